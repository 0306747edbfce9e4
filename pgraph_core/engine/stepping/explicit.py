"""Explicit Runge-Kutta methods: attempts, and dense output within the last step."""

import math

from .. import layout as at
from ..compiler.jit import kernel, sweep
from ..motion import opened
from ..tree.moving import normalise_all
from ..vec import add_scaled, cross, dot, finite, store3
from .attempt import ATTEMPT, copied, slope
from .scales import size_of, weigh

KNOWN = 0.01  # of the scales: larger errors of a step, as in a wall, follow no order of the method


@sweep
def combine(stages, base, weights, count, h, out):
    """Row `out` = row `base` (-1: zero) + h Σ weights k over the first `count` stages."""
    n = stages.shape[1]
    for i in range(n):
        stages[out, i] = 0.0
    for r in range(count):
        x = weights[r]
        if x != 0.0:
            for i in range(n):
                stages[out, i] += x * stages[at.STAGE + r, i]
    for i in range(n):
        stages[out, i] *= h
    if base >= 0:
        for i in range(n):
            stages[out, i] += stages[base, i]


@sweep
def turn_spins(rows, size, stages, by, row, back):
    """ω of balls and free bodies in `row`, or its rate, into the body's axes, or `back`.

    The body is turned as in row `by`. Stages are added up in its axes: there an error of the
    attitude is no error of ω, which a rotation that is not stable would make grow.
    """
    nq, nv = size
    if nq == nv:
        return
    sign = 2.0 if back else -2.0
    for k in range(1, rows.shape[0]):
        kind = rows[k, at.KIND]
        if kind >= at.BALL:
            i = rows[k, at.QI] + (3 if kind == at.FREE else 0)
            j = nq + rows[k, at.VI]
            w = stages[by, i]
            u = (stages[by, i + 1], stages[by, i + 2], stages[by, i + 3])
            share = 1.0 / (w * w + dot(u, u))
            x = (stages[row, j], stages[row, j + 1], stages[row, j + 2])
            across = cross(u, x)
            x = add_scaled(x, sign * w * share, across)
            store3(stages[row], j, add_scaled(x, 2.0 * share, cross(u, across)))


@kernel(ATTEMPT, nogil=True)
def attempt_runge_kutta(scene, accelerate, tableau, size, h, stages, control, matrices, flow):
    """One step of an explicit method from Y into CANDIDATE; its error over the tolerance."""
    a, b, c, error, _ = tableau
    settings, counters = control
    t = settings.time
    clip = settings.clip
    n = stages.shape[1]
    s = b.shape[0]
    rows = opened(scene).rows
    copied(stages, at.SLOPE, at.STAGE, n)
    turn_spins(rows, size, stages, at.Y, at.STAGE, False)
    base(rows, size, stages, at.Y)
    for r in range(1, s):
        x = min(t + c[r] * h, clip)
        stage(scene, accelerate, rows, x, size, h, a[r], r, stages, flow, counters)
    combine(stages, at.ERROR, b, s, h, at.CANDIDATE)
    turn_spins(rows, size, stages, at.CANDIDATE, at.CANDIDATE, True)
    if not finite(stages[at.CANDIDATE]):
        return math.inf
    if error.shape[1] > s:
        last_stage(scene, accelerate, rows, min(t + h, clip), size, s, stages, flow, counters)
    weigh(rows, size, stages, settings)
    found = estimate(rows, size, error[0], h, stages)
    known = found * settings.rtol < KNOWN or found <= 1.0
    if error.shape[0] > 1 and found > 0.0 and known:  # [Hairer, Norsett, Wanner 1993, II.10]
        other = 0.1 * estimate(rows, size, error[1], h, stages)
        found = found * found / math.sqrt(found * found + other * other)
    return found


@sweep
def base(rows, size, stages, row):
    """The state in `row` into ERROR, spins in the bodies' axes."""
    copied(stages, row, at.ERROR, stages.shape[1])
    turn_spins(rows, size, stages, row, at.ERROR, False)


@sweep
def stage(scene, accelerate, rows, t, size, h, weights, r, stages, flow, counters):
    """Stage r from `base` and those before."""
    combine(stages, at.ERROR, weights, r, h, at.TRIAL)
    turn_spins(rows, size, stages, at.TRIAL, at.TRIAL, True)
    slope(scene, accelerate, t, size, stages, at.TRIAL, at.STAGE + r, flow, counters)
    turn_spins(rows, size, stages, at.TRIAL, at.STAGE + r, False)


@sweep
def last_stage(scene, accelerate, rows, t, size, s, stages, flow, counters):
    """The stage at CANDIDATE, which is the first one of the next step."""
    slope(scene, accelerate, t, size, stages, at.CANDIDATE, at.STAGE + s, flow, counters)
    turn_spins(rows, size, stages, at.CANDIDATE, at.STAGE + s, False)


@sweep
def estimate(rows, size, weights, h, stages):
    """h Σ weights k over its tolerance."""
    combine(stages, -1, weights, weights.shape[0], h, at.ERROR)
    return size_of(rows, size, stages, at.ERROR)


# -- dense output ---------------------------------------------------------------------------------


@sweep
def fill(scene, accelerate, tableau, size, stages, control, flow):
    """The further stages that dense output takes, once a step."""
    a, b, c, _, _ = tableau
    settings, counters = control
    h = settings.old_width
    rows = opened(scene).rows
    base(rows, size, stages, at.Y_OLD)
    for r in range(b.shape[0] + 1, a.shape[0]):
        x = min(settings.old_time + c[r] * h, settings.clip)
        stage(scene, accelerate, rows, x, size, h, a[r], r, stages, flow, counters)
    settings.filled = 1


@sweep
def within(scene, accelerate, tableau, size, stages, control, flow, share):
    """y at this share of the last step into TRIAL, quaternions at length one."""
    settings, _ = control
    dense = tableau[4]
    if settings.filled == 0:
        fill(scene, accelerate, tableau, size, stages, control, flow)
    n = stages.shape[1]
    for i in range(n):
        stages[at.TRIAL, i] = 0.0
    for r in range(dense.shape[0]):
        x = 0.0
        for power in range(dense.shape[1] - 1, -1, -1):
            x = share * (dense[r, power] + x)
        if x != 0.0:
            for i in range(n):
                stages[at.TRIAL, i] += x * stages[at.STAGE + r, i]
    rows = opened(scene).rows
    base(rows, size, stages, at.Y_OLD)
    for i in range(n):
        stages[at.TRIAL, i] = stages[at.ERROR, i] + settings.old_width * stages[at.TRIAL, i]
    turn_spins(rows, size, stages, at.TRIAL, at.TRIAL, True)
    normalise_all(rows, stages[at.TRIAL, : size[0]])
