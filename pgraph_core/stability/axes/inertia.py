"""Bodies as thin as needles, or as large as wheels."""

from __future__ import annotations

from ...model import Model
from ..axis import Axis, changed, lacking


def spread(model: Model, value: float) -> Model:
    """Every body's inertia about its centre of mass times `value`; masses stay.

    Raises InputError for a model of point masses.
    """
    if not any(any(map(any, body.inertia)) for body in model.bodies):
        raise lacking("inertia", "inertia about centres of mass")
    bodies = tuple(
        changed(b, inertia=tuple(tuple(value * x for x in row) for row in b.inertia))
        for b in model.bodies
    )
    return model.replace(bodies=bodies)


INERTIA = Axis(
    "inertia", "factor on every inertia", "", (1e-15, 1e-9, 1e-6, 1e-3, 1.0, 1e1, 1e3), spread
)
