"""What happens to a run: its settings, its start, its progress, its end; and to the compiler."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from .base import FromPage, Text


@dataclass(frozen=True)
class SetScenario(FromPage):
    serial: int
    scenario: Text


@dataclass(frozen=True)
class SetRun(FromPage):
    serial: int
    field: Literal["t_end", "step", "method"]
    text: Text


@dataclass(frozen=True)
class Simulate(FromPage):
    pass


@dataclass(frozen=True)
class Cancel(FromPage):
    pass


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
