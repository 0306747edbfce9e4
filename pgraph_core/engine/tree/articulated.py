"""Articulated bodies: forward dynamics in three sweeps, O(n).

[Featherstone 2008, ch. 7], here in world-aligned axes at the bodies' origins, where the paper's
φ is a pure shift and a and b are those of eqs. (9) and (12).
"""

from .. import layout as at
from ..compiler.jit import part, sweep
from ..vec import (
    accumulate,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load6,
    mul,
    mul_t,
    scale,
    store,
    store3,
    sub,
    sym_mul,
)
from .factors import backward6, diagonal6, factor3, factor6, forward6, solve3
from .kinematics import base_axes, load_inertia, outboard

EPS16 = 16 * 2.220446049250313e-16


@part
def add_to_parent(work, p, link, j, b, m, moment, force):
    """Add φᵀ I φ and φᵀ f of a child to row p, eq. (12): both shifted by the link vector.

    With n = b + l× m the shifted inertia is [j + l× bᵀ - n l×, n; nᵀ, m].
    """
    accumulate(work, p, at.P, add_cross(moment, link, force))
    accumulate(work, p, at.P + 3, force)
    c0 = cross(link, (m[0], m[3], m[4]))
    c1 = cross(link, (m[3], m[1], m[5]))
    c2 = cross(link, (m[4], m[5], m[2]))
    n0 = (b[0] + c0[0], b[1] + c1[0], b[2] + c2[0])
    n1 = (b[3] + c0[1], b[4] + c1[1], b[5] + c2[1])
    n2 = (b[6] + c0[2], b[7] + c1[2], b[8] + c2[2])
    e0 = cross(link, (b[0], b[1], b[2]))
    e1 = cross(link, (b[3], b[4], b[5]))
    e2 = cross(link, (b[6], b[7], b[8]))
    f0 = cross(n0, link)
    f1 = cross(n1, link)
    i = at.IA
    work[p, i] += j[0] + e0[0] - f0[0]
    work[p, i + 1] += j[3] + e1[0] - f0[1]
    work[p, i + 2] += j[1] + e1[1] - f1[1]
    work[p, i + 3] += j[4] + e2[0] - f0[2]
    work[p, i + 4] += j[5] + e2[1] - f1[2]
    work[p, i + 5] += j[2] + e2[2] - (n2[0] * link[1] - n2[1] * link[0])
    work[p, i + 6] += n0[0]
    work[p, i + 7] += n1[0]
    work[p, i + 8] += n2[0]
    work[p, i + 9] += m[0]
    work[p, i + 10] += n0[1]
    work[p, i + 11] += n1[1]
    work[p, i + 12] += n2[1]
    work[p, i + 13] += m[3]
    work[p, i + 14] += m[1]
    work[p, i + 15] += n0[2]
    work[p, i + 16] += n1[2]
    work[p, i + 17] += n2[2]
    work[p, i + 18] += m[4]
    work[p, i + 19] += m[5]
    work[p, i + 20] += m[2]


@part
def reduce_hinge(rows, const, work, k, tau):
    """Articulated inertia and bias of a rotate or translate row, passed to its parent."""
    j, b, m = load_inertia(work, k)
    h = load(work, k, at.H)
    moment = load(work, k, at.P)
    force = load(work, k, at.P + 3)
    if rows[k, at.KIND] == at.ROTATE:
        u0 = sym_mul(j, h)
        u1 = mul_t(b, h)
        d = 1.0 / (dot(h, u0) + const[k, at.ARMATURE])
        left = tau[rows[k, at.VI]] - dot(h, moment)
    else:
        u0 = mul(b, h)
        u1 = sym_mul(m, h)
        d = 1.0 / (dot(h, u1) + const[k, at.ARMATURE])
        left = tau[rows[k, at.VI]] - dot(h, force)
    store(work, k, at.U, u0)
    store(work, k, at.U + 3, u1)
    work[k, at.D] = d
    work[k, at.UU] = left
    p = rows[k, at.PARENT]
    if p == 0:
        return
    a0 = load(work, k, at.A)
    a1 = load(work, k, at.A + 3)
    s = d * (left - dot(u0, a0) - dot(u1, a1))
    moment = add_scaled(add(add(moment, sym_mul(j, a0)), mul(b, a1)), s, u0)
    force = add_scaled(add(add(force, mul_t(b, a0)), sym_mul(m, a1)), s, u1)
    x0 = scale(-d, u0)
    x1 = scale(-d, u1)
    add_to_parent(
        work,
        p,
        load(work, k, at.L),
        add_outer(j, x0, u0),
        (
            b[0] + x0[0] * u1[0],
            b[1] + x0[0] * u1[1],
            b[2] + x0[0] * u1[2],
            b[3] + x0[1] * u1[0],
            b[4] + x0[1] * u1[1],
            b[5] + x0[1] * u1[2],
            b[6] + x0[2] * u1[0],
            b[7] + x0[2] * u1[1],
            b[8] + x0[2] * u1[2],
        ),
        add_outer(m, x1, u1),
        moment,
        force,
    )


