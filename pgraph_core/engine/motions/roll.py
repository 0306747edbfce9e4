"""Roll: a rotation about an axis with a proportional displacement beside it, H = (h, p h × b).

The unit vector h × b is normal to the axis u: it is the direction in which a wheel on that axis
rolls. It follows from u in the axes before the motion, without branches, as in [Duff et al. 2017].
"""

import math

from .. import layout as at
from ..compiler.jit import part
from ..compiler.masks import chosen, most
from ..rows import (
    axis_of,
    home_axis,
    home_link,
    home_pitch,
    link_of,
    parent_of,
    q_of,
    rotation_of,
    set_axis,
    set_coriolis,
    set_link,
    set_rotation,
    set_slide,
    set_spin,
    sine_cosine_of,
    slide_of,
    spin_of,
    v_of,
)
from ..vec import add, add_cross, add_scaled, cross, dot, mat_mul, mul, rodrigues, scale
from .axial import add_motion, along, column, through, unit_wrench
from .contract import Single, straight


@part
def beside(u):
    """Return a unit vector normal to a unit vector."""
    sign = chosen(most(0.0 * u[2], u[2]), 1.0 + 0.0 * u[2], -1.0 + 0.0 * u[2])
    a = -1.0 / (sign + u[2])
    return 1.0 + sign * u[0] * u[0] * a, sign * u[0] * u[1] * a, -sign * u[0]


@part
def place(rows, work, k, const, q):
    r = rotation_of(work, parent_of(rows, k))
    u = home_axis(const, k)
    sine, cosine = sine_cosine_of(work, k)
    set_axis(work, k, mul(r, u))
    set_rotation(work, k, mat_mul(r, rodrigues(u, sine, cosine)))
    slide = scale(home_pitch(const, k), mul(r, beside(u)))
    set_slide(work, k, slide)
    set_link(work, k, add_scaled(mul(r, home_link(const, k)), q[q_of(rows, k)], slide))


@part
def set_rates(rows, work, k, const, v):
    w, rate = spin_of(work, parent_of(rows, k)), v[v_of(rows, k)]
    relative = scale(rate, axis_of(work, k))
    set_spin(work, k, add(w, relative))
    around = add_cross(scale(2.0 * rate, slide_of(work, k)), w, link_of(work, k))
    set_coriolis(work, k, cross(w, relative), cross(w, around))


@part
def size(rows, work, k, angular, linear):
    slide = slide_of(work, k)
    return angular + math.sqrt(dot(slide, slide)) * linear


ROLL = Single(
    number=at.ROLL,
    angle=True,
    turns=True,
    travels=True,
    bends=True,  # about the origin, which moves across the axis
    inert=False,
    place=place,
    set_rates=set_rates,
    column=column,
    unit_wrench=unit_wrench,
    slopes=straight,
    add_motion=add_motion,
    along=along,
    through=through,
    size=size,
)
