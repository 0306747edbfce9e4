"""What the bodies look like, from their mass properties: equal inertia, so honest pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

import pgraph_core as pg

Vector: TypeAlias = "tuple[float, float, float]"


def bar(end: Sequence[float], radius: float) -> pg.Shape:
    """A capsule from the body's origin whose rounded end reaches `end` [m]."""
    length = math.hypot(*end)
    direction = [x / length for x in end]
    middle = (length - radius) / 2
    return pg.Shape(
        kind="capsule",
        radius=radius,
        length=round(length - radius, 6),
        position=_rounded(x * middle for x in direction),
        rotation=_from_z(direction),
    )


def limb(body: pg.Body, end: Sequence[float]) -> pg.Shape:
    """A capsule along a leg's segment, as thick as the solid cylinder with the body's inertia."""
    axial = np.linalg.eigvalsh(np.array(body.inertia))[0]
    return bar(end, radius=round(math.sqrt(2 * axial / body.mass), 3))


def block(body: pg.Body) -> pg.Shape:
    """The box with the body's mass and inertia, about its centre of mass."""
    moments = np.diag(np.array(body.inertia))
    squares = 12 / body.mass * (moments.sum() / 2 - moments)
    return pg.Shape(kind="box", size=_rounded(np.sqrt(squares), 3), position=body.com)


def _from_z(direction: Sequence[float]) -> tuple[float, ...]:
    """The shortest turn from z to a unit direction, as a quaternion [w, x, y, z]."""
    x, y, z = direction
    if z < -1 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    w = math.sqrt((1 + z) / 2)
    return _rounded((w, -y / (2 * w), x / (2 * w), 0.0), 9)


def _rounded(values, digits: int = 6) -> tuple[float, ...]:
    """Without the last digits, which differ between machines, and without -0."""
    return tuple(round(float(x), digits) + 0.0 for x in values)
