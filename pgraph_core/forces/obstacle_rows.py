"""Paths over obstacles that follow each other without a point between them.

Between two of them the path is straight. A point y of each of these lines divides the path into
ways past a single obstacle, whose lengths are known. The path is the shortest one where the unit
vectors of both ways at each y are equal. Newton's method finds it from points that depend on the
positions alone. Each y moves to the middle of its line, along which it changes no length.

The second derivatives of a way are those of its neighbours. Of the normal n of an obstacle at the
first touching point, an end at a distance r sees n nᵀ / r. Along the binormal b a neighbour is
apart by j, with j'' + K j = 0 on a surface of curvature K, and j'' = 0 on straight lines. From one
end to the other, (j, j') is multiplied by the matrix with the rows (A, B) and (C, D), so that

    j'_a = (j_b - A j_a) / B    and    j'_b = (D j_b - j_a) / B
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.compiler.elementary import sine_cosine
from ..engine.compiler.jit import kernel, part, sweep
from ..engine.compiler.kinds import F1, F2, array_of, f8, read
from ..engine.compiler.masks import (
    any_of,
    both,
    chosen,
    either,
    larger,
    more,
    most,
    smaller,
    without,
)
from ..engine.records import table
from ..engine.rows import point_of, rotation_of, set_origin, set_rotation
from ..engine.vec import (
    add,
    add9,
    add_outer9,
    add_scaled,
    cross,
    dot,
    load,
    load3,
    load9,
    mat_mul,
    matrix,
    mul,
    mul_t,
    scale,
    store,
    store9,
    sub,
    transpose,
    xyz,
)
from ..rotation import Array
from ..tolerances import ROUNDING, SOLVED, TINY
from .base import VIA
from .obstacle_ellipsoids import geodesic, over, past_ellipsoid, spread_of
from .obstacles import (
    ELLIPSOID,
    SHORTER,
    SPHERE,
    THROUGH,
    arc_of,
    around,
    is_inside,
    obstacle_of,
    picked,
    through,
    turned_by,
    unit,
)

# columns of a row of the workspace, for a point between two obstacles
PLACE, STEP, RIGHT, MIDDLE, AHEAD = 0, 3, 6, 9, 12
GATHERINGS = 2  # rounds that only move points to the middle of their lines
MOST_ROUNDS = 60  # steps of Newton's method, which are halved where a path gets longer
LAST_ROUNDS = 2  # after a path that is straight to SOLVED: its error is below rounding


@part
def passed(via, count, work, p, q):
    """Return `around` from p to q, with points in world coordinates, for one of `count` in a row.

    In a row, the path lies on that side of a sphere where it began, and may slip to the other one.
    """
    c = point_of(xyz(via.point), work, via.row)
    turn = rotation_of(work, via.row)
    axis, side = mul(turn, xyz(via.axis)), mul(turn, xyz(via.side))
    a, b = sub(p, c), sub(q, c)
    if via.shape == ELLIPSOID:
        own = mat_mul(turn, matrix(via.axes))
        sided = SHORTER if count > 1 else via.sided
        free, length, start, first, last, stop = past_ellipsoid(
            xyz(via.radii), sided, mul_t(own, side), mul_t(own, a), mul_t(own, b)
        )
        start, first = mul(own, start), mul(own, first)
        last, stop = mul(own, last), mul(own, stop)
    elif via.sided == THROUGH:
        free, length, start, first, last, stop = through(via.shape, via.radius, axis, a, b)
    else:
        sided = SHORTER if count > 1 and via.shape == SPHERE else via.sided
        free, length, start, first, last, stop = around(
            via.shape, sided, via.radius, axis, side, a, b
        )
    return free, length, start, add(c, first), add(c, last), stop


@part
def across(u, x):
    """Return x without its part along a unit vector, or x for a sphere, where u is zero."""
    return add_scaled(x, -dot(u, x), u)


@part
def on_ellipsoid(own, radii, x):
    """Return the point of an ellipsoid in the direction x from its centre, in world axes."""
    apart = over(mul_t(own, x), radii)
    return scale(1.0 / math.sqrt(dot(apart, apart) + TINY), x)


@sweep
def beside(via, work, p, q):
    """Return a point of an obstacle in a row on its side, near the line from p to q."""
    c = point_of(xyz(via.point), work, via.row)
    turn = rotation_of(work, via.row)
    u, side = mul(turn, xyz(via.axis)), mul(turn, xyz(via.side))
    begin, ahead = sub(p, c), sub(q, p)
    if via.shape == ELLIPSOID:
        own = mat_mul(turn, matrix(via.axes))
        return add(c, on_ellipsoid(own, xyz(via.radii), side))
    flat = across(u, ahead)
    s = -dot(flat, across(u, begin)) / (dot(flat, flat) + TINY)
    height = dot(u, add_scaled(begin, smaller(larger(s, 0.0), 1.0), ahead))
    return add(add_scaled(c, height, u), scale(via.radius, unit(across(u, side))))


@part
def pushed(via, work, y):
    """Return a point, moved out of an obstacle onto its surface if it is inside."""
    c = point_of(xyz(via.point), work, via.row)
    turn = rotation_of(work, via.row)
    out = across(mul(turn, xyz(via.axis)), sub(y, c))
    if via.shape == ELLIPSOID:
        apart = over(mul_t(mat_mul(turn, matrix(via.axes)), out), xyz(via.radii))
        far = math.sqrt(dot(apart, apart) + TINY)
    else:
        far = math.sqrt(dot(out, out) + TINY) / via.radius
    return add_scaled(y, larger(1.0 / far - 1.0, 0.0), out)


@sweep
def placed_between(first, count, room, vias, work, p, q):
    """Write a point outside both obstacles for each pair of neighbours."""
    before = beside(vias[first], work, p, q)
    for k in range(count - 1):
        one, two = vias[first + k], vias[first + k + 1]
        after = beside(two, work, p, q)
        y = scale(0.5, add(before, after))
        for _ in range(GATHERINGS):
            y = pushed(two, work, pushed(one, work, y))
        store(work, room + k, PLACE, y)
        store(work, room + k, STEP, scale(0.0, y))
        before = after


@part
def is_within(via, work, x):
    """Check whether a point is inside an obstacle."""
    turn = rotation_of(work, via.row)
    out = sub(x, point_of(xyz(via.point), work, via.row))
    if via.shape == ELLIPSOID:
        return is_inside(over(mul_t(mat_mul(turn, matrix(via.axes)), out), xyz(via.radii)), 1.0)
    return is_inside(across(mul(turn, xyz(via.axis)), out), via.radius)


@part
def normal_at(via, work, x):
    """Return the unit normal of an obstacle at a point on it."""
    c = point_of(xyz(via.point), work, via.row)
    turn = rotation_of(work, via.row)
    if via.shape == ELLIPSOID:
        own, radii = mat_mul(turn, matrix(via.axes)), xyz(via.radii)
        apart = mul_t(own, sub(x, c))
        return unit(mul(own, over(over(apart, radii), radii)))
    return unit(across(mul(turn, xyz(via.axis)), sub(x, c)))


@part
def any_normal(t):
    """Return a unit vector normal to t."""
    aside = picked(more(abs(t[0]), abs(t[1])), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    return unit(cross(t, aside))


@part
def outer(s, x, y):
    """Return s x yᵀ."""
    z = 0.0 * s
    return add_outer9((z, z, z, z, z, z, z, z, z), scale(s, x), y)


@part
def two_outer(s, x, y, t, z, w):
    """Return s x yᵀ + t z wᵀ."""
    return add_outer9(outer(s, x, y), scale(t, z), w)


@sweep
def second_slopes(via, work, p, q, found, exact):
    """Return the second derivatives of the length of a way by its ends: twice by p, twice by q, by
    both.

    They are those of a flat surface where `exact` is 0, with which no step leads to a longest way.
    """
    free, length, start, first, last, stop = found
    before, after = sub(first, p), sub(q, last)
    reach_p = math.sqrt(dot(before, before) + TINY)
    reach_q = math.sqrt(dot(after, after) + TINY)
    on = length - reach_p - reach_q
    s, c, curved = 0.0 * on, 0.0 * on, 0.0 * on
    if via.shape == SPHERE:
        s, c = sine_cosine(on / via.radius)
        s, curved = via.radius * s, -s / via.radius
        s, c, curved = chosen(exact, s, on), chosen(exact, c, 1.0), exact * curved
        onward = c
    elif via.shape == ELLIPSOID:
        own = mat_mul(rotation_of(work, via.row), matrix(via.axes))
        centre = point_of(xyz(via.point), work, via.row)
        c, curved, s, onward = spread_of(
            xyz(via.radii), mul_t(own, sub(q, centre)), mul_t(own, sub(first, centre)),
            mul_t(own, start), without(exact, free),
        )  # fmt: skip
        s, c = chosen(exact, s, on), chosen(exact, c, 1.0)
        curved, onward = exact * curved, chosen(exact, onward, 1.0)
    else:
        s, c = on, 0.0 * on + 1.0
        onward = c
    a = c + reach_q * curved
    b = reach_p * a + s + reach_q * onward
    d = reach_p * curved + onward
    n_p = picked(free, any_normal(start), normal_at(via, work, first))
    n_q = picked(free, n_p, normal_at(via, work, last))
    b_p, b_q = cross(start, n_p), cross(stop, n_q)
    over = 1.0 / length
    in_p, in_q = chosen(free, over, 1.0 / reach_p), chosen(free, over, 1.0 / reach_q)
    on_p, on_q = chosen(free, over, a / b), chosen(free, over, d / b)
    by_p = two_outer(in_p, n_p, n_p, on_p, b_p, b_p)
    by_q = two_outer(in_q, n_q, n_q, on_q, b_q, b_q)
    mixed = two_outer(chosen(free, -over, 0.0), n_p, n_q, chosen(free, -over, -1.0 / b), b_p, b_q)
    return by_p, by_q, mixed


@part
def scaled9(s, m):
    """Return s m for a 3x3 matrix."""
    return (
        s * m[0],
        s * m[1],
        s * m[2],
        s * m[3],
        s * m[4],
        s * m[5],
        s * m[6],
        s * m[7],
        s * m[8],
    )


@part
def is_positive(m):
    """Check whether a symmetric 3x3 matrix is positive definite."""
    x, y, z = (m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8])
    own = both(more(m[0], 0.0), more(m[0] * m[4] - m[1] * m[3], 0.0))
    return both(own, more(dot(x, cross(y, z)), 0.0))


@part
def inverse9(m):
    """Return the inverse of a 3x3 matrix."""
    x, y, z = (m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8])
    a, b, c = cross(y, z), cross(z, x), cross(x, y)
    over = 1.0 / dot(x, a)
    return (
        over * a[0], over * b[0], over * c[0],
        over * a[1], over * b[1], over * c[1],
        over * a[2], over * b[2], over * c[2],
    )  # fmt: skip


@part
def start_of_way(k, room, work, p):
    """Return the point at which the way past obstacle k of a row begins."""
    return p if k == 0 else load(work, room + k - 1, PLACE)


@part
def end_of_way(k, count, room, work, q):
    """Return the point at which the way past obstacle k of a row ends."""
    return q if k == count - 1 else load(work, room + k, PLACE)


@sweep
def eliminated(first, count, room, vias, work, p, q, exact, gathers):
    """Return the length of a path by the present points, its largest kink, squared, 1 if a
    shortest path is near, or else 0, and 1 if a point is inside an obstacle.

    Writes for each point what is left of its row of Newton's equations.
    """
    total, kink, least, inside = 0.0 * p[0], 0.0 * p[0], 0.0 * p[0] + 1.0, 0.0 * p[0]
    none = outer(total, p, p)
    end, stop, behind, coupled, carried = p, p, none, none, scale(0.0, p)
    for k in range(count):
        via, begin = vias[first + k], start_of_way(k, room, work, p)
        after = end_of_way(k, count, room, work, q)
        found = passed(via, count, work, begin, after)
        by_p, by_q, by_both = second_slopes(via, work, begin, after, found, exact)
        total += found[1]
        if k > 0:
            within = either(
                is_within(vias[first + k - 1], work, begin), is_within(via, work, begin)
            )
            inside = either(inside, within)
            slope = sub(stop, found[2])
            kink = larger(kink, dot(slope, slope))
            along = unit(add(stop, found[2]))
            own = add9(behind, by_p)
            stiff = own[0] + own[4] + own[8]
            middle = sub(scale(0.5, add(end, found[3])), begin)
            own = add9(own, outer(stiff, along, along))
            shift = gathers * stiff * dot(along, middle)
            left = sub(scale(shift, along), add(slope, carried))
            own = add9(own, coupled)
            least = both(least, is_positive(own))
            inverse = inverse9(own)
            right = mul(inverse, left)
            ahead = mat_mul(inverse, by_both)
            store(work, room + k - 1, RIGHT, right)
            store9(work, room + k - 1, AHEAD, ahead)
            store(work, room + k - 1, MIDDLE, middle)
            coupled = mat_mul(transpose(scaled9(-1.0, by_both)), ahead)
            carried = mul_t(by_both, right)
        end, stop, behind = found[4], found[5], by_q
    return total, kink, least, inside


@sweep
def gathered(count, room, work):
    """Move each point to the middle of its line."""
    for k in range(count - 1):
        store(work, room + k, PLACE, add(load(work, room + k, PLACE), load(work, room + k, MIDDLE)))


@sweep
def moved(count, room, work, back, part_of):
    """Move the points by a part of a step of Newton's method, or `back` by the last step."""
    step = scale(0.0, load(work, room, RIGHT))
    for k in range(count - 2, -1, -1):
        step = sub(load(work, room + k, RIGHT), mul(load9(work, room + k, AHEAD), step))
        last = load(work, room + k, STEP)
        way = picked(back, scale(-1.0, last), scale(part_of, step))
        store(work, room + k, STEP, picked(back, scale(0.0, way), way))
        store(work, room + k, PLACE, add(load(work, room + k, PLACE), way))


