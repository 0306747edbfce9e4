"""Another place for the cut of a loop: the joints between the two are turned around.

A joint that is turned around keeps its coordinates and what acts on it, and belongs to the body
that was its parent. As a body's frame stands at its joint, frames of bodies in between move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from .. import joints
from ..errors import ModelError, Problem, choices
from ..joints import PER_MOTION, JointKind
from ..rotation import Array, matrix, multiply, quaternion_of, rodrigues, rotate, unit_vector
from .body import Body
from .constraint import AlongAxes, AtPoints, Constraint, InJoints, Revolute, Rolling, Skate
from .editing import CUT, free_name, renamed
from .fields import GROUND, OfSums
from .force import Drag, Force, Spring, Wrench
from .output import OF_JOINT, Site
from .scenario import Scenario

TURNED: tuple[JointKind, ...] = ("weld", "revolute", "prismatic", "cylindrical", "spherical")
JOINT_OF: dict[str, JointKind] = {
    CUT[joint]: joint for joint in TURNED
}  # kind of a loop's constraint -> joint
ON_JOINT = (*PER_MOTION, "limits", "limit_restitution")
OPEN = 1e-6  # m, rad: a loop that does not close in the initial state
NONE: tuple[float, float, float] = (0.0, 0.0, 0.0)
Parts = Mapping[str, Sequence[Any]]


def cut_elsewhere(parts: Parts, name: str, loop: str | None) -> tuple[dict[str, Any], str]:
    """(parts, notice) of a model whose loop is cut at the joint of body `name`.

    `loop` names the constraint that closes it now, where several loops pass the body. Raises
    ModelError where a joint on the way cannot be turned around, or stands for something else too.
    """
    bodies = {body.name: body for body in parts["bodies"]}
    c, chain = _loop(parts["constraints"], bodies, name, loop)
    _check(parts, c, chain)
    at_home = poses(bodies, {}, {})
    c = _complete(c, bodies, at_home)
    if c.body != chain[0].name:
        c = _swapped(c)
    new_cut = _new_cut(chain[-1], c, [x.name for x in parts["constraints"]])
    shifts = _shifts(c, chain)
    new = _Turned(c, chain, shifts, bodies, at_home, new_cut)
    found = {
        "bodies": tuple(new.body(b) for b in parts["bodies"]),
        "constraints": tuple(
            new.cut if x.name == c.name else new.constraint(x) for x in parts["constraints"]
        ),
        "contacts": tuple(new.contact(x) for x in parts["contacts"]),
        "forces": tuple(new.force(x) for x in parts["forces"]),
        "scenarios": tuple(new.scenario(x) for x in parts["scenarios"]),
        "sites": tuple(map(new.site, parts["sites"])),
        "outputs": tuple(
            renamed(o, new.carrier) if o.kind in OF_JOINT else o for o in parts["outputs"]
        ),
    }
    moved = ", ".join(k for k, s in shifts.items() if np.abs(s).max() > 0)
    text = f"loop '{c.name}' is cut at the joint of '{name}' now, as constraint '{new_cut.name}'"
    text += f"; the frames of {moved or 'no body'} moved to their new joints"
    if JOINT_OF[c.kind] == "spherical":
        text += (
            f"; where '{c.name}' held a point is a spherical joint now, which leaves turns free "
        )
        text += (
            "that nothing may drive: give it joint='revolute' where it only turns about one axis"
        )
    return found, text


def _path(bodies: Mapping[str, Body], name: str) -> list[str]:
    """From a body to the ground, the ground left out."""
    found = []
    while name != GROUND:
        found.append(name)
        name = bodies[name].parent
    return found


def _loop(
    constraints: Sequence[Constraint], bodies: Mapping[str, Body], name: str, loop: str | None
) -> tuple[AtPoints, list[Body]]:
    """The constraint of the loop through a body, and the bodies from its end to that one."""
    found: dict[str, tuple[AtPoints, list[Body]]] = {}
    for c in constraints:
        for end, far in (c.pair, c.pair[::-1]):
            own, rest = _path(bodies, end), set(_path(bodies, far))
            if not (isinstance(c, AtPoints) and c.kind in JOINT_OF):
                continue
            if name in own and name not in rest:
                found[c.name] = (c, [bodies[k] for k in own[: own.index(name) + 1]])
    if loop is not None and loop in found:
        return found[loop]
    where = f"body '{name}'"
    if not found:
        text = (
            f"no loop that a joint could close passes it; such constraints are {choices(JOINT_OF)}"
        )
        raise ModelError(Problem(where, "loop", text))
    if loop is not None or len(found) > 1:
        given = f"; given '{loop}'" if loop is not None else ""
        text = f"name the loop that is to be cut there: {choices(found)}{given}"
        raise ModelError(Problem(where, "loop", text))
    return next(iter(found.values()))


def _swapped(c: AtPoints) -> AtPoints:
    """The same tie, seen from its other body."""
    ends: dict[str, Any] = {"body": c.other, "other": c.body}
    ends |= {"point": c.other_point, "other_point": c.point}
    if isinstance(c, AlongAxes):
        ends |= {"axis": c.other_axis, "other_axis": c.axis}
    return c.unchecked_copy(ends)


def _check(parts: Parts, c: AtPoints, chain: list[Body]) -> None:
    """What keeps a loop from being cut elsewhere, in a sentence."""
    last = chain[-1]
    where = f"body '{last.name}'"
    for body in chain:
        same = all(axis == body.axes[0] for axis in body.axes)
        if body.joint not in TURNED or not same:
            text = f"a {body.joint} joint is not turned around; choose one of {choices(TURNED)}"
            raise ModelError(Problem(f"body '{body.name}'", "joint", text))
    if any(any(getattr(last, field) or ()) for field in ON_JOINT if field != "rest"):
        text = "its joint has a spring, damper, friction, armature or limits, which a constraint "
        raise ModelError(Problem(where, "", f"{text}does not take; cut at another body"))
    every = (*parts["forces"], *(f for s in parts["scenarios"] for f in s.forces))
    balls = {body.name for body in chain if body.joint == "spherical"} | {last.name}
    for f in every:
        hit = balls.intersection(f.touches)
        if isinstance(f, OfSums) and hit:
            text = f"force '{f.name}' acts on the joint of '{min(hit)}'; cut at another body"
            raise ModelError(Problem(where, "", text))
    for x in parts["constraints"]:
        if isinstance(x, InJoints) and not balls.isdisjoint(x.touches):
            text = f"constraint '{x.name}' acts on a joint that would go; cut at another body"
            raise ModelError(Problem(where, "", text))
    for s in parts["scenarios"]:
        without = s.constraints is not None and c.name not in s.constraints
        if without or any(x.constraint == c.name for x in s.switches):
            text = f"scenario '{s.name}' opens loop '{c.name}', which would be joints of the tree"
            raise ModelError(Problem(where, "", f"{text}; leave it cut where it is"))
    if not c.active:
        text = f"loop '{c.name}' is not active, and would be joints of the tree; activate it"
        raise ModelError(Problem(where, "", text))


def _complete(c: AtPoints, bodies: Mapping[str, Body], at_home: Mapping[str, Pose]) -> AtPoints:
    """Points and axes of both ends; refused where they do not meet in the initial state."""
    a, b = at_home[c.body], at_home[c.other]
    point, other_point = c.point or bodies[c.body].tip_point, c.other_point
    if other_point is None:
        other_point = _tuple(b.rotation.T @ (a.place(point) - b.position))
    apart, askew = a.place(point) - b.place(other_point), 0.0
    update: dict[str, Any] = {"point": point, "other_point": other_point}
    if isinstance(c, AlongAxes):
        axis, other = c.axis, c.other_axis
        if axis is None:
            axis = (0.0, 0.0, 1.0) if other is None else _tuple(a.rotation.T @ b.rotation @ other)
        if other is None:
            other = _tuple(b.rotation.T @ a.rotation @ axis)
        update |= {"axis": _tuple(unit_vector(axis)), "other_axis": _tuple(unit_vector(other))}
        along = a.rotation @ unit_vector(axis)
        askew = float(np.linalg.norm(np.cross(along, b.rotation @ unit_vector(other))))
        if not isinstance(c, Revolute):
            apart = apart - (apart @ along) * along
    gap = max(float(np.abs(apart).max()), askew)
    if gap > OPEN:
        text = f"does not close in the initial state, by {gap:.3g}; give the bodies the q of an "
        raise ModelError(Problem(f"constraint '{c.name}'", "", f"{text}assembled state first"))
    return c.unchecked_copy(update)


def _tuple(x: Any) -> tuple[float, float, float]:
    a, b, c = np.asarray(x, dtype=float).tolist()
    return (a, b, c)


def _shifts(c: AtPoints, chain: list[Body]) -> dict[str, Array]:
    """How far the origin of each body goes, in its axes: to the joint that it gets."""
    places = [c.point or NONE, *(body.link for body in chain)]
    return {body.name: np.array(place) for body, place in zip(chain, places)}


def _new_cut(last: Body, c: AtPoints, taken: Sequence[str]) -> Constraint:
    """What is left of the joint at which the loop is cut; its point is still in the old frame."""
    taken = [name for name in taken if name != c.name]
    given: dict[str, Any] = {"point": NONE, "other_point": last.link}
    if last.joint in ("revolute", "prismatic", "cylindrical"):
        given |= {"axis": last.axes[0], "other_axis": rotate(last.rotation, last.axes[0])}
    name = free_name(f"{last.name}-{last.parent}", taken)
    return Constraint(name=name, kind=CUT[last.joint], body=last.name, other=last.parent, **given)


class _Turned:
    """The parts of a model after its loop is cut elsewhere."""

    def __init__(
        self,
        c: AtPoints,
        chain: list[Body],
        shifts: Mapping[str, Array],
        bodies: Mapping[str, Body],
        at_home: Mapping[str, Pose],
        cut: Constraint,
    ):
        self.c, self.chain, self.shifts = c, chain, shifts
        self.bodies, self.at_home = bodies, at_home
        self.axis = c.axis or NONE if isinstance(c, AlongAxes) else NONE
        self.joint: JointKind = JOINT_OF[c.kind]
        names = [body.name for body in chain]
        self.below = dict(zip(names[1:], chain))  # whose joint a body gets
        self.carrier = dict(pairwise(names))  # the body that gets a body's joint
        self.cut = self.constraint(cut)

    def moved(self, name: str, point: Any) -> Any:
        """A point of a body in its new frame."""
        if point is None or name not in self.shifts:
            return point
        return _tuple(np.array(point) - self.shifts[name])

    def body(self, old: Body) -> Body:
        """With its new frame, and its new joint where it is between the two places."""
        fields: dict[str, Any] = {"com": self.moved(old.name, old.com)}
        fields["tip"] = self.moved(old.name, old.tip)
        if old.shapes:
            fields["shapes"] = tuple(
                s.unchecked_copy({"position": self.moved(old.name, s.position)}) for s in old.shapes
            )
            fields["shape"] = fields["shapes"][0]
        if old.name == self.c.body:
            fields |= self._first(old)
        elif old.name in self.below:
            fields |= self._turned(self.below[old.name])
        else:
            fields["link"] = self.moved(old.parent, old.link)
            return old.unchecked_copy(fields)
        kept = {"name": old.name, "mass": old.mass, "inertia": old.inertia}
        return Body(**kept, **fields)

    def _first(self, old: Body) -> dict[str, Any]:
        """The joint in place of the loop's constraint: at 0 in the initial state."""
        a, b = self.at_home[old.name], self.at_home[self.c.other]
        fields: dict[str, Any] = {"parent": self.c.other, "joint": self.joint}
        fields["link"] = self.c.other_point
        fields["rotation"] = _quaternion(b.rotation.T @ a.rotation)
        if count := len(joints.DEFAULT[self.joint]):
            if self.joint != "spherical":
                fields["axes"] = (self.axis,) * count
            fields["q"], fields["v"] = self._coordinates({}, {})
        return fields

    def _coordinates(self, q: Mapping[str, Any], v: Mapping[str, Any]) -> tuple[Any, Any]:
        """q and v of the joint in place of the loop's constraint, in a state of the old model."""
        now = poses(self.bodies, q, v)
        a, b = now[self.c.body], now[self.c.other]
        home = self.at_home[self.c.other].rotation.T @ self.at_home[self.c.body].rotation
        point, other = np.array(self.c.point), np.array(self.c.other_point)
        return coordinate(self.joint, a, b, home, np.array(self.axis), point, other)

    def _turned(self, below: Body) -> dict[str, Any]:
        """The joint of the body that was carried, from its other side."""
        back = _conjugate(below.rotation)
        fields: dict[str, Any] = {"parent": below.name, "joint": below.joint, "rotation": back}
        fields["link"] = _tuple(-self.shifts[below.name])
        if below.joint == "spherical":
            fields["q"] = self._back("q", below, below.q)
            fields["v"] = self._back("v", below, below.v)
        elif below.joint != "weld":
            along = (_tuple(-np.array(rotate(below.rotation, axis))) for axis in below.axes)
            fields |= {"axes": tuple(along), "q": below.q, "v": below.v}
        return fields | {
            field: getattr(below, field) for field in ON_JOINT if below.joint != "weld"
        }

    def _back(self, field: str, below: Body, value: Any, q: Any = None) -> Any:
        """q or v of a joint seen from its other side."""
        if below.joint != "spherical":
            return value
        if field == "q":
            return multiply(_conjugate(below.rotation), multiply(_conjugate(value), below.rotation))
        q = below.q if q is None else q
        return _tuple(-(matrix(multiply(q, below.rotation)).T @ np.array(value)))

    def _joint(self, name: str) -> str:
        return self.carrier.get(name, name)

    def constraint(self, c: Constraint) -> Constraint:
        """With points in the new frames, and joints where they are now."""
        if isinstance(c, InJoints):
            return renamed(c, self.carrier)
        update: dict[str, Any] = {}
        if isinstance(c, (AtPoints, Skate)):
            update["point"] = self.moved(c.body, c.point)
        if isinstance(c, AtPoints):
            at_middle = isinstance(c, Rolling) and c.other_point is None and c.other in self.shifts
            update["other_point"] = self.moved(c.other, NONE if at_middle else c.other_point)
        return c.unchecked_copy(update)

    def contact(self, c: Any) -> Any:
        """With its points in the new frame."""
        return c.unchecked_copy({"points": tuple(self.moved(c.body, p) for p in c.points)})

    def site(self, s: Site) -> Site:
        """With its origin in the new frame."""
        return s.unchecked_copy({"point": self.moved(s.body, s.point)})

    def force(self, f: Force) -> Force:
        """With points in the new frames, and on the joint that it acted on."""
        if isinstance(f, OfSums):
            return renamed(f, self.carrier)
        update: dict[str, Any] = {}
        if isinstance(f, Wrench) and f.body in self.shifts:
            update["point"] = self.moved(f.body, f.point or NONE)
        if isinstance(f, Drag) and f.point is not None:
            update["point"] = self.moved(f.body, f.point)
        if isinstance(f, Spring):
            update["point"] = self.moved(f.body, f.point)
            if f.other in self.shifts:
                update["other_point"] = self.moved(f.other, f.other_point or NONE)
        return f.unchecked_copy(update)

    def scenario(self, s: Scenario) -> Scenario:
        """Initial states of the joints where they are now; the new constraint's name."""
        states: dict[str, dict[str, Any]] = {"q": {}, "v": {}}
        for field, given in (("q", s.q), ("v", s.v)):
            for name, value in given.items():
                if name in self.carrier:
                    below = self.bodies[name]
                    value = self._back(field, below, value, s.q.get(name))
                if name != self.chain[-1].name:
                    states[field][self._joint(name)] = value
        if self.joint != "weld" and (s.q or s.v):
            q, v = self._coordinates(s.q, s.v)
            states["q"][self.c.body], states["v"][self.c.body] = q, v
        names = s.constraints and tuple(
            self.cut.name if name == self.c.name else name for name in s.constraints
        )
        forces = tuple(map(self.force, s.forces))
        return s.unchecked_copy({**states, "constraints": names, "forces": forces})


