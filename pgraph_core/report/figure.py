"""The diagram: error over run time, both logarithmic, one curve a method; SVG drawn by us."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from .html import escape, series_colour
from .rows import Row
from .text import digits, duration

if TYPE_CHECKING:
    from .study import Study

LEFT, TOP, FOOT, LEGEND = 72.0, 16.0, 48.0, 22.0  # borders, and the height of a legend's line
INK, MUTED, LINE, SHADE = (
    f"var(--{name}, {colour})"
    for name, colour in (
        ("ink", "currentColor"),
        ("muted", "#7a838e"),
        ("line", "#88929e66"),
        ("shade", "#88929e22"),
    )
)
MARKS = (  # within a circle of radius 1
    "M-1,0A1,1,0,1,1,1,0A1,1,0,1,1,-1,0Z",
    "M-.9,-.9H.9V.9H-.9Z",
    "M0,-1.2L1.1,.8H-1.1Z",
    "M0,-1.3L1.1,0L0,1.3L-1.1,0Z",
    "M0,1.2L1.1,-.8H-1.1Z",
    "M-1.1,-.35H-.35V-1.1H.35V-.35H1.1V.35H.35V1.1H-.35V.35H-1.1Z",
    "M-1,-1H1L0,0L1,1H-1L0,0Z",
    "M-1.2,0L.8,-1.1V1.1Z",
)


class Paper(NamedTuple):
    """Where the diagram lies on the paper, and its legend: at the right, or in lines below."""

    width: float
    height: float
    right: float  # end of the time axis
    bottom: float  # end of the error axis
    columns: int  # of a legend below; 0: at the right


def wide() -> Paper:
    """For a page of its own."""
    return Paper(900.0, 520.0, 690.0, 472.0, 0)


def narrow(methods: int) -> Paper:
    """For a column of 400 to 500 pixels, in which the text stays legible."""
    lines = math.ceil(methods / 2)
    return Paper(480.0, 350.0 + FOOT + lines * LEGEND, 470.0, 350.0, 2)


class Axes(NamedTuple):
    """Decades that are shown, and where they lie on the paper."""

    paper: Paper
    time: tuple[int, int]  # exponents of the seconds at left and right
    error: tuple[int, int]  # exponents of the errors at bottom and top

    def x(self, seconds: float) -> float:
        """Place of a time."""
        low, high = self.time
        return LEFT + (math.log10(seconds) - low) / (high - low) * (self.paper.right - LEFT)

    def y(self, error: float) -> float:
        """Place of an error."""
        low, high = self.error
        bottom = self.paper.bottom
        return bottom - (math.log10(error) - low) / (high - low) * (bottom - TOP)


def diagram(study: Study, paper: Paper) -> str:
    """The figure as SVG; of a study without one point a figure that says so."""
    rows = [row for row in study.rows if row.error and row.seconds]
    label = f"error against run time of {study.name}"
    open_, close = (
        '<svg xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {paper.width:g} {paper.height:g}" '
        f'aria-label="{escape(label)}" font-family="system-ui, sans-serif" font-size="12">',
        "</svg>",
    )
    if not rows:
        return f"{open_}{_text(LEFT, 40, 'no run reached the end', anchor='start')}{close}"
    axes = _axes(paper, rows)
    parts = [_limit(axes, study), _grid(axes), _target(axes, study)]
    for i, name in enumerate(study.methods):
        parts.append(_curve(axes, study, name, i))
    return open_ + "".join(parts) + _legend(paper, study) + close


def _axes(paper: Paper, rows: list[Row]) -> Axes:
    times = [row.time or 1.0 for row in rows]
    found = [min(row.error or 1.0, 1e3) for row in rows]
    return Axes(paper, _decades(times), _decades(found))


def _decades(values: list[float]) -> tuple[int, int]:
    low = math.floor(math.log10(min(values)) - 0.05)
    high = math.ceil(math.log10(max(values)) + 0.05)
    return low, max(high, low + 1)


def _grid(axes: Axes) -> str:
    bottom, right = axes.paper.bottom, axes.paper.right
    parts = []
    for k in range(axes.time[0], axes.time[1] + 1):
        x = axes.x(10.0**k)
        parts.append(_line(x, TOP, x, bottom) + _text(x, bottom + 18, duration(10.0**k)))
    for k in range(axes.error[0], axes.error[1] + 1):
        y = axes.y(10.0**k)
        parts.append(_line(LEFT, y, right, y) + _text(LEFT - 8, y + 4, f"1e{k}", anchor="end"))
    parts.append(_text((LEFT + right) / 2, bottom + 40, "run time of the steps"))
    middle = (TOP + bottom) / 2
    turned = f'transform="rotate(-90 16 {middle:g})"'
    parts.append(_text(16, middle, "error (rms, without unit)", extra=turned))
    return "".join(parts)


def _limit(axes: Axes, study: Study) -> str:
    """What the reference cannot tell apart, shaded."""
    limit = study.reference["limit"]
    if not limit > 10.0 ** axes.error[0]:
        return ""
    top = max(axes.y(min(limit, 10.0 ** axes.error[1])), TOP)
    said = f"below {limit:.1e}: the limit of the reference"
    width, height = axes.paper.right - LEFT, axes.paper.bottom - top
    return (
        f'<rect x="{LEFT:g}" y="{top:.1f}" width="{width:g}" height="{height:.1f}" '
        f'style="fill:{SHADE}"><title>{escape(said)}</title></rect>'
    )


def _target(axes: Axes, study: Study) -> str:
    target = study.target
    if target is None or not 10.0 ** axes.error[0] <= target <= 10.0 ** axes.error[1]:
        return ""
    y = axes.y(target)
    line = _line(LEFT, y, axes.paper.right, y, f"stroke:{INK};stroke-dasharray:5 4")
    return line + _text(LEFT + 6, y - 5, f"target {target:g}", anchor="start")


def _curve(axes: Axes, study: Study, name: str, i: int) -> str:
    rows = study.of(name)
    places = [(axes.x(row.time or 1.0), axes.y(min(row.error or 1.0, 1e3))) for row in rows]
    colour = series_colour(i)
    dash = ";stroke-dasharray:6 3" if rows and rows[0].peer else ""
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    line = f'<polyline points="{points}" style="fill:none;stroke:{colour};stroke-width:1.8{dash}"/>'
    marks = (
        f'<g tabindex="0">{_mark(x, y, i, colour, hollow=row.limited)}'
        f"<title>{escape(said(row))}</title></g>"
        for row, (x, y) in zip(rows, places)
    )
    return line + "".join(marks)


def said(row: Row) -> str:
    """What a point says when one points at it."""
    low, middle, high = row.seconds or (0.0, 0.0, 0.0)
    counters = row.counters or {}
    lines = [
        f"{row.method}, {row.setting}",
        f"error {row.error:.2e}, digits {digits(row)}",
        f"time {duration(middle)} ({duration(low)} .. {duration(high)})",
    ]
    if "steps" in counters:
        lines.append(f"{counters['steps']} steps")
    if row.energy_drift is not None:
        lines.append(f"energy drift {row.energy_drift:.1e}")
    return "\n".join(lines)


def _legend(paper: Paper, study: Study) -> str:
    parts = []
    for i, name in enumerate(study.methods):
        x, y = _place(paper, i)
        colour = series_colour(i)
        seen = study.orders.get(name, (None, 0.0))[0]
        order = "" if seen is None else f", order {seen:.1f}"
        gone = "" if study.of(name) else " (no run)"
        parts.append(_mark(x, y - 4, i, colour) + _text(x + 12, y, name + order + gone, "start"))
    return "".join(parts)


def _place(paper: Paper, i: int) -> tuple[float, float]:
    """Of the i-th entry of the legend."""
    if not paper.columns:
        return paper.right + 18, TOP + 14 + LEGEND * i
    line, column = divmod(i, paper.columns)
    step = (paper.width - 20) / paper.columns
    return 20 + step * column, paper.bottom + FOOT + 14 + LEGEND * line


def _mark(x: float, y: float, i: int, colour: str, *, hollow: bool = False) -> str:
    path = MARKS[i % len(MARKS)]
    fill = "transparent" if hollow else colour
    return (
        f'<path d="{path}" transform="translate({x:.1f} {y:.1f}) scale(4.5)" '
        f'style="fill:{fill};stroke:{colour};stroke-width:.3"/>'
    )


def _line(x0: float, y0: float, x1: float, y1: float, style: str = "") -> str:
    style = style or f"stroke:{LINE}"
    return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" style="{style}"/>'


def _text(x: float, y: float, text: str, anchor: str = "middle", extra: str = "") -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" style="fill:{INK}" {extra}'
    return f"<text {place}>{escape(text)}</text>"
