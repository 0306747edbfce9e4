"""Inverse and forward dynamics, mass matrix and Jacobian: the O(n) sweeps of eqs. (17)-(26).

Articulated bodies follow [Featherstone 2008, ch. 7], here in world-aligned axes at the bodies'
origins, where the paper's φ is a pure shift and a and b are those of eqs. (9) and (12).
"""

from ..compiler.jit import kernel, sweep
from ..compiler.kinds import F1, F2, I2, i8, void
from ..motions import column, nv_of, project
from ..motions.inertia import add_inertia_to
from ..rows import (
    acceleration_of,
    add_bias,
    add_force,
    armature_of,
    bias_of,
    carrier_of,
    force_of,
    inertia_of,
    kind_of,
    link_of,
    offset_of,
    origin_of,
    parent_of,
    rotation_of,
    set_acceleration,
    set_force,
    spin_of,
    v_of,
)
from ..vec import add, add_cross, cross, dot, finite, load, mul, mul_t, scale, sub, sym_mul
from .articulated import articulated, inboard, joint_acceleration, singular_row
from .kinematics import accelerate, outboard, positions


@sweep
def apply_external(bodies_i, bodies_f, external, work):
    """Subtract wrenches [torque, force] on the bodies, in world axes, from the bias."""
    for b in range(external.shape[0]):
        k = carrier_of(bodies_i, b + 1)
        if k == 0:  # welded to the ground, which takes any force
            continue
        offset = mul(rotation_of(work, k), offset_of(bodies_f, b + 1))
        force = load(external, b, 3)
        moment = add_cross(load(external, b, 0), offset, force)
        add_bias(work, k, scale(-1.0, moment), scale(-1.0, force))


@kernel(i8(I2, F2, F1, F1, F1, F2, F1))
def forward_dynamics(rows, const, q, v, tau, work, vdot):
    """Compute `vdot` of a tree. Returns 0, -1 if it is not finite, or the singular row."""
    articulated(rows, const, q, v, tau, work, vdot)
    singular = singular_row(rows, work)
    if singular > 0:
        return singular
    return 0 if finite(vdot) else -1


@kernel(i8(I2, F2, I2, F2, F1, F1, F1, F2, F2, F1))
def forward_dynamics_external(rows, const, bodies_i, bodies_f, q, v, tau, external, work, vdot):
    """Compute `forward_dynamics` with wrenches on the bodies."""
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
    """Compute τ = Hᵀ F with F = φᵀ F_child + M V' + b, eqs. (12), (23), given b from `outboard`."""
    n = rows.shape[0]
    for k in range(1, n):  # b out of the way: `accelerate` writes V' in its place
        moment, force = bias_of(work, k)
        set_force(work, k, moment, force)
    accelerate(rows, const, work, v, vdot)
    for k in range(1, n):
        j, b, m = inertia_of(work, k)
        alpha, linear = acceleration_of(work, k)
        moment, force = force_of(work, k)
        moment = add(add(moment, sym_mul(j, alpha)), mul(b, linear))
        force = add(add(force, mul_t(b, alpha)), scale(m[0], linear))
        set_force(work, k, moment, force)
    for k in range(n - 1, 0, -1):
        moment, force = force_of(work, k)
        project(rows, work, k, const, moment, force, tau)
        for j in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
            tau[j] += armature_of(const, k) * vdot[j]
        p = parent_of(rows, k)
        add_force(work, p, add_cross(moment, link_of(work, k), force), force)


@kernel(void(I2, F2, I2, F2, F1, F1, F1, F2, F2, F1))
def inverse_dynamics(rows, const, bodies_i, bodies_f, q, v, vdot, external, work, tau):
    """Compute τ = M v' + C - Jᵀ f, eq. (24), by the recursive Newton-Euler sweeps."""
    outboard(rows, const, work, q, v)
    apply_external(bodies_i, bodies_f, external, work)
    newton_euler(rows, const, v, vdot, work, tau)


