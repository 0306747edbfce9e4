"""Derivatives of a run. Each primal step is followed by the same step with dual numbers.

The primal run has no derivatives and makes all decisions, such as step sizes, frames and rejected
steps. A dual run has its own scene, stages and control, and copies its values from the primal run
after each step.
"""

import math

from ...tolerances import NOTABLE, ROUNDING
from .. import layout as at
from ..arrays import (
    CORRECTION,
    CORRECTION_SIZES,
    DINV,
    EFFECT,
    FACTORED,
    FACTORS,
    LAMBDA,
    OUT,
    RHS,
    ZERO,
    carried_at,
    opened_run,
)
from ..compiler.address import caller
from ..compiler.dual import WIDTH, duals, parted, revalued
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, F3, I1, carrying, f8, i8, of_duals, void
from ..constraints.constraints import gaps, located, number_rows, respond, speeds
from ..constraints.proximal import REFINEMENTS, remainder, solve_factor, take_out, whole_blocks
from ..contact.touches import touching
from ..motion import (
    acceleration,
    call_projection,
    call_record,
    constrain,
    follow,
    opened,
    projection,
)
from ..records import CONTACT_AHEAD, REACHED
from ..signals import HELD_FROM, SIDE
from ..tree.articulated import inboard
from ..tree.kinematics import frames, outboard, positions
from ..tree.moving import advance, normalise_all
from .batch import call_advance
from .control.clock import (
    begin_step_of,
    end_step_of,
    forget_slope,
    keep_slope,
    note_repeated,
    set_last_step,
    set_time,
)
from .explicit import dense_output, last_stage, runge_kutta_step, semi_implicit_step, turn_spins
from .looks import step_again
from .measured import hold
from .state import acceleration_of, call_step, copied, onto_constraints, size_of_state

D1, F4 = carrying(F1), f8[:, :, :, ::1]
STEP_OF_DUALS = void(of_duals, i8)  # run of duals, run of numbers
NOTE = void(of_duals, i8, i8, F3)  # the same, frame, its derivatives
call_step_of_duals = caller(STEP_OF_DUALS)
call_note = caller(NOTE)

ANOTHER = 7.0  # why derivatives end
MOVING = 2  # value of `repeated` while a step is taken with derivatives by its width


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


@kernel(void(of_duals, f8), nogil=True, later=True)
def see_duals(run, t):
    """Evaluate the expressions at the state Y."""
    data = opened_run(run)
    nq, nv = size_of_state(run)
    y = data.stages[at.Y]
    follow(opened(data.scene), t, y[:nq], y[nq : nq + nv])


@kernel(i8(of_duals, f8), nogil=True, later=True)
def find_duals(run, margin):
    """Find the contact points within a margin at the state Y. Returns their number."""
    data = opened_run(run)
    own, (nq, nv) = opened(data.scene), size_of_state(run)
    y = data.stages[at.Y]
    outboard(own.rows, own.const, own.work, y[:nq], y[nq : nq + nv])
    positions(own.rows, own.work)
    return touching(data.scene, margin, 0)


