"""The stepping loop for all runs: steps of given size or chosen by their error, and frames.

The step of a method is called by address. Accepting it, the next width, corners of tables,
projection, frames and events are the same for all methods.
"""

import math

from ...tolerances import EPS, SOLVED
from .. import layout as at
from ..arrays import RUN, opened_run, save_run_tuple
from ..compiler.address import caller
from ..compiler.jit import kernel, sweep
from ..compiler.kinds import I1, i8, plain, void
from ..contact.contacts import contacts_at, remember_impulses
from ..motion import call_record, call_settle, opened
from ..records import CHOSEN, CONTACT_AHEAD, GIVEN, REACHED
from ..rows import v_of
from ..signals import take_samples
from ..tree.moving import normalise_all
from ..vec import finite
from .control.clock import (
    end_step,
    forget_slope,
    keep_slope,
    note_failure,
    pass_frame,
    set_time,
    try_width,
)
from .control.ends import note_change, note_edge, release_sides
from .control.error import accept_step, note_acceleration
from .control.guard import bound_width, note_reported
from .explicit import dense_output, last_stage, turn_spins
from .measured import HOLDING, average, hold_touches, measure, measures, steps_in_time
from .ranges import within_ranges
from .state import UNSOLVED, acceleration_of, call_step, copied, onto_constraints, size_of_state
from .widths import (
    first_width,
    given_start,
    nearby,
    next_interval,
    next_width,
    pass_corners,
    pass_edges,
    refuse,
    step_taken,
    widen,
)

LOOK_BACK = void(i8)
call_look_back = caller(LOOK_BACK)
BOUND = void(i8, i8)  # run, row of the velocities with which the next step is bounded
call_bound = caller(BOUND)

WORTH_FACTORING = 1.2  # a change of width below it is not worth factoring the matrices again


@kernel(void(I1, plain(RUN)))
def save_run(buffer, run):
    """Store a run's tuple where `opened_run` finds it."""
    save_run_tuple(buffer, run)


@kernel(i8(i8, i8), nogil=True)
def advance_run(run, budget):
    """Attempt at most `budget` steps and frames. Returns a status code, RUNNING if unfinished.

    Frame 0 is the given state. EVENT is returned once for each event, with Y at the event. The
    caller may change Y, `fresh` and the scene, and continue. A frame at that time follows. NEAR is
    returned if something may touch within the next step. If a run fails, its last valid state
    becomes the last frame.
    """
    data = opened_run(run)
    control, counters, times = data.control[0], data.counters[0], data.times
    clock, guard = control.clock, control.guard
    release_sides(control.ends)
    for _ in range(budget):
        i = clock.frame
        if i == clock.last:
            return at.DONE
        t = clock.time
        code = at.DONE
        if times[i] < t or (times[i] == t and guard.fired == 0):
            if frame(run, i):
                pass_frame(clock)
            else:
                code = at.NOT_FINITE
        elif guard.fired != 0:
            found = at.NEAR if guard.fired == CONTACT_AHEAD else at.EVENT
            note_reported(guard)
            return found
        elif counters.steps + counters.rejected_steps >= clock.most:
            code = at.TOO_MANY
        else:
            code = step_once(run)
        if code != at.DONE:
            give_up(run, t)
            return code
    return at.DONE if clock.frame == clock.last else at.RUNNING


