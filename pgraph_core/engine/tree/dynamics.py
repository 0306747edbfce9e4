"""Inverse and forward dynamics, mass matrix, Jacobian: the O(n) sweeps of eqs. (17)-(26).

Articulated bodies follow [Featherstone 2008, ch. 7], here in world-aligned axes at the bodies'
origins, where the paper's φ is a pure shift and a and b are those of eqs. (9) and (12).
"""

from .. import layout as at
from ..compiler.jit import kernel, sweep
from ..vec import (
    accumulate,
    add,
    add_cross,
    cross,
    finite,
    load,
    load9,
    mul,
    mul_t,
    scale,
    store,
    sub,
    sym_mul,
)
from .articulated import articulated, inboard, joint_acceleration, singular_row
from .composite import (
    factor,
    joint_inertia,
    motion,
    outer_freedoms,
    singular_pivot,
    size_of,
    solve,
)
from .kinematics import accelerate, joint_force, load_inertia, outboard, positions


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
    """M of eq. (25); `v` must be zero: only frames matter. O(n depth)."""
    outboard(rows, const, work, q, v)
    joint_inertia(rows, const, work, m)


@kernel(None)  # few ask for it: compiled at the first call
def forward_dynamics_composite(
    rows, const, bodies_i, bodies_f, q, v, tau, external, zero, work, outer, m, vdot
):
    """As `forward_dynamics_external` by M v' = τ - C and the factor of M: O(n depth²).

    `zero` (nv,) is v' = 0; `outer` (nv,) and `m` (nv, nv) are workspace.
    """
    outboard(rows, const, work, q, v)
    apply_external(bodies_i, bodies_f, external, work)
    newton_euler(rows, const, v, zero, work, vdot)
    for i in range(vdot.shape[0]):
        vdot[i] = tau[i] - vdot[i]
    joint_inertia(rows, const, work, m)
    outer_freedoms(rows, outer)
    factor(outer, m)
    singular = singular_pivot(rows, work, m)
    if singular > 0:
        return singular
    solve(outer, m, vdot)
    return 0 if finite(vdot) else -1


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
