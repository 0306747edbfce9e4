"""Explicit steps in lanes for trees and for loops closed by constraints.

The steps are those of `explicit` and `constraints`, with the same operations in the same order, so
every lane has the bits of its own run. Rare cases are not written twice. If the factors of its last
stage do not return a lane to its constraints, or null directions appear late, its step is
discarded and taken by the kernels of one instance.
"""

import math
from typing import Any, NamedTuple

from .. import layout as at
from ..arrays import CHANGE, FACTORED, LAMBDA, PLACED, RHS, Blocks, Workspace, opened_run
from ..arrays import STEP as RESPONSE
from ..compiler.elementary import FAR
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, F3, I1, I2, group, i8, void
from ..compiler.lane import lanes
from ..compiler.masks import any_of, both, chosen, either, larger, more, most, without
from ..constraints.blocks import (
    locate,
    residual,
    residual_acceleration,
    residual_velocity,
    turns_with_speed,
    velocities,
)
from ..constraints.constraints import (
    CLOSED,
    NEAR,
    NO_GAP,
    SMALL_MOVE,
    couplings,
    driven_power,
    number_rows,
    respond,
    unit_responses,
)
from ..constraints.proximal import (
    NULL,
    PROXIMAL,
    REFINEMENTS,
    SMALL,
    begin_null,
    eliminate,
    inner,
    load_factor3,
    normalise,
    remainder,
    solve_factor,
    store_factor3,
    take_out,
    whole_blocks,
)
from ..forces import knot_after
from ..linear import factor3
from ..motion import opened
from ..rows import origin_of
from ..stepping.batch import call_advance
from ..stepping.explicit import combine, semi_implicit_step
from ..stepping.state import STEP_ROUNDS, copied, rate_of, size_of_state
from ..tree.articulated import inboard, joint_acceleration
from ..tree.kinematics import frames, outboard, positions
from ..tree.moving import advance, normalise_all
from . import block as of
from .block import TAKEN as STEPS
from .block import move_on, take_drives
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
    marks: Any  # (2, m) which pivots are small, whose directions are null
    counts: Any  # (4, 1) iterations and rounds
    moved: Any  # (3, max(nq, nv)) states on their way onto the constraints


ARRAYS = len(Held._fields)
SMALL_ONE, IS_NULL = 0, 1  # rows of `marks`
SOLVED, ALL_SOLVED, ROUNDS, ALL_ROUNDS = range(4)  # iterations and rounds: of a step, of all


# -- Ω λ = r ---------------------------------------------------------------------------------------


@sweep
def factor_proximal(h, m):
    """Run `proximal.factor_proximal`. Returns μ and the slots of null directions, or zero."""
    omega, factor, nulls, marks, lives = h.omega, h.factor, h.nulls, h.marks, h.lane[0, of.LIVES]
    trace = 0.0
    for r in range(m):
        trace += omega[r, r]
    mu = chosen(more(trace, 0.0), PROXIMAL * trace / m, 1.0)
    end = whole_blocks(m)
    for r in range(m, end):
        for c in range(end):
            omega[r, c] = 0.0
            omega[c, r] = 0.0
    for r in range(end):
        for c in range(end):
            factor[r, c] = omega[r, c]
        factor[r, r] = factor[r, r] + (mu if r < m else 1.0)
    count = 0
    for i in range(0, end, 3):
        f = factor3(load_factor3(factor, i))
        store_factor3(factor, i, f)
        for n in range(3):
            x = f[n] * (SMALL * mu)
            small = without(lives, both(more(x, 0.0), more(1.0 + 0.0 * x, x)))
            if i + n < m and any_of(small):
                begin_null(factor, f, i, n, nulls[count], end)
                marks[SMALL_ONE, count] = small
                count += 1
        for j in range(i + 3, end, 3):
            eliminate(factor, f, i, j, end)
    for n in range(count):
        keep(nulls[n], marks[SMALL_ONE, n], end)
        solve_factor(factor, nulls[n], m)
        for other in range(n):
            take_out(nulls, other, nulls[n], end)
        growth = normalise(nulls[n], end)
        marks[IS_NULL, n] = both(marks[SMALL_ONE, n], more(growth * NULL * mu, 1.0))
        keep(nulls[n], marks[IS_NULL, n], end)
    return mu, count


@part
def keep(x, mask, end):
    """Return x where the mask is set, and zero elsewhere."""
    for r in range(end):
        x[r] = chosen(mask, x[r], 0.0)