@sweep
def step_once(run):
    """Attempt a step, which may be rejected. Returns a status code."""
    data = opened_run(run)
    control, method, links = data.control[0], data.method[0], data.links
    clock, ends, guard = control.clock, control.ends, control.guard
    if control.error.widths == GIVEN:
        set_time(clock, given_start(control))
    if data.corners.shape[0] > 0:
        pass_corners(run)
    if ends.edges > 0:
        pass_edges(run)
    take_sides_here(run)
    if method.starts == 1 and clock.fresh == 0:
        acceleration_of(run, clock.time, at.Y, at.SLOPE)
        keep_slope(clock)
        if not finite(data.stages[at.SLOPE, control.nq :]):
            return at.NOT_FINITE
    if control.error.widths == CHOSEN and clock.width == 0.0:
        try_width(clock, first_width(run))
    h, end, corner = next_width(run)
    if control.error.widths == GIVEN and guard.approach != 0:
        w = foreseen(run, h)
        if w < h:
            h, end, corner = w, clock.time + w, False
    contacts = opened(data.scene).links.contacts
    if links.events != 0 and contacts != 0:
        remember_impulses(contacts_at(contacts))
    error = call_step(links.step, (run, h))
    good = error >= 0.0 and error < math.inf
    if not good and links.cross != 0:  # a side may have no value beyond its margin
        call_step(links.cross, (run, -h))
        error = call_step(links.step, (run, h))
        good = error >= 0.0 and error < math.inf
    cornered = data.corners.shape[0] > 0 or ends.edges > 0
    if good and error > 1.0 and control.error.widths == CHOSEN and cornered:
        error = 1.0 if error <= blurred(run, h) else error
    if error == UNSOLVED and control.error.widths == GIVEN:
        h, error = halved(run, h)
        good, end, corner = error >= 0.0 and error < math.inf, clock.time + h, False
    if not good or (error > 1.0 and control.error.widths == CHOSEN):
        return refuse(run, error, h)
    if control.error.widths == CHOSEN:
        widen(control, method, min(error, 1.0), h)
        if data.tableau.dense.shape[0] == 0 and h < clock.width < WORTH_FACTORING * h:
            try_width(clock, h)
    if links.cross != 0 and not within_ranges(run, opened(data.scene).loads.signals[0], h):
        w = call_step(links.cross, (run, h))
        if w < h:
            h, end, corner = w, clock.time + w, ends.sided == 0
            if corner:
                note_change(ends, end)
    code = accept(run, h, end, corner)
    if code == at.DONE and links.watch != 0 and is_due(run):
        call_look_back(links.watch, (run,))
    if code == at.DONE and guard.due != 0 and guard.fired == 0:
        call_look_back(links.look_back, (run,))
        if guard.fired == REACHED:
            note_change(ends, clock.time)
            onto_constraints(run, clock.time, at.Y)
    if corner and clock.time == end:  # no event ended the step before
        note_edge(ends, end)
    if ends.samples > 0 and code == at.DONE and clock.time > clock.old_time:
        sampled(run)
    if control.error.widths == GIVEN:
        step_taken(run)
    if guard.approach != 0 and code == at.DONE:
        call_bound(guard.approach, (run, at.Y))
    if code == at.DONE and steps_in_time(data.scene):
        average(data.scene)
    return code


@sweep
def foreseen(run, h):
    """Return the width of a given step that contacts permit also at the velocities of its end.

    A body that rests where it begins to touch has no velocity that says how fast it will move. The
    velocities at the end are those of Euler's rule, which no stage inside a contact changes.
    """
    data = opened_run(run)
    control, stages, slope = data.control[0], data.stages, at.SLOPE
    guard, bound = control.guard, control.guard.bound
    if data.method[0].starts == 0:
        slope = at.ERROR
        acceleration_of(run, control.clock.time, at.Y, slope)
    while True:
        for j in range(control.nq, control.nq + control.nv):
            stages[at.CANDIDATE, j] = stages[at.Y, j] + h * stages[slope, j]
        call_bound(guard.approach, (run, at.CANDIDATE))
        if not guard.bound < h * (1.0 - SOLVED):
            break
        h = guard.bound
    bound_width(guard, bound)
    return h


@sweep
def halved(run, h):
    """Halve a given step until its equations are solved. Return the width and the error of the
    step."""
    data = opened_run(run)
    control, error = data.control[0], float(UNSOLVED)
    while error == UNSOLVED and 0.5 * h > nearby(control.clock.time + control.error.widest):
        data.counters[0].rejected_steps += 1
        h *= 0.5
        error = call_step(data.links.step, (run, h))
    return h, error


@sweep
def take_sides_here(run):
    """Hold the results of comparisons of the motion at Y, unless they are already held."""
    data = opened_run(run)
    if data.links.cross != 0 and data.control[0].ends.sided == 0:
        call_step(data.links.cross, (run, 0.0))


@sweep
def sampled(run):
    """Take the samples of controls at the end of a step, after all events within it."""
    data = opened_run(run)
    control, y = data.control[0], data.stages[at.Y]
    clock = control.clock
    nq, nv = size_of_state(run)
    t = clock.time
    signals = opened(data.scene).loads.signals
    if measures(signals, t, nearby(t)):
        accelerate, i = data.links.accelerate, clock.frame
        forces, vdot = data.out[3][i], data.out[2][i]  # a frame that is not recorded yet
        measure(data.scene, accelerate, t, y[:nq], y[nq : nq + nv], vdot, data.flow, forces)
    if take_samples(signals, t, nearby(t), y[:nq], y[nq : nq + nv]) > 0:
        forget_slope(clock)
        release_sides(control.ends)


