"""Cells of a curve's track: points or functions as text, and typed text as an edit."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

import pgraph_core as pg

from ..core.cells import Display, Refusal, content, shown

FUNCTIONS = ("x", "y", "z")
FLAG = ("no", "yes")  # texts of false and true
HELP = {
    "track_points": "points that the curve joins, three numbers each, parted by ;",
    "track_up": "direction that z of the body keeps while x points along the curve; empty: no turn",
    "track_angles": "functions of q for rotations, parted by ,",
} | {
    f"track_{n}": f"{n} as a number, a function of q, or pairs of q and {n}, or triples with its "
    "slope, parted by ;"
    for n in FUNCTIONS
}
NUMBERS = re.compile(r"[\s,]+")


def begun(body: pg.Body) -> dict[str, Any]:
    """Return the track of a new curve: an arc in the plane of x and z, as long as the body."""
    size = max(float(np.linalg.norm(body.tip_point)), float(np.linalg.norm(body.link)), 0.5)
    points = ((0.0, 0.0, 0.0), (0.5 * size, 0.0, -0.25 * size), (size, 0.0, 0.0))
    return {"track": pg.Track(points=points)}


def rows(track: pg.Track, display: Display) -> list[tuple[str, str, str]]:
    """Return (field, label, text) of every row."""
    if track.points:
        points = "; ".join(" ".join(_length(x, display) for x in p) for p in track.points)
        up = "" if track.up is None else " ".join(f"{x:g}" for x in track.up)
        return [("track_points", "Points", points), ("track_up", "Up", up)]
    found = [(f"track_{n}", n, _text(getattr(track, n))) for n in FUNCTIONS]
    angles = [_text(f) for f in track.angles]
    return [*found, ("track_angles", "Angles", ", ".join(angles))]


def _length(x: float, display: Display) -> str:
    return f"{shown(x, 'length', display):.10g}"


def _text(function: Any) -> str:
    if isinstance(function, tuple):
        return "; ".join(" ".join(f"{x + 0.0:.10g}" for x in row) for row in function)
    return function if isinstance(function, str) else f"{function + 0.0:.10g}"


def edit_of(body: pg.Body, field: str, text: str, display: Display) -> dict[str, Any]:
    """Return the track with what was typed into a row. Raises Refusal, ModelError."""
    if body.track is None:
        raise Refusal("has no track; its joint is no curve")
    return {"track": changed(body.track, field, text, display)}


def changed(track: pg.Track, field: str, text: str, display: Display) -> pg.Track:
    """Return a track with what was typed into a row. Raises Refusal, ModelError."""
    match name := field.removeprefix("track_"):
        case "points":
            value: Any = _rows(text, 3, "length", display)
        case "up":
            value = _rows(text, 3, "number", display)[0] if text.strip() else None
        case "closed":
            value = text == FLAG[True]
        case "angles":
            value = tuple(_function(f, display) for f in text.split(",") if f.strip())
        case _:
            value = _function(text, display)
    return pg.Track(**(track.model_dump(exclude_unset=True) | {name: value}))


def _rows(text: str, count: int, quantity: Any, display: Display) -> tuple[Any, ...]:
    found = []
    for row in text.strip(" ;").split(";"):
        parts = NUMBERS.split(row.strip())
        if len(parts) != count:
            raise Refusal(f"takes {count} numbers a row, rows parted by ;, got {row.strip()!r}")
        found.append(tuple(content(part, quantity, display) for part in parts))
    return tuple(found)


def _function(text: str, display: Display) -> Any:
    text = text.strip().removeprefix("=")
    if ";" in text:
        first = NUMBERS.split(text.split(";")[0].strip())
        return _rows(text, 3 if len(first) == 3 else 2, "number", display)
    try:
        return float(text)
    except ValueError:
        return text
