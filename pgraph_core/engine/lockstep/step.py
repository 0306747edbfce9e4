"""Moreau-Jean steps for instances side by side in lanes: trees on feet above a plane.

The steps perform the same operations as `moreau` in the same order, so that the result of each lane
is bit-identical to a single run. Rare cases are not implemented for lanes. If a lane has an impact,
a penetration, or a problem that sweeps cannot solve, its step is repeated by the kernels for single
instances.
"""

import math

from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F3, I1, I2, group, i8, void
from ..compiler.masks import any_of, both, chosen, either, larger, more, most, smaller, without
from ..constraints.blocks import velocities
from ..constraints.paths import pivots, spread, unspread
from ..contact.contacts import STILL
from ..contact.coulomb import only
from ..motion import opened, user_torque
from ..records import ACCEPTANCE, CREEP, STANCE, SWING
from ..rows import (
    TRANSLATE,
    armature_of,
    inverse_pivot_of,
    kind_of,
    origin_of,
    parent_of,
    rotation_of,
    spin_of,
    v_of,
)
from ..stepping.batch import call_advance, call_copy
from ..stepping.booking import goes_on_sliding
from ..stepping.moreau import softened, turn_rates
from ..stepping.state import size_of_state
from ..tree.articulated import inboard, joint_acceleration
from ..tree.kinematics import outboard, positions
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
        x[of.NEW_Q, i] = x[of.Q, i]
        x[of.NEW_V, i] = x[of.V, i]
        x[of.MEAN, i] = x[of.V, i]
    q, v = x[of.NEW_Q], x[of.V]
    b.lane[0, of.SWEPT] = 0.0
    b.lane[0, of.ALONE] = 0.0
    b.lane[0, of.OPEN] = 0.0
    advance(rows, q, v, 0.5 * h)
    stiffen(rows, drives, b, h, q, v)
    act(drives, b, q, v)
    outboard(rows, b.const, b.work, q, v)


@sweep
def begin_again(rows, drives, b, h):
    """Compute velocities and forces at the mean velocity of the first pass."""
    x, work = b.vectors, b.work
    q, v, mean = x[of.NEW_Q], x[of.V], x[of.MEAN]
    for j in range(x.shape[1]):
        mean[j] = v[j] + 0.5 * (h * x[of.VDOT, j] + x[of.MOVE, j])
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            pivot, extra = inverse_pivot_of(work, k), x[of.DAMPING, j]
            more_ = softened(pivot, extra, x[of.STIFFNESS, j], h, v[j], mean[j])
            x[of.PUSHED, j] = x[of.GIVEN, j] + more_
    act(drives, b, q, mean)
    outboard(rows, b.const, work, q, mean)


@sweep
def stiffen(rows, drives, b, h, q, v):
    """Run `moreau.stiffen`."""
    x, const = b.vectors, b.const
    for j in range(x.shape[1]):
        x[of.DAMPING, j] = 0.0
        x[of.STIFFNESS, j] = 0.0
        x[of.PUSHED, j] = x[of.GIVEN, j]
    for n in range(drives.shape[0]):
        j, i = drives[n, 0], drives[n, 1]
        d = b.drives[n]
        torque = -d[of.D_DAMPING] * v[j]
        if i >= 0:
            torque += d[of.D_STIFFNESS] * (d[of.D_TARGET] - q[i])
        torque += d[of.D_TORQUE]
        limited = either(more(d[of.D_LOW], torque), more(torque, d[of.D_HIGH]))
        counts = without(more(d[of.D_DAMPING], 0.0), limited)
        x[of.DAMPING, j] += chosen(counts, d[of.D_DAMPING], 0.0)
        if i >= 0:
            x[of.STIFFNESS, j] += chosen(counts, d[of.D_STIFFNESS], 0.0)
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            x[of.ARMATURE, j] = armature_of(const, k)
            x[of.DAMPING, j] = h * x[of.DAMPING, j] + 0.5 * h * h * x[of.STIFFNESS, j]
            const[k, at.ARMATURE] += x[of.DAMPING, j]
            x[of.PUSHED, j] -= 0.5 * h * x[of.STIFFNESS, j] * v[j]


