"""Whole runs inside one compiled call: drives, constrained acceleration, methods, recording.

A run is a sequence of frames; between two frames lie `substeps[i]` steps of `width[i]`. Methods
are data: an explicit Runge-Kutta tableau (a, b, c), or an empty one for semi-implicit Euler.
"""

import math

from . import layout as at
from ._jit import inlined, kernel, part, sweep
from .articulated import articulated, singular_row
from .constraints import impose, project, residual, residual_velocity
from .kinematics import kinetic_and_potential, outboard, positions
from .moving import advance, normalise_all, rate
from .proximal import CHANGE, LAMBDA
from .vec import finite, largest

TREE = "i8[:,::1],f8[:,::1]"
TABLES = "Tuple((i8[:,::1],f8[:,::1],i8[::1]))"
DRIVES = "Tuple((f8[:,::1],f8[:,::1],i8))"
SPACE = "UniTuple(f8[:,::1],5)"
F1 = "f8[::1]"
STEP_ROUNDS = 10  # of projection a step: one is the rule


@sweep
def lookup(knots, first, count, t):
    """Value of a table at time t: straight lines between knots, constant outside them."""
    if t <= knots[first, 0]:
        return knots[first, 1]
    for n in range(first + 1, first + count):
        if t < knots[n, 0]:
            share = (t - knots[n - 1, 0]) / (knots[n, 0] - knots[n - 1, 0])
            return knots[n - 1, 1] + share * (knots[n, 1] - knots[n - 1, 1])
    return knots[first + count - 1, 1]


@sweep
def drive(drives, t, q, v, given, tau):
    """τ of all drives and the given torques into `tau`; (power put in, power dissipated) [W]."""
    table, knots, passive = drives
    put_in = 0.0
    dissipated = 0.0
    for j in range(tau.shape[0]):
        tau[j] = 0.0
    for j in range(given.shape[0]):  # empty where no torques are given
        tau[j] = given[j]
        put_in += given[j] * v[j]
    for n in range(table.shape[0]):
        j = int(table[n, at.DR_V])
        i = int(table[n, at.DR_Q])
        kd = table[n, at.DR_KD]
        speed = v[j]
        drag = kd * speed
        friction = table[n, at.DR_FRICTION]
        if friction > 0.0:
            drag += friction * speed / math.sqrt(speed * speed + at.CREEP * at.CREEP)
        torque = -drag
        if i >= 0:
            first = int(table[n, at.DR_TARGET])
            target = lookup(knots, first, int(table[n, at.DR_TARGET_N]), t)
            torque += table[n, at.DR_KP] * (target - q[i])
        if n < passive:
            dissipated += drag * speed
        else:
            first = int(table[n, at.DR_TORQUE])
            torque += lookup(knots, first, int(table[n, at.DR_TORQUE_N]), t)
            limit = table[n, at.DR_LIMIT]
            torque = min(max(torque, -limit), limit)
            put_in += torque * v[j]
        tau[j] += torque
    return put_in, dissipated


@sweep
def elastic(drives, q):
    """Energy of the joints' springs [J]."""
    table, knots, passive = drives
    energy = 0.0
    for n in range(passive):
        i = int(table[n, at.DR_Q])
        if i >= 0:
            stretch = q[i] - knots[int(table[n, at.DR_TARGET]), 1]
            energy += 0.5 * table[n, at.DR_KP] * stretch * stretch
    return energy


@sweep
def acceleration(rows, const, drives, tables, work, space, gains, t, q, v, given, tau, vdot):
    """v' of the driven, constrained system; (power put in, power dissipated, iterations)."""
    put_in, dissipated = drive(drives, t, q, v, given, tau)
    articulated(rows, const, q, v, tau, work, vdot)
    iterations = 0
    if tables[2].shape[0] > 0:
        iterations = impose(rows, const, tables, work, space[:4], gains, v, vdot)
    return put_in, dissipated, iterations


@inlined
def runge_kutta(
    rows, const, drives, tables, work, space, gains, tableau, t, h, q, v, given, stages, ledger
):
    """One explicit Runge-Kutta step from the kept (q, v), and of the ledger; iterations taken."""
    a, b, c = tableau
    nq = q.shape[0]
    nv = v.shape[0]
    s = b.shape[0]
    vectors = space[4]
    q0 = vectors[0, :nq]
    v0 = vectors[1, :nv]
    tau = vectors[2, :nv]
    total = 0
    for n in range(s):
        for r in range(n):
            if a[n, r] != 0.0:
                for i in range(nq):
                    q[i] += h * a[n, r] * stages[2 * r, i]
                for j in range(nv):
                    v[j] += h * a[n, r] * stages[2 * r + 1, j]
        rate(rows, q, v, stages[2 * n, :nq])
        put_in, dissipated, iterations = acceleration(
            rows,
            const,
            drives,
            tables,
            work,
            space,
            gains,
            t + c[n] * h,
            q,
            v,
            given,
            tau,
            stages[2 * n + 1, :nv],
        )
        ledger[at.WORK_DONE] += h * b[n] * put_in
        ledger[at.DISSIPATED] += h * b[n] * dissipated
        total += iterations
        for i in range(nq):
            q[i] = q0[i]
        for j in range(nv):
            v[j] = v0[j]
    for n in range(s):
        for i in range(nq):
            q[i] += h * b[n] * stages[2 * n, i]
        for j in range(nv):
            v[j] += h * b[n] * stages[2 * n + 1, j]
    normalise_all(rows, q)
    return total


