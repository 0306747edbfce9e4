"""Forward dynamics of a tree by mpmath at 50 digits: the oracle of test_precision.

Nothing is shared with the kernels: spatial vectors are taken at the world's origin, so no link is
propagated ([Featherstone 2008, sec. 7.3] in absolute coordinates); the 8 digits that a body far
away costs are there to spend. `inverse_dynamics` checks the result by Newton-Euler.
"""

from typing import NamedTuple

import mpmath
import numpy as np

from pgraph_core import joints
from pgraph_core.paper import bodies_of
from pgraph_core.topology import Topology

mp = mpmath.mp.clone()
mp.dps = 50


class Row(NamedTuple):
    """One motion of a joint. The last one of a body carries its inertia."""

    parent: int  # row, -1 for the ground
    S: np.ndarray  # (6, m) axes of motion at the world's origin
    v: list[int]
    armature: float
    inertia: np.ndarray  # (6, 6) at the world's origin
    V: np.ndarray  # (6,) velocity
    c: np.ndarray  # (6,) V_parent × S v


def exact(x):
    """Return an array of mpmath numbers equal to the given doubles, keeping mpmath numbers."""
    x = np.asarray(x)
    return x if x.dtype == object else np.vectorize(mp.mpf, otypes=[object])(x.astype(float))


def skew(x):
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]], dtype=object)


def cross_motion(V):
    """Return V × (6, 6), whose negated transpose acts on forces."""
    w, v = skew(V[:3]), skew(V[3:])
    return np.block([[w, np.zeros((3, 3), object)], [v, w]])


def matrix(q):
    """(3, 3) of a quaternion, brought to length one at 50 digits."""
    w, x, y, z = q / mp.sqrt(sum(q * q))
    h = skew((x, y, z))
    return np.eye(3, dtype=object) + 2 * w * h + 2 * h @ h


def about(h, angle):
    k = skew(h)
    return np.eye(3, dtype=object) + mp.sin(angle) * k + (1 - mp.cos(angle)) * (k @ k)


def spatial_inertia(body, R, p):
    """(6, 6) at the world's origin of a body at p."""
    m, c = mp.mpf(body.mass), skew(p + R @ exact(body.com))
    central = R @ exact(body.inertia) @ R.T
    return np.block([[central - m * c @ c, m * c], [-m * c, m * np.eye(3, dtype=object)]])


def rows_of(model, q, v):
    """Return every motion in a state, in number order."""
    topology = Topology.of(model)
    q, v = exact(q), exact(v)
    rows: list[Row] = []
    last = [(-1, np.eye(3, dtype=object), exact(np.zeros(3)))]
    i = j = 0
    for body, parent in zip(bodies_of(model, topology), topology.parent):
        at, R, p = last[parent]
        home = matrix(exact(body.rotation))
        p = p + R @ exact(body.link)
        for motion, armature in zip(body.sequence, body.armature):
            nq, nv = joints.SIZE[motion.kind]
            x, index = q[i : i + nq], list(range(j, j + nv))
            i, j = i + nq, j + nv
            h = home @ exact(motion.axis)
            h = h / mp.sqrt(sum(h * h))
            if motion.kind == "free":  # three slides, then a ball
                p = p + R @ x[:3]
                rows.append(_row(rows, at, _slides(R), index[3:], armature, v))
                at = len(rows) - 1
            if motion.kind in ("ball", "free"):
                rows.append(_row(rows, at, _turns(R, p), index[:3], armature, v))
                R = R @ matrix(x[-4:])
            elif motion.kind == "rotate":
                rows.append(_row(rows, at, _turns((R @ h)[:, None], p), index, armature, v))
                R = R @ about(h, x[0])
            else:
                rows.append(_row(rows, at, _slides((R @ h)[:, None]), index, armature, v))
                p = p + R @ h * x[0]
            at = len(rows) - 1
        R = R @ home
        last.append((at, R, p))
        if at >= 0:  # a weld's inertia joins the row that carries it
            inertia = rows[at].inertia + spatial_inertia(body, R, p)
            rows[at] = rows[at]._replace(inertia=inertia)
    return rows


def _turns(axes, p):
    return np.vstack((axes, skew(p) @ axes))


def _slides(axes):
    return np.vstack((0 * axes, axes))


def _row(rows, parent, S, index, armature, v):
    V = rows[parent].V if parent >= 0 else exact(np.zeros(6))
    relative = S @ v[index]
    none = exact(np.zeros((6, 6)))
    return Row(parent, S, index, armature, none, V + relative, cross_motion(V) @ relative)


def forward_dynamics(model, q, v, tau):
    """(nv,) θ'' as mpmath's numbers, by articulated bodies."""
    rows, tau = rows_of(model, q, v), exact(tau)
    inertia = [row.inertia for row in rows]
    force = [-cross_motion(row.V).T @ (row.inertia @ row.V) for row in rows]
    factors: list = [None] * len(rows)
    for k in range(len(rows) - 1, -1, -1):
        row = rows[k]
        U = inertia[k] @ row.S
        D = row.S.T @ U + mp.mpf(row.armature) * np.eye(len(row.v), dtype=object)
        u = tau[row.v] - row.S.T @ force[k]
        inverse = np.array(mp.inverse(mp.matrix(D.tolist())).tolist(), dtype=object)
        factors[k] = (U, inverse, u)
        if row.parent >= 0:
            left = inertia[k] - U @ inverse @ U.T
            inertia[row.parent] = inertia[row.parent] + left
            passed = force[k] + left @ row.c + U @ (inverse @ u)
            force[row.parent] = force[row.parent] + passed
    vdot, A = exact(np.zeros(len(v))), []
    for row, (U, inverse, u) in zip(rows, factors):
        a = (A[row.parent] if row.parent >= 0 else _base(model)) + row.c
        vdot[row.v] = inverse @ (u - U.T @ a)
        A.append(a + row.S @ vdot[row.v])
    return vdot


def _base(model):
    return np.concatenate((exact(np.zeros(3)), -exact(model.gravity)))


def inverse_dynamics(model, q, v, vdot):
    """(nv,) τ by Newton-Euler."""
    rows, tau, A = rows_of(model, q, v), exact(np.zeros(len(v))), []
    for row in rows:
        a = A[row.parent] if row.parent >= 0 else _base(model)
        A.append(a + row.c + row.S @ vdot[row.v])
    force = [
        row.inertia @ a - cross_motion(row.V).T @ (row.inertia @ row.V) for row, a in zip(rows, A)
    ]
    for k in range(len(rows) - 1, -1, -1):
        row = rows[k]
        tau[row.v] = row.S.T @ force[k] + mp.mpf(row.armature) * vdot[row.v]
        if row.parent >= 0:
            force[row.parent] = force[row.parent] + force[k]
    return tau
