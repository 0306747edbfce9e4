"""The result of `work_precision`: rows, and their presentation as text, figure and page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError, counted, explained, refusal
from ..portable import jsonable
from ..tolerances import NOTABLE
from .figures import Curve, Point, Saved, aligned, duration, error_diagram
from .measures import Errors, Spread
from .task import (
    Outcome,
    Participant,
    Setting,
)

LEVELS = tuple(10.0**-k for k in range(3, 10))  # errors at which engines are compared
HEADER = (
    "method", "setting", "error", "digits", "largest", "energy", "constraints", "steps",
    "evaluations", "time", "",
)  # fmt: skip
WORDS = (0, 1, len(HEADER) - 1)  # columns that are aligned to the left

LONGER = ": give a larger `longest` or `within`"  # advice for a caller, about skipped runs
LEFT_OUT = "omitted, because it would take more than"  # beginning of the reason of a skipped run


@dataclass(frozen=True)
class Row:
    """One run in a study. Values that could not be measured are None."""

    method: str  # "rk4", or with the peer: "MuJoCo rk4"
    peer: str  # "" for ours
    step: float | None  # [s]
    rtol: float | None
    ok: bool
    reason: str  # why not, in words
    error: float | None = None  # rms
    error_max: float | None = None
    limited: bool = False  # the reference does not resolve a smaller error
    error_estimate: float | None = None  # the run's own [rad, m]
    energy_drift: float | None = None  # over the range of the energies
    constraint_drift: tuple[float, float] | None = None  # position [m, rad], velocity
    counters: Mapping[str, int] | None = None
    seconds: Spread | None = None  # [s] quartiles of the whole call, or of a peer's steps

    @classmethod
    def of(
        cls, one: Participant, setting: Setting, done: Outcome, found: Errors | None, limit: float
    ) -> Row:
        """Build the row of one run. Errors below `limit`, the reference's, are raised to it."""
        rms, largest = (None, None) if found is None else found
        limited = rms is not None and rms < limit
        return cls(
            one.name, one.peer, setting.step, setting.rtol, done.ok, done.reason,
            limit if limited else rms, largest, limited,
            _finite(done.estimate), _finite(done.energy_drift),
            done.drift if all(map(np.isfinite, done.drift)) else None,
            dict(done.counters),
        )  # fmt: skip

    @property
    def setting(self) -> Setting:
        """Step or tolerance."""
        return Setting(self.step, self.rtol)

    @property
    def digits(self) -> float | None:
        """The number of correct digits, -log10(error), or a bound at the reference's limit."""
        if self.error is None:
            return None
        return float(-np.log10(self.error)) if self.error > 0 else 17.0

    @property
    def time(self) -> float | None:
        """Median [s]."""
        return None if self.seconds is None else self.seconds[1]

    @property
    def work(self) -> int:
        """The number of evaluations of the dynamics, or 0 if unknown."""
        return (self.counters or {}).get("evaluations", 0)

    @property
    def cells(self) -> tuple[str, ...]:
        """The text of each table cell, in the order of HEADER."""
        counters, seconds, drift = self.counters or {}, self.seconds, self.constraint_drift
        return (
            self.method,
            str(self.setting),
            _format(".1e", self.error),
            self._digits,
            _format(".1e", self.error_max),
            _format(".1e", self.energy_drift),
            f"{drift[0]:.1e}" if drift and max(drift) > 0 else "",
            *(str(counters.get(name, "")) for name in ("steps", "evaluations")),
            duration(seconds[1]) if seconds else "",
            self.reason or ("reference limit" if self.limited else ""),
        )

    @property
    def _digits(self) -> str:
        if self.digits is None:
            return ""
        return f">= {self.digits:.0f}" if self.limited else f"{self.digits:.1f}"

    @property
    def point(self) -> Point:
        """The point to plot in the figure, with a tooltip."""
        low, middle, high = self.seconds or (0.0, 0.0, 0.0)
        lines = [
            f"{self.method}, {self.setting}",
            f"error {self.error:.2e}, digits {self._digits}",
            f"time {duration(middle)} ({duration(low)} .. {duration(high)})",
        ]
        if self.counters and "steps" in self.counters:
            lines.append(f"{self.counters['steps']} steps")
        if self.energy_drift is not None:
            lines.append(f"energy drift {self.energy_drift:.1e}")
        return Point(middle, self.error or 1.0, "\n".join(lines), self.limited)


