"""Many instances at once: the kernels of one instance, compiled for lanes.

Instances stand in blocks of W lanes; arrays are (blocks, ..., W). `const` is (n + 1, columns) for
instances that share their parameters, or (blocks, n + 1, columns, W).
"""

from .. import layout as at
from ..compiler.jit import kernel, sweep
from ..compiler.lane import constants, lanes
from ..constraints.blocks import velocities
from ..forces import apply_loads, drive, torque_of_loads
from ..tree.articulated import articulated, inboard, joint_acceleration
from ..tree.dynamics import newton_euler
from ..tree.kinematics import outboard, positions
from ..tree.moving import advance, normalise_all, rate


@sweep
def derivative(rows, const, drives, loads, work, t, q, v, given, tau, vdot):
    """v' of the driven tree; `loads` is None where there are none."""
    drive(drives, t, q, v, given, tau)
    if loads is None:
        articulated(rows, const, q, v, tau, work, vdot)
    else:
        outboard(rows, const, work, q, v)
        linear = work[:, at.U : at.U + 3]
        moving(rows, const, work, v, linear)
        apply_loads(loads, work, linear, t)
        inboard(rows, const, work, tau)
        joint_acceleration(rows, const, work, vdot)


@sweep
def moving(rows, const, work, v, linear):
    """Places of all origins into X, their velocities into `linear`: U, until `inboard` fills it."""
    positions(rows, work)
    velocities(rows, const, work, v, linear)


@kernel(None, nogil=True)
def forward_dynamics(rows, const, drives, loads, q, v, given, work, tau, vdot, begin, end):
    """v' of blocks `begin` to `end` - 1, eq. (26), springs and dampers included."""
    w = lanes(work)
    t = lanes(tau)
    for i in range(begin, end):
        c = constants(const, i)
        x = lanes(q[i])
        y = lanes(v[i])
        derivative(rows, c, drives, loads, w, 0.0, x, y, lanes(given[i]), t, lanes(vdot[i]))


@kernel(None, nogil=True)
def inverse_dynamics(rows, const, drives, loads, q, v, vdot, work, passive, none, tau, begin, end):
    """τ of blocks `begin` to `end` - 1, eq. (24), beside springs and dampers."""
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
            linear = w[:, at.U : at.U + 3]
            moving(rows, c, w, lanes(v[i]), linear)
            torque_of_loads(rows, c, loads, w, linear, s)
            for j in range(out.shape[0]):
                out[j] -= s[j]


@sweep
def semi_implicit(rows, const, drives, loads, work, t, h, q, v, given, stages):
    """v += h v', then q moved along the new v."""
    derivative(rows, const, drives, loads, work, t, q, v, given, stages[0], stages[1])
    for j in range(v.shape[0]):
        v[j] += h * stages[1, j]
    advance(rows, q, v, h)


@sweep
def runge_kutta(rows, const, drives, loads, work, tableau, t, h, q, v, given, stages):
    """One explicit Runge-Kutta step of (q, v); `stages` rows: τ, q0, v0, then q', v' in turn."""
    a, b, c = tableau
    for i in range(q.shape[0]):
        stages[1, i] = q[i]
    for j in range(v.shape[0]):
        stages[2, j] = v[j]
    for n in range(b.shape[0]):
        for r in range(n):
            if a[n, r] != 0.0:
                for i in range(q.shape[0]):
                    q[i] += h * a[n, r] * stages[3 + 2 * r, i]
                for j in range(v.shape[0]):
                    v[j] += h * a[n, r] * stages[4 + 2 * r, j]
        rate(rows, q, v, stages[3 + 2 * n])
        vdot = stages[4 + 2 * n]
        derivative(rows, const, drives, loads, work, t + c[n] * h, q, v, given, stages[0], vdot)
        for i in range(q.shape[0]):
            q[i] = stages[1, i]
        for j in range(v.shape[0]):
            v[j] = stages[2, j]
    for n in range(b.shape[0]):
        for i in range(q.shape[0]):
            q[i] += h * b[n] * stages[3 + 2 * n, i]
        for j in range(v.shape[0]):
            v[j] += h * b[n] * stages[4 + 2 * n, j]
    normalise_all(rows, q)


@kernel(None, nogil=True)
def run(
    rows, const, drives, loads, tableau, times, substeps, width, q, v, given, work, stages, out,
    first, last, begin, end,
):  # fmt: skip
    """Frames `first` to `last` - 1 of blocks `begin` to `end` - 1; frame 0 is the given state."""
    qs, vs = out
    w = lanes(work)
    s = lanes(stages)
    for block in range(begin, end):
        c = constants(const, block)
        x = lanes(q[block])
        y = lanes(v[block])
        g = lanes(given[block])
        frames_q = lanes(qs[block])
        frames_v = lanes(vs[block])
        for i in range(first, last):
            if i > 0:
                h = width[i - 1]
                for n in range(substeps[i - 1]):
                    t = times[i - 1] + n * h
                    if tableau[1].shape[0] == 0:
                        semi_implicit(rows, c, drives, loads, w, t, h, x, y, g, s)
                    else:
                        runge_kutta(rows, c, drives, loads, w, tableau, t, h, x, y, g, s)
            for j in range(x.shape[0]):
                frames_q[i, j] = x[j]
            for j in range(y.shape[0]):
                frames_v[i, j] = y[j]