@inlined
def semi_implicit(
    rows, const, drives, tables, work, space, gains, t, h, q, v, given, stages, ledger
):
    """v += h v', then q moved along the new v; order 1, symplectic for conservative trees."""
    nv = v.shape[0]
    vdot = stages[0, :nv]
    tau = space[4][2, :nv]
    put_in, dissipated, iterations = acceleration(
        rows, const, drives, tables, work, space, gains, t, q, v, given, tau, vdot
    )
    for j in range(nv):
        v[j] += h * vdot[j]
    ledger[at.WORK_DONE] += h * put_in
    ledger[at.DISSIPATED] += h * dissipated
    advance(rows, q, v, h)
    return iterations


@inlined
def finish(rows, const, tables, work, space, stabilised, q, v, counters):
    """What ends a step: still finite, and moved back onto the constraints; a status code."""
    if not finite(v):
        return at.NOT_FINITE
    if stabilised and tables[2].shape[0] > 0:
        rounds = project(rows, const, tables, work, space[:4], q, v, STEP_ROUNDS)
        counters[at.N_PROJECT] += abs(rounds)
        if not finite(v):
            return at.NOT_FINITE
        if rounds < 0:
            return at.NOT_CONVERGED
    return at.DONE


@inlined
def record(rows, const, drives, tables, work, space, gains, t, q, v, given, ledger, i, out):
    """Frame i of the result: state, v', multipliers, energies, ledger, constraint residuals."""
    qs, vs, vdots, lams, energies, drifts = out
    nv = v.shape[0]
    acceleration(
        rows,
        const,
        drives,
        tables,
        work,
        space,
        gains,
        t,
        q,
        v,
        given,
        space[4][2, :nv],
        vdots[i],
    )
    for n in range(q.shape[0]):
        qs[i, n] = q[n]
    for n in range(nv):
        vs[i, n] = v[n]
    m = 3 * tables[2].shape[0]
    vectors = space[3]
    for r in range(m):
        lams[i, r] = vectors[LAMBDA, r]
    if m > 0:
        positions(rows, work)
        residual(tables[0], tables[1], tables[2], work, vectors[CHANGE])
        drifts[i, 0] = largest(vectors[CHANGE], m)
        residual_velocity(rows, const, tables[0], tables[1], tables[2], work, v, vectors[CHANGE])
        drifts[i, 1] = largest(vectors[CHANGE], m)
    kinetic, potential = kinetic_and_potential(rows, const, work, v)
    energies[i, 0] = kinetic
    energies[i, 1] = potential + elastic(drives, q)
    energies[i, 2] = ledger[at.WORK_DONE]
    energies[i, 3] = ledger[at.DISSIPATED]


@kernel(
    f"i8({TREE},{DRIVES},{TABLES},f8[:,::1],{SPACE},{F1},Tuple((f8[:,::1],{F1},{F1})),"
    f"Tuple(({F1},i8[::1],{F1})),i8[::1],i8,b1,{F1},{F1},{F1},f8[:,::1],{F1},i8[::1],{F1},"
    "UniTuple(f8[:,::1],6))",
    nogil=True,
)
def run(
    rows, const, drives, tables, work, space, gains, tableau, schedule, cursor, budget,
    stabilised, q, v, given, stages, ledger, counters, failure, out,
):  # fmt: skip
    """At most `budget` steps and frames on from `cursor`; a status code, RUNNING if not over.

    Frame 0 is the state as given. Where a step fails, the state before it becomes the last
    frame, and `failure` gets its time and the row that moved fastest.
    """
    times, substeps, width = schedule
    for _ in range(budget):
        i = cursor[at.FRAME]
        if i == times.shape[0]:
            return at.DONE
        taken = cursor[at.TAKEN]
        if i == 0 or taken == substeps[i - 1]:
            record(
                rows, const, drives, tables, work, space, gains, times[i], q, v, given, ledger,
                i, out,
            )  # fmt: skip
            if not recorded(out, i):
                fail(rows, times[i], v, failure)
                return at.NOT_FINITE
            cursor[at.FRAME] = i + 1
            cursor[at.TAKEN] = 0
            continue
        h = width[i - 1]
        t = times[i - 1] + taken * h
        keep(space, q, v)
        if tableau[1].shape[0] == 0:
            iterations = semi_implicit(
                rows, const, drives, tables, work, space, gains, t, h, q, v, given, stages, ledger
            )
            counters[at.N_EVAL] += 1
        else:
            iterations = runge_kutta(
                rows, const, drives, tables, work, space, gains, tableau, t, h, q, v, given,
                stages, ledger,
            )  # fmt: skip
            counters[at.N_EVAL] += tableau[1].shape[0]
        counters[at.N_STEP] += 1
        counters[at.N_ITERATE] += iterations
        code = finish(rows, const, tables, work, space, stabilised, q, v, counters)
        if code != at.DONE:
            restore(space, q, v)
            fail(rows, t, v, failure)
            if taken > 0:
                times[i] = t
                record(
                    rows, const, drives, tables, work, space, gains, t, q, v, given, ledger, i, out
                )
                cursor[at.FRAME] = i + recorded(out, i)
            return code
        cursor[at.TAKEN] = taken + 1
    return at.DONE if cursor[at.FRAME] == times.shape[0] else at.RUNNING


