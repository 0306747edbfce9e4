"""Cores of round shapes: the points whose neighbourhood a shape is."""

import math
from typing import Any, NamedTuple

from ..compiler.jit import part, sweep
from ..records import CYLINDER, EGG, ELLIPSOID
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
    half: Any  # radii of an ellipsoid, or (radius, radius, half length) of a cylinder, or of an egg
    side: Any  # vertices of a shape with corners


@sweep
def core_of(geometry, poses, i, only, origin, room, row):
    """Return shape i as a core, and the next free row."""
    side, row = lay_out(geometry, poses, i, only, origin, room, row)
    shape = geometry.shapes[i]
    centre = sub(xyz(poses[i].position), origin)
    half = half_of_egg(shape) if shape.kind == EGG else xyz(shape.half_extents)
    return Core(shape.kind, centre, matrix(poses[i].rotation), half, side), row


@part
def half_of_egg(shape):
    """Return its radius, and its half axes below and above."""
    middle, half = xyz(shape.middle), xyz(shape.half_extents)
    return half[0], half[2] - middle[2], half[2] + middle[2]


@part
def half_above(half, z):
    """Return the radii of the half of an egg on the side of z."""
    return half[0], half[0], half[2] if z > 0.0 else half[1]


@part
def support(room, core, d):
    """Compute the support point of a core, which is the lowest along d."""
    if core.kind in (ELLIPSOID, EGG):
        g = mul_t(core.rotation, d)
        half = half_above(core.half, -g[2]) if core.kind == EGG else core.half
        q = (half[0] ** 2 * g[0], half[1] ** 2 * g[1], half[2] ** 2 * g[2])
        return add_scaled(core.centre, -1.0 / math.sqrt(dot(g, q)), mul(core.rotation, q))
    if core.kind == CYLINDER:
        g = mul_t(core.rotation, d)
        across = math.sqrt(g[0] * g[0] + g[1] * g[1])
        r = -core.half[0] / across if across > 0.0 else 0.0
        p = (r * g[0], r * g[1], -math.copysign(core.half[2], g[2]))
        return add(core.centre, mul(core.rotation, p))
    _, k = lowest(room, core.side, d)
    return xyz(room[core.side.first + k].place)
