"""Differences between the models and settings of compared runs (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import about
from pgraph_core.model.checks import PARTS
from pgraph_core.model.scenario import METHOD_NAMES
from pgraph_core.model.world import World

from . import Run

MOST = 12  # rows
LONGEST = 40  # characters of a value
SI = {"length": "m", "angle": "rad"}


def differences(runs: Sequence[Run]) -> list[list[str]]:
    """Return rows (name, value for each run) of the settings and fields in which runs differ."""
    asked = [run.request for run in runs]
    rows = [
        ["method", *(METHOD_NAMES[one.method] for one in asked)],
        ["step", *("auto" if one.step is None else f"{one.step:g} s" for one in asked)],
        ["tolerance", *("auto" if one.rtol is None else f"{one.rtol:g}" for one in asked)],
    ]
    found = [row for row in rows if len(set(row[1:])) > 1]
    models = [run.model for run in runs]
    if any(model is not models[0] for model in models):
        found += _of_fields(World, "", models)
        for part in PARTS:
            found += _of_parts(part, models)
    if len(found) <= MOST + 1:
        return found
    return [*found[:MOST], [f"{len(found) - MOST} more differences", *("" for _ in runs)]]


def _of_parts(part: str, models: Sequence[pg.Model]) -> list[list[str]]:
    """Return the rows of all parts of one kind, matched by name."""
    named = [{one.name: one for one in getattr(model, part)} for model in models]
    found = []
    for name in dict.fromkeys(name for parts in named for name in parts):
        each = [parts.get(name) for parts in named]
        if all(one is each[0] for one in each):
            continue
        if None in each or len({type(one) for one in each}) > 1:
            found.append(
                [name, *("none" if one is None else type(one).__name__.lower() for one in each)]
            )
        else:
            found += _of_fields(type(each[0]), f"{name}: ", each)
    return found


def _of_fields(kind: Any, owner: str, each: Sequence[Any]) -> list[list[str]]:
    """Return the rows of the fields of one part, or of the world."""
    found = []
    for name, info in kind.model_fields.items():
        values = [getattr(one, name) for one in each]
        if all(value == values[0] for value in values):
            continue
        known = about(info, name)
        unit = SI.get(known.unit, known.unit)
        label = f"{owner}{known.label.lower()}" + (f" [{unit}]" if unit else "")
        found.append([label, *map(_text, values)])
    return found


def _text(value: Any) -> str:
    """Return a value as short text; one that is no number, text or array of numbers has none."""
    if value is None or isinstance(value, (str, bool)):
        text = "none" if value is None else str(value)
    else:
        try:
            text = ", ".join(f"{x:.4g}" for x in np.ravel(np.asarray(value, float)))
        except (TypeError, ValueError):
            text = "other"
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"
