"""The fastest rate in a scene, which limits the step size of explicit methods."""

import math

from ...tolerances import NOTABLE, VISIBLE
from ..compiler.jit import kernel, sweep
from ..compiler.kinds import F1, F2, f8, group, i8
from ..motion import call_acceleration, opened
from ..records import columns
from ..tree.moving import advance

POWER_ROUNDS = 20

# rows of `stages`: the state, along which it is moved, the moved state, τ, v' of both
POWER = columns("state", "along", "moved", "torque", "here", "there")


@sweep
def apply_slope(scene, accelerate, size, stages, flow):
    """Replace (ξ, w) in POWER.along with its image under ∂(v, v')/∂(q, v)."""
    nq, nv = size
    xi = stages[POWER.along, :nv]
    w = stages[POWER.along, nv : 2 * nv]
    largest = 0.0
    for j in range(nv):
        largest = max(largest, abs(xi[j]))
    if not largest > 0.0:
        largest = 1.0
    h = NOTABLE / largest
    q = stages[POWER.moved, :nq]
    v = stages[POWER.moved, nq : nq + nv]
    for i in range(nq + nv):
        stages[POWER.moved, i] = stages[POWER.state, i]
    advance(opened(scene).rows, q, xi, h)
    for j in range(nv):
        v[j] += h * w[j]
    there = stages[POWER.there, :nv]
    call_acceleration(accelerate, (scene, 0.0, q, v, stages[POWER.torque, :nv], there, flow))
    for j in range(nv):
        xi[j] = w[j]
        w[j] = (there[j] - stages[POWER.here, j]) / h


@kernel(f8(i8, i8, group(*[i8] * 2), F2, F1), nogil=True)
def fastest_rate(scene, accelerate, size, stages, flow):
    """Estimate the largest |eigenvalue| of the motion about the state in the first row [1/s],
    within about 10 %.

    By power iteration on the square of the slope, which is real for oscillations too.
    """
    nq, nv = size
    q, v = stages[POWER.state, :nq], stages[POWER.state, nq : nq + nv]
    here = stages[POWER.here, :nv]
    call_acceleration(accelerate, (scene, 0.0, q, v, stages[POWER.torque, :nv], here, flow))
    for j in range(nv):
        stages[POWER.along, j] = 1.0 + 0.1 * ((7 * j) % 11) * (1 - 2 * (j % 2))
        stages[POWER.along, nv + j] = stages[POWER.along, j]  # or dampers alone would not be seen
    rate = 0.0
    most = 0.0
    for n in range(POWER_ROUNDS):
        if n > 0:
            apply_slope(scene, accelerate, size, stages, flow)
            apply_slope(scene, accelerate, size, stages, flow)
        length = 0.0
        for j in range(nv):
            length += stages[POWER.along, j] ** 2
        length = math.sqrt(length)
        if not (length > 0.0 and length < math.inf):
            return rate
        found = math.sqrt(length) if n > 0 else 0.0  # growth of a vector of length one
        most = max(most, found)
        if found < NOTABLE * most:  # within the error of differences
            return found
        for j in range(2 * nv):
            stages[POWER.along, j] /= length
        if n > 3 and abs(found - rate) < VISIBLE * rate:
            return found
        rate = found
    return rate
