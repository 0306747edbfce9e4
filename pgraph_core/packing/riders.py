"""Points of paths that ride, as rows behind those of the tree: records of `engine.riders`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.records import rows_of
from ..engine.riders import NEVER, RIDER, SHIFT
from ..forces import BetweenPoints, Shift, Within
from . import Array, joint_coordinates
from .pieces import pieces
from .placed import Placed

NO_RIDERS = rows_of(RIDER, []), rows_of(SHIFT, []), np.zeros((0, at.KNOT)), np.zeros((0, 1))


class Point(NamedTuple):
    """A point or an obstacle of a path: its row, its body and its place in the axes of the row."""

    row: int
    body: int
    place: Array
    shifts: tuple[Shift, ...]
    when: Within | None
    is_round: bool


class Riders:
    """The points that ride of all loads of a model."""

    def __init__(self, placed: Placed, first: int):
        """Start without any. `first` is the first row behind those of the tree in a run."""
        self.placed, self.first = placed, first
        self.rows, self.shifts = list[tuple[Any, ...]](), list[tuple[Any, ...]]()
        self.curves = list[tuple[float, ...]]()

    @property
    def end(self) -> int:
        """The first row behind those of all riders."""
        return self.first + len(self.rows)

    def table(self) -> tuple[Any, Any, Array, Array]:
        """Return the member `riders` of loads."""
        curves = np.array(self.curves).reshape(-1, at.KNOT)
        gates = np.full((len(self.rows), 1), float(NEVER))
        return rows_of(RIDER, self.rows), rows_of(SHIFT, self.shifts), curves, gates

    def carry(self, f: Any, one: Any, vias: Sequence[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
        """Let the points of a packed load ride: its ends in `one`, and its `vias`, which are
        returned."""
        if not isinstance(f, BetweenPoints) or not f._rides:
            return list(vias)
        path = [self._point(f.body, one["point_a"], f.shifts)]
        for via, row in zip(f.via, vias):
            round_ = via.is_obstacle
            path.append(Point(row[0], row[1], np.array(row[2]), via.shifts, via.when, round_))
        path.append(self._point(f.other, one["point_b"], f.other_shifts))
        for k, point in enumerate(path):
            if point.shifts and point.when is None:
                path[k] = self._ride(point, None)
        for k, aside in _in_order(path):
            path[k] = self._ride(path[k], path[aside])
        (one["row_a"], one["point_a"]), (one["row_b"], one["point_b"]) = (
            (x.row, x.place) for x in (path[0], path[-1])
        )
        return [(x.row, row[1], x.place, *row[3:]) for x, row in zip(path[1:-1], vias)]

    def _point(self, name: str, place: Array, shifts: tuple[Shift, ...]) -> Point:
        number = self.placed.number(name)
        return Point(self.placed.packed.row_of(number), number, place.copy(), shifts, None, False)

    def _ride(self, point: Point, away: Point | None) -> Point:
        """Add a rider, which lies at the point `away` while it does not count."""
        home, first = self.placed.home_of_number(point.body), len(self.shifts)
        for shift in point.shifts:
            v, q = self._coordinate(shift)
            rows = pieces(shift.pieces)
            self.shifts.append((q, v, len(self.curves), len(rows), home @ np.array(shift.along)))
            self.curves += rows
        gate, gate_v, low, high, other = -1, -1, 0.0, 0.0, point if away is None else away
        if (when := point.when) is not None:
            (gate_v, gate), low, high = self._coordinate(when), when.low, when.high
        row = self.end
        self.rows.append((
            row, point.row, point.body, first, len(point.shifts), gate, gate_v, other.row,
            other.body, point.place, other.place, low, high,
        ))  # fmt: skip
        return point._replace(row=row, place=np.zeros(3))

    def _coordinate(self, of: Shift | Within) -> tuple[int, int]:
        """Return the indices into v and q of a coordinate."""
        number = self.placed.number(of.body)
        v, q = joint_coordinates(self.placed.packed, number)[of.coordinate]
        return int(v), int(q)


def _in_order(path: Sequence[Point]) -> list[tuple[int, int]]:
    """Return (number of a point that counts in a range, number of that where it lies otherwise).

    The other one comes before it. It is the point before it in the path, or if an obstacle stands
    there, the one behind it.
    """
    found, k = list[tuple[int, int]](), 1
    while k < len(path):
        end = k
        while path[end].when is not None:
            end += 1
        if path[k - 1].is_round:
            found += [(n, n + 1) for n in range(end - 1, k - 1, -1)]
        else:
            found += [(n, n - 1) for n in range(k, end)]
        k = end + 1
    return found
