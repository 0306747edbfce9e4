"""The smooth muscle of De Groote et al. (2016), Ann Biomed Eng 44, 2922-2936."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..signals import Node
from ..signals.grammar import filled
from .model import Array, Curves, MuscleModel, Smooth

# height, centre, width and its slope of three bells, eq. (S2), with the digits that OpenSim gives
# them, so that the sum is 1 at the optimal length
BELLS = (
    (0.8150671134243542, 1.055033428970575, 0.162384573599574, 0.063303448465465),
    (0.433004984392647, 0.716775413397760, -0.029947116970696, 0.200356847296188),
    (0.1, 1.0, 0.353553390593274, 0.0),
)
# d1 to d4 of the force over speed, eq. (S4), so that it is 0 at -1 and 1 at 0
SPEED = (-0.3211346127989808, -8.149, -0.374, 0.8825327733249912)


def activation(a: Node, u: Node, rise: Node, fall: Node, shape: Mapping[str, float]) -> Node:
    """Return the rate whose time constant changes smoothly with the direction, eqs. (1), (2)."""
    steep = Node("number", value=2.0 * shape["steepness"])  # twice the b of eq. (2)
    share = filled("1/(1 + exp(-k*(u - a)))", k=steep, u=u, a=a)
    z = filled("0.5 + 1.5*a", a=a)
    by = filled("f/(rise*z) + (1 - f)*z/fall", f=share, rise=rise, fall=fall, z=z)
    return filled("by*(u - a)", by=by, u=u, a=a)


def curves(shape: Mapping[str, float]) -> Curves:
    """Return the curves, eqs. (S1) to (S4)."""
    strain, width, k = shape["passive_strain"], shape["active_width"], shape["passive_shape"]
    shortest, c, share = shape["shortest"], shape["tendon_toe"], shape["passive_force"]
    shift = math.exp(k * (shortest - 1.0) / strain)
    d1, d2, d3, d4 = SPEED
    # so that the strain at the largest isometric force is the given one
    stiffness = math.log((1.0 + c) / c) / shape["tendon_strain"]

    def active(_: int, x: Array) -> Array:
        x = (x - 1.0) / width + 1.0
        return sum(
            (h * np.exp(-0.5 * ((x - c) / (w + s * x)) ** 2) for h, c, w, s in BELLS), 0.0 * x
        )

    def passive(_: int, x: Array) -> Array:
        return share * (np.exp(k * (x - 1.0) / strain) - shift) / (math.exp(k) - shift)

    def velocity(_: int, x: Array) -> Array:
        return d1 * np.arcsinh(d2 * x + d3) + d4

    def tendon(piece: int, x: Array) -> Array:
        """Return eq. (S1), which is negative below the slack length, where no tendon pushes."""
        return c * np.expm1(stiffness * (x - 1.0)) if piece else 0.0 * x

    return Curves(
        Smooth((shortest, 0.5, 1.0, 1.5, 2.5), active, parts=24),
        Smooth((shortest, 1.0, 2.0), passive, parts=16),
        Smooth((-2.0, -0.5, -0.25, 0.0, 0.25, 0.5, 2.0), velocity, parts=16),
        Smooth((0.9, 1.0, 1.0 + 3.0 * shape["tendon_strain"]), tendon, parts=24),
    )


MODEL = MuscleModel(
    about="De Groote 2016: smooth curves, for optimisation",
    shape={
        "active_width": 1.0, "passive_strain": 0.6, "passive_shape": 4.0, "tendon_strain": 0.049,
        "tendon_toe": 0.2, "shortest": 0.2, "passive_force": 1.0, "steepness": 0.1,
    },
    curves=curves,
    activation=activation,
    rise=0.015,
    fall=0.06,
    fastest=10.0,
    damping=0.01,
    least=0.2,
)  # fmt: skip
