"""An attempt: a step of a method from Y into CANDIDATE, and its error over the tolerance.

It is called by address: the loop in `adaptive` knows no method. A state y is a row of
`stages`; see `layout`.
"""

from numba import from_dtype, types

from .. import layout as at
from ..compiler.address import caller
from ..compiler.jit import sweep
from ..motion import F1, F2, call_acceleration, opened
from ..records import COUNTERS, STEP_CONTROL
from ..tree.moving import rate

f8, i8 = types.float64, types.int64
C2 = types.complex128[:, ::1]
SIZE = types.UniTuple(i8, 2)  # nq, nv
TABLEAU = types.Tuple((F2, F1, F1, F2, F2))  # a, b, c, error, dense
CONTROL = types.Tuple((from_dtype(STEP_CONTROL), from_dtype(COUNTERS)))
MATRICES = types.Tuple((F2, C2))  # of implicit methods: four n by n, and one
# scene, accelerate, tableau, size, h, stages, control, matrices, flow
ATTEMPT = f8(i8, i8, TABLEAU, SIZE, f8, F2, CONTROL, MATRICES, F1)
call_attempt = caller(ATTEMPT)

EPS = 2.220446049250313e-16
NOT_SOLVED = -1.0  # returned if the equations of a step were not solved


@sweep
def copied(stages, a, b, n):
    """Row b becomes row a."""
    for i in range(n):
        stages[b, i] = stages[a, i]


@sweep
def slope(scene, accelerate, t, size, stages, row, out, flow, counters):
    """y' at the state in `row` into row `out`."""
    nq, nv = size
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    rate(opened(scene).rows, q, v, stages[out, :nq])
    tau = stages[at.TORQUE, :nv]
    call_acceleration(accelerate, (scene, t, q, v, tau, stages[out, nq : nq + nv], flow))
    stages[out, nq + nv] = flow[0]
    stages[out, nq + nv + 1] = flow[1]
    counters.evaluations += 1
    counters.solver_iterations += int(flow[2])
