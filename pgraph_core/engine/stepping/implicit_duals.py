"""Implicit steps of duals: derivatives of the stages that a run of numbers has solved for.

The stages z solve r(z, p) = 0. The simplified Newton's method that found them also finds their
derivatives: it evaluates r of duals at the values of z, and corrects the derivatives alone with the
factors of the primal run. The derivatives converge at the same rate as the values ([Griewank &
Walther 2008, section 15.3]). If the primal run has repeated a part of the step to look for an
event, its stages are those of that part, and the values are corrected too. A derivative that does
not converge is nan.
"""

import math

from ...tolerances import NOTABLE, ROUNDING, SOLVED
from .. import layout as at
from ..arrays import opened_run
from ..compiler.dual import WIDTH, parted, revalued
from ..compiler.jit import kernel, part, sweep
from ..linear import factor, substitute
from ..motion import opened
from ..records import columns
from ..tree.moving import advance
from . import gauss as by_gauss
from . import implicit as by_radau
from .control.newton import forget_factors
from .duals import STEP_OF_DUALS, end_step, go_back, width_of_step
from .gauss import GAUSS
from .implicit import COUPLING, RADAU, coupling_of, finish_local, local_slope
from .state import copied, size_of_state

CORRECTION_ROUNDS = 60  # maximum number of corrections: reaches ROUNDING at a rate of 0.6
# rows of a report, per derivative: correction, previous one, size, size at the start of the step
SIZES = columns("now", "before", "largest", "first")


@part
def open_report(report):
    """Reset the sizes of corrections."""
    for k in range(WIDTH):
        report[SIZES.now, k] = math.inf
        report[SIZES.first, k] = 0.0


@part
def begin_round(report):
    """Keep the sizes of the last corrections, and reset those of the next ones."""
    for k in range(WIDTH):
        report[SIZES.before, k] = report[SIZES.now, k]
        report[SIZES.now, k] = 0.0
        report[SIZES.largest, k] = 0.0


@part
def is_small(report, k, share):
    """Check whether the correction of derivative k is at most this share, or a rounding error."""
    change = report[SIZES.now, k]
    return change <= share * report[SIZES.largest, k] or change <= ROUNDING * report[SIZES.first, k]


@sweep
def settled(report):
    """Check whether every derivative has converged, is not finite or no longer improves."""
    done = True
    for k in range(1, WIDTH):
        change = report[SIZES.now, k]
        rounded = change >= report[SIZES.before, k] and is_small(report, k, SOLVED)
        done = done and (rounded or is_small(report, k, ROUNDING) or not change < math.inf)
    return done


@sweep
def reject(report, row):
    """Make the derivatives of a row nan whose last correction is visible."""
    derivatives = parted(row)
    for k in range(1, WIDTH):
        if not (report[SIZES.now, k] < math.inf and is_small(report, k, NOTABLE)):
            for i in range(row.shape[0]):
                derivatives[i, k] = math.nan


# -- Radau IIA -------------------------------------------------------------------------------------


@sweep
def correct_radau(run, numbers, h, report):
    """Correct the stages once, and their values if part of the step has been repeated."""
    real, given = opened_run(run).real, opened_run(numbers).real
    nv = opened_run(run).control[0].nv
    base = 3 * nv
    parts, weights = parted(real), given[base + RADAU.weights]
    f, w, z = base + RADAU.f, base + RADAU.w, base + RADAU.z
    for k in range(1 - opened_run(numbers).control[0].clock.repeated, WIDTH):
        slopes, decoupled = parts[f : f + 3, :, k], parts[w : w + 3, :, k]
        by_radau.correct(numbers, h, slopes, decoupled, parts[z : z + 3, :, k])
        change = by_radau.size_of_local(given[base + RADAU.right], weights, 2 * nv)
        pair = by_radau.size_of_local(opened_run(numbers).pair[nv], weights, 2 * nv)
        report[SIZES.now, k] = max(change, pair)
        report[SIZES.largest, k] = report[SIZES.first, k]
        for i in range(3):
            size = by_radau.size_of_local(parts[z + i, :, k], weights, 2 * nv)
            report[SIZES.largest, k] = max(report[SIZES.largest, k], size)


