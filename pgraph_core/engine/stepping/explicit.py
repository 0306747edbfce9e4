"""Explicit steps for one instance or for lanes, and dense output within the last step.

A step takes y from row Y, and v' there from row SLOPE, to row CANDIDATE. Either `run` is the
address of a run, or `trees` contains trees in lanes. The other argument is None.
"""

import math

from ...tolerances import VISIBLE
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, sweep
from ..constraints.blocks import velocities
from ..drives import drive
from ..loads import RIDERS, apply_loads
from ..motion import opened
from ..motions import numbers_of
from ..riders import drive_riders, move_riders, place_riders, unload_riders
from ..rows import kind_of, q_of, v_of
from ..tree.articulated import articulated, inboard, joint_acceleration
from ..tree.kinematics import outboard, positions
from ..tree.moving import advance, normalise_all
from ..vec import add_scaled, cross, dot, finite, store3
from .control.clock import keep_dense_output
from .state import STEP, acceleration_of, copied, rate_of, size_of_state
from .widths import size_of, weigh

# -- slopes ---------------------------------------------------------------------------------------


@sweep
def derivative(rows, const, drives, loads, work, t, q, v, given, tau, vdot):
    """Compute v' of driven trees in lanes. Returns the power supplied and dissipated [W].

    `loads` may be None.
    """
    put_in, dissipated = drive(drives, t, q, v, given, tau)
    if loads is None:
        articulated(rows, const, q, v, tau, work, vdot)
        return put_in, dissipated
    outboard(rows, const, work, q, v)
    linear = work[:, at.VELOCITY : at.VELOCITY + 3]
    moving(rows, const, work, v, linear)
    place_riders(loads[RIDERS], work, q)
    move_riders(loads[RIDERS], work, linear, q, v)
    more, lost = apply_loads(loads, work, linear, q, t)
    unload_riders(loads[RIDERS], work)
    drive_riders(loads[RIDERS], work, q, tau)
    inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)
    return put_in + more, dissipated + lost


@sweep
def moving(rows, const, work, v, linear):
    """Write the positions of all origins to X and velocities to `linear`, in U till `inboard`."""
    positions(rows, work)
    velocities(rows, const, work, v, linear)


@sweep
def slope(run, trees, size, t, row, out, stages):
    """Compute v' and the power at the state in `row` into row `out`."""
    if run is not None:
        acceleration_of(run, t, row, out)
    if trees is not None:
        rows, const, drives, loads, work, given = trees
        nq, nv = size
        q = stages[row, :nq]
        v = stages[row, nq : nq + nv]
        vdot = stages[out, nq : nq + nv]
        tau = stages[at.TORQUE, :nv]
        powers = derivative(rows, const, drives, loads, work, t, q, v, given, tau, vdot)
        if stages.shape[1] > nq + nv:  # the ledger is requested
            stages[out, nq + nv], stages[out, nq + nv + 1] = powers


# -- steps ----------------------------------------------------------------------------------------


@sweep
def semi_implicit_step(rows, size, h, stages):
    """Add h v' to v, then move q along the new v: order 1, symplectic for conservative trees."""
    nq, nv = size
    for i in range(nq):
        stages[at.CANDIDATE, i] = stages[at.Y, i]
    for j in range(nq, stages.shape[1]):
        stages[at.CANDIDATE, j] = stages[at.Y, j] + h * stages[at.SLOPE, j]
    q = stages[at.CANDIDATE, :nq]
    v = stages[at.CANDIDATE, nq : nq + nv]
    advance(rows, q, v, h)


@sweep
def runge_kutta_step(run, trees, rows, tableau, size, t, h, clip, stages, in_body):
    """Compute y + h Σ b_r k_r with k_r = f(t + c_r h, y + h Σ a_rs k_s), without stages after
    `clip` [s].

    With `in_body`, angular velocities are summed in the axes of the bodies.
    """
    a, b, c = tableau
    rate_of(rows, size, stages, at.Y, at.SLOPE)
    copied(stages, at.SLOPE, at.STAGE, stages.shape[1])
    if in_body:
        turn_spins(rows, size, stages, at.Y, at.STAGE, False)
    base(rows, size, stages, at.Y, in_body)
    for r in range(1, b.shape[0]):
        x = min(t + c[r] * h, clip)
        stage(run, trees, rows, size, x, h, a[r], r, stages, in_body)
    combine(stages, b, b.shape[0], h, at.CANDIDATE)
    if in_body:
        turn_spins(rows, size, stages, at.CANDIDATE, at.CANDIDATE, True)


@sweep
def base(rows, size, stages, row, in_body):
    """Copy the state in `row` into FROM."""
    copied(stages, row, at.FROM, stages.shape[1])
    if in_body:
        turn_spins(rows, size, stages, row, at.FROM, False)


@sweep
def stage(run, trees, rows, size, t, h, weights, r, stages, in_body):
    """Compute stage r from FROM and the preceding stages."""
    combine(stages, weights, r, h, at.TRIAL)
    if in_body:
        turn_spins(rows, size, stages, at.TRIAL, at.TRIAL, True)
    rate_of(rows, size, stages, at.TRIAL, at.STAGE + r)
    slope(run, trees, size, t, at.TRIAL, at.STAGE + r, stages)
    if in_body:
        turn_spins(rows, size, stages, at.TRIAL, at.STAGE + r, False)


