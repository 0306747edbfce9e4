"""The operators of the paper as pictures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Inspected:
    """Part of an operator that a page shows, None for all rows or columns."""

    what: str  # key of TITLES in `view.py`
    rows: tuple[int, int] | None = None  # from, to
    columns: tuple[int, int] | None = None
