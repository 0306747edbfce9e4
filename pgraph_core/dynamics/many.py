"""Many states at once: the twist of each coordinate, joint torques, and their inertial parameters.

The inertial parameters of a body are its mass, its mass times the centre of mass (3,), and its
inertia about the body's origin (xx, xy, xz, yy, yz, zz), in body axes. Joint torques are linear in
them (Atkeson, An and Hollerbach, Estimation of inertial parameters of manipulator loads and links,
Int. J. Robotics Research 5 (1986) 101-119).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.tree import bodies as kernels
from ..joints import SIZE
from ..packing import Array, Ints, plain
from ..packing.packed import Packed

if TYPE_CHECKING:
    from .dynamics import Dynamics

PARAMETERS = 10  # inertial parameters of a body
ROWS, COLUMNS = [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]  # places of its six entries in an inertia


class Motions(NamedTuple):
    """Poses, velocities, accelerations and joint forces of bodies at n states, in world axes."""

    place: Array  # (n, nb, 3)
    turn: Array  # (n, nb, 3, 3)
    velocity: Array  # (n, nb, 6) angular, linear, at the bodies' origins
    acceleration: Array  # (n, nb, 6)
    force: Array  # (n, nb, 6) torque and force that each joint passes on


def motions(packed: Packed, q: Array, v: Array, a: Array, external: Array | None = None) -> Motions:
    """Compute the motions of all bodies at states (n, nq), (n, nv), with loads (n, nb, 6)."""
    n, nb = len(q), packed.nb
    place, turn = np.empty((n, nb, 3)), np.empty((n, nb, 9))
    found = [np.empty((n, nb, 6)) for _ in range(3)]
    loads = np.zeros((n, nb, 6)) if external is None else external
    work = np.zeros((len(packed.system.rows), at.WORK))
    states = (np.ascontiguousarray(x, float) for x in (q, v, a, loads))
    kernels.motion_and_forces(*packed.system[:4], *states, work, place, turn, *found)
    return Motions(place, turn.reshape(n, nb, 3, 3), *found)


class Plan(NamedTuple):
    """Which joint has each velocity, and which velocities are tried together."""

    own: Ints  # (nv,) index of the body whose joint has it
    parent: Ints  # (nv,) index of that body's parent, -1 for the ground
    turn: Ints  # (nv,) its number within its joint
    speeds: Array  # (k, nv) all joints move by their k-th velocity
    carried: Array  # (nb, nv) 1.0 where a velocity moves a body, else 0.0
    plain: tuple[Ints, Ints]  # indices into q and v of coordinates whose rates are velocities


def plan(packed: Packed) -> Plan:
    """Return the plan of a mechanism, made once."""
    if (made := vars(packed).get("_plan_of_twists")) is not None:
        return made
    parents = packed.topology.parent.astype(np.int64) - 1
    own, turn = np.zeros((2, packed.nv), dtype=np.int64)
    for name, joint in packed.joints.items():
        own[joint.v] = packed.topology.number(name) - 1
        turn[joint.v] = np.arange(joint.v.stop - joint.v.start)
    speeds = np.zeros((int(turn.max(initial=0)) + 1, packed.nv))
    speeds[turn, np.arange(packed.nv)] = 1.0
    carried = np.zeros((packed.nb, packed.nv))
    for b, parent in enumerate(parents.tolist()):  # parents come first
        if parent >= 0:
            carried[b] = carried[parent]
        carried[b, own == b] = 1.0
    vars(packed)["_plan_of_twists"] = made = Plan(
        own, parents[own], turn, speeds, carried, plain(packed.rows)
    )  # fmt: skip
    return made


class Twists(NamedTuple):
    """The twists of all coordinates at n states, and the poses of the bodies."""

    twist: Array  # (n, nv, 6) angular, linear velocity of the point at the world's origin
    place: Array  # (n, nb, 3)
    turn: Array  # (n, nb, 3, 3)

    def points(self, body: Ints, point: Array, moved: Array) -> tuple[Array, Array]:
        """Return the places (n, m, 3) of points (m, 3) of bodies, and Jacobians (n, m, 3, nv).

        The indices `body` are -1 for points of the ground, and `moved` (m, nv) is 1.0 where a
        velocity moves a point, else 0.0.
        """
        place = (self.turn[:, body] @ point[:, :, None])[..., 0] + self.place[:, body]
        place = np.where((body < 0)[:, None], point, place)
        w, u = self.twist[:, None, :, :3], self.twist[:, None, :, 3:]
        slope = np.empty((*place.shape, self.twist.shape[1]))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):  # u + w x place
            found = w[..., j] * place[..., k, None] - w[..., k] * place[..., j, None]
            slope[:, :, i] = (found + u[..., i]) * moved
        return place, slope


def twists(packed: Packed, q: Array) -> Twists:
    """Compute the twist of each coordinate at positions (n, nq).

    A state in which all joints turn their k-th coordinate gives the k-th twist of each joint, as
    the difference of the velocities of its body and of the parent.
    """
    n, (own, parent, turn, speeds, *_) = len(q), plan(packed)
    count, each = len(speeds), np.arange(n)[:, None]
    found = motions(packed, np.tile(q, (count, 1)), np.repeat(speeds, n, axis=0),
                    np.zeros((n * count, packed.nv)))  # fmt: skip
    velocity = found.velocity.reshape(count, n, packed.nb, 6)
    ground = (parent < 0)[:, None]
    twist = velocity[turn, each, own] - np.where(ground, 0.0, velocity[turn, each, parent])
    w = velocity[turn, each, parent, :3]
    place, between = found.place[:n][:, own], found.place[:n][:, own] - found.place[:n][:, parent]
    twist[..., 3:] -= np.where(ground, 0.0, _across(w, between))
    twist[..., 3:] -= _across(twist[..., :3], place)
    return Twists(twist, found.place[:n], found.turn[:n])


def _across(a: Array, b: Array) -> Array:
    """Return cross products (..., 3), as np.cross, at a third of its time for few vectors."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return found


