"""What happens to the playback."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from ..core.event import Finite, FromPage
from ..core.state import SPEEDS


@dataclass(frozen=True)
class Play(FromPage):
    pass


@dataclass(frozen=True)
class Pause(FromPage):
    pass


@dataclass(frozen=True)
class Scrub(FromPage):
    time: Finite


@dataclass(frozen=True)
class StepFrames(FromPage):
    frames: Annotated[int, Field(ge=-1000, le=1000)]


@dataclass(frozen=True)
class Speed(FromPage):
    speed: Annotated[float, Field(ge=SPEEDS[0], le=SPEEDS[-1])]


@dataclass(frozen=True)
class Loop(FromPage):
    loop: bool


@dataclass(frozen=True)
class Tick:
    """Wall-clock time went by while playing [s]."""

    dt: float
