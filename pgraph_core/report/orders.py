"""The observed order of a method: the slope of its error over the middle of a ladder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

COARSE, FINE = 0.1, 1e-4  # errors above say nothing of an order; below, where there are enough
FLOOR = 10.0  # times the smallest error: nearer to it rounding has its say
ROUNDING = 1e-15
LEAST = 3  # points of a slope
SMALL = 1e-9  # larger errors are not rounding
MOST_STEPS = 2048


def step_counts() -> list[int]:
    """Numbers of steps, each about a fifth more than the last, all multiples of four."""
    found = {4 * round(2.0 ** (1.0 + k / 4.0)) for k in range(40)}
    return sorted(n for n in found if n <= MOST_STEPS)


def levelled(errors: Sequence[float]) -> bool:
    """Whether shorter steps have stopped to help: rounding, or equations solved no better."""
    return len(errors) > 4 and min(errors) < SMALL and errors[-1] > 0.7 * min(errors[-5:-3])


def observed_order(points: Sequence[tuple[float, float]]) -> float | None:
    """-d log E / d log n over the middle third of the usable points (n steps, E).

    None where they are few.
    """
    errors = [e for _, e in sorted(points)]
    floor = max(ROUNDING, FLOOR * min(errors)) if levelled(errors) else ROUNDING
    usable = sorted((n, e) for n, e in points if n > 0 and floor < e < COARSE)
    fine = [(n, e) for n, e in usable if e < FINE]
    pairs = fine if len(fine) >= 2 * LEAST else usable
    if len(pairs) < LEAST:
        return None
    count = max(LEAST, round(len(pairs) / 3))
    first = (len(pairs) - count) // 2
    n, e = np.log(np.array(pairs[first : first + count])).T
    return float(-np.polyfit(n, e, 1)[0])
