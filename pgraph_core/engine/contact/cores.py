"""Cores of round shapes: the points whose neighbourhood a shape is."""

import math
from typing import Any, NamedTuple

from ..compiler.jit import part, sweep
from ..records import CYLINDER, ELLIPSOID
from ..vec import add, add_scaled, dot, matrix, mul, mul_t, sub, xyz
from .convex import (
    lay_out,
    lowest,
)


class Core(NamedTuple):
    """A shape without its radius, in coordinates relative to A's origin."""

    kind: Any
    centre: Any
    rotation: Any
    half: Any  # radii of an ellipsoid, or (radius, radius, half length) of a cylinder
    side: Any  # vertices of a shape with corners


@sweep
def core_of(geometry, poses, i, only, origin, room, row):
    """Return shape i as a core, and the next free row."""
    side, row = lay_out(geometry, poses, i, only, origin, room, row)
    shape = geometry.shapes[i]
    centre = sub(xyz(poses[i].position), origin)
    return Core(shape.kind, centre, matrix(poses[i].rotation), xyz(shape.half_extents), side), row


@part
def support(room, core, d):
    """Compute the support point of a core, which is the lowest along d."""
    if core.kind == ELLIPSOID:
        g = mul_t(core.rotation, d)
        q = (core.half[0] ** 2 * g[0], core.half[1] ** 2 * g[1], core.half[2] ** 2 * g[2])
        return add_scaled(core.centre, -1.0 / math.sqrt(dot(g, q)), mul(core.rotation, q))
    if core.kind == CYLINDER:
        g = mul_t(core.rotation, d)
        across = math.sqrt(g[0] * g[0] + g[1] * g[1])
        r = -core.half[0] / across if across > 0.0 else 0.0
        p = (r * g[0], r * g[1], -math.copysign(core.half[2], g[2]))
        return add(core.centre, mul(core.rotation, p))
    _, k = lowest(room, core.side, d)
    return xyz(room[core.side.first + k].place)