# -- composite bodies: the mass matrix, O(n depth) [Featherstone 2008, sec. 6.2] ------------------


@sweep
def composite_inertia(rows, work):
    """Compute I_c of every row, the sum of its inertia and those of its descendants, shifted by
    φ."""
    for k in range(rows.shape[0] - 1, 0, -1):
        p = parent_of(rows, k)
        if p > 0:
            j, b, m = inertia_of(work, k)
            add_inertia_to(work, p, link_of(work, k), j, b, m)


@sweep
def joint_inertia(rows, const, work, m):
    """Compute M of eq. (25) after `outboard`, with F = I_c H and F_p = φᵀ F, eq. (12)."""
    composite_inertia(rows, work)
    for k in range(1, rows.shape[0]):
        for c in range(nv_of(kind_of(rows, k))):
            h0, h1 = column(rows, work, k, const, c)
            j, b, mass = inertia_of(work, k)
            moment = add(sym_mul(j, h0), mul(b, h1))
            force = add(mul_t(b, h0), sym_mul(mass, h1))
            i = v_of(rows, k) + c
            p = k
            while p > 0:
                for d in range(nv_of(kind_of(rows, p))):
                    g0, g1 = column(rows, work, p, const, d)
                    x = dot(g0, moment) + dot(g1, force)
                    m[i, v_of(rows, p) + d] = x
                    m[v_of(rows, p) + d, i] = x
                moment = add_cross(moment, link_of(work, p), force)
                p = parent_of(rows, p)
            m[i, i] += armature_of(const, k)


@sweep
def outer_freedoms(rows, outer):
    """Return the next degree of freedom towards the root for each one, or -1 for the ground."""
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        first = v_of(rows, k)
        outer[first] = v_of(rows, p) + nv_of(kind_of(rows, p)) - 1 if p > 0 else -1
        for i in range(first + 1, first + nv_of(kind_of(rows, k))):
            outer[i] = i - 1


# -- what asks for them ---------------------------------------------------------------------------


@kernel(void(I2, F2, F1, F1, F2, F2))
def mass_matrix(rows, const, q, v, work, m):
    """Compute M of eq. (25) for `v` = 0, since only frames matter. O(n depth)."""
    outboard(rows, const, work, q, v)
    joint_inertia(rows, const, work, m)


@kernel(void(I2, F2, F1, F1, i8, F1, F2, F2))
def jacobian(rows, const, q, v, k, point, work, jac):
    """Compute J of eq. (20), (6, nv), such that V of the point fixed in row k at `point` (home
    axes) is J v.

    `v` must be zero: only frames matter.
    """
    outboard(rows, const, work, q, v)
    positions(rows, work)
    offset = mul(rotation_of(work, k), (point[0], point[1], point[2]))
    place = add(origin_of(work, k), offset)
    while k > 0:
        arm = sub(place, origin_of(work, k))
        for c in range(nv_of(kind_of(rows, k))):
            h0, h1 = column(rows, work, k, const, c)
            linear = add_cross(h1, h0, arm)
            i = v_of(rows, k) + c
            for n in range(3):
                jac[n, i] = h0[n]
                jac[n + 3, i] = linear[n]
        k = parent_of(rows, k)


@kernel(void(I2, F2, F1, F1, F1, i8, F1, F2, F1))
def jacobian_bias(rows, const, q, v, zero, k, point, work, bias):
    """Compute J' v (6,), the acceleration of the point at v' = 0 (`zero`), without gravity (R6)."""
    outboard(rows, const, work, q, v)
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    accelerate(rows, const, work, v, zero)
    r = mul(rotation_of(work, k), (point[0], point[1], point[2]))
    w = spin_of(work, k)
    alpha, linear = acceleration_of(work, k)
    linear = add(add_cross(linear, alpha, r), cross(w, cross(w, r)))
    for n in range(3):
        bias[n] = alpha[n]
        bias[n + 3] = linear[n]
