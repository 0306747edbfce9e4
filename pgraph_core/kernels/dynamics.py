"""Inverse and forward dynamics, mass matrix, Jacobian: the O(n) sweeps of eqs. (17)-(26).

Articulated bodies follow [Featherstone 2008, ch. 7], here in world-aligned axes at the bodies'
origins, where the paper's φ is a pure shift and a and b are those of eqs. (9) and (12).
"""

from . import layout as at
from ._jit import kernel, part, sweep
from .kinematics import (
    accelerate,
    base_axes,
    joint_force,
    load_inertia,
    outboard,
    positions,
)
from .vec import (
    accumulate,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load9,
    mul,
    mul_t,
    scale,
    store,
    sub,
    sym_mul,
)

EPS16 = 16 * 2.220446049250313e-16


@sweep
def apply_external(bodies_i, bodies_f, external, work):
    """Take wrenches [torque, force] on the bodies, world axes at their origins, off P."""
    for b in range(external.shape[0]):
        k = bodies_i[b + 1, at.ROW]
        if k == 0:  # welded to the ground, which takes any force
            continue
        offset = mul(load9(work, k, at.R), load(bodies_f, b + 1, at.OFFSET))
        force = load(external, b, 3)
        moment = add_cross(load(external, b, 0), offset, force)
        accumulate(work, k, at.P, scale(-1.0, moment))
        accumulate(work, k, at.P + 3, scale(-1.0, force))


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
def factor3(j):
    """(1/d0, 1/d1, 1/d2, l10, l20, l21) of j = L diag(d) Lᵀ."""
    d0 = 1.0 / j[0]
    l10 = j[3] * d0
    l20 = j[4] * d0
    d1 = 1.0 / (j[1] - l10 * j[3])
    y = j[5] - l20 * j[3]
    l21 = y * d1
    d2 = 1.0 / (j[2] - l20 * j[4] - l21 * y)
    return (d0, d1, d2, l10, l20, l21)


@part
def forward3(f, x):
    """L⁻¹ x."""
    y1 = x[1] - f[3] * x[0]
    return (x[0], y1, x[2] - f[4] * x[0] - f[5] * y1)


@part
def backward3(f, x):
    """L⁻ᵀ x."""
    y1 = x[1] - f[5] * x[2]
    return (x[0] - f[3] * y1 - f[4] * x[2], y1, x[2])


@part
def solve3(f, x):
    """j⁻¹ x."""
    y = forward3(f, x)
    return backward3(f, (f[0] * y[0], f[1] * y[1], f[2] * y[2]))


@part
def load6(a, i, j):
    return (a[i, j], a[i, j + 1], a[i, j + 2], a[i, j + 3], a[i, j + 4], a[i, j + 5])


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


