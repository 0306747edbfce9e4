"""Gauss collocation in positions and momenta: symplectic, for long runs, compiled on demand.

With p = ∂L/∂v the equations of a tree are q' = v, p' = ∂L/∂q + τ, and Gauss' methods of s stages,
order 2 s, keep the symplectic form of (q, p): the energy of conservative motion stays within a
bound for very long times ([Hairer, Lubich, Wanner 2006, VI.4, IX.3]). With (q, v), they would not
be conserved if the mass matrix varies. A step uses local coordinates ξ. For ball and free joints,
the rotation is the exponential of ξ, and the momentum is dexp(ξ)ᵀ p.

The unknowns are the velocities of the stages. Momenta that they miss change them by the inverse
mass matrix at the start of the step, until rounding is left. If this converges too slowly, because
forces change much within a step, it becomes the simplified Newton's method. With the slopes C of p
with respect to ξ, and A and B of p' with respect to ξ and v, all times M⁻¹ and at the start of the
step, and with W as in `implicit`, corrections solve

    δv + C δξ - h a (A δξ + B δv) = M⁻¹ δp,    (λ² - λ (B + W - C) - (A - B W)) δξ = λ M⁻¹ δp

for every eigenvalue λ of a⁻¹ / h, and δv = (λ - W) δξ.
"""

import math

from ...tolerances import EPS, ROUNDING
from .. import layout as at
from ..arrays import FACTORED, FACTORS, opened_run
from ..compiler.elementary import power
from ..compiler.jit import kernel, part, sweep
from ..linear import factor, row_times, substitute
from ..motion import call_acceleration, opened
from ..motions import bends, has_attitude, numbers_of, nv_of, project
from ..records import columns
from ..rows import (
    add_force,
    armature_of,
    bend_of,
    force_of,
    inertia_of,
    kind_of,
    link_of,
    origin_of,
    parent_of,
    q_of,
    set_acceleration,
    set_force,
    set_origin,
    spin_of,
    v_of,
)
from ..tree.dynamics import joint_inertia, newton_euler
from ..tree.kinematics import linear_velocity, outboard
from ..tree.moving import advance, local_rate
from ..vec import add, add_cross, add_scaled, cross, dot, finite, mul, mul_t, scale, sym_mul
from . import implicit
from .control.newton import keep_jacobian, keep_rate, want_jacobian
from .implicit import COUPLING, KEEP, MOVE, add_half_turn, factor_pair, prepare, solve
from .state import STEP, UNSOLVED, copied, size_of_state

# rows of the real matrix from `own` on, before which it holds what `implicit` needs, the factors of
# the mass matrix and the mass matrix: 2 nv wide
GAUSS = columns(
    z=3,  # (ξ, v) of up to three stages
    rate=3,  # (ξ', p')
    kept=3,  # p
    pivots=1,
    start=1,
    scratch=1,
    vdot=1,
    wanted=1,
    missed=3,  # momenta and velocities
    report=1,  # report of derivatives
)
STAGE_ROUNDS = 60
NEWTON_ROUNDS = 4  # usual ones of Newton's method, in addition to the cost of the Jacobian
BY_COST, PATIENT, TO_THE_END = (
    0.0,
    0.5,
    1.0,
)  # convergence rates at which Newton's method replaces M⁻¹
PASSES = 8  # rounds for kinematics of turning bodies, which cost less than an evaluation
SERVES = 1  # largest convergence rate of a Jacobian that is used
USELESS = 3  # instead of a rate: Newton's method took more evaluations than it saved
MOTIONLESS = 64  # largest correction of a motionless position in units of rounding
TERMS = 12  # terms of the series of dexp, exact for rotations of up to 3 rad


@part
def mass(nv):
    """Return the first row of the factors of the mass matrix, before the mass matrix."""
    return 3 * nv + implicit.RADAU.total


@part
def own(nv):
    """Return the first row of the vectors."""
    return mass(nv) + 2 * nv


def matrix_rows(nv):
    """Return the number of rows of the real matrix."""
    return 5 * nv + implicit.RADAU.total + GAUSS.total


# -- momenta --------------------------------------------------------------------------------------


