"""Implicit steps by Radau IIA of order 5, compiled on first use.

A step uses local coordinates z = (ξ, w), where q is moved along ξ from the start of the step, and v
= v₀ + w. Rotations of ball and free joints are the exponential of ξ, with ξ' = dexp⁻¹(ξ) ω, so that
the order of the method is preserved. In (λ - J) z = r with J = [W 1; A B], ξ alone is solved for:

    (λ² - λ (B + W) - (A - B W)) ξ = r₂ + (λ - B) r₁,    w = (λ - W) ξ - r₁

A and B are computed by central differences, and W = ½ ω×. See [Hairer, Wanner 1996, IV.8].
"""

import math

from ...tolerances import EPS, ROUNDING
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, part, sweep
from ..linear import factor, row_times, substitute
from ..motion import call_acceleration, opened
from ..motions import has_attitude, is_inert, numbers_of
from ..records import CHOSEN, columns
from ..rows import kind_of, q_of, v_of
from ..tree.moving import advance, local_rate
from ..vec import finite
from .control.newton import keep_factors, keep_jacobian, keep_rate, want_jacobian
from .state import STEP, UNSOLVED, copied, size_of_state
from .widths import inverse, larger, weigh

# rows of the real matrices, from 3 nv on: 2 nv wide
RADAU = columns(
    pivots=1,
    pivots_c=1,  # pivots of the complex pair
    z=3,  # stages
    f=3,  # their slopes
    w=3,  # decoupled stages
    right=1,
    scratch=1,
    weights=1,
    speeds=1,
    powers=1,
    probe=1,  # a coordinate moved for a difference, and the slopes on both sides
    forward=1,
    backward=1,
    mean=1,  # mean of the stages weighted for the error, the error, and the slope there
    missed=1,
    slope=1,
    report=1,  # report of derivatives
)
# rows of the tableau's `a`: stages from decoupled ones, the reverse, eigenvalues of the inverse
COUPLING = columns(stages=3, decoupled=3, eigenvalues=1)
LEAST_COLUMNS = 6  # columns

MOVE = EPS ** (1 / 3)  # step of central differences over their scale: their error is least
KEEP = 1e-3  # Newton's rate below which the next step takes the same Jacobian (RADAU5's THET)
ITERATIONS = 12


def matrix_rows(nv):
    """Return the number of rows of the real matrix."""
    return 3 * nv + RADAU.total


@part
def coupling_of(a):
    """Return the parts of a tableau's `a` that COUPLING names."""
    return (
        a[: COUPLING.decoupled],
        a[COUPLING.decoupled : COUPLING.eigenvalues],
        a[COUPLING.eigenvalues],
    )


@sweep
def local_slope(run, t, z, out):
    """Compute z' at local coordinates z."""
    data = opened_run(run)
    stages, flow, counters = data.stages, data.flow, data.counters[0]
    nq, nv = size_of_state(run)
    rows = opened(data.scene).rows
    q = stages[at.TRIAL, :nq]
    v = stages[at.TRIAL, nq : nq + nv]
    for i in range(nq):
        q[i] = stages[at.Y, i]
    for j in range(nv):
        v[j] = stages[at.Y, nq + j] + z[nv + j]
    advance(rows, q, z[:nv], 1.0)
    local_rate(rows, z, v, out)
    tau = stages[at.TORQUE, :nv]
    vdot = out[nv : 2 * nv]
    call_acceleration(data.links.accelerate, (data.scene, t, q, v, tau, vdot, flow))
    counters.evaluations += 1
    counters.solver_iterations += int(flow[2])


@sweep
def local_weights(rows, size, stages, weights):
    """Compute the inverse tolerances of ξ and w, after `weigh`."""
    nq, nv = size
    given = stages[at.WEIGHT]
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = v_of(rows, k)
        first, count = numbers_of(kind_of(rows, k))
        inert = is_inert(kind_of(rows, k))  # no integral of a state has a tolerance
        for n in range(count):
            weights[j + first + n] = given[i + n] if not inert else 0.0
        for n in range(first):
            weights[j + n] = given[i + count]
    for j in range(nv):
        weights[nv + j] = given[nq + j]


