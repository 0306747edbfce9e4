"""What happens to a walk: its gait, its speed, pushes, the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..core.event import FromPage, Text


@dataclass(frozen=True)
class Walk(FromPage):
    """Go live with the gait that is chosen."""


@dataclass(frozen=True)
class SetGait(FromPage):
    serial: int
    gait: Text


@dataclass(frozen=True)
class SetWalk(FromPage):
    """A field of the gait, at once."""

    serial: int
    field: Literal["speed", "turn"]
    text: Text


@dataclass(frozen=True)
class SetGround(FromPage):
    """Other ground: an edit of the model, one undo step."""

    serial: int
    field: Literal["friction", "slope", "steps", "law"]
    text: Text


@dataclass(frozen=True)
class Push(FromPage):
    """Push the trunk."""

    side: Literal["left", "right", "back", "ahead"]
