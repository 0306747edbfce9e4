"""Kinds of contact shapes: the geometry of each kind, and arrays of shapes packed for kernels.

The tables are defined in `engine/records.py`. trimesh is only imported when a mesh file is opened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..engine.arrays import Geometry, Ground, Search
from ..engine.contact.curved import HULL_ROOM, RIM
from ..engine.contact.manifold import MOST
from ..engine.contact.placing import DEPTH
from ..engine.records import (
    BOUNDS,
    BOX,
    CANDIDATE,
    CAPSULE,
    CELL,
    CYLINDER,
    EDGE,
    ELLIPSOID,
    FACE,
    HEIGHTFIELD,
    HULL,
    PATCH,
    PLANE,
    POINTS,
    SHAPE,
    SPHERE,
    rows_of,
    table,
)
from ..errors import ModelError, Problem, needed
from ..mesh_files import Scale, load_mesh
from ..model import Shape
from ..model.shape import MassProperties as MassProperties
from ..model.shape import leak as _leak
from ..model.shape import mass_properties as mass_properties
from ..tolerances import NOTABLE

KEPT_HULLS = 128  # hulls that are cached
SIDES = 48  # sides of a cone, which deviates from round by 0.2 % of its radius

# -- what bounds a solid ---------------------------------------------------------------------------


Array = np.ndarray


@dataclass(frozen=True)
class Solid:
    """A shape in its own frame: a ball with `radius` at each vertex, or a convex polytope.

    Cylinders and ellipsoids have no vertices but `radii`: half the edges of their box.
    """

    kind: int
    vertices: Array  # (n, 3) [m]
    rings: tuple[tuple[int, ...], ...] = ()  # vertices around each face, from outside
    edges: Array | None = None  # (m, 4), by default found from the rings
    radius: float = 0.0
    half: float = 0.0
    radii: tuple[float, float, float] | None = None
    columns: int = 0  # columns of a heightfield, whose vertices are its heights by rows
    depth: float = 0.0  # depth of its solid below the lowest height

    @cached_property
    def corners(self) -> tuple[Array, Array]:
        """The numbers of corners of the faces (nface,), and all their vertices in one array."""
        lengths = np.array([len(ring) for ring in self.rings], np.int64)
        return lengths, np.array([v for ring in self.rings for v in ring], np.int64)

    @cached_property
    def normals(self) -> Array:
        """The outward unit normals (nface, 3), by Newell's method."""
        lengths, corners = self.corners
        found, first = np.zeros((len(lengths), 3)), np.cumsum(lengths) - lengths
        for n in np.unique(lengths):
            own = np.flatnonzero(lengths == n)
            p = self.vertices[corners[first[own, None] + np.arange(n)]]
            p = p - p[:, :1]
            found[own] = np.cross(p, np.roll(p, -1, axis=1)).sum(axis=1)
        return found / np.sqrt(np.vecdot(found, found))[:, None]

    @cached_property
    def edges_between(self) -> Array:
        """The edges (nedge, 4) as vertices u, v and faces f, g, with v - u along n_g × n_f."""
        left = dict[tuple[int, int], int]()
        for f, ring in enumerate(self.rings):
            for u, v in zip(ring, (*ring[1:], ring[0])):
                left[u, v] = f
        found = [(u, v, left[v, u], f) for (u, v), f in left.items() if u < v]
        return np.array(found, np.int64).reshape(-1, 4)

    @property
    def box(self) -> tuple[Array, Array]:
        """The bounding box as (half extents, centre) [m]."""
        if self.radii is not None:
            return np.array(self.radii), np.zeros(3)
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        if self.kind in (SPHERE, CAPSULE):
            low, high = low - self.radius, high + self.radius
        low = low - (0.0, 0.0, self.depth)
        return (high - low) / 2, (high + low) / 2

    @property
    def reach(self) -> float:
        """Distance from the shape's origin to its farthest point [m]."""
        if self.kind == CYLINDER:
            return float(np.hypot(self.radius, self.half))
        if self.radii is not None:
            return max(self.radii)
        if self.kind == HEIGHTFIELD:
            half, middle = self.box
            return float(np.linalg.norm(half + abs(middle)))
        return float(np.linalg.norm(self.vertices, axis=1).max() + self.radius)


