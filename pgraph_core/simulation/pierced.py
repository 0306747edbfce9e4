"""Notices about paths past obstacles in a frame of a run: with a point inside an obstacle beside
it, or without a shortest way over obstacles that follow each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from ..dynamics.paths import coordinates
from ..forces import BetweenPoints, Via, at_state, legs_of, ways_past
from ..forces.obstacle_rows import Past
from ..forces.obstacles import ELLIPSOID, obstacle_of, turned_by
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
    mech = record.mech
    states = [(t, record.out.q[i, : mech.nq]) for i, t in enumerate(record.steps.times)]
    states = states[: record.steps.recorded]
    paths = record.plan.wrapped
    for text in (_inside, _kinked) if paths else ():
        yield from itertools.islice((x for t, q in states for x in text(mech, paths, q, t)), 1)


def _inside(mech: Any, forces: Iterable[BetweenPoints], q: Array, t: float) -> Iterator[str]:
    for f, via, name in within(mech, forces, q):
        yield (
            f"{f.kind} '{f.name}': its point on '{name}' is inside the obstacle of radius "
            f"{via.largest:.6g} m on '{via.body}' at t = {t:.6g} s, and the path jumps to the "
            "straight line; move the point outside"
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


def within(
    mech: Any, forces: Iterable[BetweenPoints], state: Array
) -> Iterator[tuple[BetweenPoints, Via, str]]:
    """Yield (force, obstacle, body) of each point of a path inside an obstacle beside it."""
    at, turned = _places(mech, state)
    for f in forces:
        for p, past, q in legs_of(_there(mech, f, state), mech.model.body(f.body)):
            ends = ((past[0], p), (past[-1], q)) if past else ()
            for via, (name, point) in ends:
                if _is_within(via, turned(via.body), at(name, point) - at(via.body, via.point)):
                    yield f, via, name


def _there(mech: Any, f: BetweenPoints, q: Array) -> BetweenPoints:
    """Return a force with the points of its path at a state."""
    return at_state(f, mech.model.body(f.body), coordinates(mech.packed, q)) if f._rides else f


def _places(mech: Any, state: Array) -> tuple[Any, Any]:
    """Return the functions of `lines_of` that give points and orientations at a state."""
    number = mech.topology.number
    place, turn = mech.poses(state)

    def turned(name: str) -> Array:
        return turn[number(name) - 1] if number(name) else np.eye(3)

    def at(name: str, point: Any) -> Array:
        origin = place[number(name) - 1] if number(name) else np.zeros(3)
        return origin + turned(name) @ np.asarray(point)

    return at, turned


def _is_within(via: Via, turn: Array, a: Array) -> bool:
    """Check whether a point a [m], relative to the centre of an obstacle, is inside it."""
    own = turned_by(obstacle_of(via), turn)
    if own["shape"] == ELLIPSOID:
        a = a @ own["axes"].reshape(3, 3) / own["radii"]
    else:
        a = (a - (own["axis"] @ a) * own["axis"]) / own["radius"]
    return bool(np.dot(a, a) < 1.0 - SOLVED)
