"""Dry friction in joints."""

from __future__ import annotations

from ...model import Model
from ..axis import Axis, changed, lacking

BOUNDED = ("rotate", "translate")


def dragged(model: Model, value: float) -> Model:
    """Every hinge and slide gets `value` of friction. Raises InputError without one."""
    bodies = tuple(
        changed(b, friction=tuple(value if m.kind in BOUNDED else 0.0 for m in b.sequence))
        if any(m.kind in BOUNDED for m in b.sequence)
        else b
        for b in model.bodies
    )
    if all(new is old for new, old in zip(bodies, model.bodies)):
        raise lacking("joint_friction", "friction of hinges and slides")
    return model.replace(bodies=bodies)


JOINT_FRICTION = Axis(
    "joint_friction",
    "friction of every hinge and slide",
    "N m or N",
    (0, 0.01, 0.1, 1, 3, 10),
    dragged,
)
