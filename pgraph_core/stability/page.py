"""Maps as one self-contained page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..report.html import Section, escape, table
from ..report.html import page as html_page
from .text import findings, title

if TYPE_CHECKING:
    from .map import StabilityMap

HEADER = ("value", "method", "step [s]", "verdict", "error", "order", "evaluations", "why")


def page(maps: Sequence[StabilityMap]) -> str:
    """The HTML text: of each map the figure, what was found, and every cell."""
    sections = [section for found in maps for section in sections_of(found)]
    name = maps[0].model if maps else ""
    return html_page(f"Stability of {name}", sections)


def sections_of(found: StabilityMap) -> list[Section]:
    """Figure and findings, then the cells in words."""
    said = "".join(f"<li>{escape(line)}</li>" for line in findings(found))
    known = "".join(
        f"<li>{value:g}: {escape(how)}</li>" for value, how in zip(found.values, found.references)
    )
    first = f"<p>{escape(title(found))}</p>{found.figure()}<ul>{said}</ul>"
    rows = (
        (
            f"{c.value:g}", c.method, f"{c.step:g}", str(c.status), f"{c.error:.1e}",
            f"{c.order:.1f}", str(c.evaluations), c.text,
        )
        for c in found.cells
    )  # fmt: skip
    cells = f"<p>Compared with:</p><ul>{known}</ul>{table(HEADER, rows)}"
    return [Section(found.axis, first), Section(f"{found.axis}: every cell", cells)]
