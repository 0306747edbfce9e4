"""The map as a heat map: SVG text that stands alone and follows the page's colours."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from .text import title
from .verdict import LETTER, Cell, Verdict

if TYPE_CHECKING:
    from .map import StabilityMap

WIDE, HIGH, GAP = 26, 24, 12  # of a cell, and between methods
LEFT, TOP = 84, 64
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
    per = max(len(found.steps), 1)
    group = per * WIDE + GAP
    name_width = max(len(m) for m in found.methods) * 7.2 if per == 1 else 0
    group = max(group, name_width + GAP)
    width = LEFT + len(found.methods) * group
    high = TOP + len(found.values) * HIGH
    parts = [_heads(found, group), _rows(found)]
    for cell in found.cells:
        column = found.methods.index(cell.method)
        step = found.steps.index(_base(found, cell)) if found.steps else 0
        x = LEFT + column * group + step * WIDE
        parts.append(_cell(cell, x, TOP + found.values.index(cell.value) * HIGH))
    parts.append(_legend(high + 14))
    size = f'viewBox="0 0 {width:.0f} {high + 44}" width="{width:.0f}" height="{high + 44}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" '
        'font-family="system-ui, sans-serif" font-size="11">'
        f"<title>{escape(title(found))}</title>{''.join(parts)}</svg>"
    )


def _base(found: StabilityMap, cell: Cell) -> float:
    """The step as asked for: where times are scaled, that of a cell is another."""
    if cell.step in found.steps:
        return cell.step
    own = sorted({c.step for c in found.cells if c.value == cell.value})
    return sorted(found.steps)[own.index(cell.step)]


def _heads(found: StabilityMap, group: float) -> str:
    ink = 'fill="var(--ink, currentColor)"'
    parts = [f'<text x="4" y="{TOP - 8}" {ink}>{escape(found.axis)}</text>']
    for i, name in enumerate(found.methods):
        x = LEFT + i * group
        parts.append(f'<text x="{x}" y="{TOP - 40}" {ink} font-weight="600">{escape(name)}</text>')
        for j, step in enumerate(found.steps):
            at = x + j * WIDE + WIDE / 2
            parts.append(
                f'<text x="{at}" y="{TOP - 6}" {ink} text-anchor="start" '
                f'transform="rotate(-40 {at} {TOP - 6})" font-size="9">{step:g}</text>'
            )
    return "".join(parts)


def _rows(found: StabilityMap) -> str:
    return "".join(
        f'<text x="{LEFT - 8}" y="{TOP + i * HIGH + 16}" text-anchor="end" '
        f'fill="var(--ink, currentColor)">{value:g}</text>'
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
        f'<text x="{x + WIDE / 2 - 1:.1f}" y="{y + 15}" text-anchor="middle" fill="{ink}">'
        f"{letter}</text></g>"
    )


def _legend(y: float) -> str:
    parts, x = [], 4.0
    for verdict in Verdict:
        parts.append(
            f'<rect x="{x}" y="{y}" width="12" height="12" rx="2" fill="{COLOUR[verdict]}"/>'
            f'<text x="{x + 16}" y="{y + 10}" fill="var(--ink, currentColor)">{verdict}</text>'
        )
        x += 24 + 7.4 * len(verdict)
    return "".join(parts)