@part
def add_outer(s, x, y):
    """s + x yᵀ for a symmetric result."""
    return (
        s[0] + x[0] * y[0],
        s[1] + x[1] * y[1],
        s[2] + x[2] * y[2],
        s[3] + x[0] * y[1],
        s[4] + x[0] * y[2],
        s[5] + x[1] * y[2],
    )


@part
def reduce_ball(rows, const, work, k, tau):
    """As `reduce_hinge` for three rotations at once: only bᵀ j⁻¹ b is left of the inertia."""
    j, b, m = load_inertia(work, k)
    i = rows[k, at.VI]
    p = rows[k, at.PARENT]
    axes = base_axes(const, work, p, k)
    moment = load(work, k, at.P)
    force = load(work, k, at.P + 3)
    left = sub(mul(axes, (tau[i], tau[i + 1], tau[i + 2])), moment)
    f = factor3(j)
    for n in range(6):
        work[k, at.U + n] = f[n]
    store(work, k, at.UU, left)
    if p == 0:
        return
    x0 = solve3(f, (b[0], b[3], b[6]))
    x1 = solve3(f, (b[1], b[4], b[7]))
    x2 = solve3(f, (b[2], b[5], b[8]))
    c0 = (b[0], b[3], b[6])
    c1 = (b[1], b[4], b[7])
    c2 = (b[2], b[5], b[8])
    m = (
        m[0] - dot(c0, x0),
        m[1] - dot(c1, x1),
        m[2] - dot(c2, x2),
        m[3] - dot(c0, x1),
        m[4] - dot(c0, x2),
        m[5] - dot(c1, x2),
    )
    # the joint transmits its own torque; its angular acceleration takes up the rest
    force = add(force, sym_mul(m, load(work, k, at.A + 3)))
    force = add(force, (dot(x0, left), dot(x1, left), dot(x2, left)))
    moment = add(moment, left)
    zero = 0.0 * m[0]
    none = (zero, zero, zero, zero, zero, zero)
    coupling = (zero, zero, zero, zero, zero, zero, zero, zero, zero)
    add_to_parent(work, p, load(work, k, at.L), none, coupling, m, moment, force)


@part
def reduce_free(rows, const, work, k, tau):
    """Factor the 6x6 inertia in place; the parent feels only the joint's own force."""
    i = rows[k, at.VI]
    p = rows[k, at.PARENT]
    axes = base_axes(const, work, p, k)
    moment = mul(axes, (tau[i], tau[i + 1], tau[i + 2]))
    force = mul(axes, (tau[i + 3], tau[i + 4], tau[i + 5]))
    if p > 0:
        accumulate(work, p, at.P, add_cross(moment, load(work, k, at.L), force))
        accumulate(work, p, at.P + 3, force)
    store(work, k, at.U, sub(moment, load(work, k, at.P)))
    store(work, k, at.U + 3, sub(force, load(work, k, at.P + 3)))
    factor6(work, k)


@sweep
def inboard(rows, const, work, tau):
    """Second sweep, tips to root: articulated inertias and bias forces."""
    for k in range(rows.shape[0] - 1, 0, -1):
        kind = rows[k, at.KIND]
        if kind <= at.TRANSLATE:
            reduce_hinge(rows, const, work, k, tau)
        elif kind == at.BALL:
            reduce_ball(rows, const, work, k, tau)
        else:
            reduce_free(rows, const, work, k, tau)


