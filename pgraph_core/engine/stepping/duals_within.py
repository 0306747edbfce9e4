"""Derivatives of a part of a step of time stepping: its free motion, rows and contact points."""

from ...tolerances import step_of_differences
from .. import layout as at
from ..arrays import (
    DAMPING,
    KICK,
    LATER,
    MEAN,
    RHS,
    SOONER,
    SPEEDS,
    opened_run,
)
from ..compiler.dual import WIDTH, parted, revalued
from ..compiler.jit import part, sweep
from ..constraints.blocks import (
    residual_velocity,
    type_of,
    velocities,
)
from ..contact.contacts import (
    contacts_at,
    set_block,
    touching,
)
from ..contact.meeting import limit_gap
from ..contact.placing import place
from ..motion import call_acceleration, opened
from ..records import columns
from ..tree.moving import advance
from .duals import MOVING
from .moreau import (
    end_acceleration,
    relax_drives,
    soften_drives,
    stiffen_drives,
)
from .state import copied, size_of_state
from .unilateral import segment_reaches, set_wrap, span_reaches

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
        elif kind == at.T_SLACK:
            segment_reaches(scene, i, h, width, q, v)
        elif kind == at.T_WRAP:
            set_wrap(scene, i)
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