@sweep
def is_due(run):
    """Check whether the last step must be checked, because the check is due or a speed is too
    large."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    guard = control.guard
    due = not control.clock.time <= guard.next_check
    if not due:
        nq, nv = control.nq, control.nv
        slow, way = guard.slow, guard.slow * control.clock.old_width
        for i in range(nq):
            due = due or not abs(stages[at.Y, i] - stages[at.Y_OLD, i]) <= way
        for j in range(nq, nq + nv):
            due = due or not abs(stages[at.Y, j]) <= slow
    return due


@sweep
def blurred(run, h):
    """Compute the step's error by rounding of time, over its tolerance, which no step reduces."""
    data = opened_run(run)
    stages = data.stages
    nq, nv = size_of_state(run)
    change = 0.0
    for j in range(nq, nq + nv):
        moved = stages[at.CANDIDATE, j] - stages[at.Y, j]
        change = max(change, abs(moved) * stages[at.WEIGHT, j])
    return 8.0 * EPS * abs(data.control[0].clock.time) / h * change


@sweep
def accept(run, h, end, corner):
    """Accept CANDIDATE, projected onto the constraints, as the state Y. Returns a status code."""
    data = opened_run(run)
    control, stages, scene = data.control[0], data.stages, data.scene
    clock, error = control.clock, control.error
    ends = data.method[0].ends == 1
    s = data.tableau.b.shape[0]
    rows, size = opened(scene).rows, size_of_state(run)
    nq, nv = size
    if ends and data.tableau.error.shape[1] == s:
        last_stage(run, min(clock.time + h, clock.clip))
    if data.corners.shape[0] > 0 or control.ends.edges > 0:
        for j in range(nq, nq + nv):
            mean = abs(stages[at.CANDIDATE, j] - stages[at.Y, j]) / h
            note_acceleration(error, mean)
    for i in range(stages.shape[1]):
        stages[at.Y_OLD, i] = stages[at.Y, i]
        stages[at.Y, i] = stages[at.CANDIDATE, i]
    end_step(clock, h, end)
    accept_step(error)
    data.counters[0].steps += 1
    q = stages[at.Y, :nq]
    v = stages[at.Y, nq : nq + nv]
    if nq > nv:
        normalise_all(rows, q)
    settle = opened(scene).links.settle
    if settle != 0:
        call_settle(settle, (scene, end, q, v))
    moved = error.project == 1 and opened(scene).blocks.active[0] > 0
    forget_slope(clock)
    if ends and not moved and not corner:
        keep_slope(clock)
        copied(stages, at.STAGE + s, at.SLOPE, stages.shape[1])
        turn_spins(rows, size, stages, at.Y, at.SLOPE, True)
    return onto_constraints(run, end, at.Y)


@sweep
def frame(run, i):
    """Record frame i at the end of the last step or within it. Returns False if not finite.

    The next step reuses its v' if it starts there.
    """
    data = opened_run(run)
    control, stages, flow = data.control[0], data.stages, data.flow
    clock = control.clock
    t = data.times[i]
    nq, nv = size_of_state(run)
    row, held = at.Y, False
    if t != clock.time:
        dense_output(run, (t - clock.old_time) / clock.old_width)
        row = at.TRIAL
        onto_constraints(run, t, row)
        held = hold_touches(data.scene, 0)  # other shapes touched at the end of the step
    else:
        take_sides_here(run)
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    ledger = stages[row, nq + nv :]
    accelerate = data.links.accelerate
    good = call_record(
        data.links.record, (data.scene, accelerate, t, q, v, flow, ledger, i, data.out)
    )
    data.counters[0].evaluations += 1
    if held:
        hold_touches(data.scene, HOLDING)
    if steps_in_time(data.scene):
        contacts_at(opened(data.scene).links.contacts).tally[0].elapsed = 0.0
    start = t
    if control.error.widths == GIVEN:
        next_interval(run, i)
        start = given_start(control)
    if row == at.Y and t == start and clock.fresh == 0:
        vdot = data.out[2]
        for j in range(nv):
            stages[at.SLOPE, nq + j] = vdot[i, j]
        stages[at.SLOPE, nq + nv] = flow[0]
        stages[at.SLOPE, nq + nv + 1] = flow[1]
        keep_slope(clock)
    return good == 1


@sweep
def give_up(run, t):
    """Record the last valid state, at t, as the last frame if it is later than the previous
    frame."""
    data = opened_run(run)
    control, stages, times = data.control[0], data.stages, data.times
    clock = control.clock
    nq, nv = size_of_state(run)
    i = clock.frame
    if clock.time > t:
        copied(stages, at.Y_OLD, at.Y, stages.shape[1])
        set_time(clock, t)
    row = fastest_row(opened(data.scene).rows, stages[at.Y, nq : nq + nv])
    note_failure(clock, t, row)
    if 0 < i < clock.last and times[i - 1] < t:
        times[i] = t
        if frame(run, i):
            pass_frame(clock)


@sweep
def fastest_row(rows, v):
    """Return the row with the largest joint velocity."""
    best = 0.0
    row = 1
    for k in range(1, rows.shape[0]):
        if abs(v[v_of(rows, k)]) > best:
            best = abs(v[v_of(rows, k)])
            row = k
    return row
