"""What typed cells do to the model itself: its name, gravity, up, the ground (pure)."""

from __future__ import annotations

from typing import Any

import pgraph_core as pg

from ..core import cells
from ..core.cells import Refusal
from ..core.intents import Display


def world_edited(
    model: pg.Model, display: Display, field: str, index: tuple[int, ...], text: str
) -> pg.Model:
    """The model with another name, gravity, up or ground. Raises Refusal, PgraphError."""
    try:
        return _world(model, display, field, index, text)
    except Refusal as refusal:
        raise Refusal(f"The {field} {refusal}") from None


def _world(
    model: pg.Model, display: Display, field: str, index: tuple[int, ...], text: str
) -> pg.Model:
    match field:
        case "name":
            if not text.strip() or len(text) > cells.LONGEST_NAME:
                raise Refusal(
                    f"must have 1 to {cells.LONGEST_NAME} characters; given {len(text.strip())}"
                )
            return model.replace(name=text.strip())
        case "up":
            return model.replace(up=text)
        case "gravity":
            return model.replace(gravity=cells.replaced(model.gravity, index, cells.number(text)))
        case "uphill":
            level = (1.0, 0.0, 0.0) if model.up != "x" else (0.0, 1.0, 0.0)
            old = model.ground.uphill or level
            new = cells.replaced(old, index, cells.number(text)) if text.strip() else None
            return _grounded(model, uphill=new)
        case "slope":
            return _grounded(model, slope=cells.quantity(text, "angle", display))
        case "steps":
            return _grounded(model, steps=_steps(model.ground, index, text, display))
    return _grounded(model, **{field: cells.number(text)})


def _grounded(model: pg.Model, **fields: Any) -> pg.Model:
    return model.replace(ground={**model.ground.model_dump(), **fields})


def _steps(
    ground: pg.Ground, index: tuple[int, ...], text: str, display: Display
) -> tuple[Any, ...]:
    """Steps with a number typed in one, one added or one taken out."""
    steps = [step.model_dump() for step in ground.steps]
    if not index:
        far = max((s["high"][0] for s in steps), default=0.0)
        return (*steps, {"low": (far, -1.0), "high": (far + 1.0, 1.0), "height": 0.1})
    i, *rest = index
    if i >= len(steps):
        raise Refusal("has no such step any more")
    if not rest:
        return (*steps[:i], *steps[i + 1 :])
    key = ("low", "low", "high", "high", "height")[rest[0]]
    value = cells.quantity(text, "length", display)
    old = steps[i][key]
    new = value if key == "height" else cells.replaced(old, (rest[0] % 2,), value)
    return (*steps[:i], {**steps[i], key: new}, *steps[i + 1 :])