@sweep
def act(drives, b, q, v):
    """Run `forces.drive` for drives with one coordinate and no tables."""
    x, lane = b.vectors, b.lane[0]
    tau, given = x[of.TAU], x[of.PUSHED]
    lane[of.PUT_IN] = 0.0
    lane[of.LOST] = 0.0
    put_in, lost = lane[of.PUT_IN], lane[of.LOST]
    for j in range(tau.shape[0]):
        tau[j] = given[j]
        put_in += given[j] * v[j]
    for n in range(drives.shape[0]):
        j, i = drives[n, 0], drives[n, 1]
        d = b.drives[n]
        speed = v[j]
        drag = d[of.D_DAMPING] * speed
        friction = d[of.D_FRICTION] * speed / math.sqrt(speed * speed + CREEP * CREEP)
        drag = chosen(more(d[of.D_FRICTION], 0.0), drag + friction, drag)
        torque = -drag
        if i >= 0:
            torque += d[of.D_STIFFNESS] * (d[of.D_TARGET] - q[i])
        if drives[n, 2] == 1:
            lost += drag * speed
        else:
            torque += d[of.D_TORQUE]
            torque = smaller(larger(torque, d[of.D_LOW]), d[of.D_HIGH])
            put_in += torque * speed
        tau[j] += torque
    lane[of.PUT_IN] = put_in
    lane[of.LOST] = lost


@sweep
def set_velocities(rows, ways, near, b, h):
    """Write J v into BEFORE and J (v + h v') into RATE, as in `moreau.set_velocities`."""
    x, work, linear, points = b.vectors, b.work, b.linear, b.points
    turned(rows, ways, near, b, h)
    turn_rates(rows, b.const, work, x[of.V])
    velocities(rows, b.const, work, x[of.V], linear)
    directions(ways, near, b, of.BEFORE)
    for j in range(x.shape[1]):
        x[of.STEP, j] = x[of.V, j] + h * x[of.VDOT, j]
    turn_rates(rows, b.const, work, x[of.STEP])
    velocities(rows, b.const, work, x[of.STEP], linear)
    directions(ways, near, b, of.RATE)
    for m in range(near[0]):
        n = near[1 + m]
        for r in range(3):
            points[n, of.BEFORE + r] -= points[n, of.TURNED + r]
            points[n, of.RATE + r] += points[n, of.TURNED + r]
    for j in range(x.shape[1]):
        x[of.SPEEDS, j] = x[of.STEP, j]
    unspread(rows, b.const, work, x[of.SPEEDS])


@sweep
def solve(rows, ways, near, b, h, again):
    """Run a pass of a step, and write v' into VDOT and the effect of impulses into MOVE.

    Sets ALONE for lanes that must continue individually. Returns whether points touch in any lane.
    """
    x, lane, work, const, linear = b.vectors, b.lane[0], b.work, b.const, b.linear
    vdot = x[of.VDOT]
    inboard(rows, const, work, x[of.TAU])
    joint_acceleration(rows, const, work, vdot)
    positions(rows, work)
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        if p > 0:
            w, u = spin_of(work, k), spin_of(work, p)
            most_turn = larger(dot(w, w), dot(u, u)) * h * h
            lane[of.ALONE] = either(lane[of.ALONE], more(most_turn, GYRATES * GYRATES))
    if not again:
        velocities(rows, const, work, x[of.V], linear)
        find(ways, near, b, h)
    some = any_of(touching(near, b))
    for j in range(x.shape[1]):
        x[of.STEP, j] = 0.0
        x[of.MOVE, j] = 0.0
    if some:
        set_velocities(rows, ways, near, b, h)
        if not again:
            pivots(rows, work, x[of.DINV])
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
            x[of.MOVE, j] = x[of.STEP, j]
        spread(rows, const, work, x[of.MOVE])
    return some


