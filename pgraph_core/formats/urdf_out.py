"""The URDF writer, which writes the tree as links and joints, gears as mimic joints and loops as
<loop_joint>s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..dynamics import Dynamics, model_of
from ..errors import FileError, ModelError, Problem, choices, counted, explained
from ..fields import GROUND
from ..joints import KINDS, home
from ..model import Actuator, Body, Constraint, Gear, Model, Motor, Shape
from ..model.files import gathered, write_atomic
from ..rotation import frame_of, quaternion_of, rotate, unit, unit_vector
from ..shapes import kind_of
from .conversion import NO_LIMIT, Report, at_origin, named, names_beside, tell_beams, unused
from .urdf import LOOPS, WORLD

GREY = (0.5, 0.5, 0.5)  # colour of transparent shapes without a colour of their own

TYPES = {"rotate": "revolute", "translate": "prismatic", "free": "floating"}
TYPE_OF_LOOP = {kind: type_ for type_, kind in reversed(LOOPS.items())}


@explained
def write_urdf(model: Model | Dynamics, path: str | Path) -> Report:
    """Write a model to a URDF file.

    Meshes from other folders are copied to `meshes` next to the file.

    Parameters
    ----------
    model : Model or Mechanism
        The model.
    path : str or path
        The file, with the suffix .urdf.

    Returns
    -------
    Report
        Elements that are not supported by the format.

    Raises
    ------
    FileError
        If the file cannot be written.
    ModelError
        If the model has a ball joint, which URDF does not support. No file is written in this case.
    """
    whole: Model = model_of("write_urdf", model).expanded
    path = named(path, ".urdf")
    if not path.parent.is_dir():
        raise FileError(Problem(str(path), "", f"the folder {path.parent} does not exist"))
    found = [
        Problem(f"body '{b.name}'", "joint", f"is a {kind} motion, which URDF does not support")
        for b in whole.bodies
        for kind in sorted({kind for kind, _ in b.motions} - {*TYPES})
    ]
    if found:
        raise ModelError(found)
    writer = _Writer(whole, gathered(whole.bodies, path.parent), path.name)
    tell_beams(writer.report, whole)
    write_atomic(path, writer.text())
    return writer.report


class Tag:
    """An XML element under construction."""

    def __init__(self, tag: str, /, **attributes: Any):
        self.tag, self.children = tag, list[Tag]()
        self.attributes = {key.rstrip("_"): _text(value) for key, value in attributes.items()}

    def set(self, **attributes: Any) -> Tag:
        """With more attributes."""
        self.attributes |= {key: _text(value) for key, value in attributes.items()}
        return self

    def add(self, *children: Tag | None) -> Tag:
        """With more children."""
        self.children += [child for child in children if child is not None]
        return self

    def lines(self, depth: int = 0) -> list[str]:
        """Return the element as lines of text."""
        from xml.sax.saxutils import quoteattr  # imports the client of HTTP

        space = "  " * depth
        head = "".join(f" {key}={quoteattr(value)}" for key, value in self.attributes.items())
        if not self.children:
            return [f"{space}<{self.tag}{head}/>"]
        inside = [line for child in self.children for line in child.lines(depth + 1)]
        return [f"{space}<{self.tag}{head}>", *inside, f"{space}</{self.tag}>"]


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, (int, float)):
        return repr(float(value))
    return " ".join(repr(float(x)) for x in value)


class _Writer:
    def __init__(self, model: Model, bodies: Sequence[Body], name: str):
        self.model, self.bodies, self.report = model, bodies, Report(name)
        self.motors = {f.body: f for f in model.forces if isinstance(f, Motor) and _plain(f)}
        self.gears: dict[str, Gear] = {}
        for c in model.constraints:
            if isinstance(c, Gear) and c.active and self._single(c.body) and self._single(c.other):
                self.gears.setdefault(c.body, c)
        self.contents = {b.name: [*self._contents(b)] for b in bodies}
        self.root = self._root()
        self.link_of = self._link_names()
        self.links = {WORLD, *self.link_of.values()}
        self.joint_names = self._names()
        self.joints = {*self.joint_names.values()}

    def _root(self) -> str | None:
        """Return the body that is the root link: the only one at the ground, welded to its origin.

        Without one, the root is an empty link for the ground.
        """
        roots = [b for b in self.bodies if b.parent == GROUND]
        return roots[0].name if len(roots) == 1 and at_origin(roots[0]) else None

    def _link_names(self) -> dict[str, str]:
        """Return the links of the bodies. An empty root link of the name WORLD is the ground."""
        if WORLD not in self.contents or (self.root == WORLD and self.contents[WORLD]):
            return {name: name for name in self.contents}
        found = names_beside(WORLD, self.contents)
        text = f'is the link "{found[WORLD]}", because the link "{WORLD}" is the ground'
        self.report.add("converted", f"body '{WORLD}'", text, part=WORLD)
        return found

    def _single(self, name: str) -> bool:
        return name in self.model.row and len(self.model.body(name).motions) == 1

    def _names(self) -> dict[str, str]:
        """Return the joint names, from the motor or gear if there is one, else from the body."""
        found: dict[str, str] = {}
        for body in self.model.bodies:
            part = self.motors.get(body.name) or self.gears.get(body.name)
            name = part.name if part else f"{body.name} joint"
            found[body.name] = unused(name, found.values())
        return found

    def text(self) -> str:
        """The file."""
        robot = Tag("robot", name=self.model.name)
        if self.root is None:
            robot.add(Tag("link", name=WORLD))
        for body in self.bodies:
            robot.add(*self._chain(body))
        for c in self.model.constraints:
            robot.add(self._loop(c))
        self._left_out()
        self.report.add("read", "", f"{len(self.bodies)} links written")
        return "\n".join(['<?xml version="1.0"?>', *robot.lines(), ""])

    # -- links and joints ------------------------------------------------------------------------

    def _contents(self, body: Body) -> Iterator[Tag]:
        """Yield the inertia and the shapes of a body."""
        if body.mass or any(map(any, body.inertia)):
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
            moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
            inertial = Tag("inertial").add(Tag("origin", xyz=body.com))
            yield inertial.add(Tag("mass", value=body.mass), Tag("inertia", **moments))
        for shape in body.shapes:
            for tag in ("visual", "collision"):
                if shape.role in (tag, "both"):
                    yield from self._solids(tag, shape, body.name)

    def _chain(self, body: Body) -> list[Tag]:
        """Return the link of a body, its joint, and massless links between multiple motions."""
        link = Tag("link", name=self.link_of[body.name]).add(*self.contents[body.name])
        if body.name == self.root:
            return [link]
        parent = WORLD if body.parent == GROUND else self.link_of[body.parent]
        motions = body.motions or ((None, None),)
        tags: list[Tag] = []
        for k, (kind, axis) in enumerate(motions):
            last = k == len(motions) - 1
            child, name = self.link_of[body.name], self.joint_names[body.name]
            if not last:
                child, name = (
                    _taken(f"{x}/{k + 1}", known)
                    for x, known in ((child, self.links), (name, self.joints))
                )
            joint = Tag("joint", name=name, type=_type(body, k))
            if k == 0:
                joint.add(Tag("origin", xyz=body.link, rpy=rpy_of(body.rotation)))
            joint.add(Tag("parent", link=parent), Tag("child", link=child))
            if kind is not None and KINDS[kind].directed:
                joint.add(Tag("axis", xyz=axis), *self._physics(body, k, last))
            if not last:
                tags.append(Tag("link", name=child))
            tags.append(joint)
            parent = child
        if len(motions) > 1:
            text = f"its {len(motions)} motions are joints with links without mass between them"
            self.report.add("converted", f"body '{body.name}'", text, part=body.name)
        return [*tags, link]

    def _physics(self, body: Body, k: int, last: bool) -> list[Tag]:
        found: list[Tag] = []
        pair = body.limits[k] if body.limits else None
        motor = self.motors.get(body.name) if last else None
        effort = motor.torque_limit if motor else None
        low, high = pair or (None, None)
        if pair and (low is None or high is None):
            where = f"body '{body.name}'"
            self.report.add("approximated", where, "an open end of the limits is 1e9 away")
        if pair or effort or body.speed_limit[k] or _type(body, k) == "prismatic":
            ends = {} if not pair else {
                "lower": -NO_LIMIT if low is None else low,
                "upper": NO_LIMIT if high is None else high,
            }  # fmt: skip
            found.append(
                Tag("limit", **ends, effort=effort or 0.0, velocity=body.speed_limit[k] or NO_LIMIT)
            )
        if body.damping[k] or body.friction[k]:
            found.append(Tag("dynamics", damping=body.damping[k], friction=body.friction[k]))
        gear = self.gears.get(body.name)
        if gear is not None and last:
            leader = self.joint_names[gear.other]
            found.append(Tag("mimic", joint=leader, multiplier=gear.ratio, offset=gear.offset))
        return found

    def _solids(self, tag: str, shape: Shape, name: str) -> list[Tag]:
        """Return one <visual> or <collision>, or a cylinder and two spheres for a capsule."""
        parts = kind_of(shape).urdf(shape, drawn=tag == "visual")
        if not parts:
            self._out(f"body '{name}'", f"a {shape.kind}", name, acts=tag == "collision")
        else:
            tell_taper(self.report, name, shape)
        tags: list[Tag] = []
        for solid, attributes, z in parts:
            place = np.array(shape.position) + rotate(shape.rotation, (0.0, 0.0, z))
            one = Tag(tag).add(Tag("origin", xyz=place, rpy=rpy_of(shape.rotation)))
            one.add(Tag("geometry").add(Tag(solid, **attributes)))
            if tag == "visual" and (shape.colour is not None or shape.opacity < 1.0):
                rgba = (*(shape.colour or GREY), shape.opacity)
                material = Tag("material", name=f"colour {_text(rgba)}")
                one.add(material.add(Tag("color", rgba=rgba)))
            tags.append(one)
        return tags

    # -- loops -----------------------------------------------------------------------------------

    def _loop(self, c: Constraint) -> Tag | None:
        if self.gears.get(c.body) is c:
            return None
        where, other = f"constraint '{c.name}'", getattr(c, "other", GROUND)
        if c.kind not in TYPE_OF_LOOP or not c.active or other == GROUND:
            text = f"a {c.kind} constraint" + ("" if c.active else " that is not active")
            to_ground = " to the ground" if c.kind in TYPE_OF_LOOP and other == GROUND else ""
            self._out(where, f"{text}{to_ground}", c.name, acts=c.active)
            return None
        ends = Placed(self.model, c)
        turn, other_turn = np.eye(3), np.eye(3)
        if ends.axis is not None and ends.other_axis is not None:
            turn, other_turn = (
                np.roll(frame_of(unit_vector(x)), 1, axis=1) for x in (ends.axis, ends.other_axis)
            )  # maps x to the axis
        one = Tag("loop_joint", name=c.name, type=TYPE_OF_LOOP[c.kind])
        for side, link, point, R in (
            ("link1", c.body, ends.point, turn),
            ("link2", other, ends.other_point, other_turn),
        ):
            one.add(Tag(side, link=self.link_of[link], xyz=point, rpy=rpy_of(quaternion_of(R))))
        self.report.add("converted", where, "is a <loop_joint>, which few programs read")
        return one.add(Tag("axis", xyz=(1.0, 0.0, 0.0)))

    def _left_out(self) -> None:
        """Report active parts of the model that cannot be written to the file."""
        model = self.model
        for body in model.bodies:
            where = f"body '{body.name}'"
            for field in _unsaid(body):
                if any(values := getattr(body, field)):
                    text = ", ".join(f"{x:g}" for x in values)
                    self._out(where, f"the joint's {field} {text}", body.name)
            for shape in body.shapes:
                for field in ("surface_velocity", "surface_spin"):
                    if any(getattr(shape, field)):
                        acts = shape.role != "visual"
                        self._out(where, f"a shape's {field}", body.name, acts=acts)
        for force in model.forces:
            if self.motors.get(force.body) is not force:
                article = "an" if isinstance(force, Actuator) else "a"
                self._out(f"force '{force.name}'", f"{article} {force.kind}", force.name)
        for control in model.controls:
            self._out(f"control '{control.name}'", f"a {control.kind}", control.name)
        for contact in model.contacts:
            self._out(f"contact '{contact.name}'", "a contact", contact.name)
        if model.gravity != (0.0, 0.0, -9.81):
            text = f"gravity {model.gravity}; programs that read URDF assume (0, 0, -9.81)"
            self.report.add("left out", "model", text, acts=True)
        begun = [b.name for b in model.bodies if any(b.v) or b.q != home(b.sequence)]
        if begun:
            text = (
                f"the initial state of {choices(begun, 6)}: the robot is written with q = 0 at rest"
            )
            self.report.add("left out", "model", text)
        for parts in ("site", "output", "scenario"):
            if named := [part.name for part in getattr(model, f"{parts}s")]:
                text = f"{counted(len(named), parts)}: {choices(named, 6)}"
                self.report.add("left out", "model", text)

    def _out(self, where: str, what: str, part: str, *, acts: bool = True) -> None:
        """Report a part that cannot be written."""
        text = f"{what}, which URDF does not support"
        self.report.add("left out", where, text, acts=acts, part=part)


def _unsaid(body: Body) -> Iterator[str]:
    """Yield the fields of a joint that act and that URDF has no word for."""
    yield from ("stiffness", "armature")
    if any(body.stiffness):
        yield "rest"
    if body.limits:
        yield "limit_restitution"
    if body.floats:  # <dynamics> is of joints with an axis
        yield from ("damping", "friction")


def tell_taper(report: Report, body: str, shape: Shape) -> None:
    """Report a drawn shape that is written with one radius although it has another at its end."""
    if shape.end_radius is not None:
        text = f"a {shape.kind} is drawn without its end_radius {shape.end_radius:g}"
        report.add("left out", f"body '{body}'", text, part=body)


# -- what a constraint means in numbers ------------------------------------------------------------


class Placed:
    """The points and axes of a constraint, with defaults taken from the initial state."""

    def __init__(self, model: Model, c: Any):
        place, turn = Dynamics(model).packed.home_poses
        number = {name: k for k, name in enumerate(Dynamics(model).names)}

        def frame(name: str) -> tuple[np.ndarray, np.ndarray]:
            if name == GROUND:
                return np.zeros(3), np.eye(3)
            return place[number[name]], turn[number[name]]

        (x, R), (y, S) = frame(c.body), frame(c.other)
        self.point = np.array(model.point_of(c))
        given = getattr(c, "other_point", None)
        here = S.T @ (x + R @ self.point - y)
        self.other_point = np.array(given) if given is not None else here
        self.axis = self.other_axis = None
        self.turn = S.T @ R  # rotation of the body relative to the other
        if hasattr(c, "axis") and hasattr(c, "other_axis"):
            axis, other = c.axis, c.other_axis
            if axis is None and other is None:
                axis = (0.0, 0.0, 1.0)
            self.axis = np.array(axis) if axis is not None else R.T @ S @ np.array(other)
            self.other_axis = np.array(other) if other is not None else self.turn @ self.axis


# -- names and numbers -----------------------------------------------------------------------------


def _taken(name: str, names: set[str]) -> str:
    """Return the name, with primes if others have it, and add it to theirs."""
    name = unused(name, names)
    names.add(name)
    return name


def _plain(motor: Motor) -> bool:
    """Check whether a motor only limits its torque."""
    odd = motor.gear != 1.0 or motor.coefficients or motor.torque_low is not None or motor.has_state
    return motor.torque == 0.0 and motor.coordinate == 0 and not odd


def _type(body: Body, k: int) -> str:
    if not body.motions:
        return "fixed"
    motion, bounded = body.sequence[k], body.limits and body.limits[k]
    return "continuous" if motion.facts.pivots and not bounded else TYPES[motion.kind]


def rpy_of(rotation: Sequence[float]) -> tuple[float, float, float]:
    """Convert a quaternion to roll, pitch and yaw [rad], accurate to rounding even at a pitch of 90
    degrees.

    [Bernardes and Viollet 2022]
    """
    w, x, y, z = unit(rotation)
    a, b, c, d = w - y, x + z, y + w, z - x
    pitch = 2 * math.atan2(math.hypot(c, d), math.hypot(a, b)) - math.pi / 2
    plus, minus = math.atan2(b, a), math.atan2(d, c)
    return _turned(plus - minus), pitch, _turned(plus + minus)


def _turned(angle: float) -> float:
    """Wrap an angle to the range -π to π."""
    return math.remainder(angle, 2 * math.pi)
