"""Shortest paths past an ellipsoid between two points.

With the squares A of the half axes, the unit normal n of a point x = A n / √(n A n) moves along a
geodesic as the Neumann system [Knörrer 1982]: in the time σ with ds = ρ dσ, ρ = 1 / (√J n A n),

    n'' = -M n + (2 n M n - 2 E) n,    M = A⁻¹,    J = (t M t) (x M² x)

where J and the energy E are constant. The curvature K has ρ² K = det M / J, so that a field of
Jacobi, the distance j of a neighbour, has j' = ρ y and y' = -(det M / J) j / ρ.

The lines from an end p that touch the ellipsoid do so on a plane curve, whose points are counted
by an angle. From each of them a geodesic leads on until q lies in its tangent plane. It passes q at
a distance, which grows with the angle where the path is a shortest one: a root there is bracketed,
so that the search never ends on a longest way. Scaled to a sphere, the ellipsoid is touched by the
straight line from p to q where the sphere is.
"""

from __future__ import annotations

import math

import numpy as np

from ..engine.compiler.elementary import atan2, sine_cosine
from ..engine.compiler.jit import part, sweep
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
from ..engine.vec import add_scaled, cross, dot, scale, sub
from ..rotation import Array
from ..tolerances import EPS, SOLVED, TINY
from .obstacles import BESIDE, DRAWN, SHORTER, TURN, normal_of_plane, picked, unit

COLUMNS = 7  # midpoint rules of an extrapolation, whose order is twice as large
WEIGHTS = tuple(
    math.prod(k * k / (k * k - i * i) for i in range(1, COLUMNS + 1) if i != k)
    for k in range(1, COLUMNS + 1)
)
STRIDES = 16  # steps per turn of a geodesic's fastest oscillation: within 1e-11 at 1 : 1 : 0.3
MOST_STRIDES = 400
LAST_STRIDES = 2  # steps after one below SOLVED, so that derivatives follow
MOST_SHOTS = 60
LAST_SHOTS = 2  # shots after one below SOLVED, so that derivatives follow
EIGHTH = TURN / 8  # the largest change of an angle


@part
def times(x, y):
    """Return the products of components."""
    return x[0] * y[0], x[1] * y[1], x[2] * y[2]


@part
def over(x, y):
    """Return the quotients of components."""
    return x[0] / y[0], x[1] / y[1], x[2] / y[2]


@part
def flowed(z, h, at, inverse, squares, energy, pace, bend):
    """Return z plus h times the rates of a geodesic at the state `at`.

    A state is (n, n', a field of Jacobi and its slope that begin as 1, 0, those that begin as 0, 1,
    length).
    """
    n, v = (at[0], at[1], at[2]), (at[3], at[4], at[5])
    pulled = times(inverse, n)
    pull = 2.0 * dot(n, pulled) - energy
    thick = pace * dot(n, times(squares, n))
    along, back = h / thick, h * bend * thick
    return (
        z[0] + h * v[0],
        z[1] + h * v[1],
        z[2] + h * v[2],
        z[3] + h * (pull * n[0] - pulled[0]),
        z[4] + h * (pull * n[1] - pulled[1]),
        z[5] + h * (pull * n[2] - pulled[2]),
        z[6] + along * at[7],
        z[7] - back * at[6],
        z[8] + along * at[9],
        z[9] - back * at[8],
        z[10] + along,
    )


@part
def weighted(z, s, x):
    """Return z + s x for two states."""
    return (
        z[0] + s * x[0],
        z[1] + s * x[1],
        z[2] + s * x[2],
        z[3] + s * x[3],
        z[4] + s * x[4],
        z[5] + s * x[5],
        z[6] + s * x[6],
        z[7] + s * x[7],
        z[8] + s * x[8],
        z[9] + s * x[9],
        z[10] + s * x[10],
    )


@part
def replaced(mask, x, z):
    """Return state x where the mask is set, or else z."""
    return (
        chosen(mask, x[0], z[0]),
        chosen(mask, x[1], z[1]),
        chosen(mask, x[2], z[2]),
        chosen(mask, x[3], z[3]),
        chosen(mask, x[4], z[4]),
        chosen(mask, x[5], z[5]),
        chosen(mask, x[6], z[6]),
        chosen(mask, x[7], z[7]),
        chosen(mask, x[8], z[8]),
        chosen(mask, x[9], z[9]),
        chosen(mask, x[10], z[10]),
    )


