"""Generalised alpha: one implicit evaluation a step, order 2, for stiff and constrained motion.

[Chung, Hulbert 1993; on rotations: Arnold, Bruels 2007]. With accelerations A of its own it takes

    q₁ = q₀ ∘ exp(h v₀ + h² ((½ - β) A₀ + β A₁)),    v₁ = v₀ + h ((1 - γ) A₀ + γ A₁),
    (1 - α_m) A₁ + α_m A₀ = (1 - α_f) v'(q₁, v₁) + α_f v'(q₀, v₀)

and Newton's method finds A₁, with the Jacobian of Radau's method. Coefficients stand in the
first row of the tableau.
"""

import math

from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, sweep
from ..linear import factor, substitute
from ..vec import finite
from .implicit import (
    PIVOTS,
    RIGHT,
    SCRATCH,
    WEIGHTS,
    F,
    Z,
    finish_local,
    jacobian,
    local_slope,
    prepare,
    size_of_local,
)
from .state import NOT_SOLVED, STEP, size_of_state

MEMORY, MARK = at.STAGE, at.STAGE + 1  # A at the end of the last step; when that was [s]
SAME = 1e-9  # of a step
OUTDATED = 2.0  # Newton's rate that tells of other equations: the run began, or began again
SLOW = 0.1  # Newton's rate from which the next step takes a new Jacobian
ITERATIONS = 15
ENOUGH = 0.03  # of the tolerance
ROUNDING = 1e-13  # a correction below it, over its scale, is rounding


@sweep
def factor_alpha(run, h):
    """(1 - α_m) 1 - (1 - α_f) (h γ B + h² β A), factored; whether it can be."""
    data = opened_run(run)
    real, nv = data.real, data.control[0].nv
    alpha_m, alpha_f, beta, gamma = data.tableau.a[0]
    by_slope = 1.0 - alpha_f
    by_q = by_slope * h * h * beta
    by_v = by_slope * h * gamma
    A, B, out = real[:nv], real[nv : 2 * nv], real[2 * nv : 3 * nv]
    for i in range(nv):
        for j in range(nv):
            out[i, j] = -by_v * B[i, j] - by_q * A[i, j]
        out[i, i] += 1.0 - alpha_m
    data.control[0].factored = h
    data.counters[0].factorisations += 1
    return factor(out, nv, real[3 * nv + PIVOTS])


@sweep
def moved(run, h, before, now, z):
    """(ξ, w) of a step with the accelerations A₀ = `before` and A₁ = `now`."""
    data = opened_run(run)
    stages = data.stages
    nq, nv = size_of_state(run)
    beta, gamma = data.tableau.a[0, 2], data.tableau.a[0, 3]
    for j in range(nv):
        old = stages[before, nq + j]
        z[j] = h * stages[at.Y, nq + j] + h * h * ((0.5 - beta) * old + beta * now[j])
        z[nv + j] = h * ((1.0 - gamma) * old + gamma * now[j])


@sweep
def newton(run, h, before, now):
    """A₁ into `now`, and its (ξ, w); whether it was found. Newton's rate goes into `control`."""
    data = opened_run(run)
    control, counters, stages, real = data.control[0], data.counters[0], data.stages, data.real
    nq, nv = size_of_state(run)
    base = 3 * nv
    z, slope, right = real[base + Z], real[base + F], real[base + RIGHT]
    alpha_m, alpha_f, beta, gamma = data.tableau.a[0]
    t = min(control.time + h, control.clip)
    moved(run, h, before, now, z)
    last = 0.0
    for n in range(ITERATIONS):
        local_slope(run, t, z, slope)
        if not finite(slope[: 2 * nv]):
            return False
        for j in range(nv):
            here = (1.0 - alpha_m) * now[j] + alpha_m * stages[before, nq + j]
            there = (1.0 - alpha_f) * slope[nv + j] + alpha_f * stages[at.SLOPE, nq + j]
            right[j] = there - here
        substitute(real[2 * nv : base], nv, real[base + PIVOTS], right)
        for j in range(nv):
            now[j] += right[j]
            right[nv + j] = h * gamma * right[j]
            right[j] = h * h * beta * right[j]
            z[j] += right[j]
            z[nv + j] += right[nv + j]
        counters.newton_iterations += 1
        change = size_of_local(right, real[base + WEIGHTS], 2 * nv)
        if not change < math.inf:
            return False
        if n > 0:
            rate = change / last if last > 0.0 else 0.0
            control.jacobian_rate = rate
            if rate >= 1.0:
                return change * control.rtol < 100.0 * ROUNDING
            if rate / (1.0 - rate) * change < ENOUGH:
                return True
        if change * control.rtol < ROUNDING:
            control.jacobian_rate = min(control.jacobian_rate, 0.0)  # nothing outdated it
            return True
        last = change
    return False


@kernel(STEP, nogil=True, later=True)
def generalised_alpha(run, h):
    """One step of generalised alpha."""
    data = opened_run(run)
    control, stages, flow, real = data.control[0], data.stages, data.flow, data.real
    nq, nv = size_of_state(run)
    now = real[3 * nv + SCRATCH + 3, :nv]
    prepare(run)
    fresh = not control.jacobian_rate < OUTDATED
    known = not fresh and abs(stages[MARK, 0] - control.time) <= SAME * h
    before = MEMORY if known else at.SLOPE
    solved = False
    while not solved:
        if not control.jacobian_rate < SLOW and control.jacobian_time != control.time:
            jacobian(run)
        if control.factored != h and not factor_alpha(run, h):
            return NOT_SOLVED
        for j in range(nv):
            now[j] = stages[before, nq + j]
        solved = newton(run, h, before, now)
        if not solved:
            if control.jacobian_time == control.time:
                return NOT_SOLVED
            control.jacobian_rate = 1.0
    power = 0.5 * h * (stages[at.SLOPE, nq + nv] + flow[0])
    loss = 0.5 * h * (stages[at.SLOPE, nq + nv + 1] + flow[1])
    finish_local(run, real[3 * nv + Z], power, loss)
    for j in range(nv):
        stages[MEMORY, nq + j] = now[j]
    stages[MARK, 0] = control.time + h
    return 0.0 if finite(stages[at.CANDIDATE]) else math.inf
