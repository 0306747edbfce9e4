"""Moreau-Jean steps for instances side by side in lanes: trees on feet above a plane.

The steps perform the same operations as `moreau` in the same order, so that the result of each lane
is bit-identical to a single run. Rare cases are not implemented for lanes. If a lane has an impact,
a penetration, or a problem that sweeps cannot solve, its step is repeated by the kernels for single
instances.
"""

import math

from ...tolerances import TINY
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F3, I1, I2, group, i8, void
from ..compiler.lane import LANE_WIDTH
from ..compiler.masks import any_of, both, chosen, either, larger, more, most, smaller, without
from ..constraints.blocks import velocities
from ..constraints.paths import pivots, spread, unspread
from ..contact.contacts import STILL
from ..contact.coulomb import only
from ..motion import opened, user_torque
from ..records import ACCEPTANCE, CREEP, STANCE, SWING
from ..rows import (
    origin_of,
    parent_of,
    rotation_of,
    spin_of,
)
from ..stepping.armatures import corrections, relax, soften, stiffen
from ..stepping.batch import call_advance, call_copy
from ..stepping.booking import goes_on_sliding
from ..stepping.row_speeds import turn_rates
from ..stepping.state import size_of_state
from ..tree.articulated import inboard, inboard_again, joint_acceleration
from ..tree.kinematics import outboard, outboard_again, positions
from ..tree.moving import advance, normalise_all
from ..tree.spinning import GYRATES
from ..vec import accumulate, add_scaled, cross, dot, load, mul, sub
from . import block as of
from .block import in_lanes, named_block, put_out, take_in
from .feet import (
    aim,
    carry,
    directions,
    effects,
    find,
    gain_and_miss,
    gauss_seidel,
    own_block,
    push_out,
    turned,
    warm,
)
from .walk import ALL, call_walk


@sweep
def begin(rows, drives, b, h):
    """Compute the first half of a step, including the frames at its midpoint."""
    x = b.vectors
    for i in range(x.shape[1]):
        x[of.VECTOR.new_q, i] = x[of.VECTOR.q, i]
        x[of.VECTOR.new_v, i] = x[of.VECTOR.v, i]
        x[of.VECTOR.mean, i] = x[of.VECTOR.v, i]
    q, v = x[of.VECTOR.new_q], x[of.VECTOR.v]
    b.lane[0, of.LANE.swept] = 0.0
    b.lane[0, of.LANE.alone] = 0.0
    b.lane[0, of.LANE.open] = 0.0
    advance(rows, q, v, 0.5 * h)
    stiffen_drives(rows, drives, b, h, q, v)
    act(drives, b, q, v)
    outboard(rows, b.const, b.work, q, v)


@sweep
def begin_again(rows, drives, b, h, kept):
    """Compute velocities and forces at the mean velocity of the first pass.

    If `kept`, the frames and inertias of that pass are used again.
    """
    x, work = b.vectors, b.work
    q, v, mean = x[of.VECTOR.new_q], x[of.VECTOR.v], x[of.VECTOR.mean]
    for j in range(x.shape[1]):
        mean[j] = v[j] + 0.5 * (h * x[of.VECTOR.vdot, j] + x[of.VECTOR.move, j])
    own, pushed, dinv = x[of.VECTOR.given], x[of.VECTOR.pushed], x[of.VECTOR.dinv]
    damping, stiffness = x[of.VECTOR.damping], x[of.VECTOR.stiffness]
    soften(rows, work, h, v, mean, damping, stiffness, own, pushed, dinv)
    act(drives, b, q, mean)
    if kept:
        outboard_again(rows, b.const, work, mean)
    else:
        outboard(rows, b.const, work, q, mean)


