"""Gauss collocation in positions and momenta: symplectic, for long runs, compiled on demand.

With p = ∂L/∂v the equations of a tree are q' = v, p' = ∂L/∂q + τ, and Gauss' methods of s stages,
order 2 s, keep the symplectic form of (q, p): the energy of conservative motion stays within a
bound for very long times ([Hairer, Lubich, Wanner 2006, VI.4, IX.3]). With (q, v), they would not
be conserved if the mass matrix varies. A step uses local coordinates ξ. For ball and free joints,
the rotation is the exponential of ξ, and the momentum is dexp(ξ)ᵀ p.

The unknowns are the velocities of the stages. Momenta that they miss change them by the inverse
mass matrix at the start of the step, until rounding is left.
"""

import math

from ...tolerances import EPS, ROUNDING
from .. import layout as at
from ..arrays import FACTORED, opened_run
from ..compiler.jit import kernel, part, sweep
from ..linear import factor, substitute
from ..motion import call_acceleration, opened
from ..rows import (
    SCREW,
    TRANSLATE,
    add_force,
    armature_of,
    axis_of,
    force_of,
    inertia_of,
    kind_of,
    link_of,
    origin_of,
    parent_of,
    pitch_of,
    set_acceleration,
    set_force,
    set_origin,
    spin_of,
    v_of,
)
from ..tree.dynamics import joint_inertia, newton_euler
from ..tree.kinematics import joint_force, linear_velocity, outboard
from ..tree.moving import advance, local_rate
from ..vec import add, add_cross, add_scaled, cross, dot, finite, mul, mul_t, scale, sym_mul
from .state import NOT_SOLVED, STEP, copied, size_of_state

# rows of the real matrix from nv on, before which it holds the mass matrix: 2 nv wide
Z, RATE, KEPT = 0, 3, 6  # (ξ, v), (ξ', p') and p of up to three stages
PIVOTS, START, SCRATCH, VDOT, WANTED = 9, 10, 11, 12, 13
STAGE_ROUNDS = 60
STILL = 64  # largest correction of a motionless position in units of rounding
TERMS = 12  # terms of the series of dexp, exact for rotations of up to 3 rad


# -- momenta --------------------------------------------------------------------------------------


@sweep
def momenta(rows, const, work, q, v, p, pdot):
    """Compute p = M v and the velocity-dependent part of p'.

    P of a row is the momentum of what it carries, [about its origin; linear]: p = Hᵀ P, and
    p' = H'ᵀ P + Hᵀ P', where P' is what Newton and Euler's sweeps add up (`momentum_rates`), less
    V × P of an origin that moves.
    """
    outboard(rows, const, work, q, v)
    n = rows.shape[0]
    for k in range(1, n):
        parent = parent_of(rows, k)
        velocity = linear_velocity(rows, const, work, v, k, origin_of(work, parent))
        set_origin(work, k, velocity)  # reuses the place of the unused origin
        j, b, m = inertia_of(work, k)
        spin = spin_of(work, k)
        moment = add(sym_mul(j, spin), mul(b, velocity))
        set_force(work, k, moment, add(mul_t(b, spin), scale(m[0], velocity)))
    for k in range(n - 1, 0, -1):
        moment, force = force_of(work, k)
        joint_force(rows, const, work, k, force, moment, p)
        lost = cross(origin_of(work, k), force)
        i = v_of(rows, k)
        parent = parent_of(rows, k)
        turning = spin_of(work, parent)
        if kind_of(rows, k) <= TRANSLATE:
            along, kind = axis_of(work, k), kind_of(rows, k)
            swung = cross(turning, along)
            pdot[i] = 0.0
            if kind < TRANSLATE:
                pdot[i] = dot(swung, moment) - dot(along, lost)
            if kind == SCREW:
                pdot[i] += pitch_of(work, k) * dot(swung, force)
            elif kind == TRANSLATE:
                pdot[i] = dot(swung, force)
            p[i] += armature_of(const, k) * v[i]
        else:
            rate = scale(-1.0, add(lost, cross(turning, moment)))
            joint_force(rows, const, work, k, scale(-1.0, cross(turning, force)), rate, pdot)
        add_force(work, parent, add_cross(moment, link_of(work, k), force), force)
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@sweep
def momentum_rates(rows, const, work, v, vdot, pdot, scratch):
    """Add the contribution of v' by Newton-Euler sweeps to `pdot`, after `momenta`."""
    newton_euler(rows, const, v, vdot, work, scratch)
    for j in range(v.shape[0]):
        pdot[j] += scratch[j]


# -- turns ----------------------------------------------------------------------------------------


@part
def series(s, first, slope):
    """Return Σ (-s)^k / (2 k + first)! for s = φ², or its derivative with respect to s."""
    term = 1.0 / (2.0 if first == 2 else 6.0)
    total = 0.0
    for k in range(TERMS):
        if slope:
            total += (k + 1) * term * -1.0 / ((2 * k + first + 1) * (2 * k + first + 2))
        else:
            total += term
        term *= -s / ((2 * k + first + 1) * (2 * k + first + 2))
    return total


