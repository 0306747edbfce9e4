"""States: body motion, sensor readings, distances, and states of edited models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import joints
from ..engine import layout as at
from ..engine.records import table
from ..engine.tree import bodies as kernels
from ..engine.tree import sensors
from ..fields import GROUND, fields_of
from ..model import Body, Model
from ..model.output import OF_CONTACT, OF_JOINT, OF_LOAD, OF_SUBTREE, READINGS, Output
from ..packing import Array, Ints, System
from ..packing.packed import Packed
from ..paper import bodies_of, q_slices
from ..portable import same
from ..rotation import unit
from ..tolerances import EPS
from ..topology import Topology

REST = float(np.sqrt(EPS))  # relative change below which a coordinate is at rest


class Carried(NamedTuple):
    """A state transferred from one mechanism to another."""

    q: Array  # (nq,)
    v: Array  # (nv,)
    reset: tuple[str, ...]  # joints at home: the other has none of this name and kind


def carried(new: Packed, old: Packed, q: Array, v: Array) -> Carried:
    """Transfer the state (q, v) from `old` to `new`, with new joints at home."""
    new_q, new_v = new.system.q.copy(), new.system.v.copy()
    theirs, reset = old.joints, []
    for name, joint in new.joints.items():
        before = theirs.get(name)
        if before is None or before.kinds != joint.kinds:
            reset.append(name)
            continue
        new_q[joint.q] = q[before.q]
        new_v[joint.v] = v[before.v]
    return Carried(new_q, new_v, tuple(reset))


def with_initial(model: Model, q: Array, v: Array | None = None) -> Model:
    """Return the model with q (nq,), and v (nv,) if given, as initial state. Raises PgraphError."""
    top = Topology.of(model)
    bodies = bodies_of(model, top)
    ends = np.cumsum([len(body.v) for body in bodies])
    found = {}
    for body, place, end in zip(bodies, q_slices(bodies), ends):
        speeds = body.v if v is None else tuple(v[end - len(body.v) : end].tolist())
        state = {"q": tuple(q[place].tolist()), "v": speeds}
        same = (body.q, body.v) == (state["q"], state["v"])
        found[body.name] = body if same else Body(**{**fields_of(body), **state})
    return model.replace(bodies=tuple(found[body.name] for body in model.bodies))


def angles(p: Array, q: Array) -> Array:
    """Compute the angles between unit quaternions [rad] from |p - q| = 2 sin(a/4), accurate if
    small.

    p and -p are the same rotation.
    """
    apart = np.minimum(np.linalg.norm(p - q, axis=-1), np.linalg.norm(p + q, axis=-1))
    return 4.0 * np.arcsin(np.clip(apart / 2.0, 0.0, 1.0))


def differences(packed: Packed, q: Array, other: Array) -> tuple[Array, Array]:
    """Compute ((n,) largest rotation [rad], (n,) largest translation [m]) between motions q and
    `other`.

    Motions have shape (n, nq), the other one or (1, nq). Attitudes differ by an angle.
    """
    turning, sliding = packed.by_unit
    apart = np.abs(q - other)
    turned = apart[:, turning].max(axis=1, initial=0.0)
    for _, i, _ in packed.quaternions:
        turned = np.maximum(turned, angles(q[:, i : i + 4], other[:, i : i + 4]))
    return turned, apart[:, sliding].max(axis=1, initial=0.0)


def ranges_of_motion(packed: Packed, q: Array) -> tuple[float, float, float]:
    """Find the largest rotation [rad] and translation [m] of any joint from its start in a motion
    q (n, nq), and the size of the motion, which is the larger one.

    Coordinates are considered at rest if they change by less than the rounding error of the length
    of the mechanism, which is the least size.
    """
    turned, moved = differences(packed, q, q[:1])
    most = float(turned.max(initial=0.0)), float(moved.max(initial=0.0))
    return *most, max(*most, REST * packed.length)


def sizes_of_states(packed: Packed, x: Array) -> Array:
    """Compute the sizes (nx,) by which errors of states of controls x (n, nx) are judged.

    They are the ranges of the states, or 1 for a quantity whose usual size is 1, such as an
    activation. A state is considered at rest if its change is within rounding error of its value or
    of the length of the mechanism, as in `ranges_of_motion`.
    """
    least = np.maximum(np.abs(x).max(axis=0, initial=0.0), packed.length)
    usual = np.array([own.quantity is not None for _, _, own in packed.model.states], float)
    return np.maximum.reduce((np.ptp(x, axis=0) if len(x) else usual, REST * least, usual))


class BodyMotion(NamedTuple):
    """The motion of all body origins in world axes, with one row per body number."""

    pose: Array  # (..., nb, 7) x y z [m], w x y z
    velocity: Array  # (..., nb, 6) angular [rad/s], linear [m/s]
    acceleration: Array  # (..., nb, 6) angular [rad/s^2], linear [m/s^2]
    force: Array  # (..., nb, 6) torque [N m], force [N] that each joint passes on to its body

    def __eq__(self, other: object) -> bool:
        """Compare the arrays, treating nan as equal to nan."""
        return isinstance(other, tuple) and same(tuple(self), other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = None  # pyright: ignore[reportAssignmentType]


def bodies_over(system: System, q: Array, v: Array, vdot: Array, external: Array) -> BodyMotion:
    """Compute body motion and joint forces (checklist B18) of n states with loads (n, nb, 6)."""
    n, nb = len(q), len(system.bodies_i) - 1
    position, rotation = np.empty((n, nb, 3)), np.empty((n, nb, 9))
    velocity, acceleration, force = (np.empty((n, nb, 6)) for _ in range(3))
    work = np.zeros((len(system.rows), at.WORK))
    states = map(np.ascontiguousarray, (q, v, vdot))
    out = (position, rotation, velocity, acceleration, force)
    kernels.motion_and_forces(*system[:4], *states, external, work, *out)
    pose = np.empty((n, nb, 7))
    sensors.as_quaternions(position, rotation, pose)
    return BodyMotion(pose, velocity, acceleration, force)


def mass_points(bodies: Sequence[Body], motion: BodyMotion) -> tuple[Array, Array, Array, Array]:
    """Return masses, centres of mass, their velocities, and angular momenta I ω by body number."""
    mass = np.array([b.mass for b in bodies])
    turn = motion.pose[..., 3:]
    arm = turned(turn, np.array([b.com for b in bodies]).reshape(-1, 3))
    omega = motion.velocity[..., :3]
    back = turn * np.array([1.0, -1.0, -1.0, -1.0])
    inertia = np.array([b.inertia for b in bodies]).reshape(-1, 3, 3)
    spin = turned(turn, np.einsum("bij,...bj->...bi", inertia, turned(back, omega)))
    velocity = motion.velocity[..., 3:] + np.cross(omega, arm)
    return mass, motion.pose[..., :3] + arm, velocity, spin


def shifted(wrench: Array, arm: Array) -> Array:
    """Return φᵀ F (..., 6) of eq. (12) for wrenches [torque, force] applied at the offsets `arms`
    (..., 3)."""
    force = wrench[..., 3:]
    return np.concatenate((wrench[..., :3] + np.cross(arm, force), force), axis=-1)


def turned(q: Array, x: Array) -> Array:
    """Rotate the vectors x (..., 3) by unit quaternions (..., 4) [w, x, y, z]."""
    w, u = q[..., :1], q[..., 1:]
    cross = np.cross(u, x)
    return x + 2 * (w * cross + np.cross(u, cross))


class Sensors:
    """The outputs of a model: a kernel table, and those of several bodies and of contacts."""

    def __init__(self, packed: Packed, model: Model):
        """Build the table. `loads`: outputs read joint forces. `moves`: they read bodies."""
        wanted, sites = model.outputs, {s.name: s for s in model.sites}
        self.gravity = np.array(model.gravity)
        self.bodies = [model.body(name) for name in packed.topology.names]
        self._subtrees: list[tuple[int, int, Ints]] = []  # column, kind, numbers of bodies
        self.touches: list[tuple[int, int]] = []  # column, index of a body that contacts push
        self.table, self._spans, self.width = table(sensors.SENSOR, len(wanted)), [], 0
        for o, one in zip(wanted, self.table):
            one["kind"], one["first"] = list(READINGS).index(o.kind), self.width
            if o.kind in OF_JOINT:
                one["entry"] = _entry(packed, model, o)
            else:
                site = sites.get(o.at)
                body = o.at if site is None else site.body
                one["body"] = 0 if body == GROUND else packed.topology.number(body)
                one["point"] = (0.0, 0.0, 0.0) if site is None else site.point
                one["turn"] = (1.0, 0.0, 0.0, 0.0) if site is None else unit(site.rotation)
            self._spans.append((o.name, self.width, self.width + len(o.reading.parts)))
            if o.kind in OF_SUBTREE:
                carried = _carried_by(packed, int(one["body"]))
                self._subtrees.append((self.width, OF_SUBTREE.index(o.kind), carried))
            if o.kind in OF_CONTACT:
                self.touches.append((self.width, int(one["body"]) - 1))
            self.width += len(o.reading.parts)
        self.table = self.table[np.array([o.kind not in OF_CONTACT for o in wanted], dtype=bool)]
        self.moves = any(o.kind not in (*OF_JOINT, *OF_CONTACT) for o in wanted)
        self.loads = any(o.kind in OF_LOAD for o in wanted)

    def read(self, q: Array, v: Array, motion: BodyMotion, pushes: Array) -> Array:
        """Return the readings (n, width) in n states (n, nq), (n, nv).

        `pushes` are the wrenches of contacts on bodies (n, nb, 6), or empty without contacts.
        """
        out = np.empty((len(q), self.width))
        sensors.read_sensors(self.table, self.gravity, q, v, *motion, out)
        points = mass_points(self.bodies, motion) if self._subtrees else None
        for column, kind, own in self._subtrees:
            out[:, column : column + 3] = of_subtree(points, own)[kind]
        for column, b in self.touches:
            out[:, column] = np.linalg.norm(pushes[:, b, 3:], axis=1) if pushes.size else 0.0
        return out

    def by_name(self, read: Array) -> dict[str, Any]:
        """Return {name: (...,), (..., 3) or (..., 4)} from the readings (..., width)."""
        return {name: read[..., a] if b == a + 1 else read[..., a:b] for name, a, b in self._spans}


def of_subtree(points: Any, own: Ints) -> tuple[Array, Array, Array]:
    """Return the centre of mass of some bodies, its velocity, and the angular momentum about it.

    `points` are those of `mass_points`. Without mass, the results are those of the mean body.
    """
    mass, (place, velocity, spin) = points[0][own], (x[:, own] for x in points[1:])
    share = mass / mass.sum() if mass.any() else np.full(len(mass), 1.0 / max(len(mass), 1))
    centre, speed = (np.einsum("b,nbi->ni", share, x) for x in (place, velocity))
    around = np.cross(place - centre[:, None], velocity - speed[:, None])
    return centre, speed, np.einsum("b,nbi->ni", mass, around) + spin.sum(axis=1)


def _carried_by(packed: Packed, number: int) -> Ints:
    """Return the indices of a body, given by its number from 1, and of all that it carries.

    The ground, 0, carries all.
    """
    found, parent = {number}, packed.topology.parent.tolist()
    for k, p in enumerate(parent, start=1):  # parents come first
        if p in found:
            found.add(k)
    return np.array(sorted(found - {0}), dtype=np.int64) - 1


def _entry(packed: Packed, model: Model, o: Output) -> int:
    """Return the index of a joint coordinate in q or v."""
    joint = packed.joints[o.at]
    if o.kind == "joint_velocity":
        return joint.v.start + o.coordinate
    place = joints.places(model.body(o.at).sequence)[o.coordinate]
    assert place is not None
    return joint.q.start + place


def no_motion(n: int) -> BodyMotion:
    """Create an empty body motion for n states, for outputs that only read joints."""
    return BodyMotion(np.empty((n, 0, 7)), *(np.empty((n, 0, 6)) for _ in range(3)))
