"""Bilateral constraints by the articulated factors: Delassus matrix, rank-safe solve, projection.

Unit forces at the constraint points are carried down their paths by the articulated factors,
which gives Ω = J M⁻¹ Jᵀ = Y diag(1/d) Yᵀ without a mass matrix ([Featherstone 2008, ch. 8],
[Wensing et al. 2012]). Ω may be rank deficient (R12): (Ω + μI) is factored once and refined,
which tends to the multipliers of least norm ([Carpentier et al. 2021]).

A point constraint has three rows, in world axes; λ is the force on `body` at its point (R10).
`space` is (Yᵀ, Ω, factor, vectors): (nv, m), (m, m), (m, m), (6, max(m, nv)).
"""

from . import layout as at
from ._jit import part, sweep
from .articulated import inboard
from .factors import backward3, backward6, forward3, solve3
from .kinematics import base_axes, load_inertia, outboard, positions
from .moving import advance
from .proximal import CHANGE, DINV, LAMBDA, RHS, STEP, ZERO, factor_proximal, solve_proximal
from .vec import (
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    largest,
    load,
    load6,
    load9,
    mul,
    mul_t,
    store,
    store3,
    sub,
)

NO_GAP = 1e-14  # relative to the mechanism's size: rounding
CLOSED = 1e-7  # relative to it: a loop with a larger gap after all rounds is open
SMALL_MOVE = 1e-10  # rad, m: below it one factorisation serves position and velocity


@part
def offset_of(cons_f, work, i, side, k):
    """From row k's origin to the constraint's point, world axes; the ground's origin is fixed."""
    return mul(load9(work, k, at.R), load(cons_f, i, 3 * side))


@sweep
def residual(cons_i, cons_f, active, work, out):
    """Position of `body`'s point from `other`'s, world axes [m], after `positions`."""
    for n in range(active.shape[0]):
        i = active[n]
        a = cons_i[i, at.CON_A]
        b = cons_i[i, at.CON_B]
        at_a = add(load(work, a, at.X), offset_of(cons_f, work, i, 0, a))
        at_b = add(load(work, b, at.X), offset_of(cons_f, work, i, 1, b))
        store3(out, 3 * n, sub(at_a, at_b))


@part
def point_velocity(rows, const, work, v, k, offset):
    """Velocity of a point of row k, summed along its path; eq. (5)."""
    velocity = cross(load(work, k, at.W), offset)
    while k > 0:
        p = rows[k, at.PARENT]
        velocity = add_cross(velocity, load(work, p, at.W), load(work, k, at.L))
        if rows[k, at.KIND] == at.TRANSLATE:
            velocity = add_scaled(velocity, v[rows[k, at.VI]], load(work, k, at.H))
        elif rows[k, at.KIND] == at.FREE:
            j = rows[k, at.VI] + 3
            slide = mul(base_axes(const, work, p, k), (v[j], v[j + 1], v[j + 2]))
            velocity = add(velocity, slide)
        k = p
    return velocity


@sweep
def residual_velocity(rows, const, cons_i, cons_f, active, work, v, out):
    """J v of the active constraints."""
    for n in range(active.shape[0]):
        i = active[n]
        a = cons_i[i, at.CON_A]
        b = cons_i[i, at.CON_B]
        at_a = point_velocity(rows, const, work, v, a, offset_of(cons_f, work, i, 0, a))
        at_b = point_velocity(rows, const, work, v, b, offset_of(cons_f, work, i, 1, b))
        store3(out, 3 * n, sub(at_a, at_b))


@part
def point_acceleration(work, k, r):
    """V' of row k, left in P by the sweeps, taken to a point of it (R6)."""
    w = load(work, k, at.W)
    linear = add_cross(load(work, k, at.P + 3), load(work, k, at.P), r)
    return add(linear, cross(w, cross(w, r)))


@sweep
def residual_acceleration(cons_i, cons_f, active, work, out):
    """J v' + J' v of the active constraints; gravity's offset cancels between the two points."""
    for n in range(active.shape[0]):
        i = active[n]
        a = cons_i[i, at.CON_A]
        b = cons_i[i, at.CON_B]
        at_a = point_acceleration(work, a, offset_of(cons_f, work, i, 0, a))
        at_b = point_acceleration(work, b, offset_of(cons_f, work, i, 1, b))
        store3(out, 3 * n, sub(at_a, at_b))


@part
def unit_response(rows, work, k, offset, sign, y, row):
    """Add to three columns of Yᵀ what unit forces x, y, z at a point of row k do along its path."""
    for c in range(3):
        force = (sign if c == 0 else 0.0, sign if c == 1 else 0.0, sign if c == 2 else 0.0)
        carry(rows, work, k, cross(offset, force), force, y, row + c)