@sweep
def solve_proximal(h, mu, count, m, enough, asked):
    """Run `proximal.solve_proximal` in lanes `asked`. One with late null directions goes alone."""
    omega, factor, nulls, lane = h.omega, h.factor, h.nulls, h.lane[0]
    rhs, lam, change = h.rows[RHS], h.rows[LAMBDA], h.rows[CHANGE]
    end = whole_blocks(m)
    for r in range(m, end):
        rhs[r] = 0.0
    for n in range(count):
        take_out(nulls, n, rhs, end)
    for r in range(end):
        lam[r] = rhs[r]
    size = solve_factor(factor, lam, m)
    last = size
    refined = without(asked, most(mu * size, enough))
    open_ = both(refined, more(last, 0.0))
    taken = 1.0 + 0.0 * mu
    for _ in range(1, REFINEMENTS):
        if not any_of(open_):
            break
        remainder(omega, rhs, lam, change, end)
        largest = solve_factor(factor, change, m)
        taken = taken + open_
        stays = without(open_, more(0.5 * last, largest))
        late = both(stays, more(largest, 1e-9 * size))
        lane[of.ALONE] = either(lane[of.ALONE], late)
        open_ = without(open_, stays)
        for r in range(end):
            lam[r] = chosen(open_, lam[r] + change[r], lam[r])
        open_ = without(open_, most(largest * (largest / last), 1e-16 * size))
        last = chosen(open_, largest, last)
        open_ = both(open_, more(last, 0.0))
    for n in range(count):
        along = chosen(refined, inner(nulls[n], lam, end), 0.0)
        for r in range(end):
            lam[r] -= along * nulls[n, r]
    return taken


@part
def along_nulls(h, count, x, m):
    """Compute `proximal.along_nulls`."""
    size = 0.0 * x[0]
    for n in range(count):
        size = larger(size, abs(inner(h.nulls[n], x, whole_blocks(m))))
    return size


@part
def largest_of(x, m):
    """Return the largest magnitude of the first m numbers."""
    size = 0.0 * x[0]
    for r in range(m):
        size = larger(size, abs(x[r]))
    return size


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
    m = located(rows, blocks, space, h, v, turns_with_speed(blocks))
    residual_acceleration(blocks, work, space, t, vdot, rhs)
    for r in range(m):
        rhs[r] = -rhs[r]
    unit_responses(rows, const, blocks, work, space)
    couplings(blocks, space)
    mu, count = factor_proximal(h, m)
    for i in range(nq):
        h.rows[PLACED, i] = q[i]
    h.counts[SOLVED, 0] += solve_proximal(h, mu, count, m, 0.0, lane[of.LIVES])
    respond(rows, const, blocks, work, space)
    for j in range(nv):
        vdot[j] += h.rows[RESPONSE, j]
    stages[out, nq + nv] = lane[of.PUT_IN] + driven_power(blocks, space, v)
    stages[out, nq + nv + 1] = lane[of.LOST]
    return mu, count


@part
def located(rows, blocks, space, h, v, moving):
    """Run `constraints.located`."""
    positions(rows, h.work)
    if moving:
        velocities(rows, h.const, h.work, v, h.linear)
    locate(blocks, h.work, h.place)
    return number_rows(blocks, space.slots)


@sweep
def step(data, drives, blocks, space, h, tableau, size, t, end, width):
    """Take one step from Y into CANDIDATE, and project it onto the constraints at its end."""
    a, weights, c = tableau
    rows, stages, lane = data.rows, h.stages, h.lane[0]
    n, count = stages.shape[1], weights.shape[0]
    lane[of.ALONE] = 0.0
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
    settled = settle(rows, blocks, space, h, size, end, mu, slots)
    h.counts[ROUNDS, 0] = settled
    project(
        rows, blocks, space, h, size, end, without(lane[of.LIVES], either(settled, lane[of.ALONE]))
    )
    sum_ = 0.0 * lane[of.LIVES]
    for i in range(n):
        sum_ += 0.0 * stages[at.CANDIDATE, i]
    lane[of.ALONE] = either(lane[of.ALONE], without(lane[of.LIVES], most(abs(sum_), 0.0)))


@sweep
def settle(rows, blocks, space, h, size, t, mu, count):
    """Run `constraints.settle` on CANDIDATE, leaving it unchanged where that fails."""
    nq, nv = size
    const, work, lives, step = h.const, h.work, h.lane[0, of.LIVES], h.rows[RESPONSE]
    q, v = h.stages[at.CANDIDATE, :nq], h.stages[at.CANDIDATE, nq : nq + nv]
    rhs, change, new, old = h.rows[RHS], h.moved[0], h.moved[1], h.moved[2]
    moved = 0.0 * lives
    for i in range(nq):
        moved = larger(moved, abs(q[i] - h.rows[PLACED, i]))
    near = both(lives, more(NEAR + 0.0 * moved, moved))
    if not any_of(near):
        return near
    frames(rows, const, work, q, v)
    m = located(rows, blocks, space, h, v, True)
    rounding = NO_GAP * extent(rows, h)
    residual_velocity(blocks, work, space, t, v, rhs)
    missed = along_nulls(h, count, rhs, m)
    correct(rows, blocks, space, h, mu, count, m, rounding, near)
    for j in range(nv):
        change[j] = step[j]
    missed = larger(missed, moved * largest_of(change, nv))
    residual(blocks, work, space, t, q, rhs)
    opened_ = both(near, more(largest_of(rhs, m), rounding))
    for i in range(nq):
        old[i] = q[i]
    if any_of(opened_):
        far = larger(missed, along_nulls(h, count, rhs, m))
        correct(rows, blocks, space, h, mu, count, m, rounding, opened_)
        length = largest_of(step, nv)
        missed = chosen(opened_, larger(far, moved * length), missed)
        near = without(near, without(opened_, more(SMALL_MOVE + 0.0 * length, length)))
        move(rows, h, q, new, opened_)
    good = both(near, most(missed, rounding))
    for i in range(nq):
        q[i] = chosen(good, q[i], old[i])
    for j in range(nv):
        v[j] = chosen(good, v[j] + change[j], v[j])
    return good


