"""Heights of bodies above the ground plane."""

import math

from ..compiler.jit import kernel
from ..compiler.kinds import F1, F2, I1, I2, f8, i8
from ..motion import opened
from ..rows import carrier_of, offset_of, origin_of, rotation_of
from ..vec import add, dot, mul
from .kinematics import outboard, positions


@kernel(f8(i8, I1, I2, F2, F1, F1), later=True)
def lowest(scene, bodies, bodies_i, bodies_f, normal, q):
    """Return the minimum height of the origins of these bodies at q [m]."""
    data = opened(scene)
    rows, work = data.rows, data.work
    outboard(rows, data.const, work, q, data.given)
    positions(rows, work)
    up = (normal[0], normal[1], normal[2])
    least = math.inf
    for n in range(bodies.shape[0]):
        k = carrier_of(bodies_i, bodies[n])
        origin = mul(rotation_of(work, k), offset_of(bodies_f, bodies[n]))
        least = min(least, dot(add(origin_of(work, k), origin), up))
    return least
