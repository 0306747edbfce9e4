"""Moreau-Jean time stepping, with smooth forces and impulses in a single velocity update.

q_m = q + h/2 v; v⁺ = v + h v'(q_m, v_m) + M⁻¹ Jᵀ λ with all that touches at q_m;
q⁺ = q_m + h/2 v⁺ ([Moreau 1988], [Jean 1999]). The mean velocity v_m is that of a first pass with
v'(q_m, v), which includes its impulses, so that the rule is of second order between events. Rows
turn within the step: their speeds are J v⁺ + h/2 J' v_m at its end, and J v - h/2 J' v_m at its
start. Impacts need no events, many at once cost no more than one. Freely rotating bodies conserve
their energy at any speed (`tree.spinning`). States of controls follow the midpoint rule:
x⁺ = x + h x'(q_m, v_m, x_m) with v_m = ½ (v + v⁺) and x_m half a step of Euler's rule ahead, which
forces read.

Dampers and servos are stable for any stiffness, since they are inertia in a step (`armatures`). The
first pass evaluates them at the end of the step. The second one takes back the share of this that
is due to their mean in the step, from the change of v in the first pass.

A step with impacts is divided into sub-steps that end at the impacts. An impact is a sub-step of
zero length. Compliant and slow contacts are only detected at the midpoint of a sub-step.
"""

import math

from ...tolerances import COINCIDENT, SOLVED, TINY
from .. import layout as at
from ..arrays import (
    BARRED,
    CALMED,
    DAMPING,
    DINV,
    DRIVEN,
    EFFECT,
    FACTORED,
    FACTORS,
    FREE_SPIN,
    GAINED,
    GYRE,
    HARD,
    KICK,
    LAMBDA,
    LOOSE,
    MEAN,
    MISSED,
    OWN_ARMATURE,
    OWN_GIVEN,
    PUSH,
    REPORT,
    SPEEDS,
    STEPS_DONE,
    STIFFNESS,
    STRAYS,
    SWEEPS_DONE,
    UNPUSHED,
    WAY_SPEEDS,
    ZERO,
    carried_at,
    opened_run,
)
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import f8, i8, void
from ..constraints.blocks import (
    first_of,
    size_of,
    type_of,
)
from ..constraints.constraints import add_wrenches, driven_power, number_rows, unit_responses
from ..constraints.paths import spread, unspread
from ..contact.contacts import ADDING, FROZEN, clear, contacts_at, kept_place
from ..contact.impulse import solve_impulses
from ..contact.meeting import first_meeting, hits_at_once, state_at
from ..contact.newton import TRANSIENT
from ..contact.passing import keep_poses, note_passages
from ..drives import at_its_limit
from ..motion import (
    call_acceleration,
    call_contact_forces,
    energies,
    find_rates,
    follow,
    opened,
)
from ..rows import (
    set_kept,
)
from ..signals import gives_rates, put_rates
from ..tree.kinematics import positions
from ..tree.moving import advance
from ..tree.spinning import SPIN, keep_gyrating, keep_spinning
from ..vec import finite, set_xyz, store, xyz
from .armatures import corrections, relax, soften, stiffen
from .booking import book, note_chain
from .row_speeds import before_switch, set_velocities, turn_rates
from .state import NOT_MET, copied, size_of_state
from .state import STEP as STEP_SIGNATURE
from .unilateral import (
    ASK,
    CUT,
    REMAINDER,
    TAKE,
    add_passed,
    add_unilateral,
    keep_resting,
    limit_on_the_way,
    push_out,
)

# runs of duals, run of numbers, finished part of the step, its width, that of the part, first block
# or 0 to begin the step, perhaps again, and the pass
REPEAT = void(i8, i8, f8, f8, f8, i8, i8)
call_repeat = caller(REPEAT)

WAITS, ACTED = 1, 2  # a switch of constraints, for the next step and in the last one
MOST_PARTS = 2000  # limit on the sub-steps of a step, two per located impact
# passes of a part: with forces at the velocity of its start, at its mean velocity, or the only one
EXPLICIT, MIDPOINT, ONLY = 0, 1, 2


