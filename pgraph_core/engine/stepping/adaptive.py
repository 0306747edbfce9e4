"""Runs at steps chosen by their error, with output and events on dense output.

One step of a method, an *attempt*, is called by address. Accepting it, the next width, corners
of tables, projection, frames and events are the same for all methods.
"""

import math

from numba import types

from .. import layout as at
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..motion import F1, F2, I1, OUT, call_projection, call_record, opened
from ..records import COUNTERS, CURSOR, STEP_CONTROL, array_of
from ..tree.moving import normalise_all, rate
from ..vec import finite
from .attempt import CONTROL, MATRICES, SIZE, TABLEAU, call_attempt, copied, f8, i8, slope
from .explicit import last_stage, turn_spins, within
from .run import STEP_ROUNDS, call_settle, fastest_row
from .widths import first_width, next_width, refuse, widen

u1 = types.boolean
LINKS = types.UniTuple(i8, 4)  # acceleration, projection, record, attempt
# addresses of `look_back` (0: no events) and of EVENT, numbers now, then: their signs, wanted
# directions (0: both), the one that fired
EVENTS = types.Tuple((i8, i8, F1, I1, I1, I1))
LOOK_BACK = types.void(i8, i8, TABLEAU, SIZE, F2, CONTROL, F1, EVENTS)
# safety, exponents of this error and the last one, least and largest change of width
CONTROLLER = types.UniTuple(f8, 5)
call_look_back = caller(LOOK_BACK)

KEPT = 1.2  # a change of width below it is not worth factoring the matrices again


@sweep
def accept(scene, links, tableau, size, h, end, corner, stabilised, stages, control, flow):
    """CANDIDATE becomes Y, on the constraints; the slope there where it is known; a status code."""
    accelerate, project, _, _ = links
    settings, counters = control
    nq, nv = size
    n = stages.shape[1]
    s = tableau[1].shape[0]
    explicit = tableau[4].shape[0] > 0
    rows = opened(scene).rows
    if explicit and tableau[3].shape[1] == s:
        x = min(settings.time + h, settings.clip)
        last_stage(scene, accelerate, rows, x, size, s, stages, flow, counters)
    copied(stages, at.Y, at.Y_OLD, n)
    copied(stages, at.CANDIDATE, at.Y, n)
    settings.old_time = settings.time
    settings.old_width = h
    settings.time = end
    settings.filled = 0
    settings.rejected = 0
    counters.steps += 1
    q = stages[at.Y, :nq]
    v = stages[at.Y, nq : nq + nv]
    normalise_all(rows, q)
    settle = opened(scene).links.settle
    if settle != 0:
        call_settle(settle, (scene, end, q, v))
    moved = stabilised and opened(scene).blocks.active[0] > 0
    settings.fresh = 1 if explicit and not moved and not corner else 0
    if settings.fresh == 1:
        copied(stages, at.STAGE + s, at.SLOPE, n)
        turn_spins(rows, size, stages, at.Y, at.SLOPE, True)
        rate(rows, q, v, stages[at.SLOPE, :nq])
    if not moved:
        return at.DONE
    rounds = call_projection(project, (scene, end, q, v, STEP_ROUNDS))
    counters.projections += abs(rounds)
    if not finite(v):
        return at.NOT_FINITE
    return at.NOT_CONVERGED if rounds < 0 else at.DONE


@sweep
def step_once(
    scene, links, tableau, controller, order, size, corners, stop, stabilised, stages, control,
    matrices, flow, events,
):  # fmt: skip
    """One attempt, accepted or not; a status code."""
    accelerate, _, _, attempt = links
    settings, counters = control
    if settings.fresh == 0:
        t = settings.time
        slope(scene, accelerate, t, size, stages, at.Y, at.SLOPE, flow, counters)
        settings.fresh = 1
        if not finite(stages[at.SLOPE]):
            return at.NOT_FINITE
    if settings.width == 0.0:
        settings.width = first_width(scene, accelerate, size, order, stages, control, flow)
    h, ends, corner = next_width(settings, corners, stop)
    error = call_attempt(
        attempt, (scene, accelerate, tableau, size, h, stages, control, matrices, flow)
    )
    good = error >= 0.0 and error < math.inf
    if not good or (error > 1.0 and settings.fixed == 0):
        return refuse(settings, counters, controller, error, h)
    end = settings.time + h
    if ends:
        end = corners[settings.corner] if corner else stop
    widen(settings, controller, min(error, 1.0), h)
    if tableau[4].shape[0] == 0 and h < settings.width < KEPT * h:
        settings.width = h
    code = accept(scene, links, tableau, size, h, end, corner, stabilised, stages, control, flow)
    if code == at.DONE and events[0] != 0:
        call_look_back(events[0], (scene, accelerate, tableau, size, stages, control, flow, events))
        if settings.fired == 1:
            t = settings.time
            onto_constraints(scene, links[1], size, stabilised, t, stages, at.Y, counters)
    return code


