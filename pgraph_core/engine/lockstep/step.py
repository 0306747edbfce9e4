"""Moreau-Jean steps for instances side by side in lanes: trees on feet above a plane.

The same steps as `moreau`, with the same operations in the same order, so that every lane has the
bits of its own run. What is rare is not written twice: where a lane hits something, penetrates, or
needs more than sweeps, its step is thrown away and taken by the kernels of one instance.
"""

import math

from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F3, I1, I2, group, i8, void
from ..compiler.masks import any_of, both, chosen, either, larger, more, most, smaller, without
from ..constraints.blocks import velocities
from ..constraints.paths import pivots, spread, unspread
from ..contact.cone import only
from ..contact.contacts import STILL
from ..motion import opened, user_torque
from ..records import ACCEPTANCE, CREEP, STANCE, SWING
from ..rows import (
    TRANSLATE,
    armature_of,
    kind_of,
    origin_of,
    parent_of,
    rotation_of,
    spin_of,
    v_of,
)
from ..stepping.batch import call_advance, call_copy
from ..stepping.booking import goes_on_sliding
from ..stepping.moreau import turn_rates
from ..stepping.state import size_of_state
from ..tree.articulated import inboard, joint_acceleration
from ..tree.kinematics import outboard, positions
from ..tree.moving import advance, normalise_all
from ..tree.spinning import GYRATES
from ..vec import accumulate, add_scaled, cross, dot, load, mul, sub
from .block import (
    ACTIVE,
    ALONE,
    ARMATURE,
    BEFORE,
    COMPLEMENTARITY,
    CONE,
    COUNT,
    D_DAMPING,
    D_FRICTION,
    D_HIGH,
    D_LOW,
    D_STIFFNESS,
    D_TARGET,
    D_TORQUE,
    DAMPING,
    DEEPEST,
    DEEPEST_DEPTH,
    DEEPEST_PAIR,
    DEEPEST_TIME,
    DINV,
    DONE,
    FALLEN,
    FELL,
    FORCE,
    FOUND,
    GAP,
    GIVEN,
    KEPT,
    LAM,
    LARGEST,
    LARGEST_DEPTH,
    LEDGER,
    LIVES,
    LOGGED,
    LOST,
    MIDDLE,
    MISSED,
    MOVE,
    NEW_Q,
    NEW_V,
    NORMAL,
    NUMBER,
    OPEN,
    ORIGIN,
    P_GAP,
    P_SLIP,
    PENETRATION,
    PHASE,
    PUSHED,
    PUT_IN,
    RATE,
    RESIDUAL,
    S_THICK,
    SLIDES,
    SLIP,
    SPEEDS,
    STEP,
    STIFFNESS,
    SWEPT,
    TAKEN,
    TAU,
    TIME,
    TORQUE,
    VALUE,
    VDOT,
    W_BODY,
    W_PAIR,
    W_ROW,
    W_SHAPE,
    WORST,
    WORST_PAIR,
    WORST_TIME,
    Q,
    V,
    W,
    in_lanes,
    named_block,
    put_out,
    take_in,
)
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
    warm,
)
from .walk import ALL, call_walk


@sweep
def begin(rows, drives, b, h):
    """Take the first half of a step, up to the frames at its midpoint."""
    x = b.vectors
    for i in range(x.shape[1]):
        x[NEW_Q, i] = x[Q, i]
        x[NEW_V, i] = x[V, i]
    q, v = x[NEW_Q], x[V]
    advance(rows, q, v, 0.5 * h)
    stiffen(rows, drives, b, h, q, v)
    act(drives, b, q, v)
    outboard(rows, b.const, b.work, q, v)


