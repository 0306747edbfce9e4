"""Measured curves: columns over time from a run, a DataFrame, a dict or a .csv file."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import InputError, PgraphError, Problem, choices, shown
from ..markup import ordinary
from ..portable import array_of
from ..result import Result
from ..result.columns import coordinates

Array = np.ndarray
PREFIXES = {"": 0, "k": 3, "c": -2, "m": -3, "u": -6, "µ": -6, "μ": -6}  # powers of ten
WITH_PREFIX = {"m": "m", "s": "s", "N": "N", "J": "N m", "g": "g", "rad": "rad"}
TIMES = ("t", "time")  # names of the column of times
OTHERS = {  # unit: factor, and units that are known
    "g": (1 / 1000, "kg"), "deg": (math.pi / 180, "rad"), "°": (math.pi / 180, "rad"),
    "degree": (math.pi / 180, "rad"), "degrees": (math.pi / 180, "rad"),
    "rpm": (math.pi / 30, "rad/s"), "rev": (2 * math.pi, "rad"), "min": (60, "s"),
}  # fmt: skip


def measured(data: Any) -> tuple[dict[str, Array], dict[str, str]]:
    """Return arrays (n,) by name, including "t", and units by name. Raises InputError.

    Of a run, the coordinates are the data. Times in another unit are converted to seconds.
    """
    if isinstance(data, Result):
        listed, _ = coordinates(data.mechanism)
        named = {f"q.{name} [{unit}]": x for (name, unit), x in zip(listed, data.q.T)}
        data = {"t": data.t, **named}
    if isinstance(data, (str, FilePath)):
        data = _read(data)
    if hasattr(data, "to_dict") and hasattr(data, "columns"):  # a DataFrame
        timed = any(str(name).partition(" [")[0] in TIMES for name in data.columns)
        table = data if timed else data.reset_index()
        data = {str(name): table[name].to_numpy() for name in table.columns}
    if not isinstance(data, Mapping):
        text = f"must be a run, a DataFrame, a dict or a .csv file, got {shown(data)}"
        raise _refused("data", text)
    found, units = dict[str, Array](), dict[str, str]()
    for name, values in data.items():
        word, _, unit = str(name).partition(" [")
        units[word] = unit.removesuffix("]")
        try:
            column = np.array(array_of(values), dtype=float)
        except (TypeError, ValueError):
            do = "; durations are numbers [s] after t / np.timedelta64(1, 's')" * (word in TIMES)
            raise _refused(f"data['{name}']", f"must be numbers, got {shown(values)}{do}") from None
        if word in TIMES:
            if (factor := factor_of(units.pop(word) or "s", "s")) is None:
                raise _refused(f"data['{name}']", "is not in a unit of time, such as s or ms")
            word, column = "t", factor * column
        found[word] = column
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
    if n < 2 or not (np.diff(t) > 0.0).all():
        raise _refused("data['t']", "must be two times or more, in ascending order")
    return found, units


def columns_in(text: str, source: str = "the text") -> dict[str, list[str]]:
    """Return {name: values} of comma-separated text. Raises InputError."""
    try:
        rows = [row for row in csv.reader(text.splitlines()) if row]
    except csv.Error as error:
        raise _refused(source, f"is not a table of comma-separated values: {error}") from None
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


# -- units -----------------------------------------------------------------------------------------


def factor_of(given: str, unit: str) -> float | None:
    """Return the factor from one unit to another, None if one is not known or of another kind.

    Units are products and quotients of words with exponents, such as "deg", "mm/s^2" and "kg m^2".
    """
    if given == unit:
        return 1.0
    parts = [_parts(text) for text in (given, unit)]
    if None in parts:
        return None
    (factor, powers), (whole, wanted) = parts  # type: ignore[misc]
    return factor / whole if powers == wanted else None


def _parts(unit: str) -> tuple[float, dict[str, int]] | None:
    """Return the factor of a unit, and the powers of the basic units in it."""
    factor, powers = 1.0, Counter[str]()
    unit = unit.replace("²", "^2").replace("·", " ")
    for sign, word, power in re.findall(r"([*/ ]*)([^\d\W]+|°|1)(?:\^(-?\d+))?", unit):
        n = (-1 if "/" in sign else 1) * int(power or 1)
        if (known := _word(word)) is None:
            return None
        factor *= known[0] ** n
        for name, count in known[1].items():
            powers[name] += n * count
    return factor, {name: count for name, count in powers.items() if count}


def _word(word: str) -> tuple[float, dict[str, int]] | None:
    if word in ("kg", "rad", "s", "m", "N", "1"):
        return 1.0, {} if word == "1" else {word: 1}
    if word in OTHERS:
        factor, unit = OTHERS[word]
    elif word[1:] in WITH_PREFIX and word[0] in PREFIXES:
        factor, unit = 10.0 ** PREFIXES[word[0]], WITH_PREFIX[word[1:]]
    elif word in WITH_PREFIX:
        factor, unit = 1.0, WITH_PREFIX[word]
    else:
        return None
    found = _parts(unit)
    assert found is not None
    return factor * found[0], found[1]
