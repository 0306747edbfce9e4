"""Derivatives of forward dynamics, exact to rounding, from slopes of inverse dynamics.

∂v'/∂x = M⁻¹ (∂τ_passive/∂x - ∂τ/∂x), τ(q, v, v') of eq. (24) at the v' found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .kernels import layout as at
from .kernels import slopes as kernels
from .kernels.lane import LANE_WIDTH
from .system import Array

if TYPE_CHECKING:
    from .mechanism import Mechanism


def forward_derivatives(
    mech: Mechanism, q: Array, v: Array, tau: Array
) -> tuple[Array, Array, Array]:
    """∂v'/∂q, ∂v'/∂v and ∂v'/∂τ = M⁻¹, from at most 6 nv inverse dynamics in lanes."""
    n, width = mech.nv, LANE_WIDTH
    slopes = np.zeros((2 * n, n))
    vdot = mech.forward_dynamics(q, v, tau)
    sizes = ((len(mech.system.rows), at.WORK), (mech.nq,), (n,), (n,), (n,))
    space = tuple(np.zeros((*size, width)) for size in sizes)
    pending = np.zeros(width, np.int64), np.zeros(width)
    kernels.torque_slopes(*mech.tree, q, v, vdot, space, *pending, slopes)
    spring, damper = passive_slopes(mech, v)
    right = np.hstack((np.diag(spring) - slopes[:n].T, np.diag(damper) - slopes[n:].T, np.eye(n)))
    found: Array = np.linalg.solve(mech.mass_matrix(q), right).astype(np.float64, copy=False)
    return found[:, :n], found[:, n : 2 * n], found[:, 2 * n :]


def passive_slopes(mech: Mechanism, v: Array) -> tuple[Array, Array]:
    """(nv,) slopes of the joints' springs in q and of their dampers and friction in v."""
    spring, damper = np.zeros(mech.nv), np.zeros(mech.nv)
    for row in mech.passive[0]:
        j = int(row[at.DR_V])
        creep = v[j] ** 2 + at.CREEP**2
        damper[j] -= row[at.DR_KD] + row[at.DR_FRICTION] * at.CREEP**2 / creep**1.5
        spring[j] -= row[at.DR_KP] if row[at.DR_Q] >= 0 else 0.0
    return spring, damper
