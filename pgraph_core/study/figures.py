"""The two figures of studies as SVG, error against run time and a heat map, and files of studies.

SVG figures take their colours from the variables of `style`, as `var(--ink, currentColor)` or
`series_colour(i)`.
"""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from ..errors import FileError, Problem, choices, explained
from ..model.files import write_atomic
from ..portable import Portable
from .measures import TRUST

LAYOUT = """body { margin: 1.5rem; background: var(--paper); color: var(--ink); }
svg { max-width: 72rem; height: auto; }
svg text { fill: var(--ink); }
pre { overflow-x: auto; }"""
NAMES = ("paper", "ink", "muted", "line", "shade")
LIGHT = ("#ffffff", "#1b1f24", "#5b6470", "#d8dde3", "#eef1f4")
DARK = ("#16181c", "#e8eaed", "#9aa4b1", "#363c45", "#22262c")
SERIES = ("#2f5be7", "#c2560c", "#0b7d63", "#9333a8", "#684018", "#0e7490", "#b91c1c", "#4d7c0f")
SERIES_DARK = (
    "#7fa3ff", "#f2944a", "#4fd0b0", "#d48ae6", "#fbbf24", "#67e8f9", "#fca5a5", "#bef264"
)  # fmt: skip


def style() -> str:
    """Return the style sheet, with the colours of both schemes as variables."""
    dark = f"@media (prefers-color-scheme: dark) {{ {_root(DARK, SERIES_DARK)} }}"
    return f"{_root(LIGHT, SERIES)}\n{dark}\n{LAYOUT}"


def _root(colours: Sequence[str], series: Sequence[str]) -> str:
    names = (*NAMES, *(f"s{i}" for i in range(len(series))))
    values = " ".join(f"--{name}: {value};" for name, value in zip(names, (*colours, *series)))
    return f":root {{ color-scheme: light dark; {values} }}"


def series_colour(i: int) -> str:
    """Return the CSS colour of a series for both schemes, repeating cyclically."""
    return f"var(--s{i % len(SERIES)}, {SERIES[i % len(SERIES)]})"


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
        return f"{1e6 * seconds:.3g} µs"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


# -- error against run time ------------------------------------------------------------------------

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


class Axis(NamedTuple):
    """A logarithmic axis over whole decades."""

    low: int  # exponents of its ends
    high: int
    start: float  # [px] places of its ends
    end: float

    @classmethod
    def of(cls, values: Sequence[float], start: float, end: float) -> Axis:
        """Compute the axis between two places that shows all values."""
        low = math.floor(math.log10(min(values)) - 0.05)
        return cls(low, max(math.ceil(math.log10(max(values)) + 0.05), low + 1), start, end)

    def __call__(self, value: float) -> float:
        """Compute the place of a value."""
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)

    @property
    def decades(self) -> range:
        """The exponents with a line."""
        return range(self.low, self.high + 1)


def error_diagram(
    label: str,
    curves: Sequence[Curve],
    titles: tuple[str, str],
    *,
    limit: float = math.nan,
    target: float | None = None,
) -> str:
    """Return a diagram of log error over log run time, with one curve per method.

    The legend below names the methods with points. Without points it is a sentence. `titles` are
    the titles of the axes. Errors below `limit`, the limit of the reference, are shaded. `target`
    is a dashed line.
    """
    width, right, bottom = 440.0, 424.0, 230.0
    legend = [i for i, curve in enumerate(curves) if curve.points]
    height = bottom + FOOT + math.ceil(len(legend) / 2) * LEGEND
    points = [point for curve in curves for point in curve.points]
    inside = _text(LEFT, 40, "no run reached the end time", "start")
    if points:
        x = Axis.of([point.seconds for point in points], LEFT, right)
        y = Axis.of([min(point.error, TRUST) for point in points], bottom, TOP)
        inside = _shade(x, y, limit) + _grid(x, y, titles) + _target(x, y, target)
        inside += "".join(_curve(x, y, curve, i) for i, curve in enumerate(curves))
        for place, i in enumerate(legend):
            line, column = divmod(place, 2)
            left, low = 20 + (width - 20) / 2 * column, bottom + FOOT + 14 + LEGEND * line
            inside += _mark(left, low - 4, i) + _text(left + 12, low, curves[i].name, "start")
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {width:g} {height:g}" aria-label="{escape(label)}" '
        f'font-family="system-ui, sans-serif" font-size="12">{inside}</svg>'
    )