@sweep
def half_turn(rows, v, sign, x, out):
    """Add sign · W x to `out`, with W = ½ ω× for every ball and free body."""
    for k in range(1, rows.shape[0]):
        if has_attitude(kind_of(rows, k)):
            j = v_of(rows, k)
            a, b, c = 0.5 * sign * v[j], 0.5 * sign * v[j + 1], 0.5 * sign * v[j + 2]
            out[j] += b * x[j + 2] - c * x[j + 1]
            out[j + 1] += c * x[j] - a * x[j + 2]
            out[j + 2] += a * x[j + 1] - b * x[j]


@sweep
def jacobian(run):
    """Compute A - B W and B + W at Y into the first rows of `real`, by central differences."""
    data = opened_run(run)
    control, stages, real = data.control[0], data.stages, data.real
    clock = control.clock
    nq, nv = size_of_state(run)
    rows = opened(data.scene).rows
    t = min(clock.time, clock.clip)
    z = real[3 * nv + RADAU.probe]
    plus = real[3 * nv + RADAU.forward]
    minus = real[3 * nv + RADAU.backward]
    weights = real[3 * nv + RADAU.weights]
    for j in range(2 * nv):
        z[j] = 0.0
    for j in range(2 * nv):
        move = MOVE
        if weights[j] > 0.0:
            move = MOVE / (weights[j] * (control.error.rtol + control.error.atol))
        z[j] = move
        local_slope(run, t, z, plus)
        z[j] = -move
        local_slope(run, t, z, minus)
        z[j] = 0.0
        first = 0 if j < nv else nv
        for i in range(nv):
            real[first + i, j - first] = (plus[nv + i] - minus[nv + i]) / (2.0 * move)
    speeds = real[3 * nv + RADAU.speeds]
    for j in range(nv):
        speeds[j] = stages[at.Y, nq + j]
    for k in range(1, rows.shape[0]):
        if has_attitude(kind_of(rows, k)):
            add_half_turn(real, nv, v_of(rows, k), speeds)
    data.counters[0].jacobians += 1
    keep_jacobian(control.newton, clock.time)


@part
def add_half_turn(real, nv, j, speeds):
    """Compute A - B W and B + W for one ball, where W is skew-symmetric."""
    a, b, c = 0.5 * speeds[j], 0.5 * speeds[j + 1], 0.5 * speeds[j + 2]
    for i in range(nv):
        x, y, z = real[nv + i, j], real[nv + i, j + 1], real[nv + i, j + 2]
        real[i, j] -= c * y - b * z
        real[i, j + 1] -= a * z - c * x
        real[i, j + 2] -= b * x - a * y
    real[nv + j, j + 1] -= c
    real[nv + j, j + 2] += b
    real[nv + j + 1, j] += c
    real[nv + j + 1, j + 2] -= a
    real[nv + j + 2, j] -= b
    real[nv + j + 2, j + 1] += a


@sweep
def assemble(shift, real, nv, out):
    """Assemble λ² - λ (B + W) - (A - B W)."""
    for i in range(nv):
        for j in range(nv):
            out[i, j] = -shift * real[nv + i, j] - real[i, j]
        out[i, i] += shift * shift


@sweep
def solve(rows, shift, real, nv, factors, pivots, right, x):
    """Solve (λ - J) x = right (2 nv) in place of `right`, using x as scratch."""
    speeds = real[3 * nv + RADAU.speeds]
    for i in range(nv):
        x[i] = right[nv + i] + shift * right[i] - row_times(real, nv + i, 0, nv, right)
    half_turn(rows, speeds, 1.0, right, x)
    substitute(factors, nv, pivots, x)
    for i in range(nv):
        right[nv + i] = shift * x[i] - right[i]
    half_turn(rows, speeds, -1.0, x, right[nv:])
    for i in range(nv):
        right[i] = x[i]


@sweep
def size_of_local(z, weights, n):
    """Find the largest |z| over its tolerance, for real or complex z.

    The absolute value of a complex number would need `hypot` of the C library.
    """
    worst = 0.0
    for j in range(n):
        size = math.sqrt(z[j].real * z[j].real + z[j].imag * z[j].imag)
        worst = larger(worst, size * weights[j])
    return worst


@sweep
def prepare(run):
    """Compute the weights for a step from Y."""
    data = opened_run(run)
    stages, rows, size = data.stages, opened(data.scene).rows, size_of_state(run)
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    weigh(rows, size, stages, data.control[0])
    local_weights(rows, size, stages, data.real[3 * size[1] + RADAU.weights])


