"""Derivatives of forward dynamics, exact to rounding, from inverse dynamics in lanes.

∂v'/∂x = M⁻¹ (∂τ_passive/∂x - ∂τ/∂x), τ(q, v, v') of eq. (24) at the v' found. Kinetic energy is
quadratic in where a joint's motion has brought what it carries: along one turn τ is a trigonometric
polynomial of degree two, along one slide a polynomial of degree two, and so it is in v. A few
values far apart then give the slope without any error of truncation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .kernels import layout as at
from .kernels import run as kernels
from .system import Array

if TYPE_CHECKING:
    from .mechanism import Mechanism

# Of f with sin θ and sin 2θ as its odd part, (3 (f(a) - f(-a)) - (f(b) - f(-b))) / (2 √3) is f'(0).
TURN = np.array([np.pi / 3, -np.pi / 3, 2 * np.pi / 3, -2 * np.pi / 3])
TURN_WEIGHTS = np.array([3.0, -3.0, -1.0, 1.0]) / (2 * np.sqrt(3))
SLIDE = np.array([1.0, -1.0, 2.0, -2.0])
SLIDE_WEIGHTS = np.array([0.5, -0.5, 0.0, 0.0])


def forward_derivatives(
    mech: Mechanism, q: Array, v: Array, tau: Array
) -> tuple[Array, Array, Array]:
    """∂v'/∂q, ∂v'/∂v and ∂v'/∂τ = M⁻¹ from one batch of 6 nv inverse dynamics."""
    n = mech.nv
    if n == 0:
        return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0))
    moves, weights = stencil(mech)
    speed = max(1.0, float(abs(v).max()))
    qs, vs = np.repeat(q[None], 6 * n, axis=0), np.repeat(v[None], 6 * n, axis=0)
    for j in range(n):
        along = np.zeros(n)
        for i, distance in enumerate(moves[j]):
            along[j] = distance
            kernels.move(mech.system.rows, qs[4 * j + i], along, 1.0)
        vs[4 * n + 2 * j, j] += speed
        vs[4 * n + 2 * j + 1, j] -= speed
    vdots = np.repeat(mech.forward_dynamics(q, v, tau)[None], 6 * n, axis=0)
    torque = mech.batch(6 * n).rigid_torque(qs, vs, vdots)
    by_q = np.einsum("jik,ji->kj", torque[: 4 * n].reshape(n, 4, n), weights)
    by_v = (torque[4 * n :: 2] - torque[4 * n + 1 :: 2]).T / (2 * speed)
    spring, damper = passive_slopes(mech, v)
    right = np.hstack((np.diag(spring) - by_q, np.diag(damper) - by_v, np.eye(n)))
    slopes: Array = np.linalg.solve(mech.mass_matrix(q), right).astype(np.float64, copy=False)
    return slopes[:, :n], slopes[:, n : 2 * n], slopes[:, 2 * n :]


def stencil(mech: Mechanism) -> tuple[Array, Array]:
    """(nv, 4) moves along each degree of freedom, and the weights that make a slope of values."""
    const = mech.system.const
    length = float(abs(const[1:, [*range(at.LINK, at.LINK + 3), *range(at.COM, at.COM + 3)]]).max())
    length = length or 1.0
    moves, weights = np.tile(TURN, (mech.nv, 1)), np.tile(TURN_WEIGHTS, (mech.nv, 1))
    for _, kind, _, j in mech.system.rows[1:].tolist():
        if kind in (at.TRANSLATE, at.FREE):
            slides = slice(j, j + 1) if kind == at.TRANSLATE else slice(j + 3, j + 6)
            moves[slides], weights[slides] = length * SLIDE, SLIDE_WEIGHTS / length
    return moves, weights


def passive_slopes(mech: Mechanism, v: Array) -> tuple[Array, Array]:
    """(nv,) slopes of the joints' springs in q and of their dampers and friction in v."""
    spring, damper = np.zeros(mech.nv), np.zeros(mech.nv)
    for row in mech.passive[0]:
        j = int(row[at.DR_V])
        creep = v[j] ** 2 + at.CREEP**2
        damper[j] -= row[at.DR_KD] + row[at.DR_FRICTION] * at.CREEP**2 / creep**1.5
        spring[j] -= row[at.DR_KP] if row[at.DR_Q] >= 0 else 0.0
    return spring, damper
