"""Screw: a rotation about an axis with a proportional displacement along it, H = (h, p h)."""

from .. import layout as at
from ..compiler.jit import part
from ..rows import (
    axis_of,
    home_axis,
    home_link,
    home_pitch,
    link_of,
    parent_of,
    pitch_of,
    q_of,
    rotation_of,
    set_axis,
    set_coriolis,
    set_link,
    set_pitch,
    set_rotation,
    set_spin,
    sine_cosine_of,
    spin_of,
    v_of,
)
from ..vec import (
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    mat_mul,
    mul,
    mul_t,
    rodrigues,
    scale,
    sym_mul,
)
from .contract import Single


@part
def place(rows, work, k, const, q):
    r = rotation_of(work, parent_of(rows, k))
    u, pitch = home_axis(const, k), home_pitch(const, k)
    h = mul(r, u)
    sine, cosine = sine_cosine_of(work, k)
    set_pitch(work, k, pitch)
    set_axis(work, k, h)
    set_rotation(work, k, mat_mul(r, rodrigues(u, sine, cosine)))
    slide = scale(pitch, h)
    set_link(work, k, add_scaled(mul(r, home_link(const, k)), q[q_of(rows, k)], slide))


@part
def set_rates(rows, work, k, const, v):
    w, rate = spin_of(work, parent_of(rows, k)), v[v_of(rows, k)]
    h, slide = column(rows, work, k)
    relative = scale(rate, h)
    set_spin(work, k, add(w, relative))
    around = add_cross(scale(2.0 * rate, slide), w, link_of(work, k))
    set_coriolis(work, k, cross(w, relative), cross(w, around))


@part
def column(rows, work, k):
    return axis_of(work, k), scale(pitch_of(work, k), axis_of(work, k))


@part
def add_motion(rows, work, k, x, alpha, linear):
    more = scale(x, axis_of(work, k))
    return add(alpha, more), add_scaled(linear, pitch_of(work, k), more)


@part
def along(rows, work, k, moment, force):
    return dot(axis_of(work, k), add_scaled(moment, pitch_of(work, k), force))


@part
def through(rows, work, k, j, b, m):
    h, slide = column(rows, work, k)
    u0, u1 = add(sym_mul(j, h), mul(b, slide)), add(mul_t(b, h), sym_mul(m, slide))
    return u0, u1, dot(h, u0) + dot(slide, u1)


@part
def size(rows, work, k, angular, linear):
    return angular + abs(pitch_of(work, k)) * linear


SCREW = Single(
    number=at.SCREW,
    angle=True,
    travels=True,
    inert=False,
    place=place,
    set_rates=set_rates,
    column=column,
    add_motion=add_motion,
    along=along,
    through=through,
    size=size,
)
