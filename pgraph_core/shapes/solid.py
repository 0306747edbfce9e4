"""Solids by which shapes touch, in the form that kernels take."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..engine.records import POINTS

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

    @property
    def of_balls(self) -> bool:
        """True if it touches a plane by the balls at its vertices alone."""
        return not self.rings and self.radii is None

    @property
    def is_field(self) -> bool:
        """True for a heightfield."""
        return self.columns > 0

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

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The bounding box as (half extents, centre) [m]."""
        if self.radii is not None:
            return np.array(self.radii), np.zeros(3)
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        low, high = low - self.radius, high + self.radius
        low = low - (0.0, 0.0, self.depth)
        return (high - low) / 2, (high + low) / 2

    @cached_property
    def reach(self) -> float:
        """Distance from the shape's origin to its farthest point [m]."""
        if self.radii is not None:
            return max(self.radii)
        return float(np.linalg.norm(self.vertices, axis=1).max() + self.radius)

    @property
    def rounds(self) -> tuple[Array, Array] | None:
        """Centres (n, 3) and semi-axes (n, 3, 3) of ellipsoids, discs or points, whose convex hull
        is the solid, or None if there are none.

        The solid touches a plane where one of them does.
        """
        if self.radii is not None:
            return np.zeros((1, 3)), np.diag(self.radii)[None]
        return self.vertices, np.tile(self.radius * np.eye(3), (len(self.vertices), 1, 1))


def points(places: Any) -> Solid:
    """Create a solid made of explicit contact points in the shape's frame."""
    return Solid(POINTS, np.array(places, float).reshape(-1, 3))


def edges_of(solid: Solid) -> Array:
    """Return edges (nedge, 4) as vertices u, v and faces f, g, with v - u along n_g × n_f."""
    return solid.edges if solid.edges is not None else solid.edges_between
