"""Curves, tables over time and matrices as text, and curves of another kind (pure)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

import pgraph_core as pg
from pgraph_core import joints

from ..core.cells import Display, Refusal, number, quantity
from .relations import unit_of_coordinate

KINDS = ("polynomial", "sine", "table", "expression")


def knots(value: Any) -> str:
    """Format a number, or a table over time with semicolons between its rows."""
    if not isinstance(value, (pg.Table, pg.VectorTable, dict)):
        return value if isinstance(value, str) else f"{value!r}".removesuffix(".0")
    data = value if isinstance(value, dict) else value.model_dump()
    return _lines(zip(data["t"], data["value"]))


def rows(value: Any) -> str:
    """Format a table or matrix as text. A diagonal matrix is reduced to its diagonal."""
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, (dict, pg.Lines)):
        return _lines(zip(*plain(value).values()))
    diagonal = not any(x for i, row in enumerate(value) for k, x in enumerate(row) if i != k)
    return _lines([[row[i] for i, row in enumerate(value)]] if diagonal else value)


def rows_of(old: Any, text: str) -> Any:
    """Parse the text from `rows`: a table, a matrix, or its diagonal. Raises Refusal."""
    typed = [row.replace(",", " ").split() for row in re.split("[;\\n]", text) if row.strip()]
    found = tuple(tuple(number(x) for x in row) for row in typed)
    if isinstance(old, tuple):
        return found[0] if len(found) == 1 else found
    if any(len(row) != 2 for row in found):
        raise Refusal("must be rows 'x value; x value; ...', each with two numbers")
    return {"x": tuple(x for x, _ in found), "value": tuple(y for _, y in found)} if found else None


def _lines(rows: Iterable[Iterable[Any]]) -> str:
    return "; ".join(" ".join(f"{x:g}" for x in _flat(row)) for row in rows)


def _flat(value: Any) -> list[float]:
    return [y for x in value for y in (x if isinstance(x, (tuple, list)) else (x,))]


def table_of(text: str, width: int) -> dict[str, Any]:
    """Parse a table over time from the text of `knots` or from pasted rows. Raises Refusal."""
    rows = [row for row in text.replace("\n", ";").split(";") if row.strip()]
    found = [[number(x) for x in row.replace(",", " ").split()] for row in rows]
    if not found or any(len(row) != 1 + width for row in found):
        shape = "t value" if width == 1 else "t x y z"
        raise Refusal(f"must be rows '{shape}; {shape}; ...', each with {1 + width} numbers")
    values = [row[1] if width == 1 else tuple(row[1:]) for row in found]
    return {"t": tuple(row[0] for row in found), "value": tuple(values)}


def moved(curve: Any, model: pg.Model, terms: Sequence[tuple[str, int, float]]) -> Any:
    """Return a curve of the same kind that starts at the initial value of a sum of joint
    coordinates, if all of them have a position.
    """
    start = 0.0
    for name, k, by in terms:
        body = model.body(name)
        place = dict(enumerate(joints.places(body.sequence))).get(k)
        if place is None:
            return curve
        start += by * body.q[place]
    gone = start - _start(curve)
    match curve:
        case float() | int():
            return start
        case pg.Sine():
            return {**curve.model_dump(), "mean": curve.mean + gone}
        case pg.Polynomial():
            return {**curve.model_dump(), "coefficients": (start, *curve.coefficients[1:])}
    return {**curve.model_dump(), "value": tuple(x + gone for x in curve.value)}


def moved_by(model: pg.Model, item: pg.Motion, text: str, rate: bool = False) -> float:
    """Return a coordinate, or a rate, in SI units unless it is typed as 30 deg or 1500 rpm."""
    slides = unit_of_coordinate(model, item.body, item.coordinate) == "m"
    return quantity(text, "length" if slides else "angle", Display(), rate)


def plain(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else value.model_dump()


def timed(old: Any, kind: str) -> dict[str, Any] | str:
    """Return a curve of another kind with the same initial value."""
    if kind not in KINDS:
        raise Refusal(f"must be one of {', '.join(KINDS)}")
    start = _start(old)
    if kind == "expression":
        return f"={start!r} + 0*t"
    if kind == "sine":
        return {"kind": kind, "mean": start, "amplitude": 0.5, "frequency": 1.0, "phase": 0.0}
    if kind == "polynomial":
        return {"kind": kind, "coefficients": (start, 0.0)}
    return {"t": (0.0, 1.0), "value": (start, start)}


def _start(curve: Any) -> float:
    """Return the initial value of a curve, or 0 for an expression."""
    match curve:
        case pg.Sine():
            return curve.mean + curve.amplitude * math.sin(curve.phase)
        case pg.Polynomial():
            return curve.coefficients[0]
        case str():
            return 0.0
        case float() | int():
            return curve
    return curve.value[0]


def over(old: Any, text: str) -> Any:
    """Convert a constant to a table, or a table to its first value."""
    constant = isinstance(old, tuple)
    if text == "constant":
        return old if constant else old.value[0]
    return {"t": (0.0, 1.0), "value": (old, old)} if constant else old