@sweep
def stiffen_drives(rows, drives, b, h, q, v):
    """Run `moreau.stiffen_drives`."""
    x = b.vectors
    for j in range(x.shape[1]):
        x[of.VECTOR.damping, j] = 0.0
        x[of.VECTOR.stiffness, j] = 0.0
        x[of.VECTOR.driven, j] = 0.0
        x[of.VECTOR.pushed, j] = x[of.VECTOR.given, j]
    for n in range(drives.shape[0]):
        j, i = drives[n, 0], drives[n, 1]
        d = b.drives[n]
        if drives[n, 2] != 1:
            x[of.VECTOR.driven, j] += TINY
        torque = -d[of.DRIVE.damping] * v[j]
        if i >= 0:
            torque += d[of.DRIVE.stiffness] * (d[of.DRIVE.target] - q[i])
        torque += d[of.DRIVE.torque]
        limited = either(more(d[of.DRIVE.low], torque), more(torque, d[of.DRIVE.high]))
        counts = without(more(d[of.DRIVE.damping], 0.0), limited)
        x[of.VECTOR.damping, j] += chosen(counts, d[of.DRIVE.damping], 0.0)
        if drives[n, 2] != 1:
            x[of.VECTOR.driven, j] += chosen(counts, d[of.DRIVE.damping], 0.0)
        if i >= 0:
            x[of.VECTOR.stiffness, j] += chosen(counts, d[of.DRIVE.stiffness], 0.0)
    damping, stiffness, pushed = x[of.VECTOR.damping], x[of.VECTOR.stiffness], x[of.VECTOR.pushed]
    driven, own = x[of.VECTOR.driven], x[of.VECTOR.armature]
    stiffen(rows, b.const, h, v, damping, stiffness, driven, own, pushed)


@sweep
def act(drives, b, q, v):
    """Run `forces.drive` for drives with one coordinate and no tables."""
    x, lane = b.vectors, b.lane[0]
    tau, given = x[of.VECTOR.tau], x[of.VECTOR.pushed]
    lane[of.LANE.put_in] = 0.0
    lane[of.LANE.lost] = 0.0
    put_in, lost = lane[of.LANE.put_in], lane[of.LANE.lost]
    for j in range(tau.shape[0]):
        tau[j] = given[j]
        put_in += given[j] * v[j]
    for n in range(drives.shape[0]):
        j, i = drives[n, 0], drives[n, 1]
        d = b.drives[n]
        speed = v[j]
        drag = d[of.DRIVE.damping] * speed
        friction = d[of.DRIVE.friction] * speed / math.sqrt(speed * speed + CREEP * CREEP)
        drag = chosen(more(d[of.DRIVE.friction], 0.0), drag + friction, drag)
        torque = -drag
        if i >= 0:
            torque += d[of.DRIVE.stiffness] * (d[of.DRIVE.target] - q[i])
        if drives[n, 2] == 1:
            lost += drag * speed
        else:
            torque += d[of.DRIVE.torque]
            torque = smaller(larger(torque, d[of.DRIVE.low]), d[of.DRIVE.high])
            put_in += torque * speed
        tau[j] += torque
    lane[of.LANE.put_in] = put_in
    lane[of.LANE.lost] = lost


@sweep
def set_velocities(rows, ways, near, b, h):
    """Write J v into BEFORE and J (v + h v') into RATE, as in `moreau.set_velocities`."""
    x, work, linear, points = b.vectors, b.work, b.linear, b.points
    turned(rows, ways, near, b, h)
    turn_rates(rows, b.const, work, x[of.VECTOR.v])
    velocities(rows, b.const, work, x[of.VECTOR.v], linear)
    directions(ways, near, b, of.POINT.before)
    for j in range(x.shape[1]):
        x[of.VECTOR.effect, j] = x[of.VECTOR.v, j] + h * x[of.VECTOR.vdot, j]
    turn_rates(rows, b.const, work, x[of.VECTOR.effect])
    velocities(rows, b.const, work, x[of.VECTOR.effect], linear)
    directions(ways, near, b, of.POINT.rate)
    for m in range(near[0]):
        n = near[1 + m]
        for r in range(3):
            points[n, of.POINT.before + r] -= points[n, of.POINT.turned + r]
            points[n, of.POINT.rate + r] += points[n, of.POINT.turned + r]
    for j in range(x.shape[1]):
        x[of.VECTOR.speeds, j] = x[of.VECTOR.effect, j]
    unspread(rows, b.const, work, x[of.VECTOR.speeds])


