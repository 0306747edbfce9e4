"""Articulated-body algorithm: forward dynamics in three sweeps, O(n).

[Featherstone 2008, ch. 7], here in world-aligned axes at the bodies' origins, where the paper's
φ is a pure shift and a and b are those of eqs. (9) and (12).
"""

from ...tolerances import EPS
from ..compiler.jit import part, sweep
from ..linear import backward6, diagonal6, factor3, factor6, forward6, pivots6, solve3
from ..rows import (
    BALL,
    ROTATE,
    SCREW,
    TRANSLATE,
    add_bias,
    add_inertia,
    armature_of,
    axis_of,
    ball_of,
    bias_of,
    coriolis_of,
    inertia_of,
    inverse_pivot_of,
    kind_of,
    left_of,
    link_of,
    parent_of,
    pitch_of,
    projected_of,
    set_acceleration,
    set_ball,
    set_hinge,
    set_solved,
    solved_of,
    traces_of,
    v_of,
)
from ..vec import (
    add,
    add9,
    add_cross,
    add_outer,
    add_outer9,
    add_scaled,
    columns_of,
    cross,
    cross_sym,
    dot,
    mul,
    mul_t,
    rows_of,
    scale,
    store3,
    sub,
    sym_mul,
)
from .kinematics import along_axis, base_axes, carried, outboard, with_own


@part
def shifted(link, j, b, m):
    """Return φᵀ I φ (12) for I = [j b, bᵀ m]: [j + l× bᵀ - n l×, n, nᵀ, m] with n = b + l× m."""
    n = add9(b, cross_sym(link, m))
    b0, b1, b2 = rows_of(b)
    n0, n1, n2 = rows_of(n)
    e0, e1, e2 = cross(link, b0), cross(link, b1), cross(link, b2)  # columns of l× bᵀ
    f0, f1, f2 = cross(n0, link), cross(n1, link), cross(n2, link)  # rows of n l×
    j = (
        j[0] + e0[0] - f0[0],
        j[1] + e1[1] - f1[1],
        j[2] + e2[2] - f2[2],
        j[3] + e1[0] - f0[1],
        j[4] + e2[0] - f0[2],
        j[5] + e2[1] - f1[2],
    )
    return j, n, m


@part
def add_to_parent(work, p, link, inertia, moment, force):
    """Add φᵀ I φ and φᵀ f of a child to row p, eq. (12), both shifted by the link vector."""
    add_bias(work, p, add_cross(moment, link, force), force)
    j, b, m = shifted(link, inertia[0], inertia[1], inertia[2])
    add_inertia(work, p, j, b, m)


@part
def reduce_hinge(rows, const, work, k, tau):
    """Add I - U Uᵀ / D and p + I a + U u' / D of a row with one coordinate to its parent.

    [Featherstone 2008, eqs. (7.23), (7.24)]: U = I h, D = hᵀ U + armature, u' = τ - hᵀ p - Uᵀ a,
    with the bias p = (moment, force) and I of the blocks j, b, bᵀ, m. Kept: U, 1 / D, τ - hᵀ p.
    """
    j, b, m = inertia_of(work, k)
    h = axis_of(work, k)
    moment, force = bias_of(work, k)
    kind = kind_of(rows, k)
    if kind == ROTATE:
        u0, u1 = sym_mul(j, h), mul_t(b, h)
        d = 1.0 / (dot(h, u0) + armature_of(const, k))
    elif kind == SCREW:
        slide = scale(pitch_of(work, k), h)
        u0, u1 = add(sym_mul(j, h), mul(b, slide)), add(mul_t(b, h), sym_mul(m, slide))
        d = 1.0 / (dot(h, u0) + dot(slide, u1) + armature_of(const, k))
    else:
        u0, u1 = mul(b, h), sym_mul(m, h)
        d = 1.0 / (dot(h, u1) + armature_of(const, k))
    left = tau[v_of(rows, k)] - along_axis(work, k, kind, moment, force)
    set_hinge(work, k, u0, u1, d, left)
    p = parent_of(rows, k)
    if p == 0:
        return
    a0, a1 = coriolis_of(work, k)
    s = d * (left - dot(u0, a0) - dot(u1, a1))
    moment = add_scaled(add(add(moment, sym_mul(j, a0)), mul(b, a1)), s, u0)
    force = add_scaled(add(add(force, mul_t(b, a0)), sym_mul(m, a1)), s, u1)
    x0, x1 = scale(-d, u0), scale(-d, u1)
    inertia = (add_outer(j, x0, u0), add_outer9(b, x0, u1), add_outer(m, x1, u1))
    add_to_parent(work, p, link_of(work, k), inertia, moment, force)


@part
def reduce_ball(rows, const, work, k, tau):
    """Apply `reduce_hinge` to three rotations at once, which leaves the inertia m - bᵀ j⁻¹ b."""
    j, b, m = inertia_of(work, k)
    i = v_of(rows, k)
    p = parent_of(rows, k)
    axes = base_axes(const, work, p, k)
    moment, force = bias_of(work, k)
    left = sub(mul(axes, (tau[i], tau[i + 1], tau[i + 2])), moment)
    f = factor3(j)
    set_ball(work, k, f, left)
    if p == 0:
        return
    c0, c1, c2 = columns_of(b)
    x0, x1, x2 = solve3(f, c0), solve3(f, c1), solve3(f, c2)
    m = (
        m[0] - dot(c0, x0),
        m[1] - dot(c1, x1),
        m[2] - dot(c2, x2),
        m[3] - dot(c0, x1),
        m[4] - dot(c0, x2),
        m[5] - dot(c1, x2),
    )
    # the joint transmits its own torque; its angular acceleration takes up the rest
    force = add(force, sym_mul(m, coriolis_of(work, k)[1]))
    force = add(force, (dot(x0, left), dot(x1, left), dot(x2, left)))
    moment = add(moment, left)
    zero = 0.0 * m[0]
    none = (zero, zero, zero, zero, zero, zero)
    coupling = (zero, zero, zero, zero, zero, zero, zero, zero, zero)
    add_to_parent(work, p, link_of(work, k), (none, coupling, m), moment, force)