@sweep
def weigh_states(run):
    """Update the weights of control states at the end of a step, as zero states have no scale."""
    data = opened_run(run)
    control, stages, rows = data.control[0], data.stages, opened(data.scene).rows
    nq, nv = size_of_state(run)
    given, weights = stages[at.WEIGHT], data.real[3 * nv + RADAU.weights]
    for k in range(1, rows.shape[0]):
        if is_inert(kind_of(rows, k)):
            i, j = q_of(rows, k), v_of(rows, k)
            size = max(given[i], abs(stages[at.CANDIDATE, nq + j]))
            weights[nv + j] = inverse(control.error.rtol * size + control.error.atol)


@sweep
def finish_local(run, z, power, loss):
    """Compute CANDIDATE from Y, the local coordinates and the change in the ledger."""
    data = opened_run(run)
    stages = data.stages
    nq, nv = size_of_state(run)
    q = stages[at.CANDIDATE, :nq]
    advance(opened(data.scene).rows, q, z[:nv], 1.0)
    for j in range(nv):
        stages[at.CANDIDATE, nq + j] += z[nv + j]
    stages[at.CANDIDATE, nq + nv] += power
    stages[at.CANDIDATE, nq + nv + 1] += loss


@sweep
def factor_pair(run, h, mu):
    """Factor both matrices for a step of size h and the eigenvalues mu. Returns False if that
    fails."""
    data = opened_run(run)
    real, pair = data.real, data.pair
    nv = data.control[0].nv
    assemble(mu[0] / h, real, nv, real[2 * nv : 3 * nv])
    assemble(complex(mu[1], mu[2]) / h, real, nv, pair[:nv])
    keep_factors(data.control[0].newton, h)
    done = factor(real[2 * nv : 3 * nv], nv, real[3 * nv + RADAU.pivots])
    return factor(pair[:nv], nv, real[3 * nv + RADAU.pivots_c]) and done


@sweep
def correct(run, h, slopes, decoupled, stages):
    """Perform one Newton iteration on `decoupled` and `stages` from their slopes. RADAU.right keeps
    the change of `decoupled`.
    """
    data = opened_run(run)
    real, pair, rows = data.real, data.pair, opened(data.scene).rows
    nv = data.control[0].nv
    base = 3 * nv
    t, inverse, mu = coupling_of(data.tableau.a)
    right = real[base + RADAU.right]
    right_c = pair[nv]
    shift = mu[0] / h
    shift_c = complex(mu[1], mu[2]) / h
    for j in range(2 * nv):
        x = y = z = 0.0
        for i in range(3):
            f = slopes[i, j]
            x += inverse[0, i] * f
            y += inverse[1, i] * f
            z += inverse[2, i] * f
        right[j] = x - shift * decoupled[0, j]
        right_c[j] = complex(y, z) - shift_c * complex(decoupled[1, j], decoupled[2, j])
    scratch = real[base + RADAU.scratch]
    solve(rows, shift, real, nv, real[2 * nv : base], real[base + RADAU.pivots], right, scratch)
    solve(rows, shift_c, real, nv, pair[:nv], real[base + RADAU.pivots_c], right_c, pair[nv + 1])
    for j in range(2 * nv):
        decoupled[0, j] += right[j]
        decoupled[1, j] += right_c[j].real
        decoupled[2, j] += right_c[j].imag
        for i in range(3):
            stages[i, j] = (
                t[i, 0] * decoupled[0, j] + t[i, 1] * decoupled[1, j] + t[i, 2] * decoupled[2, j]
            )


@sweep
def correct_stages(run, h):
    """Perform one Newton iteration on W and Z. Returns the correction over its tolerance."""
    data = opened_run(run)
    real, pair, nv = data.real, data.pair, data.control[0].nv
    base = 3 * nv
    f, w, z = base + RADAU.f, base + RADAU.w, base + RADAU.z
    correct(run, h, real[f : f + 3], real[w : w + 3], real[z : z + 3])
    weights = real[base + RADAU.weights]
    right = size_of_local(real[base + RADAU.right], weights, 2 * nv)
    return max(right, size_of_local(pair[nv], weights, 2 * nv))