@sweep
def solve(rows, ways, near, b, h, again, kept):
    """Run a pass of a step, and write v' into VDOT and the effect of impulses into MOVE.

    Sets ALONE for lanes that must continue individually. Returns whether points touch in any lane.
    """
    x, lane, work, const, linear = b.vectors, b.lane[0], b.work, b.const, b.linear
    vdot = x[of.VECTOR.vdot]
    if kept:
        inboard_again(rows, const, work, x[of.VECTOR.tau])
    else:
        inboard(rows, const, work, x[of.VECTOR.tau])
    joint_acceleration(rows, const, work, vdot)
    positions(rows, work)
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        if p > 0:
            w, u = spin_of(work, k), spin_of(work, p)
            most_turn = larger(dot(w, w), dot(u, u)) * h * h
            lane[of.LANE.alone] = either(lane[of.LANE.alone], more(most_turn, GYRATES * GYRATES))
    if not again:
        velocities(rows, const, work, x[of.VECTOR.v], linear)
        find(ways, near, b, h)
    some = any_of(touching(near, b))
    for j in range(x.shape[1]):
        x[of.VECTOR.effect, j] = 0.0
        x[of.VECTOR.move, j] = 0.0
    if some:
        set_velocities(rows, ways, near, b, h)
        if not again:
            pivots(rows, work, x[of.VECTOR.dinv])
            for m in range(near[0]):
                n = near[1 + m]
                carry(rows, ways, b, n)
                own_block(ways, b, n)
                warm(b, n)
        aim(ways, near, b, again)
        gauss_seidel(ways, near, b)
        gain_and_miss(ways, near, b)
        effects(ways, near, b)
        for j in range(x.shape[1]):
            x[of.VECTOR.move, j] = x[of.VECTOR.effect, j]
        spread(rows, const, work, x[of.VECTOR.move])
    return some


@part
def touching(near, b):
    """Return the lanes in which a point is active."""
    touches = b.lane[0, of.LANE.count] * 0.0
    for m in range(near[0]):
        touches = either(touches, b.points[near[1 + m], of.POINT.active])
    return touches


@sweep
def finish(rows, ways, near, b, h, kept):
    """Finish a step into NEW_Q and NEW_V by its second pass."""
    x, lane = b.vectors, b.lane[0]
    v, vdot, mean_ = x[of.VECTOR.v], x[of.VECTOR.vdot], x[of.VECTOR.mean]
    some = solve(rows, ways, near, b, h, True, kept)
    relax(rows, b.const, x[of.VECTOR.armature])
    x[of.VECTOR.done, 0] = x[of.VECTOR.ledger, 0] + h * lane[of.LANE.put_in]
    x[of.VECTOR.done, 1] = x[of.VECTOR.ledger, 1] + h * lane[of.LANE.lost]
    if some:
        x[of.VECTOR.done, 1] -= chosen(touching(near, b), lane[of.LANE.gained], 0.0)
    new = x[of.VECTOR.new_v]
    for j in range(x.shape[1]):
        new[j] = v[j] + (h * vdot[j] + x[of.VECTOR.move, j])
    zero, softer, driven = lane[of.LANE.count] * 0.0, x[of.VECTOR.stiffness], x[of.VECTOR.driven]
    work, lost = corrections(
        rows, x[of.VECTOR.tau], v, mean_, x[of.VECTOR.damping], softer, driven, h, new, zero
    )
    x[of.VECTOR.done, 0] += work
    x[of.VECTOR.done, 1] += lost
    advance(rows, x[of.VECTOR.new_q], new, 0.5 * h)
    if some:
        push_out(rows, ways, near, b, h)
    sum_ = x[of.VECTOR.done, 0] + x[of.VECTOR.done, 1]
    for i in range(x.shape[1]):
        sum_ += x[of.VECTOR.new_q, i] + new[i]
    lane[of.LANE.alone] = either(
        lane[of.LANE.alone], without(lane[of.LANE.lives], most(abs(sum_), 1e300))
    )
    commit(rows, ways, near, b, h)


