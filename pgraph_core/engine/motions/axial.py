"""Motions of one coordinate that turn and slide: what follows from H = (h, s), for both parts."""

from ..compiler.jit import part
from ..rows import axis_of, slide_of
from ..vec import add, add_scaled, dot, mul, mul_t, scale, sym_mul


@part
def column(rows, work, k):
    return axis_of(work, k), slide_of(work, k)


@part
def unit_wrench(rows, work, k):
    """Return H / HᵀH."""
    h, slide = axis_of(work, k), slide_of(work, k)
    over = 1.0 / (dot(h, h) + dot(slide, slide))
    return scale(over, h), scale(over, slide)


@part
def add_motion(rows, work, k, x, alpha, linear):
    return add_scaled(alpha, x, axis_of(work, k)), add_scaled(linear, x, slide_of(work, k))


@part
def along(rows, work, k, moment, force):
    return dot(axis_of(work, k), moment) + dot(slide_of(work, k), force)


@part
def through(rows, work, k, j, b, m):
    h, slide = axis_of(work, k), slide_of(work, k)
    u0, u1 = add(sym_mul(j, h), mul(b, slide)), add(mul_t(b, h), sym_mul(m, slide))
    return u0, u1, dot(h, u0) + dot(slide, u1)
