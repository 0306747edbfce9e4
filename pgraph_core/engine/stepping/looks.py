"""Looks at a time within the last step: its state, and the monitors of contacts and user events."""

from .. import layout as at
from ..arrays import guard_at, opened_run
from ..compiler.address import caller
from ..compiler.jit import part, sweep
from ..compiler.kinds import F1, f8, i8, void
from ..constraints.blocks import type_of
from ..contact.contacts import contacts_at, recall_impulses
from ..contact.meeting import closed_limit, limit_gap
from ..contact.phases import opened_events
from ..contact.points import call_observe, watch
from ..motion import opened
from ..records import ASLEEP, WATCHED
from ..tree.moving import normalise_all
from .bracket import BELOW, NOTHING, over
from .control.clock import note_repeated, set_time
from .explicit import dense_output
from .measured import steps_in_time
from .state import call_step, copied, onto_constraints, size_of_state

# scene, t, q, v; one number an event, which happens where it changes sign
EVENT = void(i8, f8, F1, F1, F1)
call_event = caller(EVENT)


@sweep
def state_within(run, w):
    """Write the state at a time w after the start of the last step into TRIAL."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    h = control.clock.old_width
    if w >= h:
        copied(stages, at.Y, at.TRIAL, stages.shape[1])
    elif w <= 0.0:
        copied(stages, at.Y_OLD, at.TRIAL, stages.shape[1])
    elif data.tableau.dense.shape[0] > 0:
        dense_output(run, w / h)
    else:
        try_step(run, w)


@part
def log_of(tally):
    """Return what the steps of a run have noted about contacts, for `put_back`."""
    most = (
        tally.residual,
        tally.strayed,
        tally.depth,
        tally.complementarity,
        tally.cone,
        tally.penetration,
        tally.force,
    )
    counts = (
        tally.fallbacks,
        tally.calmed,
        tally.overflows,
        tally.cuts,
        tally.crowded,
        tally.chains,
        tally.loose,
        tally.passed,
    )
    worst = (
        tally.worst,
        tally.worst_pair,
        tally.worst_time,
        tally.deepest,
        tally.deepest_pair,
        tally.deepest_time,
        tally.deepest_depth,
    )
    firsts = (
        tally.crowded_time,
        tally.chain_time,
        tally.loose_pair,
        tally.loose_time,
        tally.passed_pair,
        tally.passed_time,
    )
    return most, counts, worst, firsts


@sweep
def put_back(tally, log):
    """Forget what has been noted since `log_of`."""
    most, counts, worst, firsts = log
    tally.residual = most[0]
    tally.strayed = most[1]
    tally.depth = most[2]
    tally.complementarity = most[3]
    tally.cone = most[4]
    tally.penetration = most[5]
    tally.force = most[6]
    tally.fallbacks = counts[0]
    tally.calmed = counts[1]
    tally.overflows = counts[2]
    tally.cuts = counts[3]
    tally.crowded = counts[4]
    tally.chains = counts[5]
    tally.loose = counts[6]
    tally.passed = counts[7]
    tally.worst = worst[0]
    tally.worst_pair = worst[1]
    tally.worst_time = worst[2]
    tally.deepest = worst[3]
    tally.deepest_pair = worst[4]
    tally.deepest_time = worst[5]
    tally.deepest_depth = worst[6]
    tally.crowded_time = firsts[0]
    tally.chain_time = firsts[1]
    tally.loose_pair = firsts[2]
    tally.loose_time = firsts[3]
    tally.passed_pair = firsts[4]
    tally.passed_time = firsts[5]


@sweep
def try_step(run, w):
    """Run `step_again` without a trace in the log of contacts, as the step is not taken."""
    contacts = opened(opened_run(run).scene).links.contacts
    if contacts == 0:
        step_again(run, w)
        return
    tally = contacts_at(contacts).tally[0]
    log = log_of(tally)
    step_again(run, w)
    put_back(tally, log)


@sweep
def step_again(run, w):
    """Repeat the last step with step size w from Y_OLD into TRIAL, with SLOPE still at Y_OLD."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    clock = control.clock
    nq, nv = size_of_state(run)
    n = stages.shape[1]
    time = clock.time
    copied(stages, at.Y, at.END, n)
    copied(stages, at.Y_OLD, at.Y, n)
    set_time(clock, clock.old_time)
    contacts = opened(data.scene).links.contacts
    if data.links.events != 0 and contacts != 0:
        recall_impulses(contacts_at(contacts))
    call_step(data.links.step, (run, w))
    note_repeated(clock, 1)
    set_time(clock, time)
    copied(stages, at.END, at.Y, n)
    copied(stages, at.CANDIDATE, at.TRIAL, n)
    if nq > nv:
        normalise_all(opened(data.scene).rows, stages[at.TRIAL, :nq])
    onto_constraints(run, clock.old_time + w, at.TRIAL)