@kernel(STEP_SIGNATURE, nogil=True)
def moreau_jean(run, h):
    """Take one step from Y into CANDIDATE, divided into sub-steps at impacts."""
    this = opened_run(run)
    scene, stages = this.scene, this.stages
    space = opened(scene).space
    tally = contacts_at(opened(scene).links.contacts).tally[0]
    nq, nv = size_of_state(run)
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    repeat(run, 0.0, h, 0.0, 0, ONLY)
    q = stages[at.CANDIDATE, :nq]
    v = stages[at.CANDIDATE, nq : nq + nv]
    vdot = stages[at.SLOPE, nq : nq + nv]
    clear(opened(scene).links.contacts)
    blocks_f = opened(scene).blocks.blocks_f
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        blocks_f[i, at.LOCATED] = math.inf
    for i in range(tally.first_limit - tally.frictions):
        store(blocks_f, i, at.PULL, (0.0, 0.0, 0.0))
        store(blocks_f, i, at.PULL + 3, (0.0, 0.0, 0.0))
    tally.frozen, tally.width = ADDING, h
    tally.barred = 0
    t = this.control[0].clock.time
    done = 0.0
    parts = 0
    w = 0.0
    stuck = False
    if stages[at.UNSWITCHED, nq + nv + 1] == ACTED:
        stages[at.UNSWITCHED, nq + nv + 1] = WAITS
    while True:
        left = h - done
        again = parts < MOST_PARTS and not stuck
        if w > 0.0 and again and hits_at_once(scene, h, q, v, vdot):
            w = 0.0
        elif part_of_step(run, done, h, left, ASK if again else REMAINDER):
            start = stages[at.PART_BEFORE]
            state_at(scene, 0.0, q, v, start, vdot, space.vectors[WAY_SPEEDS, :nv])
            if parts == 0:
                keep_poses(scene)
            w = first_meeting(scene, h, left, q, v, start, vdot, space.vectors[WAY_SPEEDS, :nv])
        else:
            break
        parts += 1
        if part_of_step(run, done, h, w, CUT):  # constraints lead to a limit before
            start = stages[at.PART_BEFORE]
            state_at(scene, 0.0, q, v, start, vdot, space.vectors[WAY_SPEEDS, :nv])
            w = first_meeting(scene, h, w, q, v, start, vdot, space.vectors[WAY_SPEEDS, :nv])
            part_of_step(run, done, h, w, TAKE)
        if w == left or tally.barred == 1:
            break
        stuck = w == 0.0 and not changed(stages[at.PART_BEFORE], stages[at.CANDIDATE], nq, nv)
        tally.cuts += 1
        done += w
    if parts == MOST_PARTS:  # the rest was taken at once, as a time step without location
        tally.crowded += 1
        if tally.crowded == 1:
            tally.crowded_time = t + done
    if parts > 0:
        state_at(scene, 0.0, q, v, stages[at.CANDIDATE], vdot, space.vectors[WAY_SPEEDS, :nv])
        note_passages(scene, t + h)
    tally.frozen = FROZEN
    if tally.barred == 1:
        return NOT_MET
    return 0.0 if finite(stages[at.CANDIDATE]) else math.inf


@part
def repeat(run, done, h, w, first, which):
    """Repeat what the arguments of REPEAT say in all runs of duals, if there are any."""
    carried = opened_run(run).control[0].guard.carried
    if carried != 0:
        call_repeat(carried_at(carried).repeat, (carried, run, done, h, w, first, which))


@sweep
def changed(before, after, nq, nv):
    """Check whether an impact changed velocities by more than the solver's tolerance.

    Otherwise it would be detected again immediately, for example if a prescribed motion pushes into
    the ground.
    """
    most = 0.0
    change = 0.0
    for j in range(nq, nq + nv):
        most = max(most, abs(before[j]))
        change = max(change, abs(after[j] - before[j]))
    return change > SOLVED * most


