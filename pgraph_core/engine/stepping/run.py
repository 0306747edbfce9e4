"""Runs at fixed steps: frames, and the steps between them.

Between two frames lie `substeps[i]` steps of `width[i]`. The step of a method and the equations of
motion are called by address; `links` are the addresses of acceleration, projection, record, step.
The explicit steps serve single instances (a scene) and lanes of a batch (trees).
"""

from numba import types

from .. import layout as at
from ..arrays import Loads
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..constraints.blocks import velocities
from ..forces import apply_loads, drive
from ..motion import F1, F2, I1, OUT, call_acceleration, call_projection, call_record, opened
from ..records import COUNTERS, CURSOR, array_of
from ..tree.articulated import articulated, inboard, joint_acceleration
from ..tree.kinematics import outboard, positions
from ..tree.moving import advance, normalise_all, rate
from ..vec import finite

STEP_ROUNDS = 10  # of projection a step: one is the rule

LINKS = types.UniTuple(types.int64, 4)
TABLEAU = types.Tuple((F2, F1, F1))
f8, i8 = types.float64, types.int64
# scene, accelerate, tableau, t, h, q, v, fresh, stages, flow, ledger; solver iterations.
# fresh: v' of this state is in row VDOT of `stages` already, and its power in `flow`
STEP = i8(i8, i8, TABLEAU, f8, f8, F1, F1, i8, F2, F1, F1)
call_step = caller(STEP)
SETTLE = i8(i8, f8, F1, F1)  # scene, t, q, v: after a step of a scene with contacts
call_settle = caller(SETTLE)

# rows of `stages`: q and v before the step, τ, then q' and v' of each stage in turn
Q0, V0, TAU, QDOT, VDOT = 0, 1, 2, 3, 4


@sweep
def derivative(rows, const, drives, loads, work, t, q, v, given, tau, vdot):
    """v' of driven trees in lanes; `loads` is None if there are none."""
    drive(drives, t, q, v, given, tau)
    if loads is None:
        articulated(rows, const, q, v, tau, work, vdot)
    else:
        outboard(rows, const, work, q, v)
        linear = work[:, at.VELOCITY : at.VELOCITY + 3]
        moving(rows, const, work, v, linear)
        apply_loads(Loads(loads[0], loads[1]), work, linear, t)
        inboard(rows, const, work, tau)
        joint_acceleration(rows, const, work, vdot)


@sweep
def moving(rows, const, work, v, linear):
    """Places of all origins into X, their velocities into `linear`: U, until `inboard` fills it."""
    positions(rows, work)
    velocities(rows, const, work, v, linear)


@sweep
def explicit_step(scene, trees, rows, tableau, t, h, q, v, stages):
    """One explicit Runge-Kutta step of (q, v), of a scene or of lanes; solver iterations."""
    a, b, c = tableau
    nq = q.shape[0]
    nv = v.shape[0]
    for i in range(nq):
        stages[Q0, i] = q[i]
    for j in range(nv):
        stages[V0, j] = v[j]
    total = 0
    for n in range(b.shape[0]):
        for r in range(n):
            if a[n, r] != 0.0:
                for i in range(nq):
                    q[i] += h * a[n, r] * stages[QDOT + 2 * r, i]
                for j in range(nv):
                    v[j] += h * a[n, r] * stages[VDOT + 2 * r, j]
        rate(rows, q, v, stages[QDOT + 2 * n, :nq])
        vdot = stages[VDOT + 2 * n, :nv]
        tau = stages[TAU, :nv]
        total += slope(scene, trees, n, t + c[n] * h, h * b[n], q, v, tau, vdot)
        for i in range(nq):
            q[i] = stages[Q0, i]
        for j in range(nv):
            v[j] = stages[V0, j]
    for n in range(b.shape[0]):
        for i in range(nq):
            q[i] += h * b[n] * stages[QDOT + 2 * n, i]
        for j in range(nv):
            v[j] += h * b[n] * stages[VDOT + 2 * n, j]
    normalise_all(rows, q)
    return total


@sweep
def semi_implicit_step(scene, trees, rows, t, h, q, v, stages):
    """v += h v', then q moved along the new v; order 1, symplectic for conservative trees."""
    nv = v.shape[0]
    vdot = stages[VDOT, :nv]
    taken = slope(scene, trees, 0, t, h, q, v, stages[TAU, :nv], vdot)
    for j in range(nv):
        v[j] += h * vdot[j]
    advance(rows, q, v, h)
    return taken


@sweep
def slope(scene, trees, stage, t, weight, q, v, tau, vdot):
    """v' of a scene, its work and dissipation into the ledger, or of trees in lanes.

    The other one is None; `weight` [s] turns power into work. Solver iterations.
    """
    iterations = 0
    if trees is not None:
        rows, const, drives, loads, work, given = trees
        derivative(rows, const, drives, loads, work, t, q, v, given, tau, vdot)
    if scene is not None:
        address, accelerate, fresh, flow, ledger = scene
        if stage > 0 or fresh == 0:
            call_acceleration(accelerate, (address, t, q, v, tau, vdot, flow))
        ledger[at.WORK_DONE] += weight * flow[0]
        ledger[at.DISSIPATED] += weight * flow[1]
        iterations = int(flow[2])
    return iterations


