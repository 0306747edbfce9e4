"""What pages look at beside the bodies: operators; and what cannot be seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..core.event import FromPage

Index = Annotated[int, Field(ge=0, le=1_000_000)]
What = Literal["", "M", "J", "eps_phi", "Phi", "S"]


@dataclass(frozen=True)
class Inspect(FromPage):
    """Show an operator, or the part of it within these rows and columns; "": none is in view."""

    what: What
    rows: tuple[Index, Index] | None = None
    columns: tuple[Index, Index] | None = None


@dataclass(frozen=True)
class ExportOperator(FromPage):
    """Download an operator at what is shown."""

    what: What
    suffix: Literal["npz", "csv", "mtx"]


@dataclass(frozen=True)
class Unreadable:
    """Mesh files that are drawn as boxes, a sentence each."""

    sentences: tuple[str, ...]