@part
def onto_constraints(scene, project, size, stabilised, t, stages, row, counters):
    """The state in `row` projected, as the ends of steps are."""
    nq, nv = size
    if stabilised and opened(scene).blocks.active[0] > 0:
        state = (stages[row, :nq], stages[row, nq : nq + nv])
        rounds = call_projection(project, (scene, t, state[0], state[1], STEP_ROUNDS))
        counters.projections += abs(rounds)


@sweep
def frame(scene, links, tableau, size, t, i, stabilised, stages, control, flow, out):
    """Frame i at time t, within the last step or at its end; whether all of it is finite."""
    accelerate, project, record, _ = links
    settings, counters = control
    nq, nv = size
    row = at.Y
    if t != settings.time:
        share = (t - settings.old_time) / settings.old_width
        within(scene, accelerate, tableau, size, stages, control, flow, share)
        row = at.TRIAL
        onto_constraints(scene, project, size, stabilised, t, stages, row, counters)
    counters.evaluations += 1
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    ledger = stages[row, nq + nv :]
    return call_record(record, (scene, accelerate, t, q, v, flow, ledger, i, out))


@kernel(
    i8(i8, LINKS, TABLEAU, CONTROLLER, i8, SIZE, F1, F1, array_of(CURSOR), i8, u1, F2,
       types.Tuple((array_of(STEP_CONTROL), array_of(COUNTERS))), MATRICES, F1, F1, EVENTS, OUT),
    nogil=True,
)  # fmt: skip
def run_adaptive(
    scene, links, tableau, controller, order, size, times, corners, cursor, budget, stabilised,
    stages, control, matrices, flow, failure, events, out,
):  # fmt: skip
    """At most `budget` attempts and frames on from `cursor`; a status code, RUNNING if not over.

    `times` are those of frames, `corners` those where tables bend: steps end there. A method
    without dense output ends its steps at frames too. EVENT is given once for each event, with Y
    there: the caller may change Y, FRESH and the scene, and go on; a frame of that time follows.
    """
    settings, counters = control[0][0], control[1][0]
    control, cursor = (settings, counters), cursor[0]
    last = times.shape[0]
    dense = tableau[4].shape[0] > 0
    for _ in range(budget):
        i = cursor.frame
        if i == last:
            return at.DONE
        t = settings.time
        code = at.DONE
        if times[i] < t or (times[i] == t and settings.fired == 0):
            if frame(
                scene, links, tableau, size, times[i], i, stabilised, stages, control, flow, out
            ) == 0:  # fmt: skip
                code = at.NOT_FINITE
            else:
                cursor.frame = i + 1
        elif settings.fired == 1:
            settings.fired = 0
            return at.EVENT
        elif counters.steps + counters.rejected_steps >= settings.most:
            code = at.TOO_MANY
        else:
            code = step_once(
                scene, links, tableau, controller, order, size, corners,
                times[last - 1] if dense else times[i], stabilised, stages, control, matrices,
                flow, events,
            )  # fmt: skip
        if code != at.DONE:
            give_up(scene, links, tableau, size, times, cursor, t, stages, control, flow, out)
            failure[0] = t
            nq, nv = size
            failure[1] = fastest_row(opened(scene).rows, stages[at.Y, nq : nq + nv])
            return code
    return at.DONE if cursor.frame == last else at.RUNNING


@sweep
def give_up(scene, links, tableau, size, times, cursor, t, stages, control, flow, out):
    """The last state that was good becomes the last frame, if it is later than the one before."""
    settings, _ = control
    i = cursor.frame
    if settings.time > t:
        copied(stages, at.Y_OLD, at.Y, stages.shape[1])
        settings.time = t
    if i > 0 and i < times.shape[0] and times[i - 1] < t:
        times[i] = t
        cursor.frame = i + frame(
            scene, links, tableau, size, t, i, False, stages, control, flow, out
        )