def torques(mech: Dynamics, q: Array, v: Array, a: Array, external: Array | None = None) -> Array:
    """Return the joint torques (n, nv) of the tree at many states, as `inverse_dynamics`."""
    packed, own = mech.packed, plan(mech.packed).own
    found, twist = motions(packed, q, v, a, external), twists(packed, q).twist
    force = found.force[:, own]  # (n, nv, 6), about the body's origin
    torque = force[..., :3] + _across(found.place[:, own], force[..., 3:])
    tau = (twist[..., :3] * torque + twist[..., 3:] * force[..., 3:]).sum(axis=2)
    tau += armature(mech) * a
    if mech._springs:
        tau -= [mech._passive(x.copy(), y.copy(), mech._rest) for x, y in zip(q, v)]
    return tau


def armature(mech: Dynamics) -> Array:
    """Return the inertia of drives (nv,) that only acts on its own coordinate."""
    found = np.zeros(mech.nv)
    for name, joint in mech.joints.items():
        body = mech.model.body(name)
        if any(body.armature):
            sizes = [SIZE[motion.kind][1] for motion in body.sequence]
            found[joint.v] = np.repeat(body.armature, sizes)
    return found


# -- inertial parameters ---------------------------------------------------------------------------


def parameters(mech: Dynamics) -> Array:
    """Return the inertial parameters of all bodies (10 nb,), by number."""
    found = []
    for body in mech._bodies:
        c, m = np.array(body.com), body.mass
        inertia = np.array(body.inertia) + m * (c @ c * np.eye(3) - np.outer(c, c))
        found.append([m, *(m * c), *inertia[ROWS, COLUMNS]])
    return np.array(found).reshape(-1)


def parameter_names(mech: Dynamics) -> list[str]:
    """Return the names of the inertial parameters, such as "mass of 'hand'"."""
    kinds = ("mass", "m c_x", "m c_y", "m c_z", "I_xx", "I_xy", "I_xz", "I_yy", "I_yz", "I_zz")
    return [f"{kind} of '{name}'" for name in mech.names for kind in kinds]


def regressor(mech: Dynamics, q: Array, v: Array, a: Array) -> Array:
    """Return Y (n, nv, 10 nb) with Y π = torques of masses, at states (n, nq), (n, nv), (n, nv)."""
    packed, n = mech.packed, len(q)
    found, twist = motions(packed, q, v, a), twists(packed, q).twist
    back = found.turn.transpose(0, 1, 3, 2)
    w, alpha = (np.einsum("nbij,nbj->nbi", back, x[..., :3])
                for x in (found.velocity, found.acceleration))  # fmt: skip
    pull = found.acceleration[..., 3:] - np.array(mech.model.gravity)
    pull = np.einsum("nbij,nbj->nbi", back, pull)
    wx, ax = _cross(w), _cross(alpha)
    of_force, of_torque = np.zeros((2, n, packed.nb, 3, PARAMETERS))
    of_force[..., 0] = pull
    of_force[..., 1:4] = ax + wx @ wx
    of_torque[..., 1:4] = -_cross(pull)
    of_torque[..., 4:] = _times(alpha) + wx @ _times(w)
    of_force, of_torque = found.turn @ of_force, found.turn @ of_torque
    of_torque += _cross(found.place) @ of_force  # about the world's origin
    y = np.einsum("njk,nbkp->njbp", twist[..., :3], of_torque)
    y += np.einsum("njk,nbkp->njbp", twist[..., 3:], of_force)
    return (y * plan(packed).carried.T[None, :, :, None]).reshape(
        n, packed.nv, PARAMETERS * packed.nb
    )


def _cross(x: Array) -> Array:
    """Return the matrices (..., 3, 3) of cross products with x (..., 3)."""
    found = np.zeros((*x.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., i, j], found[..., j, i] = -x[..., k], x[..., k]
    return found


def _times(x: Array) -> Array:
    """Return the matrices (..., 3, 6) that take six entries of an inertia I to I x."""
    found = np.zeros((*x.shape, 6))
    for entry, (i, j) in enumerate(zip(ROWS, COLUMNS)):
        found[..., i, entry] = x[..., j]
        found[..., j, entry] = x[..., i]
    return found
