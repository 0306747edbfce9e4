"""The map as text: a letter a cell, and a sentence for each kind of trouble."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .verdict import LETTER, MEANING, Cell, Verdict

if TYPE_CHECKING:
    from .map import StabilityMap


def text(found: StabilityMap) -> str:
    """Rows are values, columns methods with a letter a step; then what the letters mean."""
    letters = {(c.value, c.method, c.step): LETTER[c.status] for c in found.cells}
    widest = max(len(_short(v)) for v in found.values)
    head = f"{'':{widest}}"
    lines = [title(found), "", head]
    per = len(found.steps) or 1
    for name in found.methods:
        lines[-1] += f"  {name:{per}}"
    by_row: dict[float, list[Cell]] = {}
    for cell in found.cells:
        by_row.setdefault(cell.value, []).append(cell)
    for value in found.values:
        line = f"{_short(value):{widest}}"
        for name in found.methods:
            own = [c for c in by_row.get(value, ()) if c.method == name]
            marks = "".join(letters[c.value, c.method, c.step] for c in own)
            line += f"  {marks:{max(per, len(name))}}"
        lines.append(line.rstrip())
    return "\n".join([*lines, "", *legend(found), "", *findings(found)]).rstrip()


def title(found: StabilityMap) -> str:
    """What was varied, over how long, against which target."""
    unit = f" [{found.unit}]" if found.unit else ""
    steps = ", ".join(f"{s:g}" for s in found.steps)
    each = f"; steps {steps} s from left to right" if found.steps else ""
    return (
        f"{found.model}: {found.what}{unit}, {found.t_end:g} s, errors up to {found.target:g} "
        f"rad or of the length are OK{each}"
    )


def legend(found: StabilityMap) -> list[str]:
    """The letters that occur."""
    there = {cell.status for cell in found.cells}
    lines = [f"{LETTER[v]}  {v:11} {MEANING[v]}" for v in Verdict if v in there]
    return lines if found.complete else [*lines, "cancelled: these are the cells that were done"]


def findings(found: StabilityMap) -> list[str]:
    """The first cell of each method and verdict but OK, in words, and how many are like it."""
    groups: dict[tuple[str, Verdict], list[Cell]] = {}
    for cell in found.cells:
        if cell.status is not Verdict.OK:
            groups.setdefault((cell.method, cell.status), []).append(cell)
    return [_finding(cells, found.axis) for cells in groups.values()]


def _finding(cells: list[Cell], axis: str) -> str:
    first = cells[0]
    where = f"{axis} {_short(first.value)}, step {first.step:g} s"
    more = f" ({len(cells)} cells)" if len(cells) > 1 else ""
    return f"{first.method} {first.status}{more}, as at {where}: {first.text}"


def _short(value: float) -> str:
    return f"{value:g}"
