"""Derivatives of forward dynamics, by central differences over lanes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .kernels import step as kernels
from .system import Array

if TYPE_CHECKING:
    from .mechanism import Mechanism

STEP = 6e-6  # cube root of machine epsilon: where truncation and rounding balance


def forward_derivatives(
    mech: Mechanism, q: Array, v: Array, tau: Array
) -> tuple[Array, Array, Array]:
    """∂v'/∂q and ∂v'/∂v from one batch of 4 nv states, and ∂v'/∂τ = M⁻¹."""
    n = mech.nv
    steps = STEP * np.concatenate((np.ones(n), np.maximum(1.0, np.abs(v))))
    qs, vs = np.repeat(q[None], 4 * n, axis=0), np.repeat(v[None], 4 * n, axis=0)
    for j in range(n):
        for row, sign in ((2 * j, 1.0), (2 * j + 1, -1.0)):
            along = np.zeros(n)
            along[j] = sign * steps[j]
            kernels.move(mech.system.rows, qs[row], along, 1.0)
            vs[2 * n + row, j] += sign * steps[n + j]
    vdot = mech.batch(4 * n).forward_dynamics(qs, vs, np.repeat(tau[None], 4 * n, axis=0))
    slope = (vdot[0::2] - vdot[1::2]) / (2 * steps[:, None])
    by_tau = np.asarray(np.linalg.inv(mech.mass_matrix(q)), dtype=np.float64)
    return slope[:n].T, slope[n:].T, by_tau
