"""What all events of a page share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from pydantic import ConfigDict, Field

Text = Annotated[str, Field(max_length=20_000)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


@dataclass(frozen=True)
class FromPage:
    """An event that one open page sent."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    client: int
    seen: int | None = field(default=None, kw_only=True)  # renames it knew of; None: all
