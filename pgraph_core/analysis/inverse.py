"""Inverse dynamics with closed loops: joint torques for a motion permitted by the constraints.

M v' + C - passive = S τ + Jᵀλ. Let N span the null space of J, orthonormal in the mass
metric. The constraints' forces drop out, Nᵀ S τ = Nᵀ r. τ is the solution of least
weighted norm ([Aghili 2005], [Nakamura and Ghodoussi 1989]).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.arguments import finite
from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.compiler.jit import ready
from ..engine.inverse import VECTORS
from ..engine.inverse import least_torques as LEAST
from ..errors import InputError, Problem, choices, shown
from ..packing import Array, Ints
from ..packing.constraints import radius_of_gyration
from ..tolerances import NOTABLE, ROUNDING, SOLVED
from .mobility import complement, judged
from .rows import Rows


def constrained_inverse_dynamics(
    mech: Dynamics,
    q: Array,
    v: Array,
    vdot: Array,
    actuated: Sequence[str] | None,
    weights: Array | Mapping[str, float] | None,
) -> Array:
    """Return the minimum-norm τ (nv,) for v'. See `Mechanism.constrained_inverse_dynamics`."""
    at_once = _at_once(mech, (q, v, vdot), actuated, weights)
    if at_once is not None:
        return at_once
    force = mech._tree_torque(q, v, vdot)  # checks q, v, v'
    q, v, vdot = (np.array(x, dtype=float) for x in (q, v, vdot))
    rows = Rows.of(mech, mech.packed.active, q, v)
    _refuse_wrong_state(rows)
    basis = judged(rows)[0]
    _refuse_forbidden(rows, basis, vdot)
    free = rows.step(complement(basis, mech.nv))  # (nv, n), orthonormal in the mass metric
    chosen = _coordinates(mech, actuated)
    scale = 1.0 / np.sqrt(_weights(mech, weights)[chosen])
    leverage = free[chosen].T * scale  # (n, actuated)
    wanted = free.T @ force
    size = _size(rows, force, vdot)
    given = np.linalg.lstsq(leverage, wanted, rcond=ROUNDING)[0]
    left = wanted - leverage @ given
    if np.linalg.norm(left) > SOLVED * size:
        raise InputError(_unreached(mech, rows.root @ rows.root.T @ (free @ left), actuated))
    tau = np.zeros(mech.nv)
    tau[chosen] = scale * given
    return tau


class Prepared(NamedTuple):
    """Kernel arguments in addition to the state."""

    addresses: tuple[int, int, float]
    cost: Array  # (nv,) of every joint
    space: tuple[Array, Array, Array]


def _at_once(
    mech: Dynamics,
    state: tuple[Array, Array, Array],
    actuated: Sequence[str] | None,
    weights: Array | Mapping[str, float] | None,
) -> Array | None:
    """Return τ if the kernel accepts the state and no row can be redundant, else None.

    The slower steps then report bad input or decide which rows are redundant.
    """
    own = vars(mech).get("_inverse_prepared") or _prepared(mech)
    if own is None:
        return None
    (q, v, vdot), tau = state, np.empty(mech.nv)
    cost = own.cost
    try:
        if len(q) != mech.nq or len(v) != mech.nv or len(vdot) != mech.nv:
            return None
        if weights is not None or actuated is not None:
            chosen = _coordinates(mech, actuated)
            cost = np.zeros(mech.nv)
            cost[chosen] = _weights(mech, weights)[chosen]
        passive = mech._passive(q, v, mech._rest) if mech._springs else mech._rest
        with mech._lock:
            code = LEAST(*own.addresses, q, v, vdot, passive, cost, *own.space, tau)
    except (TypeError, ValueError, AttributeError):  # arrays that the kernel does not take
        return None
    return None if code else tau


def _prepared(mech: Dynamics) -> Prepared | None:
    """Prepare the kernel arguments once per mechanism. Return None if there are no constraints."""
    scene = mech._scene
    if not scene.active[0]:
        return None
    n, m = mech.nv, len(scene.space.omega)
    accelerate = address_of(motion.acceleration)
    addresses = scene.address, accelerate, radius_of_gyration(mech.packed.system)
    space = np.empty((n, m)), np.empty((m, m)), np.empty((VECTORS, max(n, m, 3)))
    vars(mech)["_inverse_prepared"] = own = Prepared(addresses, np.ones(n), space)
    ready(LEAST)
    return own


