"""The map as a heat map: SVG text that stands alone and follows the page's colours."""

from __future__ import annotations

from html import escape
from itertools import accumulate
from typing import TYPE_CHECKING

from .text import title
from .verdict import LETTER, Cell, Verdict

if TYPE_CHECKING:
    from .map import StabilityMap

WIDE, HIGH, GAP = 26, 24, 12  # of a cell, and between methods
LEFT, TOP = 84, 64
LETTER_WIDE = 6.8  # of a method's name
COLOUR = {
    Verdict.OK: "#2e9e5b",
    Verdict.INACCURATE: "#e3b341",
    Verdict.UNSTABLE: "#c2352b",
    Verdict.DAMPED: "#8d6cc9",
    Verdict.DRIFT: "#d9782d",
    Verdict.FAILED: "#5a2327",
    Verdict.SLOW: "#8a939e",
}
DARK_ON = (Verdict.INACCURATE,)  # verdicts whose colour takes a dark letter


def figure(found: StabilityMap) -> str:
    """Rows are values, groups of columns methods, columns in a group steps; a letter a cell too."""
    starts = _starts(found)
    high = TOP + len(found.values) * HIGH
    width = max(starts[-1], 640)
    parts = [_heads(found, starts), _rows(found)]
    for cell in found.cells:
        step = found.steps.index(_base(found, cell)) if found.steps else 0
        x = starts[found.methods.index(cell.method)] + step * WIDE
        parts.append(_cell(cell, x, TOP + found.values.index(cell.value) * HIGH))
    parts.append(_legend(high + 14))
    size = f'viewBox="0 0 {width:.0f} {high + 44}" width="{width:.0f}" height="{high + 44}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" '
        'font-family="system-ui, sans-serif" font-size="11">'
        f"<title>{escape(title(found))}</title>{''.join(parts)}</svg>"
    )


def _starts(found: StabilityMap) -> list[float]:
    """Where the columns of each method begin, as wide as its steps and its name; then the end."""
    widths = (max(len(found.steps) * WIDE, LETTER_WIDE * len(m)) + GAP for m in found.methods)
    return list(accumulate(widths, initial=float(LEFT)))


def _base(found: StabilityMap, cell: Cell) -> float:
    """The step as asked for: where times are scaled, that of a cell is another."""
    if cell.step in found.steps:
        return cell.step
    own = sorted({c.step for c in found.cells if c.value == cell.value})
    return sorted(found.steps)[own.index(cell.step)]


def _style(size: int, ink: str = "var(--ink, currentColor)") -> str:
    """Colour and size of a text, which the style of a page does not overrule."""
    return f"fill: {ink}; font-size: {size}px"


def _heads(found: StabilityMap, starts: list[float]) -> str:
    ink = f'style="{_style(11)}"'
    parts = [f'<text x="4" y="{TOP - 8}" {ink}>{escape(found.axis)}</text>']
    for i, name in enumerate(found.methods):
        x = starts[i]
        parts.append(f'<text x="{x}" y="{TOP - 40}" {ink}>{escape(name)}</text>')
        for j, step in enumerate(found.steps):
            at = x + j * WIDE + WIDE / 2
            parts.append(
                f'<text x="{at}" y="{TOP - 6}" style="{_style(9)}" '
                f'transform="rotate(-40 {at} {TOP - 6})">{step:g}</text>'
            )
    return "".join(parts)


def _rows(found: StabilityMap) -> str:
    return "".join(
        f'<text x="{LEFT - 8}" y="{TOP + i * HIGH + 16}" text-anchor="end" '
        f'style="{_style(11)}">{value:g}</text>'
        for i, value in enumerate(found.values)
    )


def _cell(cell: Cell, x: float, y: float) -> str:
    said = escape(
        f"{cell.method}, {cell.value:g}, step {cell.step:g} s: {cell.status}: {cell.text}"
    )
    ink = "#1b1f24" if cell.status in DARK_ON else "#ffffff"
    letter = "" if cell.status is Verdict.OK else LETTER[cell.status]
    return (
        f'<g tabindex="0"><title>{said}</title><rect x="{x:.1f}" y="{y}" width="{WIDE - 2}" '
        f'height="{HIGH - 2}" rx="3" fill="{COLOUR[cell.status]}"/>'
        f'<text x="{x + WIDE / 2 - 1:.1f}" y="{y + 15}" text-anchor="middle" '
        f'style="{_style(11, ink)}">'
        f"{letter}</text></g>"
    )


def _legend(y: float) -> str:
    parts, x = [], 4.0
    for verdict in Verdict:
        parts.append(
            f'<rect x="{x}" y="{y}" width="12" height="12" rx="2" fill="{COLOUR[verdict]}"/>'
            f'<text x="{x + 16}" y="{y + 10}" style="{_style(11)}">{verdict}</text>'
        )
        x += 24 + 7.4 * len(verdict)
    return "".join(parts)
