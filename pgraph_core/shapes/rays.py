"""Points in which rays meet boxes, ellipsoids, cones, discs and triangles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

Array = np.ndarray


class Ray(NamedTuple):
    """A ray from the camera through the pointer."""

    origin: Array  # (3,) [m]
    direction: Array  # (3,) unit vector
    slack: float  # tangent of the angle within which a point counts as pointed at

    def seen_from(self, position: Array, R: Array) -> Ray:
        """Transform it into the axes of a body or piece."""
        return Ray(R.T @ (self.origin - position), R.T @ self.direction, self.slack)


class Hit(NamedTuple):
    """The intersection of a ray with a surface, in the axes of the piece or body."""

    far: float  # along the ray [m]
    direction: Array  # (3,) unit: the normal of a flat face, the axis of a round one
    what: str


def box_hits(half: Array, ray: Ray) -> Iterator[Hit]:
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - ray.origin) / ray.direction, (half - ray.origin) / ray.direction
    enters = np.where(np.isnan(a) | np.isnan(b), -np.inf, np.minimum(a, b))
    leaves = np.where(np.isnan(a) | np.isnan(b), np.inf, np.maximum(a, b))
    if 0 < (far := float(enters.max())) <= leaves.min():
        k = int(enters.argmax())
        yield Hit(far, -math.copysign(1.0, ray.direction[k]) * np.eye(3)[k], "flat face")


def ellipsoid_hits(half: Array, middle: Array, ray: Ray) -> Iterator[Hit]:
    o, d = (ray.origin - middle) / half, ray.direction / half
    for far in _roots(float(d @ d), float(o @ d), float(o @ o) - 1.0):
        normal = (o + far * d) / half
        yield Hit(far, normal / np.linalg.norm(normal), "round face")


def cone_hits(low: tuple[float, float], high: tuple[float, float], ray: Ray) -> Iterator[Hit]:
    """Yield hits on a conical side between two (height, radius) pairs, and the cone's axis."""
    (z0, r0), (z1, r1) = low, high
    if z1 - z0 < 1e-12:
        return
    k = (r1 - r0) / (z1 - z0)
    (x, y, z), (dx, dy, dz) = ray.origin, ray.direction
    r = r0 + k * (z - z0)
    a, b, c = dx * dx + dy * dy - (k * dz) ** 2, x * dx + y * dy - k * dz * r, x * x + y * y - r * r
    for far in _roots(a, b, c):
        if z0 <= z + far * dz <= z1:
            yield Hit(far, np.array((0.0, 0.0, 1.0)), "round face")


def disc_hits(z: float, radius: float, ray: Ray) -> Iterator[Hit]:
    if ray.direction[2] == 0:
        return
    far = float((z - ray.origin[2]) / ray.direction[2])
    x, y, _ = ray.origin + far * ray.direction
    if far > 0 and x * x + y * y <= radius * radius:
        yield Hit(far, np.array((0.0, 0.0, math.copysign(1.0, z))), "flat face")


def _roots(a: float, b: float, c: float) -> list[float]:
    """Return the positive roots t of a t² + 2 b t + c = 0."""
    if abs(a) < 1e-300:
        return []
    root = b * b - a * c
    if root < 0:
        return []
    return [t for sign in (-1, 1) if (t := (-b + sign * math.sqrt(root)) / a) > 0]


def triangle_hits(triangles: Array, ray: Ray) -> Iterator[Hit]:
    """Yield hits on triangles (n, 3, 3).

    By Möller and Trumbore, *Fast, minimum storage ray/triangle intersection*.
    """
    p, q, r = triangles.swapaxes(0, 1)
    across = np.cross(ray.direction, r - p)
    det = np.einsum("ij,ij->i", q - p, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = ray.origin - p
        u = np.einsum("ij,ij->i", s, across) / det
        back = np.cross(s, q - p)
        v = back @ ray.direction / det
        t = np.einsum("ij,ij->i", r - p, back) / det
        inside = (np.abs(det) > 1e-15) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    for i in np.flatnonzero(inside):
        normal = np.cross(q[i] - p[i], r[i] - p[i])
        yield Hit(float(t[i]), normal / np.linalg.norm(normal), "face")
