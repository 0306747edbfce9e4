"""Explicit steps in lanes for trees and for loops closed by constraints.

The steps are those of `explicit` and `constraints`, with the same operations in the same order, so
every lane has the bits of its own run. If a lane cannot be returned to its constraints, its step is
discarded and taken by the kernels of one instance.
"""

import math
from typing import Any, NamedTuple

from .. import layout as at
from ..arrays import FACTORED, PLACED, RHS, Blocks, Workspace, opened_run
from ..arrays import STEP as RESPONSE
from ..compiler.elementary import FAR
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, F3, I1, I2, group, i8, void
from ..compiler.lane import lanes
from ..compiler.masks import chosen, either, most, without
from ..constraints.blocks import residual_acceleration, turns_with_speed
from ..constraints.constraints import close, delassus, driven_power, located, respond, settle
from ..constraints.proximal import solve_proximal
from ..forces import knot_after
from ..motion import opened
from ..stepping.batch import call_advance
from ..stepping.explicit import combine, semi_implicit_step
from ..stepping.state import STEP_ROUNDS, copied, rate_of, size_of_state
from ..tree.articulated import inboard, joint_acceleration
from ..tree.kinematics import outboard
from ..tree.moving import normalise_all
from . import block as of
from .block import TAKEN as STEPS
from .block import take_drives
from .step import BY_ITSELF, IN_LANES, LEAST_INSTANCES, OUT, act, exchange, is_running, load_run


class Held(NamedTuple):
    """Arrays for the kernels of a block with constraints, with the lane as the last axis."""

    const: Any  # (n + 1, CONST) of the bodies
    work: Any  # (n + 1, WORK)
    vectors: Any  # (VECTORS of a block, nv)
    drives: Any  # (nd, DRIVE)
    knots: Any  # (nk, 4) knots of the drives' tables, at the same times in all lanes
    stages: Any  # like `Run.stages`
    lane: Any  # (1, LANE) numbers of the lane
    blocks_f: Any  # like `Blocks.blocks_f`
    y: Any  # this and the following like Workspace
    omega: Any
    factor: Any
    place: Any
    rows: Any
    linear: Any
    carried: Any
    nulls: Any
    counts: Any  # (4, 1) iterations and rounds


ARRAYS = len(Held._fields)
SOLVED, ALL_SOLVED, ROUNDS, ALL_ROUNDS = range(4)  # iterations and rounds: of a step, of all


# -- slopes and steps ------------------------------------------------------------------------------


@part
def set_inputs(table, times, h, t):
    """Set the targets and torques of the drives at time t, from tables with several knots."""
    for n in range(table.shape[0]):
        one = table[n]
        if one.coordinate >= 0 and one.targets > 1:
            h.drives[n, of.D_TARGET] = between(times, h.knots, one.first_target, one.targets, t)
        if one.torques > 1:
            h.drives[n, of.D_TORQUE] = between(times, h.knots, one.first_torque, one.torques, t)


@part
def between(times, knots, first, count, t):
    """Compute `forces.lookup` for per-lane values at shared times."""
    last = first + count - 1
    if t <= times[first, 0]:
        return knots[first, 1]
    if not t < times[last, 0]:
        return knots[last, 1]
    n = knot_after(times, first, count, t, times[last, 2]) - 1
    return knots[n, 1] + (t - times[n, 0]) * knots[n, 2]


@sweep
def slope(data, drives, blocks, space, h, size, t, row, out):
    """Compute v' and powers at the state in `row` into row `out`. Returns μ and the null slots."""
    nq, nv = size
    rows, const, work, lane = data.rows, h.const, h.work, h.lane[0]
    rhs, stages = h.rows[RHS], h.stages
    q, v = stages[row, :nq], stages[row, nq : nq + nv]
    vdot = stages[out, nq : nq + nv]
    set_inputs(data.drives.table, data.drives.knots, h, t)
    act(drives, h, q, v)
    outboard(rows, const, work, q, v)
    inboard(rows, const, work, h.vectors[of.TAU])
    joint_acceleration(rows, const, work, vdot)
    m = located(rows, const, blocks, work, space, v, turns_with_speed(blocks))
    residual_acceleration(blocks, work, space, t, vdot, rhs)
    for r in range(m):
        rhs[r] = -rhs[r]
    mu, count = delassus(rows, const, blocks, work, space, m, lane[of.LIVES])
    for i in range(nq):
        h.rows[PLACED, i] = q[i]
    h.counts[SOLVED, 0] += solve_proximal(space, mu, count, m, 0.0, lane[of.LIVES])
    respond(rows, const, blocks, work, space)
    for j in range(nv):
        vdot[j] += h.rows[RESPONSE, j]
    stages[out, nq + nv] = lane[of.PUT_IN] + driven_power(blocks, space, v)
    stages[out, nq + nv + 1] = lane[of.LOST]
    return mu, count


