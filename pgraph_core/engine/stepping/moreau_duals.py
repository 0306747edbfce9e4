"""Derivatives of time stepping, computed by repeating each sub-step with dual numbers.

An impact ends a sub-step at a time that depends on all parameters. The last derivative of a dual is
therefore with respect to the width of the sub-step. Since the gap is zero at the impact, the
derivatives of the sub-step width follow from the derivatives of the gap. They determine the jump of
the state derivatives, which is also known as saltation ([Müller 1995]).

A step that ends at an event is repeated twice, the first time with an end that moves. The
difference of the derivatives is the rate of the state at the end.
"""

from .. import layout as at
from ..arrays import (
    DINV,
    EFFECT,
    MEAN,
    carried_at,
    opened_run,
)
from ..compiler.address import caller
from ..compiler.dual import parted
from ..compiler.jit import kernel
from ..compiler.kinds import f8, i8, of_duals, void
from ..constraints.constraints import driven_power, number_rows, unit_responses
from ..constraints.paths import spread
from ..contact.contacts import (
    contact_points,
    push_contacts,
)
from ..contact.slopes import impulses_of_duals
from ..contact.sweeps import own_block
from ..motion import opened
from ..tree.moving import advance
from .duals import D1, STEP_OF_DUALS, end_step, take_values
from .duals_within import (
    BY_WIDTH,
    NO_SLOPE,
    SEVERAL,
    TIMES,
    begin_part,
    end_moves,
    follow_width,
    move_again,
    move_freely,
    set_rows,
)
from .impact_times import cease, end_derivatives, end_where_parted, locate_end, locate_impact
from .moreau import EXPLICIT, MIDPOINT, REPEAT, book_drives, find_mean, relax_drives
from .row_speeds import set_velocities, turn_rates
from .state import copied, size_of_state
from .unilateral import push_out


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
        set_velocities(scene, t, t + w, width, q, v, vdot, m)
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
    book_drives(scene, tau, before, damping, width, v, ledger)
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


# -- the time of an impact -------------------------------------------------------------------------


# -- ends ------------------------------------------------------------------------------------------


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
