"""Pictures of the operators in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, Self

from pydantic import Field

from .. import pose
from ..core.events import FromPage, Request
from ..core.state import with_client


@dataclass(frozen=True)
class Inspected:
    """The part of an operator that a page shows. None selects all rows or columns."""

    what: str  # key of OPERATORS in `view.py`
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


# -- the operator shown on each page (pure) --------------------------------------------------------


Index = Annotated[int, Field(ge=0, le=1_000_000)]
Operator = Literal[
    "M", "C", "J", "S", "eps_phi", "Phi", "Phi_T", "H", "M_k", "a", "b", "V", "V_T", "Jdot", "Vdot",
    "F", "tau", "vdot", "Omega", "eq5", "eq8", "eq24", "fig3",
]  # fmt: skip


class Inspect(FromPage):
    """Show an operator, or some of its rows and columns. `what` is "" if none is shown."""

    what: Literal[""] | Operator
    rows: tuple[Index, Index] | None = None
    columns: tuple[Index, Index] | None = None

    def applied(self, state: State) -> State:
        inspected = Inspected(self.what, self.rows, self.columns) if self.what else None
        return with_client(state, self.client, inspected=inspected)


class ExportOperator(Request):
    """Download an operator, evaluated at the displayed pose."""

    what: Operator
    suffix: Literal["npz", "csv", "mtx"]
