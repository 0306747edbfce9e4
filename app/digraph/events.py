"""What happens to the digraph: a node dropped onto another, and stepping through."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..core.event import FromPage, Text


@dataclass(frozen=True)
class Drop(FromPage):
    """A body was dropped onto its new parent, or onto a second one: then a `loop` closes."""

    serial: int
    body: Text
    parent: Text
    loop: bool


@dataclass(frozen=True)
class StepThrough(FromPage):
    """Show how Pgraph is made (Fig. 4), or how frames are updated along it (Fig. 8)."""

    what: Literal["", "pgraph", "frames"]