@part
def factor6(work, k):
    """L diag(d) Lᵀ of the 6x6 inertia in its own place; the diagonal holds 1/d."""
    for r in range(6):
        ir = at.IA + r * (r + 1) // 2
        for c in range(r):
            ic = at.IA + c * (c + 1) // 2
            for n in range(c):
                work[k, ir + c] -= work[k, ir + n] * work[k, ic + n]
        diagonal = work[k, ir + r]
        for c in range(r):
            scaled = work[k, ir + c] * work[k, at.IA + c * (c + 1) // 2 + c]
            diagonal -= scaled * work[k, ir + c]
            work[k, ir + c] = scaled
        work[k, ir + r] = 1.0 / diagonal


@part
def forward6(work, k, at_x):
    """L⁻¹ x in place, x the six numbers of row k from column `at_x`."""
    for r in range(1, 6):
        ir = at.IA + r * (r + 1) // 2
        for c in range(r):
            work[k, at_x + r] -= work[k, ir + c] * work[k, at_x + c]


@part
def backward6(work, k, at_x):
    """L⁻ᵀ x in place."""
    for r in range(4, -1, -1):
        for c in range(r + 1, 6):
            work[k, at_x + r] -= work[k, at.IA + c * (c + 1) // 2 + r] * work[k, at_x + c]


@part
def diagonal6(work, k, at_x):
    """diag(1/d) x in place."""
    for r in range(6):
        work[k, at_x + r] *= work[k, at.IA + r * (r + 1) // 2 + r]


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
def store3(x, i, value):
    x[i] = value[0]
    x[i + 1] = value[1]
    x[i + 2] = value[2]


@part
def articulated(rows, const, q, v, tau, work, vdot):
    """v' = M⁻¹ (τ - C), eq. (26), in three sweeps."""
    outboard(rows, const, work, q, v)
    inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)


@part
def finite(x):
    """Whether every number of a vector is finite."""
    n = x.shape[0]
    even = 0.0
    odd = 0.0
    for i in range(0, n - 1, 2):
        even += 0.0 * x[i]
        odd += 0.0 * x[i + 1]
    if n % 2 == 1:
        even += 0.0 * x[n - 1]
    return even + odd == 0.0


@part
def vanishes(size, inverse):
    """Whether a pivot, given by its inverse, is rounding of an inertia of this size."""
    return not (EPS16 * size * inverse < 1.0 and inverse > 0.0)


@sweep
def singular_row(rows, work):
    """First row whose motion sees no inertia, to rounding; 0 if there is none."""
    for k in range(1, rows.shape[0]):
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


@kernel("i8(i8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[::1])")
def forward_dynamics(rows, const, q, v, tau, work, vdot):
    """Tree dynamics into `vdot`; 0, or -1 where it is not finite, or the singular row."""
    articulated(rows, const, q, v, tau, work, vdot)
    singular = singular_row(rows, work)
    if singular > 0:
        return singular
    return 0 if finite(vdot) else -1


@kernel(
    "i8(i8[:,::1],f8[:,::1],i8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[:,::1],f8[::1])"
)
def forward_dynamics_external(rows, const, bodies_i, bodies_f, q, v, tau, external, work, vdot):
    """As `forward_dynamics` with wrenches on the bodies."""
    outboard(rows, const, work, q, v)
    apply_external(bodies_i, bodies_f, external, work)
    inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)
    singular = singular_row(rows, work)
    if singular > 0:
        return singular
    return 0 if finite(vdot) else -1


@sweep
def newton_euler(rows, const, v, vdot, work, tau):
    """τ = Hᵀ F with F = φᵀ F_child + M V' + b, eqs. (12), (23), after `outboard` left b in P."""
    n = rows.shape[0]
    for k in range(1, n):  # b out of the way: `accelerate` writes V' into P
        for i in range(6):
            work[k, at.U + i] = work[k, at.P + i]
    accelerate(rows, const, work, v, vdot)
    for k in range(1, n):
        j, b, m = load_inertia(work, k)
        alpha = load(work, k, at.P)
        linear = load(work, k, at.P + 3)
        moment = add(add(load(work, k, at.U), sym_mul(j, alpha)), mul(b, linear))
        force = add(add(load(work, k, at.U + 3), mul_t(b, alpha)), scale(m[0], linear))
        store(work, k, at.U, moment)
        store(work, k, at.U + 3, force)
    for k in range(n - 1, 0, -1):
        moment = load(work, k, at.U)
        force = load(work, k, at.U + 3)
        joint_force(rows, const, work, k, force, moment, tau)
        if rows[k, at.KIND] <= at.TRANSLATE:
            tau[rows[k, at.VI]] += const[k, at.ARMATURE] * vdot[rows[k, at.VI]]
        p = rows[k, at.PARENT]
        accumulate(work, p, at.U, add_cross(moment, load(work, k, at.L), force))
        accumulate(work, p, at.U + 3, force)


@kernel(
    "void(i8[:,::1],f8[:,::1],i8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[:,::1],f8[::1])"
)
def inverse_dynamics(rows, const, bodies_i, bodies_f, q, v, vdot, external, work, tau):
    """τ = M v' + C - Jᵀ f, eq. (24), by the recursive Newton-Euler sweeps."""
    outboard(rows, const, work, q, v)
    apply_external(bodies_i, bodies_f, external, work)
    newton_euler(rows, const, v, vdot, work, tau)


@kernel("void(i8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[:,::1],f8[:,::1])")
def mass_matrix(rows, const, q, v, work, m):
    """M of eq. (25) by composite bodies: F = I_c H carried down the path, F_p = φᵀ F, eq. (12).

    `v` must be zero: only frames matter. O(n depth).
    """
    outboard(rows, const, work, q, v)
    for k in range(rows.shape[0] - 1, 0, -1):
        p = rows[k, at.PARENT]
        if p > 0:
            j, b, mass = load_inertia(work, k)
            zero = (0.0, 0.0, 0.0)
            add_to_parent(work, p, load(work, k, at.L), j, b, mass, zero, zero)
    for k in range(1, rows.shape[0]):
        for column in range(size_of(rows[k, at.KIND])):
            h0, h1 = motion(rows, const, work, k, column)
            j, b, mass = load_inertia(work, k)
            moment = add(sym_mul(j, h0), mul(b, h1))
            force = add(mul_t(b, h0), sym_mul(mass, h1))
            i = rows[k, at.VI] + column
            p = k
            while p > 0:
                for c in range(size_of(rows[p, at.KIND])):
                    g0, g1 = motion(rows, const, work, p, c)
                    x = dot(g0, moment) + dot(g1, force)
                    m[i, rows[p, at.VI] + c] = x
                    m[rows[p, at.VI] + c, i] = x
                moment = add_cross(moment, load(work, p, at.L), force)
                p = rows[p, at.PARENT]
            if rows[k, at.KIND] <= at.TRANSLATE:
                m[i, i] += const[k, at.ARMATURE]


@part
def size_of(kind):
    """Degrees of freedom of a row."""
    return 1 if kind <= at.TRANSLATE else 3 if kind == at.BALL else 6


@part
def motion(rows, const, work, k, column):
    """Column of H_k, eqs. (6), (7): (angular, linear) in world axes."""
    zero = (0.0, 0.0, 0.0)
    kind = rows[k, at.KIND]
    if kind == at.ROTATE:
        return load(work, k, at.H), zero
    if kind == at.TRANSLATE:
        return zero, load(work, k, at.H)
    axes = base_axes(const, work, rows[k, at.PARENT], k)
    c = column % 3
    x = (axes[c], axes[c + 3], axes[c + 6])
    if column < 3:
        return x, zero
    return zero, x


@kernel("void(i8[:,::1],f8[:,::1],f8[::1],f8[::1],i8,f8[::1],f8[:,::1],f8[:,::1])")
def jacobian(rows, const, q, v, k, point, work, jac):
    """J of eq. (20) into (6, nv): V of the point fixed in row k at `point` (home axes) is J v.

    `v` must be zero: only frames matter.
    """
    outboard(rows, const, work, q, v)
    positions(rows, work)
    offset = mul(load9(work, k, at.R), (point[0], point[1], point[2]))
    place = add(load(work, k, at.X), offset)
    while k > 0:
        arm = sub(place, load(work, k, at.X))
        for c in range(size_of(rows[k, at.KIND])):
            h0, h1 = motion(rows, const, work, k, c)
            linear = add_cross(h1, h0, arm)
            i = rows[k, at.VI] + c
            for n in range(3):
                jac[n, i] = h0[n]
                jac[n + 3, i] = linear[n]
        k = rows[k, at.PARENT]


@kernel("void(i8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],i8,f8[::1],f8[:,::1],f8[::1])")
def jacobian_bias(rows, const, q, v, zero, k, point, work, bias):
    """J' v (6,): the acceleration of the point at v' = 0 (`zero`), without gravity (R6)."""
    outboard(rows, const, work, q, v)
    store(work, 0, at.P + 3, (0.0, 0.0, 0.0))
    accelerate(rows, const, work, v, zero)
    r = mul(load9(work, k, at.R), (point[0], point[1], point[2]))
    w = load(work, k, at.W)
    alpha = load(work, k, at.P)
    linear = add(add_cross(load(work, k, at.P + 3), alpha, r), cross(w, cross(w, r)))
    for n in range(3):
        bias[n] = alpha[n]
        bias[n + 3] = linear[n]
