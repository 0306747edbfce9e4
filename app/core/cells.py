"""Form fields: conversion between typed text and values, and the data sent to the page.

Numbers must be complete. Units and single entries of a vector or matrix can be typed separately.
Degrees and millimetres are only used on the page. Models and files contain radians and metres.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pgraph_core.model.parameters import evaluated

Quantity = Literal["angle", "length", "mass", "number"]
ARITHMETIC = re.compile(r"[\d\s.+\-*/^()eE]*(pi[\d\s.+\-*/^()eE]*)*", re.ASCII)
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
LONGEST_NAME = 100
FAR = 1e15  # [m] limit on coordinates that can be drawn
UNITS: dict[Quantity, dict[str, tuple[float, float]]] = {  # typed unit -> (times, divided by)
    "length": {"mm": (1, 1000), "cm": (1, 100), "m": (1, 1)},
    "angle": {"rad": (1, 1), "deg": (math.pi, 180), "°": (math.pi, 180)},
    "mass": {"kg": (1, 1), "g": (1, 1000), "t": (1000, 1)},
    "number": {},
}


def quantity_in(unit: str) -> Quantity:
    """Return the quantity of a unit. "length" and "angle" follow the units of the page."""
    return unit if unit in ("length", "angle") else "number"  # type: ignore[return-value]


@dataclass(frozen=True)
class Display:
    """The units and formats in which one page displays and accepts numbers."""

    angle: Literal["rad", "deg"] = "rad"
    length: Literal["m", "mm"] = "m"
    turn: Literal["quaternion", "euler", "axis"] = "quaternion"  # form of orientations
    about: Literal["com", "origin"] = "com"  # reference point of inertias

    def unit(self, quantity: Quantity) -> str:
        """Return the unit in which a quantity is displayed."""
        return {"angle": self.angle, "length": self.length}.get(quantity, "")

    def of_unit(self, unit: str) -> tuple[str, float]:
        """Convert a unit such as "rad/s" to the units of the page, and return it and its factor."""
        head, slash, rest = unit.partition("/")
        heads: dict[str, Quantity] = {"rad": "angle", "m": "length"}
        quantity = heads.get(head, "number")
        return (self.unit(quantity) or head) + slash + rest, self.shown(1.0, quantity)

    def shown(self, value: float, quantity: Quantity) -> float:
        """Convert an SI value to the page's unit, in the fewest digits that convert back to it."""
        if quantity == "length" and self.length == "mm":
            return _shortest(value * 1000, value, quantity, self)
        if quantity == "angle" and self.angle == "deg":
            return _shortest(math.degrees(value), value, quantity, self)
        return value

    def si(self, value: float, quantity: Quantity) -> float:
        """Convert a value in the page's unit to SI."""
        if quantity == "length" and self.length == "mm":
            return value / 1000
        if quantity == "angle" and self.angle == "deg":
            return math.radians(value)
        return value


def _shortest(near: float, value: float, quantity: Quantity, display: Display) -> float:
    """Find the shortest decimal that converts back to `value`: 30 deg, not 29.999999999999996."""
    rounded = (float(f"{near:.{digits}g}") for digits in (12, 14, 15, 16))
    return next((x for x in rounded if display.si(x, quantity) == value), near)


class Refusal(ValueError):
    """An error for invalid typed text, with a message for the user."""


def number(text: str) -> float:
    """Parse a typed number exactly: 1e-6 is 1e-6, 0.2/2 is 0.1. Raises Refusal."""
    typed = text.strip()
    if not NUMBER.fullmatch(typed) and typed and ARITHMETIC.fullmatch(typed):
        return _calculated(typed)
    if not NUMBER.fullmatch(typed):
        hint = "; write the decimal point as '.'" if "," in typed else " such as 0.25 or 1e-6"
        raise Refusal(f"must be a number{hint}, got {quoted(typed)}")
    value = float(typed)
    if not math.isfinite(value):
        raise Refusal(f"{quoted(typed)} is too large for a number; use less than 1.8e308")
    return value


