"""Starts ever nearer to a singular position, for a model whose initial state is one."""

from __future__ import annotations

from ...model import Model
from ..axis import Axis, changed, lacking

ONE = ("rotate", "translate")


def moved_away(model: Model, value: float) -> Model:
    """The first hinge or slide starts `value` further on. Raises InputError without one."""
    mover = next((b for b in model.bodies if b.sequence and b.sequence[0].kind in ONE), None)
    if mover is None:
        raise lacking("singularity", "the first hinge or slide")
    new = changed(mover, q=(mover.q[0] + value, *mover.q[1:]))
    return model.replace(bodies=tuple(new if b is mover else b for b in model.bodies))


SINGULARITY = Axis(
    "singularity",
    "distance of the first joint from its initial position",
    "rad or m",
    (0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2),
    moved_away,
)
