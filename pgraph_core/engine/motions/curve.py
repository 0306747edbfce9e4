"""Curve: displacement x(q) and rotation R(q) are functions of one coordinate, H = (a, x').

Both are polynomials of degree 7 in each piece of the track, for x and for a quaternion p of any
length. R is the rotation by p, and a = 2 vec(p' p̄) / |p|² in the axes before the motion, so that
R' = a × R. Beyond the ends of an open curve, x and p go on with a constant second derivative. A
closed curve repeats itself.
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..pieces import located, polynomial
from ..rows import (
    axis_of,
    bend_of,
    home_link,
    link_of,
    parent_of,
    q_of,
    rotation_of,
    set_axis,
    set_bend,
    set_coriolis,
    set_link,
    set_rotation,
    set_slide,
    set_spin,
    slide_of,
    spin_of,
    track_of,
    track_rows_of,
    v_of,
)
from ..vec import add, add_cross, add_scaled, cross, dot, mat_mul, mul, quaternion_matrix, scale
from .axial import add_motion, along, column, through, unit_wrench
from .contract import Single


@sweep
def displacements(const, first, rows, q):
    """Return x, x', x'' and x''' in home axes."""
    i, s, beyond, _ = located(const, first, rows // 2, 2.0, at.TRACK_RATE, q)
    a = polynomial(const, i, s, beyond, at.TRACK_PLACE, 3)
    b = polynomial(const, i, s, beyond, at.TRACK_PLACE + 1, 3)
    c = polynomial(const, i, s, beyond, at.TRACK_PLACE + 2, 3)
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2]), (a[3], b[3], c[3])


@sweep
def quaternions(const, first, rows, q):
    """Return p, p', p'' and p''' in home axes."""
    i, s, beyond, _ = located(const, first, rows // 2, 2.0, at.TRACK_RATE, q)
    i = i + 1.0
    a = polynomial(const, i, s, beyond, at.TRACK_TURN, 4)
    b = polynomial(const, i, s, beyond, at.TRACK_TURN + 1, 4)
    c = polynomial(const, i, s, beyond, at.TRACK_TURN + 2, 4)
    d = polynomial(const, i, s, beyond, at.TRACK_TURN + 3, 4)
    return (
        (a[0], b[0], c[0], d[0]),
        (a[1], b[1], c[1], d[1]),
        (a[2], b[2], c[2], d[2]),
        (a[3], b[3], c[3], d[3]),
    )


@part
def dot4(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@part
def twist(a, b):
    """Return vec(a b̄) of two quaternions."""
    v, w = (a[1], a[2], a[3]), (b[1], b[2], b[3])
    return add_scaled(add_cross(scale(b[0], v), w, v), -a[0], w)


@part
def turning(p, p1, p2):
    """Return a and a', from (|p|² a)' = 2 vec(p'' p̄)."""
    over = 2.0 / dot4(p, p)
    a = scale(over, twist(p1, p))
    return a, add_scaled(scale(over, twist(p2, p)), -over * dot4(p, p1), a)


@part
def place(rows, work, k, const, q):
    r = rotation_of(work, parent_of(rows, k))
    first, count, here = track_of(rows, k), track_rows_of(rows, k), q[q_of(rows, k)]
    x, x1, x2, _ = displacements(const, first, count, here)
    p, p1, p2, _ = quaternions(const, first, count, here)
    a, a1 = turning(p, p1, p2)
    set_rotation(work, k, mat_mul(r, quaternion_matrix(p[0], p[1], p[2], p[3])))
    set_link(work, k, mul(r, add(home_link(const, k), x)))
    set_axis(work, k, mul(r, a))
    set_slide(work, k, mul(r, x1))
    set_bend(work, k, mul(r, a1), mul(r, x2))


@part
def set_rates(rows, work, k, const, v):
    w, rate = spin_of(work, parent_of(rows, k)), v[v_of(rows, k)]
    relative = scale(rate, axis_of(work, k))
    set_spin(work, k, add(w, relative))
    around = add_cross(scale(2.0 * rate, slide_of(work, k)), w, link_of(work, k))
    turn, bend = bend_of(work, k)
    own = rate * rate
    set_coriolis(
        work,
        k,
        add_scaled(cross(w, relative), own, turn),
        add_scaled(cross(w, around), own, bend),
    )


@part
def slopes(rows, work, k, const, q):
    """Return H' and H'', where (|p|² a)'' = 2 vec(p''' p̄ + p'' p̄')."""
    r = rotation_of(work, parent_of(rows, k))
    first, count, here = track_of(rows, k), track_rows_of(rows, k), q[q_of(rows, k)]
    _, _, _, x3 = displacements(const, first, count, here)
    p, p1, p2, p3 = quaternions(const, first, count, here)
    a, a1 = turning(p, p1, p2)
    over = 2.0 / dot4(p, p)
    a2 = scale(over, add(twist(p3, p), twist(p2, p1)))
    a2 = add_scaled(a2, -2.0 * over * dot4(p, p1), a1)
    a2 = add_scaled(a2, -over * (dot4(p, p2) + dot4(p1, p1)), a)
    return bend_of(work, k), (mul(r, a2), mul(r, x3))


@part
def size(rows, work, k, angular, linear):
    h, slide = axis_of(work, k), slide_of(work, k)
    return math.sqrt(dot(h, h)) * angular + math.sqrt(dot(slide, slide)) * linear


CURVE = Single(
    number=at.CURVE,
    angle=True,
    turns=False,
    travels=True,
    bends=True,
    inert=False,
    place=place,
    set_rates=set_rates,
    column=column,
    unit_wrench=unit_wrench,
    slopes=slopes,
    add_motion=add_motion,
    along=along,
    through=through,
    size=size,
)
WIRE = CURVE._replace(number=at.WIRE, angle=False)  # the coordinate is a length [m]