@kernel(STEP, nogil=True)
def runge_kutta(scene, accelerate, tableau, t, h, q, v, fresh, stages, flow, ledger):
    """One explicit Runge-Kutta step of (q, v), and of the ledger; solver iterations."""
    system = (scene, accelerate, fresh, flow, ledger)
    rows = opened(scene).rows
    return explicit_step(system, None, rows, tableau, t, h, q, v, stages)


@kernel(STEP, nogil=True)
def semi_implicit(scene, accelerate, tableau, t, h, q, v, fresh, stages, flow, ledger):
    """One step of semi-implicit Euler, and of the ledger; solver iterations."""
    system = (scene, accelerate, fresh, flow, ledger)
    return semi_implicit_step(system, None, opened(scene).rows, t, h, q, v, stages)


@part
def finish(scene, project, stabilised, t, q, v, counters):
    """Finish a step: check it and project it onto the constraints; a status code."""
    if not finite(v):
        return at.NOT_FINITE
    settle = opened(scene).links.settle
    if settle != 0:
        call_settle(settle, (scene, t, q, v))
    if stabilised and opened(scene).blocks.active[0] > 0:
        rounds = call_projection(project, (scene, t, q, v, STEP_ROUNDS))
        counters.projections += abs(rounds)
        if not finite(v):
            return at.NOT_FINITE
        if rounds < 0:
            return at.NOT_CONVERGED
    return at.DONE


@kernel(
    i8(i8, LINKS, TABLEAU, types.Tuple((F1, I1, F1)), array_of(CURSOR), i8, types.boolean, F1,
       F1, F2, F1, F1, array_of(COUNTERS), F1, OUT),
    nogil=True,
)  # fmt: skip
def run(
    scene, links, tableau, schedule, cursor, budget, stabilised, q, v, stages, flow, ledger,
    counters, failure, out,
):  # fmt: skip
    """At most `budget` steps and frames on from `cursor`; a status code, RUNNING if not over.

    Frame 0 is the state as given. Where a step fails, the state before it becomes the last
    frame, and `failure` gets its time and the row that moved fastest.
    """
    accelerate, project, record, step = links
    cursor, counters = cursor[0], counters[0]
    times, substeps, width = schedule
    before = stages.shape[0] - 2
    for _ in range(budget):
        i = cursor.frame
        if i == times.shape[0]:
            return at.DONE
        taken = cursor.taken
        if i == 0 or taken == substeps[i - 1]:
            if not call_record(record, (scene, accelerate, times[i], q, v, flow, ledger, i, out)):
                fail(scene, times[i], v, failure)
                return at.NOT_FINITE
            cursor.frame = i + 1
            cursor.taken = 0
            cursor.fresh = 1  # the first stage of the next step is known
            for j in range(v.shape[0]):
                stages[VDOT, j] = out[2][i, j]
            continue
        h = width[i - 1]
        t = times[i - 1] + taken * h
        keep(q, v, stages, before)
        state = (q, v, cursor.fresh, stages, flow, ledger)
        iterations = call_step(step, (scene, accelerate, tableau, t, h, *state))
        cursor.fresh = 0
        counters.evaluations += max(tableau[1].shape[0], 1)
        counters.steps += 1
        counters.solver_iterations += iterations
        code = finish(scene, project, stabilised, t + h, q, v, counters)
        if code != at.DONE:
            restore(q, v, stages, before)
            fail(scene, t, v, failure)
            if taken > 0:
                times[i] = t
                frame = (scene, accelerate, t, q, v, flow, ledger, i, out)
                cursor.frame = i + call_record(record, frame)
            return code
        cursor.taken = taken + 1
    return at.DONE if cursor.frame == times.shape[0] else at.RUNNING


@part
def keep(q, v, stages, row):
    """The state before a step, for the case that it fails."""
    for i in range(q.shape[0]):
        stages[row, i] = q[i]
    for j in range(v.shape[0]):
        stages[row + 1, j] = v[j]


@part
def restore(q, v, stages, row):
    """Back to the state before the step."""
    for i in range(q.shape[0]):
        q[i] = stages[row, i]
    for j in range(v.shape[0]):
        v[j] = stages[row + 1, j]


@part
def fail(scene, t, v, failure):
    failure[0] = t
    failure[1] = fastest_row(opened(scene).rows, v)


@sweep
def fastest_row(rows, v):
    """Row of the largest joint velocity."""
    best = 0.0
    row = 1
    for k in range(1, rows.shape[0]):
        if abs(v[rows[k, at.VI]]) > best:
            best = abs(v[rows[k, at.VI]])
            row = k
    return row


@kernel("void(i8[:,::1],f8[::1],f8[::1],f8)")
def move(rows, q, v, h):
    """q moved along v for the time h."""
    advance(rows, q, v, h)