@explained
@dataclass(frozen=True)
class Study(Saved):
    """Error against run time for several methods on one motion. `print(study)` shows a table."""

    name: str  # name of the model
    scenario: str | None
    t_end: float  # [s] duration of the compared motion
    frames: int  # number of compared times
    rows: tuple[Row, ...]
    reference: Mapping[str, Any]  # source, accuracy, limit
    target: float | None
    rounds: int
    machine: Mapping[str, Any]
    notes: tuple[str, ...]  # missing peers, a shortened motion, ...
    cancelled: bool = False
    asked: float = 0.0  # duration of the run that was asked about [s]

    def __str__(self) -> str:
        cells, peers = [HEADER, *(row.cells for row in self.rows)], self.peer_table()
        parts = [*self._head(), "", *aligned(cells, [i in WORDS for i in range(len(HEADER))])]
        if peers:
            parts += ["", *aligned(peers, [i < 2 for i in range(len(peers[0]))])]
        return "\n".join((*parts, "", *self._foot()))

    @property
    def methods(self) -> tuple[str, ...]:
        """The names of the curves, with our methods first."""
        return tuple(dict.fromkeys(row.method for row in self.rows))

    def of(self, method: str) -> tuple[Row, ...]:
        """Return the rows of one method that have an error and a time.

        Parameters
        ----------
        method : str
            Name of the method.
        """
        return tuple(row for row in self.rows if row.method == method and row.error and row.seconds)

    def recommend(self, target: float | None = None) -> Row:
        """Return the fastest run that is accurate enough.

        Parameters
        ----------
        target : float, optional
            Largest permitted error. The default is the target of the report.

        Raises
        ------
        InputError
            If no run is accurate enough. The message gives the smallest error.
        """
        wanted = self.target if target is None else target
        if wanted is None:
            raise refusal("recommend", "target", "give the error to reach, such as 1e-6")
        ours = [row for row in self.rows if not row.peer and row.error and row.seconds]
        fit = [row for row in ours if (row.error or np.inf) <= wanted]
        if not fit:
            raise refusal("recommend", "target", self._unmet(wanted, ours))
        return min(fit, key=lambda row: row.time or np.inf)

    def _unmet(self, wanted: float, ours: list[Row]) -> str:
        if not ours:
            return f"no method reached the end, so none reaches {wanted:g}; try smaller steps"
        best = min(ours, key=lambda row: row.error or np.inf)
        least = f"the smallest error is {best.error:.2g} by {best.method} at {best.setting}"
        return f"{self._missed(wanted, best, LONGER)}; {least}"

    def _missed(self, wanted: float, best: Row, remedy: str) -> str:
        why = ", and the reference is no better" if best.limited else ""
        cut = sum(not row.peer and row.reason.startswith(LEFT_OUT) for row in self.rows)
        counted = "1 run was" if cut == 1 else f"{cut} runs were"
        more = f"; {counted} left out{remedy}" if cut else ""
        return f"no method reaches {wanted:g}{why}{more}"

    def time_at(self, error: float) -> dict[str, float]:
        """Return the time that each method needs for an error.

        Parameters
        ----------
        error : float
            The error, in the unit of the report.

        Returns
        -------
        dict
            Seconds by method, interpolated along its curve in logarithmic scales.
        """
        found = {name: seconds_at(self.of(name), error) for name in self.methods}
        return {name: seconds for name, seconds in found.items() if np.isfinite(seconds)}

    def against_peers(self) -> list[dict[str, Any]]:
        """Return one row per error and program, with our time, its time and their ratio."""
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

    # -- for people --------------------------------------------------------------------------------

    def _head(self) -> tuple[str, ...]:
        """Return the header lines: the comparison, the reference and the machine."""
        scenario = f", scenario {self.scenario}" if self.scenario else ""
        known = self.reference
        return (
            f"{self.name}{scenario}: error against run time over {self.t_end:.6g} s at "
            f"{self.frames} times",
            f"reference        {known['source']}, accurate to {known['accuracy']:.1e}; errors "
            f"below {known['limit']:.1e} are not resolved",
            f"machine          {self.machine['cpu']}, one thread, "
            f"minima of {self.rounds} rounds, processor time of whole calls",
        )

    def _foot(self) -> tuple[str, ...]:
        """Return the footer: recommendation and notes."""
        return (
            f"recommended      {self.answer}",
            *(f"note             {line}" for line in self.notes),
            *(["CANCELLED: rows that were not measured are missing"] if self.cancelled else []),
        )

    def advised(self) -> Row | None:
        """Return the fastest run that meets the target (default 1e-6), or the most accurate one.

        None if no run reached the end time.
        """
        try:
            return self.recommend(NOTABLE if self.target is None else self.target)
        except InputError:
            ours = [row for row in self.rows if not row.peer and row.error and row.seconds]
            return min(ours, key=lambda row: row.error or np.inf, default=None)

    @property
    def answer(self) -> str:
        """A sentence that recommends a method and setting, or explains why it cannot."""
        return self.said(remedy=LONGER)

    def said(self, label: Callable[[str], str] = str, remedy: str = "") -> str:
        """Return `answer`, with methods named by `label` and with `remedy` if runs were skipped."""
        if not self.cancelled:
            return self._answer(label, remedy)
        measured = sum(bool(row.error and row.time) for row in self.rows)
        if not measured:
            return "Cancelled before any run was measured."
        return f"Cancelled after {counted(measured, 'run')}. {self._answer(label, remedy)}"

    def _answer(self, label: Callable[[str], str], remedy: str) -> str:
        row, wanted = self.advised(), NOTABLE if self.target is None else self.target
        if row is None:
            why = next((each.reason for each in self.rows if each.reason), "none was measured")
            return f"No method reached the end: {why}."
        took = duration(row.time or 0.0)
        error = f"error {'at most ' if row.limited else ''}{row.error:.1e}"
        text = f"Take {label(row.method)} at {row.setting}: {error} in {took}"
        if self.t_end < self.asked * (1 - 1e-9):
            text += f", judged over the first {self.t_end:.4g} s of {self.asked:.4g} s"
        if (row.error or np.inf) <= wanted:
            return f"{text}."
        return f"{text}; {self._missed(wanted, row, remedy)}."

    def peer_table(self) -> list[list[str]]:
        """Return a header and rows for times at equal error, or [] if there are no peers."""
        found = self.against_peers()
        if not found:
            return []
        names = list(dict.fromkeys(row["peer"] for row in found))
        cells = [["at equal error", "ours", "time", *names]]
        for level in dict.fromkeys(row["error"] for row in found):
            mine = {row["peer"]: row for row in found if row["error"] == level}
            ours = next(iter(mine.values()))
            theirs = (
                f"{duration(mine[n]['peer_seconds'])} ({mine[n]['ratio']:.3g} x)"
                if n in mine
                else "-"
                for n in names
            )
            cells.append([f"{level:.0e}", ours["ours"], duration(ours["seconds"]), *theirs])
        return cells

    def figure(self) -> str:
        """Return the figure as standalone SVG text."""
        curves = []
        for name in self.methods:
            rows = self.of(name)
            points = [row.point for row in rows]
            curves.append(Curve(name, points, dashed=bool(rows and rows[0].peer)))
        label = f"error against run time of {self.name}"
        titles = "run time of a whole call (processor)", "error of the position, rms, without unit"
        limit = self.reference["limit"]
        return error_diagram(label, curves, titles, limit=limit, target=self.target)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with None for numbers that are not finite."""
        data, row = asdict(self), self.advised()
        data["rows"] = [asdict(each) | {"digits": each.digits} for each in self.rows]
        found = {"against_peers": self.against_peers(), "answer": self.answer}
        return jsonable(data | found | {"recommended": row and self.rows.index(row)})


def seconds_at(rows: tuple[Row, ...], error: float) -> float:
    """Compute the minimum time in which a curve reaches an error, or inf if it never does."""
    points = [(row.error or np.inf, row.time or np.inf) for row in rows]
    found = [seconds for reached, seconds in points if reached <= error]
    for (e0, s0), (e1, s1) in pairwise(points):
        if e1 < error < e0:
            part = np.log(e0 / error) / np.log(e0 / e1)
            found.append(float(s0 * (s1 / s0) ** part))
    return min(found, default=np.inf)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _format(how: str, value: float | None) -> str:
    return "" if value is None else format(value, how)
