"""What a form sends to the page: groups of fields of cells, each typed into by itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from .cells import Display, Quantity

Payload = dict[str, Any]
XYZ = ("x", "y", "z")
WXYZ = ("w", *XYZ)


def cell(index: Sequence[int], value: Any, name: str = "", **more: Any) -> Payload:
    """One cell: where its value is in the field, and what it holds; None is an empty cell."""
    return {"index": list(index), "value": "" if value is None else value, "name": name, **more}


def shown(value: Any, quantity: Quantity, display: Display) -> Any:
    """A number in the page's unit; a formula or nothing as it is."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    return display.shown(float(value), quantity)


def field(
    name: str, label: str, cells: Iterable[Payload], *, unit: str = "", help: str = "", **more: Any
) -> Payload:
    """A row of cells with its label; `kind` is number, text, choice or names."""
    cells = list(cells)
    columns = more.pop("columns", 4 if len(cells) == 4 else min(max(len(cells), 1), 3))
    return {
        "field": name, "label": label, "unit": unit, "help": help, "cells": cells,
        "columns": columns,
        "kind": more.pop("kind", "number"), "options": more.pop("options", None),
        "buttons": more.pop("buttons", []), "note": more.pop("note", ""), **more,
    }  # fmt: skip


def choice(name: str, label: str, value: str, options: Iterable[Any], **more: Any) -> Payload:
    """A drop-down; options are (value, text) pairs or words."""
    pairs = [o if isinstance(o, (tuple, list)) else (o, o) for o in options]
    return field(name, label, [cell((), value)], kind="choice", options=pairs, **more)


def button(text: str, event: str, title: str = "", /, **fields: Any) -> Payload:
    """A button that sends an event."""
    return {"text": text, "event": event, "title": title, "fields": fields}


def group(title: str, fields: Iterable[Payload], is_open: bool = True) -> Payload:
    """Fields under a title that folds them away."""
    return {"title": title, "open": is_open, "fields": list(fields)}


def merged(forms: Sequence[list[Payload]]) -> list[Payload]:
    """One form for several things: fields that all have; cells that differ are `varied`."""
    first, *others = forms
    if not others:
        return first
    tables = [{_key(f): f for g in form for f in g["fields"]} for form in others]
    found = []
    for g in first:
        fields = [
            _together(f, [table[_key(f)] for table in tables])
            for f in g["fields"] if all(_key(f) in table for table in tables)
        ]  # fmt: skip
        if fields:
            found.append({**g, "fields": fields})
    return found


def _key(f: Payload) -> tuple[Any, ...]:
    return (f["field"], f["kind"], tuple(tuple(c["index"]) for c in f["cells"]))


def _together(one: Payload, others: list[Payload]) -> Payload:
    cells = []
    for i, c in enumerate(one["cells"]):
        same = all(other["cells"][i]["value"] == c["value"] for other in others)
        cells.append(c if same else {**c, "value": "", "varied": True})
    units = {one["unit"], *(other["unit"] for other in others)}
    return {**one, "cells": cells, "unit": ", ".join(sorted(filter(None, units))), "note": ""}
