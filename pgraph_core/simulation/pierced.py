"""Notices about paths past obstacles in a frame of a run: with a point inside an obstacle beside
it, or without a shortest way over obstacles that follow each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dynamics.paths import coordinates
from ..forces import BetweenPoints, Via, at_state, legs_of, ways_past
from ..forces.obstacle_rows import Past
from ..forces.obstacles import ELLIPSOID, obstacle_of
from ..forces.path import Place
from ..packing import Array
from ..rotation import unit_vector
from ..tolerances import SOLVED, TINY
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
        kinks = (x for t, q in zip(times, states) for x in _kinked(mech, paths, q, t))
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
            for via, name, inside in _points_inside(mech, _there(mech, f, q[0]), q):
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


def _kinked(mech: Any, forces: Iterable[BetweenPoints], q: Array, t: float) -> Iterator[str]:
    """Yield a text about each path over obstacles in a row that is not straight between them."""
    rows = [
        (f, leg)
        for f in forces
        for leg in legs_of(_there(mech, f, q), mech.model.body(f.body))
        if len(leg[1]) > 1
    ]
    at, turned = _places(mech, q) if rows else (None, None)
    for f, (p, past, end) in rows:
        ways, kink = ways_past(past, at, turned, p, end)
        if kink > SOLVED or any(_beyond(past, ways, at, turned, p, end)):
            names = " and ".join(dict.fromkeys(f"'{via.body}'" for via in past))
            yield (
                f"{f.kind} '{f.name}': there is no shortest way over its {len(past)} obstacles in "
                f"a row on {names}, on their sides, at t = {t:.6g} s, so that its length and "
                "forces are not right; give them other sides or radii, or put a point between them"
            )


def _beyond(
    past: Sequence[Via], ways: Sequence[Past], at: Any, turned: Any, p: Place, q: Place
) -> Iterator[bool]:
    """Yield for each cylinder that a path does not touch whether it passes on its other side."""
    begin = at(*p)
    for k, (via, way) in enumerate(zip(past, ways)):
        if not way.free:
            begin = way.last
        elif via.axis is not None and via.side is not None:
            end = next((x.first for x in ways[k + 1 :] if not x.free), at(*q))
            u, centre = turned(via.body) @ unit_vector(via.axis), at(via.body, via.point)
            ahead, near = (x - (u @ x) * u for x in (end - begin, begin - centre))
            s = np.clip(-(ahead @ near) / max(ahead @ ahead, TINY), 0.0, 1.0)
            yield bool((near + s * ahead) @ (at(via.body, via.side) - centre) < 0.0)


def _points_inside(
    mech: Any, f: BetweenPoints, states: Array
) -> Iterator[tuple[Via, str, NDArray[np.bool_]]]:
    """Yield (obstacle, body, whether it is inside (n,)) of each point beside an obstacle."""
    at, turned = _places(mech, states)
    for p, past, q in legs_of(f, mech.model.body(f.body)):
        for via, (name, point) in ((past[0], p), (past[-1], q)) if past else ():
            apart = at(name, point) - at(via.body, via.point)
            yield via, name, _is_within(via, np.einsum("...ji,...j->...i", turned(via.body), apart))


def _there(mech: Any, f: BetweenPoints, q: Array) -> BetweenPoints:
    """Return a force with the points of its path at a state."""
    return at_state(f, mech.model.body(f.body), coordinates(mech.packed, q)) if f._rides else f


def _places(mech: Any, states: Array) -> tuple[Any, Any]:
    """Return the functions of `lines_of` that give points (..., 3) and orientations at states."""
    number = mech.topology.number
    place, turn = mech.poses(states)

    def turned(name: str) -> Array:
        return turn[..., number(name) - 1, :, :] if number(name) else np.eye(3)

    def at(name: str, point: Any) -> Array:
        origin = place[..., number(name) - 1, :] if number(name) else np.zeros(3)
        return origin + turned(name) @ np.asarray(point)

    return at, turned


def _is_within(via: Via, a: Array) -> NDArray[np.bool_]:
    """Check whether points a (..., 3) [m], in its body's axes from its centre, are in an
    obstacle."""
    own = obstacle_of(via)
    if own["shape"] == ELLIPSOID:
        a = a @ own["axes"].reshape(3, 3) / own["radii"]
    else:
        a = (a - (a @ own["axis"])[..., None] * own["axis"]) / own["radius"]
    return np.atleast_1d(np.sum(a * a, axis=-1) < 1.0 - SOLVED)