@sweep
def stiffen(rows, drives, b, h, q, v):
    """Run `moreau.stiffen`."""
    x, const = b.vectors, b.const
    for j in range(x.shape[1]):
        x[DAMPING, j] = 0.0
        x[STIFFNESS, j] = 0.0
        x[PUSHED, j] = x[GIVEN, j]
    for n in range(drives.shape[0]):
        j, i = drives[n, 0], drives[n, 1]
        d = b.drives[n]
        torque = -d[D_DAMPING] * v[j]
        if i >= 0:
            torque += d[D_STIFFNESS] * (d[D_TARGET] - q[i])
        torque += d[D_TORQUE]
        limited = either(more(d[D_LOW], torque), more(torque, d[D_HIGH]))
        counts = without(more(d[D_DAMPING], 0.0), limited)
        x[DAMPING, j] += chosen(counts, d[D_DAMPING], 0.0)
        if i >= 0:
            x[STIFFNESS, j] += chosen(counts, d[D_STIFFNESS], 0.0)
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            x[ARMATURE, j] = armature_of(const, k)
            x[DAMPING, j] = h * x[DAMPING, j] + 0.5 * h * h * x[STIFFNESS, j]
            const[k, at.ARMATURE] += x[DAMPING, j]
            x[PUSHED, j] -= 0.5 * h * x[STIFFNESS, j] * v[j]


@sweep
def act(drives, b, q, v):
    """Run `forces.drive` for drives with one coordinate and no tables."""
    x, lane = b.vectors, b.lane[0]
    tau, given = x[TAU], x[PUSHED]
    lane[PUT_IN] = 0.0
    lane[LOST] = 0.0
    put_in, lost = lane[PUT_IN], lane[LOST]
    for j in range(tau.shape[0]):
        tau[j] = given[j]
        put_in += given[j] * v[j]
    for n in range(drives.shape[0]):
        j, i = drives[n, 0], drives[n, 1]
        d = b.drives[n]
        speed = v[j]
        drag = d[D_DAMPING] * speed
        friction = d[D_FRICTION] * speed / math.sqrt(speed * speed + CREEP * CREEP)
        drag = chosen(more(d[D_FRICTION], 0.0), drag + friction, drag)
        torque = -drag
        if i >= 0:
            torque += d[D_STIFFNESS] * (d[D_TARGET] - q[i])
        if drives[n, 2] == 1:
            lost += drag * speed
        else:
            torque += d[D_TORQUE]
            torque = smaller(larger(torque, d[D_LOW]), d[D_HIGH])
            put_in += torque * speed
        tau[j] += torque
    lane[PUT_IN] = put_in
    lane[LOST] = lost


@sweep
def set_velocities(rows, ways, near, b, h):
    """Write J v into BEFORE and J (v + h v') into RATE, as in `moreau.set_velocities`."""
    x, work, linear = b.vectors, b.work, b.linear
    directions(ways, near, b, BEFORE)
    for j in range(x.shape[1]):
        x[STEP, j] = x[V, j] + h * x[VDOT, j]
    turn_rates(rows, b.const, work, x[STEP])
    velocities(rows, b.const, work, x[STEP], linear)
    directions(ways, near, b, RATE)
    for j in range(x.shape[1]):
        x[SPEEDS, j] = x[STEP, j]
    unspread(rows, b.const, work, x[SPEEDS])


