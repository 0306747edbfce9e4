"""Pictures of the operators in the paper."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Inspected:
    """The part of an operator that a page shows. None stands for all rows or columns."""

    what: str  # key of TITLES in `view.py`
    rows: tuple[int, int] | None = None  # from, to
    columns: tuple[int, int] | None = None
