"""Quaternions [w, x, y, z] in plain Python, for descriptions and test oracles (not for kernels)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = "NDArray[np.float64]"
Quaternion: TypeAlias = "tuple[float, float, float, float]"


def multiply(p: Sequence[float], q: Sequence[float]) -> Quaternion:
    """Compute the Hamilton product p q, which applies q first and then p."""
    (a, b, c, d), (w, x, y, z) = p, q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def unit(q: Sequence[float]) -> Quaternion:
    """Return `q` normalised to unit length."""
    w, x, y, z = q
    norm = math.hypot(w, x, y, z)
    return (w / norm, x / norm, y / norm, z / norm)


def unit_vector(x: Sequence[float] | Array) -> Array:
    """Return `x` normalised to unit length."""
    vector = np.array(x, dtype=float)
    return vector / np.linalg.norm(vector)


def matrix(q: Sequence[float]) -> Array:
    """Compute the (3, 3) rotation matrix for a quaternion with any nonzero norm."""
    w, x, y, z = unit(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotate(q: Sequence[float], x: Sequence[float]) -> tuple[float, float, float]:
    """Rotate the vector x by the quaternion q."""
    a, b, c = matrix(q) @ np.asarray(x, dtype=float)
    return (float(a), float(b), float(c))


def skew(x: Sequence[float] | Array) -> Array:
    """Return the (3, 3) cross product matrix, such that skew(x) y = x × y."""
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def rodrigues(axis: Sequence[float] | Array, angle: float) -> Array:
    """Compute the rotation (3, 3) about a unit axis: I + (h×) sin θ + (h×)² (1 - cos θ), Fig. 7."""
    h = skew(axis)
    return np.eye(3) + math.sin(angle) * h + (1.0 - math.cos(angle)) * (h @ h)


def turn_of_z(axis: Sequence[float]) -> Quaternion:
    """Return the shortest rotation that maps z to an axis, about x if the axis is -z."""
    x, y, z = np.array(axis) / math.hypot(*axis)
    w = 1.0 + z if z > 0.0 else (x * x + y * y) / (1.0 - z)
    return unit((w, -y, x, 0.0)) if w else (0.0, 1.0, 0.0, 0.0)


def normals_of(axis: Array) -> tuple[Array, Array]:
    """Return two unit vectors that form a right-handed frame with a unit axis as the third."""
    least = np.eye(3)[np.argmin(np.abs(axis))]
    first = unit_vector(np.cross(least, axis).astype(float))
    return first, np.cross(axis, first)


def frame_of(axis: Array) -> Array:
    """Return a rotation (3, 3) that maps z to a unit axis."""
    return np.column_stack((*normals_of(axis), axis))


def quaternion_products(R: Array) -> Array:
    """Compute 4 p pᵀ (..., 4, 4) for the unit quaternions p of rotation matrices (..., 3, 3)."""
    (a, xy, xz), (yx, b, yz), (zx, zy, c) = np.moveaxis(R, (-2, -1), (0, 1))
    products = np.array([
        [1 + a + b + c, zy - yz, xz - zx, yx - xy],
        [zy - yz, 1 + a - b - c, xy + yx, xz + zx],
        [xz - zx, xy + yx, 1 - a + b - c, yz + zy],
        [yx - xy, xz + zx, yz + zy, 1 - a - b + c],
    ])  # fmt: skip
    return np.moveaxis(products, (0, 1), (-2, -1))


def quaternion_of(R: Array) -> Quaternion:
    """Compute the quaternion for a (3, 3) rotation matrix, with its largest component positive."""
    products = quaternion_products(R)
    return unit(products[int(np.argmax(np.diagonal(products)))].tolist())
