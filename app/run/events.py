"""What happens to a run: its settings, its start, its progress, its end; and to the compiler."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from ..core.event import FromPage, Text


@dataclass(frozen=True)
class SetScenario(FromPage):
    serial: int
    scenario: Text


@dataclass(frozen=True)
class SetRun(FromPage):
    serial: int
    field: Literal["t_end", "step", "rtol", "method"]
    text: Text


@dataclass(frozen=True)
class Simulate(FromPage):
    pass


@dataclass(frozen=True)
class Cancel(FromPage):
    pass


@dataclass(frozen=True)
class Continue(FromPage):
    """Go on from the end of the run for as long again."""


@dataclass(frozen=True)
class Compare(FromPage):
    """Keep the run as a ghost beside the next ones, or take the ghost away."""


@dataclass(frozen=True)
class Export(FromPage):
    """The run as a file."""

    what: Literal["csv", "npz", "html"]


@dataclass(frozen=True)
class GoLive(FromPage):
    """Simulate and play at once, without an end."""


@dataclass(frozen=True)
class StopLive(FromPage):
    pass


@dataclass(frozen=True)
class Advanced:
    """The live run got further by a part; `pace` is its speed over the one asked for."""

    live: int
    part: Any
    pace: float


@dataclass(frozen=True)
class Stuck:
    """The live run cannot go on."""

    live: int
    text: str


@dataclass(frozen=True)
class Progress:
    job: int
    fraction: float


@dataclass(frozen=True)
class Simulated:
    job: int
    result: Any


@dataclass(frozen=True)
class Failed:
    job: int
    text: str


@dataclass(frozen=True)
class Compiling:
    done: int
    total: int
    name: str


@dataclass(frozen=True)
class Compiled:
    problem: str = ""
