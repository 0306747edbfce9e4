"""The curves of relations: their texts, and those of another kind (pure)."""

from __future__ import annotations

import re
from typing import Any

import pgraph_core as pg
from pgraph_core.signals import is_expression

from ..core.cells import Display, Refusal, number, quantity
from ..pose.solving import degrees

KINDS = ("natural", "clamped", "periodic", "quintic", "polynomial", "expression")


def unit_of_coordinate(model: pg.Model, body: str, coordinate: int) -> str:
    """Return the unit of a coordinate of a joint, or "" if there is none."""
    joint = degrees(model.body(body)) if body in model.row else []
    return joint[coordinate][1] if coordinate < len(joint) else ""


def ends_of(item: pg.Relation) -> tuple[tuple[str, int], tuple[str, int]]:
    """Return (body, coordinate) of what a relation follows, and of what it moves."""
    return (item.other, item.other_coordinate), (item.body, item.coordinate)


def kind_of(curve: pg.Curve | pg.Polynomial | str) -> str:
    """Return the kind of the curve of a relation, one of `KINDS`."""
    return "expression" if isinstance(curve, str) else curve.kind


def written(curve: pg.Curve | pg.Polynomial | str) -> str:
    """Format the curve of a relation as text, with semicolons between its points."""
    if isinstance(curve, pg.Polynomial):
        return " ".join(f"{x:.12g}" for x in curve.coefficients)
    if isinstance(curve, pg.Curve):
        return "; ".join(f"{x:.12g} {y:.12g}" for x, y in zip(curve.x, curve.value))
    return curve


def curve_of(model: pg.Model, item: pg.Relation, text: str) -> Any:
    """Parse the curve of a relation from the text of `written`. Raises Refusal."""
    if is_expression(text):
        return text.strip()
    if isinstance(item.curve, pg.Polynomial):
        powers = tuple(map(number, text.replace(",", " ").split()))
        return {"kind": "polynomial", "coefficients": powers}
    rows = [row.replace(",", " ").split() for row in re.split("[;\\n]", text) if row.strip()]
    if any(len(row) != 2 for row in rows):
        raise Refusal("must be rows 'x value; x value; ...', as 0 0; 90deg 12mm; 180deg 20mm")
    slides = [unit_of_coordinate(model, *end) == "m" for end in ends_of(item)]
    columns = [
        tuple(quantity(x, "length" if slide else "angle", Display()) for x in column)
        for slide, column in zip(slides, zip(*rows))
    ]
    kind = item.curve.kind if isinstance(item.curve, pg.Curve) else "natural"
    return {**dict(zip(("x", "value"), columns)), "kind": kind}


def rekinded(old: Any, kind: str) -> Any:
    """Return a curve of another kind, with the same points if both have points."""
    if kind not in KINDS:
        raise Refusal(f"must be one of {', '.join(KINDS)}")
    if kind == kind_of(old):
        return old
    if kind == "expression":
        return "=q"
    if kind == "polynomial":
        return {"kind": kind, "coefficients": (0.0, 1.0)}
    points = isinstance(old, pg.Curve)
    x, value = (old.x, old.value) if points else ((0.0, 1.0), (0.0, 1.0))
    if kind == "periodic" and len(x) == 2:
        x, value = (x[0], 0.5 * (x[0] + x[1]), x[1]), (value[0], value[1], value[0])
    return {"x": x, "value": value, "kind": kind}