@sweep
def commit(rows, ways, near, b, h):
    """Commit state and history after the step as `booking.book`, in lanes that stay together."""
    x, lane, points, pairs = b.vectors, b.lane[0], b.points, b.pairs
    good = without(lane[of.LANE.lives], lane[of.LANE.alone])
    zero = 0.0 * lane[of.LANE.count]
    normalise_all(rows, x[of.VECTOR.new_q])
    for i in range(x.shape[1]):
        x[of.VECTOR.q, i] = chosen(good, x[of.VECTOR.new_q, i], x[of.VECTOR.q, i])
        x[of.VECTOR.v, i] = chosen(good, x[of.VECTOR.new_v, i], x[of.VECTOR.v, i])
    for c in range(2):
        x[of.VECTOR.ledger, c] = chosen(good, x[of.VECTOR.done, c], x[of.VECTOR.ledger, c])
    number, found, touches = zero, zero, zero
    for k in range(pairs.shape[0]):
        for c in range(6):
            pairs[k, of.PAIR.force + c] = zero
        pairs[k, of.PAIR.gap] = zero + math.inf
        pairs[k, of.PAIR.slip] = zero
    for k in range(b.wrenches.shape[0]):
        for c in range(6):
            b.wrenches[k, c] = zero
    for m in range(near[0]):
        n = near[1 + m]
        here = both(good, points[n, of.POINT.active])
        found = found + points[n, of.POINT.found]
        number = number + here
        touches = either(touches, here)
        note_point(ways, b, n, here, h)
        push_body(ways, b, n, here, h)
    for n in range(ways.shape[0]):
        points[n, of.POINT.kept] = chosen(
            good, points[n, of.POINT.active], points[n, of.POINT.kept]
        )
    lane[of.LANE.swept] = chosen(both(good, touches), lane[of.LANE.swept], 0.0)
    note_largest(lane, of.LANE.residual, touches, lane[of.LANE.open])
    lane[of.LANE.number] = chosen(good, number, lane[of.LANE.number])
    lane[of.LANE.count] = chosen(good, found, lane[of.LANE.count])
    lane[of.LANE.elapsed] = chosen(good, lane[of.LANE.elapsed] + h, lane[of.LANE.elapsed])
    share = h / larger(lane[of.LANE.elapsed], h)
    for k in range(pairs.shape[0]):
        change_phase(b, k, good)
        for c in range(6):
            mean, force = pairs[k, of.PAIR.mean + c], pairs[k, of.PAIR.force + c]
            pairs[k, of.PAIR.mean + c] = chosen(good, force + (1.0 - share) * (mean - force), mean)


