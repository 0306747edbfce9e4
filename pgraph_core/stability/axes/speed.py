"""Slow and fast starts."""

from __future__ import annotations

from ...model import Model
from ..axis import Axis, changed, lacking


def sped(model: Model, value: float) -> Model:
    """The largest initial velocity becomes `value`, the others in proportion.

    Where all rest, the first coordinate of the first joint that moves gets it. Raises InputError
    for a model that cannot move.
    """
    fastest = max((abs(x) for b in model.bodies for x in b.v), default=None)
    if fastest is None:
        raise lacking("speed", "initial velocities")
    if fastest == 0.0:
        mover = next(b for b in model.bodies if b.v)
        new = changed(mover, v=(float(value), *mover.v[1:]))
        return model.replace(bodies=tuple(new if b is mover else b for b in model.bodies))
    by = value / fastest
    bodies = tuple(changed(b, v=tuple(by * x for x in b.v)) if b.v else b for b in model.bodies)
    return model.replace(bodies=bodies)


SPEED = Axis(
    "speed",
    "largest initial velocity",
    "rad/s or m/s",
    (0.1, 1.0, 1e1, 1e2, 1e3, 1e4),
    sped,
)