@part
def touching(near, b):
    """Return the lanes in which a point is active."""
    touches = b.lane[0, of.COUNT] * 0.0
    for m in range(near[0]):
        touches = either(touches, b.points[near[1 + m], of.ACTIVE])
    return touches


@sweep
def finish(rows, ways, near, b, h, passive):
    """Finish a step into NEW_Q and NEW_V by its second pass."""
    x, lane, const = b.vectors, b.lane[0], b.const
    v, vdot, mean_ = x[of.V], x[of.VDOT], x[of.MEAN]
    some = solve(rows, ways, near, b, h, True)
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            const[k, at.ARMATURE] = x[of.ARMATURE, v_of(rows, k)]
    x[of.DONE, 0] = x[of.LEDGER, 0] + h * lane[of.PUT_IN]
    x[of.DONE, 1] = x[of.LEDGER, 1] + h * lane[of.LOST]
    if some:
        x[of.DONE, 1] -= chosen(touching(near, b), lane[of.GAINED], 0.0)
    new, more_work = x[of.NEW_V], lane[of.COUNT] * 0.0
    for j in range(x.shape[1]):
        new[j] = v[j] + (h * vdot[j] + x[of.MOVE, j])
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            change = new[j] - v[j]
            mean = 0.5 * (new[j] + v[j])
            pushed = h * x[of.TAU, j]
            more_work += (pushed - x[of.DAMPING, j] * change) * mean - pushed * mean_[j]
    if passive:
        x[of.DONE, 1] -= more_work
    else:
        x[of.DONE, 0] += more_work
    advance(rows, x[of.NEW_Q], new, 0.5 * h)
    if some:
        push_out(rows, ways, near, b, h)
    sum_ = x[of.DONE, 0] + x[of.DONE, 1]
    for i in range(x.shape[1]):
        sum_ += x[of.NEW_Q, i] + new[i]
    lane[of.ALONE] = either(lane[of.ALONE], without(lane[of.LIVES], most(abs(sum_), 1e300)))
    commit(rows, ways, near, b, h)


@sweep
def commit(rows, ways, near, b, h):
    """Commit state and history after the step as `booking.book`, in lanes that stay together."""
    x, lane, points, pairs = b.vectors, b.lane[0], b.points, b.pairs
    good = without(lane[of.LIVES], lane[of.ALONE])
    zero = 0.0 * lane[of.COUNT]
    normalise_all(rows, x[of.NEW_Q])
    for i in range(x.shape[1]):
        x[of.Q, i] = chosen(good, x[of.NEW_Q, i], x[of.Q, i])
        x[of.V, i] = chosen(good, x[of.NEW_V, i], x[of.V, i])
    for c in range(2):
        x[of.LEDGER, c] = chosen(good, x[of.DONE, c], x[of.LEDGER, c])
    number, found, touches = zero, zero, zero
    for k in range(pairs.shape[0]):
        for c in range(6):
            pairs[k, of.FORCE + c] = zero
        pairs[k, of.P_GAP] = zero + math.inf
        pairs[k, of.P_SLIP] = zero
    for k in range(b.wrenches.shape[0]):
        for c in range(6):
            b.wrenches[k, c] = zero
    for m in range(near[0]):
        n = near[1 + m]
        here = both(good, points[n, of.ACTIVE])
        found = found + points[n, of.FOUND]
        number = number + here
        touches = either(touches, here)
        note_point(ways, b, n, here, h)
        push_body(ways, b, n, here, h)
    for n in range(ways.shape[0]):
        points[n, of.KEPT] = chosen(good, points[n, of.ACTIVE], points[n, of.KEPT])
    lane[of.SWEPT] = chosen(both(good, touches), lane[of.SWEPT], 0.0)
    note_largest(lane, of.RESIDUAL, touches, lane[of.OPEN])
    lane[of.NUMBER] = chosen(good, number, lane[of.NUMBER])
    lane[of.COUNT] = chosen(good, found, lane[of.COUNT])
    lane[of.ELAPSED] = chosen(good, lane[of.ELAPSED] + h, lane[of.ELAPSED])
    share = h / larger(lane[of.ELAPSED], h)
    for k in range(pairs.shape[0]):
        change_phase(b, k, good)
        for c in range(6):
            mean, force = pairs[k, of.P_MEAN + c], pairs[k, of.FORCE + c]
            pairs[k, of.P_MEAN + c] = chosen(good, force + (1.0 - share) * (mean - force), mean)