@sweep
def joint_acceleration(rows, const, work, vdot):
    """Third sweep, root to tips: v' of every row, and V' into P."""
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        i = rows[k, at.VI]
        kind = rows[k, at.KIND]
        alpha = load(work, p, at.P)
        linear = add_cross(load(work, p, at.P + 3), alpha, load(work, k, at.L))
        linear = add(linear, load(work, k, at.A + 3))
        alpha = add(alpha, load(work, k, at.A))
        if kind <= at.TRANSLATE:
            u0 = load(work, k, at.U)
            u1 = load(work, k, at.U + 3)
            x = work[k, at.D] * (work[k, at.UU] - dot(u0, alpha) - dot(u1, linear))
            vdot[i] = x
            if kind == at.ROTATE:
                alpha = add_scaled(alpha, x, load(work, k, at.H))
            else:
                linear = add_scaled(linear, x, load(work, k, at.H))
        elif kind == at.BALL:
            alpha = accelerate_ball(rows, const, work, k, alpha, linear, vdot)
        else:
            accelerate_free(rows, const, work, k, alpha, linear, vdot)
            alpha = load(work, k, at.U)
            linear = load(work, k, at.U + 3)
        store(work, k, at.P, alpha)
        store(work, k, at.P + 3, linear)


@part
def accelerate_ball(rows, const, work, k, alpha, linear, vdot):
    """v' of a ball; returns its angular acceleration j⁻¹ (u - b V'_linear)."""
    j, b, m = load_inertia(work, k)
    total = solve3(load6(work, k, at.U), sub(load(work, k, at.UU), mul(b, linear)))
    axes = base_axes(const, work, rows[k, at.PARENT], k)
    store3(vdot, rows[k, at.VI], mul_t(axes, sub(total, alpha)))
    return total


@part
def accelerate_free(rows, const, work, k, alpha, linear, vdot):
    """v' of a free row; leaves its V' in U."""
    forward6(work, k, at.U)
    diagonal6(work, k, at.U)
    backward6(work, k, at.U)
    i = rows[k, at.VI]
    axes = base_axes(const, work, rows[k, at.PARENT], k)
    store3(vdot, i, mul_t(axes, sub(load(work, k, at.U), alpha)))
    store3(vdot, i + 3, mul_t(axes, sub(load(work, k, at.U + 3), linear)))


@part
def articulated(rows, const, q, v, tau, work, vdot):
    """v' = M⁻¹ (τ - C), eq. (26), in three sweeps."""
    outboard(rows, const, work, q, v)
    inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)


@part
def vanishes(size, inverse):
    """Whether a pivot, given by its inverse, is rounding of an inertia of this size."""
    return not (EPS16 * size * inverse < 1.0 and inverse > 0.0)


@sweep
def singular_row(rows, work):
    """First row, from the tips, whose motion sees no inertia, to rounding; 0 if there is none."""
    for k in range(rows.shape[0] - 1, 0, -1):
        kind = rows[k, at.KIND]
        angular = work[k, at.IA] + work[k, at.IA + 2] + work[k, at.IA + 5]
        linear = work[k, at.IA + 9] + work[k, at.IA + 14] + work[k, at.IA + 20]
        if kind == at.ROTATE:
            if vanishes(angular, work[k, at.D]):
                return k
        elif kind == at.TRANSLATE:
            if vanishes(linear, work[k, at.D]):
                return k
        elif kind == at.BALL:
            for n in range(3):
                if vanishes(angular, work[k, at.U + n]):
                    return k
        else:  # the factor stands where the inertia was: pivots against pivots
            angular = 1.0 / work[k, at.IA] + 1.0 / work[k, at.IA + 2] + 1.0 / work[k, at.IA + 5]
            linear = (
                1.0 / work[k, at.IA + 9] + 1.0 / work[k, at.IA + 14] + 1.0 / work[k, at.IA + 20]
            )
            for n in range(6):
                size = angular if n < 3 else linear
                if vanishes(size, work[k, at.IA + n * (n + 1) // 2 + n]):
                    return k
    return 0
