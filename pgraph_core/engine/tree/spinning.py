"""Angular velocity of a free body, or of a ball on the ground, over a whole step.

Euler's equations I Ω' + Ω × I Ω = τ are solved by the implicit midpoint rule in the body's axes.
Without a torque, Ωᵀ I Ω and |I Ω| stay constant at any speed, because the rule keeps quadratic
invariants ([Hairer et al. 2006, ch. IV.2]). A body rotates about its own angular velocity, first by
that before the step and then by that after it. So both have the same components in the body's axes
at either end as in its axes at the middle of the step, where all is solved.
"""

import math

from ...tolerances import EPS, LONGEST_STEP, TINY
from ..compiler.elementary import sine_cosine
from ..compiler.jit import part, sweep
from ..linear import factor3, solve3
from ..rows import BALL, FREE, kind_of, mass_of, parent_of, rotation_of, v_of
from ..vec import (
    about_origin,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    mul,
    mul_t,
    rodrigues,
    rotate_sym,
    scale,
    store3,
    sub,
    sym_mul,
)
from .kinematics import base_axes

TURN = LONGEST_STEP / 2  # [rad] rotation in a substep that converges for any inertia
MOST_SUBSTEPS = 400  # limit on substeps, beyond which a body keeps its angular velocity
NEWTON = 30
ENOUGH = 64 * EPS  # relative: a correction, or a gyroscopic torque, that is rounding


@sweep
def keep_spinning(rows, const, work, v, h, free, vdot):
    """Replace v' of bodies that turn freely by their change over the step, a time h apart.

    `v` is that at the step's start, `work` and v' are of its middle. `free` (nv,) is scratch.
    """
    for j in range(v.shape[0]):
        free[j] = 1.0
    for k in range(1, rows.shape[0]):
        if parent_of(rows, k) > 0:
            free[v_of(rows, parent_of(rows, k))] = 0.0
    for k in range(1, rows.shape[0]):
        j = v_of(rows, k)
        if kind_of(rows, k) < BALL or parent_of(rows, k) > 0 or free[j] == 0.0:
            continue
        axes = base_axes(const, work, 0, k)
        r = rotation_of(work, k)
        m, com, central = mass_of(const, k)
        c = mul(r, com)
        inertia = rotate_sym(r, central)
        if kind_of(rows, k) == BALL:
            inertia = about_origin(inertia, m, c)
        before = mul(axes, (v[j], v[j + 1], v[j + 2]))
        alpha = mul(axes, (vdot[j], vdot[j + 1], vdot[j + 2]))
        after = rate_after(inertia, before, alpha, h)
        store3(vdot, j, mul_t(axes, scale(1.0 / h, sub(after, before))))
        if kind_of(rows, k) == FREE and dot(com, com) > 0.0:  # the centre of mass moves on
            linear = mul(axes, (vdot[j + 3], vdot[j + 4], vdot[j + 5]))
            swing = add_cross(cross(alpha, c), before, cross(before, c))
            orbit = sub(
                cross(before, swung(c, -0.5 * h, before)), cross(after, swung(c, 0.5 * h, after))
            )
            linear = add_scaled(add(linear, swing), 1.0 / h, orbit)
            store3(vdot, j + 3, mul_t(axes, linear))


@part
def swung(c, h, w):
    """c turned by the rate w for the time h."""
    rate = math.sqrt(dot(w, w) + TINY)
    sine, cosine = sine_cosine(h * rate)
    return mul(rodrigues(scale(1.0 / rate, w), sine, cosine), c)


@part
def rate_after(inertia, before, alpha, h):
    """Rate of turn after a step of width h, from the rate before it and the explicit ω' [1/s²].

    In substeps of at most TURN. Where they are too many, or fail, the gyroscopic torque is left
    out, which keeps the energy too.
    """
    momentum = sym_mul(inertia, before)
    gyroscopic = cross(before, momentum)
    small = ENOUGH * ENOUGH * dot(before, before) * dot(momentum, momentum)
    after = add_scaled(before, h, alpha)
    if not dot(gyroscopic, gyroscopic) > small:
        return after
    pushed = add(alpha, solve3(factor3(inertia), gyroscopic))  # by τ alone
    most = math.sqrt(max(dot(before, before), dot(after, after)))
    after = add_scaled(before, h, pushed)
    most = max(most, math.sqrt(dot(after, after)))
    if not h * most < TURN * MOST_SUBSTEPS:
        return after
    count = 1 + int(h * most / TURN)
    width = h / count
    torque = scale(width * width, sym_mul(inertia, pushed))
    turn = scale(width, before)
    for _ in range(count):
        middle, found = middle_turn(inertia, turn, torque)
        if not found:
            return after
        turn = sub(add(middle, middle), turn)
    return scale(1.0 / width, turn)


@part
def middle_turn(inertia, turn, torque):
    """θ of 2 I (θ - θ₀) + θ × I θ = h² τ by Newton's method, and whether it was found."""
    theta = turn
    for _ in range(NEWTON):
        momentum = sym_mul(inertia, theta)
        gap = add_cross(
            sub(scale(2.0, sym_mul(inertia, sub(theta, turn))), torque), theta, momentum
        )
        x = column(inertia, theta, momentum, (1.0, 0.0, 0.0))
        y = column(inertia, theta, momentum, (0.0, 1.0, 0.0))
        z = column(inertia, theta, momentum, (0.0, 0.0, 1.0))
        yz = cross(y, z)
        size = 1.0 / dot(x, yz)
        step = scale(size, (dot(gap, yz), dot(gap, cross(z, x)), dot(gap, cross(x, y))))
        theta = sub(theta, step)
        if dot(step, step) <= ENOUGH * ENOUGH * dot(theta, theta):
            return theta, True
    return theta, False


@part
def column(inertia, theta, momentum, e):
    """Slope of the midpoint rule's gap along the unit vector e: 2 I e + θ × I e + e × I θ."""
    along = sym_mul(inertia, e)
    return add(add_cross(scale(2.0, along), theta, along), cross(e, momentum))