@sweep
def part_of_step(run, done, h, w, mode):
    """Advance CANDIDATE by a part of width w, from `done` on, of a step of width h.

    If requested, the function returns True if an impact may occur within the sub-step, without
    changing CANDIDATE. If constraints lead to the impact of a limit, SLOPE is then v' with their
    impulses. A part without width is an impact of all that touches. The state before is in
    PART_BEFORE.
    """
    this = opened_run(run)
    scene, stages = this.scene, this.stages
    t = this.control[0].clock.time + done
    nq, nv = size_of_state(run)
    copied(stages, at.CANDIDATE, at.PART_BEFORE, stages.shape[1])
    q = stages[at.CANDIDATE, :nq]
    v = stages[at.CANDIDATE, nq : nq + nv]
    ledger = stages[at.CANDIDATE, nq + nv :]
    before = stages[at.PART_BEFORE, nq : nq + nv]
    vdot = stages[at.SLOPE, nq : nq + nv]
    damping = stages[at.PART_DAMPING, :nv]
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    active = blocks.active
    bilateral = active[0]
    states = data.loads.signals[2].shape[0]
    if mode == ASK and bilateral > 0:
        for j in range(nv):
            stages[at.BENT, j] = 0.0
    accelerate(run, t, h, w)
    first = bilateral + 1
    if add_unilateral(scene, h, w, h - done, mode, q, v, vdot):
        relax_drives(scene)
        take_back(run, h, w)
        active[0] = bilateral
        return True
    which = EXPLICIT if w > 0.0 else ONLY
    while True:
        if solve_part(run, (t, h, w, first, which), mode, q, v, vdot):
            relax_drives(scene)
            take_back(run, h, w)
            active[0] = bilateral
            return True
        repeat(run, done, h, w, first, which)
        if which != EXPLICIT:
            break
        which = MIDPOINT
        accelerate_again(run, t, h, w)
    relax_drives(scene)
    ledger[at.WORK_DONE] += w * this.flow[0]
    ledger[at.DISSIPATED] += w * this.flow[1]
    if active[0] > 0:
        account(scene, first, t, w if w > 0.0 else h, ledger)
        if w == 0.0:
            note_chain(scene, first, t)
    book(scene, first, t + w, w, h, w == h - done)
    if active[0] > 0:
        spread(rows, const, work, space.vectors[EFFECT])
    for j in range(nv - states):
        v[j] += w * vdot[j] + space.vectors[EFFECT, j]
    book_drives(scene, stages[at.TORQUE, :nv], before, damping, w, v, ledger)
    if bilateral > 0:  # impulses times the mean speed over the part
        add_wrenches(rows, blocks, work, space, bilateral, blocks.blocks_f, at.PULL)
        work_done = driven_power(blocks, space, before) + driven_power(blocks, space, v)
        ledger[at.WORK_DONE] += 0.5 * work_done
    if states > 0:
        middle = stages[at.PART_MIDDLE, nq : nq + nv]
        for j in range(nv - states):
            middle[j] = 0.5 * (before[j] + v[j])
        for j in range(nv - states, nv):
            middle[j] = v[j]
        move_states(scene, t + 0.5 * w, w, q, middle, before, v, damping)
    advance(rows, q, v, 0.5 * w)
    if active[0] >= first and w > 0.0 and push_out(scene, first, h, q):
        ledger[at.DISSIPATED] -= lifted(scene, q, v)
    active[0] = bilateral
    return False


@sweep
def lifted(scene, q, v):
    """Return the potential energy that `push_out` has added by moving q [J]."""
    data = opened(scene)
    before = data.space.vectors[UNPUSHED, : q.shape[0]]
    for i in range(q.shape[0]):
        before[i] = q[i]
    advance(data.rows, before, data.space.vectors[PUSH], -1.0)
    return energies(scene, q, v)[1] - energies(scene, before, v)[1]


@sweep
def accelerate(run, t, h, w):
    """Move CANDIDATE to the middle of a part of width w from time t on, and write v' there without
    impulses into SLOPE, torques into TORQUE and damping into PART_DAMPING.
    """
    this = opened_run(run)
    scene, stages = this.scene, this.stages
    nq, nv = size_of_state(run)
    q = stages[at.CANDIDATE, :nq]
    v = stages[at.CANDIDATE, nq : nq + nv]
    before = stages[at.PART_BEFORE, nq : nq + nv]
    tau = stages[at.TORQUE, :nv]
    vdot = stages[at.SLOPE, nq : nq + nv]
    data = opened(scene)
    active = data.blocks.active
    bilateral = active[0]
    active[0] = 0  # constraints come in with the impulses
    if data.loads.signals[2].shape[0] > 0:
        move_states(scene, t, 0.5 * w, q, v, before, v, tau)
    advance(data.rows, q, v, 0.5 * w)
    stiffen_drives(scene, t + 0.5 * w, w, q, v)
    vectors = data.space.vectors
    for j in range(nv):
        vectors[MEAN, j] = v[j]
        vectors[KICK, j] = 0.0
        stages[at.PART_DAMPING, j] = vectors[DAMPING, j]
    contacts_at(data.links.contacts).tally[0].share = w / h
    call_acceleration(this.links.accelerate, (scene, t + 0.5 * w, q, v, tau, vdot, this.flow))
    this.counters[0].evaluations += 1
    end_acceleration(run, w, w)
    active[0] = bilateral