@kernel(STEP_OF_DUALS, nogil=True, later=True)
def radau_of_duals(run, numbers):
    """Repeat a step of Radau IIA."""
    go_back(run, numbers)
    data, given = opened_run(run), opened_run(numbers)
    control, stages, flow, real = data.control[0], data.stages, data.flow, data.real
    nv, h = control.nv, width_of_step(numbers)
    base = 3 * nv
    report, y = parted(real[base + RADAU.report]), parted(stages[at.Y])
    open_report(report)
    for k in range(1, WIDTH):
        for i in range(control.nq + nv):
            size = abs(y[i, k]) * given.stages[at.WEIGHT, i]
            report[SIZES.first, k] = max(report[SIZES.first, k], size)
    _, decoupling, eigenvalues = coupling_of(data.tableau.a)
    for i in range(3):
        for j in range(2 * nv):
            real[base + RADAU.z + i, j] = given.real[base + RADAU.z + i, j]
            real[base + RADAU.w + i, j] = 0.0
            for n in range(3):
                z = given.real[base + RADAU.z + n, j]
                real[base + RADAU.w + i, j] += decoupling[i, n] * z
    if given.control[0].newton.factored != h:
        by_radau.factor_pair(numbers, h, eigenvalues)
        # the primal run factors again, as without derivatives
        forget_factors(given.control[0].newton)
    for _ in range(CORRECTION_ROUNDS):
        begin_round(report)
        for i in range(3):
            t = min(control.clock.time + data.tableau.c[i] * h, control.clock.clip)
            local_slope(run, t, real[base + RADAU.z + i], real[base + RADAU.f + i])
            real[base + RADAU.powers, 2 * i] = flow[0]
            real[base + RADAU.powers, 2 * i + 1] = flow[1]
        correct_radau(run, numbers, h, report)
        if settled(report):
            break
    power = 0.0 * flow[0]
    loss = 0.0 * flow[0]
    for i in range(3):
        power += h * data.tableau.b[i] * real[base + RADAU.powers, 2 * i]
        loss += h * data.tableau.b[i] * real[base + RADAU.powers, 2 * i + 1]
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    finish_local(run, real[base + RADAU.z + 2], power, loss)
    reject(report, stages[at.CANDIDATE])
    end_step(run, numbers)


# -- Gauss' collocation ----------------------------------------------------------------------------


@sweep
def correct_gauss(run, numbers, h, report):
    """Correct the velocities of the stages once, and their values as `correct_radau` does."""
    data, given = opened_run(run), opened_run(numbers)
    real, nv = data.real, data.control[0].nv
    rows, first, count = opened(data.scene).rows, by_gauss.own(nv), data.tableau.b.shape[0]
    parts, found = parted(real), given.real[first + GAUSS.missed :]
    wanted, scratch = real[first + GAUSS.wanted], real[first + GAUSS.scratch]
    newton = given.control[0].newton.jacobian_rate < by_gauss.SERVES
    for i in range(count):
        z, p = real[first + GAUSS.z + i], real[first + GAUSS.kept + i]
        missed = real[first + GAUSS.missed + i, :nv]
        by_gauss.collocated(run, data.tableau.a[i], h, wanted)
        by_gauss.out_of_chart(rows, z[:nv], wanted[nv : 2 * nv], scratch[:nv], missed)
        for j in range(nv):
            missed[j] -= p[j]
    for k in range(1 - given.control[0].clock.repeated, WIDTH):
        for i in range(count):
            for j in range(nv):
                found[i, j] = parts[first + GAUSS.missed + i, j, k]
        by_gauss.use_misses(numbers, h, newton)
        for i in range(count):
            for j in range(nv):
                x = found[i, nv + j]
                parts[first + GAUSS.z + i, nv + j, k] += x
                report[SIZES.now, k] = max(report[SIZES.now, k], abs(x))
                size = abs(parts[first + GAUSS.z + i, nv + j, k])
                report[SIZES.largest, k] = max(report[SIZES.largest, k], size)
    by_gauss.place(run, h, newton)


