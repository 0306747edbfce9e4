"""Forward dynamics under point constraints by dense algebra, eqs. (27)-(29) made rank-safe."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.linalg import solve

from ..rotation import Array
from ..schema import Constraint
from .motion import home_poses
from .paper import Operators

RANK = 1e-10  # relative size below which a singular value of Ω counts as zero


def constrained_dynamics(
    op: Operators, tau: Array | None = None, active: Iterable[str] | None = None
) -> tuple[Array, dict[str, Array]]:
    """θ'' and the force [torque, force] on each constraint's body at its point, world axes.

    Ω λ = -(J M⁻¹(τ - C) + J'θ'), eq. (29) with λ = -F_T (R10), by the pseudo-inverse: redundant
    rows make Ω singular (R12), and of all λ the one of least norm is taken.
    """
    held = active_constraints(op, active)
    J, drift = constraint_rows(op, held)
    free = op.forward_dynamics(tau)
    omega = delassus(op, J)
    lam = -np.linalg.pinv(omega, rcond=RANK, hermitian=True) @ (J @ free + drift)
    vdot = free + solve(op.mass_matrix, J.T @ lam, assume_a="pos")
    forces = lam.reshape(-1, 3)
    return vdot, {c.name: np.concatenate((np.zeros(3), f)) for c, f in zip(held, forces)}


def delassus(op: Operators, J: Array) -> Array:
    """Ω = J M⁻¹ Jᵀ, eq. (29)."""
    return J @ solve(op.mass_matrix, J.T, assume_a="pos")


def active_constraints(op: Operators, active: Iterable[str] | None = None) -> list[Constraint]:
    """The named constraints, or those that the model calls active, in its order."""
    names = None if active is None else set(active)
    return [c for c in op.model.constraints if (c.active if names is None else c.name in names)]


def constraint_rows(op: Operators, held: Iterable[Constraint]) -> tuple[Array, Array]:
    """J (3 n_c, nv) and J'θ' of point constraints: linear velocity of the points apart (R11)."""
    rows, drift = [np.zeros((0, op.nv))], [np.zeros(0)]
    for c in held:
        body, other = op.topology.number(c.body), op.topology.number(c.other)
        point, other_point = constraint_points(op, c)
        row, bias = op.point_jacobian(body, point), op.point_bias(body, point)
        if other:
            row = row - op.point_jacobian(other, other_point)
            bias = bias - op.point_bias(other, other_point)
        rows.append(row[3:])
        drift.append(bias[3:])
    return np.vstack(rows), np.concatenate(drift)


def constraint_points(op: Operators, c: Constraint) -> tuple[Array, Array]:
    """The two points in their bodies' frames; one left out is where the other is at home."""
    body, other = op.topology.number(c.body), op.topology.number(c.other)
    point = np.array(op.bodies[body - 1].tip_point if c.point is None else c.point)
    if c.other_point is not None:
        return point, np.array(c.other_point)
    position, rotation = home_poses(op.model)
    at = position[body - 1] + rotation[body - 1] @ point
    return point, rotation[other - 1].T @ (at - position[other - 1]) if other else at