@part
def note_point(ways, b, n, here, h):
    """Record the residual and depth at point n, and the start of the next step."""
    lane, points = b.lane[0], b.points
    zero, t = 0.0 * lane[of.LANE.count], lane[of.LANE.time] + h
    lam, gap = load(points, n, of.POINT.lam), points[n, of.POINT.gap]
    i, pair = ways[n, of.WAY.shape], ways[n, of.WAY.pair] + zero
    broken, cone = points[n, of.POINT.missed] / h, points[n, of.POINT.missed + 1] / h
    note_largest(lane, of.LANE.complementarity, here, broken)
    note_largest(lane, of.LANE.cone, here, cone)
    note_largest(lane, of.LANE.largest, here, math.sqrt(dot(lam, lam)) / h)
    new = both(here, more(larger(broken, cone), lane[of.LANE.worst]))
    lane[of.LANE.worst] = chosen(new, larger(broken, cone), lane[of.LANE.worst])
    lane[of.LANE.worst_pair] = chosen(new, pair, lane[of.LANE.worst_pair])
    lane[of.LANE.worst_time] = chosen(new, t, lane[of.LANE.worst_time])
    note_largest(lane, of.LANE.penetration, here, -gap)
    note_largest(lane, of.LANE.largest_depth, here, -gap)
    share = -gap / b.shapes[i, of.SHAPE.thick]
    new = both(here, more(share, lane[of.LANE.deepest]))
    lane[of.LANE.deepest] = chosen(new, share, lane[of.LANE.deepest])
    lane[of.LANE.deepest_depth] = chosen(new, -gap, lane[of.LANE.deepest_depth])
    lane[of.LANE.deepest_pair] = chosen(new, pair, lane[of.LANE.deepest_pair])
    lane[of.LANE.deepest_time] = chosen(new, t, lane[of.LANE.deepest_time])
    for c in range(3):
        points[n, of.POINT.value + c] = chosen(here, lam[c], points[n, of.POINT.value + c])
    mu = b.laws[ways[n, of.WAY.pair], 0]
    slides = goes_on_sliding(lam, mu, points[n, of.POINT.rate], points[n, of.POINT.slip])
    points[n, of.POINT.slides] = chosen(here, slides, points[n, of.POINT.slides])


@part
def push_body(ways, b, n, here, h):
    """Add the force at point n to its contact pair and its body."""
    points, pairs, wrenches, work = b.points, b.pairs, b.wrenches, b.work
    pair, k, body = ways[n, of.WAY.pair], ways[n, of.WAY.row], ways[n, of.WAY.body]
    zero, lam = 0.0 * b.lane[0, of.LANE.count], load(points, n, of.POINT.lam)
    force = (zero, zero, zero)
    for c in range(3):
        force = add_scaled(force, lam[c] / h, load(b.lane, 0, of.LANE.normal + 3 * c))
    force = only(here, force)
    pairs[pair, of.PAIR.gap] = smaller(
        pairs[pair, of.PAIR.gap], chosen(here, points[n, of.POINT.gap], math.inf)
    )
    pairs[pair, of.PAIR.slip] = larger(
        pairs[pair, of.PAIR.slip], chosen(here, points[n, of.POINT.slip], 0.0)
    )
    arm = sub(load(points, n, of.POINT.middle), origin_of(work, k))
    offset = mul(rotation_of(work, k), load(b.bodies, body, 0))
    accumulate(pairs, pair, of.PAIR.force, force)
    accumulate(pairs, pair, of.PAIR.torque, cross(sub(arm, offset), force))
    accumulate(wrenches, body, 0, cross(arm, force))
    accumulate(wrenches, body, 3, force)


@part
def change_phase(b, k, good):
    """Update the phase of contact pair k after the step, and count any change."""
    lane, pairs = b.lane[0], b.pairs
    zero = 0.0 * lane[of.LANE.count]
    force, before = load(pairs, k, of.PAIR.force), pairs[k, of.PAIR.phase]
    starts = both(more(before, SWING - 0.5), most(before, ACCEPTANCE + 0.5))
    slips = chosen(starts, ACCEPTANCE + zero, 2.0)
    now = chosen(most(pairs[k, of.PAIR.slip], STILL), STANCE + zero, slips)
    now = chosen(more(dot(force, force), 0.0), now, SWING + zero)
    changed = without(good, both(most(now, before), most(before, now)))
    pairs[k, of.PAIR.phase] = chosen(changed, now, before)
    lane[of.LANE.logged] = lane[of.LANE.logged] + changed


@part
def note_largest(lane, column, here, x):
    lane[column] = chosen(both(here, more(x, lane[column])), x, lane[column])


@part
def exchange(copy, spans, row, out):
    """Copy between a row of a table and the run."""
    for k in range(spans.shape[0]):
        if out:
            call_copy(copy, (row + spans[k, 1], spans[k, 0], spans[k, 2]))
        else:
            call_copy(copy, (spans[k, 0], row + spans[k, 1], spans[k, 2]))


