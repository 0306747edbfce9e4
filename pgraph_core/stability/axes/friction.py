"""Coulomb's coefficient of contacts, from ice to glue."""

from __future__ import annotations

from ...model import Model
from ..axis import Axis, lacking


def roughened(model: Model, value: float) -> Model:
    """Every contact gets the coefficient `value`. Raises InputError without contacts."""
    if not model.contacts:
        raise lacking("friction", "contacts")
    return model.replace(
        contacts=tuple(c.model_copy(update={"friction": float(value)}) for c in model.contacts)
    )


FRICTION = Axis(
    "friction",
    "Coulomb's coefficient of all contacts",
    "",
    (0, 0.01, 0.1, 0.3, 0.5, 1, 3, 10),
    roughened,
)
