"""Derivatives of time stepping, computed by repeating each sub-step with dual numbers.

An impact ends a sub-step at a time that depends on all parameters. The last derivative of a dual is
therefore with respect to the width of the sub-step. Since the gap is zero at the impact, the
derivatives of the sub-step width follow from the derivatives of the gap. They determine the jump of
the state derivatives, which is also known as saltation ([Müller 1995]).

A step that ends at an event is repeated twice, the first time with an end that moves. The
difference of the derivatives is the rate of the state at the end.
"""

import math

from ...tolerances import NOTABLE, step_of_differences
from .. import layout as at
from ..arrays import (
    BEFORE,
    DAMPING,
    DINV,
    EFFECT,
    KICK,
    LAMBDA,
    LATER,
    MEAN,
    PATH_GAPS,
    RHS,
    SOONER,
    SPEEDS,
    WAY_SPEEDS,
    carried_at,
    opened_run,
)
from ..compiler.address import caller
from ..compiler.dual import WIDTH, parted, revalued
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import f8, i8, of_duals, void
from ..constraints.blocks import (
    ends_of,
    first_of,
    residual_velocity,
    span,
    type_of,
    velocities,
)
from ..constraints.constraints import driven_power, number_rows, unit_responses
from ..constraints.paths import spread
from ..contact.closing import closed_gap
from ..contact.contacts import (
    contact_points,
    contacts_at,
    push_contacts,
    set_block,
    touching,
)
from ..contact.meeting import limit_gap
from ..contact.placing import place
from ..contact.slopes import impulses_of_duals
from ..contact.sweeps import own_block
from ..motion import call_acceleration, opened
from ..records import columns
from ..tree.kinematics import frames, positions
from ..tree.moving import advance
from ..vec import xyz
from .duals import D1, MOVING, STEP_OF_DUALS, end_step, take_values
from .moreau import (
    EXPLICIT,
    MIDPOINT,
    REPEAT,
    book_drives,
    end_acceleration,
    find_mean,
    relax_drives,
    set_velocities,
    soften_drives,
    stiffen_drives,
    turn_rates,
)
from .state import copied, size_of_state
from .unilateral import push_out, span_reaches

BY_WIDTH = WIDTH - 1  # the derivative by the width of a part
# entries of PART_TIMES: when a part begins, of which only the derivatives count, how wide it is,
# and what was left of the step when the path to an impact was looked for
TIMES = columns("begun", "taken", "left", "kept")
SHIFT = step_of_differences(2)  # part of a step over which forces are differenced in time
NO_SLOPE, TOGETHER, HIT_TWICE, ASIDE, SEVERAL, PARTED = (
    1.0,
    2.0,
    3.0,
    4.0,
    5.0,
    6.0,
)  # why derivatives end


@kernel(i8(of_duals, f8, i8), nogil=True, later=True)
def find_of_duals(scene, margin, placed):
    """`contact_points`."""
    return contact_points(scene, margin, placed)


@kernel(i8(of_duals, D1, D1, D1), nogil=True, later=True)
def forces_of_duals(scene, v, tau, flow):
    """`push_contacts`."""
    return push_contacts(scene, v, tau, flow)


# run of duals, run of numbers, runs of duals, finished part, widths, first block, pass
PART = void(of_duals, i8, i8, f8, f8, f8, i8, i8)
call_part = caller(PART)


@kernel(REPEAT, nogil=True, later=True)
def repeat_part(carried, numbers, done, h, w, first, which):
    """Repeat a pass of a sub-step in all runs of duals."""
    given = carried_at(carried)
    for k in range(given.runs.shape[0]):
        call_part(given.part, (given.runs[k], numbers, carried, done, h, w, first, which))