@sweep
def momenta(rows, const, work, q, v, p, pdot):
    """Compute p = M v and the velocity-dependent part of p'.

    P of a row is the momentum of what it carries, [about its origin; linear]: p = Hᵀ P, and
    p' = H'ᵀ P + Hᵀ P', where P' is what Newton and Euler's sweeps add up (`momentum_rates`), less
    V × P of an origin that moves. H' is that of an axis fixed in the parent and, for a curve, the
    slope of the axis times the speed.
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
        project(rows, work, k, const, moment, force, p)
        lost = cross(origin_of(work, k), force)
        parent = parent_of(rows, k)
        turning = spin_of(work, parent)
        rate = scale(-1.0, add(lost, cross(turning, moment)))
        project(rows, work, k, const, rate, cross(force, turning), pdot)
        if bends(kind_of(rows, k)):
            turn, bend = bend_of(work, k)
            pdot[v_of(rows, k)] += v[v_of(rows, k)] * (dot(turn, moment) + dot(bend, force))
        for i in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
            p[i] += armature_of(const, k) * v[i]
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
        if not has_attitude(kind_of(rows, k)):
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
def reach(rows, inertia, q):
    """Return qᵀ M q of the mass matrix, attitudes as 1 rad: the scale of rounding."""
    total = 0.0
    for k in range(1, rows.shape[0]):
        i, j = q_of(rows, k), v_of(rows, k)
        first, count = numbers_of(kind_of(rows, k))
        for n in range(first):
            total += inertia[j + n, j + n]
        for n in range(count):
            total += inertia[j + first + n, j + first + n] * q[i + n] * q[i + n]
    return total


@sweep
def mass_matrix(run, q):
    """Compute the mass matrix at q.

    It takes the place of the articulated inertias, to which the factors of the constraints belong.
    """
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    scene = opened(data.scene)
    inertia, still = real[mass(nv) : mass(nv) + nv], real[own(nv) + GAUSS.scratch, :nv]
    for i in range(nv):
        still[i] = 0.0
        for j in range(nv):
            inertia[i, j] = 0.0
    outboard(scene.rows, scene.const, scene.work, q, still)
    joint_inertia(scene.rows, scene.const, scene.work, inertia)
    scene.space.vectors[FACTORED, FACTORS.known] = 0.0


@sweep
def factor_mass(run, q):
    """Factor the mass matrix at q, and keep it. Returns (True on success, its reach)."""
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    first = mass(nv)
    mass_matrix(run, q)
    inertia = real[first : first + nv]
    total = reach(opened(data.scene).rows, inertia, q)
    for i in range(nv):
        for j in range(nv):
            real[first + nv + i, j] = inertia[i, j]
    return factor(inertia, nv, real[own(nv) + GAUSS.pivots]), total


@sweep
def evaluate(run, t, i):
    """Compute rates and momentum of stage i from its ξ and v, and its power in `flow`."""
    data = opened_run(run)
    stages, real, flow, counters = data.stages, data.real, data.flow, data.counters[0]
    nq, nv = size_of_state(run)
    q = stages[at.TRIAL, :nq]
    first = own(nv)
    z = real[first + GAUSS.z + i]
    for j in range(nq):
        q[j] = stages[at.Y, j]
    rows = opened(data.scene).rows
    advance(rows, q, z[:nv], 1.0)
    v = z[nv : 2 * nv]
    vdot = real[first + GAUSS.vdot, :nv]
    tau = stages[at.TORQUE, :nv]
    call_acceleration(data.links.accelerate, (data.scene, t, q, v, tau, vdot, flow))
    counters.evaluations += 1
    counters.solver_iterations += int(flow[2])
    scene = opened(data.scene)
    rate = real[first + GAUSS.rate + i]
    kept = real[first + GAUSS.kept + i]
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
        out[nv + j] = real[own(nv) + GAUSS.start, j]
    for i in range(weights.shape[0]):
        for j in range(2 * nv):
            out[j] += h * weights[i] * real[own(nv) + GAUSS.rate + i, j]


@sweep
def use_misses(run, h, newton):
    """Replace missed momenta by the changes of momentum and velocity that remove them.

    The velocities follow missed momenta, at first by the inverse mass matrix. Newton's method also
    considers the change of forces.
    """
    data = opened_run(run)
    real, pair, rows = data.real, data.pair, opened(data.scene).rows
    nv, count = data.control[0].nv, data.tableau.b.shape[0]
    missed, factors = real[own(nv) + GAUSS.missed :], real[mass(nv) : mass(nv) + nv]
    for i in range(count):
        for j in range(nv):
            missed[i, nv + j] = missed[i, j]
        substitute(factors, nv, real[own(nv) + GAUSS.pivots], missed[i, nv:])
    if not newton:
        return
    base, a = 3 * nv, data.tableau.a
    t, inverse, mu = a[3:6], a[6:9], a[9]
    shift, shift_c = mu[0] / h, complex(mu[1], mu[2]) / h
    right, right_c, scratch = (
        real[base + implicit.RADAU.right],
        pair[nv],
        real[base + implicit.RADAU.scratch],
    )
    for j in range(nv):
        x = y = z = 0.0
        for i in range(count):
            x += inverse[0, i] * missed[i, nv + j]
            y += inverse[1, i] * missed[i, nv + j]
            z += inverse[2, i] * missed[i, nv + j]
        right[j], right[nv + j] = 0.0, shift * x
        right_c[j], right_c[nv + j] = 0.0j, shift_c * complex(y, z)
    pivots, pivots_c = real[base + implicit.RADAU.pivots], real[base + implicit.RADAU.pivots_c]
    solve(rows, shift, real, nv, real[2 * nv : base], pivots, right, scratch)
    solve(rows, shift_c, real, nv, pair[:nv], pivots_c, right_c, pair[nv + 1])
    for i in range(count):
        for j in range(nv):
            x, y = right[nv + j], right_c[nv + j]
            missed[i, nv + j] = t[i, 0] * x + t[i, 1] * y.real + t[i, 2] * y.imag
        for j in range(nv):
            missed[i, j] = row_times(real, mass(nv) + nv + j, 0, nv, missed[i, nv:])


@sweep
def corrected(run, h, newton):
    """Correct all stages. Returns the squared norms of the correction and of the motion.

    Sizes are momentum times velocity, which have the same unit for all joints.
    """
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    rows, first = opened(data.scene).rows, own(nv)
    wanted, scratch = real[first + GAUSS.wanted], real[first + GAUSS.scratch]
    change = 0.0
    size = 0.0
    for i in range(data.tableau.b.shape[0]):
        z = real[first + GAUSS.z + i]
        p = real[first + GAUSS.kept + i]
        missed = real[first + GAUSS.missed + i]
        collocated(run, data.tableau.a[i], h, wanted)
        out_of_chart(rows, z[:nv], wanted[nv : 2 * nv], scratch[:nv], missed[:nv])
        for j in range(nv):
            size += p[j] * z[nv + j]
            missed[j] -= p[j]
    use_misses(run, h, newton)
    for i in range(data.tableau.b.shape[0]):
        z = real[first + GAUSS.z + i]
        missed = real[first + GAUSS.missed + i]
        for j in range(nv):
            change += missed[j] * missed[nv + j]
            z[nv + j] += missed[nv + j]
    place(run, h, newton)
    return change, size


@sweep
def place(run, h, newton):
    """Compute ξ of all stages from their velocities.

    Where ξ' depends on ξ, Newton's method makes several passes.
    """
    data = opened_run(run)
    real, rows = data.real, opened(data.scene).rows
    nq, nv = size_of_state(run)
    first, count = own(nv), data.tableau.b.shape[0]
    wanted = real[first + GAUSS.wanted]
    for _ in range(PASSES if newton and nq > nv else 1):
        for i in range(count):
            z = real[first + GAUSS.z + i]
            local_rate(rows, z[:nv], z[nv : 2 * nv], real[first + GAUSS.rate + i, :nv])
        for i in range(count):
            collocated(run, data.tableau.a[i], h, wanted)
            for j in range(nv):
                real[first + GAUSS.z + i, j] = wanted[j]


@sweep
def begin_stages(run, h):
    """Write p₀ to GAUSS.start, and the stages that the slope at Y predicts."""
    data = opened_run(run)
    stages, real, scene, tableau = data.stages, data.real, opened(data.scene), data.tableau
    nq, nv = size_of_state(run)
    q, v = stages[at.Y, :nq], stages[at.Y, nq : nq + nv]
    start, unused = real[own(nv) + GAUSS.start, :nv], real[own(nv) + GAUSS.scratch, :nv]
    momenta(scene.rows, scene.const, scene.work, q, v, start, unused)
    for i in range(tableau.b.shape[0]):
        late = tableau.c[i] * h
        for j in range(nv):
            slope = stages[at.SLOPE, nq + j]
            real[own(nv) + GAUSS.z + i, j] = late * (v[j] + 0.5 * late * slope)
            real[own(nv) + GAUSS.z + i, nv + j] = v[j] + late * slope


@sweep
def end_stages(run, h):
    """Compute q and v of CANDIDATE from the rates of the stages. Returns False if M is singular."""
    data = opened_run(run)
    stages, real, rows = data.stages, data.real, opened(data.scene).rows
    nq, nv = size_of_state(run)
    wanted, scratch = real[own(nv) + GAUSS.wanted], real[own(nv) + GAUSS.scratch]
    collocated(run, data.tableau.b, h, wanted)
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    q = stages[at.CANDIDATE, :nq]
    advance(rows, q, wanted[:nv], 1.0)
    regular, _ = factor_mass(run, q)
    out_of_chart(rows, wanted[:nv], wanted[nv : 2 * nv], scratch[nv : 2 * nv], scratch[:nv])
    factors = real[mass(nv) : mass(nv) + nv]
    substitute(factors, nv, real[own(nv) + GAUSS.pivots], scratch)
    for j in range(nv):
        stages[at.CANDIDATE, nq + j] = scratch[j]
    return regular


@sweep
def jacobian(run):
    """Compute A - B W and B + W - C at Y into the first rows of `real`, by central differences."""
    data = opened_run(run)
    control, stages, real = data.control[0], data.stages, data.real
    clock = control.clock
    nq, nv = size_of_state(run)
    rows, first, base = opened(data.scene).rows, own(nv), 3 * nv
    t = min(clock.time, clock.clip)
    z, rate = real[first + GAUSS.z], real[first + GAUSS.rate, nv:]
    p = real[first + GAUSS.kept, nv if nq > nv else 0 :]  # momentum in the chart
    factors, pivots = real[mass(nv) : mass(nv) + nv], real[first + GAUSS.pivots]
    plus, minus = real[base + implicit.RADAU.f], real[base + implicit.RADAU.f + 1]
    speeds, weights = real[base + implicit.RADAU.speeds], real[base + implicit.RADAU.weights]
    prepare(run)
    for j in range(nv):
        speeds[j] = stages[at.Y, nq + j]
        z[j], z[nv + j] = 0.0, speeds[j]
    for j in range(2 * nv):
        move, start = MOVE, z[j]
        if weights[j] > 0.0:
            move = MOVE / (weights[j] * (control.error.rtol + control.error.atol))
        z[j] = start + move
        evaluate(run, t, 0)
        for i in range(nv):
            plus[i], plus[nv + i] = p[i], rate[i]
        z[j] = start - move
        evaluate(run, t, 0)
        z[j] = start
        for i in range(nv):
            minus[i] = (plus[i] - p[i]) / (2.0 * move)
            plus[i] = (plus[nv + i] - rate[i]) / (2.0 * move)
        substitute(factors, nv, pivots, minus)
        substitute(factors, nv, pivots, plus)
        of, column = (0, j) if j < nv else (nv, j - nv)
        for i in range(nv):
            real[of + i, column] = plus[i]
            if j < nv:
                real[2 * nv + i, j] = minus[i]
    for k in range(1, rows.shape[0]):
        if has_attitude(kind_of(rows, k)):
            add_half_turn(real, nv, v_of(rows, k), speeds)
    for i in range(nv):
        for j in range(nv):
            real[nv + i, j] -= real[2 * nv + i, j]
    data.counters[0].jacobians += 1
    keep_jacobian(control.newton, clock.time)


@sweep
def is_slow(missed, rate, rounds, nv):
    """Check whether these iterations need more evaluations than a Jacobian by central differences
    and so many rounds of Newton's method."""
    return rate >= 1.0 or missed * power(rate, rounds + 4.0 * nv / 3.0) > EPS


