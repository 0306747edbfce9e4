"""Notices about paths that slip to another way past an obstacle between two frames of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from ..dynamics.paths import Paths
from ..errors import choices
from ..forces import BetweenPoints, Via
from ..packing import Array
from ..result.slopes import BESIDE
from ..tolerances import NAMED, SOLVED
from .running import Running

HALVINGS = 24  # halvings of an interval between frames, to a change by bends below SOLVED

End = tuple[float, float, float]  # place in an interval between two frames, length, slope


def slipped(record: Running) -> Iterator[str]:
    """Yield a notice about each path whose length jumps where it changes least evenly.

    A path lies on the side of an obstacle that is nearer to its shortest way, or to `side`, so that
    it may change from one side to the other. `jumping` reports points that count in a range only.
    """
    mech, n = record.mech, record.steps.recorded
    forces = [f for f in record.plan.wrapped if _may_slip(f)]
    if not forces or n < 3:
        return
    paths, states = Paths(mech.packed, forces), record.out.q[:n, : mech.nq]
    change = np.diff([paths.measured(q)[0] for q in states.copy()], axis=0)
    beside = 0.5 * (change[[0, *range(n - 2)]] + change[[*range(1, n - 1), n - 2]])
    uneven = np.abs(change - beside)
    for k, f in enumerate(forces):
        i = int(uneven[:, k].argmax())
        if NAMED * uneven[i, k] <= np.median(uneven[:, k]):  # most intervals are as uneven
            continue
        a, b = states[i], states[i + 1]
        share, jump, whole = _largest_jump(partial(_length, paths, k, a, b))
        if jump > SOLVED * whole:
            t = record.steps.times[i] + share * (record.steps.times[i + 1] - record.steps.times[i])
            yield _text(f, float(t), jump)


def _length(paths: Paths, k: int, a: Array, b: Array, s: float) -> float:
    """Return the length of path k where the part s of the way from q = a to b is done."""
    return float(paths.measured(a + s * (b - a))[0][k])


def _may_slip(f: BetweenPoints) -> bool:
    """Check whether the shortest way past an obstacle of a path may end, or its side may change."""
    past = [via for via in f.via if via.is_obstacle and not via.inner]
    return bool(past) and not any(via.when for via in f.via)


def _largest_jump(length: Callable[[float], float]) -> tuple[float, float, float]:
    """Return (place, size, length) of the jump of a function from 0 to 1.

    The interval is halved, each time to the half whose change differs most from that by the slopes
    at its ends. A change that remains is a jump.
    """

    def end(s: float, width: float) -> End:
        ahead, behind = (length(s + sign * BESIDE * width) for sign in (1.0, -1.0))
        return s, length(s), (ahead - behind) / (2.0 * BESIDE * width)

    ends = [end(0.0, 1.0), end(1.0, 1.0)]
    for _ in range(HALVINGS):
        one = end(0.5 * (ends[0][0] + ends[1][0]), ends[1][0] - ends[0][0])
        ends = max(([ends[0], one], [one, ends[1]]), key=_uneven)
    return ends[0][0], _uneven(ends), ends[0][1]


def _uneven(ends: Sequence[End]) -> float:
    """Return how far a change differs from that by the slopes at its ends."""
    (a, one, slope), (b, two, last) = ends
    return abs(two - one - 0.5 * (b - a) * (slope + last))


def _text(f: BetweenPoints, t: float, jump: float) -> str:
    past = [via for via in f.via if via.is_obstacle]
    names = choices(dict.fromkeys(f"'{via.body}'" for via in past))
    return (
        f"{f.kind} '{f.name}': its path slips to another way past an obstacle on {names} at t = "
        f"{t:.6g} s, and its length jumps by {jump:.3g} m, so that energy and derivatives are "
        f"wrong from there on; {_remedy(past)}"
    )


def _remedy(past: Sequence[Via]) -> str:
    if any(via.axis is None for via in past):
        return "give a cylinder with a `side` in its place, or put a point beside the obstacle"
    if any(via.side is not None for via in past):
        return "move `side` to the middle of the arc that the path takes over the whole motion"
    return "give a `side`"