@kernel(PART, nogil=True, later=True)
def part_of_duals(run, numbers, carried, done, h, w, first, which):
    """Repeat a pass of a sub-step from the state CANDIDATE, or begin a step (`first` = 0).

    A step may be taken again, since the location of an event takes shorter ones in between. The end
    of the time before is kept in Y_OLD, and the width of its last sub-step in LAST_WIDTH.
    """
    data = opened_run(run)
    scene, stages = data.scene, data.stages
    if first == 0:
        copied(stages, at.CANDIDATE, at.Y_OLD, stages.shape[1])
        stages[at.LAST_WIDTH, 0] = stages[at.PART_TIMES, TIMES.taken]
        copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
        stages[at.PART_TIMES, TIMES.begun] = 0.0
        parted(stages[at.PART_TIMES])[TIMES.left, 0] = 0.0
        return
    moves = end_moves(numbers)
    t, late = opened_run(numbers).control[0].clock.time + done, w < h or moves > 0.0
    if which == MIDPOINT:
        move_again(run, t, w, late)
    else:
        take_values(run, numbers, at.CANDIDATE, at.PART_BEFORE)
        if w == 0.0:
            locate_impact(run, numbers, carried, (done, h), first)
        elif parted(stages[at.PART_TIMES])[TIMES.left, 0] > 0.0:
            locate_end(run, numbers, (done, h))
        begin_part(run, done, h, w, moves)
        if w > 0.0 and done == 0.0 and opened_run(numbers).counters[0].steps == 0:
            end_where_parted(run, numbers, carried, first)
        copied(stages, at.CANDIDATE, at.PART_BEFORE, stages.shape[1])
        move_freely(run, t, h, w, late)
    width = stages[at.PART_TIMES, TIMES.taken]
    nq, nv = size_of_state(run)
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    vdot, before = stages[at.SLOPE, nq : nq + nv], stages[at.PART_BEFORE, nq : nq + nv]
    ledger, flow = stages[at.CANDIDATE, nq + nv :], data.flow
    scene_of_numbers = opened_run(numbers).scene
    own = opened(scene)
    space = own.space
    turn_rates(own.rows, own.const, own.work, v)
    set_rows(scene, scene_of_numbers, first, h, width, q, v)
    turn_rates(own.rows, own.const, own.work, space.vectors[MEAN, :nv])
    for k in range(nv):
        space.vectors[EFFECT, k] = 0.0
    if own.blocks.active[0] > 0:
        m = number_rows(own.blocks, space.slots)
        set_velocities(scene, t, t + w, width, v, vdot, m)
        if late and first > 1:
            follow_width(run, t + w, h, m)
        unit_responses(own.rows, own.const, own.blocks, own.work, space)
        given = carried_at(carried)
        unclear, loose = impulses_of_duals(scene, scene_of_numbers, given, first, m)
        if unclear:
            end_derivatives(carried, t, NO_SLOPE)
        if loose:
            end_derivatives(carried, t, SEVERAL)
    if which == EXPLICIT:
        find_mean(scene, width, v, vdot, own.blocks.active[0])
        return
    relax_drives(scene)
    ledger[at.WORK_DONE] += width * flow[0]
    ledger[at.DISSIPATED] += width * flow[1]
    if own.blocks.active[0] > 0:
        spread(own.rows, own.const, own.work, space.vectors[EFFECT])
    for j in range(nv):
        v[j] += width * vdot[j] + space.vectors[EFFECT, j]
    damping, tau = stages[at.PART_DAMPING, :nv], stages[at.TORQUE, :nv]
    mean = space.vectors[MEAN]
    book_drives(own.rows, own.drives, tau, before, mean, damping, width, v, ledger)
    if first > 1:
        work = driven_power(own.blocks, space, before) + driven_power(own.blocks, space, v)
        ledger[at.WORK_DONE] += 0.5 * work
    advance(own.rows, q, v, 0.5 * width)
    if own.blocks.active[0] >= first and w > 0.0:
        for j in range(first, own.blocks.active[0] + 1):
            own_block(space.y, space.slots, space.vectors[DINV], own.blocks.active[j], space.own)
        push_out(scene, first, h, q)
    stages[at.PART_TIMES, TIMES.begun] = stages[at.PART_TIMES, TIMES.begun] + width
    cease(carried, stages[at.CANDIDATE])


@part
def end_moves(numbers):
    """Return 1 if all derivatives of the width of the step are 1, else 0."""
    return 1.0 if opened_run(numbers).control[0].clock.repeated == MOVING else 0.0