@kernel(void(i8, f8, f8), nogil=True, later=True)
def step_beside(run, t, w):
    """Repeat the last primal step from another time t with width w, into TRIAL."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    nq, nv = size_of_state(run)
    copied(stages, at.Y_OLD, at.Y, stages.shape[1])
    set_time(control.clock, t)
    acceleration_of(run, t, at.Y, at.SLOPE)
    call_step(data.links.step, (run, w))
    copied(stages, at.CANDIDATE, at.TRIAL, stages.shape[1])
    if nq > nv:
        normalise_all(opened(data.scene).rows, stages[at.TRIAL, :nq])
    onto_constraints(run, t + w, at.TRIAL)


@sweep
def take_sides(run, numbers):
    """Give comparisons of the motion the results that the primal run holds.

    Their positions may differ, because a factor of 1 does not require an instruction.
    """
    code = opened(opened_run(run).scene).loads.signals[0]
    given = opened(opened_run(numbers).scene).loads.signals[0]
    n = 0
    for i in range(0, given.shape[0], 2):
        if given[i, 0] >= HELD_FROM:
            while code[n, 0] < HELD_FROM:
                n += 2
            code[n + 1, SIDE] = revalued(code[n + 1, SIDE], given[i + 1, SIDE])
            n += 2
    hold(opened_run(run).scene, code)


@sweep
def take_values(run, numbers, row, source):
    """Copy the values of row `source` of the primal run to the state in `row`."""
    stages, given = opened_run(run).stages, opened_run(numbers).stages
    for i in range(stages.shape[1]):
        stages[row, i] = revalued(stages[row, i], given[source, i])


@sweep
def go_back(run, numbers):
    """Return to the start of the last step, for numbers without derivatives."""
    control, given = opened_run(run).control[0], opened_run(numbers).control[0]
    take_values(run, numbers, at.Y, at.Y_OLD)
    begin_step_of(control.clock, given.clock)
    if opened_run(numbers).links.cross != 0:
        take_sides(run, numbers)


@part
def width_of_step(numbers):
    """Return the width of the last primal step, which an event may have cut short."""
    given = opened_run(numbers).control[0]
    return (
        given.clock.time - given.clock.old_time
        if given.guard.fired == REACHED
        else given.clock.old_width
    )


@sweep
def begin_step(run, numbers):
    """Return to the start of the last primal step, including v'."""
    go_back(run, numbers)
    control = opened_run(run).control[0]
    if control.clock.fresh == 0:
        acceleration_of(run, control.clock.time, at.Y, at.SLOPE)


@sweep
def end_step(run, numbers):
    """Make CANDIDATE, on the constraints, the state Y, as `run.accept` does."""
    data = opened_run(run)
    control, stages, given = data.control[0], data.stages, opened_run(numbers).control[0]
    clock = control.clock
    rows, size = opened(data.scene).rows, size_of_state(run)
    copied(stages, at.Y, at.Y_OLD, stages.shape[1])
    copied(stages, at.CANDIDATE, at.Y, stages.shape[1])
    end_step_of(clock, given.clock)
    if size[0] > size[1]:
        normalise_all(rows, stages[at.Y, : size[0]])
    forget_slope(clock)
    if data.method[0].ends == 1 and given.clock.fresh == 1:
        keep_slope(clock)
        copied(stages, at.STAGE + data.tableau.b.shape[0], at.SLOPE, stages.shape[1])
        turn_spins(rows, size, stages, at.Y, at.SLOPE, True)
    onto_constraints(run, clock.time, at.Y)
    take_values(run, numbers, at.Y, at.Y)


@kernel(STEP_OF_DUALS, nogil=True, later=True)
def explicit_of_duals(run, numbers):
    """Repeat an explicit step."""
    begin_step(run, numbers)
    data, other = opened_run(run), opened_run(numbers).control[0]
    control, stages, tableau = data.control[0], data.stages, data.tableau
    clock = control.clock
    rows, size = opened(data.scene).rows, size_of_state(run)
    dense = tableau.dense.shape[0] > 0
    t, h = clock.time, other.clock.old_width if dense else width_of_step(numbers)
    if tableau.b.shape[0] == 0:
        semi_implicit_step(rows, size, h, stages)
    else:
        given, in_body = (tableau.a, tableau.b, tableau.c), tableau.error.shape[0] > 0
        runge_kutta_step(run, None, rows, given, size, t, h, clock.clip, stages, in_body)
    if data.method[0].ends == 1:
        last_stage(run, min(t + h, clock.clip))
    if dense and other.guard.fired == REACHED:
        copied(stages, at.Y, at.Y_OLD, stages.shape[1])
        set_last_step(clock, t, h)
        dense_output(run, width_of_step(numbers) / h)
        copied(stages, at.TRIAL, at.CANDIDATE, stages.shape[1])
    end_step(run, numbers)


