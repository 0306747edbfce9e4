"""The operators of the paper as pictures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Inspected:
    """The part of an operator that a page looks at; None: all rows, all columns."""

    what: str  # as in TITLES of `view.py`
    rows: tuple[int, int] | None = None  # from, to
    columns: tuple[int, int] | None = None