def sphere(radius: float) -> Solid:
    """Create a sphere about the shape's origin."""
    return Solid(SPHERE, np.zeros((1, 3)), radius=radius)


def capsule(radius: float, length: float) -> Solid:
    """Create a capsule along z, with `length` excluding the caps."""
    ends = np.array(((0.0, 0.0, -length / 2), (0.0, 0.0, length / 2)))
    return Solid(CAPSULE, ends, (), np.array(((0, 1, -1, -1),)), radius, length / 2)


def box(size: Sequence[float]) -> Solid:
    """Create a box with the given edge lengths along x, y and z."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    rings = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Solid(BOX, corners * np.asarray(size, float) / 2, rings)


def cylinder(radius: float, length: float) -> Solid:
    """Along z."""
    radii = (radius, radius, length / 2)
    return Solid(CYLINDER, np.zeros((0, 3)), radius=radius, half=length / 2, radii=radii)


def frustum(radius: float, end: float, length: float) -> Solid:
    """Return a truncated or complete cone along z with SIDES sides.

    Its edges are on the round surface, so sides and rims miss it by `radius` (1 - cos(π / SIDES)).
    """
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    ring = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(SIDES)))
    near = radius * ring - (0.0, 0.0, length / 2)
    far = end * ring[: SIDES if end else 1] + (0.0, 0.0, length / 2)
    return hull(np.concatenate((near, far)))


def ellipsoid(radii: Sequence[float]) -> Solid:
    """Create an ellipsoid with the given semi-axes along x, y and z."""
    x, y, z = radii
    return Solid(ELLIPSOID, np.zeros((0, 3)), radii=(x, y, z))


def heightfield(size: Sequence[float], heights: Any) -> Solid:
    """Create a heightfield on a rectangle about the origin, with heights[i][j] along x and y."""
    heights = np.asarray(heights, float)
    places = [np.linspace(-w / 2, w / 2, n) for w, n in zip(size, heights.shape)]
    grid = np.meshgrid(*places, indexing="ij")
    nodes = np.stack((*grid, heights), axis=-1).reshape(-1, 3)
    sides = [(k, 3 + k, 3 + (k + 1) % 3, (k + 1) % 3) for k in range(3)]
    rings = ((0, 1, 2), *sides, (5, 4, 3))
    columns, depth = heights.shape[1], float(size[2])
    return Solid(HEIGHTFIELD, nodes, rings, _PRISM_EDGES, columns=columns, depth=depth)


def points(places: Any) -> Solid:
    """Create a solid made of explicit contact points in the shape's frame."""
    return Solid(POINTS, np.array(places, float).reshape(-1, 3))


def hull(places: Any) -> Solid:
    """Compute the convex hull of points that span a volume, with coplanar facets merged.

    The result is cached by the points, because models of one sweep have the same meshes.
    """
    return _hull(np.asarray(places, float).tobytes())


@lru_cache(maxsize=KEPT_HULLS)
def _hull(content: bytes) -> Solid:
    from scipy.spatial import ConvexHull

    places = np.frombuffer(content).reshape(-1, 3)
    found = ConvexHull(places)
    group = _levels(found)
    triangles = _turned(found)
    _make_convex(places, triangles, group)
    least = np.argmin(triangles, axis=1)  # the ring of a triangle begins before its first vertex
    single = np.take_along_axis(triangles, (least[:, None] + (2, 0, 1)) % 3, axis=1).tolist()
    rings = list[list[int]]()
    for one in _groups(group):
        if len(one) == 1:
            rings.append(single[one[0]])
        elif (ring := _outline(triangles[one])) is None:
            rings += triangles[one].tolist()
        else:
            at = np.array(ring)
            normal = found.equations[one, :3].mean(axis=0)
            first = ring.index(int(_around(places, np.unique(at), normal)[0]))
            rings.append(ring[first:] + ring[:first])
    kept = sorted({v for ring in rings for v in ring})
    number = {old: new for new, old in enumerate(kept)}
    renamed = tuple(tuple(number[v] for v in ring) for ring in rings)
    return Solid(HULL, places[kept], renamed)


