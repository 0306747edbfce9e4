"""Derivatives of the time of an impact within a step of time stepping."""

import math

from ...tolerances import NOTABLE
from .. import layout as at
from ..arrays import (
    BEFORE,
    LAMBDA,
    PATH_GAPS,
    WAY_SPEEDS,
    carried_at,
    opened_run,
)
from ..cables import cable_length
from ..compiler.dual import WIDTH, parted
from ..compiler.jit import part, sweep
from ..constraints.blocks import (
    dry,
    ends_of,
    first_of,
    span,
    stations_of,
    type_of,
)
from ..contact.closing import closed_gap
from ..contact.contacts import (
    contacts_at,
)
from ..contact.meeting import limit_gap
from ..motion import opened
from ..tree.kinematics import frames, positions
from ..tree.moving import advance
from ..vec import xyz
from .duals_within import (
    ASIDE,
    BY_WIDTH,
    HIT_TWICE,
    PARTED,
    TIMES,
    TOGETHER,
    end_moves,
    look_for_points,
    move_freely,
    touches,
)
from .moreau import relax_drives
from .state import copied, size_of_state


@part
def gap_of(scene, numbers, i, q):
    """Return the gap of a limit or a contact point, after `follow_path`."""
    data = opened(scene)
    blocks = data.blocks
    if type_of(blocks.blocks_i, i) == at.T_LIMIT:
        return limit_gap(blocks, i, q)
    if type_of(blocks.blocks_i, i) == at.T_CONTACT:
        return gap_of_point(scene, numbers, i)
    if type_of(blocks.blocks_i, i) == at.T_SLACK:
        first, last = stations_of(blocks.blocks_i, i)
        length = cable_length(blocks.stations, data.work, q, first, last)
        return blocks.blocks_f[i, at.VALUE] - length
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
        if dry(type_of(own.blocks.blocks_i, i)):  # friction has no gap
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
        slope = stages[at.SLOPE, nq + j] + opened_run(numbers).stages[at.BENT, j]
        speed[j] = v[j] + 0.5 * time * slope
    advance(own.rows, q, speed, time)
    frames(own.rows, own.const, own.work, q, v)
    positions(own.rows, own.work)


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
