"""Inverse dynamics of mechanisms with loops: joint torques for a motion that constraints permit.

M v' + C - passive = S τ + Jᵀλ + J_cᵀf. Let N span the null space of J, orthonormal in the mass
metric. The constraints' forces drop out, Nᵀ S τ + Nᵀ J_cᵀ f = Nᵀ r. τ is the solution of least
weighted norm ([Aghili 2005], [Nakamura and Ghodoussi 1989]).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ..dynamics import Dynamics
from ..dynamics.arguments import finite
from ..dynamics.scene import NO_CONSTRAINTS, Scene, contact_tables
from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.compiler.jit import ready
from ..engine.inverse import VECTORS
from ..engine.inverse import least_torques as LEAST
from ..errors import InputError, Problem, choices, shown
from ..packing import Array, Ints
from ..packing.constraints import radius_of_gyration
from ..packing.forces import NO_LOADS
from ..rotation import normals_of
from ..tolerances import EPS, NAMED, NOTABLE, ROUNDING, SOLVED, TOUCHING
from .mobility import complement, judged
from .rows import Rows

EDGES = 8  # edges of the first pyramid inside a friction cone
REFINEMENTS = 12  # refinements of the pyramid, each by the directions in use
# Cost of a force relative to that of a torque, whose square is half the digits: it decides only if
# torques do not. What torques cannot balance weighs as much more, before it is balanced exactly
# (weighting method; Lawson and Hanson, Solving Least Squares Problems, chapter 22).
LIGHT = EPS**0.25


def constrained_inverse_dynamics(
    mech: Dynamics,
    q: Array,
    v: Array,
    vdot: Array,
    actuated: Sequence[str] | None,
    weights: Array | Mapping[str, float] | None,
    contacts: Sequence[str] | None,
) -> Array:
    """Return τ (nv,) of least norm for v', see `Mechanism.constrained_inverse_dynamics`."""
    at_once = None if contacts else _at_once(mech, (q, v, vdot), actuated, weights)
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
    points = _points(mech, q, contacts) if contacts else []
    if points:
        wanted = wanted - _carried(points, free, leverage, wanted, size)
    given = np.linalg.lstsq(leverage, wanted, rcond=ROUNDING)[0]
    left = wanted - leverage @ given
    if np.linalg.norm(left) > SOLVED * size:
        raise InputError(_unreached(mech, rows.root @ rows.root.T @ (free @ left), actuated))
    tau = np.zeros(mech.nv)
    tau[chosen] = scale * given
    return tau


class Prepared(NamedTuple):
    """Arguments of the kernel in addition to the state."""

    addresses: tuple[int, int, float]
    cost: Array  # (nv,) of every joint
    space: tuple[Array, Array, Array]


def _at_once(
    mech: Dynamics,
    state: tuple[Array, Array, Array],
    actuated: Sequence[str] | None,
    weights: Array | Mapping[str, float] | None,
) -> Array | None:
    """Return τ if the kernel accepts the state and no row may be redundant, else None.

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
    """Prepare the kernel's arguments, once per mechanism. None without constraints."""
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
    """The forces at hand in the mass metric, before they cancel."""
    inertia = rows.root @ (rows.root.T @ vdot)
    parts = (inertia, force, force - inertia, rows.mech.bias_force(rows.q, rows.v))
    return sum(float(np.linalg.norm(np.linalg.solve(rows.root, x))) for x in parts)


# -- arguments -------------------------------------------------------------------------------------

WHERE = "constrained_inverse_dynamics"


def _coordinates(mech: Dynamics, actuated: Sequence[str] | None) -> Ints:
    """Indices into v of the joints that carry torques."""
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
    """Return the cost of τ² in each coordinate (nv,) > 0, by default 1. Raises InputError."""
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
    """Raise InputError where q or v do not meet the constraints."""
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
    """Raise InputError where the constraints do not allow v'."""
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
    """Which joints would have to carry what no actuator gives."""
    missing = {name: float(np.abs(left[j.v]).max()) for name, j in mech.joints.items()}
    most = max(missing.values())
    named = [name for name, x in sorted(missing.items(), key=lambda m: -m[1]) if x > NAMED * most]
    by = "every joint" if actuated is None else choices(actuated) or "no joint"
    text = f"the motion cannot be reached with torques of {by}: forces of up to {most:.3g} (N m or"
    text = f"{text} N) are missing, in the joints of {choices(named, 6)}; name more joints"
    return Problem(WHERE, "actuated", text)


# -- contacts that carry ---------------------------------------------------------------------------


class CarryingPoint(NamedTuple):
    """Point at which a contact acts with force `axes.T @ (normal, tangential, tangential)`."""

    jacobian: Array  # (3, nv) of the body's point against the other's, world axes
    axes: Array  # (3, 3) normal and two tangents, as rows
    friction: float


