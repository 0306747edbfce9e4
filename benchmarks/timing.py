"""Timing of calls: one process, warm, interleaved in shuffled rounds, medians with quartiles."""

from __future__ import annotations

import gc
import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pgraph_core.study.measures import Spread as Spread
from pgraph_core.study.measures import spread as spread


@dataclass(frozen=True)
class Case:
    """One comparison: the call of each side, and the units of work in a call."""

    name: str
    sides: Mapping[str, Callable[[], object]]  # the first one is ours
    unit: str = "call"
    per_call: int = 1
    agreement: str = ""  # how far the results differed before timing
    goals: Mapping[str, float] = field(default_factory=dict)  # ratio to reach, by peer
    clocked: frozenset[str] = frozenset()  # sides whose calls return their own seconds
    at_most: Mapping[str, float] = field(default_factory=dict)  # ratio not to pass, by side


@dataclass
class Timed:
    """Seconds a unit of every side, by round."""

    case: Case
    seconds: dict[str, list[float]]

    @property
    def ours(self) -> str:
        """The side that the others are compared to."""
        return next(iter(self.case.sides))

    def quartiles(self, side: str) -> Spread:
        """Seconds a unit."""
        return spread(self.seconds[side])

    def ratio(self, side: str) -> Spread:
        """A peer's time over ours, within the same round."""
        return spread([x / y for x, y in zip(self.seconds[side], self.seconds[self.ours])])


def repeats(call: Callable[[], object], shortest: float) -> int:
    """Calls a sample, so that it lasts `shortest` [s]; warms up first, long calls once."""
    for _ in range(3):
        if sample(call, 1, clocked=False) > 100 * shortest:
            return 1
    n = 1
    while True:
        begin = time.perf_counter()
        sample(call, n, clocked=False)
        total = time.perf_counter() - begin
        if total >= shortest:
            return n
        n = max(2 * n, int(n * shortest / max(total, 1e-7)))


def sample(call: Callable[[], object], n: int, *, clocked: bool) -> float:
    """Seconds a call over n calls, by our clock or, where `clocked`, by the call's own."""
    if clocked:
        return sum(float(call()) for _ in range(n)) / n  # type: ignore[arg-type]
    begin = time.perf_counter()
    for _ in range(n):
        call()
    return (time.perf_counter() - begin) / n


def measure(cases: list[Case], rounds: int, shortest: float, seed: int = 0) -> list[Timed]:
    """All sides of all cases, interleaved in a new random order every round."""
    shuffle = random.Random(seed)
    timed = [Timed(case, {side: [] for side in case.sides}) for case in cases]
    counts = {
        (t.case.name, side): repeats(call, shortest)
        for t in timed
        for side, call in t.case.sides.items()
    }
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for t in shuffle.sample(timed, len(timed)):
                for side in shuffle.sample(list(t.case.sides), len(t.case.sides)):
                    n, clocked = counts[t.case.name, side], side in t.case.clocked
                    seconds = sample(t.case.sides[side], n, clocked=clocked)
                    t.seconds[side].append(seconds / t.case.per_call)
    finally:
        gc.enable()
    return timed
