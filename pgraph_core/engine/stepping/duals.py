"""Derivatives of a run: after each step of numbers, the same step of duals from the same state.

The run of numbers is the one that has no derivatives, and decides on everything: widths, frames,
rejected steps. A run of duals has a scene, stages and a control of its own, and takes its values
from the run of numbers after each step.
"""

from .. import layout as at
from ..arrays import OUT, opened_run
from ..compiler.address import caller
from ..compiler.dual import duals, revalued
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, F3, I1, carrying, f8, i8, of_duals, void
from ..motion import acceleration, call_projection, call_record, constrain, opened, projection
from ..records import REACHED
from ..tree.moving import normalise_all
from .batch import call_advance
from .explicit import dense_output, last_stage, runge_kutta_step, semi_implicit_step, turn_spins
from .state import acceleration_of, copied, onto_constraints, size_of_state

D1, F4 = carrying(F1), f8[:, :, :, ::1]
STEP_OF_DUALS = void(of_duals, i8)  # run of duals, run of numbers
NOTE = void(of_duals, i8, i8, F3)  # the same, frame, its derivatives
call_step_of_duals = caller(STEP_OF_DUALS)
call_note = caller(NOTE)


@kernel(i8(of_duals, f8, D1, D1, D1, D1, D1), nogil=True, later=True)
def acceleration_of_duals(scene, t, q, v, tau, vdot, flow):
    """`motion.acceleration`."""
    return acceleration(scene, t, q, v, tau, vdot, flow)


@kernel(i8(of_duals, f8, D1, D1, D1, D1), nogil=True, later=True)
def constrain_duals(scene, t, q, v, vdot, flow):
    """`motion.constrain`."""
    return constrain(scene, t, q, v, vdot, flow)


@kernel(i8(of_duals, f8, D1, D1, i8), nogil=True, later=True)
def projection_of_duals(scene, t, q, v, rounds):
    """`motion.projection`."""
    return projection(scene, t, q, v, rounds)


@kernel(void(i8, i8, i8, F1, F2, OUT), nogil=True, later=True)
def record_states(scene, record, accelerate, times, states, out):
    """Record frames of given states (1 + frames, nq + nv + 2), of which the first is scratch."""
    flow, nq, nv = states[0, :3], out[0].shape[1], out[1].shape[1]
    for i in range(1, states.shape[0]):
        y = states[i]
        ledger = y[nq + nv :]
        given = scene, accelerate, times[i - 1], y[:nq], y[nq : nq + nv], flow, ledger, i - 1, out
        call_record(record, given)


@kernel(void(of_duals, f8, i8), nogil=True, later=True)
def place_of_duals(run, t, rounds):
    """Project the state Y onto the constraints."""
    data = opened_run(run)
    nq, nv = size_of_state(run)
    y = data.stages[at.Y]
    call_projection(data.links.project, (data.scene, t, y[:nq], y[nq : nq + nv], rounds))


@sweep
def take_values(run, numbers, row, source):
    """Give the state in `row` the values of row `source` of the run of numbers."""
    stages, given = opened_run(run).stages, opened_run(numbers).stages
    for i in range(stages.shape[1]):
        stages[row, i] = revalued(stages[row, i], given[source, i])


@sweep
def go_back(run, numbers):
    """Return to the start of the last step, for numbers without derivatives."""
    control, given = opened_run(run).control[0], opened_run(numbers).control[0]
    take_values(run, numbers, at.Y, at.Y_OLD)
    control.time = given.old_time
    control.clip = given.clip


@part
def width_of_step(numbers):
    """Return the width of the last step of numbers, which an event may have cut short."""
    given = opened_run(numbers).control[0]
    return given.time - given.old_time if given.fired == REACHED else given.old_width


@sweep
def begin_step(run, numbers):
    """Go back to the start of the last step of numbers, with v' there."""
    go_back(run, numbers)
    control = opened_run(run).control[0]
    if control.fresh == 0:
        acceleration_of(run, control.time, at.Y, at.SLOPE)


@sweep
def end_step(run, numbers):
    """Make CANDIDATE, on the constraints, the state Y, as `run.accept` does."""
    data = opened_run(run)
    control, stages, given = data.control[0], data.stages, opened_run(numbers).control[0]
    rows, size = opened(data.scene).rows, size_of_state(run)
    copied(stages, at.Y, at.Y_OLD, stages.shape[1])
    copied(stages, at.CANDIDATE, at.Y, stages.shape[1])
    control.old_time = given.old_time
    control.old_width = given.old_width
    control.time = given.time
    control.filled = 0
    if size[0] > size[1]:
        normalise_all(rows, stages[at.Y, : size[0]])
    control.fresh = given.fresh if data.method[0].ends == 1 else 0
    if control.fresh == 1:
        copied(stages, at.STAGE + data.tableau.b.shape[0], at.SLOPE, stages.shape[1])
        turn_spins(rows, size, stages, at.Y, at.SLOPE, True)
    onto_constraints(run, control.time, at.Y)
    take_values(run, numbers, at.Y, at.Y)


@kernel(STEP_OF_DUALS, nogil=True, later=True)
def explicit_of_duals(run, numbers):
    """Repeat an explicit step."""
    begin_step(run, numbers)
    data, other = opened_run(run), opened_run(numbers).control[0]
    control, stages, tableau = data.control[0], data.stages, data.tableau
    rows, size = opened(data.scene).rows, size_of_state(run)
    dense = tableau.dense.shape[0] > 0
    t, h = control.time, other.old_width if dense else width_of_step(numbers)
    if tableau.b.shape[0] == 0:
        semi_implicit_step(rows, size, h, stages)
    else:
        given, in_body = (tableau.a, tableau.b, tableau.c), tableau.error.shape[0] > 0
        runge_kutta_step(run, None, rows, given, size, t, h, control.clip, stages, in_body)
    if data.method[0].ends == 1:
        last_stage(run, min(t + h, control.clip))
    if dense and other.fired == REACHED:
        copied(stages, at.Y, at.Y_OLD, stages.shape[1])
        control.old_time = t
        control.old_width = h
        control.filled = 0
        dense_output(run, width_of_step(numbers) / h)
        copied(stages, at.TRIAL, at.CANDIDATE, stages.shape[1])
    end_step(run, numbers)


@kernel(NOTE, nogil=True, later=True)
def note_duals(run, numbers, i, out):
    """Write q and v of frame i, which the run of numbers has recorded, into `out`."""
    data = opened_run(run)
    control, stages, t = data.control[0], data.stages, opened_run(numbers).times[i]
    row = at.Y
    if t != control.time:
        dense_output(run, (t - control.old_time) / control.old_width)
        row = at.TRIAL
        onto_constraints(run, t, row)
    wanted = duals(out)
    for n in range(wanted.shape[1]):
        wanted[i, n] = stages[row, n]


@kernel(i8(i8, i8, I1, i8, i8, F4, i8), nogil=True, later=True)
def advance_with_duals(run, advance, others, step, note, out, budget):
    """`advance_run` with the runs of duals at the addresses `others`. Returns its status code.

    `out` (others, frames, nq + nv, WIDTH) gets their states at the frames.
    """
    control, counters = opened_run(run).control[0], opened_run(run).counters[0]
    for _ in range(budget):
        frame, steps = control.frame, counters.steps
        code = call_advance(advance, (run, 1))
        if counters.steps > steps:
            for k in range(others.shape[0]):
                call_step_of_duals(step, (others[k], run))
        if control.frame > frame:
            for k in range(others.shape[0]):
                call_note(note, (others[k], run, frame, out[k]))
        if code != at.RUNNING:
            return code
    return at.RUNNING