# -- frames within a step, projected by the factors of the primal run --------------------------


@sweep
def copied_values(out, given, first, rows, columns):
    """Copy this part of a primal table to duals without derivatives."""
    for i in range(first, first + rows):
        for j in range(columns):
            out[i, j] = given[i, j]


@sweep
def take_factors(scene, numbers, q, v, m):
    """Copy the factors of the last primal acceleration, with m rows, to a dual scene.

    The factors of the tree are recomputed, because the energies have overwritten some of them.
    """
    own, given = opened(scene), opened(numbers)
    mine, other, end = own.space, given.space, whole_blocks(m)
    zero = other.vectors[ZERO]
    for j in range(v.shape[0]):
        zero[j] = 0.0
    outboard(given.rows, given.const, given.work, q, v)
    inboard(given.rows, given.const, given.work, zero)
    copied_values(own.work, given.work, 0, given.work.shape[0], given.work.shape[1])
    for j in range(1, given.blocks.active[0] + 1):
        i = given.blocks.active[j]
        copied_values(mine.y, other.y, i, 1, other.y.shape[1])
        for k in range(other.slots.shape[1]):
            mine.slots[i, k] = other.slots[i, k]
    copied_values(mine.omega, other.omega, 0, end, end)
    copied_values(mine.factor, other.factor, 0, end, end)
    copied_values(mine.nulls, other.nulls, 0, int(other.vectors[FACTORED, FACTORS.nulls]), end)
    copied_values(mine.vectors, other.vectors, DINV, 1, other.vectors.shape[1])
    mine.vectors[FACTORED, FACTORS.known] = 0.0  # have no derivatives


@sweep
def improves(lam, change, before, end):
    """Check whether corrections of some derivatives are above rounding and all others shrink.

    `before` (WIDTH) contains the size of the last corrections.
    """
    impulses, corrections = parted(lam), parted(change)
    found = False
    for k in range(1, WIDTH):
        size, largest = 0.0, 0.0
        for r in range(end):
            size = max(size, abs(impulses[r, k]))
            largest = max(largest, abs(corrections[r, k]))
        if largest > ROUNDING * size:
            if not largest < 0.5 * before[k]:
                return False
            before[k] = largest
            found = True
    return found


@sweep
def corrected(scene, count, m):
    """Compute -M⁻¹ Jᵀ Ω⁺ RHS in EFFECT with the factors at hand, refined for the derivatives."""
    own = opened(scene)
    space, vectors, end = own.space, own.space.vectors, whole_blocks(m)
    rhs, lam, change, before = (
        vectors[RHS],
        vectors[LAMBDA],
        vectors[CORRECTION],
        vectors[CORRECTION_SIZES],
    )
    for r in range(end):
        rhs[r] = -rhs[r] if r < m else 0.0 * rhs[r]
    for n in range(count):
        take_out(space.nulls, n, rhs, end)
    for r in range(end):
        lam[r] = rhs[r]
    solve_factor(space.factor, lam, m)
    for k in range(WIDTH):
        parted(before)[0, k] = math.inf
    for _ in range(REFINEMENTS):
        remainder(space.omega, rhs, lam, change, end)
        solve_factor(space.factor, change, m)
        if not improves(lam, change, parted(before)[0], end):
            break
        for r in range(end):
            lam[r] += change[r]
    for n in range(count):
        take_out(space.nulls, n, lam, end)
    respond(own.rows, own.const, own.blocks, own.work, space)


