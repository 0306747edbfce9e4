"""Timing of all benchmarks: sides take turns, processor time, medians with quartiles.

Other programs on the machine disturb both sides of a comparison alike when they take turns, and a
ratio is taken within a round. Processor time leaves out the time in which others run.
"""

from __future__ import annotations

import gc
import random
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from pgraph_core.study.measures import spread


class Disagreement(Exception):
    """Results of two sides that should be the same are not: their times would say nothing."""


Row = dict[str, Any]  # column -> number or text; rows with the same columns form a table
Sides = Mapping[str, Callable[[], object]]
T = TypeVar("T")


@dataclass(frozen=True)
class Effort:
    """How much a benchmark does: as for the documents, or the smallest size that works."""

    quick: bool = False

    def pick(self, full: T, quick: T) -> T:
        """One of two sizes."""
        return quick if self.quick else full

    @property
    def rounds(self) -> int:
        """Rounds in which sides take turns."""
        return self.pick(21, 3)

    @property
    def shortest(self) -> float:
        """Seconds that a sample lasts at least."""
        return self.pick(1e-2, 1e-4)


def compared(
    effort: Effort, case: str, sides: Sides, *, unit: str = "call", per_call: int = 1,
    agrees: str = "", clocked: frozenset[str] | set[str] = frozenset(), wall: bool = False,
    rounds: int = 0,
) -> Iterator[Row]:  # fmt: skip
    """A row per side: seconds per unit of work, and its time over that of the first side.

    `clocked` sides return their own seconds. `wall` measures by the clock, for threads that share
    the work. `agrees` says how far the results of the sides differ.
    """
    if not sides:
        return
    clock = time.perf_counter if wall else time.process_time
    seconds = in_turns(sides, rounds or effort.rounds, effort.shortest, clock, clocked)
    first = next(iter(sides))
    for side, found in seconds.items():
        low, middle, high = spread([x / per_call for x in found])
        ratio = None if side == first else spread([x / y for x, y in zip(found, seconds[first])])[1]
        yield {
            "case": case, "by": side, "per": unit, "seconds": middle, "low": low, "high": high,
            "ratio": ratio, "agrees": agrees if side == first else "",
        }  # fmt: skip


def in_turns(
    sides: Sides, rounds: int, shortest: float, clock: Callable[[], float] = time.process_time,
    clocked: frozenset[str] | set[str] = frozenset(),
) -> dict[str, list[float]]:  # fmt: skip
    """Seconds per call of every side in every round; the order changes from round to round."""
    shuffle = random.Random(0)
    counts = {side: repeats(call, shortest) for side, call in sides.items()}
    found: dict[str, list[float]] = {side: [] for side in sides}
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for side in shuffle.sample(list(sides), len(sides)):
                n, call = counts[side], sides[side]
                if side in clocked:
                    found[side].append(float(np.mean([call() for _ in range(n)])))  # type: ignore
                    continue
                begin = clock()
                for _ in range(n):
                    call()
                found[side].append((clock() - begin) / n)
    finally:
        gc.enable()
    return found


def repeats(call: Callable[[], object], shortest: float) -> int:
    """Calls in a sample, so that it lasts `shortest` [s]. Warms up first, long calls once."""
    begin = time.perf_counter()
    call()
    if time.perf_counter() - begin > 100 * shortest:
        return 1
    n = 1
    while True:
        begin = time.perf_counter()
        for _ in range(n):
            call()
        total = time.perf_counter() - begin
        if total >= shortest:
            return n
        n = max(2 * n, int(n * shortest / max(total, 1e-7)))


def spent(call: Callable[[], T]) -> tuple[float, T]:
    """(processor seconds, the result) of one call."""
    begin = time.process_time()
    result = call()
    return time.process_time() - begin, result


def differ(found: Any, expected: Any, bound: float, what: str) -> str:
    """The relative difference of two results. Raises Disagreement unless below the bound."""
    error = float(np.abs(found - expected).max() / max(1.0, np.abs(expected).max()))
    if not error < bound:
        raise Disagreement(f"{what}: the results differ by {error:.2e}, so nothing is timed")
    return f"{error:.0e}"
