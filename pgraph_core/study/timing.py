"""Timing in one process and one thread, all runs in turn in shuffled rounds; the machine."""

from __future__ import annotations

import gc
import os
import platform
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median, quantiles

Spread = tuple[float, float, float]  # lower quartile, median, upper quartile
SHORTEST = 2e-3  # s; a sample of a shorter run is the median of several
MOST_REPEATS = 20


def spread(values: Sequence[float]) -> Spread:
    """Lower quartile, median, upper quartile."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, _, high = quantiles(values, n=4, method="inclusive")
    return low, median(values), high


def least(values: Sequence[float]) -> Spread:
    """The minimum, twice, and the upper quartile: other programs only add to processor time."""
    return min(values), min(values), spread(values)[2]


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
    """Number of runs in a sample, for a run of so many seconds."""
    return max(1, min(MOST_REPEATS, int(SHORTEST / max(seconds, 1e-9))))


def measured(
    runs: Sequence[Callable[[], float]],
    expected: Sequence[float],
    rounds: int,
    *,
    seed: int = 0,
    progress: Callable[[float], None] = lambda _: None,
) -> list[list[float]]:
    """Seconds of every run in every round; each run returns its own seconds.

    `expected` are rough seconds of the runs, for the fractions; `progress(fraction)` is called
    between the runs and may raise to end the measurement.
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
                progress(min(1.0, done / total))
    return found


def ratios(seconds: Sequence[float], baseline: Sequence[float]) -> Spread:
    """Ratio to the baseline, taken round by round."""
    return spread([x / y for x, y in zip(seconds, baseline)])


def machine(
    packages: tuple[str, ...] = ("pgraph-dynamics", "numpy", "numba"),
) -> dict[str, str | int]:
    """CPU model, cores that may be used, versions of Python and of packages."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": cpu(),
        "cores": cores or 1,
        "python": platform.python_version(),
        **{name: package_version(name) for name in packages},
    }


def cpu() -> str:
    """The CPU's model name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def package_version(name: str) -> str:
    """A package's version, or that it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