@sweep
def frame_onto_constraints(run, numbers, t, row):
    """Move the derivatives of a frame onto the constraints.

    The primal run has its state there and its factors. By the implicit function theorem, the
    derivatives of factors do not enter where g and g' are zero.
    """
    data, other = opened_run(run), opened_run(numbers)
    scene, given = data.scene, other.scene
    if data.control[0].error.project == 0 or opened(scene).blocks.active[0] == 0:
        return
    nq, nv = size_of_state(run)
    own, count = opened(scene), int(opened(given).space.vectors[FACTORED, FACTORS.nulls])
    m = number_rows(own.blocks, own.space.slots)
    take_values(run, numbers, row, row)
    state = other.stages[row]
    take_factors(scene, given, state[:nq], state[nq : nq + nv], m)
    q, v, step = data.stages[row, :nq], data.stages[row, nq : nq + nv], own.space.vectors[EFFECT]
    frames(own.rows, own.const, own.work, q, v)
    located(scene, q, v, False)
    gaps(scene, t, q, RHS)
    corrected(scene, count, m)
    advance(own.rows, q, step, 1.0)
    take_values(run, numbers, row, row)
    frames(own.rows, own.const, own.work, q, v)
    located(scene, q, v, True)
    speeds(scene, t, v, RHS)
    corrected(scene, count, m)
    for j in range(nv):
        v[j] += step[j]
    take_values(run, numbers, row, row)


@kernel(NOTE, nogil=True, later=True)
def note_duals(run, numbers, i, out):
    """Write q and v of frame i, which the primal run has recorded, into `out`."""
    data = opened_run(run)
    control, stages, t = data.control[0], data.stages, opened_run(numbers).times[i]
    clock = control.clock
    row = at.Y
    if t != clock.time:
        dense_output(run, (t - clock.old_time) / clock.old_width)
        row = at.TRIAL
        frame_onto_constraints(run, numbers, t, row)
    wanted = duals(out)
    for n in range(wanted.shape[1]):
        wanted[i, n] = stages[row, n]


@sweep
def is_another(run):
    """Check whether the step just repeated ends elsewhere, as contacts keep their last forces."""
    stages = opened_run(run).stages
    nq, nv = size_of_state(run)
    size, apart = 0.0, 0.0
    for i in range(nq + nv):
        size = max(size, abs(stages[at.Y, i]))
        apart = max(apart, abs(stages[at.TRIAL, i] - stages[at.Y, i]))
    return apart > NOTABLE * size


@kernel(i8(i8, i8, I1, i8, i8, F4, f8, i8), nogil=True, later=True)
def advance_with_duals(run, advance, others, step, note, out, until, budget):
    """`advance_run` with the runs of duals at the addresses `others`. Returns its status code.

    The function returns after a step that ends at a change of a comparison, that slides along its
    threshold, or that reaches the time `until`. `out` (others, frames, nq + nv, WIDTH) gets their
    states at the frames.
    """
    control, counters = opened_run(run).control[0], opened_run(run).counters[0]
    clock, guard = control.clock, control.guard
    crosses = opened_run(run).links.cross != 0
    for _ in range(budget):
        frame, steps = clock.frame, counters.steps
        code = call_advance(advance, (run, 1))
        if counters.steps > steps and guard.fired != CONTACT_AHEAD:  # such an event undoes it
            if clock.repeated == 1 and guard.carried != 0:  # duals are at the end of a trial
                if guard.fired == REACHED:
                    note_repeated(clock, MOVING)
                    step_again(run, clock.old_width)
                step_again(run, clock.old_width)
                if is_another(run):
                    ended = carried_at(guard.carried).ended
                    if ended[1] == 0.0:
                        ended[0], ended[1] = clock.old_time, ANOTHER
                    step_again(run, clock.old_width)
            for k in range(others.shape[0]):
                call_step_of_duals(step, (others[k], run))
        if clock.frame > frame:
            for k in range(others.shape[0]):
                call_note(note, (others[k], run, frame, out[k]))
        if code != at.RUNNING:
            return code
        if (
            crosses
            and counters.steps > steps
            and (control.ends.sided == 0 or control.ends.slid > 0)
        ):
            break
        if clock.time >= until:
            break
    return at.RUNNING
