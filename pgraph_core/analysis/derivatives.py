"""Derivatives of forward dynamics, exact to rounding, from slopes of inverse dynamics.

∂v'/∂x = M⁻¹ (∂τ_passive/∂x - ∂τ/∂x), τ(q, v, v') of eq. (24) at the v' found. Of springs between
bodies, whose lengths are roots, the slopes in q are differences of sixth order.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..dynamics import Dynamics
from ..engine import layout as at
from ..engine import motion
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.records import CREEP
from ..engine.tree import slopes as kernels
from ..packing.system import Array, Drives


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
    by_q, by_v = torque_slopes(mech, q, v, mech.forward_dynamics(q, v, tau))
    spring, damper = drive_slopes(mech.packed.passive, q, v)
    by_q, by_v = np.diag(spring) - by_q, np.diag(damper) - by_v
    if len(mech.packed.passive_loads.table):
        axes = np.eye(mech.nv)
        swing = [mech._load_torque(q, v + e) - mech._load_torque(q, v - e) for e in axes]
        by_v = by_v + np.array(swing).T / 2  # these forces are linear in v
        by_q = by_q + differences(mech, q, lambda x: mech._load_torque(x, v))
    return by_q, by_v


def torque_slopes(mech: Dynamics, q: Array, v: Array, vdot: Array) -> tuple[Array, Array]:
    """∂τ/∂q and ∂τ/∂v (nv, nv) of τ(q, v, v') of eq. (24), without passive forces."""
    n, width = mech.nv, LANE_WIDTH
    slopes = np.zeros((2 * n, n))
    sizes = ((len(mech.packed.rows), at.WORK), (mech.nq,), (n,), (n,), (n,))
    space = tuple(np.zeros((*size, width)) for size in sizes)
    pending = np.zeros(width, np.int64), np.zeros(width)
    kernels.torque_slopes(*mech.packed.tree, q, v, vdot, space, *pending, slopes)
    return slopes[:n].T, slopes[n:].T


def drive_slopes(drives: Drives, q: Array, v: Array) -> tuple[Array, Array]:
    """(nv,) slopes of springs, servos and motors in q, and of dampers and friction in v.

    At t = 0; a drive at its limit has none.
    """
    spring, damper = np.zeros(len(v)), np.zeros(len(v))
    for one in drives.table:
        j, i = one["velocity"], one["coordinate"]
        creep = v[j] ** 2 + CREEP**2
        friction = one["friction"] * CREEP**2 / creep**1.5
        if np.isfinite(one["limit"]):
            target, torque = (_first(drives, one[key]) for key in ("first_target", "first_torque"))
            asked = torque + one["stiffness"] * ((target - q[i]) if i >= 0 else 0.0)
            if abs(asked - one["damping"] * v[j]) >= one["limit"]:
                continue
        damper[j] -= one["damping"] + friction
        spring[j] -= one["stiffness"] if i >= 0 else 0.0
    return spring, damper


def _first(drives: Drives, knot: int) -> float:
    return float(drives.knots[knot, 1])


STEPS = (1e-2, 1e-3, 1e-4)  # rad, m: a short spring bends within less than a long one
FOURTH, SIXTH = np.array([8.0, -1.0, 0.0]) / 12, np.array([45.0, -9.0, 1.0]) / 60


def differences(mech: Dynamics, q: Array, of: Callable[[Array], Array]) -> Array:
    """(k, nv) slopes in q of a function (k,) of it, within about 1e-11 of the largest."""
    return np.array([_slope(mech, q, of, e) for e in np.eye(mech.nv)]).T


def _slope(mech: Dynamics, q: Array, of: Callable[[Array], Array], e: Array) -> Array:
    """Slope along one freedom, by the step whose orders four and six agree best."""
    found: list[tuple[float, Array]] = []
    for h in STEPS:
        odd = [of(_moved(mech, q, e, n * h)) - of(_moved(mech, q, e, -n * h)) for n in (1, 2, 3)]
        fourth, sixth = FOURTH @ odd / h, SIXTH @ odd / h
        found.append((float(np.max(np.abs(sixth - fourth), initial=0.0)), sixth))
    return min(found, key=lambda pair: pair[0])[1]


def _moved(mech: Dynamics, q: Array, e: Array, distance: float) -> Array:
    moved = q.copy()
    motion.move(mech.packed.rows, moved, e, distance)
    return moved
