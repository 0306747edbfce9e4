"""Slider: a translation along an axis fixed in the parent row, H = (0, h)."""

from .. import layout as at
from ..compiler.jit import part
from ..rows import (
    axis_of,
    home_axis,
    home_link,
    link_of,
    parent_of,
    q_of,
    rotation_of,
    set_axis,
    set_coriolis,
    set_link,
    set_rotation,
    set_spin,
    spin_of,
    v_of,
)
from ..vec import add_cross, add_scaled, cross, dot, mul, scale, sym_mul
from .contract import Single, straight


@part
def place(rows, work, k, const, q):
    r = rotation_of(work, parent_of(rows, k))
    h = mul(r, home_axis(const, k))
    set_axis(work, k, h)
    set_rotation(work, k, r)
    set_link(work, k, add_scaled(mul(r, home_link(const, k)), q[q_of(rows, k)], h))


@part
def set_rates(rows, work, k, const, v):
    w = spin_of(work, parent_of(rows, k))
    slide = scale(2.0 * v[v_of(rows, k)], axis_of(work, k))
    set_spin(work, k, w)
    set_coriolis(work, k, scale(0.0, w), cross(w, add_cross(slide, w, link_of(work, k))))


@part
def column(rows, work, k):
    h = axis_of(work, k)
    return scale(0.0, h), h


@part
def add_motion(rows, work, k, x, alpha, linear):
    return alpha, add_scaled(linear, x, axis_of(work, k))


@part
def along(rows, work, k, moment, force):
    return dot(axis_of(work, k), force)


@part
def through(rows, work, k, j, b, m):
    h = axis_of(work, k)
    u0, u1 = mul(b, h), sym_mul(m, h)
    return u0, u1, dot(h, u1)


@part
def size(rows, work, k, angular, linear):
    return linear


SLIDER = Single(
    number=at.TRANSLATE,
    angle=False,
    turns=False,
    travels=True,
    bends=False,
    inert=False,
    place=place,
    set_rates=set_rates,
    column=column,
    unit_wrench=column,
    slopes=straight,
    add_motion=add_motion,
    along=along,
    through=through,
    size=size,
)
