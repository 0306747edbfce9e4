"""Hinge: a rotation about an axis fixed in the parent row, H = (h, 0)."""

from .. import layout as at
from ..compiler.jit import part
from ..rows import (
    axis_of,
    home_axis,
    home_link,
    link_of,
    parent_of,
    rotation_of,
    set_axis,
    set_coriolis,
    set_link,
    set_rotation,
    set_spin,
    sine_cosine_of,
    spin_of,
    v_of,
)
from ..vec import add, add_scaled, cross, dot, mat_mul, mul, mul_t, rodrigues, scale, sym_mul
from .contract import Single, straight


@part
def place(rows, work, k, const, q):
    r, u = rotation_of(work, parent_of(rows, k)), home_axis(const, k)
    sine, cosine = sine_cosine_of(work, k)
    set_axis(work, k, mul(r, u))
    set_rotation(work, k, mat_mul(r, rodrigues(u, sine, cosine)))
    set_link(work, k, mul(r, home_link(const, k)))


@part
def set_rates(rows, work, k, const, v):
    w = spin_of(work, parent_of(rows, k))
    relative = scale(v[v_of(rows, k)], axis_of(work, k))
    set_spin(work, k, add(w, relative))
    set_coriolis(work, k, cross(w, relative), cross(w, cross(w, link_of(work, k))))


@part
def column(rows, work, k):
    h = axis_of(work, k)
    return h, scale(0.0, h)


@part
def add_motion(rows, work, k, x, alpha, linear):
    return add_scaled(alpha, x, axis_of(work, k)), linear


@part
def along(rows, work, k, moment, force):
    return dot(axis_of(work, k), moment)


@part
def through(rows, work, k, j, b, m):
    h = axis_of(work, k)
    u0, u1 = sym_mul(j, h), mul_t(b, h)
    return u0, u1, dot(h, u0)


@part
def size(rows, work, k, angular, linear):
    return angular


HINGE = Single(
    number=at.ROTATE,
    angle=True,
    turns=True,
    travels=False,
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
