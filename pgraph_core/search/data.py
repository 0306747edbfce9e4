"""Measured curves: columns over time from a DataFrame, a dict or a .csv file."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import InputError, PgraphError, Problem, choices, shown
from ..markup import ordinary

Array = np.ndarray


def measured(data: Any) -> tuple[dict[str, Array], dict[str, str]]:
    """Return {name: (n,)} with "t", and units by name. Raises InputError."""
    if isinstance(data, (str, FilePath)):
        data = _read(data)
    if hasattr(data, "to_dict") and hasattr(data, "columns"):  # a DataFrame
        table = data if "t" in [*data.columns] else data.reset_index()
        data = {str(name): table[name].to_numpy() for name in table.columns}
    if not isinstance(data, Mapping):
        raise _refused("data", f"must be a DataFrame, a dict or a .csv file, got {shown(data)}")
    found, units = dict[str, Array](), dict[str, str]()
    for name, values in data.items():
        word, _, unit = str(name).partition(" [")
        units[word] = unit.removesuffix("]")
        if word in ("t", "time") and units[word] not in ("", "s"):
            raise _refused(f"data['{name}']", f"is in {units[word]}: convert it to s")
        try:
            found["t" if word in ("t", "time") else word] = np.array(values, dtype=float)
        except (TypeError, ValueError):
            raise _refused(f"data['{name}']", "must be numbers") from None
    if "t" not in found or len(found) < 2:
        text = f"needs a column t of times [s] and others, got {choices(found) or 'none'}"
        raise _refused("data", text)
    n = len(found["t"])
    for name, values in found.items():
        if values.shape != (n,):
            text = f"has shape {values.shape}, and t has {n} numbers"
            raise _refused(f"data['{name}']", text)
        if len(bad := np.flatnonzero(~np.isfinite(values))):
            text = f"row {bad[0]} is {values[bad[0]]}: leave out rows without a number"
            raise _refused(f"data['{name}']", text)
    t = found["t"]
    if n < 2 or t[0] < 0.0 or not (np.diff(t) > 0.0).all():
        raise _refused("data['t']", "must be two times or more, ascending from 0 s on")
    return found, units


def columns_in(text: str, source: str = "the text") -> dict[str, list[str]]:
    """Return {name: values} of comma-separated text. Raises InputError."""
    rows = [row for row in csv.reader(text.splitlines()) if row]
    if len(rows) < 2:
        raise _refused(source, "needs a line of names and lines of numbers")
    width = len(rows[0])
    for n, row in enumerate(rows):
        if len(row) != width:
            raise _refused(source, f"row {n} has {len(row)} entries, and the first has {width}")
    return {name.strip("'\" "): [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}


def _read(path: str | FilePath) -> dict[str, list[str]]:
    try:
        with ordinary(path) as file:
            text = file.read().decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise _refused(str(path), f"cannot be read: {error}") from None
    return columns_in(text, str(path))


def _refused(what: str, text: str) -> PgraphError:
    return InputError(Problem("fit", what, text))
