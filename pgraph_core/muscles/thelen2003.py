"""The muscle of Thelen (2003), J Biomech Eng 125, 70-77, as OpenSim continues it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..signals import Node
from ..signals.grammar import filled
from .model import Array, Curves, MuscleModel, Smooth


def activation(a: Node, u: Node, rise: Node, fall: Node, _: Mapping[str, float]) -> Node:
    """Return the rate with a time constant that depends on the direction, eqs. (1) and (2)."""
    z = filled("0.5 + 1.5*a", a=a)
    tau = filled("if(u > a, rise*z, fall/z)", a=a, u=u, z=z, rise=rise, fall=fall)
    return filled("(u - a)/tau", u=u, a=a, tau=tau)


def curves(shape: Mapping[str, float]) -> Curves:
    """Return the curves, eqs. (3) to (7)."""
    e0, k = shape["passive_strain"], shape["passive_shape"]

    def active(_: int, x: Array) -> Array:
        return np.exp(-((x - 1.0) ** 2) / shape["active_width"])

    def passive(piece: int, x: Array) -> Array:
        return np.expm1(k * (x - 1.0) / e0) / math.expm1(k) if piece else 0.0 * x

    fibre = Smooth((0.0, 1.0, 2.0, 3.0), active, parts=24)
    parallel = Smooth((0.5, 1.0, 1.0 + 2.0 * e0), passive, parts=24)
    return Curves(fibre, parallel, _velocity(shape), _tendon(shape))


def _velocity(shape: Mapping[str, float]) -> Smooth:
    """Return f_v, the inverse of eq. (6) over the speed, with eq. (7)."""
    af, most, share = shape["shortening"], shape["lengthening"], shape["followed"]
    slow = 2.0 + 2.0 / af

    def value(piece: int, v: Array) -> Array:
        if piece == 0:
            return (1.0 + v) / (1.0 - v / af)
        by = slow / (most - 1.0) * v
        return (1.0 + by * most) / (1.0 + by)

    last = share * most  # the largest force to which the hyperbola is followed
    fastest = (last - 1.0) * (most - 1.0) / (slow * (most - last))
    places = (-1.0, 0.0, fastest)
    return Smooth(places, value, parts=48)


def _tendon(shape: Mapping[str, float]) -> Smooth:
    """Return f_t, whose curved part ends with the slope of its line."""
    strain, k, force = shape["tendon_strain"], shape["toe_shape"], shape["toe_force"]
    # the strain there, by which both slopes are equal
    toe = strain / (1.0 + (1.0 - force) / force * -math.expm1(-k) / k)

    def value(piece: int, x: Array) -> Array:
        if piece == 0:
            return 0.0 * x
        if piece == 1:
            return force * np.expm1(k * (x - 1.0) / toe) / math.expm1(k)
        return force + (1.0 - force) / (strain - toe) * (x - 1.0 - toe)

    return Smooth((0.5, 1.0, 1.0 + toe, 1.0 + 2.0 * strain), value)


MODEL = MuscleModel(
    about="Thelen 2003: exponentials and hyperbolas, as in OpenSim",
    shape={
        "active_width": 0.45, "passive_strain": 0.6, "passive_shape": 5.0, "shortening": 0.25,
        "lengthening": 1.4, "followed": 0.95, "tendon_strain": 0.04, "toe_force": 0.33,
        "toe_shape": 3.0,
    },
    curves=curves,
    activation=activation,
    rise=0.015,
    fall=0.05,
    fastest=10.0,
    speed=(0.25, 0.75),
)  # fmt: skip
