"""A study: error against run time of many methods on one motion."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..errors import FileError, InputError, Problem
from ..model.files import write_atomic
from ..portable import Portable
from . import figure, text
from .rows import Row

LEVELS = tuple(10.0**-k for k in range(3, 10))  # errors at which sides are compared


@dataclass(frozen=True)
class Study(Portable):
    """Rows, and what a person has to know to read them; `print(study)` is a table."""

    SUFFIXES: ClassVar[tuple[str, ...]] = (".html", ".json", ".svg", ".txt")  # of files

    name: str  # of the model
    scenario: str | None
    t_end: float  # [s] of the compared motion
    frames: int  # times at which it was compared
    rows: tuple[Row, ...]
    orders: Mapping[str, tuple[float | None, float]]  # (observed, nominal)
    reference: Mapping[str, Any]  # source, accuracy, limit
    baseline: int | None  # the row that ratios are relative to
    target: float | None
    rounds: int
    clock: str  # that the times are by: "wall" or "processor"
    timing: Mapping[str, float]  # seconds of the study's parts
    machine: Mapping[str, Any]
    left_out: tuple[str, ...]  # what the scene did not need
    notes: tuple[str, ...]  # peers that are missing, methods that cannot take the scene, ...
    cancelled: bool = False

    def __str__(self) -> str:
        return text.table(self)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the curves, ours first."""
        return tuple(dict.fromkeys(row.method for row in self.rows))

    def of(self, method: str) -> tuple[Row, ...]:
        """The rows of one curve that have an error and a time."""
        return tuple(row for row in self.rows if row.method == method and row.error and row.seconds)

    def recommend(self, target: float | None = None) -> Row:
        """The cheapest of our runs whose error is at most `target`.

        Raises InputError where none is, with the best that was reached.
        """
        wanted = self.target if target is None else target
        if wanted is None:
            text = "give the error that is wanted, such as 1e-6"
            raise InputError(Problem("recommend", "target", text))
        ours = [row for row in self.rows if not row.peer and row.error and row.seconds]
        fit = [row for row in ours if (row.error or np.inf) <= wanted]
        if not fit:
            raise InputError(Problem("recommend", "target", self._unmet(wanted, ours)))
        return min(fit, key=lambda row: row.time or np.inf)

    def _unmet(self, wanted: float, ours: list[Row]) -> str:
        if not ours:
            return f"no method reached the end, so none reaches {wanted:g}; try smaller steps"
        best = min(ours, key=lambda row: row.error or np.inf)
        reached = f"no method reaches {wanted:g}; the best is {best.error:.2g} by {best.method}"
        why = ", the reference's own limit" if best.limited else ""
        return f"{reached} at {best.setting}{why}"

    def time_at(self, error: float) -> dict[str, float]:
        """{method: seconds} that each curve takes to an error, between its points log-log."""
        found = {name: seconds_at(self.of(name), error) for name in self.methods}
        return {name: seconds for name, seconds in found.items() if np.isfinite(seconds)}

    def against_peers(self) -> list[dict[str, Any]]:
        """A row an error and peer: our seconds, theirs, and how many times longer they take."""
        peers = {row.method for row in self.rows if row.peer}
        found = []
        for level in LEVELS:
            at = self.time_at(level)
            ours = {name: s for name, s in at.items() if name not in peers}
            if not ours:
                continue
            best = min(ours, key=lambda name: ours[name])
            for name in sorted(peers & at.keys()):
                row = {"error": level, "ours": best, "seconds": ours[best], "peer": name}
                found.append(row | {"peer_seconds": at[name], "ratio": at[name] / ours[best]})
        return found

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as JSON takes them."""
        data = {name: getattr(self, name) for name in self.__dataclass_fields__}
        data["rows"] = [row.to_dict() for row in self.rows]
        for name in ("orders", "reference", "timing", "machine"):
            data[name] = dict(data[name])
        return data | {"against_peers": self.against_peers(), "recommended": self._recommended()}

    def _recommended(self) -> int | None:
        try:
            return self.rows.index(self.recommend())
        except InputError:
            return None

    def to_json(self) -> str:
        """One JSON object, under the names of this class."""
        return json.dumps(_plain(self.to_dict()), allow_nan=False)

    def figure(self, *, narrow: bool = False) -> str:
        """The diagram as SVG, which takes the colours of the page it stands in; `narrow`: for a
        column beside other things."""
        paper = figure.narrow(len(self.methods)) if narrow else figure.wide()
        return figure.diagram(self, paper)

    def html(self) -> str:
        """The report as one page."""
        from .document import document

        return document(self)

    def save(self, path: str | Path, /) -> None:
        """Write the page (.html), the data (.json), the diagram (.svg) or the table (.txt).

        Raises FileError.
        """
        kinds = dict(zip(self.SUFFIXES, (self.html, self.to_json, self.figure, self.__str__)))
        suffix = Path(path).suffix.lower()
        if suffix not in kinds:
            kind = suffix or "no ending"
            words = f"a report is written as {', '.join(self.SUFFIXES)}; given {kind!r}"
            raise FileError(Problem(str(path), "", words))
        write_atomic(path, kinds[suffix]())


def seconds_at(rows: tuple[Row, ...], error: float) -> float:
    """Least time of a curve to come to an error; inf where it does not. Rows in ladder order."""
    points = [(row.error or np.inf, row.time or np.inf) for row in rows]
    found = [seconds for reached, seconds in points if reached <= error]
    for (e0, s0), (e1, s1) in pairwise(points):
        if e1 < error < e0:
            part = np.log(e0 / error) / np.log(e0 / e1)
            found.append(float(s0 * (s1 / s0) ** part))
    return min(found, default=np.inf)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