def _calculated(typed: str) -> float:
    """Evaluate an expression of + - * / ^ and parentheses. Raises Refusal."""
    try:
        return evaluated(typed.replace("^", "**"), {})
    except ValueError as problem:
        asked, do = "is not a formula; write =thigh/2", "cannot be calculated; write it as 0.2/2"
        text = str(problem).replace(asked, do)
        raise Refusal(text) from None


def quantity(text: str, of: Quantity, display: Display, rate: bool = False) -> float:
    """Parse a typed quantity into SI. The unit of the page is used unless a unit is typed, for
    example 3 mm or 30 deg.

    A `rate` is a quantity a second, which can also be typed as 60 rpm or 5 mm/s. Raises Refusal.
    """
    typed = text.strip()
    if rate and of == "angle" and typed.endswith("rpm"):
        return number(typed.removesuffix("rpm")) * 2 * math.pi / 60
    found = _quantity(typed.removesuffix("/s") if rate else typed, of, display)
    if of == "length" and abs(found) > FAR:
        raise Refusal(f"is too long to draw; use at most {FAR:g} m, got {quoted(text.strip())}")
    return found


def _quantity(text: str, of: Quantity, display: Display) -> float:
    typed = text.strip()
    _refuse_unit_of_another(typed, of)
    unit = next((u for u in UNITS[of] if typed.endswith(u) and len(u) < len(typed)), None)
    bare = typed if unit is None else typed.removesuffix(unit).strip()
    if unit is None or not (NUMBER.fullmatch(bare) or ARITHMETIC.fullmatch(bare)):
        return display.si(number(text), of)
    times, by = UNITS[of][unit]
    return number(bare) * times / by


def _refuse_unit_of_another(typed: str, of: Quantity) -> None:
    """Reject a unit of another quantity, such as 15 deg in a length. Raises Refusal."""
    words = {
        "length": "a length",
        "angle": "an angle",
        "mass": "a mass",
        "number": "a plain number",
    }
    match = re.fullmatch(r"(.*[\d.)])\s*([a-z°]+)", typed)
    if match is None or match[2] in UNITS[of] or match[2] in ("pi", "e"):
        return
    for other, units in UNITS.items():
        if match[2] in units:
            wanted = f", in {' or '.join(UNITS[of])}" if UNITS[of] else ""
            raise Refusal(f"is {words[of]}{wanted}; {match[2]} is the unit of {words[other]}")


def content(text: str, of: Quantity, display: Display, rate: bool = False) -> float | str:
    """Parse a number into SI units, or return the formula typed instead of one. Raises Refusal."""
    return text.strip() if text.lstrip().startswith("=") else quantity(text, of, display, rate)


def whole(text: str, low: int, high: int) -> int:
    """Parse a typed integer within [low, high]. Raises Refusal."""
    typed = text.strip()
    if not re.fullmatch(r"[0-9]{1,9}", typed) or not low <= int(typed) <= high:
        raise Refusal(f"must be a whole number from {low} to {high}, got {quoted(typed)}")
    return int(typed)


def valid_name(text: str) -> str:
    """Return a typed name. Raises Refusal."""
    if len(text) > LONGEST_NAME:
        raise Refusal(f"a name has at most {LONGEST_NAME} characters, got {len(text)}")
    return text.strip()


def replaced(value: Any, index: tuple[int, ...], new: Any) -> Any:
    """Return `value` with the entry at `index` replaced by `new`."""
    if not index:
        if isinstance(value, tuple):
            raise Refusal("has several numbers; say which")
        return new
    first, *rest = index
    if not isinstance(value, (tuple, list)) or first >= len(value):
        raise Refusal("no longer has this entry")
    return (*value[:first], replaced(value[first], tuple(rest), new), *value[first + 1 :])


