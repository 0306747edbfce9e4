"""Points that stay on a curve of another body: the place on it, its tangent and its bend.

The curve C(s) is in the axes of the row of B, in pieces of polynomials like that of a joint. Its
place at the point x of A is the nearest one, where f = C' · (x - C) = 0. With the velocity u of A's
point as B sees it,

    s' = C' · u / h    with    h = C' · C' - C'' · (x - C)

The rows are n · (x - C) along two normals of the tangent t. As t turns with (t × C'') (t · u) / h,
so do they. How they turn about t changes no force, so they are normal to a constant direction too.

Several places may be the nearest ones around them, as where a curve crosses itself. A block keeps
the last s, from which the next search begins, so that a point stays on its branch. A point that is
far from there has been put elsewhere, and is sought along the whole curve. The last steps of a
search begin at a whole multiple of a small way, so that s does not depend on where it began.
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..pieces import located, polynomial
from ..rows import origin_of, rotation_of
from ..vec import add_scaled, cross, dot, load, mul, mul_t, scale, store, sub

AXES = 3  # rows of a piece, one for each coordinate of the curve
PLACES_TRIED = 8  # places in each piece from which the nearest point is sought
MOST_DESCENTS = 32  # rounds of a search from one place, more than any regular curve needs
LAST_STEPS = 2  # after them the error of the first beginning is below rounding


@sweep
def curve_at(curves, first, count, s):
    """Return C, C' and C'' in the axes of the row, from `count` rows of pieces and their end."""
    i, way, beyond, _ = located(curves, first, count // AXES, AXES * 1.0, at.PIECE_RATE, s)
    a = polynomial(curves, i, way, beyond, at.PIECE_POWERS, 1)
    b = polynomial(curves, i + 1.0, way, beyond, at.PIECE_POWERS, 1)
    c = polynomial(curves, i + 2.0, way, beyond, at.PIECE_POWERS, 1)
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


@part
def denominator(apart, slope, bend):
    """Return h, but at least half of C' · C', so that no step leads to the farthest place."""
    square = dot(slope, slope)
    return max(square - dot(apart, bend), 0.5 * square)


@sweep
def step_along(curves, first, count, x, s):
    """Return the way from s towards the point of the curve that is nearest to x."""
    place, slope, bend = curve_at(curves, first, count, s)
    apart = sub(x, place)
    return dot(slope, apart) / denominator(apart, slope, bend)


@sweep
def sought(curves, first, count, x):
    """Return about where the curve is nearest to x, by tangents at several places of each piece."""
    least = -1.0
    found = 0.0 * x[0]
    for n in range(count // AXES):
        begin = curves[first + AXES * n, at.PIECE_AT]
        part_width = (curves[first + AXES * (n + 1), at.PIECE_AT] - begin) / PLACES_TRIED
        for k in range(PLACES_TRIED):
            s = begin + (k + 0.5) * part_width
            place, slope, _ = curve_at(curves, first, count, s)
            apart = sub(x, place)
            way = dot(slope, apart) / dot(slope, slope)
            way = min(max(way, -0.5 * part_width), 0.5 * part_width)
            left = add_scaled(apart, -way, slope)
            square = dot(left, left)
            if least < 0.0 or square < least:
                least = square + 0.0
                found = s + way
    return found


@sweep
def descended(curves, first, count, x, s, grain):
    """Return the coordinate of the nearest point around s, to about the square of `grain`."""
    for _ in range(MOST_DESCENTS):
        step = step_along(curves, first, count, x, s)
        s = s + step
        if abs(step) <= grain:
            break
    return s


@sweep
def nearest(blocks_i, blocks_f, curves, i, x):
    """Return the coordinate of the point on curve i that is nearest to x, on the last branch."""
    first, count = blocks_i[i, at.B_CURVE], blocks_i[i, at.B_KNOTS]
    grain, s = blocks_f[i, at.GRAIN], blocks_f[i, at.WAY]
    close = False
    if blocks_f[i, at.KNOWN] == 1.0:
        s = descended(curves, first, count, x, s, grain)
        apart = sub(x, curve_at(curves, first, count, s)[0])
        close = dot(apart, apart) <= blocks_f[i, at.REACH] * blocks_f[i, at.REACH]
    if not close:
        s = descended(curves, first, count, x, sought(curves, first, count, x), grain)
    start = curves[first, at.PIECE_AT]
    period = curves[first + count - 1, at.PIECE_AT] - start
    s = s - (math.floor((s - start) * curves[first, at.PIECE_RATE]) * 1.0) * period
    s = (math.floor(s / grain + 0.5) * 1.0) * grain
    for _ in range(LAST_STEPS):
        s = s + step_along(curves, first, count, x, s)
    return s


@part
def apart_from(blocks_i, curves, i, x, s):
    """Return the vector to x from the point at s of curve i, then C' and C'', in the row's axes."""
    place, slope, bend = curve_at(curves, blocks_i[i, at.B_CURVE], blocks_i[i, at.B_KNOTS], s)
    return sub(x, place), slope, bend


@part
def within(blocks_i, i, work, p):
    """Return the place p in the axes of the row of B."""
    b = blocks_i[i, at.B_B]
    return mul_t(rotation_of(work, b), sub(p, origin_of(work, b)))


@part
def follow_curve(blocks, i, work, p, place):
    """Find the point of curve i at p, and write the normals, and how they turn, into its place."""
    blocks_i, blocks_f, curves = blocks.blocks_i, blocks.blocks_f, blocks.curves
    x = within(blocks_i, i, work, p)
    s = nearest(blocks_i, blocks_f, curves, i, x)
    blocks_f[i, at.WAY] = s
    blocks_f[i, at.KNOWN] = 1.0
    apart, slope, bend = apart_from(blocks_i, curves, i, x, s)
    t = scale(1.0 / math.sqrt(dot(slope, slope)), slope)
    n = cross(load(blocks_f, i, at.DIR), t)
    n = scale(1.0 / math.sqrt(dot(n, n)), n)
    r = rotation_of(work, blocks_i[i, at.B_B])
    store(place, i, at.PLACE_D, mul(r, n))
    store(place, i, at.PLACE_D + 3, mul(r, cross(t, n)))
    turn = scale(1.0 / denominator(apart, slope, bend), cross(t, bend))
    store(place, i, at.PLACE_TURN, mul(r, turn))


@part
def curve_gap(blocks, i, work, p):
    """Return the vector to p from its point on curve i, in the world, after `follow_curve`."""
    blocks_i, s = blocks.blocks_i, blocks.blocks_f[i, at.WAY]
    apart, _, _ = apart_from(blocks_i, blocks.curves, i, within(blocks_i, i, work, p), s)
    return mul(rotation_of(work, blocks_i[i, at.B_B]), apart)


@part
def turn_along(place, i, u):
    """Return with which angular velocity the normals of curve i turn as B sees it."""
    t = cross(load(place, i, at.PLACE_D), load(place, i, at.PLACE_D + 3))
    return scale(dot(t, u), load(place, i, at.PLACE_TURN))
