"""The reader of models of OpenSim, with document versions from 2.3 to 4.6.

The frame of a body is that of its joint. A coordinate of the file is an output of the same name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.paths import jump_text, jumps_of
from ..errors import ModelError, Problem, choices, explained, shown
from ..fields import GROUND, Vec3, name_problem
from ..forces import BetweenPoints
from ..markup import read_markup
from ..model import Body, Model, Output, Site
from ..model.poses import poses as poses_of
from .conversion import Folders, Report, reach_of, suspect_units, unphysical, unused
from .osim_forces import Forces, coupler_of
from .osim_functions import Curve
from .osim_joints import Chain, Coordinate, Joint, Link, coordinate_of
from .osim_pictures import Pictures
from .osim_text import HOME, Document, Element, Pose, turned

UNITS = ("", "m", "meter", "meters", "metre", "metres")
JOINED = {(): "weld", ("rotate",): "revolute", ("translate",): "prismatic", ("curve",): "curve"}


@explained
def read_osim(path: str | Path, roots: Iterable[str | Path] = ()) -> tuple[Model, Report]:
    """Read a model of OpenSim with a document version of 20300 or later.

    Parameters
    ----------
    path : str or path
        The file.
    roots : iterable of paths
        Folders with the files of pictures. By default they must be in the folder of the file, or in
        the folder Geometry in it.

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

    Examples
    --------
    >>> import pgraph_core as pg
    >>> model, report = pg.read_osim("arm26.osim")  # doctest: +SKIP
    """
    path = Path(path)
    return _Reader(Document(path.name, read_markup(path)), Folders(path, roots)).result()


class _Reader:
    def __init__(self, file: Document, folders: Folders):
        self.file, self.report = file, Report(file.name)
        self.pictures = Pictures(file, self.report, folders)
        self.elements = self._bodies_by_name()
        file.collect(list(self.elements))
        self.joints = self._joints()
        self.poses = {
            GROUND: HOME
        }  # poses of the file's bodies in ours, whose frames are those of the joints
        self.chains = self._chains()
        self.coordinates = dict[str, tuple[Coordinate, str, int]]()

    def result(self) -> tuple[Model, Report]:
        """Return the model and the report. Raises FileError, ModelError."""
        bodies = self._bodies()
        joined = {name for joint in self.joints.values() for name in joint.follows}
        forces = Forces(self.file, self.report, self.poses, self.coordinates, joined)
        bodies = forces.started(bodies)
        self.pictures.tell()
        sites, outputs = self._markers({body.name for body in bodies}), self._outputs()
        gravity = self.file.numbers(self.file.model, "gravity", (0.0, -9.80665, 0.0))
        name = self.file.model.get("name") or Path(self.file.name).stem
        fields: dict[str, Any] = {
            "name": name, "bodies": bodies, "gravity": gravity, "up": _up_of(gravity),
            "constraints": forces.constraints, "forces": forces.forces,
            "sites": sites, "outputs": outputs,
        }  # fmt: skip
        try:
            model = Model(**fields)
        except ModelError as error:
            at = f"{self.file.name}: "
            found = [Problem(at + p.where, p.field, p.text) for p in error.problems]
            raise ModelError(found) from None
        if limited := sum(x is not None for body in bodies for x in body.limits):
            text = (
                f"the ranges of {limited} clamped coordinates are limits, which stop the joints; "
            )
            self.report.add("converted", self.file.name, text + "OpenSim holds no motion there")
        self._suspect(model)
        self._tell_jumps(model, forces)
        moving = sum(body.dof > 0 for body in bodies)
        text = f"{len(self.elements)} bodies, {moving} joints that move, "
        text += f"{len(self.coordinates)} coordinates, {len(forces.muscles)} muscles"
        self.report.add("read", self.file.name, text)
        return self.report.attached_to(model), self.report

    def _tell_jumps(self, model: Model, forces: Forces) -> None:
        """Report the paths that jump where a conditional point begins or ceases to count."""
        paths = [f for f in model.forces if isinstance(f, BetweenPoints)]
        paths = [f for f in paths if any(via.when for via in f.via)]
        packed = Dynamics(model).packed if paths else None
        lines = {muscle.name: muscle.element for muscle in forces.muscles}
        for f in paths:
            assert packed is not None, "there are paths"
            if jumps := jumps_of(packed, f, packed.system.q):
                where = self.file.where(lines[f.name])
                self.report.add("warning", where, jump_text(packed, jumps), part=f.name)

    def _suspect(self, model: Model) -> None:
        """Report units that may not be metres and kilograms."""
        places = dict[str, Vec3]()
        for name, pose in poses_of(model.bodies).items():
            x, y, z = pose.position.tolist()
            places[name] = x, y, z
        suspect_units(self.report, model, reach_of(places))
        unit = self.file.text(self.file.model, "length_units").lower()
        if unit not in UNITS:
            text = f"its length_units are {shown(unit)}, but its numbers are read as metres"
            self.report.add("warning", self.file.name, f"{text}, as OpenSim does")

    # -- the tree --------------------------------------------------------------------------------

    def _bodies_by_name(self) -> dict[str, Element]:
        found = dict[str, Element]()
        for element in self.file.members("BodySet"):
            name = element.get("name")
            if element.tag != "Body" or name == GROUND:
                continue
            if problem := name_problem(name):
                raise self.file.refuse(element, "name", problem)
            if name in found:
                text = f"a body of this name is on line {found[name].line} already"
                raise self.file.refuse(element, "name", text)
            found[name] = element
        return found

    def _joints(self) -> dict[str, Joint]:
        """Return the joint of each body. Raises FileError."""
        found, file = dict[str, Joint](), self.file
        given: list[tuple[Element, str]] = []  # with the child, if it stands inside it
        for element in self.elements.values():
            held = element.first("Joint")
            given += [(x, element.get("name")) for x in (held.children if held else ())]
        given += [(x, "") for x in file.members("JointSet")]
        for element, inside in given:
            joint = self._joint(element, inside)
            if file.flag(element, "reverse"):
                text = "a reversed joint is not read; exchange its frames and its sign"
                raise file.refuse(element, "reverse", text)
            if joint.child == GROUND:
                text = "has the ground as its child; exchange its frames in OpenSim"
                raise file.refuse(element, "child_frame", text)
            if (other := found.get(joint.child)) is not None:
                text = f"body {shown(joint.child)} is the child of joint {shown(other.name)} too; "
                text += "close the loop by a WeldConstraint or PointConstraint"
                raise file.refuse(element, "child_frame", text)
            found[joint.child] = joint
        return found

    def _joint(self, element: Element, inside: str) -> Joint:
        file = self.file
        parent = file.socket(element, "parent_frame", "parent_body")
        child = inside or file.socket(element, "child_frame", "child_body")
        (first, at_parent), (second, at_child) = (
            file.frame(path, element, field)
            for path, field in ((parent, "parent_frame"), (child, "child_frame"))
        )
        at_parent, at_child = (
            at @ self._offset(element, *names)
            for at, *names in (
                (at_parent, "location_in_parent", "orientation_in_parent"),
                (at_child, *(("location", "orientation") if inside else
                             ("location_in_child", "orientation_in_child"))),
            )
        )  # fmt: skip
        held = element.first("coordinates") or element.first("CoordinateSet")
        held = (held.first("objects") or held) if held is not None else None
        given = [coordinate_of(file, x) for x in (held.all("Coordinate") if held else ())]
        name, follows = element.get("name"), self._follows([c.name for c in given])
        return Joint(name, element.tag, element, first, second, at_parent, at_child, given, follows)

    def _follows(self, names: list[str]) -> dict[str, tuple[str, Curve]]:
        """Return the coordinates that follow another one of their joint by a coupler."""
        found = dict[str, tuple[str, Curve]]()
        for element in self.file.members("ConstraintSet"):
            coupler = coupler_of(self.file, element)
            if coupler is None or not coupler.on or coupler.own not in names:
                continue
            own, leaders = coupler.own, coupler.leaders
            if len(leaders) == 1 and leaders[0] in names and leaders[0] != own:
                found[own] = leaders[0], coupler.curve
                text = f"{shown(own)} is no coordinate: its motion is one of {shown(leaders[0])}"
                self.report.add("converted", self.file.where(element), text)
        return found

    def _offset(self, element: Element, location: str, orientation: str) -> Pose:
        zero = (0.0, 0.0, 0.0)
        place = np.array(self.file.numbers(element, location, zero))
        return Pose(place, turned(self.file.numbers(element, orientation, zero)))

    def _chains(self) -> dict[str, list[Link]]:
        """Return the links of each body, with parents first. Raises FileError."""
        for name, element in self.elements.items():
            if name not in self.joints:
                text = "no joint holds it: it is free, as in OpenSim"
                self.report.add("converted", self.file.where(element), text, part=name)
                names = [f"free_{name}_coord_{k}" for k in range(6)]
                free = [Coordinate(x, None) for x in names]
                joint = Joint(f"free_{name}", "FreeJoint", element, GROUND, name, HOME, HOME, free)
                self.joints[name] = joint
        order, ready = list[str](), {GROUND}
        while len(order) < len(self.joints):
            more = [x for x, j in self.joints.items() if x not in ready and j.parent in ready]
            if not more:
                left = next(j for x, j in self.joints.items() if x not in ready)
                loop = choices(shown(x) for x in self.joints if x not in ready)
                text = f"the bodies {loop} carry each other; one of them needs the parent 'ground'"
                raise self.file.refuse(left.element, "parent_frame", text)
            order += more
            ready.update(more)
        for name in order:
            joint = self.joints[name]
            at = self.poses[joint.parent] @ joint.at_parent
            self.joints[name] = joint._replace(at_parent=at)
            self.poses[name] = joint.at_child.inverse
        return {name: Chain(self.file, self.joints[name]).result() for name in order}

    # -- bodies ----------------------------------------------------------------------------------

    def _bodies(self) -> list[Body]:
        found, taken = list[Body](), {GROUND, *self.elements}
        for name, links in self.chains.items():
            joint = self.joints[name]
            if joint.at_child.place.any() or not np.array_equal(joint.at_child.turn, np.eye(3)):
                text = "the frame of the body is that of its joint here"
                self.report.add("converted", self.file.where(joint.element), text, part=name)
            parent = joint.parent
            for link in links:
                fields = dict(link.fields)
                own = name
                if before := fields.pop("before", ""):
                    own = unused(f"{name} {before}", taken)
                    taken.add(own)
                    text = f"the massless body {shown(own)} comes before the curve of {before}"
                    self.report.add("converted", self.file.where(joint.element), text, part=own)
                fields |= self._placed(joint, link, own)
                fields |= {"name": own, "parent": parent, "tip": None}
                fields |= self._massless() if own != name else self._inertial(name)
                found.append(self._body(joint.element, fields))
                parent = own
        return found

    def _body(self, element: Element, fields: Mapping[str, Any]) -> Body:
        try:
            return Body(**fields)
        except ModelError as error:
            where = self.file.where(element)
            raise ModelError([Problem(where, p.field, p.text) for p in error.problems]) from None

    def _placed(self, joint: Joint, link: Link, body: str) -> dict[str, Any]:
        """Return the joint's kind, coordinates and limits, and note where each coordinate is."""
        if "joint" in link.fields:
            self.coordinates |= {c.name: (c, body, -1) for c in joint.coordinates}
            return {}
        own = [joint.coordinates[k] for k in link.numbers]
        for k, c in enumerate(own):
            if c.name in self.coordinates:
                text = f"two coordinates are called {shown(c.name)}; rename one"
                raise self.file.refuse(joint.element, "coordinates", text)
            self.coordinates[c.name] = c, body, k
        kinds = tuple(kind for kind, _ in link.fields["motions"])
        fields: dict[str, Any] = {"joint": JOINED.get(kinds, "compound")}
        if own:
            fields["q"], fields["v"] = [c.start for c in own], [c.speed for c in own]
            limits = [self._limits(c, body) for c in own]
            fields["limits"] = limits if any(limits) else ()
        return fields

    def _limits(self, c: Coordinate, body: str) -> tuple[float, float] | None:
        if not c.clamped or c.range is None or c.locked or c.prescribed is not None:
            return None
        low, high = c.range
        if not low <= c.start <= high:
            text = f"it starts at {c.start:.6g}, outside its range {shown(c.range)}, which is no "
            text += "limit here"
            where = self.file.where(c.element) if c.element else self.file.name
            self.report.add("left out", where, text, acts=True, part=body)
            return None
        return c.range

    def _massless(self) -> dict[str, Any]:
        return {"mass": 0.0, "com": (0.0, 0.0, 0.0), "inertia": np.zeros((3, 3))}

    def _inertial(self, name: str) -> dict[str, Any]:
        """Return the mass, its centre and the inertia in the axes of the joint."""
        file, element, pose = self.file, self.elements[name], self.poses[name]
        mass = file.number(element, "mass")
        if mass < 0.0:
            raise file.refuse(element, "mass", f"must be >= 0 [kg], got {shown(mass)}")
        zero = (0.0,) * 6
        if element.first("inertia") is not None:
            xx, yy, zz, xy, xz, yz = file.numbers(element, "inertia", zero)
        else:
            parts = ("xx", "yy", "zz", "xy", "xz", "yz")
            xx, yy, zz, xy, xz, yz = (file.number(element, f"inertia_{x}") for x in parts)
        inertia = pose.turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ pose.turn.T
        inertia = (inertia + inertia.T) / 2
        com = pose.point(file.numbers(element, "mass_center", (0.0, 0.0, 0.0)))
        fields: dict[str, Any] = {"mass": mass, "com": com, "inertia": inertia}
        fields["shapes"] = self.pictures.of(element, self.poses)
        return fields | unphysical(self.report, file.where(element), name, inertia)

    # -- names of coordinates and markers --------------------------------------------------------

    def _outputs(self) -> list[Output]:
        """Return an output for each coordinate, by its name."""
        return [
            Output(name=name, kind="joint_position", at=body, coordinate=k)
            for name, (_, body, k) in self.coordinates.items()
            if k >= 0 and not name_problem(name)
        ]

    def _markers(self, taken: set[str]) -> list[Site]:
        found, names = list[Site](), {GROUND, *taken}
        for element in self.file.members("MarkerSet"):
            if element.tag != "Marker":
                continue
            path = self.file.socket(element, "parent_frame", "reference_frame", "body")
            body, pose = self.file.frame(path, element, "parent_frame")
            place = pose.point(self.file.numbers(element, "location", (0.0, 0.0, 0.0)))
            name = unused(element.get("name"), names)
            names.add(name)
            at = self.poses[body]
            found.append(
                Site(name=name, body=body, point=at.point(place), rotation=(at @ pose).quaternion)
            )
        return found


def _up_of(gravity: tuple[float, ...]) -> str:
    """Return the axis along which gravity acts, y without gravity."""
    k = max(range(3), key=lambda i: abs(gravity[i]))
    return "xyz"[k] if math.hypot(*gravity) > 0.0 else "y"