@sweep
def finish_gauss(run, numbers, h):
    """Compute q and v of CANDIDATE from the rates of the stages.

    The derivatives of v are those of the momentum minus those of the mass matrix times v, divided
    by the mass matrix.
    """
    data, given = opened_run(run), opened_run(numbers)
    real, stages = data.real, data.stages
    nq, nv = size_of_state(run)
    rows, first, own = opened(data.scene).rows, by_gauss.mass(nv), by_gauss.own(nv)
    wanted, scratch = real[own + GAUSS.wanted], real[own + GAUSS.scratch]
    by_gauss.collocated(run, data.tableau.b, h, wanted)
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    advance(rows, q, wanted[:nv], 1.0)
    by_gauss.mass_matrix(run, q)
    by_gauss.out_of_chart(rows, wanted[:nv], wanted[nv : 2 * nv], scratch[nv : 2 * nv], v)
    mass, speeds = parted(real[first : first + nv]), parted(v)
    x, pivots = given.real[own + GAUSS.scratch], given.real[own + GAUSS.pivots]
    factors = given.real[first : first + nv]
    for i in range(nv):
        for j in range(nv):
            factors[i, j] = mass[i, j, 0]
    factor(factors, nv, pivots)
    for k in range(WIDTH):
        for i in range(nv):
            x[i] = speeds[i, k]
            for j in range(nv if k > 0 else 0):
                x[i] -= mass[i, j, k] * speeds[j, 0]
        substitute(factors, nv, pivots, x)
        for i in range(nv):
            speeds[i, k] = x[i]


@kernel(STEP_OF_DUALS, nogil=True, later=True)
def gauss_of_duals(run, numbers):
    """Repeat a step of Gauss' collocation."""
    go_back(run, numbers)
    data, given = opened_run(run), opened_run(numbers)
    control, stages, flow, real = data.control[0], data.stages, data.flow, data.real
    nq, nv = size_of_state(run)
    h, count = width_of_step(numbers), data.tableau.b.shape[0]
    scene, first = opened(data.scene), by_gauss.own(nv)
    q, v = stages[at.Y, :nq], stages[at.Y, nq : nq + nv]
    start, unused = real[first + GAUSS.start, :nv], real[first + GAUSS.scratch, :nv]
    by_gauss.momenta(scene.rows, scene.const, scene.work, q, v, start, unused)
    report, y = parted(real[first + GAUSS.report]), parted(stages[at.Y])
    open_report(report)
    for k in range(1, WIDTH):
        for i in range(nq + nv):  # rounded positions are rounded velocities over a step
            size = abs(y[i, k]) / h if i < nq else abs(y[i, k])
            report[SIZES.first, k] = max(report[SIZES.first, k], size)
    for i in range(count):
        for j in range(nv):
            z, values = real[first + GAUSS.z + i], given.real[first + GAUSS.z + i]
            z[j] = revalued(data.tableau.c[i] * h * v[j], values[j])
            z[nv + j] = revalued(v[j], values[nv + j])
    newton = given.control[0].newton
    if newton.jacobian_rate < by_gauss.SERVES and newton.factored != h:
        by_radau.factor_pair(numbers, h, data.tableau.a[3 + COUPLING.eigenvalues])
        # the primal run factors again, as without derivatives
        forget_factors(given.control[0].newton)
    power = 0.0 * flow[0]
    loss = 0.0 * flow[0]
    for _ in range(CORRECTION_ROUNDS):
        begin_round(report)
        power = 0.0 * flow[0]
        loss = 0.0 * flow[0]
        for i in range(count):
            by_gauss.evaluate(
                run, min(control.clock.time + data.tableau.c[i] * h, control.clock.clip), i
            )
            power += h * data.tableau.b[i] * flow[0]
            loss += h * data.tableau.b[i] * flow[1]
        correct_gauss(run, numbers, h, report)
        if settled(report):
            break
    finish_gauss(run, numbers, h)
    stages[at.CANDIDATE, nq + nv] += power
    stages[at.CANDIDATE, nq + nv + 1] += loss
    reject(report, stages[at.CANDIDATE])
    end_step(run, numbers)
