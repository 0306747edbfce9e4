"""Round obstacles on which paths lie: points and directions, and the closed forms past spheres and
cylinders.

The shortest path past a cylinder is a straight line on its unrolled surface: with the length l of
its projection along the axis, and the distance h of its ends along the axis, it is √(l² + h²) long.
A sphere is a cylinder about the normal of the plane through its centre and both ends. The
projection has two tangents and an arc. A path whose arc would be negative does not touch the
obstacle, nor does one with an end inside it.

The length of a shortest path does not change with the tangent points, so that its rate and the
forces of its tension follow from the material points there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..engine.compiler.elementary import atan2, sine_cosine
from ..engine.compiler.jit import part, sweep
from ..engine.compiler.masks import any_of, both, chosen, either, larger, more, most, smaller
from ..engine.records import INTEGER, REAL
from ..engine.vec import add_scaled, cross, dot, scale, sub
from ..rotation import Array, matrix, unit_vector
from ..rotation import unit as unit_quaternion
from ..tolerances import EPS, SOLVED, TINY

POINT, SPHERE, CYLINDER, ELLIPSOID = range(4)
LAST_OBSTACLE = ELLIPSOID
# the way on the shorter side, that on the side of a point, or the one through the obstacle
SHORTER, BESIDE, THROUGH = range(3)
TURN = 2.0 * math.pi
MOST_MEETING = 64  # halvings of an angle below rounding
DRAWN = 0.2  # rad between drawn points of an arc: chords within 0.5 % of the radius
NONE = np.zeros(3)

OBSTACLE = {
    "shape": INTEGER,  # POINT: none
    "sided": INTEGER,  # SHORTER or BESIDE
    "radius": REAL,
    "axis": (REAL, 3),  # axis of a cylinder in the home axes of the row
    "side": (REAL, 3),  # from the centre to the point on whose side the path lies, the same axes
    "radii": (REAL, 3),  # half axes of an ellipsoid, and its frame in the same axes, row by row
    "axes": (REAL, 9),
}


@part
def picked(mask, a, b):
    """Return vector a where the mask is set, or else b."""
    return chosen(mask, a[0], b[0]), chosen(mask, a[1], b[1]), chosen(mask, a[2], b[2])


@part
def unit(x):
    return scale(1.0 / math.sqrt(dot(x, x) + TINY), x)


@part
def normal_of_plane(a, b, side):
    """Return the unit normal of the plane of two vectors.

    If they are parallel, the plane contains `side`, or else any direction.
    """
    n = cross(a, b)
    flat = most(dot(n, n), EPS * EPS * dot(a, a) * dot(b, b))
    n = picked(flat, cross(a, side), n)
    flat = most(dot(n, n), EPS * EPS * dot(a, a) * dot(side, side))
    across = picked(most(abs(a[0]), abs(a[1])), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    return unit(picked(flat, cross(a, across), n))


@part
def tangent(p, u, turns, radius):
    """Return (length of the tangent from p to a circle about u, unit vector to its point there,
    angle from p to that vector).

    The path turns about u with the right hand if `turns` is 1, with the left hand if it is -1. A
    point inside the circle is moved outwards onto it.
    """
    square = dot(p, p)
    reach = math.sqrt(larger(square - radius * radius, 0.0) + TINY)
    far = math.sqrt(larger(square, radius * radius))
    out = unit(p)
    to_it = add_scaled(scale(radius / far, out), turns * reach / far, cross(u, out))
    return reach, to_it, atan2(reach / far, radius / far)


@part
def is_inside(p, radius):
    """Check whether a point is inside the circle, and not on it but for rounding."""
    return more(radius * radius * (1.0 - SOLVED), dot(p, p))


@part
def turning(p, q, u, sided, side):
    """Return 1 if a path from p to q turns about u with the right hand, or else -1.

    It takes the shorter side, unless `side` lies in the angle opposite to that between p and q.
    """
    across = dot(u, cross(p, q))
    shorter = chosen(most(0.0, across), 1.0, -1.0)
    if sided == SHORTER:
        return shorter
    beyond_p, beyond_q = dot(u, cross(p, side)), dot(u, cross(side, q))
    behind = both(more(0.0, shorter * beyond_p), more(0.0, shorter * beyond_q))
    return chosen(behind, -shorter, shorter)


@sweep
def around(shape, sided, radius, axis, side, a, b):
    """Return the shortest path from a to b past an obstacle at the origin.

    It is given as (whether it is free of the obstacle, length, unit direction at the start, first
    and last point on the obstacle, unit direction at the end). Both points of a free path are its
    middle.
    """
    u = normal_of_plane(a, b, side) if shape == SPHERE else axis
    begin, end = dot(u, a), dot(u, b)
    p, q = add_scaled(a, -begin, u), add_scaled(b, -end, u)
    turns = turning(p, q, u, sided, side)
    reach_p, from_p, ahead_p = tangent(p, u, turns, radius)
    reach_q, from_q, ahead_q = tangent(q, u, -turns, radius)
    swept = turns * atan2(dot(u, cross(p, q)), dot(p, q))
    swept = chosen(most(0.0, swept), swept, swept + TURN)
    arc = swept - ahead_p - ahead_q
    flat = reach_p + radius * arc + reach_q
    rise = end - begin
    length = math.sqrt(flat * flat + rise * rise + TINY)
    ascent = rise / (flat + TINY)
    first = add_scaled(scale(radius, from_p), begin + ascent * reach_p, u)
    last = add_scaled(scale(radius, from_q), end - ascent * reach_q, u)
    along, up = turns * flat / length, rise / length
    start = add_scaled(scale(along, cross(u, from_p)), up, u)
    stop = add_scaled(scale(along, cross(u, from_q)), up, u)
    apart = sub(b, a)
    straight = math.sqrt(dot(apart, apart) + TINY)
    ahead, middle = scale(1.0 / straight, apart), add_scaled(a, 0.5, apart)
    free = either(most(arc, 0.0), either(is_inside(p, radius), is_inside(q, radius)))
    return (
        free,
        chosen(free, straight, length),
        picked(free, ahead, start),
        picked(free, middle, first),
        picked(free, middle, last),
        picked(free, ahead, stop),
    )


@part
def slope_to(far, radius, angle, square_of_tangent):
    """Return the slope and the bend, by an angle, of the distance from a point to one of a circle.

    The point is `far` from the centre, and the other one at an angle from its direction.
    """
    s, c = sine_cosine(angle)
    apart = math.sqrt(square_of_tangent + 2.0 * far * radius * (1.0 - c) + TINY)
    slope = far * radius * s / apart
    return slope, (far * radius * c - slope * slope) / apart


@sweep
def through(shape, radius, axis, a, b):
    """Return the shortest path from a to b that meets an obstacle at the origin, as `around`.

    It touches the obstacle at one point, where it makes equal angles with it. There the slope of
    its length by the angle from a is zero. It is free where the straight line meets the obstacle.
    """
    u = normal_of_plane(a, b, a) if shape == SPHERE else axis
    begin, end = dot(u, a), dot(u, b)
    p, q = add_scaled(a, -begin, u), add_scaled(b, -end, u)
    far_p, far_q = math.sqrt(dot(p, p) + TINY), math.sqrt(dot(q, q) + TINY)
    across = dot(u, cross(p, q))
    turns = chosen(most(0.0, across), 1.0, -1.0)
    whole = atan2(turns * across, dot(p, q))
    _, _, ahead_p = tangent(p, u, 1.0, radius)
    _, _, ahead_q = tangent(q, u, 1.0, radius)
    low, high = larger(whole - ahead_q, 0.0), smaller(whole, ahead_p)
    near_p, near_q = (far_p - radius) * (far_p - radius), (far_q - radius) * (far_q - radius)
    angle = 0.5 * (low + high)
    for _ in range(MOST_MEETING):
        slope_p, bend_p = slope_to(far_p, radius, angle, near_p)
        slope_q, bend_q = slope_to(far_q, radius, whole - angle, near_q)
        slope = slope_p - slope_q
        low = chosen(most(slope, 0.0), angle, low)
        high = chosen(most(0.0, slope), angle, high)
        following = angle - slope / (bend_p + bend_q + TINY)
        outside = either(more(low, following), more(following, high))
        step = chosen(outside, 0.5 * (low + high), following) - angle
        angle = angle + step
        if not any_of(more(abs(step), SOLVED * SOLVED)):
            break
    s, c = sine_cosine(angle)
    out = unit(p)
    touch = add_scaled(scale(radius * c, out), radius * s * turns, cross(u, out))
    before, after = sub(touch, p), sub(q, touch)
    reach_p, reach_q = math.sqrt(dot(before, before) + TINY), math.sqrt(dot(after, after) + TINY)
    rise = end - begin
    height = begin + rise * reach_p / (reach_p + reach_q)
    touch = add_scaled(touch, height, u)
    before, after = sub(touch, a), sub(b, touch)
    length_a = math.sqrt(dot(before, before) + TINY)
    length_b = math.sqrt(dot(after, after) + TINY)
    apart = sub(b, a)
    straight = math.sqrt(dot(apart, apart) + TINY)
    ahead, middle = scale(1.0 / straight, apart), add_scaled(a, 0.5, apart)
    free = either(
        most(ahead_p + ahead_q, whole), either(is_inside(p, radius), is_inside(q, radius))
    )
    return (
        free,
        chosen(free, straight, length_a + length_b),
        picked(free, ahead, scale(1.0 / length_a, before)),
        picked(free, middle, touch),
        picked(free, middle, touch),
        picked(free, ahead, scale(1.0 / length_b, after)),
    )


def arc_of(radius: float, axis: Array, start: Array, first: Array, length: float) -> Array:
    """Return points of a helix of a length, from `first` in direction `start`."""
    u = axis if axis.any() else np.cross(first, start) / radius
    ahead, out = start - (u @ start) * u, first - (u @ first) * u
    flat = float(np.linalg.norm(ahead))
    angle = length * flat / radius
    s = np.linspace(0.0, 1.0, 2 + int(angle / DRAWN))[:, None]
    circle = np.cos(s * angle) * out + np.sin(s * angle) * radius / flat * ahead
    return circle + (u @ first + s * length * (u @ start)) * u


def follow_each_other(vias: Any) -> bool:
    """Check whether records VIA contain two obstacles in a row."""
    is_round = (vias["shape"] > POINT) & (vias["shape"] <= LAST_OBSTACLE)
    return bool((is_round[1:] & is_round[:-1]).any())


def obstacle_of(via: Any) -> dict[str, Any]:
    """Return the numbers of an obstacle, or of a point, in the axes of its body."""
    shape = POINT
    if via.radii is not None:
        shape = ELLIPSOID
    elif via.radius is not None:
        shape = SPHERE if via.axis is None else CYLINDER
    turn = np.eye(3) if via.rotation is None else matrix(unit_quaternion(via.rotation))
    return {
        "shape": shape,
        "sided": THROUGH if via.inner else SHORTER if via.side is None else BESIDE,
        "radius": via.radius or 0.0,
        "axis": NONE if via.axis is None else unit_vector(via.axis),
        "side": NONE if via.side is None else np.subtract(via.side, via.point),
        "radii": NONE if via.radii is None else np.array(via.radii),
        "axes": turn,
    }


def turned_by(given: dict[str, Any], turn: Array) -> dict[str, Any]:
    """Return the numbers of an obstacle in axes in which those of its body are the columns of
    `turn`."""
    own = {name: turn @ given[name] for name in ("axis", "side", "axes")}
    return {**given, **own, "axes": own["axes"].ravel()}
