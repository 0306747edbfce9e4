"""Paths over obstacles that follow each other: whether they are the shortest ways at a state."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..forces import BetweenPoints, Via, at_state, legs_of, ways_past
from ..forces.obstacle_rows import Past
from ..forces.path import Place
from ..packing import Array, joint_coordinates
from ..packing.packed import Packed
from ..rotation import unit_vector
from ..tolerances import SOLVED, TINY


def there(packed: Packed, f: BetweenPoints, q: Array) -> BetweenPoints:
    """Return a force with the points of its path at a state."""
    number, system = packed.topology.number, packed.system

    def coordinate(name: str, k: int) -> float:
        return float(q[joint_coordinates(system, number(name))[k][1]])

    return at_state(f, packed.model.body(f.body), coordinate) if f._rides else f


def places_of(packed: Packed, place: Array, turn: Array) -> tuple[Any, Any]:
    """Return the functions of `lines_of` that give points (..., 3) and orientations, from those of
    all bodies (..., nb, 3) and (..., nb, 3, 3)."""
    number = packed.topology.number

    def turned(name: str) -> Array:
        return turn[..., number(name) - 1, :, :] if number(name) else np.eye(3)

    def at(name: str, point: Any) -> Array:
        origin = place[..., number(name) - 1, :] if number(name) else np.zeros(3)
        return origin + turned(name) @ np.asarray(point)

    return at, turned


def has_rows(f: BetweenPoints) -> bool:
    """Check whether obstacles of a path follow each other without a point between them."""
    return any(a.is_obstacle and b.is_obstacle for a, b in itertools.pairwise(f.via))


def no_ways(
    packed: Packed, forces: Sequence[BetweenPoints], q: Array, when: Callable[[BetweenPoints], str]
) -> Iterator[str]:
    """Yield a sentence about each path over obstacles in a row that is not straight between them.

    `when(force)` says at which state.
    """
    forces = [f for f in forces if has_rows(f)]
    at, turned = places_of(packed, *packed.poses(q)) if forces else (None, None)
    for f in forces:
        for p, past, end in legs_of(there(packed, f, q), packed.model.body(f.body)):
            ways, kink = ways_past(past, at, turned, p, end) if len(past) > 1 else ([], 0.0)
            if kink > SOLVED or any(_beyond(past, ways, at, turned, p, end)):
                names = " and ".join(dict.fromkeys(f"'{via.body}'" for via in past))
                yield (
                    f"{f.kind} '{f.name}': there is no shortest way over its {len(past)} obstacles "
                    f"in a row on {names}, on their sides, {when(f)}, so that its length and "
                    "forces are not right; give them other sides or radii, or put a point between "
                    "them"
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
