"""The muscle of MuJoCo, whose tendon is rigid.

Its length range and its range of lengths are l_opt and l_slack here: the fibre is (path length -
l_slack) / l_opt long.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..signals import Node
from ..signals.grammar import filled
from .model import Array, Curves, MuscleModel, Smooth


def activation(a: Node, u: Node, rise: Node, fall: Node, shape: Mapping[str, float]) -> Node:
    """Return the rate of `mju_muscleDynamics`, whose time constant changes over `smoothing`."""
    a, u = filled("min(max(a, 0), 1)", a=a), filled("min(max(u, 0), 1)", u=u)
    z = filled("0.5 + 1.5*a", a=a)
    by = {"a": a, "u": u, "z": z, "rise": rise, "fall": fall}
    tau = filled("if(u > a, rise*z, fall/z)", **by)
    if shape["smoothing"]:
        width = Node("number", value=shape["smoothing"])
        x = filled("min(max((u - a)/width + 0.5, 0), 1)", u=u, a=a, width=width)
        share = filled("x*x*x*(10 + x*(6*x - 15))", x=x)
        tau = filled("fall/z + (rise*z - fall/z)*share", **by, share=share)
    return filled("(u - a)/tau", u=u, a=a, tau=tau)


def curves(shape: Mapping[str, float]) -> Curves:
    """Return FL, FP and FV of the documentation of MuJoCo."""
    low, high = shape["shortest"], shape["longest"]
    middle = 0.5 * (low + 1.0), 0.5 * (high + 1.0)
    most, passive_force = shape["lengthening"], shape["passive_force"]
    if not low < 1.0 < high:
        raise ValueError("needs shortest < 1 < longest")

    def active(piece: int, x: Array) -> Array:
        rise, fall = middle[0] - low, high - middle[1]
        by = (
            0.5 * ((x - low) / rise) ** 2,
            1.0 - 0.5 * ((1.0 - x) / (1.0 - middle[0])) ** 2,
            1.0 - 0.5 * ((x - 1.0) / (middle[1] - 1.0)) ** 2,
            0.5 * ((high - x) / fall) ** 2,
        )
        return by[piece]

    def passive(piece: int, x: Array) -> Array:
        x = (x - 1.0) / (middle[1] - 1.0)
        return (0.0 * x, passive_force * 0.5 * x * x, passive_force * (x - 0.5))[piece]

    def velocity(piece: int, v: Array) -> Array:
        y = most - 1.0
        return ((v + 1.0) ** 2, most - (y - v) ** 2 / y, 0.0 * v + most)[piece]

    return Curves(
        Smooth((low, middle[0], 1.0, middle[1], high), active, parts=1),
        Smooth((0.0, 1.0, middle[1], high), passive, parts=1),
        Smooth((-1.0, 0.0, most - 1.0, most), velocity, parts=1),
        None,
    )


MODEL = MuscleModel(
    about="the muscle of MuJoCo, with a rigid tendon",
    shape={
        "shortest": 0.5,
        "longest": 1.6,
        "lengthening": 1.2,
        "passive_force": 1.3,
        "smoothing": 0.0,
    },
    curves=curves,
    activation=activation,
    rise=0.01,
    fall=0.04,
    fastest=1.5,
    weakest=0.0,
)