@part
def note_point(ways, b, n, here, h):
    """Record the residual and depth at point n, and the start of the next step."""
    lane, points = b.lane[0], b.points
    zero, t = 0.0 * lane[of.COUNT], lane[of.TIME] + h
    lam, gap = load(points, n, of.LAM), points[n, of.GAP]
    i, pair = ways[n, of.W_SHAPE], ways[n, of.W_PAIR] + zero
    broken, cone = points[n, of.MISSED] / h, points[n, of.MISSED + 1] / h
    note_largest(lane, of.COMPLEMENTARITY, here, broken)
    note_largest(lane, of.CONE, here, cone)
    note_largest(lane, of.LARGEST, here, math.sqrt(dot(lam, lam)) / h)
    new = both(here, more(larger(broken, cone), lane[of.WORST]))
    lane[of.WORST] = chosen(new, larger(broken, cone), lane[of.WORST])
    lane[of.WORST_PAIR] = chosen(new, pair, lane[of.WORST_PAIR])
    lane[of.WORST_TIME] = chosen(new, t, lane[of.WORST_TIME])
    note_largest(lane, of.PENETRATION, here, -gap)
    note_largest(lane, of.LARGEST_DEPTH, here, -gap)
    share = -gap / b.shapes[i, of.S_THICK]
    new = both(here, more(share, lane[of.DEEPEST]))
    lane[of.DEEPEST] = chosen(new, share, lane[of.DEEPEST])
    lane[of.DEEPEST_DEPTH] = chosen(new, -gap, lane[of.DEEPEST_DEPTH])
    lane[of.DEEPEST_PAIR] = chosen(new, pair, lane[of.DEEPEST_PAIR])
    lane[of.DEEPEST_TIME] = chosen(new, t, lane[of.DEEPEST_TIME])
    for c in range(3):
        points[n, of.VALUE + c] = chosen(here, lam[c], points[n, of.VALUE + c])
    mu = b.laws[ways[n, of.W_PAIR], 0]
    slides = goes_on_sliding(lam, mu, points[n, of.RATE], points[n, of.SLIP])
    points[n, of.SLIDES] = chosen(here, slides, points[n, of.SLIDES])


@part
def push_body(ways, b, n, here, h):
    """Add the force at point n to its contact pair and its body."""
    points, pairs, wrenches, work = b.points, b.pairs, b.wrenches, b.work
    pair, k, body = ways[n, of.W_PAIR], ways[n, of.W_ROW], ways[n, of.W_BODY]
    zero, lam = 0.0 * b.lane[0, of.COUNT], load(points, n, of.LAM)
    force = (zero, zero, zero)
    for c in range(3):
        force = add_scaled(force, lam[c] / h, load(b.lane, 0, of.NORMAL + 3 * c))
    force = only(here, force)
    pairs[pair, of.P_GAP] = smaller(
        pairs[pair, of.P_GAP], chosen(here, points[n, of.GAP], math.inf)
    )
    pairs[pair, of.P_SLIP] = larger(pairs[pair, of.P_SLIP], chosen(here, points[n, of.SLIP], 0.0))
    arm = sub(load(points, n, of.MIDDLE), origin_of(work, k))
    offset = mul(rotation_of(work, k), load(b.bodies, body, 0))
    accumulate(pairs, pair, of.FORCE, force)
    accumulate(pairs, pair, of.TORQUE, cross(sub(arm, offset), force))
    accumulate(wrenches, body, 0, cross(arm, force))
    accumulate(wrenches, body, 3, force)