def _groups(group: Array) -> list[Array]:
    """Return the numbers of the triangles of each group, sorted, in the order of the groups."""
    order = np.argsort(group, kind="stable")
    starts = [0, *(np.flatnonzero(np.diff(group[order])) + 1).tolist(), len(order)]
    return [order[a:b] for a, b in pairwise(starts)]


def _levels(found: Any) -> Array:
    """Return the group (n,) of each hull triangle: those that are level with their neighbours."""
    normals = found.equations[:, :3]
    level = np.vecdot(normals[:, None], normals[found.neighbors]) > 1 - NOTABLE**2 / 2
    group = list(range(len(normals)))
    members = {f: [f] for f in group}
    for f, k in np.argwhere(level).tolist():
        old, new = group[found.neighbors[f, k]], group[f]
        if old != new:
            for g in members[old]:
                group[g] = new
            members[new] += members.pop(old)
    return np.array(group)


def _turned(found: Any) -> Array:
    """Return the hull triangles (n, 3), counterclockwise as seen from outside.

    The search proceeds from faces to their neighbours, because the corners of a degenerate triangle
    are not sufficient.
    """
    triangles, places = found.simplices.copy(), found.points
    corners = places[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    first = int(np.argmax(np.linalg.norm(across, axis=1)))
    starts, ends = triangles, np.roll(triangles, -1, axis=1)
    own = starts[:, None, :, None], ends[:, None, :, None]
    other = starts[found.neighbors][:, :, None], ends[found.neighbors][:, :, None]
    same = ((own[0] == other[0]) & (own[1] == other[1])).any(axis=(2, 3))  # edge in one direction
    against = ((own[0] == other[1]) & (own[1] == other[0])).any(axis=(2, 3))
    turns = {first: bool(across[first] @ found.equations[first, :3] < 0)}
    left, beside = [first], found.neighbors.tolist()
    apart = np.stack((same, against), axis=2).tolist()
    while left:
        f = left.pop()
        for g, meet in zip(beside[f], apart[f]):
            if g not in turns:
                turns[g] = meet[turns[f]]
                left.append(g)
    turned = [f for f, turn in turns.items() if turn]
    triangles[turned] = triangles[turned, ::-1]
    return triangles


def _make_convex(places: Array, triangles: Array, group: Array) -> None:
    """Merge faces that have a concave corner with coplanar neighbours.

    The normals of facets between coplanar corners are determined by rounding.
    """
    members = {int(group[one[0]]): one for one in _groups(group)}
    waiting = [number for number, one in members.items() if len(one) > 1]
    if not waiting:
        return
    over = {(u, v): f for f, t in enumerate(triangles.tolist()) for u, v in zip(t, t[1:] + t[:1])}
    near = NOTABLE * float(np.ptp(places, axis=0).max())
    while waiting:
        one = waiting.pop()
        if one not in members or (ring := _outline(triangles[members[one]])) is None:
            continue
        p, ahead = places[ring], np.roll(places[ring], -1, axis=0)
        normal = np.cross(p - p[0], ahead - p[0]).sum(axis=0)
        inward = np.cross(p - np.roll(p, 1, axis=0), ahead - p) @ normal < 0
        edges = zip(ring[1:] + ring[:1], ring)
        others = [int(group[over[edge]]) for edge in edges]
        for other in {o for k in np.flatnonzero(inward) for o in (others[k - 1], others[k])}:
            both = np.union1d(members[one], members[other])
            if _are_level(places, triangles[both], near):
                group[members.pop(other)] = one
                members[one] = both
                waiting.append(one)
                break


def _are_level(places: Array, triangles: Array, near: float) -> bool:
    """Check whether all corners of these triangles lie within `near` of a common plane [m]."""
    p, q, r = places[triangles].transpose(1, 0, 2)
    normal = np.cross(q - p, r - p).sum(axis=0)
    return bool(
        np.ptp((places[np.unique(triangles)] - p[0]) @ normal) < near * np.linalg.norm(normal)
    )


def _outline(triangles: Array) -> list[int] | None:
    """Return the outline of coplanar triangles, or None if it is not a single closed loop."""
    edges = {(u, v) for t in triangles.tolist() for u, v in zip(t, (*t[1:], t[0]))}
    after = {u: v for u, v in edges if (v, u) not in edges}
    if len(after) != sum((v, u) not in edges for u, v in edges):
        return None
    ring = [min(after)] if after else []
    while ring and len(ring) < len(after) and after[ring[-1]] != ring[0]:
        ring.append(after[ring[-1]])
    return ring if ring and len(ring) == len(after) else None


def _around(places: Array, ring: Array, n: Array) -> Array:
    """Sort the vertices of a face counterclockwise about its outward normal."""
    middle = places[ring].mean(axis=0)
    x = places[ring[0]] - middle
    x = x - (x @ n) * n
    y = np.cross(n, x)
    apart = places[ring] - middle
    return ring[np.argsort(np.arctan2(apart @ y, apart @ x))]


def normals_of(solid: Solid) -> Array:
    """Return the outward unit normals (nface, 3), by Newell's method."""
    if solid.kind == HEIGHTFIELD:  # each of its prisms has its own
        return np.zeros((len(solid.rings), 3))
    return solid.normals


def edges_of(solid: Solid) -> Array:
    """Return edges (nedge, 4) as vertices u, v and faces f, g, with v - u along n_g × n_f."""
    return solid.edges if solid.edges is not None else solid.edges_between


# as from `edges_of`, those around the top first
_PRISM_EDGES = np.array(
    [(k, (k + 1) % 3, 1 + k, 0) for k in range(3)]
    + [(3 + k, 3 + (k + 1) % 3, 4, 1 + k) for k in range(3)]
    + [(k, 3 + k, (k + 2) % 3 + 1, 1 + k) for k in range(3)]
)


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
    normals, edges = [normals_of(s) for s in solids], [edges_of(s) for s in solids]
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
        rows_of(EDGE, np.concatenate([np.zeros((0, 4), np.int64), *edges])),
        np.array([k for beside in neighbours for k in beside], np.int64),
        pull / (np.linalg.norm(pull) or 1.0),
    )


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
        for k, i in enumerate(row):
            slack = DEPTH * np.minimum(reach, reach[k])[:, None]
            meet = np.flatnonzero((abs(middle - middle[k]) <= half + half[k] + slack).all(axis=1))
            found[i] = [row[m] for m in meet.tolist() if m != k and partners[i] <= partners[row[m]]]
    return found


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


