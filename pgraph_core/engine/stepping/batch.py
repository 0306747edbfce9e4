"""Many instances, either in lanes with single-instance kernels or one after another.

In lanes, instances are in blocks of W, with arrays (blocks, ..., W). `const` is (n + 1, columns)
for instances that share their parameters, or (blocks, n + 1, columns, W).
"""

import math

from .. import layout as at
from ..arrays import DRIVES, LOADS, opened_run
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, F3, I1, I2, f8, group, i8, none, plain, void
from ..compiler.lane import constants, lanes
from ..drives import drive
from ..loads import RIDERS, torque_of_loads
from ..riders import move_riders, place_riders
from ..tree.dynamics import newton_euler
from ..tree.kinematics import outboard
from ..tree.moving import normalise_all
from .explicit import derivative, moving, runge_kutta_step, semi_implicit_step, slope
from .state import copied

# rows, constants that all share or of each, drives, loads where there are any
ACTS = [
    (I2, const, plain(DRIVES), loads)
    for const in (F2, f8[:, :, :, ::1])
    for loads in (none, plain(LOADS))
]
TABLEAU = group(F2, F1, F1)


@kernel(*[void(*acts, f8, *[F3] * 4, F2, F3, i8, i8) for acts in ACTS], nogil=True, lanes=True)
def forward_in_lanes(rows, const, drives, loads, t, q, v, given, work, tau, vdot, begin, end):
    """Compute v' at time t for blocks `begin` to `end` - 1, eq. (26), with all forces."""
    w = lanes(work)
    s = lanes(tau)
    for i in range(begin, end):
        c = constants(const, i)
        x = lanes(q[i])
        y = lanes(v[i])
        derivative(rows, c, drives, loads, w, t, x, y, lanes(given[i]), s, lanes(vdot[i]))


@kernel(*[void(*acts, *[F3] * 4, F2, F2, F3, i8, i8) for acts in ACTS], nogil=True, lanes=True)
def inverse_in_lanes(rows, const, drives, loads, q, v, vdot, work, passive, none, tau, begin, end):
    """Compute τ of blocks `begin` to `end` - 1, eq. (24), without springs and dampers."""
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
            place_riders(loads[RIDERS], w, lanes(q[i]))
            move_riders(loads[RIDERS], w, linear, lanes(q[i]), lanes(v[i]))
            torque_of_loads(rows, c, loads, w, linear, lanes(q[i]), s)
            for j in range(out.shape[0]):
                out[j] -= s[j]


@kernel(
    *[void(*acts, TABLEAU, f8, f8, i8, *[F3] * 6, i8, i8) for acts in ACTS], nogil=True, lanes=True
)
def run_in_lanes(
    rows, const, drives, loads, tableau, t, h, number, q, v, ledger, given, work, stages,
    begin, end,
):  # fmt: skip
    """Take `number` steps of size h from time t, for blocks `begin` to `end` - 1.

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
        for own in parts:
            for j in range(own.shape[0]):
                state[first + j] = own[j]
            first += own.shape[0]
        for n in range(number):
            step(trees, tableau, (nq, nv), t + n * h, h, s)
        first = 0
        for own in parts:
            for j in range(own.shape[0]):
                own[j] = state[first + j]
            first += own.shape[0]


@sweep
def step(trees, tableau, size, t, h, stages):
    """Take one step for all lanes of a block."""
    rows = trees[0]
    slope(None, trees, size, t, at.Y, at.SLOPE, stages)
    if tableau[1].shape[0] == 0:
        semi_implicit_step(rows, size, h, stages)
    else:
        runge_kutta_step(None, trees, rows, tableau, size, t, h, math.inf, stages, False)
    copied(stages, at.CANDIDATE, at.Y, stages.shape[1])
    normalise_all(rows, stages[at.Y, : size[0]])


# -- one after the other in one run: each is a row of bytes, copied in, stepped, copied out --------
#
# A row is all that steps read before they write it, so that no result depends on what the run has
# stepped before. Kernels are called by address: nothing is compiled twice.

COPY = i8(i8, i8, i8)  # to, from, bytes: C's memmove
ADVANCE = i8(i8, i8)  # `advance_run`
call_copy = caller(COPY)
call_advance = caller(ADVANCE)


@kernel(void(i8, i8, i8, I2, I2, I2, I1, I1, i8, i8, i8), nogil=True)
def step_instances(run, advance, copy, own, numbers, tables, kind, codes, n, begin, end):
    """Take n steps of the RUNNING instances `begin` to `end` - 1 and update their codes.

    `own` and `numbers` are the spans of the rows of two tables: (address in the run, place in the
    row, bytes). `tables` has their addresses and the lengths of their rows [bytes]: states by
    instance, copied back after the steps, and numbers of the model by `kind`.
    """
    for i in range(begin, end):
        if codes[i] != at.RUNNING:
            continue
        row = tables[0, 0] + i * tables[0, 1]
        copy_in(copy, numbers, tables[1, 0] + kind[i] * tables[1, 1])
        copy_in(copy, own, row)
        control = opened_run(run).control[0]
        end = control.ends.taken + n  # near stiff contacts a step is taken in parts
        while codes[i] == at.RUNNING and control.ends.taken < end:
            codes[i] = call_advance(advance, (run, end - control.ends.taken))
        for k in range(own.shape[0]):
            call_copy(copy, (row + own[k, 1], own[k, 0], own[k, 2]))


@part
def copy_in(copy, spans, row):
    """Copy the spans of a row into the arrays of the run."""
    for k in range(spans.shape[0]):
        call_copy(copy, (spans[k, 0], row + spans[k, 1], spans[k, 2]))