@sweep
def carry(rows, work, k, moment, force, y, row):
    """Take a wrench at row k's origin to the ground, leaving its share in each joint in Yᵀ."""
    while k > 0:
        i = rows[k, at.VI]
        kind = rows[k, at.KIND]
        if kind <= at.TRANSLATE:
            h = load(work, k, at.H)
            share = dot(h, moment) if kind == at.ROTATE else dot(h, force)
            y[i, row] += share
            x = -share * work[k, at.D]
            moment = add_scaled(moment, x, load(work, k, at.U))
            force = add_scaled(force, x, load(work, k, at.U + 3))
        elif kind == at.BALL:
            j, b, m = load_inertia(work, k)
            f = load6(work, k, at.U)
            share3 = forward3(f, moment)
            for n in range(3):
                y[i + n, row] += share3[n]
            force = sub(force, mul_t(b, solve3(f, moment)))
            moment = (0.0, 0.0, 0.0)
        else:
            carry_free(work, k, moment, force, y, row, i)
            return
        moment = add_cross(moment, load(work, k, at.L), force)
        k = rows[k, at.PARENT]


@part
def carry_free(work, k, moment, force, y, row, i):
    """The last joint that feels a wrench: a free one transmits nothing."""
    x = (moment[0], moment[1], moment[2], force[0], force[1], force[2])
    y0 = x[0]
    y1 = x[1] - work[k, at.IA + 1] * y0
    y2 = x[2] - work[k, at.IA + 3] * y0 - work[k, at.IA + 4] * y1
    y3 = x[3] - work[k, at.IA + 6] * y0 - work[k, at.IA + 7] * y1 - work[k, at.IA + 8] * y2
    y4 = x[4] - work[k, at.IA + 10] * y0 - work[k, at.IA + 11] * y1
    y4 += -work[k, at.IA + 12] * y2 - work[k, at.IA + 13] * y3
    y5 = x[5] - work[k, at.IA + 15] * y0 - work[k, at.IA + 16] * y1
    y5 += -work[k, at.IA + 17] * y2 - work[k, at.IA + 18] * y3 - work[k, at.IA + 19] * y4
    y[i, row] += y0
    y[i + 1, row] += y1
    y[i + 2, row] += y2
    y[i + 3, row] += y3
    y[i + 4, row] += y4
    y[i + 5, row] += y5


