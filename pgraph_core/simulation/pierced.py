"""A notice about points of paths that are inside an obstacle beside them, in a frame of a run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..forces import BetweenPoints, Via, legs_of
from ..packing import Array
from ..rotation import unit_vector
from ..tolerances import SOLVED
from .running import Running


def pierced(record: Running) -> Iterator[str]:
    """Yield a notice about the first path with a point inside an obstacle, in the frames.

    A point that is inside between two frames is not seen.
    """
    mech = record.mech
    for i in range(record.steps.recorded):
        for f, via, name in within(mech, record.plan.wrapped, record.out.q[i, : mech.nq]):
            yield (
                f"{f.kind} '{f.name}': its point on '{name}' is inside the obstacle of radius "
                f"{via.radius:.6g} m on '{via.body}' at t = {record.steps.times[i]:.6g} s, and the "
                "path jumps to the straight line; move the point outside"
            )
            return


def within(
    mech: Any, forces: Iterable[BetweenPoints], state: Array
) -> Iterator[tuple[BetweenPoints, Via, str]]:
    """Yield (force, obstacle, body) of each point of a path inside an obstacle beside it."""
    number = mech.topology.number
    place, turn = mech.poses(state)

    def turned(name: str) -> Array:
        return turn[number(name) - 1] if number(name) else np.eye(3)

    def at(name: str, point: Any) -> Array:
        origin = place[number(name) - 1] if number(name) else np.zeros(3)
        return origin + turned(name) @ np.asarray(point)

    for f in forces:
        for p, past, q in legs_of(f, mech.model.body(f.body)):
            ends = ((past[0], p), (past[-1], q)) if past else ()
            for via, (name, point) in ends:
                if _is_within(via, turned(via.body), at(name, point) - at(via.body, via.point)):
                    yield f, via, name


def _is_within(via: Via, turn: Array, a: Array) -> bool:
    """Check whether a point a [m], relative to the centre of an obstacle, is inside it."""
    assert via.radius is not None, "it is round"
    if via.axis is not None:
        u = turn @ unit_vector(via.axis)
        a = a - (u @ a) * u
    return bool(np.dot(a, a) < via.radius**2 * (1.0 - SOLVED))