@part
def reduce_free(rows, const, work, k, tau):
    """Factor the 6x6 inertia in place. The force on the parent only consists of the joint force."""
    i = v_of(rows, k)
    p = parent_of(rows, k)
    axes = base_axes(const, work, p, k)
    moment = mul(axes, (tau[i], tau[i + 1], tau[i + 2]))
    force = mul(axes, (tau[i + 3], tau[i + 4], tau[i + 5]))
    if p > 0:
        add_bias(work, p, add_cross(moment, link_of(work, k), force), force)
    moment_b, force_b = bias_of(work, k)
    set_solved(work, k, sub(moment, moment_b), sub(force, force_b))
    factor6(work, k)


@sweep
def inboard(rows, const, work, tau):
    """Second sweep, tips to root: compute articulated inertias and bias forces."""
    for k in range(rows.shape[0] - 1, 0, -1):
        kind = kind_of(rows, k)
        if kind <= TRANSLATE:
            reduce_hinge(rows, const, work, k, tau)
        elif kind == BALL:
            reduce_ball(rows, const, work, k, tau)
        else:
            reduce_free(rows, const, work, k, tau)


@sweep
def joint_acceleration(rows, const, work, vdot):
    """Third sweep, root to tips: compute v' of every row, with V' overwriting the bias."""
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        i = v_of(rows, k)
        kind = kind_of(rows, k)
        alpha, linear = carried(work, p, k)
        a0, a1 = coriolis_of(work, k)
        linear = add(linear, a1)
        alpha = add(alpha, a0)
        if kind <= TRANSLATE:
            u0, u1 = projected_of(work, k)
            rate = inverse_pivot_of(work, k) * (left_of(work, k) - dot(u0, alpha) - dot(u1, linear))
            vdot[i] = rate
            alpha, linear = with_own(work, k, kind, rate, alpha, linear)
        elif kind == BALL:
            alpha = accelerate_ball(rows, const, work, k, alpha, linear, vdot)
        else:
            accelerate_free(rows, const, work, k, alpha, linear, vdot)
            alpha, linear = solved_of(work, k)
        set_acceleration(work, k, alpha, linear)


@part
def accelerate_ball(rows, const, work, k, alpha, linear, vdot):
    """Compute v' of a ball. Returns its angular acceleration j⁻¹ (u - b V'_linear)."""
    _, b, _ = inertia_of(work, k)
    f, left = ball_of(work, k)
    total = solve3(f, sub(left, mul(b, linear)))
    axes = base_axes(const, work, parent_of(rows, k), k)
    store3(vdot, v_of(rows, k), mul_t(axes, sub(total, alpha)))
    return total


@part
def accelerate_free(rows, const, work, k, alpha, linear, vdot):
    """Compute v' of a free row and overwrite the solution with V'."""
    forward6(work, k)
    diagonal6(work, k)
    backward6(work, k)
    i = v_of(rows, k)
    axes = base_axes(const, work, parent_of(rows, k), k)
    angular, along = solved_of(work, k)
    store3(vdot, i, mul_t(axes, sub(angular, alpha)))
    store3(vdot, i + 3, mul_t(axes, sub(along, linear)))


@part
def articulated(rows, const, q, v, tau, work, vdot):
    """Compute v' = M⁻¹ (τ - C), eq. (26), in three sweeps."""
    outboard(rows, const, work, q, v)
    inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)


@part
def vanishes(size, inverse):
    """Check whether a pivot, given by its inverse, is zero to rounding for an inertia of this
    size."""
    return not (16 * EPS * size * inverse < 1.0 and inverse > 0.0)


@sweep
def singular_row(rows, work):
    """Find the first row, starting from the tips, with no inertia up to rounding, or 0 if there
    is none."""
    for k in range(rows.shape[0] - 1, 0, -1):
        kind = kind_of(rows, k)
        angular, linear = traces_of(work, k)
        if kind <= TRANSLATE:
            size = angular if kind < TRANSLATE else linear
            if kind == SCREW:
                size += pitch_of(work, k) ** 2 * linear
            if vanishes(size, inverse_pivot_of(work, k)):
                return k
        elif kind == BALL:
            f, _ = ball_of(work, k)
            if vanishes(angular, f[0]) or vanishes(angular, f[1]) or vanishes(angular, f[2]):
                return k
        else:  # the factor stands where the inertia was: pivots against pivots
            a, b = pivots6(work, k)
            angular = 1.0 / a[0] + 1.0 / a[1] + 1.0 / a[2]
            linear = 1.0 / b[0] + 1.0 / b[1] + 1.0 / b[2]
            if vanishes(angular, a[0]) or vanishes(angular, a[1]) or vanishes(angular, a[2]):
                return k
            if vanishes(linear, b[0]) or vanishes(linear, b[1]) or vanishes(linear, b[2]):
                return k
    return 0
