"""A self-contained HTML page of sections with tables and two SVG figures, light or dark.

The figures are error against run time, and a heat map; each stands alone too.

SVG figures take their colours from the variables of `style`, as `var(--ink, currentColor)` or
`series_colour(i)`. The page shows the `<title>` of an element at once on hover and on focus.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape as escape
from pathlib import Path
from typing import NamedTuple

from .measures import TRUST

FOLDER = Path(__file__).parent
NAMES = ("paper", "ink", "muted", "line", "shade")
LIGHT = ("#ffffff", "#1b1f24", "#5b6470", "#d8dde3", "#eef1f4")
DARK = ("#16181c", "#e8eaed", "#9aa4b1", "#363c45", "#22262c")
SERIES = ("#2f5be7", "#c2560c", "#0b7d63", "#9333a8", "#684018", "#0e7490", "#b91c1c", "#4d7c0f")
SERIES_DARK = (
    "#7fa3ff", "#f2944a", "#4fd0b0", "#d48ae6", "#fbbf24", "#67e8f9", "#fca5a5", "#bef264"
)  # fmt: skip


class Section(NamedTuple):
    """A heading and the content below it."""

    title: str
    body: str  # HTML or SVG, already escaped


def page(title: str, sections: Iterable[Section], lines: Sequence[str] = ()) -> str:
    """Return the HTML of a standalone page, with `lines` of text below the title."""
    first = "".join(f"<p>{escape(line)}</p>" for line in lines)
    parts = "".join(
        f'<section><h2 id="s{i}">{escape(part.title)}</h2>{part.body}</section>'
        for i, part in enumerate(sections)
    )
    script = (FOLDER / "page.js").read_text(encoding="utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style()}</style></head>"
        f"<body><main><h1>{escape(title)}</h1>{first}{parts}</main>"
        f"<script>{script}</script></body></html>\n"
    )


def style() -> str:
    """Return the style sheet, with the colours of both schemes as variables."""
    text = (FOLDER / "page.css").read_text(encoding="utf-8")
    dark = f"@media (prefers-color-scheme: dark) {{ {_root(DARK, SERIES_DARK)} }}"
    return f"{_root(LIGHT, SERIES)}\n{dark}\n{text}"


def _root(colours: Sequence[str], series: Sequence[str]) -> str:
    names = (*NAMES, *(f"s{i}" for i in range(len(series))))
    values = " ".join(f"--{name}: {value};" for name, value in zip(names, (*colours, *series)))
    return f":root {{ color-scheme: light dark; {values} }}"


def series_colour(i: int) -> str:
    """Return the CSS colour of a series for both schemes, repeating cyclically."""
    return f"var(--s{i % len(SERIES)}, {SERIES[i % len(SERIES)]})"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return an HTML table of plain texts, which are escaped. Wide tables scroll."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows
    )
    inner = f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>"
    return f'<div class="wide"><table>{inner}</table></div>'


def aligned(cells: Sequence[Sequence[str]], left: Sequence[bool]) -> list[str]:
    """Return a table as lines of plain text, with columns aligned `left` or to the right."""
    widths = [max(len(row[i]) for row in cells) for i in range(len(left))]
    lines = []
    for row in cells:
        parts = (x.ljust(w) if to else x.rjust(w) for x, w, to in zip(row, widths, left))
        lines.append("  ".join(parts).rstrip())
    return lines


def duration(seconds: float) -> str:
    """Format a duration with its unit."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


# -- figures ---------------------------------------------------------------------------------------

