"""Derivatives of forward dynamics, exact to rounding, from slopes of inverse dynamics.

∂v'/∂x = M⁻¹ (∂τ_passive/∂x - ∂τ/∂x), τ(q, v, v') of eq. (24) at the v' found. Of springs between
bodies, whose lengths are roots, the slopes in q are differences of sixth order.
"""

from __future__ import annotations

import numpy as np

from ..dynamics import Dynamics
from ..engine import layout as at
from ..engine import motion
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.records import CREEP
from ..engine.tree import slopes as kernels
from ..packing.system import Array


def forward_derivatives(
    mech: Dynamics, q: Array, v: Array, tau: Array
) -> tuple[Array, Array, Array]:
    """∂v'/∂q, ∂v'/∂v and ∂v'/∂τ = M⁻¹, from at most 6 nv inverse dynamics in lanes."""
    n = mech.nv
    right = np.hstack((*force_slopes(mech, q, v, tau), np.eye(n)))
    found: Array = np.linalg.solve(mech.mass_matrix(q), right).astype(np.float64, copy=False)
    return found[:, :n], found[:, n : 2 * n], found[:, 2 * n :]


def force_slopes(mech: Dynamics, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    """M ∂v'/∂q and M ∂v'/∂v: at rest, minus the stiffness and damping of small motions."""
    n, width = mech.nv, LANE_WIDTH
    slopes = np.zeros((2 * n, n))
    vdot = mech.forward_dynamics(q, v, tau)
    sizes = ((len(mech.packed.rows), at.WORK), (mech.nq,), (n,), (n,), (n,))
    space = tuple(np.zeros((*size, width)) for size in sizes)
    pending = np.zeros(width, np.int64), np.zeros(width)
    kernels.torque_slopes(*mech.packed.tree, q, v, vdot, space, *pending, slopes)
    spring, damper = passive_slopes(mech, v)
    by_q, by_v = np.diag(spring) - slopes[:n].T, np.diag(damper) - slopes[n:].T
    if len(mech.packed.passive_loads.table):
        more_q, more_v = load_slopes(mech, q, v)
        by_q, by_v = by_q + more_q, by_v + more_v
    return by_q, by_v


def passive_slopes(mech: Dynamics, v: Array) -> tuple[Array, Array]:
    """(nv,) slopes of the joints' springs in q and of their dampers and friction in v."""
    spring, damper = np.zeros(mech.nv), np.zeros(mech.nv)
    for one in mech.packed.passive.table:
        j = one["velocity"]
        creep = v[j] ** 2 + CREEP**2
        damper[j] -= one["damping"] + one["friction"] * CREEP**2 / creep**1.5
        spring[j] -= one["stiffness"] if one["coordinate"] >= 0 else 0.0
    return spring, damper


STEPS = (1e-2, 1e-3, 1e-4)  # rad, m: a short spring bends within less than a long one
FOURTH, SIXTH = np.array([8.0, -1.0, 0.0]) / 12, np.array([45.0, -9.0, 1.0]) / 60


def load_slopes(mech: Dynamics, q: Array, v: Array) -> tuple[Array, Array]:
    """(nv, nv) slopes of the torques of springs between bodies in q, and in v.

    In q within about 1e-11 of the largest; in v, where these forces are linear, to rounding.
    """
    axes = np.eye(mech.nv)
    damping = [0.5 * (mech._load_torque(q, v + e) - mech._load_torque(q, v - e)) for e in axes]
    return np.array([_slope(mech, q, v, e) for e in axes]).T, np.array(damping).T


def _slope(mech: Dynamics, q: Array, v: Array, e: Array) -> Array:
    """(nv,) slope along one freedom, by the step whose orders four and six agree best."""
    found: list[tuple[float, Array]] = []
    for h in STEPS:
        odd = [_moved(mech, q, v, e, n * h) - _moved(mech, q, v, e, -n * h) for n in (1, 2, 3)]
        fourth, sixth = FOURTH @ odd / h, SIXTH @ odd / h
        found.append((float(np.max(np.abs(sixth - fourth))), sixth))
    return min(found, key=lambda pair: pair[0])[1]


def _moved(mech: Dynamics, q: Array, v: Array, e: Array, distance: float) -> Array:
    moved = q.copy()
    motion.move(mech.packed.rows, moved, e, distance)
    return mech._load_torque(moved, v)