@sweep
def into_chart(rows, xi, xi_rate, p, pdot):
    """Transform p and p' to the coordinates ξ, i.e. dexp(ξ)ᵀ p and its derivative along ξ'.

    dexpᵀ p = p - a ξ × p + b ξ × (ξ × p), a = (1 - cos φ) / φ², b = (φ - sin φ) / φ³, φ = |ξ|.
    """
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            continue
        i = v_of(rows, k)
        x = (xi[i], xi[i + 1], xi[i + 2])
        u = (xi_rate[i], xi_rate[i + 1], xi_rate[i + 2])
        y = (p[i], p[i + 1], p[i + 2])
        z = (pdot[i], pdot[i + 1], pdot[i + 2])
        s = dot(x, x)
        a, b = series(s, 2, False), series(s, 3, False)
        growing = 2.0 * dot(x, u)
        a_rate, b_rate = growing * series(s, 2, True), growing * series(s, 3, True)
        xy = cross(x, y)
        xxy = cross(x, xy)
        uy = cross(u, y)
        turned = add(cross(u, xy), cross(x, uy))
        xz = cross(x, z)
        for n in range(3):
            p[i + n] = y[n] - a * xy[n] + b * xxy[n]
        z = add_scaled(add_scaled(z, -a, xz), b, cross(x, xz))
        z = add_scaled(add_scaled(z, -a, uy), b, turned)
        z = add_scaled(add_scaled(z, -a_rate, xy), b_rate, xxy)
        for n in range(3):
            pdot[i + n] = z[n]


@sweep
def out_of_chart(rows, xi, p, negative, out):
    """Compute dexp(ξ)⁻ᵀ p = dexp(-ξ)⁻¹ p from the momentum of ξ, using `negative` as scratch."""
    for j in range(p.shape[0]):
        negative[j] = -xi[j]
    local_rate(rows, negative, p, out)


# -- steps ----------------------------------------------------------------------------------------


@sweep
def reach(rows, real, q):
    """Return qᵀ M q of the mass matrix in `real`, attitudes as 1 rad: the scale of rounding."""
    total = 0.0
    for k in range(1, rows.shape[0]):
        i = v_of(rows, k)
        first = rows[k, at.QI]
        if kind_of(rows, k) <= TRANSLATE:
            total += real[i, i] * q[first] * q[first]
            continue
        for n in range(3):
            total += real[i + n, i + n]
            if kind_of(rows, k) == at.FREE:
                total += real[i + 3 + n, i + 3 + n] * q[first + n] * q[first + n]
    return total


@sweep
def mass_matrix(run, q):
    """Compute the mass matrix at q in `real`.

    It takes the place of the articulated inertias, to which the factors of the constraints belong.
    """
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    scene = opened(data.scene)
    still = real[nv + SCRATCH, :nv]
    for i in range(nv):
        still[i] = 0.0
        for j in range(nv):
            real[i, j] = 0.0
    outboard(scene.rows, scene.const, scene.work, q, still)
    joint_inertia(scene.rows, scene.const, scene.work, real)
    scene.space.vectors[FACTORED, 2] = 0.0


@sweep
def factor_mass(run, q):
    """Factor the mass matrix at q in `real`. Returns (True on success, its reach)."""
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    mass_matrix(run, q)
    total = reach(opened(data.scene).rows, real, q)
    return factor(real, nv, real[nv + PIVOTS]), total


@sweep
def evaluate(run, t, i):
    """Compute rates and momentum of stage i from its ξ and v, and its power in `flow`."""
    data = opened_run(run)
    stages, real, flow, counters = data.stages, data.real, data.flow, data.counters[0]
    nq, nv = size_of_state(run)
    q = stages[at.TRIAL, :nq]
    z = real[nv + Z + i]
    for j in range(nq):
        q[j] = stages[at.Y, j]
    rows = opened(data.scene).rows
    advance(rows, q, z[:nv], 1.0)
    v = z[nv : 2 * nv]
    vdot = real[nv + VDOT, :nv]
    tau = stages[at.TORQUE, :nv]
    call_acceleration(data.links.accelerate, (data.scene, t, q, v, tau, vdot, flow))
    counters.evaluations += 1
    counters.solver_iterations += int(flow[2])
    scene = opened(data.scene)
    rate = real[nv + RATE + i]
    kept = real[nv + KEPT + i]
    p = kept[:nv]
    pdot = rate[nv : 2 * nv]
    momenta(scene.rows, scene.const, scene.work, q, v, p, pdot)
    momentum_rates(scene.rows, scene.const, scene.work, v, vdot, pdot, kept[nv : 2 * nv])
    local_rate(rows, z[:nv], v, rate[:nv])
    if nq > nv:
        charted = kept[nv : 2 * nv]
        for j in range(nv):
            charted[j] = p[j]
        into_chart(rows, z[:nv], rate[:nv], charted, pdot)