def _size(rows: Rows, force: Array, vdot: Array) -> float:
    """Return the magnitude of the forces in the mass metric, before cancellation."""
    inertia = rows.root @ (rows.root.T @ vdot)
    parts = (inertia, force, force - inertia, rows.mech.bias_force(rows.q, rows.v))
    return sum(float(np.linalg.norm(np.linalg.solve(rows.root, x))) for x in parts)


# -- arguments -------------------------------------------------------------------------------------

WHERE = "constrained_inverse_dynamics"


def _coordinates(mech: Dynamics, actuated: Sequence[str] | None) -> Ints:
    """Return the indices into v for the joints that carry torques."""
    if actuated is None:
        return np.arange(mech.nv)
    if isinstance(actuated, str):
        actuated = (actuated,)
    spans: list[Ints] = []
    for name in actuated:
        if name not in mech.joints:
            text = f"no joint that moves belongs to {shown(name)}; choose from "
            raise InputError(Problem(WHERE, "actuated", text + choices(mech.joints)))
        span = mech.joints[name].v
        spans.append(np.arange(span.start, span.stop))
    return np.unique(np.concatenate(spans)) if spans else np.zeros(0, dtype=np.int64)


def _weights(mech: Dynamics, weights: Array | Mapping[str, float] | None) -> Array:
    """Return the positive cost of τ² for each coordinate (nv,), 1 by default. Raises InputError."""
    if weights is None:
        return np.ones(mech.nv)
    if isinstance(weights, Mapping):
        cost = np.ones(mech.nv)
        for name, weight in weights.items():
            cost[_coordinates(mech, (name,))] = weight
    else:
        cost = finite("weights", weights, mech.nv)
    if not (np.isfinite(cost).all() and (cost > 0).all()):
        raise InputError(Problem(WHERE, "weights", f"must be numbers > 0; given {shown(weights)}"))
    return cost


# -- what cannot be reached ------------------------------------------------------------------------


def _refuse_wrong_state(rows: Rows) -> None:
    """Raise InputError if q or v violates the constraints."""
    speed = float(np.max(np.abs(rows.J) @ np.abs(rows.v), initial=0.0))
    for what, missed, most, unit in (
        ("q", rows.gap, NOTABLE * rows.size, "m"),
        ("v", rows.slip, NOTABLE * max(speed, NOTABLE), "m/s"),
    ):
        worst = float(np.max(np.abs(missed), initial=0.0))
        if worst > most:
            name = _blamed(rows, missed)
            text = f"misses constraint '{name}' by {worst:.3g} {unit}; `assemble` it first"
            raise InputError(Problem(WHERE, what, text))


def _refuse_forbidden(rows: Rows, basis: Array, vdot: Array) -> None:
    """Raise InputError if the constraints do not permit v'."""
    if not len(basis):
        return
    allowed, _ = rows.mech.constrained_dynamics(rows.q, rows.v)
    mine, theirs = rows.root.T @ vdot, rows.root.T @ allowed
    missed = float(np.linalg.norm(basis @ (mine - theirs)))
    if missed > SOLVED * float(np.linalg.norm(mine) + np.linalg.norm(theirs)):
        off = rows.J @ (vdot - allowed)
        text = (
            f"cannot be reached: constraint '{_blamed(rows, off)}' forbids it, by "
            f"{np.abs(off).max():.3g} m/s^2. For v' from differences or a fit, the nearest that "
            "they allow is mech.constrained_dynamics(q, v, mech.inverse_dynamics(q, v, vdot))[0]; "
            "where a joint follows a given motion, a pg.Motion constraint finds all of it"
        )
        raise InputError(Problem(WHERE, "vdot", text))


def _blamed(rows: Rows, missed: Array) -> str:
    worst = max(rows.groups, key=lambda g: float(np.abs(missed[g.rows]).max()))
    return worst.constraint.name


def _unreached(mech: Dynamics, left: Array, actuated: Sequence[str] | None) -> Problem:
    """Name the joints without an actuator that would have to carry the missing torque."""
    missing = {name: float(np.abs(left[j.v]).max()) for name, j in mech.joints.items()}
    most = max(missing.values())
    others = sorted((x, name) for name, x in missing.items() if name not in (actuated or ()))
    named = [name for x, name in reversed(others) if x > NOTABLE * most]
    by = "every joint" if actuated is None else choices(actuated) or "no joint"
    text = f"the motion is not possible with torques of {by}: forces of up to {most:.3g} (N m or"
    text = f"{text} N) are missing, in the joints of {choices(named, 6)}; name more joints"
    return Problem(WHERE, "actuated", text)