@sweep
def finish(rows, drives, ways, near, b, h, passive):
    """Finish a step into NEW_Q and NEW_V. Sets ALONE for lanes that must continue alone."""
    x, lane, work, const, linear = b.vectors, b.lane[0], b.work, b.const, b.linear
    v = x[V]
    vdot = x[VDOT]
    inboard(rows, const, work, x[TAU])
    joint_acceleration(rows, const, work, vdot)
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            const[k, at.ARMATURE] = x[ARMATURE, v_of(rows, k)]
    positions(rows, work)
    velocities(rows, const, work, v, linear)
    lane[ALONE] = 0.0
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        if p > 0:
            w, u = spin_of(work, k), spin_of(work, p)
            most_turn = larger(dot(w, w), dot(u, u)) * h * h
            lane[ALONE] = either(lane[ALONE], more(most_turn, GYRATES * GYRATES))
    find(ways, near, b, h)
    x[DONE, 0] = x[LEDGER, 0] + h * lane[PUT_IN]
    x[DONE, 1] = x[LEDGER, 1] + h * lane[LOST]
    touches = lane[COUNT] * 0.0
    for m in range(near[0]):
        n = near[1 + m]
        touches = either(touches, b.points[n, ACTIVE])
    some = any_of(touches)
    for j in range(x.shape[1]):
        x[STEP, j] = 0.0
        x[MOVE, j] = 0.0
    if some:
        set_velocities(rows, ways, near, b, h)
        pivots(rows, work, x[DINV])
        for m in range(near[0]):
            n = near[1 + m]
            carry(rows, ways, b, n)
            own_block(ways, b, n)
            warm(b, n)
        aim(ways, near, b)
        gauss_seidel(ways, near, b)
        gain_and_miss(ways, near, b)
        effects(ways, near, b, touches)
        for j in range(x.shape[1]):
            x[MOVE, j] = x[STEP, j]
        spread(rows, const, work, x[MOVE])
    new, more_work = x[NEW_V], lane[COUNT] * 0.0
    for j in range(x.shape[1]):
        new[j] = v[j] + (h * vdot[j] + x[MOVE, j])
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            change = new[j] - v[j]
            mean = 0.5 * (new[j] + v[j])
            pushed = h * x[TAU, j]
            more_work += (pushed - x[DAMPING, j] * change) * mean - pushed * v[j]
    if passive:
        x[DONE, 1] -= more_work
    else:
        x[DONE, 0] += more_work
    advance(rows, x[NEW_Q], new, 0.5 * h)
    if some:
        push_out(rows, ways, near, b, h)
    sum_ = x[DONE, 0] + x[DONE, 1]
    for i in range(x.shape[1]):
        sum_ += x[NEW_Q, i] + new[i]
    lane[ALONE] = either(lane[ALONE], without(lane[LIVES], most(abs(sum_), 1e300)))
    commit(rows, ways, near, b, h)


@sweep
def commit(rows, ways, near, b, h):
    """Commit state and history after the step as `booking.book`, in lanes that stay together."""
    x, lane, points, pairs = b.vectors, b.lane[0], b.points, b.pairs
    good = without(lane[LIVES], lane[ALONE])
    zero = 0.0 * lane[COUNT]
    normalise_all(rows, x[NEW_Q])
    for i in range(x.shape[1]):
        x[Q, i] = chosen(good, x[NEW_Q, i], x[Q, i])
        x[V, i] = chosen(good, x[NEW_V, i], x[V, i])
    for c in range(2):
        x[LEDGER, c] = chosen(good, x[DONE, c], x[LEDGER, c])
    number, found, touches = zero, zero, zero
    for k in range(pairs.shape[0]):
        for c in range(6):
            pairs[k, c] = zero
        pairs[k, P_GAP] = zero + math.inf
        pairs[k, P_SLIP] = zero
    for k in range(b.wrenches.shape[0]):
        for c in range(6):
            b.wrenches[k, c] = zero
    for m in range(near[0]):
        n = near[1 + m]
        here = both(good, points[n, ACTIVE])
        found = found + points[n, FOUND]
        number = number + here
        touches = either(touches, here)
        note_point(ways, b, n, here, h)
        push_body(ways, b, n, here, h)
    for n in range(ways.shape[0]):
        points[n, KEPT] = chosen(good, points[n, ACTIVE], points[n, KEPT])
    lane[SWEPT] = chosen(both(good, touches), lane[SWEPT], 0.0)
    note_largest(lane, RESIDUAL, touches, lane[OPEN])
    lane[NUMBER] = chosen(good, number, lane[NUMBER])
    lane[COUNT] = chosen(good, found, lane[COUNT])
    for k in range(pairs.shape[0]):
        change_phase(b, k, good)