@sweep
def load_run(copy, own, numbers, tables, kind, i):
    """Load the rows of instance i into the run."""
    exchange(copy, numbers, tables[1, 0] + kind[i] * tables[1, 1], False)
    exchange(copy, own, tables[0, 0] + i * tables[0, 1], False)


@sweep
def ask_user(run, b, w, h):
    """Add the result of a user function to τ of lane w."""
    this = opened_run(run)
    data, stages = opened(this.scene), this.stages
    nq, nv = size_of_state(run)
    trial, tau = stages[at.TRIAL], stages[at.TORQUE, :nv]
    q, v = trial[:nq], trial[nq : nq + nv]
    x, lane = b.vectors, b.lane[0]
    for i in range(nq):
        q[i] = x[of.VECTOR.new_q, i, w]
    for j in range(nv):
        v[j] = x[of.VECTOR.mean, j, w]
        tau[j] = x[of.VECTOR.tau, j, w]
    lane[of.LANE.put_in, w] += user_torque(data.user, lane[of.LANE.time, w] + 0.5 * h, q, v, tau)
    for j in range(nv):
        x[of.VECTOR.tau, j, w] = tau[j]


@sweep
def lay_out(work, frames):
    """Compute frames, velocities and inertias of all lanes, one lane after the other."""
    for k in range(work.shape[0]):
        for c in range(at.PROJECTED):
            for w in range(LANE_WIDTH):
                frames[w, k, c] = work[k, c, w]


BLOCK = group(*[F3] * 15)
OUT, IN_LANES, BY_ITSELF = 0, 1, 2  # continuation of an instance of the block
LEAST_INSTANCES = 3  # instances in a block, or each goes by itself


@kernel(
    void(
        i8, i8, i8, I2, I2, i8, I2, I1, I2, BLOCK, F3, I2, I2, I1, I1, *[i8] * 5, F1,
    ),
    nogil=True, later=True, lanes=True,
)  # fmt: skip
def step_lanes(
    run, advance, copy, own, numbers, memory, ways, near, drives, block, frames, state, tables,
    kind, codes, n, first, end, walk, place, fallen,
):  # fmt: skip
    """Run `batch.step_instances` in lanes as far as possible.

    The last `memory` spans of `own` are reserved for a user function. `walk` is the address of
    `walk_in_lanes` if all instances walk, else 0. `place` is the address of its tuple, and `fallen`
    the time of the fall of the instance in the run. The rest are names and scratch.
    """
    while first < end:
        step_block(
            run, advance, copy, own, numbers, memory, ways, near, drives, block, frames, state,
            tables, kind, codes, n, first, min(first + LANE_WIDTH, end), walk, place, fallen,
        )  # fmt: skip
        first += LANE_WIDTH


@part
def is_running(codes, i):
    return codes[i] == at.RUNNING


@part
def count_running(codes, first, end):
    """Count the instances of a block that run."""
    running = 0
    for i in range(first, end):
        running += 1 if is_running(codes, i) else 0
    return running


@sweep
def ask_users(run, runs, s, ways_on, frames, first, loaded, h):
    """Let functions of the users write the torques of the lanes that run together.

    `loaded` is the kind of instance that the run holds, or -1. Returns the one that it holds now.
    """
    copy, own, mine, numbers, tables, kind = runs
    work = opened(opened_run(run).scene).work
    lay_out(s.work, frames)
    size = 8 * at.WORK * work.shape[0]
    for w in range(LANE_WIDTH):
        if ways_on[w] == IN_LANES:
            i = first + w
            row = tables[0, 0] + i * tables[0, 1]
            if kind[i] != loaded:
                load_run(copy, own, numbers, tables, kind, i)
                loaded = kind[i]
            exchange(copy, mine, row, False)
            call_copy(copy, (work.ctypes.data, frames[w].ctypes.data, size))
            ask_user(run, s, w, h)
            exchange(copy, mine, row, True)
    return loaded


