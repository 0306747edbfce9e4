"""Convex hulls of points, with coplanar facets merged."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from ..engine.records import HULL
from ..tolerances import NOTABLE
from .solid import Array, Solid

KEPT_HULLS = 128  # hulls that are cached


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