@sweep
def advanced(z, h, inverse, squares, energy, pace, bend):
    """Return the state of a geodesic after a time h [Gragg 1965]."""
    total = weighted(z, -1.0, z)
    for k in range(COLUMNS):
        step = h / (2.0 * k + 2.0)
        before, now = z, flowed(z, step, z, inverse, squares, energy, pace, bend)
        for _ in range(2 * k + 1):
            after = flowed(before, 2.0 * step, now, inverse, squares, energy, pace, bend)
            before, now = now, after
        total = weighted(total, WEIGHTS[k], now)
    return total


@sweep
def shot(radii, q, first, start):
    """Return the end of a geodesic from `first` in direction `start` whose tangent plane contains
    q, or that comes nearest to q.

    It is given as (whether it contains q, its place, unit tangent and normal there, length, both
    fields of Jacobi with their slopes).
    """
    squares = times(radii, radii)
    inverse = over((1.0, 1.0, 1.0), squares)
    normal, ahead = times(inverse, first), times(inverse, start)
    steep = dot(normal, normal)
    n = scale(1.0 / math.sqrt(steep), normal)
    pace = math.sqrt(dot(start, ahead) * steep)
    v = scale(math.sqrt(steep) / pace, add_scaled(ahead, -dot(n, ahead), n))
    energy = dot(v, v) + dot(n, times(inverse, n))
    bend = inverse[0] * inverse[1] * inverse[2] / (pace * pace)
    zero = 0.0 * pace
    one = zero + 1.0
    z = n[0], n[1], n[2], v[0], v[1], v[2], one, zero, zero, one, zero
    longest = TURN / (STRIDES * math.sqrt(energy))
    left, rising, hit = zero + LAST_STRIDES, zero, one
    for _ in range(MOST_STRIDES):
        n, v = (z[0], z[1], z[2]), (z[3], z[4], z[5])
        stretched = times(squares, n)
        reach = math.sqrt(dot(n, stretched))
        apart = add_scaled(q, -1.0 / reach, stretched)
        gap, closing = dot(q, n) - reach, dot(apart, v)
        nearing = more(closing, 0.0)
        missed = both(rising, both(more(0.0, gap), without(1.0 + zero, nearing)))
        hit = without(hit, missed)
        rising = either(rising, nearing)
        h = smaller(-gap / (closing + TINY), longest)
        h = larger(chosen(nearing, h, longest), -longest)
        active = without(more(left, 0.0), missed)
        if not any_of(active):
            break
        z = replaced(active, advanced(z, h, inverse, squares, energy, pace, bend), z)
        left = chosen(both(nearing, most(abs(h), SOLVED * longest)), left - 1.0, left)
        left = chosen(missed, zero, left)
    n, v = (z[0], z[1], z[2]), (z[3], z[4], z[5])
    stretched = times(squares, n)
    reach = math.sqrt(dot(n, stretched))
    last = scale(1.0 / reach, stretched)
    turned = times(squares, v)
    tangent = unit(add_scaled(turned, -dot(n, turned) / reach, last))
    return hit, last, tangent, n, z[10], (z[6], z[7], z[8], z[9])


@sweep
def way_from(radii, p, q, up, across, other, near, angle, touches):
    """Return the path from p to q that begins near an angle of the curve of touching points.

    The curve lies about `up` at a height of `near` over the centre, scaled to a unit sphere, and
    the angle counts from `across` to `other`. The path is given as (length, first point, unit
    direction there, last point, unit direction there, angle, whether it is stable).
    """
    zero = 0.0 * near
    wide = math.sqrt(larger(1.0 - near * near, 0.0) + TINY)
    low, high = angle - TURN, angle + TURN
    left = chosen(touches, LAST_SHOTS + zero, zero)
    length, stable, first, start, last, stop = zero, zero, p, p, p, p
    for _ in range(MOST_SHOTS):
        s, c = sine_cosine(angle)
        ring = add_scaled(scale(c, across), s, other)
        first = times(radii, add_scaled(scale(near, up), wide, ring))
        along = times(radii, scale(wide, add_scaled(scale(-s, across), c, other)))
        before = sub(first, p)
        reach = math.sqrt(dot(before, before) + TINY)
        start = scale(1.0 / reach, before)
        hit, last, tangent, n, on, (b, c, d, e) = shot(radii, q, first, start)
        normal = unit(over(first, times(radii, radii)))
        moved = dot(along, cross(normal, start))
        after = sub(q, last)
        miss = -dot(after, cross(n, tangent))
        spread = b * moved + d * moved / reach
        slope = spread + dot(after, tangent) * (c * moved + e * moved / reach)
        far = math.sqrt(dot(after, after) + TINY)
        length, stop = reach + on + far, scale(1.0 / far, after)
        stable = both(hit, more(slope, 0.0))
        step = chosen(stable, -miss / (slope + TINY), chosen(more(miss, 0.0), -EIGHTH, EIGHTH))
        step = smaller(larger(step, -EIGHTH), EIGHTH)
        after_high = both(more(step, 0.0), most(high, angle + step))
        before_low = both(more(0.0, step), most(angle + step, low))
        low = chosen(more(0.0, miss), angle, low)
        high = chosen(more(miss, 0.0), angle, high)
        active = more(left, 0.0)
        if not any_of(active):
            break
        outside = both(more(abs(step), SOLVED), either(after_high, before_low))
        step = chosen(outside, 0.5 * (low + high) - angle, step)
        angle = chosen(active, angle + step, angle)
        left = chosen(more(abs(step), SOLVED), left, left - 1.0)
    return length, first, start, last, stop, angle, stable