@sweep
def step_block(
    run, advance, copy, own, numbers, memory, ways, near, drives, block, frames, state, tables,
    kind, codes, n, first, end, walk, place, fallen,
):  # fmt: skip
    """Take n steps of one block."""
    this = opened_run(run)
    data = opened(this.scene)
    rows, user = data.rows, data.user
    kept = walk == 0 and user.address == 0  # otherwise they may write into the rows
    b, s = in_lanes(block), named_block(block)
    since, ways_on, swept, lane = state[0], state[1], state[2], s.lane[0]
    running, h = count_running(codes, first, end), this.control[0].error.widest
    for w in range(LANE_WIDTH):
        i = min(first + w, end - 1)
        since[w] = 0
        swept[w] = 0
        ways_on[w] = OUT
        if first + w < end and is_running(codes, i) and running < LEAST_INSTANCES:
            load_run(copy, own, numbers, tables, kind, i)
            codes[i] = call_advance(advance, (run, n))
            exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
        elif running >= LEAST_INSTANCES:
            load_run(copy, own, numbers, tables, kind, i)
            good = take_in(run, ways, drives, s, w, True)
            if walk != 0:
                call_walk(walk, (place, w, h))
                lane[of.LANE.fallen, w] = fallen[0]
            if first + w < end and is_running(codes, i):
                ways_on[w] = IN_LANES if good else BY_ITSELF
        lane[of.LANE.lives, w] = 1.0 if ways_on[w] == IN_LANES else 0.0
    if running < LEAST_INSTANCES:
        return
    mine = own[own.shape[0] - memory :]
    loaded = -1
    for _ in range(n):
        for again in range(2):
            if again == 0:
                begin(rows, drives, b, h)
            else:
                begin_again(rows, drives, b, h, kept)
            if walk != 0:
                call_walk(walk, (place, ALL, h))
            elif user.address != 0:
                runs = copy, own, mine, numbers, tables, kind
                loaded = ask_users(run, runs, s, ways_on, frames, first, loaded, h)
            if again == 0:
                solve(rows, ways, near, b, h, False, False)
        finish(rows, ways, near, b, h, kept)
        for w in range(LANE_WIDTH):
            i = first + w
            if ways_on[w] == IN_LANES and lane[of.LANE.alone, w] == 0.0:
                since[w] += 1
                swept[w] += int(lane[of.LANE.swept, w])
                lane[of.LANE.taken, w] += 1.0
                lane[of.LANE.time, w] = lane[of.LANE.origin, w] + lane[of.LANE.taken, w] * h
                lane[of.LANE.fallen, w] = lane[of.LANE.fell, w]
            elif ways_on[w] != OUT:
                load_run(copy, own, numbers, tables, kind, i)
                loaded = kind[i]
                if since[w] > 0:
                    put_out(run, ways, s, w, since[w], swept[w])
                    if walk != 0:
                        fallen[0] = lane[of.LANE.fallen, w]
                codes[i] = call_advance(advance, (run, 1))
                exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
                since[w] = 0
                swept[w] = 0
                good = take_in(run, ways, drives, s, w, False)
                if walk != 0:
                    lane[of.LANE.fallen, w] = fallen[0]
                ways_on[w] = OUT
                if is_running(codes, i):
                    ways_on[w] = IN_LANES if good else BY_ITSELF
                lane[of.LANE.lives, w] = 1.0 if ways_on[w] == IN_LANES else 0.0
    for w in range(LANE_WIDTH):
        if ways_on[w] == IN_LANES and since[w] > 0:
            load_run(copy, own, numbers, tables, kind, first + w)
            put_out(run, ways, s, w, since[w], swept[w])
            if walk != 0:
                fallen[0] = lane[of.LANE.fallen, w]
            exchange(copy, own, tables[0, 0] + (first + w) * tables[0, 1], True)
