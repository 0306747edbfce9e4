"""Inverse kinematics: move bodies to targets, subject to joint limits and loop closure.

Damped Gauss-Newton steps, each a least-squares problem with bounds; from several starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from .. import words
from ..dynamics import Dynamics
from ..dynamics.arguments import finite, whole_number
from ..engine import layout as at
from ..errors import InputError, Problem, choices, counted, shown
from ..given import array_of
from ..joints import SIZE
from ..packing import Array
from ..rotation import matrix
from ..tolerances import LONGEST_STEP, NOTABLE, ROUNDING, SOLVED
from .balance import acting, state_of
from .rows import Rows

WHERE = "inverse_kinematics"
REACH_ROUNDS = 100
MOST_STARTS = 100_000
STRIDE, STRIDES = 0.25, 8  # share of the size a hand moves a point in one call, and its rounds


class Target(NamedTuple):
    """The target position and orientation for a point on a body or site."""

    name: str
    point: Array  # (3,) in the body's axes
    place: Array | None  # (3,) in the world
    turn: Array | None  # (3, 3)


def inverse_kinematics(
    mech: Dynamics, targets: Mapping[str, Any], q: Array | None, scenario: str | None, starts: int
) -> Array:
    """Return q (nq,) near q. See `Mechanism.inverse_kinematics`."""
    starts = whole_number(WHERE, "starts", starts, 1, MOST_STARTS)
    q, _ = state_of(mech, q, None, scenario)
    wanted = [_target(mech, q, name, value) for name, value in targets.items()]
    if not wanted:
        raise InputError(Problem(WHERE, "targets", "give at least one body and its target"))
    rows = Rows.of(mech, acting(mech, scenario)[1], q)
    low, high = bounds(mech)
    random = np.random.default_rng(0)
    best, least = q, np.inf
    for start in range(starts):
        end, left = _descended(rows.at(best if start == 0 else _around(rows, q, random, low, high)),
                               wanted, low, high)  # fmt: skip
        if left < least:
            best, least = end, left
        if least <= SOLVED * rows.size:
            return best
    raise InputError([_missed(mech, best, target, starts) for target in _off(best, wanted, rows)])


def nearest(
    mech: Dynamics, q: Array, name: str, point: Any, place: Any, still: Array
) -> Array:  # fmt: skip
    """Return q (nq,) near q with a body's point (3,) as close as possible to a target (3,) [m].

    Limits hold. Loops nearly stay closed, and `assemble` closes them. `still` (nv,) contains the
    degrees of freedom that do not move. One call moves the point by at most STRIDE of the
    mechanism's size.
    """
    rows = Rows.of(mech, acting(mech, None)[1], q)
    low, high = bounds(mech)
    here = single(rows)
    low, high = np.where(still, here, low), np.where(still, here, high)
    at, turn = mech.pose(q, name)
    start = at + turn @ np.asarray(point, float)
    way = np.asarray(place, float) - start
    way *= min(1.0, STRIDE * rows.size / max(float(np.linalg.norm(way)), 1e-300))
    target = Target(name, np.asarray(point, float), start + way, None)
    return _descended(rows, [target], low, high, STRIDES)[0]


def _target(mech: Dynamics, q: Array, name: str, value: Any) -> Target:
    mech.pose(q, name)  # raises InputError for a name that is none
    point: Any = (0.0, 0.0, 0.0)
    place: Any = None
    turn: Any = None
    if isinstance(value, Mapping):
        value = words.renamed(value, ("place", "rotation")) or value
        if unknown := value.keys() - {"place", "rotation", "point"}:
            text = f"has place, rotation and point; given {choices(sorted(map(str, unknown)))}"
            raise InputError(Problem(WHERE, name, f"a target {text}"))
        point = value.get("point", point)
        place, turn = value.get("place"), value.get("rotation")
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        if all(isinstance(x, (int, float)) for x in value):
            text = f"a place has three numbers [m]; given {shown(value)}"
            raise InputError(Problem(WHERE, f"target of '{name}'", text))
        place, turn = value
    else:
        place = value
    if place is None and turn is None:
        raise InputError(Problem(WHERE, name, "give a place, a rotation, or both"))
    place = None if place is None else finite(f"target of '{name}'", place, 3)
    return Target(
        name, finite("point", point, 3), place, None if turn is None else _turn(name, turn)
    )


def _turn(name: str, given: Any) -> Array:
    try:
        turn = array_of(given).astype(float)
    except (TypeError, ValueError):
        turn = np.zeros(0)
    if turn.shape == (4,) and 0.5 < np.linalg.norm(turn) < 2:
        return matrix(turn.tolist())
    if turn.shape == (3, 3) and np.abs(turn @ turn.T - np.eye(3)).max() < NOTABLE:
        return turn
    text = f"must be a unit quaternion [w, x, y, z] or a rotation (3, 3); given {shown(given)}"
    raise InputError(Problem(WHERE, f"rotation of '{name}'", text))


def bounds(mech: Dynamics) -> tuple[Array, Array]:
    """Return the lower and upper limits of each coordinate, (nv,) each, infinite for balls."""
    low, high = np.full(mech.nv, -np.inf), np.full(mech.nv, np.inf)
    for name, joint in mech.joints.items():
        body, j = mech.model.body(name), joint.v.start
        for (kind, _), pair in zip(body.motions, body.limits):
            if pair is not None:
                low[j] = -np.inf if pair[0] is None else pair[0]
                high[j] = np.inf if pair[1] is None else pair[1]
            j += SIZE[kind][1]
    return low, high


def _room(rows: Rows, low: Array, high: Array) -> tuple[Array, Array]:
    """Return how far each degree of freedom may move down and up in one step, (nv,) each."""
    here = single(rows)
    longest = LONGEST_STEP * np.where(rows.turns, 1.0, rows.size)
    down, up = np.maximum(low - here, -longest), np.minimum(high - here, longest)
    return np.minimum(down, -1e-15), np.maximum(up, 1e-15)


def _around(rows: Rows, q: Array, random: np.random.Generator, low: Array, high: Array) -> Array:
    """Return another start from a random move, with random positions between limits."""
    start = rows.at(q)
    here = single(start)
    step = random.normal(size=rows.nv) * np.where(rows.turns, 1.5, 0.5 * rows.size)
    both = np.isfinite(low) & np.isfinite(high)
    inside = random.uniform(np.where(both, low, 0.0), np.where(both, high, 0.0))
    return start.advanced(np.where(both, inside, np.clip(here + step, low, high)) - here)


def single(rows: Rows) -> Array:
    """Return the rotation and translation coordinates (nv,), with 0 for balls."""
    here = np.zeros(rows.nv)
    for _, kind, i, j in rows.mech.packed.rows[1:].tolist():
        if kind <= at.TRANSLATE:
            here[j] = rows.q[i]
    return here


def _descended(
    rows: Rows, wanted: list[Target], low: Array, high: Array, rounds: int = REACH_ROUNDS
) -> tuple[Array, float]:
    """Descend from a start to (q, residual [m]). Rotations count by the radius of gyration."""
    damping, left = 1e-3, np.inf
    error, J = _errors(rows, wanted)
    left = float(np.linalg.norm(error))
    for _ in range(rounds):
        if left <= ROUNDING * rows.size:
            break
        weight = np.sqrt(damping) * min(left / rows.size, 1.0)
        weights = np.where(rows.turns, rows.length, 1.0) * weight
        down, up = _room(rows, low, high)
        system = np.vstack((J, np.diag(weights)))
        step = lsq_linear(system, np.concatenate((-error, np.zeros(rows.nv))), (down, up)).x
        trial = rows.at(rows.advanced(step))
        new, slope = _errors(trial, wanted)
        size = float(np.linalg.norm(new))
        if size < left:
            gained = 1 - size / left
            rows, error, J, left = trial, new, slope, size
            damping = max(damping / 5, 1e-12)
            if gained < NOTABLE:
                break
        else:
            damping *= 10
            if damping > 1e9:
                break
    return rows.q, left


def _errors(rows: Rows, wanted: list[Target]) -> tuple[Array, Array]:
    """Return the target and loop residuals (m,) [m], and their derivatives (m, nv)."""
    errors, slopes = [rows.gap[rows.holonomic]], [rows.J[rows.holonomic]]
    for target in wanted:
        place, turn = rows.mech.pose(rows.q, target.name)
        J = rows.mech.jacobian(rows.q, target.name, tuple(target.point))
        if target.place is not None:
            errors.append(place + turn @ target.point - target.place)
            slopes.append(J[3:])
        if target.turn is not None:
            errors.append(rows.length * _angle(turn @ target.turn.T))
            slopes.append(rows.length * J[:3])
    return np.concatenate(errors), np.vstack(slopes)


def _angle(R: Array) -> Array:
    """Return the rotation vector (3,) of a rotation."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


def _off(q: Array, wanted: list[Target], rows: Rows) -> list[Target]:
    """Return the missed targets, or all of them if only loops are open."""
    here = rows.at(q)
    loops = len(here.holonomic)
    found = [
        t for t in wanted if np.linalg.norm(_errors(here, [t])[0][loops:]) > SOLVED * rows.size
    ]
    return found or wanted


def _missed(mech: Dynamics, q: Array, target: Target, starts: int) -> Problem:
    place, turn = mech.pose(q, target.name)
    parts: list[str] = []
    if target.place is not None:
        parts.append(f"{np.linalg.norm(place + turn @ target.point - target.place):.3g} m")
    if target.turn is not None:
        parts.append(f"{np.linalg.norm(_angle(turn @ target.turn.T)):.3g} rad")
    text = f"the best of {counted(starts, 'start')} misses the target by {' and '.join(parts)}, "
    text += "within the limits and constraints; move the target, start closer to it "
    text += "with q=..., or give more starts=..."
    return Problem(WHERE, f"target of '{target.name}'", text)