@part
def keep(space, q, v):
    """The state before a step, for its stages and for the case that it fails."""
    for i in range(q.shape[0]):
        space[4][0, i] = q[i]
    for j in range(v.shape[0]):
        space[4][1, j] = v[j]


@part
def restore(space, q, v):
    """Back to the state before the step."""
    for i in range(q.shape[0]):
        q[i] = space[4][0, i]
    for j in range(v.shape[0]):
        v[j] = space[4][1, j]


@part
def recorded(out, i):
    """Whether frame i holds finite accelerations and energies."""
    return finite(out[2][i]) and finite(out[4][i])


@part
def fail(rows, t, v, failure):
    failure[0] = t
    failure[1] = fastest_row(rows, v)


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


@kernel(f"i8({TREE},{DRIVES},{TABLES},f8[:,::1],{SPACE},{F1},f8,{F1},{F1},{F1},{F1})")
def constrained_dynamics(rows, const, drives, tables, work, space, gains, t, q, v, given, vdot):
    """v' and, in `vectors`, λ at one state: 0, or -1 where not finite, or the singular row."""
    nv = v.shape[0]
    acceleration(
        rows, const, drives, tables, work, space, gains, t, q, v, given, space[4][2, :nv], vdot
    )
    singular = singular_row(rows, work)
    if singular > 0:
        return singular
    return 0 if finite(vdot) else -1


@kernel(f"i8({TREE},{TABLES},f8[:,::1],{SPACE},{F1},{F1},i8)")
def assemble(rows, const, tables, work, space, q, v, rounds):
    """Move q and v onto the active constraints; rounds taken, or -1."""
    return project(rows, const, tables, work, space[:4], q, v, rounds)


@kernel(f"void({DRIVES},f8,{F1},{F1},{F1},{F1})")
def drive_torque(drives, t, q, v, given, tau):
    """τ of springs, dampers, motors and servos added to the given torques."""
    drive(drives, t, q, v, given, tau)


@kernel(f"UniTuple(f8,2)({TREE},{DRIVES},{F1},{F1},f8[:,::1])")
def energy(rows, const, drives, q, v, work):
    """(kinetic, potential) energy, springs included [J]."""
    outboard(rows, const, work, q, v)
    kinetic, potential = kinetic_and_potential(rows, const, work, v)
    return kinetic, potential + elastic(drives, q)


COMMON = f"{TREE},{DRIVES},{TABLES},f8[:,::1],{SPACE},{F1}"


@kernel(f"UniTuple(f8,2)({COMMON},f8,{F1},{F1},{F1},{F1},{F1})")
def evaluate(rows, const, drives, tables, work, space, gains, t, q, v, given, qdot, vdot):
    """(q', v') at one state; (power put in, power dissipated)."""
    tau = space[4][2, : v.shape[0]]
    put_in, dissipated, _ = acceleration(
        rows, const, drives, tables, work, space, gains, t, q, v, given, tau, vdot
    )
    rate(rows, q, v, qdot)
    return put_in, dissipated


@kernel(f"void({COMMON},f8,{F1},{F1},{F1},{F1},i8,UniTuple(f8[:,::1],6))")
def record_frame(rows, const, drives, tables, work, space, gains, t, q, v, given, ledger, i, out):
    """Frame i of the result, for stepping from Python."""
    record(rows, const, drives, tables, work, space, gains, t, q, v, given, ledger, i, out)


@kernel(f"i8({TREE},{TABLES},f8[:,::1],{SPACE},b1,{F1},{F1},i8[::1])")
def settle(rows, const, tables, work, space, stabilised, q, v, counters):
    """What ends a step, for stepping from Python."""
    normalise_all(rows, q)
    return finish(rows, const, tables, work, space, stabilised, q, v, counters)


@kernel(f"void(i8[:,::1],{F1},{F1},f8)")
def move(rows, q, v, h):
    """q moved along v for the time h."""
    advance(rows, q, v, h)