@sweep
def pivots(rows, work, dinv):
    """1/d of every degree of freedom: the diagonal between Y and Yᵀ."""
    for k in range(1, rows.shape[0]):
        i = rows[k, at.VI]
        kind = rows[k, at.KIND]
        if kind <= at.TRANSLATE:
            dinv[i] = work[k, at.D]
        elif kind == at.BALL:
            for n in range(3):
                dinv[i + n] = work[k, at.U + n]
        else:
            for n in range(6):
                dinv[i + n] = work[k, at.IA + n * (n + 1) // 2 + n]


@sweep
def delassus(rows, cons_i, cons_f, active, work, space):
    """Y and Ω of the active constraints from the articulated factors, Ω's proximal factor; μ."""
    y, omega, factor, vectors = space
    nv = y.shape[0]
    m = 3 * active.shape[0]
    dinv = vectors[DINV]
    pivots(rows, work, dinv)
    y[:, :] = 0.0
    for n in range(active.shape[0]):
        i = active[n]
        a = cons_i[i, at.CON_A]
        b = cons_i[i, at.CON_B]
        unit_response(rows, work, a, offset_of(cons_f, work, i, 0, a), 1.0, y, 3 * n)
        unit_response(rows, work, b, offset_of(cons_f, work, i, 1, b), -1.0, y, 3 * n)
    omega[:, :] = 0.0
    for j in range(nv):
        for r in range(m):
            x = dinv[j] * y[j, r]
            if x != 0.0:  # most joints lie on the paths of few constraints
                for c in range(m):
                    omega[r, c] += x * y[j, c]
    return factor_proximal(omega, factor, m)


@sweep
def spread(rows, const, work, space, m, step):
    """M⁻¹ Jᵀ λ into `step`: the response of all joints to the multipliers. Overwrites P."""
    y, omega, factor, vectors = space
    lam = vectors[LAMBDA]
    dinv = vectors[DINV]
    for j in range(y.shape[0]):
        total = 0.0
        for r in range(m):
            total += y[j, r] * lam[r]
        step[j] = total * dinv[j]
    store(work, 0, at.P, (0.0, 0.0, 0.0))
    store(work, 0, at.P + 3, (0.0, 0.0, 0.0))
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        i = rows[k, at.VI]
        kind = rows[k, at.KIND]
        alpha = load(work, p, at.P)
        linear = add_cross(load(work, p, at.P + 3), alpha, load(work, k, at.L))
        if kind <= at.TRANSLATE:
            u = dot(load(work, k, at.U), alpha) + dot(load(work, k, at.U + 3), linear)
            x = step[i] - work[k, at.D] * u
            step[i] = x
            if kind == at.ROTATE:
                alpha = add_scaled(alpha, x, load(work, k, at.H))
            else:
                linear = add_scaled(linear, x, load(work, k, at.H))
        elif kind == at.BALL:
            j, b, mass = load_inertia(work, k)
            f = load6(work, k, at.U)
            total3 = backward3(f, (step[i], step[i + 1], step[i + 2]))
            total3 = sub(total3, solve3(f, mul(b, linear)))
            axes = base_axes(const, work, p, k)
            store3(step, i, mul_t(axes, sub(total3, alpha)))
            alpha = total3
        else:
            for n in range(6):
                work[k, at.U + n] = step[i + n]
            backward6(work, k, at.U)
            axes = base_axes(const, work, p, k)
            store3(step, i, mul_t(axes, sub(load(work, k, at.U), alpha)))
            store3(step, i + 3, mul_t(axes, sub(load(work, k, at.U + 3), linear)))
            alpha = load(work, k, at.U)
            linear = load(work, k, at.U + 3)
        store(work, k, at.P, alpha)
        store(work, k, at.P + 3, linear)


@sweep
def impose(rows, const, tables, work, space, gains, v, vdot):
    """Add M⁻¹ Jᵀ λ to v' so that J v' + J' v = 0, eqs. (27)-(29); λ is left in `vectors`.

    `gains` (2,) are Baumgarte's 2α and α², zero without it.
    """
    cons_i, cons_f, active = tables
    y, omega, factor, vectors = space
    m = 3 * active.shape[0]
    rhs = vectors[RHS]
    residual_acceleration(cons_i, cons_f, active, work, rhs)
    if gains[0] > 0.0:
        stabilise(rows, const, tables, work, space, gains, v)
    for r in range(m):
        rhs[r] = -rhs[r]
    mu = delassus(rows, cons_i, cons_f, active, work, space)
    iterations = solve_proximal(space, mu, m)
    spread(rows, const, work, space, m, vectors[STEP])
    for j in range(vdot.shape[0]):
        vdot[j] += vectors[STEP, j]
    return iterations


@sweep
def stabilise(rows, const, tables, work, space, gains, v):
    """Baumgarte's 2α J v + α² g on top of J v' + J' v."""
    cons_i, cons_f, active = tables
    vectors = space[3]
    other = vectors[CHANGE]
    residual_velocity(rows, const, cons_i, cons_f, active, work, v, other)
    for r in range(3 * active.shape[0]):
        vectors[RHS, r] += gains[0] * other[r]
    positions(rows, work)
    residual(cons_i, cons_f, active, work, other)
    for r in range(3 * active.shape[0]):
        vectors[RHS, r] += gains[1] * other[r]


@sweep
def extent(rows, cons_f, work):
    """Size of the mechanism's coordinates [m]: what rounding of positions is relative to."""
    size = 0.0
    for k in range(1, rows.shape[0]):
        for n in range(3):
            size = max(size, abs(work[k, at.X + n]))
    for i in range(cons_f.shape[0]):
        for n in range(6):
            size = max(size, abs(cons_f[i, n]))
    return size


@sweep
def project(rows, const, tables, work, space, q, v, rounds):
    """Move q and v onto the constraints in the mass metric; rounds taken, -1 where it fails.

    Both corrections use one factorisation; it is made anew while positions move notably. Next to
    a singular position rounding alone moves them: a gap that is rounding is none.
    """
    cons_i, cons_f, active = tables
    vectors = space[3]
    m = 3 * active.shape[0]
    zero = vectors[ZERO]
    for j in range(v.shape[0]):
        zero[j] = 0.0
    gap = 0.0
    size = 1.0
    round_taken = 0
    for round_taken in range(1, rounds + 1):
        outboard(rows, const, work, q, v)
        inboard(rows, const, work, zero)
        positions(rows, work)
        mu = delassus(rows, cons_i, cons_f, active, work, space)
        residual_velocity(rows, const, cons_i, cons_f, active, work, v, vectors[RHS])
        correct(rows, const, work, space, mu, m)
        for j in range(v.shape[0]):
            v[j] += vectors[STEP, j]
        residual(cons_i, cons_f, active, work, vectors[RHS])
        gap = largest(vectors[RHS], m)
        size = extent(rows, cons_f, work)
        if gap <= NO_GAP * size:
            return round_taken
        correct(rows, const, work, space, mu, m)
        advance(rows, q, vectors[STEP], 1.0)
        if largest(vectors[STEP], v.shape[0]) < SMALL_MOVE:
            break
    return round_taken if gap <= CLOSED * size else -1


@part
def correct(rows, const, work, space, mu, m):
    """-M⁻¹ Jᵀ Ω⁺ RHS into STEP."""
    vectors = space[3]
    for r in range(m):
        vectors[RHS, r] = -vectors[RHS, r]
    solve_proximal(space, mu, m)
    spread(rows, const, work, space, m, vectors[STEP])