def _grid(x: Axis, y: Axis, titles: tuple[str, str]) -> str:
    """Return a line for each decade, and the titles."""
    parts = []
    for k in x.decades:
        at = x(10.0**k)
        parts.append(_line(at, TOP, at, y.start))
        anchor = "middle" if at < x.end else "end"  # within the figure
        parts.append(_text(at, y.start + 18, duration(10.0**k), anchor))
    for k in y.decades:
        at = y(10.0**k)
        parts.append(_line(LEFT, at, x.end, at) + _text(LEFT - 8, at + 4, f"1e{k}", "end"))
    middle = (TOP + y.start) / 2
    turned = f'transform="rotate(-90 16 {middle:g})"'
    parts.append(_text((LEFT + x.end) / 2, y.start + 40, titles[0]))
    return "".join(parts) + _text(16, middle, titles[1], extra=turned)


def _shade(x: Axis, y: Axis, limit: float) -> str:
    if not limit > 10.0**y.low:
        return ""
    top = max(y(min(limit, 10.0**y.high)), TOP)
    return (
        f'<rect x="{LEFT:g}" y="{top:.1f}" width="{x.end - LEFT:g}" height="{y.start - top:.1f}" '
        f'style="fill:{SHADE}"><title>below {limit:.1e}: the limit of the reference</title></rect>'
    )


def _target(x: Axis, y: Axis, target: float | None) -> str:
    if target is None or not 10.0**y.low <= target <= 10.0**y.high:
        return ""
    line = _line(LEFT, y(target), x.end, y(target), f"stroke:{INK};stroke-dasharray:5 4")
    return line + _text(LEFT + 6, y(target) - 5, f"target {target:g}", "start")


def _curve(x: Axis, y: Axis, curve: Curve, i: int) -> str:
    places = [(x(point.seconds), y(min(point.error, TRUST))) for point in curve.points]
    look = f"stroke:{series_colour(i)};stroke-width:1.8"
    look += ";stroke-dasharray:6 3" if curve.dashed else ""
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
    return f'<polyline points="{path}" style="fill:none;{look}"/>' + "".join(
        f'<g tabindex="0">{_mark(*place, i, hollow=point.hollow)}'
        f"<title>{escape(point.text)}</title></g>"
        for point, place in zip(curve.points, places)
    )


def _mark(x: float, y: float, i: int, *, hollow: bool = False) -> str:
    """Return the mark of a curve."""
    colour = series_colour(i)
    return (
        f'<path d="{MARKS[i % len(MARKS)]}" transform="translate({x:.1f} {y:.1f}) scale(4.5)" '
        f'style="fill:{"transparent" if hollow else colour};stroke:{colour};stroke-width:.3"/>'
    )


def _line(x0: float, y0: float, x1: float, y1: float, style: str = f"stroke:{LINE}") -> str:
    return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" style="{style}"/>'


def _text(
    x: float, y: float, text: str, anchor: str = "middle", size: int = 12, ink: str = INK,
    extra: str = "",
) -> str:  # fmt: skip
    """Return a text with a colour and a size that are not overridden by style sheets."""
    look = f'text-anchor="{anchor}" style="fill:{ink};font-size:{size}px" {extra}'
    return f'<text x="{x:.1f}" y="{y:.1f}" {look}>{escape(text)}</text>'


# -- heat map --------------------------------------------------------------------------------------

CELL, CELL_HIGH, GAP = 26, 24, 12  # size of a heat map's cell [px], and between groups
MAP_LEFT, MAP_TOP, WIDE = 84, 64, 560.0
LETTER_WIDE, HEAD_WIDE = 6.8, 4.2  # width of a letter of a group's name and of a slanted head


class Look(NamedTuple):
    """The appearance of a heat map cell, as explained in the legend."""

    letter: str
    colour: str
    ink: str  # colour of the letter
    text: str


class Square(NamedTuple):
    """One cell in a heat map."""

    row: int
    group: int
    column: int
    look: Look
    text: str  # shown when one points at it