@sweep
def collocated(run, weights, h, out):
    """Compute (ξ, p) in the chart: (0, p₀) + h Σ weights (ξ', p')."""
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    for j in range(nv):
        out[j] = 0.0
        out[nv + j] = real[nv + START, j]
    for i in range(weights.shape[0]):
        for j in range(2 * nv):
            out[j] += h * weights[i] * real[nv + RATE + i, j]


@sweep
def corrected(run, h):
    """Correct all stages. Returns the squared norms of the correction and of the motion.

    Sizes are momentum times velocity, which have the same unit for all joints.
    """
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    rows = opened(data.scene).rows
    wanted, scratch = real[nv + WANTED], real[nv + SCRATCH]
    change = 0.0
    size = 0.0
    for i in range(data.tableau.b.shape[0]):
        z = real[nv + Z + i]
        p = real[nv + KEPT + i]
        collocated(run, data.tableau.a[i], h, wanted)
        out_of_chart(rows, z[:nv], wanted[nv : 2 * nv], scratch[nv : 2 * nv], scratch[:nv])
        for j in range(nv):
            size += p[j] * z[nv + j]
            scratch[j] -= p[j]
            scratch[nv + j] = scratch[j]
        substitute(real, nv, real[nv + PIVOTS], scratch)
        for j in range(nv):
            change += scratch[j] * scratch[nv + j]
            z[nv + j] += scratch[j]
        local_rate(rows, z[:nv], z[nv : 2 * nv], real[nv + RATE + i, :nv])
    for i in range(data.tableau.b.shape[0]):  # with the new velocities
        collocated(run, data.tableau.a[i], h, wanted)
        for j in range(nv):
            real[nv + Z + i, j] = wanted[j]
    return change, size


@sweep
def begin_stages(run, h):
    """Write p₀ to START, and the stages that the slope at Y predicts."""
    data = opened_run(run)
    stages, real, scene, tableau = data.stages, data.real, opened(data.scene), data.tableau
    nq, nv = size_of_state(run)
    q, v = stages[at.Y, :nq], stages[at.Y, nq : nq + nv]
    start, unused = real[nv + START, :nv], real[nv + SCRATCH, :nv]
    momenta(scene.rows, scene.const, scene.work, q, v, start, unused)
    for i in range(tableau.b.shape[0]):
        late = tableau.c[i] * h
        for j in range(nv):
            slope = stages[at.SLOPE, nq + j]
            real[nv + Z + i, j] = late * (v[j] + 0.5 * late * slope)
            real[nv + Z + i, nv + j] = v[j] + late * slope


@sweep
def end_stages(run, h):
    """Compute q and v of CANDIDATE from the rates of the stages. Returns False if M is singular."""
    data = opened_run(run)
    stages, real, rows = data.stages, data.real, opened(data.scene).rows
    nq, nv = size_of_state(run)
    wanted, scratch = real[nv + WANTED], real[nv + SCRATCH]
    collocated(run, data.tableau.b, h, wanted)
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    q = stages[at.CANDIDATE, :nq]
    advance(rows, q, wanted[:nv], 1.0)
    regular, _ = factor_mass(run, q)
    out_of_chart(rows, wanted[:nv], wanted[nv : 2 * nv], scratch[nv : 2 * nv], scratch[:nv])
    substitute(real, nv, real[nv + PIVOTS], scratch)
    for j in range(nv):
        stages[at.CANDIDATE, nq + j] = scratch[j]
    return regular


@kernel(STEP, nogil=True, later=True)
def gauss(run, h):
    """Take one step of Gauss collocation in (q, p)."""
    data = opened_run(run)
    control, counters, stages = data.control[0], data.counters[0], data.stages
    flow, tableau = data.flow, data.tableau
    nq, nv = size_of_state(run)
    count = tableau.b.shape[0]
    regular, total = factor_mass(run, stages[at.Y, :nq])
    if not regular:
        return NOT_SOLVED
    still = (STILL * EPS / h) ** 2 * total
    begin_stages(run, h)
    last = math.inf
    solved = False
    power = 0.0
    loss = 0.0
    for _ in range(STAGE_ROUNDS):
        power = 0.0
        loss = 0.0
        for i in range(count):
            evaluate(run, min(control.time + tableau.c[i] * h, control.clip), i)
            power += h * tableau.b[i] * flow[0]
            loss += h * tableau.b[i] * flow[1]
        change, size = corrected(run, h)
        counters.newton_iterations += 1
        if not (abs(change) < math.inf and size < math.inf):
            return NOT_SOLVED
        missed = math.sqrt(abs(change) / size) if size > 0.0 else 0.0
        rounded = missed < ROUNDING or abs(change) < still
        solved = missed < 2.0 * EPS or (missed >= last and rounded)
        if solved:
            break
        last = missed
    if not solved:
        return NOT_SOLVED
    if not end_stages(run, h):
        return NOT_SOLVED
    stages[at.CANDIDATE, nq + nv] += power
    stages[at.CANDIDATE, nq + nv + 1] += loss
    return 0.0 if finite(stages[at.CANDIDATE]) else math.inf
