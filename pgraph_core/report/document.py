"""A study as one HTML page: the diagram, the table, and what to know beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import text
from .html import Section, escape, page, table

if TYPE_CHECKING:
    from .study import Study


def sections(study: Study) -> tuple[Section, ...]:
    """The parts of the page, for those who put them into another one."""
    notes = "".join(f"<p>{escape(line)}</p>" for line in text.foot(study) if line)
    header, *rows = text.peers(study) or [[]]
    beside = [Section("At equal error", table(header, rows))] if rows else []
    return (
        Section("Error against run time", study.figure()),
        *beside,
        Section("What it says", notes),
        Section("All runs", table(text.HEADER, map(text.cells_of, study.rows))),
    )


def document(study: Study) -> str:
    """The page; it needs nothing from elsewhere."""
    first, *rest = text.head(study)
    return page(first, sections(study), rest)