@part
def change_phase(b, k, good):
    """Update the phase of contact pair k after the step, and count any change."""
    lane, pairs = b.lane[0], b.pairs
    zero = 0.0 * lane[of.COUNT]
    force, before = load(pairs, k, of.FORCE), pairs[k, of.PHASE]
    starts = both(more(before, SWING - 0.5), most(before, ACCEPTANCE + 0.5))
    slips = chosen(starts, ACCEPTANCE + zero, 2.0)
    now = chosen(most(pairs[k, of.P_SLIP], STILL), STANCE + zero, slips)
    now = chosen(more(dot(force, force), 0.0), now, SWING + zero)
    changed = without(good, both(most(now, before), most(before, now)))
    pairs[k, of.PHASE] = chosen(changed, now, before)
    lane[of.LOGGED] = lane[of.LOGGED] + changed


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
        q[i] = x[of.NEW_Q, i, w]
    for j in range(nv):
        v[j] = x[of.MEAN, j, w]
        tau[j] = x[of.TAU, j, w]
    lane[of.PUT_IN, w] += user_torque(data.user, lane[of.TIME, w] + 0.5 * h, q, v, tau)
    for j in range(nv):
        x[of.TAU, j, w] = tau[j]


@sweep
def lay_out(work, frames):
    """Compute frames, velocities and inertias of all lanes, one lane after the other."""
    for k in range(work.shape[0]):
        for c in range(at.PROJECTED):
            for w in range(of.W):
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
            tables, kind, codes, n, first, min(first + of.W, end), walk, place, fallen,
        )  # fmt: skip
        first += of.W


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
    for w in range(of.W):
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
                lane[of.FALLEN, w] = fallen[0]
            if first + w < end and is_running(codes, i):
                ways_on[w] = IN_LANES if good else BY_ITSELF
        lane[of.LIVES, w] = 1.0 if ways_on[w] == IN_LANES else 0.0
    if running < LEAST_INSTANCES:
        return
    mine = own[own.shape[0] - memory :]
    loaded = -1
    for _ in range(n):
        for again in range(2):
            if again == 0:
                begin(rows, drives, b, h)
            else:
                begin_again(rows, drives, b, h)
            if walk != 0:
                call_walk(walk, (place, ALL, h))
            elif user.address != 0:
                lay_out(s.work, frames)
                size = 8 * at.WORK * work.shape[0]
                for w in range(of.W):
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
            if again == 0:
                solve(rows, ways, near, b, h, False)
        finish(rows, ways, near, b, h, passive)
        for w in range(of.W):
            i = first + w
            if ways_on[w] == IN_LANES and lane[of.ALONE, w] == 0.0:
                since[w] += 1
                swept[w] += int(lane[of.SWEPT, w])
                lane[of.TAKEN, w] += 1.0
                lane[of.TIME, w] = lane[of.ORIGIN, w] + lane[of.TAKEN, w] * h
                lane[of.FALLEN, w] = lane[of.FELL, w]
            elif ways_on[w] != OUT:
                load_run(copy, own, numbers, tables, kind, i)
                loaded = kind[i]
                if since[w] > 0:
                    put_out(run, ways, s, w, since[w], swept[w])
                    if walk != 0:
                        fallen[0] = lane[of.FALLEN, w]
                codes[i] = call_advance(advance, (run, 1))
                exchange(copy, own, tables[0, 0] + i * tables[0, 1], True)
                since[w] = 0
                swept[w] = 0
                good = take_in(run, ways, drives, s, w, False)
                if walk != 0:
                    lane[of.FALLEN, w] = fallen[0]
                ways_on[w] = OUT
                if is_running(codes, i):
                    ways_on[w] = IN_LANES if good else BY_ITSELF
                lane[of.LIVES, w] = 1.0 if ways_on[w] == IN_LANES else 0.0
    for w in range(of.W):
        if ways_on[w] == IN_LANES and since[w] > 0:
            load_run(copy, own, numbers, tables, kind, first + w)
            put_out(run, ways, s, w, since[w], swept[w])
            if walk != 0:
                fallen[0] = lane[of.FALLEN, w]
            exchange(copy, own, tables[0, 0] + (first + w) * tables[0, 1], True)