def _conjugate(q: Sequence[float]) -> tuple[float, float, float, float]:
    w, x, y, z = q
    return (w, -x, -y, -z)


def _quaternion(R: Array) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat().tolist()
    return (w, x, y, z)


# -- where the bodies are, and how they move -------------------------------------------------------


@dataclass(frozen=True)
class Pose:
    """A body frame in the world, and its velocity."""

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3)
    velocity: Array  # (3,) of the origin [m/s]
    spin: Array  # (3,) [rad/s]

    def place(self, point: Any) -> Array:
        """A point of the body in the world [m]."""
        return self.position + self.rotation @ np.asarray(point, dtype=float)

    def speed(self, point: Any) -> Array:
        """Velocity of a point of the body [m/s]."""
        return self.velocity + np.cross(self.spin, self.place(point) - self.position)


STILL = Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


def poses(
    bodies: Mapping[str, Body], q: Mapping[str, Any], v: Mapping[str, Any]
) -> dict[str, Pose]:
    """Of all bodies and the ground; q and v by name, the bodies' own where they are left out."""
    found = {GROUND: STILL}

    def pose(name: str) -> Pose:
        if name not in found:
            body = bodies[name]
            found[name] = _carried(
                pose(body.parent), body, q.get(name, body.q), v.get(name, body.v)
            )
        return found[name]

    for name in bodies:
        pose(name)
    return found