@sweep
def begin_part(run, done, h, w, moves):
    """Set the derivatives of the width of a sub-step. The last one ends with the step, the width of
    which has the derivatives `moves`.
    """
    stages = opened_run(run).stages
    begun, taken = (
        parted(stages[at.PART_TIMES])[TIMES.begun],
        parted(stages[at.PART_TIMES])[TIMES.taken],
    )
    if w > 0.0:
        state = parted(stages[at.CANDIDATE])
        for i in range(stages.shape[1]):
            state[i, BY_WIDTH] = 0.0
        begun[BY_WIDTH] = 0.0
    last = w > 0.0 and w == h - done
    for k in range(1, BY_WIDTH):
        taken[k] = moves - begun[k] if last else 0.0
    taken[0] = w
    taken[BY_WIDTH] = 1.0 if w > 0.0 and not last else 0.0
    if w > 0.0:
        left = parted(stages[at.PART_TIMES])[TIMES.left]
        left[0] = 0.0 if last else h - done
        for k in range(1, BY_WIDTH):
            left[k] = moves - begun[k]
        copied(stages, at.CANDIDATE, at.PART_START, stages.shape[1])


@sweep
def move_freely(run, t, h, w, moves):
    """Move to the middle of a sub-step, whose time may move, and compute v' and the power."""
    data = opened_run(run)
    scene, stages = data.scene, data.stages
    nq, nv = size_of_state(run)
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    own, width = opened(scene), stages[at.PART_TIMES, TIMES.taken]
    active = own.blocks.active
    count = active[0]
    active[0] = 0
    advance(own.rows, q, v, 0.5 * width)
    if moves and w > 0.0:
        differ_in_time(run, t + 0.5 * w, SHIFT * h)
    accelerate(run, t + 0.5 * w)
    end_later(run, w, moves)
    active[0] = count


@sweep
def move_again(run, t, w, moves):
    """Compute v' and the power again at the mean velocity of the first pass."""
    data = opened_run(run)
    stages, own, width = data.stages, opened(data.scene), data.stages[at.PART_TIMES, TIMES.taken]
    nq, nv = size_of_state(run)
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    tau, vdot, active = stages[at.TORQUE, :nv], stages[at.SLOPE, nq : nq + nv], own.blocks.active
    count, mean = active[0], own.space.vectors[MEAN, :nv]
    active[0] = 0
    soften_drives(data.scene, width, v)
    time = t + 0.5 * w
    call_acceleration(data.links.accelerate, (data.scene, time, q, mean, tau, vdot, data.flow))
    end_later(run, w, moves)
    active[0] = count


@sweep
def end_later(run, w, moves):
    """Add what moves with the time of a sub-step to v' and the power, and complete v'."""
    data = opened_run(run)
    stages, flow = data.stages, data.flow
    nq, nv = size_of_state(run)
    vdot, width = stages[at.SLOPE, nq : nq + nv], stages[at.PART_TIMES, TIMES.taken]
    if moves and w > 0.0:
        late = revalued(stages[at.PART_TIMES, TIMES.begun] + 0.5 * width, 0.0)
        for j in range(nv):
            vdot[j] += stages[at.FORCE_SLOPE, nq + j] * late
        flow[0] += stages[at.FORCE_SLOPE, nq + nv] * late
        flow[1] += stages[at.FORCE_SLOPE, nq + nv + 1] * late
    end_acceleration(run, w, width)


@sweep
def accelerate(run, t):
    """Compute v' and the power of CANDIDATE at time t, with drives as inertia."""
    data = opened_run(run)
    stages, width = data.stages, data.stages[at.PART_TIMES, TIMES.taken]
    nq, nv = size_of_state(run)
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    tau, vdot = stages[at.TORQUE, :nv], stages[at.SLOPE, nq : nq + nv]
    stiffen_drives(data.scene, t, width, q, v)
    vectors = opened(data.scene).space.vectors
    for j in range(nv):
        vectors[MEAN, j] = v[j]
        vectors[KICK, j] = 0.0
        stages[at.PART_DAMPING, j] = vectors[DAMPING, j]
    call_acceleration(data.links.accelerate, (data.scene, t, q, v, tau, vdot, data.flow))