@sweep
def settle(first, count, room, vias, work, p, q):
    """Find the points that divide the shortest path from p to q over `count` obstacles in a row.

    They are in `count` - 1 rows of the workspace, from `room` on. Returns the largest kink,
    squared. A step to a longer path, or into an obstacle, is undone, and a smaller part of one
    follows, which moves no point along its line. Where no shortest path is near, it is a step as if
    the obstacles were flat, whose parts grow: the path slips off an obstacle there.
    """
    placed_between(first, count, room, vias, work, p, q)
    none = 0.0 * p[0]
    for _ in range(GATHERINGS):
        eliminated(first, count, room, vias, work, p, q, none, none + 1.0)
        gathered(count, room, work)
    least, kink, exact, part_of, left = none + 1.0 / TINY, none, none + 1.0, none + 1.0, none
    left, stepped, flat = left + LAST_ROUNDS, none, none
    for _ in range(MOST_ROUNDS):
        gathers = most(1.0, part_of)
        length, kink, convex, inside = eliminated(
            first, count, room, vias, work, p, q, exact, gathers
        )
        rough = more(kink, SOLVED * SOLVED)
        longer = either(inside, both(more(length, least * (1.0 + ROUNDING)), rough))
        longer = both(longer, stepped)
        least = chosen(stepped, smaller(least, length), length)
        grown = chosen(flat, 2.0 * part_of, smaller(2.0 * part_of, 1.0))
        part_of = chosen(longer, 0.5 * part_of, chosen(stepped, grown, part_of))
        stepped = both(without(more(left, 0.0), longer), convex)
        flat = without(1.0, exact)
        step = chosen(flat, part_of, smaller(part_of, 1.0))
        moved(count, room, work, longer, chosen(stepped, step, 0.0))
        exact = either(longer, convex)
        left = chosen(either(rough, without(1.0, convex)), left, left - 1.0)
        if not any_of(more(left, 0.0)):
            break
    return kink


