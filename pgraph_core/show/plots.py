"""Columns over time as a matplotlib figure or as a pandas table.

Columns are named arrays, units in brackets, time first: "t [s]", "q knee 0 [rad]", "paw Fz [N]".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np

from ..errors import InputError, Problem, choices, needed

TIME = "t [s]"


def frame(columns: Mapping[str, np.ndarray]) -> Any:
    """A pandas.DataFrame with a row per frame, its index the time [s]. Needs pandas."""
    pandas = needed("pandas", "pandas")
    return pandas.DataFrame(dict(columns)).set_index(TIME)


def figure(columns: Mapping[str, np.ndarray], names: Sequence[str] = (), title: str = "") -> Any:
    """A matplotlib figure with a panel per unit. Needs matplotlib.

    Each name is a column, or how one begins: "kinetic energy", "v knee", "paw Fz"; a body stands
    for its coordinates q; no names: all coordinates. Raises InputError naming the closest columns.
    """
    picked = picked_columns(columns, names)
    panels: dict[str, list[str]] = {}
    for name in picked:
        panels.setdefault(unit_of(name), []).append(name)
    pyplot = needed("matplotlib.pyplot", "plot")
    drawn, axes = pyplot.subplots(
        len(panels), sharex=True, squeeze=False, layout="constrained",
        figsize=(7.0, 1.2 + 2.0 * len(panels)),
    )  # fmt: skip
    for axis, (unit, members) in zip(axes[:, 0], panels.items()):
        for name in members:
            axis.plot(columns[TIME], columns[name], label=name.removesuffix(f" [{unit}]"))
        axis.set_ylabel(f"[{unit}]")
        axis.grid(alpha=0.3)
        if len(members) <= 12:
            axis.legend(fontsize="small")
    axes[-1, 0].set_xlabel(TIME)
    if title:
        drawn.suptitle(title)
    if pyplot.get_backend().lower() == "agg" or "inline" in pyplot.get_backend():
        pyplot.close(drawn)  # a notebook shows what is returned, and once is enough
    return drawn


def picked_columns(columns: Mapping[str, np.ndarray], names: Sequence[str]) -> list[str]:
    """The columns that are meant by `names`, each once, in the order asked for."""
    if not names:
        return [column for column in columns if column.startswith("q ")]
    found = [column for name in names for column in _meant(columns, name)]
    return list(dict.fromkeys(found))


def _meant(columns: Mapping[str, np.ndarray], name: str) -> list[str]:
    known = [column for column in columns if column != TIME]
    for start in (f"q {name}", name):
        found = [c for c in known if c == start or c.startswith(f"{start} ")]
        if found:
            return found
    short = {re.sub(r"( \d+)? \[.*\]$", "", c).removeprefix("q "): c for c in known}
    close = get_close_matches(name, short, n=6, cutoff=0.4) or list(short)
    text = f"no column begins so; choose one of {choices(close)}"
    raise InputError(Problem(f"plot '{name}'", "", text))


def unit_of(column: str) -> str:
    """The text in the brackets at the end of a column's name, "1" if there is none."""
    found = re.search(r"\[([^\]]*)\]$", column)
    return found[1] if found else "1"
