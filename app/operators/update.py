"""The operator shown on each page (pure)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..core.events import FromPage, on, on_request
from ..core.state import with_client
from . import Inspected, State

Index = Annotated[int, Field(ge=0, le=1_000_000)]
Operator = Literal["M", "J", "eps_phi", "Phi", "S"]


@dataclass(frozen=True)
class Inspect(FromPage):
    """Show an operator, or some of its rows and columns, or "" for none."""

    what: Literal[""] | Operator
    rows: tuple[Index, Index] | None = None
    columns: tuple[Index, Index] | None = None


@on(Inspect)
def inspect(state: State, event: Inspect) -> State:
    inspected = Inspected(event.what, event.rows, event.columns) if event.what else None
    return with_client(state, event.client, inspected=inspected)


@on_request
@dataclass(frozen=True)
class ExportOperator(FromPage):
    """Download an operator, evaluated at the displayed pose."""

    what: Operator
    suffix: Literal["npz", "csv", "mtx"]