@part
def move(rows, h, q, new, where):
    """Move q along the response in the lanes of the mask."""
    for i in range(q.shape[0]):
        new[i] = q[i]
    advance(rows, new, h.rows[RESPONSE], 1.0)
    for i in range(q.shape[0]):
        q[i] = chosen(where, new[i], q[i])


@sweep
def project(rows, blocks, space, h, size, t, asked):
    """Run `constraints.project` on CANDIDATE. Lanes that fail continue alone."""
    nq, nv = size
    const, work, lane, step, tau = h.const, h.work, h.lane[0], h.rows[RESPONSE], h.vectors[of.TAU]
    q, v = h.stages[at.CANDIDATE, :nq], h.stages[at.CANDIDATE, nq : nq + nv]
    rhs, open_ = h.rows[RHS], asked
    for _ in range(STEP_ROUNDS):
        if not any_of(open_):
            return
        h.counts[ROUNDS, 0] += open_
        for j in range(nv):
            tau[j] = 0.0
        outboard(rows, const, work, q, v)
        inboard(rows, const, work, tau)
        m = located(rows, blocks, space, h, v, True)
        unit_responses(rows, const, blocks, work, space)
        couplings(blocks, space)
        mu, count = factor_proximal(h, m)
        residual_velocity(blocks, work, space, t, v, rhs)
        correct(rows, blocks, space, h, mu, count, m, 0.0, open_)
        for j in range(nv):
            v[j] = chosen(open_, v[j] + step[j], v[j])
        residual(blocks, work, space, t, q, rhs)
        gap, far = largest_of(rhs, m), extent(rows, h)
        open_ = both(open_, more(gap, NO_GAP * far))
        correct(rows, blocks, space, h, mu, count, m, 0.0, open_)
        move(rows, h, q, h.moved[1], open_)
        still = both(open_, more(SMALL_MOVE + 0.0 * gap, largest_of(step, nv)))
        lane[of.ALONE] = either(lane[of.ALONE], both(still, more(gap, CLOSED * far)))
        open_ = without(open_, either(still, lane[of.ALONE]))
    lane[of.ALONE] = either(lane[of.ALONE], open_)


@part
def correct(rows, blocks, space, h, mu, count, m, enough, asked):
    """Run `constraints.correct`."""
    for r in range(m):
        h.rows[RHS, r] = -h.rows[RHS, r]
    solve_proximal(h, mu, count, m, enough, asked)
    respond(rows, h.const, blocks, h.work, space)


@part
def extent(rows, h):
    """Compute `constraints.extent`."""
    size = 0.0 * h.lane[0, of.LIVES]
    for k in range(1, rows.shape[0]):
        p = origin_of(h.work, k)
        size = larger(size, larger(abs(p[0]), larger(abs(p[1]), abs(p[2]))))
    for i in range(h.blocks_f.shape[0]):
        for n in range(6):
            size = larger(size, abs(h.blocks_f[i, n]))
    return size


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
    counters = this.counters[0]
    y = this.stages[at.Y]
    for i in range(y.shape[0]):
        y[i] = h.stages[at.Y, i, w]
    move_on(run, taken, taken * evaluations)
    counters.solver_iterations += int(h.counts[ALL_SOLVED, 0, w])
    counters.projections += int(h.counts[ALL_ROUNDS, 0, w])
    opened(this.scene).space.vectors[FACTORED, 2] = 0.0


@part
def as_lanes(x):
    return Held(
        lanes(x[0]), lanes(x[1]), lanes(x[2]), lanes(x[3]), lanes(x[4]), lanes(x[5]), lanes(x[6]),
        lanes(x[7]), lanes(x[8]), lanes(x[9]), lanes(x[10]), lanes(x[11]), lanes(x[12]),
        lanes(x[13]), lanes(x[14]), lanes(x[15]), lanes(x[16]), lanes(x[17]), lanes(x[18]),
    )  # fmt: skip


@part
def as_numbers(x):
    return Held(
        x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13],
        x[14], x[15], x[16], x[17], x[18],
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
