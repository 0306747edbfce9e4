"""Honest timing: one process, one thread, all runs in turn in shuffled rounds."""

from __future__ import annotations

import gc
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from statistics import median, quantiles

Spread = tuple[float, float, float]  # lower quartile, median, upper quartile
SHORTEST = 2e-3  # s that a sample lasts at least: shorter ones are made of several runs
MOST_REPEATS = 20


def spread(values: Sequence[float]) -> Spread:
    """Lower quartile, median, upper quartile."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, _, high = quantiles(values, n=4, method="inclusive")
    return low, median(values), high


@contextmanager
def undisturbed() -> Iterator[None]:
    """No garbage collection within."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def repeats(seconds: float) -> int:
    """Runs a sample, of a run that takes so long."""
    return max(1, min(MOST_REPEATS, int(SHORTEST / max(seconds, 1e-9))))


def measured(
    runs: Sequence[Callable[[], float]],
    expected: Sequence[float],
    rounds: int,
    *,
    seed: int = 0,
    said: Callable[[float], None] = lambda _: None,
) -> list[list[float]]:
    """Seconds of every run in every round; each run gives its own seconds.

    `expected` are rough seconds of the runs, from which a round is divided up; `said(fraction)`
    is called between the runs and may raise to end it all.
    """
    shuffle = random.Random(seed)
    found: list[list[float]] = [[] for _ in runs]
    counts = [repeats(seconds) for seconds in expected]
    total = rounds * sum(n * s for n, s in zip(counts, expected)) or 1.0
    done = 0.0
    with undisturbed():
        for _ in range(rounds):
            for i in shuffle.sample(range(len(runs)), len(runs)):
                found[i].append(median(runs[i]() for _ in range(counts[i])))
                done += counts[i] * expected[i]
                said(min(1.0, done / total))
    return found


def ratios(seconds: Sequence[float], baseline: Sequence[float]) -> Spread:
    """How many times longer, round by round."""
    return spread([x / y for x, y in zip(seconds, baseline)])
