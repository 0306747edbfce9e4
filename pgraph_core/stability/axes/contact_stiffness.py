"""Contacts that give way, from rubber to rock."""

from __future__ import annotations

from ...model import Model
from ..axis import Axis, lacking


def hardened(model: Model, value: float) -> Model:
    """Every soft or penalty contact gets `value`. Raises InputError without one."""
    if not any(c.law != "complementarity" for c in model.contacts):
        raise lacking("contact_stiffness", "contacts of law 'soft' or 'penalty'")
    return model.replace(
        contacts=tuple(
            c if c.law == "complementarity" else c.model_copy(update={"stiffness": float(value)})
            for c in model.contacts
        )
    )


CONTACT_STIFFNESS = Axis(
    "contact_stiffness",
    "stiffness of soft and penalty contacts",
    "N/m^1.5 or N/m",
    (1e3, 1e4, 1e5, 1e6, 1e7, 1e8),
    hardened,
)