@sweep
def solved(run, h, still, newton, most):
    """Solve for the stages of a step. Returns (True, power, loss), or (False, last correction, its
    rate).

    Corrections below `still` are of the size of rounding. Newton's method keeps its rate. The
    iteration with the inverse mass matrix alone ends at the rate `most`, or if Newton's method
    costs less.
    """
    data = opened_run(run)
    control, counters, flow, tableau = data.control[0], data.counters[0], data.flow, data.tableau
    begin_stages(run, h)
    last = math.inf
    rate = 0.0
    for n in range(STAGE_ROUNDS):
        power = 0.0
        loss = 0.0
        for i in range(tableau.b.shape[0]):
            evaluate(run, min(control.clock.time + tableau.c[i] * h, control.clock.clip), i)
            power += h * tableau.b[i] * flow[0]
            loss += h * tableau.b[i] * flow[1]
        change, size = corrected(run, h, newton)
        counters.newton_iterations += 1
        if not (abs(change) < math.inf and size < math.inf):
            return False, 1.0, 1.0
        missed = math.sqrt(abs(change) / size) if size > 0.0 else 0.0
        rounded = missed < ROUNDING or abs(change) < still
        share = missed / last if n > 0 else 0.0
        if n > 0 and not rounded:
            rate = max(rate, share)
        remaining = max(rate, share) * missed if n > 0 else missed  # size of the next correction
        if missed < 2.0 * EPS or remaining < EPS or (share >= 1.0 and rounded):
            if newton:
                keep_rate(control.newton, rate)
            elif most == BY_COST:
                want_jacobian(control.newton)
            return True, power, loss
        slow = share >= (most if most > BY_COST else SERVES)
        if most == BY_COST and n > 1:  # the first rate is not typical
            slow = is_slow(missed, share, NEWTON_ROUNDS, control.nv)
        if slow and n > 0 and not rounded:
            return False, missed, share
        last = missed
    return False, 1.0, 1.0