@kernel(f8(read(array_of(VIA)), F1, F1, F2, F2))
def path_over(vias, p, q, work, out):
    """Compute `passed` for each of some obstacles of the ground in a row, into `out` (n, 14).

    `work` has a row for the ground and one for each obstacle. Returns the largest kink, squared, or
    1 if a point between two of them is inside one.
    """
    set_rotation(work, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    set_origin(work, 0, (0.0, 0.0, 0.0))
    p, q, count, kink = load3(p, 0), load3(q, 0), vias.shape[0], 0.0
    if count > 1:
        kink = settle(0, count, 1, vias, work, p, q)
        for k in range(2 * (count - 1)):
            kink = max(kink, is_within(vias[(k + 1) // 2], work, load(work, 1 + k // 2, PLACE)))
    for k in range(count):
        begin, end = start_of_way(k, 1, work, p), end_of_way(k, count, 1, work, q)
        free, length, start, first, last, stop = passed(vias[k], count, work, begin, end)
        out[k, 0], out[k, 1] = free, length
        store(out, k, 2, start)
        store(out, k, 5, first)
        store(out, k, 8, last)
        store(out, k, 11, stop)
    return kink


class Past(NamedTuple):
    """The part of a path past an obstacle, in the axes of its ends [m]."""

    length: float
    free: bool  # True if the path does not touch the obstacle
    first: Array  # (3,) points at which it touches the obstacle, or its middle
    last: Array
    via: Any  # record VIA of the obstacle
    start: Array  # direction in which the path begins to lie on it
    along: float  # length on it [m]

    @property
    def arc(self) -> Array:
        """Points (n, 3) along the obstacle from the first to the last."""
        if self.free or self.via["sided"] == THROUGH:
            return self.first[None]
        centre, begin = self.via["point"], self.first - self.via["point"]
        if self.via["shape"] == ELLIPSOID:
            own = self.via["axes"].reshape(3, 3)
            arc = geodesic(self.via["radii"], begin @ own, self.start @ own, self.along) @ own.T
            return np.concatenate((centre + arc, self.last[None]))
        sizes = self.via["radius"], self.via["axis"]
        return centre + arc_of(*sizes, self.start, begin, self.along)


def past_obstacles(
    past: Sequence[Any], places: Sequence[tuple[Array, Array]], p: Array, q: Array
) -> tuple[list[Past], float]:
    """Return the parts of a path from p to q [m], one past each obstacle, and its largest kink.

    `places` are the orientation (3, 3) and the centre (3,) of each obstacle.
    """
    vias, work = table(VIA, len(past)), np.zeros((1 + len(past), at.WORK))
    for one, via, (turn, centre) in zip(vias, past, places):
        given = turned_by(obstacle_of(via), turn)
        for name, value in (*given.items(), ("point", centre)):
            one[name] = value
    p, q = np.ascontiguousarray(p, float), np.ascontiguousarray(q, float)
    out = np.empty((len(past), 14))
    kink = math.sqrt(path_over(vias, p, q, work, out))
    inside = work[1 : len(past), PLACE : PLACE + 3]
    ends = zip((p, *inside), (*inside, q))
    return [_part(*each) for each in zip(vias, out, ends)], kink


def _part(via: Any, out: Array, ends: tuple[Array, Array]) -> Past:
    """Return the part of a path past an obstacle, given the row of `path_over` and its ends."""
    free, length, (start, first, last, _) = bool(out[0]), float(out[1]), out[2:].reshape(4, 3)
    along = length - float(np.linalg.norm(first - ends[0]) + np.linalg.norm(last - ends[1]))
    return Past(length, free, first, last, via, start, along)
