"""The URDF reader, which converts links and joints, shapes, limits, motors, mimic joints and loops.

The frame of a link is the frame of its joint, as for a body, so no transformation is needed. The
root link is welded to the ground, or free.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import (
    FileError,
    InputError,
    ModelError,
    Problem,
    choices,
    explained,
    shown,
)
from ..fields import GROUND, name_problem
from ..markup import Element, read_markup
from ..model import Body, Constraint, Force, Gear, Model, Motion, Motor, Wrench
from ..model.world import Ground
from ..rotation import Quaternion, matrix, turn_of_z
from .conversion import (
    NO_LIMIT,
    Folders,
    Report,
    reach_of,
    suspect_meshes,
    suspect_rings,
    suspect_units,
    unphysical,
)
from .urdf_friction import surfaces, weightless
from .urdf_shapes import ZERO, Shapes, quaternion_of_rpy
from .urdf_unread import report_unread
from .xacro import SUFFIX, expanded, no_arguments, only_macros

X = (1.0, 0.0, 0.0)
NO_LINK = "has no link; a robot needs at least one. If other files include this one, load those"
# elements of SRDF, in which MoveIt describes a robot whose links and joints are in a URDF
SEMANTIC = ("group", "disable_collisions", "virtual_joint", "end_effector")
SRDF = "is SRDF, which names groups of joints of another file; give the URDF of the robot"
JOINTS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "weld",
    "floating": "free",
    "planar": "planar",
}
LOOPS = {  # types of <loop_joint> -> kinds of constraints
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "cylindrical": "cylindrical",
    "universal": "universal",
    "fixed": "weld",
    "spherical": "point",
    "ball": "point",
}
WORLD = "world"  # a root link of this name without content is the ground
XACRO = "of xacro; name the file robot.urdf.xacro, so that they are expanded"


@explained
def read_urdf(
    path: str | Path,
    roots: Iterable[str | Path] = (),
    *,
    base: Literal["fixed", "free"] = "fixed",
    arguments: Mapping[str, Any] | None = None,
) -> tuple[Model, Report]:
    """Read a URDF file, or a xacro file that generates one.

    Parameters
    ----------
    path : str or path
        The file.
    roots : iterable of paths
        Additional folders for mesh files. By default they must be in the nearest parent folder with
        a package.xml, or in the folder of the file.
    base : {"fixed", "free"}
        Whether the root link is welded to the ground or floats.
    arguments : dict, optional
        Arguments of a xacro file. Since xacro files can execute code, only read files that you
        trust.

    Returns
    -------
    model : Model
        The model.
    report : Report
        Omissions and warnings, which can be printed.

    Raises
    ------
    FileError, ModelError
        If the file cannot be read. The message contains the line and the element.
    InputError
        If an argument is invalid.
    MissingPackage
        If a xacro file needs the package xacro.
    """
    if base not in ("fixed", "free"):
        text = f"must be 'fixed' or 'free', got {shown(base)}"
        raise InputError(Problem("read_urdf", "base", text))
    path = Path(path)
    is_xacro = path.suffix.lower() == SUFFIX
    folders, name, warnings = Folders(path, roots, trusted=is_xacro), path.name, list[str]()
    if is_xacro:
        robot, warnings = expanded(path, folders, arguments or {})
        name = f"{name}, expanded"
    elif arguments:
        raise no_arguments(path)
    else:
        robot = read_markup(path)
    if is_xacro and robot.first("link") is None and (text := only_macros(path)):
        raise FileError(Problem(path.name, "", text))
    reader = _Reader(name, robot, folders, base)
    for text in warnings:
        reader.report.add("warning", path.name, text)
    return reader.result()


class _Joint(NamedTuple):
    element: Element
    name: str
    parent: str
    child: str


class _Reader(Shapes):
    def __init__(self, name: str, robot: Element, folders: Folders, base: str):
        super().__init__(name, folders)
        self.robot, self.base, self.speeds = robot, base, 0
        self.bounded: list[tuple[str, str, float, float]] = []  # link, place, limits
        if robot.tag != "robot":
            text = f"holds <{robot.tag}>, not the <robot> of a URDF file"
            do = "; it is MJCF: call read_mjcf, or give it a name that ends in .xml"
            raise self.source.wrong(robot, "", text + do * (robot.tag == "mujoco"))
        for element in self.robot.inside():
            if element.tag.startswith("xacro:"):
                raise self.source.wrong(element, "", f"holds <{element.tag}> {XACRO}")
            for key, value in element.attributes.items():
                if "${" in value or "$(" in value:
                    raise self.source.wrong(element, key, f"holds {shown(value)} {XACRO}")
        self.links: dict[str, Element] = {}
        for name, element in self._named("link"):
            self.links.setdefault(name, element)
        if not (self.links or self.faults):
            semantic = self.source.name.lower().endswith(".srdf") or any(robot.all(*SEMANTIC))
            raise self.source.wrong(robot, "", SRDF if semantic else NO_LINK)
        if world := self._world_of_drake():
            self.links[WORLD] = world
        self.joints = self._joints()
        self._look(robot, self.links.values())

    def result(self) -> tuple[Model, Report]:
        """Return the model and the report."""
        self.joint_of = {joint.child: joint for joint in self.joints}
        order = [*self.links]
        if not self.faults:  # the names that make the tree are sound
            order = self._noted(order, self._order)
        place = {link: k for k, link in enumerate(order)}
        self.joints.sort(key=lambda joint: place[joint.child])
        links = (link for link in order if not self._is_ground(link))
        bodies = [body for link in links if (body := self._noted(None, self._body, link))]
        fields: dict[str, Any] = {
            "name": self.robot.get("name") or Path(self.source.name).stem,
            "bodies": bodies,
            "constraints": [*self._noted([], self._mimics), *self._noted([], self._loops)],
            "forces": self._noted([], self._motors),
            "ground": Ground(**surfaces(self.report, self.source, self.robot)),
        }
        fields["forces"] += self._lifts({body.name: body for body in bodies})
        if self.faults:
            of_model = all(isinstance(fault, ModelError) for fault in self.faults)
            found = [problem for fault in self.faults for problem in fault.problems]
            raise (ModelError if of_model else FileError)(found)
        joints = [joint.element for joint in self.joints]
        report_unread(self.report, self.source, self.robot, [*self.links.values()], joints)
        if self.hulls:
            text = f"{self.hulls} collision meshes touch by their convex hulls"
            self.report.add("approximated", self.source.name, text)
        fields["bodies"] = self._following(bodies, fields["constraints"])
        self._tell_starts({body.name: body for body in fields["bodies"]})
        try:
            model = Model(**fields)
        except ModelError as error:
            raise ModelError(
                [Problem(f"{self.source.name}: {p.where}", p.field, p.text) for p in error.problems]
            ) from None
        reach = reach_of(self._places(model))
        suspect_units(self.report, model, reach)
        suspect_meshes(self.report, model, reach, self.sizes)
        moving = sum(body.joint != "weld" for body in model.bodies)
        text = f"{len(bodies)} links, {moving} joints that move, {len(model.forces)} motors"
        self.report.add("read", self.source.name, text)
        return self.report.attached_to(model), self.report

    # -- the tree --------------------------------------------------------------------------------

    def _world_of_drake(self) -> Element | None:
        """Return a link for the world if joints only name it as their parent, as Drake allows."""
        if WORLD in self.links:
            return None
        ends = [(joint.first("parent"), joint.first("child")) for joint in self.robot.all("joint")]
        if any(child is not None and child.get("link") == WORLD for _, child in ends):
            return None
        named = (one for one, _ in ends if one is not None and one.get("link") == WORLD)
        if (parent := next(named, None)) is None:
            return None
        text = "the link 'world', which the file does not define, is the ground, as in Drake"
        self.report.add("converted", self.source.at(parent, "parent"), text)
        return Element("link", {"name": WORLD}, parent.line)

    def _named(self, tag: str) -> list[tuple[str, Element]]:
        """Return all elements with a tag by their names. Duplicate names are noted as faults."""
        first: dict[str, Element] = {}
        found: list[tuple[str, Element]] = []
        for element in self.robot.all(tag):
            name = element.get("name")
            found.append((name, element))
            if problem := name_problem(name):
                self._wrong(element, "name", problem, tag)
            elif (other := first.setdefault(name, element)) is not element:
                text = f"a {tag} of this name is on line {other.line} already"
                self._wrong(element, "name", text, f"{tag} {shown(name)}")
        return found

    def _joints(self) -> list[_Joint]:
        joints: list[_Joint] = []
        parent_of: dict[str, _Joint] = {}
        for name, element in self._named("joint"):
            what, sound = f"joint {shown(name)}", True
            ends: list[str] = []
            for side in ("parent", "child"):
                end = element.first(side)
                link = end.get("link") if end is not None else ""
                if link not in self.links:
                    text = f"must name a link, got {shown(link)}"
                    if link:
                        text += f', which the file lacks: add <link name="{link}"/>, or give the '
                        text += "file of the whole robot"
                    self._wrong(end or element, side, text, what)
                    sound = False
                ends.append(link)
            if element.get("type") not in JOINTS:
                text = f"must be one of {', '.join(JOINTS)}, got {shown(element.get('type'))}"
                self._wrong(element, "type", text, what)
                sound = False
            if not sound:
                self._pose(element, what)
                self._axis(element, what)
                continue
            joint = _Joint(element, name, *ends)
            if (other := parent_of.get(joint.child)) is not None:
                text = (
                    f"link {shown(joint.child)} is the child of joint {shown(other.name)} in line "
                    f"{other.element.line} too; close the loop by a <loop_joint> instead"
                )
                self._wrong(element, "child", text, what)
            parent_of[joint.child] = joint
            joints.append(joint)
        return joints

    def _order(self) -> list[str]:
        """Return the links from the root, depth-first. Raises FileError for two roots or cycles."""
        roots = [name for name in self.links if name not in self.joint_of]
        if len(roots) > 1:
            named = choices(f"{name!r} (line {self.links[name].line})" for name in roots)
            text = f"has {len(roots)} root links, {named}; connect them by a joint"
            raise self.source.wrong(self.robot, "", text)
        children: dict[str, list[str]] = {}
        for joint in self.joints:
            children.setdefault(joint.parent, []).append(joint.child)
        order: list[str] = []
        waiting = roots
        while waiting:
            link = waiting.pop()
            order.append(link)
            waiting += reversed(children.get(link, ()))
        if len(order) < len(self.links):
            left = next(joint for joint in self.joints if joint.child not in set(order))
            text = "its links form a cycle; give one of them another parent"
            raise self.source.wrong(left.element, "", text, f"joint {shown(left.name)}")
        return order

    def _is_ground(self, link: str) -> bool:
        element = self.links[link]
        return link == WORLD and link not in self.joint_of and not element.children

    def _body_name(self, link: str) -> str:
        """Return the body name for a link, since 'ground' and '*' are reserved."""
        if self._is_ground(link):
            return GROUND
        return link if link not in (GROUND, "*") else f"{link} link"

    def _places(self, model: Model) -> dict[str, tuple[float, float, float]]:
        """Return the origins of the body frames at q = 0 in the axes of the root [m]."""
        frames: dict[str, tuple[np.ndarray, np.ndarray]] = {GROUND: (np.zeros(3), np.eye(3))}
        for body in model.bodies:
            place, turn = frames[body.parent]
            frames[body.name] = (place + turn @ body.link, turn @ matrix(body.rotation))
        return {name: tuple(place.tolist()) for name, (place, _) in frames.items()}

    # -- one link with its joint -----------------------------------------------------------------

    def _body(self, link: str) -> Body | None:
        """Return the body for a link, or None after recording its faults."""
        faults = len(self.faults)
        element, joint = self.links[link], self.joint_of.get(link)
        what = f"link {shown(link)}"
        name = self._body_name(link)
        where = self.source.at(element, what)
        fields: dict[str, Any] = {"name": name, "tip": None}
        if joint is not None:
            fields |= self._joint_fields(joint)
        elif self.base == "free":
            fields["joint"] = "free"
            self.report.add("converted", where, "the root link is free, as requested", part=name)
        else:
            fields["joint"] = "weld"
            text = "the root link is welded to the ground; base='free' lets it float"
            self.report.add("converted", where, text, part=name)
        if name != link:
            text = f"is named {name!r} here: {link!r} means something else"
            self.report.add("converted", where, text, part=name)
        fields |= self._inertial(element, what, name, fields["joint"] == "weld")
        fields["shapes"] = self._shapes(element, what, name)
        if len(self.faults) > faults:
            return None
        try:
            fields |= self._of_density(element, what, name, fields["shapes"])
            return Body(**fields)
        except ModelError as error:
            raise ModelError([Problem(where, p.field, p.text) for p in error.problems]) from None

    def _joint_fields(self, joint: _Joint) -> dict[str, Any]:
        element, what = joint.element, f"joint {shown(joint.name)}"
        kind = element.get("type")
        link, rotation = self._pose(element, what)
        fields: dict[str, Any] = {
            "parent": self._body_name(joint.parent),
            "joint": JOINTS[kind],
            "link": link,
            "rotation": rotation,
        }
        if kind in ("fixed", "floating"):
            return fields
        axis = self._axis(element, what)
        if abs(math.hypot(*axis) - 1.0) > 1e-6:
            text = f"the axis {shown(axis)} is normalised"
            self.report.add("converted", self.source.at(element, what), text)
        if kind == "planar":
            turn = matrix(turn_of_z(axis))  # x and y of the joint, as in MuJoCo
            slides = [("translate", tuple(x)) for x in turn.T[:2].tolist()]
            return fields | {"motions": [*slides, ("rotate", axis)]}
        fields["axes"] = [axis]
        dynamics = element.first("dynamics")
        for name in ("damping", "friction"):
            value = self.given.number(dynamics, name, 0.0, what)
            if value < 0:
                text = f"must be >= 0, got {shown(value)}"
                self._wrong(dynamics or element, name, text, what)
            fields[name] = value
        fields["speed_limit"] = self._speed(joint, what)
        return fields | self._limits(joint, kind, what)

    def _axis(self, element: Element, what: str) -> tuple[float, ...]:
        axis = self.given.numbers(element.first("axis"), "xyz", X, what)
        if 1e-9 < math.hypot(*axis) < 1e9:
            return axis
        text = f"must not be zero, got {shown(axis)}"
        self._wrong(element.first("axis") or element, "axis", text, what)
        return X

    def _speed(self, joint: _Joint, what: str) -> float:
        """Return the velocity limit of a joint, or 0 without one."""
        limit = joint.element.first("limit")
        speed = self.given.number(limit, "velocity", 0.0, what, infinite=True)
        if not 0 < speed < NO_LIMIT:
            return 0.0
        self.speeds += 1
        return speed

    def _limits(self, joint: _Joint, kind: str, what: str) -> dict[str, Any]:
        limit = joint.element.first("limit")
        where = self.source.at(limit or joint.element, what)
        if kind == "continuous":
            if limit is not None and any(limit.get(end) for end in ("lower", "upper")):
                text = "a continuous joint has no limits; its lower and upper are ignored"
                self.report.add("converted", where, text, part=joint.child)
            return {}
        if limit is None or not {"lower", "upper"} & limit.attributes.keys():
            text = f"a {kind} joint should have limits; it has none and moves freely here"
            self.report.add("warning", where, text, part=joint.child)
            return {}
        low, high = (
            self.given.number(limit, name, 0.0, what, infinite=True) for name in ("lower", "upper")
        )
        if low == -math.inf and high == math.inf:
            return {}
        if low == high == 0.0:
            text = "the limits 0 and 0 would lock the joint; they are ignored"
            self.report.add("converted", where, text, part=joint.child)
            return {}
        if low > high:
            text = f"lower {shown(low)} above upper {shown(high)} is ignored, as in Bullet"
            self.report.add("warning", where, text, part=joint.child)
            return {}
        if low == high:
            text = f"lower must be less than upper, got {shown(low)} and {shown(high)}"
            self.report.add("warning", where, f"{text}; the limits are ignored", part=joint.child)
            self.report.add("left out", where, "limits", acts=True, part=joint.child)
            return {}
        start = min(max(0.0, low), high)
        self.bounded.append((joint.child, where, low, high))
        ends = tuple(end if math.isfinite(end) else None for end in (low, high))
        return {"limits": [ends], "q": (start,)}

    def _inertial(self, element: Element, what: str, name: str, still: bool) -> dict[str, Any]:
        inertial = element.first("inertial")
        none = {"mass": 0.0, "com": ZERO, "inertia": np.zeros((3, 3))}
        if inertial is None:
            if not still:
                text = "moves and has no <inertial>: it has no mass here either"
                self.report.add("warning", self.source.at(element, what), text, part=name)
            return none
        com, turn = self._pose(inertial, what)
        own = inertial.first("mass")
        mass = self.given.number(own, "value", 0.0, what)
        if mass < 0:
            text = f"must be >= 0 [kg], got {shown(mass)}"
            self._wrong(own or inertial, "mass", text, what)
        if (own is None or "value" not in own.attributes) and inertial.first("density") is None:
            text = 'the mass: <inertial> has no <mass value="..."/>, so it is 0 kg here'
            root = name not in map(self._body_name, self.joint_of)
            where = self.source.at(own or inertial, what)
            self.report.add("left out", where, text, acts=not (still and root), part=name)
        given = inertial.first("inertia")
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        xx, xy, xz, yy, yz, zz = (self.given.number(given, n, 0.0, what) for n in names)
        R = matrix(turn)
        inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
        inertia = (inertia + inertia.T) / 2
        fields = {"mass": mass, "com": com, "inertia": inertia}
        where = self.source.at(given or inertial, what)
        return fields | unphysical(self.report, where, name, inertia)

    # -- what acts between links -----------------------------------------------------------------

    def _mimics(self) -> list[Constraint]:
        by_name = {joint.name: joint for joint in self.joints}
        found: list[Constraint] = []
        gears: list[tuple[Gear, str]] = []
        for joint in self.joints:
            mimic = joint.element.first("mimic")
            if mimic is None:
                continue
            what = f"joint {shown(joint.name)}"
            where, leader = self.source.at(mimic, what), by_name.get(mimic.get("joint"))
            if leader is None or leader is joint:
                text = f"<mimic> names {shown(mimic.get('joint'))}, which is not another joint"
                self.report.add("left out", where, text, acts=True, part=joint.child)
                continue
            ratio = self.given.number(mimic, "multiplier", 1.0, what)
            offset = self.given.number(mimic, "offset", 0.0, what)
            single = ("revolute", "continuous", "prismatic")
            kinds = [each.element.get("type") for each in (joint, leader)]
            if kinds[0] not in single or (kinds[1] not in single and ratio):
                held = kinds[0] == "fixed"
                text = f"a {kinds[0]} joint that follows a {kinds[1]} one"
                self.report.add("left out", where, text, acts=not held, part=joint.child)
                continue
            name, body = joint.name, self._body_name(joint.child)
            if ratio:
                other = self._body_name(leader.child)
                gear = Gear(name=name, body=body, other=other, ratio=ratio, offset=offset)
                found.append(gear)
                gears.append((gear, where))
            else:
                curve = {"kind": "polynomial", "coefficients": [offset]}
                found.append(Motion(name=name, body=body, q_of_t=curve))
            self.report.add("converted", where, f"<mimic> is the constraint '{name}'", part=name)
        suspect_rings(self.report, gears)
        return found

    def _following(self, bodies: list[Body], constraints: list[Constraint]) -> list[Body]:
        """Return the bodies, with each follower at the position determined by its leader."""
        found = {body.name: body for body in bodies}
        gears = {c.body: c for c in constraints if isinstance(c, Gear)}

        def start(name: str, followers: tuple[str, ...] = ()) -> float:
            gear = gears.get(name)
            if gear is None or name in followers:  # a leader, or a ring of gears
                return found[name].q[0]
            return gear.ratio * start(gear.other, (*followers, name)) + gear.offset

        for name in gears:
            if (q := start(name)) != found[name].q[0]:
                found[name] = found[name].model_copy(update={"q": (q,)})
        return list(found.values())

    def _tell_starts(self, bodies: Mapping[str, Body]) -> None:
        """Report the joints whose limits exclude 0, and those that a leader puts outside."""
        for link, where, low, high in self.bounded:
            start = bodies[self._body_name(link)].q[0]
            if low <= 0.0 <= high and low <= start <= high:
                continue
            text = f"0 is outside the limits {shown((low, high))}; it starts at {start:.6g}"
            if not low <= start <= high:
                text = f"<mimic> starts it at {start:.6g}, outside the limits {shown((low, high))}"
            self.report.add("warning", where, text, part=link)

    def _loops(self) -> list[Constraint]:
        """Return the <loop_joint>s as joints between the poses on <link1> and <link2>."""
        found: list[Constraint] = []
        for name, element in self._named("loop_joint"):
            what, kind = f"loop_joint {shown(name)}", LOOPS.get(element.get("type"))
            if kind is None:
                text = f"must be one of {', '.join(LOOPS)}, got {shown(element.get('type'))}"
                self._wrong(element, "type", text, what)
                continue
            ends: list[tuple[str, tuple[float, ...], Quaternion]] = []
            for side in ("link1", "link2"):
                end = element.first(side)
                link = end.get("link") if end is not None else ""
                if end is None or link not in self.links:
                    self._wrong(element, side, "must name a link", what)
                    continue
                xyz = self.given.numbers(end, "xyz", ZERO, what)
                rpy = quaternion_of_rpy(self.given.numbers(end, "rpy", ZERO, what))
                ends.append((self._body_name(link), xyz, rpy))
            axis = self.given.numbers(element.first("axis"), "xyz", X, what)
            if len(ends) < 2:
                continue
            (body, point, turn), (other, other_point, other_turn) = ends
            fields = {"name": name, "kind": kind, "body": body, "other": other}
            fields |= {"point": point, "other_point": other_point}
            if kind in ("revolute", "prismatic", "cylindrical", "universal"):
                fields["axis"] = tuple((matrix(turn) @ axis).tolist())
                fields["other_axis"] = tuple((matrix(other_turn) @ axis).tolist())
            found.append(Constraint(**fields))
        return found

    def _lifts(self, bodies: Mapping[str, Body]) -> list[Force]:
        """Return a wrench against gravity for each link that Gazebo keeps from falling."""
        found: list[Force] = []
        for link, line in weightless(self.robot):
            body = bodies.get(self._body_name(link)) if link in self.links else None
            if body is not None and body.mass:
                force = (0.0, 0.0, 9.81 * body.mass)
                name = f"gravity off of {body.name}"
                found.append(Wrench(name=name, body=body.name, force=force, point=body.com))
                text = f"turnGravityOff is the force '{name}'"
                self.report.add("converted", self.source.at(line), text, part=name)
        return found

    def _motors(self) -> list[Force]:
        """Return a motor with zero torque for each joint that has an effort limit."""
        found: list[Force] = []
        for joint in self.joints:
            limit = joint.element.first("limit")
            kind = joint.element.get("type")
            if limit is None or kind not in ("revolute", "continuous", "prismatic"):
                continue
            what = f"joint {shown(joint.name)}"
            effort = self.given.number(limit, "effort", 0.0, what, infinite=True)
            if effort > 0 and joint.element.first("mimic") is not None:
                text = "its effort limit makes no motor: <mimic> moves the joint"
                self.report.add("converted", self.source.at(limit, what), text, part=joint.child)
            elif effort > 0:
                body, most = self._body_name(joint.child), effort if effort < math.inf else None
                found.append(Motor(name=joint.name, body=body, torque=0.0, torque_limit=most))
        if self.speeds:
            text = (
                f"{self.speeds} velocity limits hold no joint; runs name those that exceed their "
            )
            self.report.add("left out", self.source.name, f"{text}`speed_limit`")
        return found
