"""Many instances at once: the kernels of one instance, compiled for lanes.

Instances stand in blocks of W lanes; arrays are (blocks, ..., W). `const` is (n + 1, columns) for
instances that share their parameters, or (blocks, n + 1, columns, W).
"""

import math

from .. import layout as at
from ..arrays import Loads
from ..compiler.jit import kernel, sweep
from ..compiler.lane import constants, lanes
from ..forces import drive, torque_of_loads
from ..tree.dynamics import newton_euler
from ..tree.kinematics import outboard
from ..tree.moving import normalise_all
from .explicit import derivative, moving, runge_kutta_step, semi_implicit_step, slope
from .state import copied


@kernel(None, nogil=True)
def forward_dynamics(rows, const, drives, loads, t, q, v, given, work, tau, vdot, begin, end):
    """v' at time t of blocks `begin` to `end` - 1, eq. (26), with all forces."""
    w = lanes(work)
    s = lanes(tau)
    for i in range(begin, end):
        c = constants(const, i)
        x = lanes(q[i])
        y = lanes(v[i])
        derivative(rows, c, drives, loads, w, t, x, y, lanes(given[i]), s, lanes(vdot[i]))


@kernel(None, nogil=True)
def inverse_dynamics(rows, const, drives, loads, q, v, vdot, work, passive, none, tau, begin, end):
    """τ of blocks `begin` to `end` - 1, eq. (24), without the part of springs and dampers."""
    w = lanes(work)
    s = lanes(passive)
    for i in range(begin, end):
        c = constants(const, i)
        out = lanes(tau[i])
        outboard(rows, c, w, lanes(q[i]), lanes(v[i]))
        newton_euler(rows, c, lanes(v[i]), lanes(vdot[i]), w, out)
        drive(drives, 0.0, lanes(q[i]), lanes(v[i]), lanes(none), s)
        for j in range(out.shape[0]):
            out[j] -= s[j]
        if loads is not None:
            outboard(rows, c, w, lanes(q[i]), lanes(v[i]))
            linear = w[:, at.VELOCITY : at.VELOCITY + 3]
            moving(rows, c, w, lanes(v[i]), linear)
            torque_of_loads(rows, c, Loads(loads[0], loads[1]), w, linear, s)
            for j in range(out.shape[0]):
                out[j] -= s[j]


@kernel(None, nogil=True)
def run(
    rows, const, drives, loads, tableau, t, h, number, q, v, ledger, given, work, stages,
    begin, end,
):  # fmt: skip
    """`number` steps of width h from time t, of blocks `begin` to `end` - 1.

    `ledger` (blocks, 2, W) adds up the work put in and what is dissipated [J]; (blocks, 0, W) where
    nobody asks.
    """
    w = lanes(work)
    s = lanes(stages)
    nq, nv = q.shape[1], v.shape[1]
    for block in range(begin, end):
        trees = (rows, constants(const, block), drives, loads, w, lanes(given[block]))
        parts = (lanes(q[block]), lanes(v[block]), lanes(ledger[block]))
        state = s[at.Y]
        first = 0
        for part in parts:
            for j in range(part.shape[0]):
                state[first + j] = part[j]
            first += part.shape[0]
        for n in range(number):
            step(trees, tableau, (nq, nv), t + n * h, h, s)
        first = 0
        for part in parts:
            for j in range(part.shape[0]):
                part[j] = state[first + j]
            first += part.shape[0]


@sweep
def step(trees, tableau, size, t, h, stages):
    """One step of all lanes of a block."""
    rows = trees[0]
    slope(None, trees, size, t, at.Y, at.SLOPE, stages)
    if tableau[1].shape[0] == 0:
        semi_implicit_step(rows, size, h, stages)
    else:
        runge_kutta_step(None, trees, rows, tableau, size, t, h, math.inf, stages, False)
    copied(stages, at.CANDIDATE, at.Y, stages.shape[1])
    normalise_all(rows, stages[at.Y, : size[0]])