# -- the kinds of shapes ---------------------------------------------------------------------------


def solids_of(shape: Shape) -> tuple[Solid, ...]:
    """Return the collision solids for a shape in its own frame: one solid, or the parts of a mesh.

    Raises FileError, ModelError, MissingPackage.
    """
    if shape.kind == "mesh" and shape.hull == "parts":
        return convex_parts(shape.file or "", shape.scale)
    return (solid_of(shape),)


def solid_of(shape: Shape, unit: str = "m") -> Solid:
    """Return the solid of a shape that is one, in its own frame. Raises FileError, ModelError."""
    if shape.kind == "mesh":
        return convex_hull(shape.file or "", shape.scale, unit, closed=shape.hull is None)
    return KINDS[shape.kind](shape)


def rounds_of(solid: Solid) -> tuple[Array, Array]:
    """Return (centres (n, 3), semi-axes (n, 3, 3)) of ellipsoids, discs or points, whose convex
    hull is the solid.

    The solid touches a plane where one of them does. Not for heightfields.
    """
    if solid.kind == CYLINDER:
        ends = np.array(((0.0, 0.0, -solid.half), (0.0, 0.0, solid.half)))
        return ends, np.tile(np.diag((solid.radius, solid.radius, 0.0)), (2, 1, 1))
    if solid.radii is not None:
        return np.zeros((1, 3)), np.diag(solid.radii)[None]
    return solid.vertices, np.tile(solid.radius * np.eye(3), (len(solid.vertices), 1, 1))


