"""What the bodies look like, from their mass properties: equal inertia, so honest pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import Quaternion

Vector: TypeAlias = "tuple[float, float, float]"


def bar(end: Sequence[float], radius: float) -> pg.Shape:
    """A capsule from the body's origin whose rounded end reaches `end` [m]."""
    length = math.hypot(*end)
    x, y, z = (c / length for c in end)
    middle = (length - radius) / 2
    return pg.Shape(
        kind="capsule",
        radius=radius,
        length=rounded(length - radius),
        position=(rounded(x * middle), rounded(y * middle), rounded(z * middle)),
        rotation=turn_from_z(x, y, z),
    )


def limb(body: pg.Body, end: Sequence[float]) -> pg.Shape:
    """A capsule along a leg's segment, as thick as the solid cylinder with the body's inertia."""
    axial = np.linalg.eigvalsh(np.array(body.inertia))[0]
    return bar(end, radius=rounded(math.sqrt(2 * axial / body.mass), 3))


def block(body: pg.Body) -> pg.Shape:
    """The box with the body's mass and inertia, about its centre of mass."""
    moments = np.diag(np.array(body.inertia))
    x, y, z = np.sqrt(12 / body.mass * (moments.sum() / 2 - moments))
    size = (rounded(x, 3), rounded(y, 3), rounded(z, 3))
    return pg.Shape(kind="box", size=size, position=body.com)


def rounded(x: float, digits: int = 6) -> float:
    """Without the last digits, which differ between machines, and without -0."""
    return round(float(x), digits) + 0.0


def turn_from_z(x: float, y: float, z: float) -> Quaternion:
    """The shortest turn from z to a unit direction, as a quaternion [w, x, y, z]."""
    if z < -1 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    w = math.sqrt((1 + z) / 2)
    return (rounded(w, 9), rounded(-y / (2 * w), 9), rounded(x / (2 * w), 9), 0.0)