@part
def note_point(ways, b, n, here, h):
    """Record the residual and depth at point n, and the start of the next step."""
    lane, points = b.lane[0], b.points
    zero, t = 0.0 * lane[COUNT], lane[TIME] + h
    lam, gap = load(points, n, LAM), points[n, GAP]
    i, pair = ways[n, W_SHAPE], ways[n, W_PAIR] + zero
    broken, cone = points[n, MISSED] / h, points[n, MISSED + 1] / h
    note_largest(lane, COMPLEMENTARITY, here, broken)
    note_largest(lane, CONE, here, cone)
    note_largest(lane, LARGEST, here, math.sqrt(dot(lam, lam)) / h)
    new = both(here, more(larger(broken, cone), lane[WORST]))
    lane[WORST] = chosen(new, larger(broken, cone), lane[WORST])
    lane[WORST_PAIR] = chosen(new, pair, lane[WORST_PAIR])
    lane[WORST_TIME] = chosen(new, t, lane[WORST_TIME])
    note_largest(lane, PENETRATION, here, -gap)
    note_largest(lane, LARGEST_DEPTH, here, -gap)
    share = -gap / b.shapes[i, S_THICK]
    new = both(here, more(share, lane[DEEPEST]))
    lane[DEEPEST] = chosen(new, share, lane[DEEPEST])
    lane[DEEPEST_DEPTH] = chosen(new, -gap, lane[DEEPEST_DEPTH])
    lane[DEEPEST_PAIR] = chosen(new, pair, lane[DEEPEST_PAIR])
    lane[DEEPEST_TIME] = chosen(new, t, lane[DEEPEST_TIME])
    for c in range(3):
        points[n, VALUE + c] = chosen(here, lam[c], points[n, VALUE + c])
    mu = b.laws[ways[n, W_PAIR], 0]
    slides = goes_on_sliding(lam, mu, points[n, RATE], points[n, SLIP])
    points[n, SLIDES] = chosen(here, slides, points[n, SLIDES])


@part
def push_body(ways, b, n, here, h):
    """Add the force at point n to its contact pair and its body."""
    points, pairs, wrenches, work = b.points, b.pairs, b.wrenches, b.work
    pair, k, body = ways[n, W_PAIR], ways[n, W_ROW], ways[n, W_BODY]
    zero, lam = 0.0 * b.lane[0, COUNT], load(points, n, LAM)
    force = (zero, zero, zero)
    for c in range(3):
        force = add_scaled(force, lam[c] / h, load(b.lane, 0, NORMAL + 3 * c))
    force = only(here, force)
    pairs[pair, P_GAP] = smaller(pairs[pair, P_GAP], chosen(here, points[n, GAP], math.inf))
    pairs[pair, P_SLIP] = larger(pairs[pair, P_SLIP], chosen(here, points[n, SLIP], 0.0))
    arm = sub(load(points, n, MIDDLE), origin_of(work, k))
    offset = mul(rotation_of(work, k), load(b.bodies, body, 0))
    accumulate(pairs, pair, FORCE, force)
    accumulate(pairs, pair, TORQUE, cross(sub(arm, offset), force))
    accumulate(wrenches, body, 0, cross(arm, force))
    accumulate(wrenches, body, 3, force)


@part
def change_phase(b, k, good):
    """Update the phase of contact pair k after the step, and count any change."""
    lane, pairs = b.lane[0], b.pairs
    zero = 0.0 * lane[COUNT]
    force, before = load(pairs, k, FORCE), pairs[k, PHASE]
    starts = both(more(before, SWING - 0.5), most(before, ACCEPTANCE + 0.5))
    slips = chosen(starts, ACCEPTANCE + zero, 2.0)
    now = chosen(most(pairs[k, P_SLIP], STILL), STANCE + zero, slips)
    now = chosen(more(dot(force, force), 0.0), now, SWING + zero)
    changed = without(good, both(most(now, before), most(before, now)))
    pairs[k, PHASE] = chosen(changed, now, before)
    lane[LOGGED] = lane[LOGGED] + changed


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
        q[i] = x[NEW_Q, i, w]
    for j in range(nv):
        v[j] = x[V, j, w]
        tau[j] = x[TAU, j, w]
    lane[PUT_IN, w] += user_torque(data.user, lane[TIME, w] + 0.5 * h, q, v, tau)
    for j in range(nv):
        x[TAU, j, w] = tau[j]


