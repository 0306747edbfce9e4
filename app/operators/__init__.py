"""Pictures of the operators in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from .. import pose


@dataclass(frozen=True)
class Inspected:
    """The part of an operator that a page shows. None stands for all rows or columns."""

    what: str  # key of TITLES in `view.py`
    rows: tuple[int, int] | None = None  # from, to
    columns: tuple[int, int] | None = None


@dataclass(frozen=True)
class Client(pose.Client):
    inspected: Inspected | None = None  # the operator it looks at

    def afresh(self) -> Self:
        looked = self.inspected  # its tab may be in sight: the same operator, all of it
        whole = None if looked is None else replace(looked, rows=None, columns=None)
        return replace(super().afresh(), inspected=whole)


@dataclass(frozen=True)
class State(pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
