"""One self-contained page: sections of SVG and tables, light or dark, values where one points.

Figures are SVG texts that stand alone too: they take their colours from the variables of `style`,
as `var(--ink, currentColor)` or `series_colour(i)`. What has a `<title>` says it at once when one
points at it or moves the focus to it.
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
    """A heading with what stands below it."""

    title: str
    body: str  # HTML or SVG, escaped by who made it


def page(title: str, sections: Iterable[Section], lines: Sequence[str] = ()) -> str:
    """The HTML text; `lines` are sentences below the title. It needs nothing from elsewhere."""
    said = "".join(f"<p>{escape(line)}</p>" for line in lines)
    parts = "".join(
        f'<section><h2 id="s{i}">{escape(part.title)}</h2>{part.body}</section>'
        for i, part in enumerate(sections)
    )
    script = (FOLDER / "page.js").read_text(encoding="utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style()}</style></head>"
        f"<body><main><h1>{escape(title)}</h1>{said}{parts}</main>"
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
    """The CSS colour of a series in both schemes; beyond the last it starts over."""
    return f"var(--s{i % len(SERIES)}, {SERIES[i % len(SERIES)]})"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """An HTML table; texts are escaped here, and scroll within the page where they are wide."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows
    )
    inner = f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>"
    return f'<div class="wide"><table>{inner}</table></div>'