def home_poses(bodies: Sequence[Body]) -> Array:
    """(nb, 7) position and quaternion of each body in the initial state; parents come first."""
    found = poses({body.name: body for body in bodies}, {}, {})
    rows = [(*found[b.name].position, *quaternion_of(found[b.name].rotation)) for b in bodies]
    return np.array(rows).reshape(-1, 7)


def _carried(parent: Pose, body: Body, q: Any, v: Any) -> Pose:
    """A body on its joint."""
    R, home = parent.rotation, matrix(body.rotation)
    arm = R @ np.array(body.link)
    x, u, w = parent.position + arm, parent.velocity + np.cross(parent.spin, arm), parent.spin
    i = j = 0
    for motion in body.sequence:
        nq, nv = joints.SIZE[motion.kind]
        a, b = np.array(q[i : i + nq], dtype=float), np.array(v[j : j + nv], dtype=float)
        axis = R @ home @ unit_vector(motion.axis)
        if motion.kind == "translate":
            x, u = x + axis * a[0], u + np.cross(w, axis * a[0]) + axis * b[0]
        elif motion.kind == "rotate":
            w = w + axis * b[0]
            R = rodrigues(axis, float(a[0])) @ R
        else:
            if motion.kind == "free":
                x, u = x + R @ a[:3], u + np.cross(w, R @ a[:3]) + R @ b[3:]
            w = w + R @ b[:3]
            R = R @ matrix(a[-4:].tolist())
        i, j = i + nq, j + nv
    return Pose(x, R @ home, u, w)


def coordinate(
    joint: str, a: Pose, b: Pose, home: Array, axis: Array, point: Array, other: Array
) -> tuple[Any, Any]:
    """(q, v) of a joint that carries body a on b: `point` of a at `other` of b.

    `home` is the rotation of a against b, and `axis` that of a, where q is 0.
    """
    from scipy.spatial.transform import Rotation

    turned = b.rotation.T @ a.rotation
    spin = a.spin - b.spin
    if joint == "spherical":
        x, y, z, w = Rotation.from_matrix(turned @ home.T).as_quat().tolist()
        return (w, x, y, z), tuple((b.rotation.T @ spin).tolist())
    if joint == "weld":
        return (), ()
    along = a.rotation @ axis
    angle = float(Rotation.from_matrix(home.T @ turned).as_rotvec() @ axis)
    apart = float(along @ (a.place(point) - b.place(other)))
    at_a = b.velocity + np.cross(b.spin, a.place(point) - b.position)
    turn, slide = float(along @ spin), float(along @ (a.speed(point) - at_a))
    if joint == "cylindrical":
        return (angle, apart), (turn, slide)
    return ((angle,), (turn,)) if joint == "revolute" else ((apart,), (slide,))