@sweep
def newton(run, h):
    """Solve for the stages Z of a step, and store the convergence rate in `control`.

    Returns False if that fails. A correction of the size of rounding, which grows with the
    stiffness, counts as zero.
    """
    data = opened_run(run)
    control, counters, flow, real = data.control[0], data.counters[0], data.flow, data.real
    nv = control.nv
    base = 3 * nv
    for row in range(3):
        for j in range(2 * nv):
            real[base + RADAU.z + row, j] = 0.0
            real[base + RADAU.w + row, j] = 0.0
    rtol = control.error.rtol
    enough = max(10.0 * EPS / rtol, min(0.03, math.sqrt(rtol)))
    last = 0.0
    for n in range(ITERATIONS):
        for i in range(3):
            t = min(control.clock.time + data.tableau.c[i] * h, control.clock.clip)
            out = real[base + RADAU.f + i]
            local_slope(run, t, real[base + RADAU.z + i], out)
            real[base + RADAU.powers, 2 * i] = flow[0]
            real[base + RADAU.powers, 2 * i + 1] = flow[1]
            if not finite(out[: 2 * nv]):
                return False
        counters.newton_iterations += 1
        change = correct_stages(run, h)
        if not change < math.inf:
            return False
        if n > 0:
            rate = change / last if last > 0.0 else 0.0
            keep_rate(control.newton, rate)
            if rate >= 1.0:
                return change * rtol < 100.0 * ROUNDING
            if rate / (1.0 - rate) * change < enough:
                return True
        if change * rtol < ROUNDING:
            return True
        last = change
    return False


@sweep
def radau_error(run, h):
    """Compute the error of a step over its tolerance, filtered for stiff components."""
    data = opened_run(run)
    control, stages, real = data.control[0], data.stages, data.real
    nq, nv = size_of_state(run)
    base = 3 * nv
    rows = opened(data.scene).rows
    shift = data.tableau.a[COUPLING.eigenvalues, 0] / h
    missed = real[base + RADAU.missed]
    weights = real[base + RADAU.weights]
    scratch = real[base + RADAU.scratch]
    factors, pivots = real[2 * nv : base], real[base + RADAU.pivots]
    weighted_stages(data.tableau.error[0], h, real, base, nv)
    for j in range(nv):
        missed[j] = real[base + RADAU.mean, j] + stages[at.Y, nq + j]
        missed[nv + j] = real[base + RADAU.mean, nv + j] + stages[at.SLOPE, nq + j]
    solve(rows, shift, real, nv, factors, pivots, missed, scratch)
    error = size_of_local(missed, weights, 2 * nv)
    if error > 1.0 and (control.error.rejected == 1 or data.counters[0].steps == 0):
        out = real[base + RADAU.slope]
        local_slope(run, min(control.clock.time, control.clock.clip), missed, out)
        for j in range(2 * nv):
            missed[j] = real[base + RADAU.mean, j] + out[j]
        solve(rows, shift, real, nv, factors, pivots, missed, scratch)
        error = size_of_local(missed, weights, 2 * nv)
    return error


@part
def weighted_stages(error, h, real, base, nv):
    """Write Σ e_i Z_i / h into RADAU.mean."""
    for j in range(2 * nv):
        x = 0.0
        for i in range(3):
            x += error[i] * real[base + RADAU.z + i, j]
        real[base + RADAU.mean, j] = x / h


@kernel(STEP, nogil=True, later=True)
def radau(run, h):
    """Take one step of Radau IIA. Returns the error over the tolerance."""
    data = opened_run(run)
    control, stages, real = data.control[0], data.stages, data.real
    base = 3 * control.nv
    prepare(run)
    solved = False
    while not solved:
        if (
            not control.newton.jacobian_rate < KEEP
            and control.newton.jacobian_time != control.clock.time
        ):
            jacobian(run)
        if control.newton.factored != h:
            data.counters[0].factorisations += 1
            if not factor_pair(run, h, data.tableau.a[COUPLING.eigenvalues]):
                return UNSOLVED
        solved = newton(run, h)
        if not solved:
            if control.newton.jacobian_time == control.clock.time:
                return UNSOLVED
            want_jacobian(control.newton)
    power = 0.0
    loss = 0.0
    for i in range(3):
        power += h * data.tableau.b[i] * real[base + RADAU.powers, 2 * i]
        loss += h * data.tableau.b[i] * real[base + RADAU.powers, 2 * i + 1]
    finish_local(run, real[base + RADAU.z + 2], power, loss)
    if not finite(stages[at.CANDIDATE]):
        return math.inf
    if control.error.widths != CHOSEN:
        return 0.0
    weigh_states(run)
    return radau_error(run, h)
