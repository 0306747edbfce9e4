"""The result of `stability_map`: cells, and how a person reads them as text, figure and page."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import FileError, Problem, choices, explained
from ..model.files import write_atomic
from ..portable import Hinting
from .page import Section, Square, escape, heat_map, page, table
from .report import plain
from .verdicts import Cell, Verdict

OWN = "◂"  # marks the model's own value
COLUMN = 470.0  # width of a narrow figure [px]
LOOK = {  # letter of the text map, colour and ink of the figure, meaning
    Verdict.OK: (".", "#2e9e5b", "#ffffff", "as accurate as asked for"),
    Verdict.INACCURATE: ("i", "#e3b341", "#1b1f24", "bounded, but not as accurate as asked for"),
    Verdict.UNSTABLE: ("U", "#c2352b", "#ffffff", "the method makes the motion grow"),
    Verdict.DAMPED: ("d", "#8d6cc9", "#ffffff", "the method takes energy that the model conserves"),
    Verdict.DRIFT: ("D", "#d9782d", "#ffffff", "constraints drift"),
    Verdict.FAILED: ("F", "#5a2327", "#ffffff", "the run ended early, or was refused"),
    Verdict.SLOW: ("s", "#8a939e", "#ffffff", "more steps than the budget allows"),
}
HEADER = ("value", "method", "step [s]", "verdict", "error", "order", "evaluations", "why")


@explained
@dataclass(frozen=True)
class StabilityMap(Hinting):
    """A verdict on each value of the axis, method and step; `print` shows it as text."""

    model: str  # name
    axis: str
    what: str  # meaning of a value
    unit: str
    values: tuple[float, ...]
    methods: tuple[str, ...]
    steps: tuple[float, ...]  # [s]; empty if the values are the steps
    t_end: float  # [s]
    target: float  # largest error that is OK
    references: tuple[str, ...]  # of each value
    cells: tuple[Cell, ...]
    complete: bool = True  # False: it was cancelled, and these are the cells so far
    own: float | None = None  # the value of the model as it is, if it is among them

    def __str__(self) -> str:
        per = len(self.steps) or 1
        widest = max(len(self._label(v)) for v in self.values)
        head = "".join(f"  {name:{per}}" for name in self.methods)
        lines = [self.title, "", f"{'':{widest}}{head}"]
        for value in self.values:
            line = f"{self._label(value):{widest}}"
            for name in self.methods:
                own = (c for c in self.cells if (c.value, c.method) == (value, name))
                line += f"  {''.join(LOOK[c.status][0] for c in own):{max(per, len(name))}}"
            lines.append(line.rstrip())
        text = [*lines, "", *self._legend(), "", self.advice, "", *self.findings()]
        return "\n".join(text).rstrip()

    def _label(self, value: float) -> str:
        return f"{value:g} {OWN}" if value == self.own else f"{value:g}"

    @property
    def advice(self) -> str:
        """The method and step to take, in a sentence.

        Right for the model as it is, then at most values, then the cheapest.
        """
        right: dict[tuple[str, float], list[Cell]] = {}
        for cell in self.cells:
            if cell.status is Verdict.OK:
                width = self.steps[self._column(cell)] if self.steps else cell.step
                right.setdefault((cell.method, width), []).append(cell)
        if not right:
            failed = [cell for cell in self.cells if cell.status is Verdict.FAILED]
            if failed and len(failed) == len(self.cells):
                return f"No method reaches the end: {failed[0].text}."
            return "No method is as accurate as asked for at any of these steps: give smaller ones."
        for_own = {k: v for k, v in right.items() if any(c.value == self.own for c in v)}
        chosen = for_own or right
        count = max(len(cells) for cells in chosen.values())
        (method, step), cells = min(
            (item for item in chosen.items() if len(item[1]) == count),
            key=lambda item: sum(cell.evaluations for cell in item[1]),
        )
        if not self.steps:
            return f"Take {method} at a step of {step:g} s."
        axis, values = self.axis.replace("_", " "), [cell.value for cell in cells]
        where = f"all values of {axis}"
        if count < len(self.values):
            where = f"{count} of {len(self.values)} values of {axis}, "
            where += f"{min(values):g} to {max(values):g}"
        text = f"Take {method} at a step of {step:g} s: as accurate as asked for at {where}"
        if for_own and self.own is not None:
            return f"{text}, this model's own {self.own:g} among them."
        if self.own is not None:
            return f"{text}; at this model's own {self.own:g} give smaller steps."
        return f"{text}."

    @property
    def title(self) -> str:
        """What was varied, over which duration, to which target."""
        unit = f" [{self.unit}]" if self.unit else ""
        steps = ", ".join(f"{s:g}" for s in self.steps)
        each = f"; steps {steps} s from left to right" if self.steps else ""
        return (
            f"{self.model}: {self.what}{unit}, {self.t_end:g} s, errors up to {self.target:g} "
            f"rad or of the length are OK{each}"
        )

    def _legend(self) -> list[str]:
        """The letters that occur."""
        there = {cell.status for cell in self.cells}
        lines = [f"{LOOK[v][0]}  {v:11} {LOOK[v][3]}" for v in Verdict if v in there]
        if self.own is not None:
            lines.append(f"{OWN}  the model as it is")
        return lines if self.complete else [*lines, "cancelled: only the finished cells are here"]

    def findings(self) -> list[str]:
        """For each method and verdict other than OK: the first cell in words, and their number."""
        groups: dict[tuple[str, Verdict], list[Cell]] = {}
        for cell in self.cells:
            if cell.status is not Verdict.OK:
                groups.setdefault((cell.method, cell.status), []).append(cell)
        found = []
        for (method, status), cells in groups.items():
            where = f"{self.axis} {cells[0].value:g}, step {cells[0].step:g} s"
            more = f" ({len(cells)} cells)" if len(cells) > 1 else ""
            found.append(f"{method} {status}{more}, as at {where}: {cells[0].text}")
        return found

    def figure(self, *, narrow: bool = False) -> str:
        """A heat map as an SVG text that stands alone; `narrow`: for a column."""
        squares = []
        for c in self.cells:
            letter, colour, ink, _ = LOOK[c.status]
            letter = "" if c.status is Verdict.OK else letter
            text = f"{c.method}, {c.value:g}, step {c.step:g} s: {c.status}: {c.text}"
            place = self.values.index(c.value), self.methods.index(c.method), self._column(c)
            squares.append(Square(*place, colour, ink, letter, text))
        values, steps = [self._label(x) for x in self.values], [f"{x:g} s" for x in self.steps]
        legend = [(str(v), LOOK[v][1]) for v in Verdict]
        axis = self.axis.replace("_", " ") + (f" [{self.unit}]" if self.unit else "")
        if self.own is not None:
            axis += f"; {OWN}: the model as it is"
        wide = COLUMN if narrow else math.inf
        return heat_map(self.title, axis, values, self.methods, steps, squares, legend, wide)

    def _column(self, cell: Cell) -> int:
        """The index of the requested step: where times are scaled, that of a cell is another."""
        if not self.steps or cell.step in self.steps:
            return self.steps.index(cell.step) if self.steps else 0
        own = sorted({c.step for c in self.cells if c.value == cell.value})
        return self.steps.index(sorted(self.steps)[own.index(cell.step)])

    def sections(self) -> list[Section]:
        """The parts of a page: figure and findings, then every cell in words."""
        lines = "".join(f"<li>{escape(line)}</li>" for line in self.findings())
        head = f"<p>{escape(self.title)}</p><p>{escape(self.advice)}</p>"
        first = f"{head}{self.figure()}<ul>{lines}</ul>"
        known = "".join(
            f"<li>{value:g}: {escape(text)}</li>"
            for value, text in zip(self.values, self.references)
        )
        rows = (
            (
                f"{c.value:g}", c.method, f"{c.step:g}", str(c.status), f"{c.error:.1e}",
                f"{c.order:.1f}", str(c.evaluations), c.text,
            )
            for c in self.cells
        )  # fmt: skip
        cells = f"<p>Compared with:</p><ul>{known}</ul>{table(HEADER, rows)}"
        return [Section(self.axis, first), Section(f"{self.axis}: every cell", cells)]

    def html(self) -> str:
        """The map as one page."""
        return maps_page([self])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as JSON takes them; numbers that are not finite are None."""
        return plain(vars(self) | {"cells": [asdict(cell) for cell in self.cells]})

    def to_json(self) -> str:
        """One JSON object."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def save(self, path: str | Path, /) -> None:
        """Write a page (.html), the figure (.svg) or the numbers (.json). Raises FileError."""
        kinds = {".html": self.html, ".svg": self.figure, ".json": self.to_json}
        suffix = Path(path).suffix.lower()
        if suffix not in kinds:
            text = f"must end in {choices(kinds)}; given {suffix!r}"
            raise FileError(Problem(str(path), "", text))
        write_atomic(path, kinds[suffix]())


def maps_page(maps: Sequence[StabilityMap]) -> str:
    """Several maps of one model as one page."""
    name = maps[0].model if maps else ""
    return page(f"Stability of {name}", [part for each in maps for part in each.sections()])
