"""Displacements and ranges of points of paths as text in cells (pure).

A displacement is "shank (1 0 0) -2 0.01; -1 0.03": the body of the joint, a vector, and points of a
curve (coordinate, value and, with three numbers, slope) or "polynomial" with its coefficients.
Several are separated by "|". A range is "shank -0.8 0.2". "shank.1" is coordinate 1 of a joint with
several.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import pgraph_core as pg

from ..core.cells import Refusal

SHIFT = re.compile(r"\s*(?P<body>.+?)\s*\((?P<along>[^()]*)\)\s*(?P<curve>[^()]*)")
SAYS = "write the body of the joint, a vector and points, such as shank (1 0 0) -2 0.01; -1 0.03"
POLYNOMIAL = "polynomial"


def text_of_shifts(shifts: Sequence[pg.Shift]) -> str:
    """Return displacements as text."""
    found = list[str]()
    for one in shifts:
        curve: Any = one.curve
        if isinstance(curve, pg.Polynomial):
            rows = " ".join([POLYNOMIAL, *map(_shown, curve.coefficients)])
        else:
            columns = (curve.x, curve.value, *([curve.slope] if curve.slope else []))
            rows = "; ".join(" ".join(map(_shown, row)) for row in zip(*columns))
            rows = rows if curve.kind in ("natural", "hermite") else f"{curve.kind} {rows}"
        along = " ".join(map(_shown, one.along))
        found.append(f"{_named(one)} ({along}) {rows}")
    return " | ".join(found)


def shifts_of(model: pg.Model, text: str) -> tuple[dict[str, Any], ...]:
    """Return displacements from text. Raises Refusal."""
    return tuple(_shift(model, one) for one in text.split("|") if one.strip())


def text_of_range(when: pg.Within | None) -> str:
    """Return a range as text."""
    return "" if when is None else f"{_named(when)} {_shown(when.low)} {_shown(when.high)}"


def range_of(model: pg.Model, text: str) -> dict[str, Any]:
    """Return a range from text. Raises Refusal."""
    name, *ends = text.rsplit(maxsplit=2)
    if len(ends) != 2:
        raise Refusal("write the body of the joint and two numbers, such as shank -0.8 0.2")
    low, high = map(_number, ends)
    return {**_coordinate(model, name), "low": low, "high": high}


def _shift(model: pg.Model, text: str) -> dict[str, Any]:
    if (found := SHIFT.fullmatch(text)) is None:
        raise Refusal(SAYS)
    kind, rows = "", found["curve"].strip()
    if rows[:1].isalpha():
        kind, _, rows = rows.partition(" ")
    numbers = [tuple(map(_number, row.split())) for row in rows.split(";") if row.strip()]
    along = tuple(map(_number, found["along"].split()))
    if kind == POLYNOMIAL:
        curve: dict[str, Any] = {"kind": kind, "coefficients": numbers[0] if numbers else ()}
    elif {len(row) for row in numbers} in ({2}, {3}):
        names = ("x", "value", "slope")
        curve = dict(zip(names, zip(*numbers)))
        curve["kind"] = kind or ("hermite" if "slope" in curve else "natural")
    else:
        raise Refusal(SAYS)
    return {**_coordinate(model, found["body"]), "along": along, "curve": curve}


def _coordinate(model: pg.Model, text: str) -> dict[str, Any]:
    """Return the body and the index of a coordinate, which may stand behind a point."""
    name, known = text.strip(), {body.name for body in model.bodies}
    body, point, k = name.rpartition(".")
    if name in known or not point or not k.isdigit():
        return {"body": name, "coordinate": 0}
    return {"body": body, "coordinate": int(k)}


def _named(one: Any) -> str:
    return f"{one.body}.{one.coordinate}" if one.coordinate else str(one.body)


def _shown(x: float) -> str:
    """Return the shortest text of a number that has all its digits."""
    return repr(x).removesuffix(".0")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise Refusal(f"'{text}' is no number; {SAYS}") from None
