"""Forward dynamics under constraints by dense algebra, eqs. (27)-(29) made rank-safe."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.linalg import solve

from pgraph_core.model import Constraint
from pgraph_core.paper import Operators
from pgraph_core.rotation import Array

from .constraint_rows import Rows, radius_of_gyration, rows_of

RANK = 1e-10  # relative size below which a singular value of Ω counts as zero


def constrained_dynamics(
    op: Operators, tau: Array | None = None, active: Iterable[str] | None = None, t: float = 0.0
) -> tuple[Array, dict[str, Array]]:
    """θ'' and the force [torque, force] on each constraint's body at its point, world axes.

    Ω λ = -(J M⁻¹(τ - C) + J'θ'), eq. (29) with λ = -F_T (R10), by the pseudo-inverse: redundant
    rows make Ω singular (R12), and of all λ the one of least norm is taken.
    """
    held = active_constraints(op, active)
    J, drift = constraint_rows(op, held, t)
    free = op.forward_dynamics(tau)
    omega = delassus(op, J)
    lam = -np.linalg.pinv(omega, rcond=RANK, hermitian=True) @ (J @ free + drift)
    vdot = free + solve(op.mass_matrix, J.T @ lam, assume_a="pos")
    forces, start = {}, 0
    for c, rows in zip(held, _rows(op, held, t)):
        forces[c.name] = lam[start : start + len(rows.J)] @ rows.wrench
        start += len(rows.J)
    return vdot, forces


def delassus(op: Operators, J: Array) -> Array:
    """Ω = J M⁻¹ Jᵀ, eq. (29)."""
    return J @ solve(op.mass_matrix, J.T, assume_a="pos")


def active_constraints(op: Operators, active: Iterable[str] | None = None) -> list[Constraint]:
    """The named constraints, or those that the model calls active, in its order."""
    names = None if active is None else set(active)
    return [c for c in op.model.constraints if (c.active if names is None else c.name in names)]


def constraint_rows(
    op: Operators, held: Iterable[Constraint], t: float = 0.0
) -> tuple[Array, Array]:
    """Return J (m, nv) and J'θ' of constraints, for points the linear velocities (R11)."""
    rows = _rows(op, held, t)
    J = np.vstack([np.zeros((0, op.nv)), *(r.J for r in rows)])
    return J, np.concatenate([np.zeros(0), *(r.drift for r in rows)])


def _rows(op: Operators, held: Iterable[Constraint], t: float) -> list[Rows]:
    length = radius_of_gyration(op)
    return [rows_of(op, c, length, t) for c in held]