def quoted(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


def named_number(name: str, text: str) -> float:
    """Parse a number typed for a setting. Raises Refusal with the setting's name."""
    try:
        return number(text)
    except Refusal as refusal:
        raise Refusal(f"{name} {refusal}") from None


Payload = dict[str, Any]
XYZ = ("x", "y", "z")
WXYZ = ("w", *XYZ)


def cell(index: Sequence[int], value: Any, name: str = "", **more: Any) -> Payload:
    """Return one cell with its index in the field and its value, or None if the cell is empty.

    `name` is read and shown, a `mark` is only shown. The cell has a width of `span` out of six
    columns, or an equal share.
    """
    return {"index": list(index), "value": "" if value is None else value, "name": name, **more}


def components(cells: Iterable[Payload]) -> list[Payload]:
    """Label cells as vector x, y, z or quaternion w, x, y, z, unless they have names."""
    cells = list(cells)
    marks = {3: XYZ, 4: WXYZ}.get(len(cells), ())
    return [{"mark": mark, **c} if not c["name"] else c for c, mark in zip(cells, marks)] or cells


def shown(value: Any, quantity: Quantity, display: Display) -> Any:
    """Convert a number to the page's unit. A formula or an empty value is returned unchanged."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    return display.shown(float(value), quantity)


def field(
    name: str, label: str, cells: Iterable[Payload], *, unit: str = "", help: str = "", **more: Any
) -> Payload:
    """Return a labelled row of cells. Its `kind` is number, text, choice or names.

    If `pick` is "point" or "axis", the numbers can be picked in the 3D view. A `direction`, such as
    an axis, can be typed as a letter.
    """
    cells, pick = list(cells), more.pop("pick", "")
    if pick or more.get("direction"):
        cells = components(cells)
    columns = more.pop("columns", 2 if len(cells) == 4 else min(max(len(cells), 1), 3))
    return {
        "field": name, "label": label, "unit": unit, "help": help, "cells": cells,
        "columns": columns,
        "kind": more.pop("kind", "number"), "options": more.pop("options", None),
        "buttons": more.pop("buttons", []), "note": more.pop("note", ""),
        "pick": pick, "direction": more.pop("direction", pick == "axis"), **more,
    }  # fmt: skip


def choice(name: str, label: str, value: str, options: Iterable[Any], **more: Any) -> Payload:
    """Return a drop-down list whose options are (value, text) pairs or words."""
    pairs = [o if isinstance(o, (tuple, list)) else (o, o) for o in options]
    return field(name, label, [cell((), value)], kind="choice", options=pairs, **more)


def button(text: str, event: str, title: str = "", /, **fields: Any) -> Payload:
    """Return a button that sends an event."""
    return {"text": text, "event": event, "title": title, "fields": fields}


def group(title: str, fields: Iterable[Payload], is_open: bool = True, state: str = "") -> Payload:
    """Return fields under a collapsible title, with `state` as their summary when collapsed."""
    return {"title": title, "open": is_open, "state": state, "fields": list(fields)}


def merged(forms: Sequence[list[Payload]]) -> list[Payload]:
    """Merge several forms into one with their common fields. Cells that differ are `varied`."""
    first, *others = forms
    if not others:
        return first
    tables = [{_key(f): f for g in form for f in g["fields"]} for form in others]
    states = [{g["title"]: g["state"] for g in form} for form in others]
    found = []
    for g in first:
        fields = [
            _together(f, [table[_key(f)] for table in tables])
            for f in g["fields"] if all(_key(f) in table for table in tables)
        ]  # fmt: skip
        if fields:
            same = all(state.get(g["title"]) == g["state"] for state in states)
            found.append({**g, "fields": fields, "state": g["state"] if same else "various"})
    return found


def _key(f: Payload) -> tuple[Any, ...]:
    return (f["field"], f["kind"], tuple(tuple(c["index"]) for c in f["cells"]))


def _together(one: Payload, others: list[Payload]) -> Payload:
    cells = []
    for i, c in enumerate(one["cells"]):
        same = all(other["cells"][i]["value"] == c["value"] for other in others)
        cells.append(c if same else {**c, "value": "", "varied": True})
    units = [u for f in (one, *others) for u in f["unit"].split(", ") if u]
    unit = ", ".join(dict.fromkeys(units))
    return {**one, "cells": cells, "unit": unit, "note": "", "pick": ""}
