"""Notices about paths past obstacles in a frame of a run: with a point inside an obstacle beside
it, or without a shortest way over obstacles that follow each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dynamics.ways import has_rows, no_ways, places_of, there
from ..forces import BetweenPoints, Via, legs_of
from ..forces.obstacles import ELLIPSOID, obstacle_of
from ..packing import Array
from ..tolerances import SOLVED
from .running import Running


def pierced(record: Running) -> Iterator[str]:
    """Yield a notice about the first path with a point inside an obstacle, in the frames, and one
    about the first path without a shortest way.

    A point that is inside between two frames is not seen.
    """
    mech, n, paths = record.mech, record.steps.recorded, record.plan.wrapped
    times, states = record.steps.times[:n], record.out.q[:n, : mech.nq].copy()
    if paths:
        yield from _inside(mech, paths, times, states)
        frames = zip(times, states) if any(map(has_rows, paths)) else ()
        kinks = (
            text for t, q in frames
            for text in no_ways(mech.packed, paths, q, lambda _, t=t: f"at t = {t:.6g} s")
        )  # fmt: skip
        yield from itertools.islice(kinks, 1)


def _inside(
    mech: Any, forces: Iterable[BetweenPoints], times: Array, states: Array
) -> Iterator[str]:
    """Yield a text about the point that is the first to be inside an obstacle beside it."""
    first = len(times)
    found = None
    for f in forces:
        rides = f._rides  # then its points are others in each frame
        for k, q in enumerate(states[:first, None]) if rides else ((0, states[:first]),):
            for via, name, inside in _points_inside(mech, there(mech.packed, f, q[0]), q):
                if inside.any() and (i := k + int(inside.argmax())) < first:
                    first, found = i, (f, via, name)
            if rides and found is not None and first <= k:
                break
    if found is not None:
        f, via, name = found
        yield (
            f"{f.kind} '{f.name}': its point on '{name}' is inside the obstacle of radius "
            f"{via.largest:.6g} m on '{via.body}' at t = {times[first]:.6g} s, and the path jumps "
            "to the straight line; move the point outside"
        )


def _points_inside(
    mech: Any, f: BetweenPoints, states: Array
) -> Iterator[tuple[Via, str, NDArray[np.bool_]]]:
    """Yield (obstacle, body, whether it is inside (n,)) of each point beside an obstacle."""
    at, turned = places_of(mech.packed, *mech.poses(states))
    for p, past, q in legs_of(f, mech.model.body(f.body)):
        for via, (name, point) in ((past[0], p), (past[-1], q)) if past else ():
            apart = at(name, point) - at(via.body, via.point)
            yield via, name, _is_within(via, np.einsum("...ji,...j->...i", turned(via.body), apart))


def _is_within(via: Via, a: Array) -> NDArray[np.bool_]:
    """Check whether points a (..., 3) [m], in its body's axes from its centre, are in an
    obstacle."""
    own = obstacle_of(via)
    if own["shape"] == ELLIPSOID:
        a = a @ own["axes"].reshape(3, 3) / own["radii"]
    else:
        a = (a - (a @ own["axis"])[..., None] * own["axis"]) / own["radius"]
    return np.atleast_1d(np.sum(a * a, axis=-1) < 1.0 - SOLVED)