@sweep
def add_stages(stages, weights, count, out):
    """Compute row `out` = Σ weights k over the first `count` stages."""
    n = stages.shape[1]
    for i in range(n):
        stages[out, i] = 0.0
    for r in range(count):
        weight = weights[r]
        if weight != 0.0:
            for i in range(n):
                stages[out, i] += weight * stages[at.STAGE + r, i]


@sweep
def combine(stages, weights, count, h, out):
    """Compute row `out` = FROM + h Σ weights k over the first `count` stages."""
    add_stages(stages, weights, count, out)
    for i in range(stages.shape[1]):
        stages[out, i] = stages[at.FROM, i] + h * stages[out, i]


@sweep
def turn_spins(rows, size, stages, by, row, back):
    """Rotate ω of balls and free bodies in `row`, or its rate, into body axes, or `back`.

    The body is rotated according to row `by`. In body axes, errors of the attitude do not affect ω,
    so they do not grow during unstable rotations. In world axes, constant torques are integrated
    without an error.
    """
    nq, nv = size
    if nq == nv:
        return
    sign = 2.0 if back else -2.0
    for k in range(1, rows.shape[0]):
        first, count = numbers_of(kind_of(rows, k))
        if first > 0:
            i = q_of(rows, k) + count
            j = nq + v_of(rows, k)
            w = stages[by, i]
            u = (stages[by, i + 1], stages[by, i + 2], stages[by, i + 3])
            share = 1.0 / (w * w + dot(u, u))
            x = (stages[row, j], stages[row, j + 1], stages[row, j + 2])
            across = cross(u, x)
            x = add_scaled(x, sign * w * share, across)
            store3(stages[row], j, add_scaled(x, 2.0 * share, cross(u, across)))


@kernel(STEP, nogil=True)
def semi_implicit(run, h):
    """Take one step of semi-implicit Euler."""
    data = opened_run(run)
    stages = data.stages
    semi_implicit_step(opened(data.scene).rows, size_of_state(run), h, stages)
    return 0.0 if finite(stages[at.CANDIDATE]) else math.inf


@kernel(STEP, nogil=True)
def runge_kutta(run, h):
    """Take an explicit Runge-Kutta step. Returns its error over the tolerance, if estimated."""
    data = opened_run(run)
    control, stages, error = data.control[0], data.stages, data.tableau.error
    a, b, c = data.tableau.a, data.tableau.b, data.tableau.c
    t, clip = control.clock.time, control.clock.clip
    size = size_of_state(run)
    rows = opened(data.scene).rows
    estimated = error.shape[0] > 0
    runge_kutta_step(run, None, rows, (a, b, c), size, t, h, clip, stages, estimated)
    if not finite(stages[at.CANDIDATE]):
        return math.inf
    if not estimated:
        return 0.0
    if error.shape[1] > b.shape[0]:
        last_stage(run, min(t + h, clip))
    weigh(rows, size, stages, control)
    found = estimate(rows, size, error[0], h, stages)
    known = found * control.error.rtol < VISIBLE or found <= 1.0
    if error.shape[0] > 1 and found > 0.0 and known:  # [Hairer, Norsett, Wanner 1993, II.10]
        other = 0.1 * estimate(rows, size, error[1], h, stages)
        found /= math.sqrt(1.0 + (other / found) ** 2)
    return found


@sweep
def last_stage(run, t):
    """Compute the stage at CANDIDATE, which is the first stage of the next step."""
    data = opened_run(run)
    stages, s = data.stages, data.tableau.b.shape[0]
    rows, size = opened(data.scene).rows, size_of_state(run)
    rate_of(rows, size, stages, at.CANDIDATE, at.STAGE + s)
    acceleration_of(run, t, at.CANDIDATE, at.STAGE + s)
    turn_spins(rows, size, stages, at.CANDIDATE, at.STAGE + s, False)


@sweep
def estimate(rows, size, weights, h, stages):
    """Return the error estimate h Σ weights k over its tolerance."""
    add_stages(stages, weights, weights.shape[0], at.ERROR)
    for i in range(stages.shape[1]):
        stages[at.ERROR, i] *= h
    return size_of(rows, size, stages, at.ERROR)


# -- dense output ---------------------------------------------------------------------------------


@sweep
def fill(run):
    """Compute the additional stages for dense output, once per step."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    clock = control.clock
    a, b, c = data.tableau.a, data.tableau.b, data.tableau.c
    h = clock.old_width
    rows, size = opened(data.scene).rows, size_of_state(run)
    base(rows, size, stages, at.Y_OLD, True)
    for r in range(b.shape[0] + 1, a.shape[0]):
        x = min(clock.old_time + c[r] * h, clock.clip)
        stage(run, None, rows, size, x, h, a[r], r, stages, True)
    keep_dense_output(clock)


@sweep
def dense_output(run, share):
    """Interpolate y at this fraction of the last step into TRIAL, with normalised quaternions."""
    data = opened_run(run)
    control, stages, dense = data.control[0], data.stages, data.tableau.dense
    if control.clock.filled == 0:
        fill(run)
    rows, size = opened(data.scene).rows, size_of_state(run)
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
    base(rows, size, stages, at.Y_OLD, True)
    for i in range(n):
        stages[at.TRIAL, i] = stages[at.FROM, i] + control.clock.old_width * stages[at.TRIAL, i]
    turn_spins(rows, size, stages, at.TRIAL, at.TRIAL, True)
    normalise_all(rows, stages[at.TRIAL, : size[0]])