@part
def time_within(clock, w):
    """Return the time of the state at a time w after the start of the last step [s]."""
    return clock.old_time + w if w < clock.old_width else clock.time


@part
def phases_watched(run):
    """Check whether contact points are monitored."""
    data = opened_run(run)
    return data.watched.shape[1] > data.signs.shape[0]


@sweep
def look(run, low, w):
    """Evaluate the monitors at a time low + w after the start of the last step, into row NOW.

    Returns whether one is below zero.
    """
    data = opened_run(run)
    control, counters, stages = data.control[0], data.counters[0], data.stages
    state_within(run, low + w)
    nq, nv = size_of_state(run)
    q = stages[at.TRIAL, :nq]
    v = stages[at.TRIAL, nq : nq + nv]
    t = time_within(control.clock, low + w)
    if phases_watched(run):
        contact = opened_events(data.scene).contact
        vdot = stages[at.OBSERVED, nq : nq + nv]
        call_observe(contact.links.observe, (data.scene, t, q, v, vdot, data.flow))
        counters.evaluations += 1
        watch(contact, WATCHED.now, w)
    if data.links.events != 0:
        values_of_events(run, t, q, v)
        watch_events(run, low + w)
    return over(data.watched, WATCHED.now)


@sweep
def values_of_events(run, t, q, v):
    """Evaluate a user's events and the guard's conditions on coordinates."""
    data = opened_run(run)
    values = data.values
    if steps_in_time(data.scene):
        copy_to_limits(run, q)
        q = data.stages[at.AT_LIMITS, : q.shape[0]]
    call_event(data.links.events, (data.scene, t, q, v, values))
    if data.control[0].guard.address != 0:
        conditions = guard_at(data.control[0].guard.address).limits
        for n in range(conditions.shape[0]):
            one = conditions[n]
            if one.event >= 0:
                values[one.event] = one.value - one.sign * q[one.coordinate]


@sweep
def copy_to_limits(run, q):
    """Copy q to AT_LIMITS, with coordinates on the limits that are closed at them.

    Time stepping takes the impact of a limit a closed gap before it, and rests there.
    """
    data = opened_run(run)
    scene, kept = opened(data.scene), data.stages[at.AT_LIMITS]
    blocks, tally = scene.blocks, contacts_at(scene.links.contacts).tally[0]
    for k in range(q.shape[0]):
        kept[k] = q[k]
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        single = blocks.blocks_i[i, at.B_TERMS] == 1 and type_of(blocks.blocks_i, i) == at.T_LIMIT
        if single and abs(limit_gap(blocks, i, q)) <= 2.0 * closed_limit(blocks, i):
            n = blocks.blocks_i[i, at.B_TERM]
            kept[blocks.terms_i[n, 1]] = blocks.blocks_f[i, at.VALUE] / blocks.terms_f[n]


@sweep
def watch_events(run, w):
    """Compute the monitors of user events, positive while the values keep their sign.

    Up to the time `since` after the start of the step, the sign of a value is rounding. A value
    that comes to rest at zero is zero up to the size in row `rest`.
    """
    data = opened_run(run)
    signs, values, watched = data.signs, data.values, data.watched
    first = watched.shape[1] - signs.shape[0]
    for i in range(signs.shape[0]):
        monitor = NOTHING
        if signs[i] != 0 and data.wanted[i] != ASLEEP:
            monitor = signs[i] * values[i]
            if w <= watched[WATCHED.since, first + i]:
                monitor = abs(monitor)
            elif monitor == 0.0 or abs(monitor) <= watched[WATCHED.rest, first + i]:
                monitor = -BELOW
        watched[WATCHED.now, first + i] = monitor


@sweep
def keep_values(run, row):
    """Store the values of user events in a row of `watched`."""
    data = opened_run(run)
    watched, values = data.watched, data.values
    first = watched.shape[1] - data.signs.shape[0]
    for i in range(data.signs.shape[0]):
        watched[row, first + i] = values[i]
