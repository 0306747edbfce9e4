"""One self-contained HTML page of sections, light or dark, and tables as text and HTML.

SVG figures take their colours from the variables of `style`, as `var(--ink, currentColor)` or
`series_colour(i)`. The page shows the `<title>` of an element at once on hover and on focus.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape as escape
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent
NAMES = ("paper", "ink", "muted", "line", "shade")
LIGHT = ("#ffffff", "#1b1f24", "#5b6470", "#d8dde3", "#eef1f4")
DARK = ("#16181c", "#e8eaed", "#9aa4b1", "#363c45", "#22262c")
SERIES = ("#0b62a4", "#c2410c", "#15803d", "#a21caf", "#b45309", "#0e7490", "#b91c1c", "#4d7c0f")
SERIES_DARK = (
    "#6cb6ff",
    "#ff9b6a",
    "#6ee7a0",
    "#f0abfc",
    "#fbbf24",
    "#67e8f9",
    "#fca5a5",
    "#bef264",
)


class Section(NamedTuple):
    """A heading and the content below it."""

    title: str
    body: str  # HTML or SVG, already escaped


def page(title: str, sections: Iterable[Section], lines: Sequence[str] = ()) -> str:
    """The HTML text, without links to other files; `lines` are sentences below the title."""
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
    """The style sheet, with the colours of both schemes as variables."""
    text = (FOLDER / "page.css").read_text(encoding="utf-8")
    dark = f"@media (prefers-color-scheme: dark) {{ {_root(DARK, SERIES_DARK)} }}"
    return f"{_root(LIGHT, SERIES)}\n{dark}\n{text}"


def _root(colours: Sequence[str], series: Sequence[str]) -> str:
    names = (*NAMES, *(f"s{i}" for i in range(len(series))))
    values = " ".join(f"--{name}: {value};" for name, value in zip(names, (*colours, *series)))
    return f":root {{ color-scheme: light dark; {values} }}"


def series_colour(i: int) -> str:
    """The CSS colour of a series in both schemes; after the last it starts over."""
    return f"var(--s{i % len(SERIES)}, {SERIES[i % len(SERIES)]})"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """An HTML table of plain texts, which are escaped here; wide ones scroll within the page."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows
    )
    inner = f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>"
    return f'<div class="wide"><table>{inner}</table></div>'


def aligned(cells: Sequence[Sequence[str]], left: Sequence[bool]) -> list[str]:
    """A table as lines of plain text; columns are aligned to the `left` or to the right."""
    widths = [max(len(row[i]) for row in cells) for i in range(len(left))]
    lines = []
    for row in cells:
        parts = (x.ljust(w) if to else x.rjust(w) for x, w, to in zip(row, widths, left))
        lines.append("  ".join(parts).rstrip())
    return lines


def duration(seconds: float) -> str:
    """A time with its unit."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"