@sweep
def step(data, drives, blocks, space, h, tableau, size, t, end, width):
    """Take one step from Y into CANDIDATE, and project it onto the constraints at its end."""
    a, weights, c = tableau
    rows, stages, lane = data.rows, h.stages, h.lane[0]
    n, count = stages.shape[1], weights.shape[0]
    h.counts[SOLVED, 0] = 0.0
    mu, slots = slope(data, drives, blocks, space, h, size, t, at.Y, at.SLOPE)
    if count == 0:
        semi_implicit_step(rows, size, width, stages)
    else:
        rate_of(rows, size, stages, at.Y, at.SLOPE)
        copied(stages, at.SLOPE, at.STAGE, n)
        copied(stages, at.Y, at.FROM, n)
        for r in range(1, count):
            combine(stages, a[r], r, width, at.TRIAL)
            rate_of(rows, size, stages, at.TRIAL, at.STAGE + r)
            x = t + c[r] * width
            mu, slots = slope(data, drives, blocks, space, h, size, x, at.TRIAL, at.STAGE + r)
        combine(stages, weights, count, width, at.CANDIDATE)
    normalise_all(rows, stages[at.CANDIDATE, : size[0]])
    const, work, lives = h.const, h.work, lane[of.LIVES]
    q, v = stages[at.CANDIDATE, : size[0]], stages[at.CANDIDATE, size[0] : size[0] + size[1]]
    settled = settle(rows, const, blocks, work, space, end, q, v, mu, slots, lives)
    left = without(lives, settled)
    rounds, failed = close(rows, const, blocks, work, space, end, q, v, STEP_ROUNDS, left)
    h.counts[ROUNDS, 0] = settled + rounds
    sum_ = 0.0 * lane[of.LIVES]
    for i in range(n):
        sum_ += 0.0 * stages[at.CANDIDATE, i]
    lane[of.ALONE] = either(failed, without(lives, most(abs(sum_), 0.0)))


# -- blocks of instances ---------------------------------------------------------------------------


@sweep
def take_in(run, drives, h, w):
    """Copy the instance in the run into lane w. Returns True if lanes can take its steps."""
    this = opened_run(run)
    data, control, y = opened(this.scene), this.control[0], this.stages[at.Y]
    knots, blocks_f, lane = data.drives.knots, data.blocks.blocks_f, h.lane[0]
    take_drives(data, drives, h, w)
    for k in range(knots.shape[0]):
        for c in range(knots.shape[1]):
            h.knots[k, c, w] = knots[k, c]
    for i in range(blocks_f.shape[0]):
        for c in range(blocks_f.shape[1]):
            h.blocks_f[i, c, w] = blocks_f[i, c]
    far = 0.0
    for i in range(y.shape[0]):
        h.stages[at.Y, i, w] = y[i]
    for i in range(control.nq):
        far = max(far, abs(y[i]))
    for j in range(control.nv):
        h.vectors[of.PUSHED, j, w] = data.given[j]
    h.counts[ALL_SOLVED, 0, w] = 0.0
    h.counts[ALL_ROUNDS, 0, w] = 0.0
    lane[of.ORIGIN, w] = control.origin
    lane[STEPS, w] = control.taken
    smooth = True  # lanes take whole steps: none may end at a corner of a table
    for t in this.corners:
        smooth = smooth and t <= control.origin + control.taken * control.widest
    whole = control.done == 0.0 and control.fired == 0 and control.bound == math.inf
    return far < FAR and whole and smooth


@sweep
def put_out(run, h, w, taken, evaluations):
    """Copy lane w back into the run after the steps taken since `take_in`."""
    this = opened_run(run)
    data, control, counters = opened(this.scene), this.control[0], this.counters[0]
    y = this.stages[at.Y]
    for i in range(y.shape[0]):
        y[i] = h.stages[at.Y, i, w]
    control.old_time = control.origin + (control.taken + taken - 1) * control.widest
    control.taken += taken
    control.left -= taken
    control.time = control.origin + control.taken * control.widest
    control.old_width = control.widest
    control.filled = 0
    control.rejected = 0
    control.fresh = 0
    control.clip = math.inf
    counters.steps += taken
    counters.evaluations += taken * evaluations
    counters.solver_iterations += int(h.counts[ALL_SOLVED, 0, w])
    counters.projections += int(h.counts[ALL_ROUNDS, 0, w])
    data.space.vectors[FACTORED, 2] = 0.0


@part
def as_lanes(x):
    return Held(
        lanes(x[0]), lanes(x[1]), lanes(x[2]), lanes(x[3]), lanes(x[4]), lanes(x[5]), lanes(x[6]),
        lanes(x[7]), lanes(x[8]), lanes(x[9]), lanes(x[10]), lanes(x[11]), lanes(x[12]),
        lanes(x[13]), lanes(x[14]), lanes(x[15]), lanes(x[16]),
    )  # fmt: skip


@part
def as_numbers(x):
    return Held(
        x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13],
        x[14], x[15], x[16],
    )  # fmt: skip