def convex_hull(
    file: str | Path, scale: Scale = 1.0, unit: str = "m", *, closed: bool = False
) -> Solid:
    """Return the convex hull of a mesh file for collisions.

    Raises FileError, ModelError, also for a mesh that is not closed if `closed` is required.
    """
    mesh = load_mesh(file, scale, unit)
    vertices = np.asarray(mesh.vertices)
    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or spread[2] <= 1e-9 * spread[0]:
        text = "is flat: a shape with contact must have a volume; give a box, or a solid mesh"
        raise ModelError(Problem(f"mesh {file}", "", text))
    if closed and not mesh.is_watertight:
        do = "give a closed mesh, or hull 'convex' to let its convex hull touch"
        raise ModelError(Problem(f"mesh {file}", "", f"{_leak(mesh)}; {do}"))
    return hull(vertices)


def hull_excess(file: str | Path, scale: Scale = 1.0) -> float:
    """Return the ratio of a closed mesh's convex hull volume to its own. Raises FileError,
    ModelError.

    The result is cached until the file changes.
    """
    changed = Path(file).stat().st_mtime_ns if Path(file).is_file() else 0
    return _hull_excess(str(file), scale, changed)


@lru_cache(maxsize=256)
def _hull_excess(file: str, scale: Scale, changed: int) -> float:
    mesh = load_mesh(file, scale)
    return float(mesh.convex_hull.volume / abs(mesh.volume))


MOST_HULLS = 64
HULL_CORNERS = 32  # limit on the corners of a part


def convex_parts(file: str | Path, scale: Scale = 1.0) -> tuple[Solid, ...]:
    """Split a closed mesh into approximate convex parts, using CoACD [Wei et al. 2022].

    The result is cached until the file changes. Raises FileError, MissingPackage, and ModelError
    for a mesh that is not closed or has more than 64 parts.
    """
    changed = Path(file).stat().st_mtime_ns if Path(file).is_file() else 0
    return _convex_parts(str(file), scale, changed)


@lru_cache(maxsize=64)
def _convex_parts(file: str, scale: Scale, changed: int) -> tuple[Solid, ...]:
    mesh = load_mesh(file, scale)
    if not mesh.is_watertight:
        do = "give a closed mesh, or hull 'convex' to let its convex hull touch"
        raise ModelError(Problem(f"mesh {file}", "", f"{_leak(mesh)}; {do}"))
    coacd = needed("coacd", "meshes")
    coacd.set_log_level("error")
    given = coacd.Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    parts = coacd.run_coacd(given, seed=0, decimate=True, max_ch_vertex=HULL_CORNERS)
    if len(parts) > MOST_HULLS:
        text = f"splits into {len(parts)} convex parts, more than {MOST_HULLS}"
        do = "simplify the mesh, use simple shapes, or hull 'convex'"
        raise ModelError(Problem(f"mesh {file}", "", f"{text}; {do}"))
    return tuple(hull(np.unique(vertices, axis=0)) for vertices, _ in parts)


# Every kind of shape but meshes, which are read from files. A new kind is an entry here, its mass
# properties in `model.shape`, a builder in this module, and for the kernels a branch in
# `engine.contact.pairs.single_pair` and in `engine.contact.ground.candidate`, unless it is a convex
# solid with corners.
KINDS: dict[str, Callable[[Shape], Solid]] = {
    "box": lambda s: box(s.size or ()),
    "sphere": lambda s: sphere(s.radius or 0.0),
    "ellipsoid": lambda s: ellipsoid(s.radii or ()),
    "heightfield": lambda s: heightfield(s.size or (), s.heights or ()),
    "cylinder": lambda s: (
        cylinder(s.radius or 0.0, s.length or 0.0)
        if s.end_radius is None
        else frustum(s.radius or 0.0, s.end_radius, s.length or 0.0)
    ),
    "capsule": lambda s: capsule(s.radius or 0.0, s.length or 0.0),
}
