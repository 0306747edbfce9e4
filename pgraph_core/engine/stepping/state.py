"""The state of a run and its derivative, for all methods.

A state y = (q, v, work done, dissipation) is a row of `stages`; `layout` names the rows. Kernels
receive the address of a run, which `opened_run` converts to named fields.
"""

import math

from .. import layout as at
from ..arrays import opened_run
from ..compiler.address import caller
from ..compiler.jit import part, sweep
from ..compiler.kinds import f8, i8
from ..motion import call_acceleration, call_projection, opened
from ..tree.moving import rate
from ..vec import finite

# run, h: a step of width h from Y into CANDIDATE; its error over the tolerance, 0 without one,
# infinite where the state is not finite, UNSOLVED where equations were not solved, NOT_MET where
# no velocities satisfy constraints, limits and contacts
STEP = f8(i8, f8)
call_step = caller(STEP)

UNSOLVED = -math.inf
NOT_MET = -1.0
STEP_ROUNDS = 10  # limit on projections per step, of which one usually suffices


@sweep
def copied(stages, a, b, n):
    """Copy row b to row a."""
    for i in range(n):
        stages[b, i] = stages[a, i]


@part
def size_of_state(run):
    """(nq, nv)."""
    control = opened_run(run).control[0]
    return control.nq, control.nv


@sweep
def acceleration_of(run, t, row, out):
    """Compute v' and the power at the state in `row` into row `out`."""
    data = opened_run(run)
    stages, flow, counters = data.stages, data.flow, data.counters[0]
    nq, nv = size_of_state(run)
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    vdot = stages[out, nq : nq + nv]
    tau = stages[at.TORQUE, :nv]
    call_acceleration(data.links.accelerate, (data.scene, t, q, v, tau, vdot, flow))
    stages[out, nq + nv] = flow[0]
    stages[out, nq + nv + 1] = flow[1]
    counters.evaluations += 1
    counters.solver_iterations += int(flow[2])


@sweep
def rate_of(rows, size, stages, row, out):
    """Compute q' at the state in `row` into row `out`."""
    nq, nv = size
    rate(rows, stages[row, :nq], stages[row, nq : nq + nv], stages[out, :nq])


@sweep
def onto_constraints(run, t, row):
    """Project the state in `row` onto the active constraints. Returns a status code."""
    data = opened_run(run)
    control, counters, stages = data.control[0], data.counters[0], data.stages
    if control.error.project == 0 or opened(data.scene).blocks.active[0] == 0:
        return at.DONE
    nq, nv = size_of_state(run)
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    rounds = call_projection(data.links.project, (data.scene, t, q, v, STEP_ROUNDS))
    counters.projections += abs(rounds)
    if not finite(v):
        return at.NOT_FINITE
    return at.NOT_CONVERGED if rounds < 0 else at.DONE