HELD = group(*[F3] * ARRAYS)
TABLEAU = group(F2, F1, F1)


@kernel(
    void(i8, i8, i8, I2, I2, I2, HELD, TABLEAU, I2, I2, I1, I1, F3, i8, i8, i8),
    nogil=True, later=True, lanes=True,
)  # fmt: skip
def step_loops(
    run, advance, copy, own, numbers, drives, held, tableau, state, tables, kind, codes, trace, n,
    first, end,
):  # fmt: skip
    """Run `batch.step_instances` in lanes as far as possible.

    `trace` (n, instances, nq + nv) takes the states after each step, (0, 0, 0) for none.
    """
    while first < end:
        step_block(
            run, advance, copy, own, numbers, drives, held, tableau, state, tables, kind, codes,
            trace, n, first, min(first + of.W, end),
        )  # fmt: skip
        first += of.W


@sweep
def step_block(
    run, advance, copy, own, numbers, drives, held, tableau, state, tables, kind, codes, trace, n,
    first, end,
):  # fmt: skip
    """Take n steps of one block."""
    this = opened_run(run)
    data, size = opened(this.scene), size_of_state(run)
    h, s = as_lanes(held), as_numbers(held)
    old, kept = data.blocks, data.space
    blocks = Blocks(old.blocks_i, h.blocks_f, old.terms_i, old.terms_f, old.curves, old.active)
    space = Workspace(
        h.y, kept.slots, h.omega, h.factor, h.place, h.rows, h.linear, h.carried, kept.watch,
        kept.dips, kept.dip_states, h.nulls, kept.where, kept.own,
    )  # fmt: skip
    since, how, lane = state[0], state[1], s.lane[0]
    evaluations = max(tableau[1].shape[0], 1)
    traced = trace.shape[0] > 0
    least = 1 if traced else LEAST_INSTANCES
    running = 0
    for i in range(first, end):
        running += 1 if is_running(codes, i) else 0
    for w in range(of.W):
        i = min(first + w, end - 1)
        since[w] = 0
        how[w] = OUT
        if first + w < end and is_running(codes, i) and running < least:
            load_run(copy, own, numbers, tables, kind, i)
            codes[i] = call_advance(advance, (run, n))
            exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
        elif running >= least:
            load_run(copy, own, numbers, tables, kind, i)
            good = take_in(run, drives, s, w)
            if first + w < end and is_running(codes, i):
                how[w] = IN_LANES if good else BY_ITSELF
    if running < least:
        return
    width = this.control[0].widest
    alone, left = 0, 0
    for k in range(n):
        leads = -1  # the lane whose time is that of all in lanes
        for w in range(of.W):
            if how[w] == IN_LANES and leads < 0:
                leads = w
            same = (
                lane[of.ORIGIN, w] == lane[of.ORIGIN, leads]
                and lane[STEPS, w] == lane[STEPS, leads]
            )
            lane[of.LIVES, w] = 1.0 if how[w] == IN_LANES and same else 0.0
        if leads >= 0:
            t = lane[of.ORIGIN, leads] + lane[STEPS, leads] * width
            end_ = lane[of.ORIGIN, leads] + (lane[STEPS, leads] + 1.0) * width
            step(data, drives, blocks, space, h, tableau, size, t, end_, width)
            good = without(h.lane[0, of.LIVES], h.lane[0, of.ALONE])
            for c in range(2):
                h.counts[2 * c + 1, 0] += chosen(good, h.counts[2 * c, 0], 0.0)
            for i in range(h.stages.shape[1]):
                h.stages[at.Y, i] = chosen(good, h.stages[at.CANDIDATE, i], h.stages[at.Y, i])
        for w in range(of.W):
            i = first + w
            if lane[of.LIVES, w] == 1.0 and lane[of.ALONE, w] == 0.0:
                since[w] += 1
                lane[STEPS, w] += 1.0
            elif how[w] != OUT:
                alone += 1
                load_run(copy, own, numbers, tables, kind, i)
                if since[w] > 0:
                    put_out(run, s, w, since[w], evaluations)
                codes[i] = call_advance(advance, (run, 1))
                exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
                since[w] = 0
                good_one = take_in(run, drives, s, w)
                how[w] = OUT
                if is_running(codes, i):
                    how[w] = IN_LANES if good_one else BY_ITSELF
            if traced and i < end:
                for c in range(trace.shape[2]):
                    trace[k, i, c] = s.stages[at.Y, c, w]
        if not traced and k >= 2 and 2 * alone > running * (k + 1):
            left = n - 1 - k  # lanes do not pay here
            break
    for w in range(of.W):
        i = first + w
        if how[w] != OUT and (since[w] > 0 or left > 0):
            load_run(copy, own, numbers, tables, kind, i)
            if since[w] > 0:
                put_out(run, s, w, since[w], evaluations)
            if left > 0:
                codes[i] = call_advance(advance, (run, left))
            exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