@sweep
def accelerate_again(run, t, h, w):
    """Write v' at the mean velocity of the first pass into SLOPE, in place of that at its start."""
    this = opened_run(run)
    scene, stages, data = this.scene, this.stages, opened(this.scene)
    nq, nv = size_of_state(run)
    q, v = stages[at.CANDIDATE, :nq], stages[at.CANDIDATE, nq : nq + nv]
    tau, vdot = stages[at.TORQUE, :nv], stages[at.SLOPE, nq : nq + nv]
    active, count = data.blocks.active, data.blocks.active[0]
    mean = data.space.vectors[MEAN, :nv]
    put_contacts(run, v, -w / h)
    find_mean(scene, w, v, vdot, count)
    soften_drives(scene, w, v)
    contacts_at(data.links.contacts).tally[0].share = w / h
    active[0] = 0
    if data.user.address == 0:  # a user's function may write into the rows
        set_kept(data.work, 0, 1.0)
    call_acceleration(this.links.accelerate, (scene, t + 0.5 * w, q, mean, tau, vdot, this.flow))
    set_kept(data.work, 0, 0.0)
    active[0] = count
    this.counters[0].evaluations += 1
    end_acceleration(run, w, w)


@sweep
def find_mean(scene, w, v, vdot, count):
    """Write the mean velocity of a part of width w and the effect of its impulses into MEAN and
    KICK, from v' without the impulses of the `count` active blocks, which are in EFFECT.
    """
    data = opened(scene)
    vectors = data.space.vectors
    states = data.loads.signals[2].shape[0]
    for j in range(v.shape[0]):
        vectors[KICK, j] = vectors[EFFECT, j]
    if count > 0:
        spread(data.rows, data.const, data.work, vectors[KICK])
    for j in range(v.shape[0] - states):
        vectors[MEAN, j] = v[j] + 0.5 * (w * vdot[j] + vectors[KICK, j])
    for j in range(v.shape[0] - states, v.shape[0]):  # already those of its middle
        vectors[MEAN, j] = v[j]
        vectors[KICK, j] = 0.0


@sweep
def end_acceleration(run, w, width):
    """Conserve the energy of spinning bodies in a sub-step.

    The width of a part is w, and `width` in the number type of the run.
    """
    this = opened_run(run)
    stages, data = this.stages, opened(this.scene)
    nq, nv = size_of_state(run)
    q, before = stages[at.CANDIDATE, :nq], stages[at.PART_BEFORE, nq : nq + nv]
    vdot, vectors = stages[at.SLOPE, nq : nq + nv], data.space.vectors
    rows, const, work = data.rows, data.const, data.work
    mean, kick = vectors[MEAN, :nv], vectors[KICK, :nv]
    if w > 0.0:
        for j in range(nv):
            vectors[ZERO, j] = 0.0
        gyre = vectors[GYRE : GYRE + SPIN.total]
        keep_gyrating(rows, const, work, q, before, mean, kick, width, vectors[ZERO], gyre, vdot)
        keep_spinning(rows, const, work, before, mean, kick, width, vectors[FREE_SPIN], vdot)
    positions(rows, work)


@sweep
def take_back(run, h, w):
    """Restore CANDIDATE to the state before a sub-step, and remove its forces from the contacts."""
    this = opened_run(run)
    stages, data = this.stages, opened(this.scene)
    nq, nv = size_of_state(run)
    v, states = stages[at.CANDIDATE, nq : nq + nv], data.loads.signals[2].shape[0]
    put_contacts(run, v, -w / h)
    for i in range(nq):
        stages[at.CANDIDATE, i] = stages[at.PART_BEFORE, i]
    for j in range(nv - states, nv):
        v[j] = stages[at.PART_BEFORE, nq + j]


@sweep
def put_contacts(run, v, share):
    """Add a share of the contact forces at v to what is recorded of the step."""
    this = opened_run(run)
    data = opened(this.scene)
    contacts, tau = contacts_at(data.links.contacts), this.stages[at.TORQUE, : v.shape[0]]
    if contacts.laws.shape[0] > 0:
        turn_rates(data.rows, data.const, data.work, v)
        contacts.tally[0].share = share
        call_contact_forces(data.links.forces, (this.scene, v, tau, this.flow))


