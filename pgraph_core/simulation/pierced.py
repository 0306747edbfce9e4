"""Notices about paths past obstacles in a frame of a run: with a point inside an obstacle beside
it, or without a shortest way over obstacles that follow each other, and about paths that slip off
an obstacle between two frames."""

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
from ..result.slopes import BESIDE
from ..rotation import unit_vector
from ..tolerances import SOLVED, TINY
from .running import Running

HALVINGS = 24  # of an interval between frames, to a change by its bends below SOLVED


def pierced(record: Running) -> Iterator[str]:
    """Yield a notice about the first path with a point inside an obstacle, in the frames, one about
    the first path without a shortest way, and one about each path that slips off an obstacle.

    A point that is inside between two frames is not seen.
    """
    mech = record.mech
    states = [(t, record.out.q[i, : mech.nq]) for i, t in enumerate(record.steps.times)]
    states = states[: record.steps.recorded]
    paths = record.plan.wrapped
    for text in (_inside, _kinked) if paths else ():
        yield from itertools.islice((x for t, q in states for x in text(mech, paths, q, t)), 1)
    for f in paths:
        for leg in legs_of(f, mech.model.body(f.body)):
            if _may_slip(leg[1]):
                yield from _slipped(mech, f, leg, states)


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


def _may_slip(past: Sequence[Via]) -> bool:
    """Check whether the shortest way over obstacles may end on its side: not over cylinders."""
    held = len(past) > 1 or any(via.radii is not None and via.side is not None for via in past)
    return held and any(via.axis is None for via in past)


def _slipped(
    mech: Any, f: BetweenPoints, leg: tuple[Place, tuple[Via, ...], Place], states: Sequence[Any]
) -> Iterator[str]:
    """Yield a text if the length of a leg jumps where it changes least evenly between frames.

    The interval is halved, each time to the half whose change differs most from that by the slopes
    at its ends. A change that remains is a jump.
    """

    def length(q: Array) -> float:
        at, turned = _places(mech, q)
        return sum(way.length for way in ways_past(leg[1], at, turned, leg[0], leg[2])[0])

    def slope(a: Array, b: Array, s: float, width: float) -> float:
        ahead, behind = (a + (s + x * BESIDE * width) * (b - a) for x in (1.0, -1.0))
        return (length(ahead) - length(behind)) / (2.0 * BESIDE * width)

    if len(states) < 2:
        return
    change = np.diff([length(q) for _, q in states])
    uneven = np.abs(
        change - 0.5 * (np.r_[change[:1], change[:-1]] + np.r_[change[1:], change[-1:]])
    )
    k = int(uneven.argmax() if len(change) > 2 else np.abs(change).argmax())
    (t, a), (end, b) = states[k : k + 2]
    ends = [(s, length(a + s * (b - a)), slope(a, b, s, 1.0)) for s in (0.0, 1.0)]
    for _ in range(HALVINGS):
        middle, width = 0.5 * (ends[0][0] + ends[1][0]), ends[1][0] - ends[0][0]
        one = middle, length(a + middle * (b - a)), slope(a, b, middle, width)
        halves = [(ends[0], one), (one, ends[1])]
        ends = max(halves, key=_uneven)
    jump = _uneven(ends)
    if jump > SOLVED * ends[0][1]:
        names = " and ".join(dict.fromkeys(f"'{via.body}'" for via in leg[1]))
        yield (
            f"{f.kind} '{f.name}': its path slips over an obstacle on {names} at t = "
            f"{t + ends[0][0] * (end - t):.6g} s to another way, as no shortest way is held on a "
            f"side of a sphere or ellipsoid: its length jumps by {jump:.3g} m, and energy is lost "
            "or gained; give a cylinder in its place, or put a point between the obstacles"
        )


def _uneven(ends: Sequence[tuple[float, float, float]]) -> float:
    """Return how far a change differs from that by the slopes at its ends.

    An end is its place, value and slope.
    """
    (a, one, slope), (b, two, last) = ends
    return abs(two - one - 0.5 * (b - a) * (slope + last))


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
    return at_state(f, mech.model.body(f.body), coordinates(mech.packed, q)) if f.rides else f


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