LEFT, TOP, FOOT, LEGEND = 72.0, 16.0, 48.0, 22.0  # margins, and the height of a legend's line
INK, LINE, SHADE = (
    f"var(--{name}, {colour})"
    for name, colour in (("ink", "currentColor"), ("line", "#88929e66"), ("shade", "#88929e22"))
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


CELL, CELL_HIGH, GAP = 26, 24, 12  # size of a heat map's cell [px], and between groups
MAP_LEFT, MAP_TOP = 84, 64
LETTER_WIDE, HEAD_WIDE = 6.8, 4.2  # width of a letter of a group's name and of a slanted head


class Point(NamedTuple):
    """One run."""

    seconds: float
    error: float
    text: str  # shown when one points at it
    hollow: bool = False  # at the limit of the reference


class Curve(NamedTuple):
    """The runs for one method."""

    name: str  # text in the legend
    points: Sequence[Point]
    dashed: bool = False


class Paper(NamedTuple):
    """The size of the diagram and of its legend, which is on the right or in columns below."""

    width: float
    height: float
    right: float  # end of the time axis
    bottom: float  # end of the error axis
    columns: int  # columns of a legend below the diagram, 0 for a legend at the right


WIDE = Paper(900.0, 520.0, 690.0, 472.0, 0)


def narrow_paper(curves: int) -> Paper:
    """Return the paper size for a column of 400 to 500 pixels, in which text remains legible."""
    lines = math.ceil(curves / 2)
    return Paper(480.0, 350.0 + FOOT + lines * LEGEND, 470.0, 350.0, 2)


class Axes(NamedTuple):
    """The decades on both axes, and their positions on the paper."""

    paper: Paper
    time: tuple[int, int]  # exponents of the seconds at left and right
    error: tuple[int, int]  # exponents of the errors at bottom and top

    def x(self, seconds: float) -> float:
        """Return the horizontal position for a time."""
        low, high = self.time
        return LEFT + (math.log10(seconds) - low) / (high - low) * (self.paper.right - LEFT)

    def y(self, error: float) -> float:
        """Return the vertical position for an error."""
        low, high = self.error
        bottom = self.paper.bottom
        return bottom - (math.log10(min(error, TRUST)) - low) / (high - low) * (bottom - TOP)


def error_diagram(
    label: str,
    curves: Sequence[Curve],
    paper: Paper = WIDE,
    titles: tuple[str, str] = ("run time", "error (rms, without unit)"),
    *,
    limit: float = math.nan,
    target: float | None = None,
) -> str:
    """Return a diagram of log error over log run time, with one curve per method.

    Without points it is a sentence. `titles` are the titles of the axes. Errors below `limit`, the
    limit of the reference, are shaded. `target` is a dashed line.
    """
    open_ = (
        '<svg xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {paper.width:g} {paper.height:g}" '
        f'aria-label="{escape(label)}" font-family="system-ui, sans-serif" font-size="12">'
    )
    points = [point for curve in curves for point in curve.points]
    if not points:
        return f"{open_}{_text(LEFT, 40, 'no run reached the end', anchor='start')}</svg>"
    errors = [min(point.error, TRUST) for point in points]
    axes = Axes(paper, _decades([point.seconds for point in points]), _decades(errors))
    parts = [_shade(axes, limit), _grid(axes, titles), _target(axes, target)]
    parts += [_curve(axes, curve, i) for i, curve in enumerate(curves)]
    return f"{open_}{''.join(parts)}{_legend(paper, curves)}</svg>"


def _decades(values: list[float]) -> tuple[int, int]:
    low = math.floor(math.log10(min(values)) - 0.05)
    high = math.ceil(math.log10(max(values)) + 0.05)
    return low, max(high, low + 1)


def _grid(axes: Axes, titles: tuple[str, str]) -> str:
    bottom, right = axes.paper.bottom, axes.paper.right
    parts = []
    for k in range(axes.time[0], axes.time[1] + 1):
        x = axes.x(10.0**k)
        parts.append(_line(x, TOP, x, bottom) + _text(x, bottom + 18, duration(10.0**k)))
    for k in range(axes.error[0], axes.error[1] + 1):
        y = axes.y(10.0**k)
        parts.append(_line(LEFT, y, right, y) + _text(LEFT - 8, y + 4, f"1e{k}", anchor="end"))
    parts.append(_text((LEFT + right) / 2, bottom + 40, titles[0]))
    middle = (TOP + bottom) / 2
    turned = f'transform="rotate(-90 16 {middle:g})"'
    parts.append(_text(16, middle, titles[1], extra=turned))
    return "".join(parts)


def _shade(axes: Axes, limit: float) -> str:
    if not limit > 10.0 ** axes.error[0]:
        return ""
    top = max(axes.y(min(limit, 10.0 ** axes.error[1])), TOP)
    width, height = axes.paper.right - LEFT, axes.paper.bottom - top
    return (
        f'<rect x="{LEFT:g}" y="{top:.1f}" width="{width:g}" height="{height:.1f}" '
        f'style="fill:{SHADE}"><title>below {limit:.1e}: the limit of the reference</title></rect>'
    )


def _target(axes: Axes, target: float | None) -> str:
    if target is None or not 10.0 ** axes.error[0] <= target <= 10.0 ** axes.error[1]:
        return ""
    y = axes.y(target)
    line = _line(LEFT, y, axes.paper.right, y, f"stroke:{INK};stroke-dasharray:5 4")
    return line + _text(LEFT + 6, y - 5, f"target {target:g}", anchor="start")


def _curve(axes: Axes, curve: Curve, i: int) -> str:
    places = [(axes.x(point.seconds), axes.y(point.error)) for point in curve.points]
    colour = series_colour(i)
    dash = ";stroke-dasharray:6 3" if curve.dashed else ""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    line = f'<polyline points="{path}" style="fill:none;stroke:{colour};stroke-width:1.8{dash}"/>'
    marks = (
        f'<g tabindex="0">{_mark(x, y, i, colour, hollow=point.hollow)}'
        f"<title>{escape(point.text)}</title></g>"
        for point, (x, y) in zip(curve.points, places)
    )
    return line + "".join(marks)


def _legend(paper: Paper, curves: Sequence[Curve]) -> str:
    parts = []
    for i, curve in enumerate(curves):
        x, y = _place(paper, i)
        parts.append(_mark(x, y - 4, i, series_colour(i)) + _text(x + 12, y, curve.name, "start"))
    return "".join(parts)


def _place(paper: Paper, i: int) -> tuple[float, float]:
    """Return the position of the i-th legend entry."""
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


# -- heat map --------------------------------------------------------------------------------------


class Square(NamedTuple):
    """One cell in a heat map."""

    row: int
    group: int
    column: int
    colour: str
    ink: str  # colour of the letter
    letter: str
    text: str  # shown when one points at it


class Key(NamedTuple):
    """A legend entry for a heat map: a colour, a letter and their meaning."""

    letter: str
    colour: str
    ink: str
    text: str


def heat_map(
    title: str,
    axis: str,
    rows: Sequence[str],
    groups: Sequence[str],
    columns: Sequence[str],
    squares: Sequence[Square],
    legend: Sequence[Key],
    wide: float = math.inf,
) -> str:
    """Draw coloured cells in rows below their legend, with one group of columns per method.

    Groups that do not fit into `wide` pixels go below the others.
    """
    high = MAP_TOP + len(rows) * CELL_HIGH
    beyond = HEAD_WIDE * max(map(len, columns), default=0) - CELL / 2  # the last head, turned
    group = len(columns) * CELL + max(beyond, GAP)
    places = _places([max(group, LETTER_WIDE * len(x) + GAP) for x in groups], wide)
    bands = range(max((band for _, band in places), default=0) + 1)
    bottom = high * len(bands)
    parts = [f'<text x="4" y="12" {_style(11)}>{escape(axis)}</text>']
    parts += [_head(name, x, band * high, columns) for name, (x, band) in zip(groups, places)]
    for band in bands:
        for i, text in enumerate(rows):
            y = band * high + MAP_TOP + i * CELL_HIGH + 16
            place = f'x="{MAP_LEFT - 8}" y="{y}" text-anchor="end"'
            parts.append(f"<text {place} {_style(11)}>{escape(text)}</text>")
    for each in squares:
        x, band = places[each.group]
        y = band * high + MAP_TOP + each.row * CELL_HIGH
        parts.append(_square(each, x + each.column * CELL, y))
    width = max((x for x, _ in places), default=0.0) + group
    width = max(width, min(wide, 640.0))
    x, y, keys = 4.0, 0.0, []
    for key in legend:
        long = 28 + 6.2 * len(key.text)
        if x > 4.0 and x + long > width:
            x, y = 4.0, y + LEGEND
        keys.append(
            f'<rect x="{x}" y="{y}" width="14" height="14" rx="2" fill="{key.colour}"/>'
            f'<text x="{x + 7}" y="{y + 11}" text-anchor="middle" {_style(10, key.ink)}>'
            f"{key.letter}</text>"
            f'<text x="{x + 19}" y="{y + 11}" {_style(11)}>{escape(key.text)}</text>'
        )
        x += long
    top = y + LEGEND + 4
    high = f"{top + bottom:.0f}"
    size = f'viewBox="0 0 {width:.0f} {high}" width="{width:.0f}" height="{high}"'
    body = f'{"".join(keys)}<g transform="translate(0 {top:.0f})">{"".join(parts)}</g>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" '
        'font-family="system-ui, sans-serif" font-size="11">'
        f"<title>{escape(title)}</title>{body}</svg>"
    )