@sweep
def solved_by_newton(run, h, still):
    """Solve for the stages of a step with the Jacobian of this step or of an earlier one."""
    data = opened_run(run)
    control, counters = data.control[0], data.counters[0]
    newton = control.newton
    while True:
        if not newton.jacobian_rate < KEEP and newton.jacobian_time != control.clock.time:
            jacobian(run)
        if newton.factored != h:
            counters.factorisations += 1
            if not factor_pair(run, h, data.tableau.a[3 + COUPLING.eigenvalues]):
                return False, 0.0, 0.0
        found = solved(run, h, still, True, SERVES)
        if found[0]:
            return found
        want_jacobian(newton)
        if newton.jacobian_time == control.clock.time:
            return found


@sweep
def solve_stages(run, h, still):
    """Solve for the stages of a step by the cheaper way. Returns (True on success, power, loss)."""
    data = opened_run(run)
    control, counters = data.control[0], data.counters[0]
    newton = control.newton
    if newton.jacobian_rate < SERVES:
        found = solved_by_newton(run, h, still)
    else:
        alone = solved(
            run, h, still, False, PATIENT if newton.jacobian_rate == USELESS else BY_COST
        )
        if alone[0]:
            return alone
        before = counters.newton_iterations
        found = solved_by_newton(run, h, still)
        rounds = counters.newton_iterations - before
        if found[0] and not is_slow(alone[1], alone[2], rounds, control.nv):
            keep_rate(newton, USELESS)
    return found if found[0] else solved(run, h, still, False, TO_THE_END)


@kernel(STEP, nogil=True, later=True)
def gauss(run, h):
    """Take one step of Gauss collocation in (q, p)."""
    data = opened_run(run)
    stages = data.stages
    nq, nv = size_of_state(run)
    regular, total = factor_mass(run, stages[at.Y, :nq])
    if not regular:
        return UNSOLVED
    found, power, loss = solve_stages(run, h, (MOTIONLESS * EPS / h) ** 2 * total)
    if not found or not end_stages(run, h):
        return UNSOLVED
    stages[at.CANDIDATE, nq + nv] += power
    stages[at.CANDIDATE, nq + nv + 1] += loss
    return 0.0 if finite(stages[at.CANDIDATE]) else math.inf