def heat_map(
    title: str,
    axis: str,
    rows: Sequence[str],
    groups: Sequence[str],
    columns: Sequence[str],
    squares: Sequence[Square],
    legend: Sequence[Look],
) -> str:
    """Draw coloured cells in rows below their legend, with one group of columns per method.

    Groups that do not fit into WIDE pixels go below the others.
    """
    high = MAP_TOP + len(rows) * CELL_HIGH
    beyond = HEAD_WIDE * max(map(len, columns), default=0) - CELL / 2  # the last head, turned
    group = len(columns) * CELL + max(beyond, GAP)
    places = _places([max(group, LETTER_WIDE * len(x) + GAP) for x in groups])
    bands = max((band for _, band in places), default=0) + 1
    width = max(WIDE, max((x for x, _ in places), default=0.0) + group)
    keys, top = _keys(legend, width)
    parts = [_text(4, top + 12, axis, "start", 11)]
    for name, (x, band) in zip(groups, places):
        parts.append(_head(name, x, top + band * high, columns))
    for band in range(bands):
        for i, text in enumerate(rows):
            y = top + band * high + MAP_TOP + i * CELL_HIGH + 16
            parts.append(_text(MAP_LEFT - 8, y, text, "end", 11))
    for each in squares:
        x, band = places[each.group]
        y = top + band * high + MAP_TOP + each.row * CELL_HIGH
        inside = _box(x + each.column * CELL, y, CELL - 2, CELL_HIGH - 2, each.look)
        parts.append(f'<g tabindex="0"><title>{escape(each.text)}</title>{inside}</g>')
    tall = f"{top + bands * high:.0f}"
    size = f'viewBox="0 0 {width:.0f} {tall}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" '
        'font-family="system-ui, sans-serif" font-size="11">'
        f"<title>{escape(title)}</title>{keys}{''.join(parts)}</svg>"
    )


def _places(widths: Sequence[float]) -> list[tuple[float, int]]:
    """Compute (left end, band) for groups with these widths, placed side by side while they fit."""
    found, x, band = [], float(MAP_LEFT), 0
    for width in widths:
        if x > MAP_LEFT and x + width > WIDE:
            x, band = float(MAP_LEFT), band + 1
        found.append((x, band))
        x += width
    return found


def _keys(legend: Sequence[Look], width: float) -> tuple[str, float]:
    """Compute the legend in lines of this width, and its height."""
    x, y, keys = 4.0, 0.0, []
    for look in legend:
        long = 28 + 6.2 * len(look.text)
        if x > 4.0 and x + long > width:
            x, y = 4.0, y + LEGEND
        keys.append(_box(x, y, 14, 14, look) + _text(x + 19, y + 11, look.text, "start", 11))
        x += long
    return "".join(keys), y + LEGEND + 4


def _head(name: str, x: float, top: float, columns: Sequence[str]) -> str:
    parts = [_text(x, top + MAP_TOP - 40, name, "start", 11)]
    for j, text in enumerate(columns):
        middle, y = x + j * CELL + CELL / 2, top + MAP_TOP - 6
        turned = f'transform="rotate(-40 {middle} {y})"'
        parts.append(_text(middle, y, text, "start", 9, extra=turned))
    return "".join(parts)


def _box(x: float, y: float, wide: int, high: int, look: Look) -> str:
    """Return a coloured box with its letter."""
    box = f'<rect x="{x:.1f}" y="{y:.1f}" width="{wide}" height="{high}" rx="3"'
    letter = _text(x + wide / 2, y + high / 2 + 4, look.letter, size=11, ink=look.ink)
    return f'{box} fill="{look.colour}"/>{letter}'


# -- results of studies as files -------------------------------------------------------------------


@explained
class Saved(Portable, ABC):
    """A result of a study. `print` shows it as text."""

    SUFFIXES: ClassVar[tuple[str, ...]] = (".html", ".json", ".svg", ".txt")  # files

    @abstractmethod
    def figure(self) -> str:
        """Return the figure as standalone SVG text."""

    def html(self) -> str:
        """Return the text and the figure as a standalone HTML page."""
        title, _, rest = str(self).partition("\n")
        return (
            '<!doctype html><html lang="en"><head><meta charset="utf-8">'
            f"<title>{escape(title)}</title><style>{style()}</style></head>"
            f"<body><h1>{escape(title)}</h1>{self.figure()}<pre>{escape(rest)}</pre></body></html>\n"
        )

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with None for numbers that are not finite."""

    def to_json(self) -> str:
        """Return the values of `to_dict` as a JSON object."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def save(self, path: str | Path, /) -> None:
        """Save the result to a file.

        Parameters
        ----------
        path : path
            A page (.html), the data (.json), the figure (.svg) or the text (.txt).

        Raises
        ------
        FileError
            If the file cannot be written or has another suffix.
        """
        kinds = dict(zip(self.SUFFIXES, (self.html, self.to_json, self.figure, self.__str__)))
        suffix = Path(path).suffix.lower()
        if suffix not in kinds:
            text = f"must end in {choices(kinds)}, got {suffix!r}"
            raise FileError(Problem(str(path), "", text))
        write_atomic(path, kinds[suffix]())
