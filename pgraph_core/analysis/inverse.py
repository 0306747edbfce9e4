"""Inverse dynamics with closed loops, and inverse kinematics.

Inverse dynamics: joint torques for a motion permitted by the constraints.

M v' + C - passive = S τ + Jᵀλ. Let N span the null space of J, orthonormal in the mass
metric. The constraints' forces drop out, Nᵀ S τ = Nᵀ r. τ is the solution of least
weighted norm ([Aghili 2005], [Nakamura and Ghodoussi 1989]).

Inverse kinematics by damped Gauss-Newton steps from several starting points. Each step is a
least-squares problem with bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import words
from ..dynamics import Dynamics
from ..dynamics.arguments import finite, whole_number
from ..engine import layout as at
from ..engine.compiler.jit import ready
from ..engine.inverse import INVERSE
from ..engine.inverse import least_torques as LEAST
from ..engine.motions import facts
from ..errors import InputError, Problem, choices, counted, shown
from ..joints import SIZE
from ..packing import Array, Ints
from ..packing.constraints import radius_of_gyration
from ..portable import array_of
from ..rotation import matrix
from ..tolerances import LONGEST_STEP, NOTABLE, ROUNDING, SOLVED
from .assembly import Configuration
from .balance import acting, state_of
from .mobility import complement, judged
from .rows import Rows

DYNAMICS, KINEMATICS = "constrained_inverse_dynamics", "inverse_kinematics"  # calls in errors


def constrained_inverse_dynamics(
    mech: Dynamics,
    q: Array,
    v: Array,
    vdot: Array,
    actuated: Sequence[str] | None,
    weights: Array | Mapping[str, float] | None,
    nearest: bool = False,
) -> Array:
    """Compute the minimum-norm τ (nv,) for v'. See `Mechanism.constrained_inverse_dynamics`."""
    if nearest:  # Gauss's principle, with the torques that would yield v' without constraints
        vdot, _ = mech._constrained_acceleration(q, v, mech._tree_torque(q, v, vdot))
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
    # magnitudes before cancellation, in the mass metric
    inertia = rows.root @ (rows.root.T @ vdot)
    parts = (inertia, force, force - inertia, rows.mech.bias_force(rows.q, rows.v))
    size = sum(float(np.linalg.norm(np.linalg.solve(rows.root, x))) for x in parts)
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
    addresses = scene.address, scene.accelerate, radius_of_gyration(mech.packed.system)
    space = np.empty((n, m)), np.empty((m, m)), np.empty((INVERSE.total, max(n, m, 3)))
    vars(mech)["_inverse_prepared"] = own = Prepared(addresses, np.ones(n), space)
    ready(LEAST)
    return own


# -- arguments -------------------------------------------------------------------------------------


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
            raise InputError(Problem(DYNAMICS, "actuated", text + choices(mech.joints)))
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
        raise InputError(Problem(DYNAMICS, "weights", f"must be numbers > 0, got {shown(weights)}"))
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
            raise InputError(Problem(DYNAMICS, what, text))


def _refuse_forbidden(rows: Rows, basis: Array, vdot: Array) -> None:
    """Raise InputError if the constraints do not permit v'."""
    if not len(basis):
        return
    allowed, _ = rows.mech._constrained_acceleration(rows.q, rows.v)
    mine, theirs = rows.root.T @ vdot, rows.root.T @ allowed
    missed = float(np.linalg.norm(basis @ (mine - theirs)))
    if missed > SOLVED * float(np.linalg.norm(mine) + np.linalg.norm(theirs)):
        off = rows.J @ (vdot - allowed)
        text = (
            f"cannot be reached: constraint '{_blamed(rows, off)}' forbids it, by "
            f"{np.abs(off).max():.3g} m/s^2. For v' from differences or a fit, nearest=True takes "
            "the nearest that they allow; "
            "where a joint follows a given motion, a pg.Motion constraint finds all of it"
        )
        raise InputError(Problem(DYNAMICS, "vdot", text))


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
    text = f"the motion cannot be produced by torques of {by}: forces of up to {most:.3g} (N m or"
    text = f"{text} N) are missing, in the joints of {choices(named, 6)}; name more joints"
    return Problem(DYNAMICS, "actuated", text)


