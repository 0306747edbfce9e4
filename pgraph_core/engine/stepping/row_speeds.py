"""Speeds of constraint rows at both ends of a part of a step, with frames of its middle."""

from ..arrays import (
    BEFORE,
    MEAN,
    RHS,
    SPEEDS,
    TARGET,
    TURNED,
    ZERO,
)
from ..compiler.jit import sweep
from ..constraints.blocks import (
    locate,
    residual_velocity,
    turning_acceleration,
    velocities,
)
from ..motion import opened
from ..motions import add_motion
from ..rows import (
    parent_of,
    set_acceleration,
    set_spin,
    spin_of,
)
from ..tree.kinematics import accelerate as accelerate_rows


@sweep
def set_velocities(scene, t, end, h, q, v, vdot, m):
    """Write the speeds of the m active rows at t into BEFORE, and those with v + h v' at the time
    `end` into RHS, less the prescribed ones.

    The rows are those at q. They turn with the velocities MEAN, which the last evaluation of v'
    used.
    """
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors, linear = space.vectors, space.linear
    mean = vectors[MEAN, : v.shape[0]]
    locate(blocks, work, q, space.place)
    velocities(rows, const, work, mean, linear)
    turned(rows, const, blocks, work, space, h, mean, m)
    turn_rates(rows, const, work, v)
    velocities(rows, const, work, v, linear)
    residual_velocity(blocks, work, space, t, v, vectors[BEFORE])
    for j in range(v.shape[0]):
        vectors[SPEEDS, j] = v[j] + h * vdot[j]
    turn_rates(rows, const, work, vectors[SPEEDS])
    velocities(rows, const, work, vectors[SPEEDS], linear)
    residual_velocity(blocks, work, space, end, vectors[SPEEDS], vectors[RHS])
    for r in range(m):
        vectors[BEFORE, r] -= vectors[TURNED, r]
        vectors[RHS, r] += vectors[TURNED, r]


@sweep
def before_switch(scene, t, q, v, unswitched):
    """Write the speeds of the active rows before and after constraints were switched at t, from
    joint velocities `unswitched` and v, into TARGET and BEFORE."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors, linear = space.vectors, space.linear
    locate(blocks, work, q, space.place)
    turn_rates(rows, const, work, unswitched)
    velocities(rows, const, work, unswitched, linear)
    residual_velocity(blocks, work, space, t, unswitched, vectors[TARGET])
    turn_rates(rows, const, work, v)
    velocities(rows, const, work, v, linear)
    residual_velocity(blocks, work, space, t, v, vectors[BEFORE])
    turn_rates(rows, const, work, vectors[MEAN, : v.shape[0]])


@sweep
def turned(rows, const, blocks, work, space, h, v, m):
    """Write h/2 J' v of the m active rows into TURNED, after `outboard`, `positions` and
    `velocities`."""
    vectors = space.vectors
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for j in range(v.shape[0]):
        vectors[ZERO, j] = 0.0
    accelerate_rows(rows, const, work, v, vectors[ZERO])
    turning_acceleration(blocks, work, space, v, vectors[TURNED])
    for r in range(m):
        vectors[TURNED, r] *= 0.5 * h


@sweep
def turn_rates(rows, const, work, v):
    """Compute the angular velocities of all rows for other joint velocities, same frames."""
    for k in range(1, rows.shape[0]):
        w = spin_of(work, parent_of(rows, k))
        set_spin(work, k, add_motion(rows, work, k, const, v, w, w)[0])