@sweep
def past_ellipsoid(radii, sided, side, p, q):
    """Return the shortest path from p to q past an ellipsoid at the origin along the axes, as
    `around`.

    It is the shorter one of those on both sides, or with a side that which the search finds from
    there. Where the surface bends too much for a second one, both are the same.
    """
    a, b = over(p, radii), over(q, radii)
    toward = over(side, radii)
    up, u = unit(a), normal_of_plane(a, b, toward)
    across = cross(u, up)
    square_a, square_b, between = dot(a, a), dot(b, b), dot(a, b)
    near = 1.0 / math.sqrt(larger(square_a, 1.0))
    tangents = math.sqrt(larger(square_a - 1.0, 0.0)) * math.sqrt(larger(square_b - 1.0, 0.0))
    inside = either(more(1.0 - SOLVED, square_a), more(1.0 - SOLVED, square_b))
    free = either(inside, more(between, 1.0 - tangents))
    apart = sub(q, p)
    straight = math.sqrt(dot(apart, apart) + TINY)
    ahead, middle = scale(1.0 / straight, apart), add_scaled(p, 0.5, apart)
    length, first, start, last, stop = straight, middle, ahead, middle, ahead
    touches = without(1.0 + 0.0 * near, free)
    if any_of(touches):
        angle = 0.0 * near
        if sided == BESIDE:
            angle = angle + atan2(dot(toward, u), dot(toward, across))
        own, x, t, y, d, angle, _ = way_from(radii, p, q, up, across, u, near, angle, touches)
        if sided == SHORTER:
            angle = angle + 0.5 * TURN
            least, x2, t2, y2, d2, _, stable = way_from(
                radii, p, q, up, across, u, near, angle, touches
            )
            shorter = both(stable, more(own * (1.0 - 16.0 * EPS), least))
            own = chosen(shorter, least, own)
            x, t = picked(shorter, x2, x), picked(shorter, t2, t)
            y, d = picked(shorter, y2, y), picked(shorter, d2, d)
        length = chosen(free, straight, own)
        first, start = picked(free, middle, x), picked(free, ahead, t)
        last, stop = picked(free, middle, y), picked(free, ahead, d)
    return free, length, start, first, last, stop


@sweep
def spread_of(radii, q, first, start, touches):
    """Return both fields of Jacobi with their slopes at the end of the geodesic of a path to q.

    Those of a point where the path does not touch.
    """
    one = 1.0 + 0.0 * q[0]
    c, curved, s, onward = one, 0.0 * one, 0.0 * one, one
    if any_of(touches):
        _, _, _, _, _, (c, curved, s, onward) = shot(radii, q, first, start)
    return c, curved, s, onward


def geodesic(radii: Array, first: Array, start: Array, length: float) -> Array:
    """Return points (n, 3) of a geodesic of a length, from `first` in direction `start`."""
    squares = radii**2
    normal, ahead = first / squares, start / squares
    steep, pace = math.sqrt(normal @ normal), math.sqrt(start @ ahead * (normal @ normal))
    n = normal / steep
    v = steep / pace * (ahead - n * (n @ ahead))
    energy = float(v @ v + n @ (n / squares))

    def rates(z: Array) -> Array:
        n = z[:3]
        bent = (2.0 * n @ (n / squares) - energy) * n - n / squares
        return np.array([*z[3:6], *bent, 1.0 / (pace * (n @ (squares * n)))])

    z, found, h = np.array([*n, *v, 0.0]), [first], DRAWN / math.sqrt(energy)
    while True:  # by the classical method of Runge and Kutta
        a = rates(z)
        b = rates(z + 0.5 * h * a)
        c = rates(z + 0.5 * h * b)
        z = z + h / 6.0 * (a + 2.0 * b + 2.0 * c + rates(z + h * c))
        if not z[6] < length:
            return np.array(found)
        found.append(squares * z[:3] / math.sqrt(z[:3] @ (squares * z[:3])))
