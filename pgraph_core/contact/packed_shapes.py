"""Arrays of shapes, and of the ground, packed for kernels.

The tables are defined in `engine/records.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..engine.arrays import Geometry, Ground, Search
from ..engine.contact.curved import HULL_ROOM, RIM
from ..engine.contact.manifold import MOST
from ..engine.contact.placing import DEPTH
from ..engine.records import (
    BOUNDS,
    CANDIDATE,
    CELL,
    EDGE,
    FACE,
    HEIGHTFIELD,
    PATCH,
    PLANE,
    POINTS,
    SHAPE,
    rows_of,
    table,
)
from ..packing import Ints
from ..shapes.solid import Array, Solid, edges_of


class Placed(NamedTuple):
    """A solid on a body. `position` and `rotation` are in the home axes of the body's row."""

    solid: Solid
    row: int
    body: int
    position: Sequence[float] = (0.0, 0.0, 0.0)
    rotation: Any = np.eye(3)
    surface: tuple[Sequence[float], Sequence[float]] = (3 * (0.0,), 3 * (0.0,))  # velocity, spin


def packed(
    shapes: Iterable[Placed],
    neighbours: Sequence[Sequence[int]] = (),
    gravity: Sequence[float] = (0.0, 0.0, 0.0),
) -> Geometry:
    """Pack the shapes for the kernels, with `neighbours` as returned by `neighbours_of`."""
    shapes = list(shapes)
    pull = np.array(gravity, float)
    neighbours = neighbours or [()] * len(shapes)
    found = table(SHAPE, len(shapes))
    solids = [shape.solid for shape in shapes]
    normals, edges = [s.normals for s in solids], [edges_of(s) for s in solids]
    first = np.zeros(3, np.int64)
    before = 0
    for i, shape in enumerate(shapes):
        s = shape.solid
        counts = np.array((len(s.vertices), len(s.rings), len(edges[i])))
        ranges = np.stack((first, counts), axis=1).ravel()
        half, middle = s.box
        rotation = np.asarray(shape.rotation, float).ravel()
        place = (shape.position, rotation, s.radius, s.half, half, middle, s.reach)
        beside = before, len(neighbours[i])
        surface = any(map(any, shape.surface)), *shape.surface
        found[i] = (s.kind, shape.row, shape.body, *ranges, s.columns, *beside, *place, *surface)
        first += counts
        before += len(neighbours[i])
    none = np.zeros(0, np.int64)
    lengths = np.concatenate([none, *(s.corners[0] for s in solids)])
    faces = table(FACE, len(lengths))
    faces["first"], faces["corners"] = np.cumsum(lengths) - lengths, lengths
    return Geometry(
        found,
        np.concatenate([np.zeros((0, 3)), *(s.vertices for s in solids)]),
        np.concatenate([np.zeros((0, 3)), *normals]),
        faces,
        np.concatenate([none, *(s.corners[1] for s in solids)]),
        _edges(np.concatenate([np.zeros((0, 4), np.int64), *edges])),
        np.array([k for beside in neighbours for k in beside], np.int64),
        pull / (np.linalg.norm(pull) or 1.0),
    )


def _edges(rows: Ints) -> Any:
    """Return the records of edges (n, 4), by columns, since there are many."""
    found = table(EDGE, len(rows))
    for name, column in zip(EDGE.names or (), rows.T):
        found[name] = column
    return found


def neighbours_of(shapes: Sequence[Placed], partners: Sequence[set[Any]]) -> list[list[int]]:
    """Find the shapes that form one solid with each shape, i.e. shapes of the same row with
    overlapping boxes.

    A neighbour must be able to touch all partners of the shape (`partners` of each). Otherwise it
    would be missing for some of them.
    """
    found: list[list[int]] = [[] for _ in shapes]
    by_row: dict[int, list[int]] = {}
    for i, shape in enumerate(shapes):
        if partners[i] and shape.solid.kind != POINTS:
            by_row.setdefault(shape.row, []).append(i)
    for row in by_row.values():
        if len(row) == 1:
            continue
        placed = [shapes[i] for i in row]
        boxes = [p.solid.box for p in placed]
        turns = [np.asarray(p.rotation, float).reshape(3, 3) for p in placed]
        middle = np.array([p.position + r @ b[1] for p, b, r in zip(placed, boxes, turns)])
        half = np.array([abs(r) @ b[0] for b, r in zip(boxes, turns)])
        reach = np.array([p.solid.reach for p in placed])
        for k, others in _near(middle, half + DEPTH * reach[:, None]):
            slack = DEPTH * np.minimum(reach[others], reach[k])[:, None]
            apart = abs(middle[others] - middle[k])
            meet = others[(apart <= half[others] + half[k] + slack).all(axis=1)]
            for i, m in ((row[k], row[m]) for m in meet.tolist()):
                found[i] += [m] if partners[i] <= partners[m] else []
                found[m] += [i] if partners[m] <= partners[i] else []
    return [sorted(beside) for beside in found]


def _near(middle: Array, half: Array) -> Iterator[tuple[int, Array]]:
    """Yield each box with boxes that may overlap it, so that each pair comes once.

    The boxes are sorted along the direction in which they are spread most.
    """
    axis = int(np.argmax(np.ptp(middle, axis=0)))
    low, high = middle[:, axis] - half[:, axis], middle[:, axis] + half[:, axis]
    order = np.argsort(low)
    ends = np.searchsorted(low[order], high[order], side="right")
    for place, (k, end) in enumerate(zip(order.tolist(), ends.tolist()), start=1):
        if place < end:
            yield k, order[place:end]


def ground(normal: Sequence[float], patches: Iterable[Sequence[float]] = ()) -> Ground:
    """Return the kernels' `ground`: the plane and its patches (x0, x1, y0, y1, height, box).

    `box` is 1 if a box replaces the plane, otherwise 0 or omitted. x and y of a patch are along
    `ground_axes`, its height is along the normal [m].
    """
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    plane = table(PLANE, 1)
    plane[0] = (n, *ground_axes(n))
    return Ground(plane, rows_of(PATCH, list(patches)))


def ground_axes(normal: Array) -> tuple[Array, Array]:
    """Return the plane's x and y: the two world axes after the steepest one, projected onto the
    plane.

    The axes are x and y for the normal z, z and x for y, and y and z for x.
    """
    up = int(np.argmax(np.abs(normal)))
    first = np.eye(3)[(up + 1) % 3]
    x = first - (first @ normal) * normal
    x /= np.linalg.norm(x)
    return x, np.cross(normal, x)


def search_space(geometry: Geometry, members: int) -> Search:
    """Allocate buffers for the contact point search, for the given number of members."""
    shapes = geometry.shapes
    single = shapes[shapes["kind"] != HEIGHTFIELD]
    corners = max(int(single["vertices"].max(initial=0)), 6)  # 6: of a prism
    sides = int(shapes["faces"].max(initial=0))
    ring = int(geometry.faces["corners"].max(initial=0))
    ring = max(ring, RIM)
    rows = 2 * (corners + sides) + HULL_ROOM + 6 * (ring + corners) + MOST
    buckets = 1 << max(2 * members - 1, 1).bit_length()
    return Search(
        table(CANDIDATE, rows),
        table(BOUNDS, len(shapes)),
        table(CELL, members),
        np.zeros(buckets, np.int64),
    )