# -- inverse kinematics ----------------------------------------------------------------------------


REACH_ROUNDS = 100
MOST_STARTS = 100_000
STRIDE, STRIDES = 0.25, 8  # share of the size a hand moves a point in one call, and its rounds


class Target(NamedTuple):
    """The target position and orientation for a point on a body or site."""

    name: str
    point: Array  # (3,) in the body's axes
    place: Array | None  # (3,) in the world
    turn: Array | None  # (3, 3)


class Reached(Configuration):
    """A configuration q (nq,) that satisfies the targets, as an array."""

    residual = 0.0  # distance from the targets and of open loops [m]


def inverse_kinematics(
    mech: Dynamics,
    targets: Mapping[str, Any] | str,
    q: Array | None,
    scenario: str | None,
    starts: int,
    alone: Mapping[str, Any],
) -> Reached:
    """Return q (nq,) near q. See `Mechanism.inverse_kinematics`.

    `alone` has the target of a single body.
    """
    if isinstance(targets, str):
        if alone.keys() <= {"point"}:
            form = (
                f"mech.inverse_kinematics({targets!r}, position=(x, y, z), rotation=(w, x, y, z))"
            )
            text = f"of '{targets}' has no place and no rotation; for example: q = {form}"
            raise InputError(Problem(KINEMATICS, "targets", f"the target {text}"))
        targets = {targets: alone}
    elif alone:
        name = next(iter(alone)).replace("place", "position")
        text = f"belongs to a target; name it: mech.inverse_kinematics('hand', {name}=...)"
        raise InputError(Problem(KINEMATICS, name, text))
    items = targets.items()  # before q: a call by position gives a body and its place
    starts = whole_number(KINEMATICS, "starts", starts, 1, MOST_STARTS)
    q, _ = state_of(mech, q, None, scenario)
    wanted = [_target(mech, q, name, value) for name, value in items]
    if not wanted:
        raise InputError(Problem(KINEMATICS, "targets", "give at least one body and its target"))
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
            reached = best.view(Reached)
            reached.residual = least
            return reached
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
            text = f"has place, rotation and point, got {choices(sorted(map(str, unknown)))}"
            raise InputError(Problem(KINEMATICS, name, f"a target {text}"))
        point = value.get("point", point)
        place, turn = value.get("place"), value.get("rotation")
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        if all(isinstance(x, (int, float)) for x in value):
            text = f"a place has three numbers [m], got {shown(value)}"
            raise InputError(Problem(KINEMATICS, f"target of '{name}'", text))
        place, turn = value
    elif getattr(value, "shape", ()) == (4, 4):
        matrix = np.asarray(value)
        place, turn = matrix[:3, 3], matrix[:3, :3]
    else:
        place = value
    if place is None and turn is None:
        raise InputError(Problem(KINEMATICS, name, "give a place, a rotation, or both"))
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
    text = f"must be a unit quaternion [w, x, y, z] or a rotation (3, 3), got {shown(given)}"
    raise InputError(Problem(KINEMATICS, f"rotation of '{name}'", text))


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
    single = facts("freedoms")[rows.mech.packed.rows[1:, at.KIND]] == 1
    of_q, of_v = rows.mech.packed.rows[1:][single, at.QI : at.VI + 1].T
    here[of_v] = rows.q[of_q]
    return here


def _descended(
    rows: Rows, wanted: list[Target], low: Array, high: Array, rounds: int = REACH_ROUNDS
) -> tuple[Array, float]:
    """Descend from a start to (q, residual [m]). Rotations count by the radius of gyration."""
    from scipy.optimize import lsq_linear  # a tenth of a second, which inverse dynamics saves

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
    """Compute the target and loop residuals (m,) [m], and their derivatives (m, nv)."""
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
    return Problem(KINEMATICS, f"target of '{target.name}'", text)
