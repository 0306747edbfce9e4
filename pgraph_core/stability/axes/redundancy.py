"""The same constraint said again and again."""

from __future__ import annotations

from ...errors import InputError, Problem
from ...model import Model
from ..axis import Axis, lacking


def repeated(model: Model, value: float) -> Model:
    """Every active constraint is there 1 + value times; raises InputError without one."""
    active = [c for c in model.constraints if c.active]
    if not active:
        raise lacking("redundancy", "active constraints")
    if value != int(value) or value < 0:
        text = f"of redundancy must be whole numbers >= 0; given {value:g}"
        raise InputError(Problem("stability_map", "values", text))
    copies = tuple(
        c.model_copy(update={"name": f"{c.name} again {i + 1}"})
        for i in range(int(value))
        for c in active
    )
    return model.replace(constraints=(*model.constraints, *copies))


REDUNDANCY = Axis(
    "redundancy", "copies of every active constraint", "copies", (0, 1, 2, 5), repeated
)