@sweep
def differ_in_time(run, t, shift):
    """Write the slopes of v' and of the power in time into FROM, by central differences."""
    data = opened_run(run)
    stages, flow = data.stages, data.flow
    nq, nv = size_of_state(run)
    for sign in (-1.0, 1.0):
        accelerate(run, t + sign * shift)
        relax_drives(data.scene)
        for j in range(nv):
            x = sign * stages[at.SLOPE, nq + j] / (2.0 * shift)
            stages[at.FORCE_SLOPE, nq + j] = x if sign < 0.0 else stages[at.FORCE_SLOPE, nq + j] + x
        for c in range(2):
            x = sign * flow[c] / (2.0 * shift)
            stages[at.FORCE_SLOPE, nq + nv + c] = (
                x if sign < 0.0 else stages[at.FORCE_SLOPE, nq + nv + c] + x
            )


@sweep
def set_rows(scene, numbers, first, h, width, q, v):
    """Write the unilateral rows, from block `first` on, as the primal run has chosen them."""
    blocks, given = opened(scene).blocks, opened(numbers).blocks.blocks_f
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    if touches(numbers):
        look_for_points(scene, numbers, v)
    for j in range(first, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        if kind == at.T_FRICTION:
            blocks_f[i, at.AIM] = width * blocks_f[i, at.VALUE]
        elif kind == at.T_SPAN:
            span_reaches(scene, i, h, width, v)
        elif kind == at.T_CONTACT:
            set_contact(scene, numbers, i, h)
        else:
            blocks_f[i, at.AIM] = 0.0
            if given[i, at.AIM] != 0.0:
                blocks_f[i, at.AIM] = 2.0 * limit_gap(blocks, i, q) / width
            blocks_f[i, at.BOUNCE] = 0.0
            if given[i, at.BOUNCE] != 0.0:
                blocks_f[i, at.BOUNCE] = blocks_f[i, at.REBOUND]


@part
def touches(numbers):
    """Check whether the scene has contacts between shapes."""
    return contacts_at(opened(numbers).links.contacts).laws.shape[0] > 0


@sweep
def look_for_points(scene, numbers, v):
    """Find the contact points of the primal run again, after `positions`, with velocities."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    velocities(data.rows, data.const, data.work, v, data.space.linear)
    place(contacts.geometry.shapes, data.work, contacts.poses)
    touching(scene, contacts_at(opened(numbers).links.contacts).tally[0].margin, 1)


@part
def set_contact(scene, numbers, i, h):
    """Write the block of a contact point, with the contact laws selected by the primal run."""
    blocks, given = opened(scene).blocks, opened(numbers).blocks.blocks_f
    contacts = contacts_at(opened(scene).links.contacts)
    n = i - contacts.tally[0].first_contact
    law = contacts.laws[contacts.found[n].pair]
    set_block(contacts, blocks, n, i, given[i, at.FRICTION] == law.friction)
    blocks.blocks_f[i, at.VALUE] = 0.0
    if given[i, at.VALUE] != 0.0:
        blocks.blocks_f[i, at.VALUE] = contacts.found[n].gap / h
    if given[i, at.BOUNCE] == 0.0:
        blocks.blocks_f[i, at.BOUNCE] = 0.0


@sweep
def follow_width(run, t, h, m):
    """Add the change in speed of prescribed motions if the sub-step ends later, at t."""
    data = opened_run(run)
    own, stages = opened(data.scene), data.stages
    vectors, nv = own.space.vectors, data.control[0].nv
    end = revalued(stages[at.PART_TIMES, TIMES.begun] + stages[at.PART_TIMES, TIMES.taken], 0.0)
    for sign in (-1.0, 1.0):
        row = vectors[SOONER] if sign < 0.0 else vectors[LATER]
        moment = t + sign * SHIFT * h
        residual_velocity(own.blocks, own.work, own.space, moment, vectors[SPEEDS, :nv], row)
    for r in range(m):
        slope = (vectors[LATER, r] - vectors[SOONER, r]) / (2.0 * SHIFT * h)
        vectors[RHS, r] += slope * end


# -- the time of an impact -------------------------------------------------------------------------


@part
def gap_of(scene, numbers, i, q):
    """Return the gap of a limit or a contact point, after `follow_path`."""
    data = opened(scene)
    blocks = data.blocks
    if type_of(blocks.blocks_i, i) == at.T_LIMIT:
        return limit_gap(blocks, i, q)
    if type_of(blocks.blocks_i, i) == at.T_CONTACT:
        return gap_of_point(scene, numbers, i)
    a, b = ends_of(blocks.blocks_i, i)
    return span(blocks.blocks_f, i, data.work, a, b)[0]


@sweep
def place_of_point(scene, numbers, i):
    """Return the index of the contact point that is block i of the primal run, -1 if there is none.

    The order of the points may differ because of rounding.
    """
    contacts, given = (
        contacts_at(opened(scene).links.contacts),
        contacts_at(opened(numbers).links.contacts),
    )
    found, point = contacts.found, given.found[i - given.tally[0].first_contact]
    for n in range(contacts.tally[0].found):
        same = found[n].shape_a == point.shape_a and found[n].shape_b == point.shape_b
        if same and found[n].feature == point.feature:
            return n
    return -1


@part
def gap_of_point(scene, numbers, i):
    """Return the gap of the contact point that is block i of the primal run, or nan."""
    found, n = contacts_at(opened(scene).links.contacts).found, place_of_point(scene, numbers, i)
    return found[n].gap if n >= 0 else math.nan * found[0].gap


@sweep
def end_where_parted(run, numbers, carried, first):
    """End derivatives that change the gap of what carries load from the start of a run.

    The gap closes in a time that has no derivatives.
    """
    data, of_numbers = opened_run(run), opened_run(numbers).scene
    scene, stages = data.scene, data.stages
    own, given = opened(scene), opened(of_numbers)
    nq, nv = size_of_state(run)
    state, gaps = parted(stages[at.CANDIDATE]), own.space.vectors[PATH_GAPS]
    q, v, gap = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv], parted(gaps)
    frames(own.rows, own.const, own.work, q, v)
    positions(own.rows, own.work)
    if touches(of_numbers):
        look_for_points(scene, of_numbers, v)
    for j in range(first, own.blocks.active[0] + 1):
        i = own.blocks.active[j]
        if not given.space.vectors[LAMBDA, first_of(given.space.slots, i)] > 0.0:
            continue
        if type_of(own.blocks.blocks_i, i) == at.T_FRICTION:  # friction of a joint has no gap
            continue
        point = type_of(own.blocks.blocks_i, i) == at.T_CONTACT
        n = place_of_point(scene, of_numbers, i) if point else -1
        gaps[0] = gap_of(scene, of_numbers, i, q)
        for k in range(1, BY_WIDTH):
            moved = 0.0
            for m in range(nq):
                moved = max(moved, abs(state[m, k]))
            if n >= 0:
                place_of_a = contacts_at(own.links.contacts).found[n].point_a
                for c in range(3):
                    moved = max(moved, abs(parted(place_of_a)[c, k]))
            if abs(gap[0, k]) > NOTABLE * moved:
                end_derivatives(carried, opened_run(numbers).control[0].clock.time, PARTED)


@sweep
def locate_impact(run, numbers, carried, place, first):
    """Add the derivatives of the time of an impact to the state before it.

    The block with the largest closing speed determines these derivatives. Impacts that coincide by
    chance have no common derivative. The same holds for an impact that does not end a path, such as
    one of shapes that touch already. `place` is (finished part of the step, its width).
    """
    data = opened_run(run)
    scene, stages = data.scene, data.stages
    own, given = opened(scene), opened(opened_run(numbers).scene)
    active, gaps = own.blocks.active, own.space.vectors[PATH_GAPS]
    chief, fastest = -1, 0.0
    for j in range(first, active[0] + 1):
        r = first_of(given.space.slots, active[j])
        closing = -given.space.vectors[BEFORE, r]
        if given.space.vectors[LAMBDA, r] > 0.0 and closing > fastest:
            chief, fastest = active[j], closing
    if chief < 0:
        return
    if not parted(stages[at.PART_TIMES])[TIMES.left, 0] > 0.0:  # no part has ended here
        end_derivatives(carried, opened_run(numbers).control[0].clock.time + place[0], HIT_TWICE)
        return
    follow_path(run, numbers, place)
    q = stages[at.CANDIDATE, : data.control[0].nq]
    of_numbers = opened_run(numbers).scene
    if touches(of_numbers):
        look_for_points(scene, of_numbers, own.space.vectors[WAY_SPEEDS, : data.control[0].nv])
    gaps[0] = gap_of(scene, of_numbers, chief, q)
    gap = parted(gaps)
    if not abs(gap[0, 0]) <= reached(given, chief):  # nan if there is no such point
        end_derivatives(carried, opened_run(numbers).control[0].clock.time, ASIDE)
    for j in range(first, active[0] + 1):
        i = active[j]
        r = first_of(given.space.slots, i)
        closing = -given.space.vectors[BEFORE, r]
        if given.space.vectors[LAMBDA, r] > 0.0 and closing > NOTABLE * fastest:
            gaps[1] = gap_of(scene, of_numbers, i, q)
            for k in range(1, BY_WIDTH):
                share = gap[1, BY_WIDTH] / gap[0, BY_WIDTH]
                if abs(gap[1, k] - share * gap[0, k]) > NOTABLE * (abs(gap[1, k]) + abs(gap[0, k])):
                    end_derivatives(carried, opened_run(numbers).control[0].clock.time, TOGETHER)
    arrive(run)


@part
def reached(given, i):
    """Return the largest gap of block i at the end of a path to its impact, with rounding [m]."""
    if type_of(given.blocks.blocks_i, i) != at.T_CONTACT:
        return math.inf
    contacts = contacts_at(given.links.contacts)
    point = contacts.found[i - contacts.tally[0].first_contact]
    return 2.0 * closed_gap(contacts, point.shape_a, point.shape_b, xyz(point.point_a))


@sweep
def locate_end(run, numbers, place):
    """Add the derivatives of the end time of a sub-step without an impact to the state.

    The part ended where a limit or a contact point closes on the path, but itself went another way.
    An impact shortly after it, or within the next part, has the same derivatives. An end at which
    nothing closes is held, because the path is not known beyond it.
    """
    data = opened_run(run)
    scene, stages = data.scene, data.stages
    of_numbers = opened_run(numbers).scene
    own, given = opened(scene), opened(of_numbers)
    gaps, contacts = own.space.vectors[PATH_GAPS], contacts_at(given.links.contacts)
    tally, gap = contacts.tally[0], parted(gaps)
    follow_path(run, numbers, place)
    q = stages[at.CANDIDATE, : data.control[0].nq]
    least, fastest = math.inf, 0.0
    for k in range(WIDTH):
        gap[0, k] = 1.0 if k == BY_WIDTH else 0.0  # nothing moves the end
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        located = given.blocks.blocks_f[i, at.LOCATED]  # perhaps from here, for the next end
        if located < math.inf:
            gaps[1] = gap_of(scene, of_numbers, i, q)
            if abs(gap[1, 0]) < min(least, 0.5 * located):
                least = abs(gap[1, 0])
                gaps[0] = gaps[1]
    if least == math.inf and touches(of_numbers):
        look_for_points(scene, of_numbers, own.space.vectors[WAY_SPEEDS, : data.control[0].nv])
        mine = contacts_at(own.links.contacts)
        for n in range(mine.tally[0].found):
            point = mine.found[n]
            p = contacts.poses[point.shape_a].position
            gaps[1] = point.gap
            closed = 2.0 * closed_gap(contacts, point.shape_a, point.shape_b, xyz(p))
            if abs(gap[1, 0]) <= closed and gap[1, BY_WIDTH] < fastest:
                fastest = gap[1, BY_WIDTH]
                gaps[0] = gaps[1]
    arrive(run)


@sweep
def arrive(run):
    """Return from the path to the saved state, at the time at which the first gap closes."""
    data = opened_run(run)
    stages, gap = data.stages, parted(opened(data.scene).space.vectors[PATH_GAPS])
    copied(stages, at.WAITING, at.CANDIDATE, stages.shape[1])
    stages[at.PART_TIMES, TIMES.begun] = stages[at.PART_TIMES, TIMES.kept]
    stages[at.PART_TIMES, TIMES.taken] = 0.0
    state, times = parted(stages[at.CANDIDATE]), parted(stages[at.PART_TIMES])
    for k in range(1, BY_WIDTH):
        later = -gap[0, k] / gap[0, BY_WIDTH]
        for i in range(stages.shape[1]):
            state[i, k] += state[i, BY_WIDTH] * later
        times[TIMES.begun, k] += times[TIMES.begun, BY_WIDTH] * later
    for i in range(stages.shape[1]):
        state[i, BY_WIDTH] = 0.0
    times[TIMES.begun, BY_WIDTH] = 0.0
    times[TIMES.left, 0] = 0.0


@sweep
def follow_path(run, numbers, place):
    """Go along the path without impulses on which the impact was looked for, as `state_at`."""
    data = opened_run(run)
    scene, stages = data.scene, data.stages
    nq, nv = size_of_state(run)
    done, h = place
    left = parted(stages[at.PART_TIMES])[TIMES.left, 0]
    copied(stages, at.CANDIDATE, at.WAITING, stages.shape[1])
    copied(stages, at.PART_START, at.CANDIDATE, stages.shape[1])
    copied(stages, at.PART_START, at.PART_BEFORE, stages.shape[1])
    stages[at.PART_TIMES, TIMES.kept] = stages[at.PART_TIMES, TIMES.begun]
    stages[at.PART_TIMES, TIMES.begun] = -stages[at.PART_TIMES, TIMES.left]
    moves, begun = end_moves(numbers), parted(stages[at.PART_TIMES])[TIMES.begun]
    for k in range(1, BY_WIDTH):
        begun[k] += moves
    stages[at.PART_TIMES, TIMES.taken] = stages[at.PART_TIMES, TIMES.left]
    move_freely(
        run,
        opened_run(numbers).control[0].clock.time + (h - left),
        h,
        left,
        left < h or moves > 0.0,
    )
    relax_drives(scene)
    copied(stages, at.PART_START, at.CANDIDATE, stages.shape[1])
    stages[at.PART_TIMES, TIMES.taken] = done - (h - left)
    parted(stages[at.PART_TIMES])[TIMES.taken, BY_WIDTH] = 1.0
    own, time = opened(scene), stages[at.PART_TIMES, TIMES.taken]
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    speed = own.space.vectors[WAY_SPEEDS, :nv]
    for j in range(nv):
        speed[j] = v[j] + 0.5 * time * stages[at.SLOPE, nq + j]
    advance(own.rows, q, speed, time)
    frames(own.rows, own.const, own.work, q, v)
    positions(own.rows, own.work)


# -- ends ------------------------------------------------------------------------------------------


@part
def end_derivatives(carried, t, why):
    """Note the first time at which derivatives do not exist."""
    ended = carried_at(carried).ended
    if ended[1] == 0.0:
        ended[0] = t
        ended[1] = why


@sweep
def cease(carried, state):
    """Make all derivatives nan once they have ended."""
    if carried_at(carried).ended[1] != 0.0:
        derivatives = parted(state)
        for i in range(state.shape[0]):
            for k in range(1, WIDTH):
                derivatives[i, k] = math.nan


@kernel(STEP_OF_DUALS, nogil=True, later=True)
def moreau_jean_of_duals(run, numbers):
    """Complete a step after repeating all sub-steps.

    The derivatives of PART_START become how much more those of the repetition before are.
    """
    stages = opened_run(run).stages
    start, end, moved = (
        parted(stages[at.PART_START]),
        parted(stages[at.CANDIDATE]),
        parted(stages[at.Y_OLD]),
    )
    for i in range(stages.shape[1]):
        for k in range(1, BY_WIDTH):
            start[i, k] = moved[i, k] - end[i, k]
        end[i, BY_WIDTH] = 0.0
    end_step(run, numbers)