@sweep
def lay_out(work, frames):
    """Compute frames, velocities and inertias of all lanes, one lane after the other."""
    for k in range(work.shape[0]):
        for c in range(at.PROJECTED):
            for w in range(W):
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

    The last `memory` spans of `own` are those of a user's function. `walk` is the address of
    `walk_in_lanes` if all instances walk, else 0. `place` is the address of its tuple, and `fallen`
    the time of the fall of the instance in the run. The rest are names and scratch.
    """
    while first < end:
        step_block(
            run, advance, copy, own, numbers, memory, ways, near, drives, block, frames, state,
            tables, kind, codes, n, first, min(first + W, end), walk, place, fallen,
        )  # fmt: skip
        first += W


@part
def is_running(codes, i):
    return codes[i] == at.RUNNING


@sweep
def step_block(
    run, advance, copy, own, numbers, memory, ways, near, drives, block, frames, state, tables,
    kind, codes, n, first, end, walk, place, fallen,
):  # fmt: skip
    """Take n steps of one block."""
    this = opened_run(run)
    data = opened(this.scene)
    rows, user, work = data.rows, data.user, data.work
    passive = data.drives.table.shape[0] <= data.drives.passive
    b, s = in_lanes(block), named_block(block)
    since, ways_on, swept, lane = state[0], state[1], state[2], s.lane[0]
    running, h = 0, this.control[0].widest
    for i in range(first, end):
        running += 1 if is_running(codes, i) else 0
    for w in range(W):
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
                lane[FALLEN, w] = fallen[0]
            if first + w < end and is_running(codes, i):
                ways_on[w] = IN_LANES if good else BY_ITSELF
        lane[LIVES, w] = 1.0 if ways_on[w] == IN_LANES else 0.0
    if running < LEAST_INSTANCES:
        return
    mine = own[own.shape[0] - memory :]
    loaded = -1
    for _ in range(n):
        begin(rows, drives, b, h)
        if walk != 0:
            call_walk(walk, (place, ALL, h))
        elif user.address != 0:
            lay_out(s.work, frames)
            size = 8 * at.WORK * work.shape[0]
            for w in range(W):
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
        finish(rows, drives, ways, near, b, h, passive)
        for w in range(W):
            i = first + w
            if ways_on[w] == IN_LANES and lane[ALONE, w] == 0.0:
                since[w] += 1
                swept[w] += int(lane[SWEPT, w])
                lane[TAKEN, w] += 1.0
                lane[TIME, w] = lane[ORIGIN, w] + lane[TAKEN, w] * h
                lane[FALLEN, w] = lane[FELL, w]
            elif ways_on[w] != OUT:
                load_run(copy, own, numbers, tables, kind, i)
                loaded = kind[i]
                if since[w] > 0:
                    put_out(run, ways, s, w, since[w], swept[w])
                    if walk != 0:
                        fallen[0] = lane[FALLEN, w]
                codes[i] = call_advance(advance, (run, 1))
                exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
                since[w] = 0
                swept[w] = 0
                good = take_in(run, ways, drives, s, w, False)
                if walk != 0:
                    lane[FALLEN, w] = fallen[0]
                ways_on[w] = OUT
                if is_running(codes, i):
                    ways_on[w] = IN_LANES if good else BY_ITSELF
                lane[LIVES, w] = 1.0 if ways_on[w] == IN_LANES else 0.0
    for w in range(W):
        if ways_on[w] == IN_LANES and since[w] > 0:
            load_run(copy, own, numbers, tables, kind, first + w)
            put_out(run, ways, s, w, since[w], swept[w])
            if walk != 0:
                fallen[0] = lane[FALLEN, w]
            exchange(copy, own, tables[0, 0] + (first + w) * tables[0, 1], True)
