"""Notices about paths whose length jumped in a run, where a point began or ceased to count."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..dynamics.paths import Jump, jump_text, jumps_of
from ..forces import BetweenPoints
from ..packing import Array, joint_coordinates
from .running import Running


def jumped(record: Running) -> Iterator[str]:
    """Yield a notice about the jumps of each path between two frames, of each place the largest."""
    mech, n = record.mech, record.steps.recorded
    states = record.out.q[:n, : mech.nq]
    for f in record.plan.ranged:
        found, first = dict[tuple[int, float], Jump](), 0.0
        for t, q in _crossings(mech, f, record.steps.times[:n], states):
            for jump in jumps_of(mech.packed, f, q):
                known = found.get((jump.number, jump.at))
                if not _is_at(mech, jump, q) or (known and abs(known.size) >= abs(jump.size)):
                    continue
                first = first if found else t
                found[jump.number, jump.at] = jump
        if found:
            yield jump_text(mech.packed, [*found.values()], f", as at t = {first:.6g} s")


def _crossings(
    mech: Any, f: BetweenPoints, times: Array, states: Array
) -> Iterator[tuple[float, Array]]:
    """Yield (time, q) where a point begins or ceases to count, between two frames by a chord."""
    for via in f.via:
        for end in (via.when.low, via.when.high) if via.when is not None else ():
            assert via.when is not None, "it has a range"
            at = _place(mech, via.when)
            beyond = states[:, at] > end if end == via.when.high else states[:, at] >= end
            for i in np.flatnonzero(beyond[1:] != beyond[:-1]).tolist():
                one, two = states[i], states[i + 1]
                share = (end - one[at]) / (two[at] - one[at])
                q = one + share * (two - one)
                q[at] = end
                yield float(times[i] + share * (times[i + 1] - times[i])), q


def _place(mech: Any, when: Any) -> int:
    number = mech.topology.number(when.body)
    return joint_coordinates(mech.packed.system, number)[when.coordinate][1]


def _is_at(mech: Any, jump: Jump, q: Array) -> bool:
    """Check whether a state is where a path jumps."""
    return bool(q[_place(mech, jump.when)] == jump.at)
