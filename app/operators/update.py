"""The operator shown on each page (pure)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ..core.events import FromPage, Request
from ..core.state import with_client
from . import Inspected, State

Index = Annotated[int, Field(ge=0, le=1_000_000)]
Operator = Literal["M", "J", "eps_phi", "Phi", "S"]


class Inspect(FromPage):
    """Show an operator, or some of its rows and columns, or "" for none."""

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
