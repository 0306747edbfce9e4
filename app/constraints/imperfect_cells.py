"""Cells of the imperfections of a sensor: sampling, delay, noise, drift, resolution and range."""

from __future__ import annotations

from typing import Any

import pgraph_core as pg
from pgraph_core.fields import about
from pgraph_core.model.output import READINGS

from ..core.cells import Payload, Refusal, cell, field, group, number, whole

PREFIX = "imperfect_"
MOST = 999_999_999  # largest seed that can be typed
FIELDS = pg.Imperfect.model_fields
EXACT = "exact: give a time between samples for samples with noise, delay and range"


def grouped(item: pg.Output) -> Payload:
    """Return the form of the imperfections of an output, folded where it is exact."""
    now = item.imperfect
    rows = []
    for name in FIELDS if now else ["sample"]:
        shows, value = about(FIELDS[name], name), getattr(now, name, None)
        rows.append(
            field(PREFIX + name, shows.label, [cell((), value)], unit=_unit(item, name),
                  help=shows.help, note="" if now else EXACT)
        )  # fmt: skip
    state = f"every {now.sample:g} s" if now else "none"
    return group("Imperfections", rows, now is not None, state)


def _unit(item: pg.Output, name: str) -> str:
    """Return the unit of a field, where "unit" stands for that of the output."""
    _, _, named = (FIELDS[name].description or "").partition("[")
    return named.rstrip("]").replace("unit", READINGS[item.kind].unit)


def changed(now: pg.Imperfect | None, of: str, text: str) -> dict[str, Any] | None:
    """Return the fields of imperfections after a text was typed into the cell `of`.

    An empty text is the default. Without a time between samples a sensor is exact. Raises Refusal.
    """
    name = of.removeprefix(PREFIX)
    if now is None and name != "sample":
        raise Refusal("needs a time between samples first")
    data = {} if now is None else now.model_dump(exclude_defaults=True)
    data.pop(name, None)
    if text.strip():
        data[name] = whole(text, 0, MOST) if name == "seed" else number(text)
    return data if "sample" in data else None
