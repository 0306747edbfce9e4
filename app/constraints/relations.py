"""The curves of relations: their texts, and those of another kind (pure)."""

from __future__ import annotations

import re
from typing import Any

import pgraph_core as pg
from pgraph_core.signals import is_expression

from ..core.cells import Display, Quantity, Refusal, number, quantity
from ..pose.solving import degrees

KINDS = ("natural", "clamped", "periodic", "quintic", "hermite", "polynomial", "expression")
QUANTITIES: dict[str, Quantity] = {"rad": "angle", "m": "length", "": "number"}


def unit_of_coordinate(model: pg.Model, body: str, coordinate: int) -> str:
    """Return the unit of a coordinate of a joint, or "" if there is none."""
    joint = degrees(model.body(body)) if body in model.row else []
    return joint[coordinate][1] if coordinate < len(joint) else ""


def ends_of(item: pg.Relation | pg.Cam) -> tuple[tuple[str, int], tuple[str, int]]:
    """Return (body, coordinate) of what a relation follows, and of what it moves."""
    return (item.other, item.other_coordinate), (item.body, item.coordinate)


def quantities(model: pg.Model, item: pg.Relation | pg.Cam) -> tuple[Quantity, Quantity]:
    """Return the quantities of what a relation follows, and of what it moves."""
    x, value = (unit_of_coordinate(model, *end) for end in ends_of(item))
    return QUANTITIES[x], QUANTITIES[value]


def kind_of(curve: pg.Curve | pg.Polynomial | str) -> str:
    """Return the kind of the curve of a relation, one of `KINDS`."""
    return "expression" if isinstance(curve, str) else curve.kind


def written(model: pg.Model, item: pg.Relation, display: Display) -> str:
    """Format the curve of a relation as text, with its points in the units of the page."""
    if isinstance(item.curve, pg.Polynomial):
        return " ".join(map(short, item.curve.coefficients))
    if isinstance(item.curve, pg.Curve):
        of = (*quantities(model, item), "number")
        points = zip(*_columns(item.curve))
        return "; ".join(
            " ".join(short(display.shown(x, each)) for x, each in zip(point, of))
            for point in points
        )
    return item.curve


def short(x: float) -> str:
    """Format a number in the fewest digits that give it back."""
    return f"{x + 0.0!r}".removesuffix(".0")


def curve_of(model: pg.Model, item: pg.Relation, text: str, display: Display) -> Any:
    """Parse the curve of a relation from the text of `written`. Raises Refusal."""
    if is_expression(text):
        return text.strip()
    if isinstance(item.curve, pg.Polynomial):
        powers = tuple(map(number, text.replace(",", " ").split()))
        return {"kind": "polynomial", "coefficients": powers}
    rows = [row.replace(",", " ").split() for row in re.split("[;\\n]", text) if row.strip()]
    kind = item.curve.kind if isinstance(item.curve, pg.Curve) else "natural"
    names = ("x", "value", "slope") if kind == "hermite" else ("x", "value")
    if any(len(row) != len(names) for row in rows):
        shown = f"'{' '.join(names)}; {' '.join(names)}; ...'"
        slopes = (" 1", " 0.5", " 0") if kind == "hermite" else ("", "", "")
        points = zip(("0 0", "90deg 12mm", "180deg 20mm"), slopes)
        raise Refusal(f"must be rows {shown}, as {'; '.join(x + y for x, y in points)}")
    of: tuple[Quantity, ...] = (*quantities(model, item), "number")
    columns = [tuple(quantity(x, u, display) for x in column) for u, column in zip(of, zip(*rows))]
    return {**dict(zip(names, columns)), "kind": kind}


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
    found = {"x": x, "value": value, "kind": kind}
    if kind == "hermite":
        found["slope"] = slopes_of(old) if points else (1.0, 1.0)
    return found


def slopes_of(curve: pg.Curve) -> tuple[float, ...]:
    """Return the slopes of a curve at its points."""
    places, powers, *_ = curve.pieces
    slopes = dict(zip(places.tolist(), powers[1].tolist()))
    if curve.x[-1] not in slopes:  # a periodic function
        slopes[curve.x[-1]] = slopes[curve.x[0]]
    return tuple(slopes[x] for x in curve.x)


def _columns(curve: pg.Curve) -> tuple[tuple[float, ...], ...]:
    return (curve.x, curve.value, *((curve.slope,) if curve.slope else ()))