def _places(widths: Sequence[float], wide: float) -> list[tuple[float, int]]:
    """Return (left end, band) for groups with these widths, placed side by side while they fit."""
    found, x, band = [], float(MAP_LEFT), 0
    for width in widths:
        if x > MAP_LEFT and x + width > wide:
            x, band = float(MAP_LEFT), band + 1
        found.append((x, band))
        x += width
    return found


def _head(name: str, x: float, top: float, columns: Sequence[str]) -> str:
    parts = [f'<text x="{x}" y="{top + MAP_TOP - 40}" {_style(11)}>{escape(name)}</text>']
    for j, text in enumerate(columns):
        middle, y = x + j * CELL + CELL / 2, top + MAP_TOP - 6
        turned = f'transform="rotate(-40 {middle} {y})"'
        parts.append(f'<text x="{middle}" y="{y}" {_style(9)} {turned}>{escape(text)}</text>')
    return "".join(parts)


def _square(each: Square, x: float, y: float) -> str:
    return (
        f'<g tabindex="0"><title>{escape(each.text)}</title><rect x="{x:.1f}" y="{y}" '
        f'width="{CELL - 2}" height="{CELL_HIGH - 2}" rx="3" fill="{each.colour}"/>'
        f'<text x="{x + CELL / 2 - 1:.1f}" y="{y + 15}" text-anchor="middle" '
        f"{_style(11, each.ink)}>{each.letter}</text></g>"
    )


def _style(size: int, ink: str = INK) -> str:
    """Return text colour and size as attributes that a page's style sheet does not override."""
    return f'style="fill: {ink}; font-size: {size}px"'