def _points(mech: Dynamics, q: Array, names: Sequence[str]) -> list[CarryingPoint]:
    """The points at which these contacts touch. Raises InputError for one that does not."""
    from ..engine.contact import contacts as kernels  # compiled only where something touches

    names = (names,) if isinstance(names, str) else tuple(names)
    known = [c.name for c in mech.model.contacts]
    for name in names:
        if name not in known:
            do = f"choose from {choices(known)}" if known else "the model has no contact"
            raise InputError(Problem(WHERE, "contacts", f"no contact is named {shown(name)}; {do}"))
    chosen = tuple(c for c in mech.model.contacts if c.name in names)
    tables = contact_tables(mech.packed, chosen)
    assert tables is not None
    scene = Scene(mech.packed, mech.packed.passive, NO_LOADS, NO_CONSTRAINTS, contacts=tables)
    none = np.zeros(0)
    motion.residuals(scene.address, 0.0, q, np.zeros(mech.nv), none, none)  # places the bodies
    place, turn = mech.poses(q)
    reach = TOUCHING * radius_of_gyration(mech.packed.system)
    assert scene.touching is not None
    count = kernels.find(scene.address, reach, 0)
    shapes, found = scene.touching.shapes, scene.touching.found[:count]
    points: list[CarryingPoint] = []
    carrying: set[str] = set()

    def jacobian(shape: int, x: Array) -> Array:
        if shape < 0:
            return np.zeros((3, mech.nv))
        number = int(mech.packed.system.body_of_row[int(shapes[shape]["row"])])
        at = turn[number - 1].T @ (x - place[number - 1])
        return mech.jacobian(q, mech.names[number - 1], at)[3:]

    for one in found:
        if one["gap"] > reach:
            continue
        contact = tables.touches[int(one["pair"])].contact
        carrying.add(contact.name)
        normal = np.array(one["normal"])
        mine = jacobian(int(one["shape_a"]), one["point_a"])
        other = jacobian(int(one["shape_b"]), one["point_b"])
        own = mech.model.ground.friction if contact.friction is None else contact.friction
        points.append(CarryingPoint(mine - other, np.stack((normal, *normals_of(normal))), own))
    for name in names:
        if name not in carrying:
            text = f"contact '{name}' does not touch at q, so it carries nothing; leave it out, or"
            raise InputError(Problem(WHERE, "contacts", f"{text} put the body down"))
    return points


def _carried(
    points: list[CarryingPoint], free: Array, leverage: Array, wanted: Array, size: float
) -> Array:
    """(n,) what contact forces within their cones do, where the other torques are least.

    Cones by pyramids inside them, refined in the directions that are used: each is a non-negative
    least-squares problem, and the torques fall from one to the next.
    """
    left, sizes, right = np.linalg.svd(leverage, full_matrices=True)
    rank = int((sizes > ROUNDING * sizes.max(initial=0.0)).sum())
    by_torque, beyond = left[:, :rank].T / sizes[:rank, None], left[:, rank:].T
    angles = [np.linspace(0, 2 * np.pi, EDGES, endpoint=False) for _ in points]
    effect = np.zeros(len(wanted))
    for _ in range(REFINEMENTS):
        edges = [_edges(p, a) for p, a in zip(points, angles)]
        acts = [free.T @ p.jacobian.T @ e for p, e in zip(points, edges)]
        pushes, each = np.hstack(acts), np.hstack(edges)
        torques = by_torque @ pushes
        light = LIGHT * float(np.max(np.abs(torques), initial=0.0)) or 1.0
        cost = np.vstack((torques, light * _apart(edges)))
        aim = np.concatenate((by_torque @ wanted, np.zeros(len(cost) - len(by_torque))))
        weight = float(np.abs(cost).max()) / LIGHT
        share, _ = nnls(
            np.vstack((cost, weight * beyond @ pushes)),
            np.concatenate((aim, weight * beyond @ wanted)),
            maxiter=100 * each.shape[1],
        )
        used = np.flatnonzero(share > 0)
        share = _balanced(beyond @ pushes[:, used], beyond @ wanted, share[used])
        before, effect = effect, pushes[:, used] @ share
        first = 0
        for k, (point, e) in enumerate(zip(points, edges)):
            mine = (used >= first) & (used < first + e.shape[1])
            force = point.axes @ (e[:, used[mine] - first] @ share[mine])
            first += e.shape[1]
            if np.hypot(*force[1:]) > 0:
                angles[k] = np.append(angles[k], np.arctan2(force[2], force[1]))
        if np.linalg.norm(effect - before) <= SOLVED * size:
            break
    return effect


def _edges(point: CarryingPoint, angles: Array) -> Array:
    """Return the normal and the edges of a pyramid in a friction cone (3, 1 + k), normal part 1."""
    mu = point.friction
    own = np.stack((np.ones_like(angles), mu * np.cos(angles), mu * np.sin(angles)))
    return point.axes.T @ np.hstack((np.array([[1.0], [0.0], [0.0]]), own))


def _apart(edges: list[Array]) -> Array:
    """The forces of all points one below the other."""
    width = sum(e.shape[1] for e in edges)
    out, column = np.zeros((3 * len(edges), width)), 0
    for k, e in enumerate(edges):
        out[3 * k : 3 * k + 3, column : column + e.shape[1]] = e
        column += e.shape[1]
    return out


def _balanced(balance: Array, owed: Array, share: Array) -> Array:
    """Return shares >= 0 that meet the balance exactly and are closest to least cost."""
    for _ in range(3):
        share = share + np.linalg.lstsq(balance, owed - balance @ share, rcond=ROUNDING)[0]
    return np.maximum(share, 0.0) if len(share) else share
