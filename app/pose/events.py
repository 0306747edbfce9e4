"""What moves bodies by hand: joint sliders, the gizmo in 3D, and pulling while a run is live."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..core.event import Finite, FromPage, Text

Vector = tuple[Finite, Finite, Finite]


@dataclass(frozen=True)
class Pose(FromPage):
    """One coordinate of a joint was moved to what `text` says, by a slider or typed.

    A typed one has a `serial` to be answered; a slider's is 0.
    """

    serial: int
    body: Text
    index: Annotated[int, Field(ge=0, le=5)]
    text: Text


@dataclass(frozen=True)
class Posing(FromPage):
    """The sliders of the joints came into view, or went out of it."""

    on: bool


@dataclass(frozen=True)
class HomePose(FromPage):
    """Show the model's initial state, or the run, again."""


@dataclass(frozen=True)
class UsePose(FromPage):
    """Make the pose that is shown the model's initial state."""


@dataclass(frozen=True)
class Gizmo(FromPage):
    """What of the selected body is moved in 3D on this page."""

    what: Literal["", "link", "com"]


@dataclass(frozen=True)
class Grip(FromPage):
    """The gizmo was dragged to `vector` [m], in the axes of the field; the end is one undo step."""

    body: Text
    what: Literal["link", "com"]
    vector: Vector
    done: bool


@dataclass(frozen=True)
class Pull(FromPage):
    """The mouse pulls on a body's `point`, in its axes, towards `target`, in the world's [m]."""

    body: Text
    point: Vector
    target: Vector | None  # None: let go