@sweep
def move_states(scene, t, h, q, v, start, out, rates):
    """Write the states of controls in `start`, moved for the time h at their rates at (t, q, v),
    into `out`.
    """
    data = opened(scene)
    follow(data, t, q, v)
    if gives_rates(data.loads.signals[2]):
        find_rates(data, t, q, v)
    put_rates(data.loads.signals, data.loads, rates)
    for j in range(v.shape[0] - data.loads.signals[2].shape[0], v.shape[0]):
        out[j] = start[j] + h * rates[j]


@sweep
def stiffen_drives(scene, t, h, q, v):
    """Add the implicit terms of dampers and springs to inertia and torque."""
    data = opened(scene)
    drives, vectors, given = data.drives, data.space.vectors, data.given
    table = drives.table
    damping, stiffness = vectors[DAMPING], vectors[STIFFNESS]
    for j in range(v.shape[0]):
        damping[j] = 0.0
        stiffness[j] = 0.0
        vectors[DRIVEN, j] = 0.0
        vectors[OWN_GIVEN, j] = given[j]
    follow(data, t, q, v)
    for n in range(table.shape[0]):
        j = table[n].velocity
        kd = table[n].damping
        if n >= drives.passive:
            vectors[DRIVEN, j] += TINY
            for i in range(table[n].first_term + 1, table[n].first_term + table[n].terms):
                vectors[DRIVEN, int(drives.terms[i, 0])] += TINY
        if table[n].terms > 0:  # along several joints: as it is
            continue
        if kd > 0.0 and not at_its_limit(drives, n, t, q, v):
            damping[j] += kd
            if n >= drives.passive:
                vectors[DRIVEN, j] += kd
            if table[n].coordinate >= 0:
                stiffness[j] += table[n].stiffness
    driven, own = vectors[DRIVEN], vectors[OWN_ARMATURE]
    stiffen(data.rows, data.const, h, v, damping, stiffness, driven, own, given)


@sweep
def soften_drives(scene, h, v):
    """Take implicit terms of drives at the mean velocity, where they are soft."""
    data = opened(scene)
    vectors = data.space.vectors
    mean, damping, stiffness = vectors[MEAN], vectors[DAMPING], vectors[STIFFNESS]
    own, dinv = vectors[OWN_GIVEN], vectors[DINV]
    soften(data.rows, data.work, h, v, mean, damping, stiffness, own, data.given, dinv)


@sweep
def relax_drives(scene):
    """Undo `stiffen_drives`."""
    data = opened(scene)
    relax(data.rows, data.const, data.space.vectors[OWN_ARMATURE])
    for j in range(data.given.shape[0]):
        data.given[j] = data.space.vectors[OWN_GIVEN, j]


@part
def book_drives(scene, tau, before, extra, h, v, ledger):
    """Correct the work of drives and the loss in joints for their change over the step.

    Their power was taken at the velocities MEAN.
    """
    data = opened(scene)
    vectors = data.space.vectors
    softer, driven, taken = vectors[STIFFNESS], vectors[DRIVEN], vectors[MEAN]
    work, lost = corrections(data.rows, tau, before, taken, extra, softer, driven, h, v, 0.0)
    ledger[at.WORK_DONE] += work
    ledger[at.DISSIPATED] += lost


@sweep
def warm_start(scene, first, m):
    """Copy λ of the last step for persistent contact points and joint friction, else zero.

    Sub-steps use a proportional fraction.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    contacts = contacts_at(data.links.contacts)
    active, slots = blocks.active, space.slots
    lam = space.vectors[LAMBDA]
    for r in range(m):
        lam[r] = 0.0
    begin, room = contacts.tally[0].first_contact, contacts.found.shape[0]
    share = contacts.tally[0].share
    for j in range(first, active[0] + 1):
        n = active[j] - begin
        if type_of(blocks.blocks_i, active[j]) == at.T_FRICTION:
            one = blocks.blocks_f[active[j]]
            lam[first_of(slots, active[j])] = one[at.HELD] * one[at.AIM] / one[at.VALUE]
        elif n >= 0:
            turns = n >= room
            n -= room if turns else 0
            if not turns:
                set_xyz(contacts.found[n].held, (0.0, 0.0, 0.0))
                blocks.blocks_f[active[j], at.SETTLED] = TRANSIENT
            k = kept_place(contacts.found[n], contacts.kept, contacts.tally[0].kept, n)
            if k >= 0:
                r = first_of(slots, active[j])
                kept = xyz(contacts.kept[k].turn) if turns else xyz(contacts.kept[k].value)
                if not turns:
                    set_xyz(contacts.found[n].held, kept)
                    blocks.blocks_f[active[j], at.SETTLED] = float(contacts.kept[k].settled)
                for c in range(3):
                    lam[r + c] = share * kept[c]


@sweep
def solve_part(run, own, mode, q, v, vdot):
    """Solve for the impulses in a pass of a part of width w, starting at t, of a step of width h.

    Their effect on the joints is stored in EFFECT. The second pass starts with those of the first.
    Returns whether constraints lead to the impact of a limit within the part, if that is asked.
    """
    t, h, w, first, which = own
    this = opened_run(run)
    scene, data = this.scene, opened(this.scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    report = space.vectors[REPORT]
    for j in range(v.shape[0]):
        space.vectors[EFFECT, j] = 0.0
    space.vectors[FACTORED, FACTORS.known] = 0.0  # Y is no longer that of the last factors
    goes_on = which == MIDPOINT
    switched = which != MIDPOINT and has_switched(run, t, h)
    while blocks.active[0] > 0:
        m = number_rows(blocks, space.slots)
        if switched:
            unswitched = this.stages[at.UNSWITCHED, q.shape[0] : q.shape[0] + v.shape[0]]
            before_switch(scene, t, q, v, unswitched)
            keep_resting(scene, first)
            switched = False
        set_velocities(scene, t, t + w, w, q, v, vdot, m)
        unspread(rows, const, work, space.vectors[SPEEDS])
        if not goes_on:
            unit_responses(rows, const, blocks, work, space)
            warm_start(scene, first, m)
        solve_impulses(scene, h, goes_on, which != EXPLICIT)
        this.counters[0].solver_iterations += int(report[SWEEPS_DONE] + report[STEPS_DONE])
        asks = first > 1 and which == EXPLICIT and (mode == ASK or mode == CUT)
        if asks and limit_on_the_way(scene, first, h, w, q, v, vdot):
            bend_way(run, w, vdot)
            return True
        if w == 0.0 or not add_passed(scene, first, w, q, v, vdot):
            break
        goes_on = False
        mean = space.vectors[MEAN, : v.shape[0]]
        turn_rates(rows, const, work, mean)
    state = this.stages[at.UNSWITCHED]
    if which != EXPLICIT and state[q.shape[0] + v.shape[0] + 1] == WAITS:
        state[q.shape[0] + v.shape[0] + 1] = ACTED
    return False


@part
def has_switched(run, t, h):
    """Check whether constraints were switched at t, where a step of width h begins, and nothing in
    this step has come before."""
    data = opened_run(run)
    row, last = data.stages[at.UNSWITCHED], data.control[0].nq + data.control[0].nv
    return row[last + 1] == WAITS and abs(t - row[last]) <= COINCIDENT * h


@sweep
def bend_way(run, w, vdot):
    """Add the change of v' by the impulses of a part of width w, whose effect is in EFFECT, to
    v', and write it to BENT."""
    data = opened_run(run)
    scene, bent = opened(data.scene), data.stages[at.BENT]
    effect = scene.space.vectors[EFFECT]
    spread(scene.rows, scene.const, scene.work, effect)
    for j in range(vdot.shape[0]):
        bent[j] = effect[j] / w
        vdot[j] += bent[j]


@sweep
def account(scene, first, t, lasts, ledger):
    """Record the energy loss of impulses in the ledger, the work of moving surfaces, and the
    solver's report in the tally, at time t.

    A velocity that misses a law lasts until the next solve, for the time `lasts`.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    tally, report = contacts.tally[0], data.space.vectors[REPORT]
    ledger[at.DISSIPATED] -= report[GAINED]
    blocks, lam = data.blocks, data.space.vectors[LAMBDA]
    for j in range(first, blocks.active[0] + 1):
        i = blocks.active[j]
        r = first_of(data.space.slots, i)
        for c in range(size_of(blocks.blocks_i, i)):
            ledger[at.WORK_DONE] -= lam[r + c] * blocks.blocks_f[i, at.SURFACE + c]
    tally.residual = max(tally.residual, report[MISSED])
    tally.strayed += lasts * report[STRAYS]
    if report[HARD] > 0.0:
        tally.fallbacks += 1
    if report[BARRED] > 0.0:
        tally.barred = 1
        tally.barred_time = t
    if report[CALMED] > 0.0:
        tally.calmed += 1
    if report[LOOSE] > 0.0:
        tally.loose += 1
        tally.loose_pair = contacts.found[int(report[LOOSE]) - 1 - tally.first_contact].pair
        tally.loose_time = t
