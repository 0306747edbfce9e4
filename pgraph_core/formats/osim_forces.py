"""Constraints, forces and actuators of OpenSim."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..curves import Polynomial, Table
from ..errors import FileError, ModelError, Problem, choices, shown
from ..forces import Bushing
from ..functions import Curve as Spline
from ..model import Body, Constraint, Force, Gear, Motion, Motor, Relation, Spring, Wrench
from ..model.constraint import Distance, Line, Point, Weld
from ..model.poses import poses as poses_of
from ..tolerances import NOTABLE
from .conversion import Report
from .osim_functions import Curve, function_of
from .osim_joints import Coordinate
from .osim_muscles import ZERO, Muscle, Paths, losses, muscle_of
from .osim_text import Array, Document, Element, Pose, turned

Placed = Mapping[str, tuple[Coordinate, str, int]]  # coordinate, its body, its place or -1
STILL = ("Frame", "Station", "IMU", "Reporter")  # endings of parts that do not act
BALL = "is of a coordinate that is none here: it follows in its joint, or is of a quaternion"


class Spent(NamedTuple):
    """A spring and damper on a coordinate, for the fields of its body."""

    stiffness: float
    rest: float
    damping: float


class Forces:
    """Converts what acts on the bodies of a file.

    `joined` are coordinates that are none, since their joint lets them follow.
    """

    def __init__(
        self, file: Document, report: Report, poses: Mapping[str, Pose], coordinates: Placed,
        joined: Collection[str],
    ):  # fmt: skip
        self.file, self.report, self.poses, self.coordinates = file, report, poses, coordinates
        self.joined = joined
        self.constraints: list[Constraint] = []
        self.forces: list[Force] = []
        self.muscles: list[Muscle] = []
        self.springs: dict[tuple[str, int], Spent] = {}
        self.follows: dict[tuple[str, int], tuple[tuple[str, int], Curve]] = {}
        self.welds: list[tuple[Element, str, Array, str, Array]] = []
        self.lost: dict[tuple[str, bool], list[Element]] = {}
        self.paths = Paths(file, poses, self._place)
        for element in file.members("ConstraintSet"):
            self._made(CONSTRAINTS, element, "isEnforced")
        self._held()
        self.controls = self._controls()
        for element in file.members("ForceSet"):
            self._made(FORCES, element, "appliesForce")
        self._others()

    # -- what was read -----------------------------------------------------------------------------

    def started(self, bodies: list[Body]) -> list[Body]:
        """Return the bodies with their springs, and each follower where its leader puts it."""
        found = {body.name: body for body in bodies}
        for name, k in self.follows:
            q = list(found[name].q)
            q[k] = self._start(found, (name, k), ())
            found[name] = found[name].model_copy(update={"q": tuple(q)})
        for (name, k), spring in self.springs.items():
            update = dict[str, Any]()
            for field, value in spring._asdict().items():
                own = list(getattr(found[name], field))
                own[k] += value
                update[field] = tuple(own)
            found[name] = found[name].model_copy(update=update)
        held = poses_of(list(found.values()))
        for element, body, turn, other, other_turn in self.welds:
            first, second = held[body].rotation @ turn, held[other].rotation @ other_turn
            if np.abs(first - second).max() > NOTABLE:
                text = "its frames are turned against each other at the start; they stay so here"
                self.report.add("warning", self.file.where(element), text)
        curved = 0
        for muscle in self.muscles:
            control = self.controls.get(muscle.name, 0.0)
            made = muscle_of(
                muscle,
                lambda body, point: held[body].place(point),
                lambda body, k: found[body].q[k],
                control,
            )
            if isinstance(made, str):
                self._lost(muscle.element, made)
            else:
                self.forces.append(made)
                for text in losses(muscle):
                    self._lost(muscle.element, text)
                curved += any(via.axis is not None or via.radii is not None for via in made.via)
        if curved:
            text = f"{curved} paths lie on cylinders, which have no ends here, or on ellipsoids, "
            text += "and take the shortest way, which those of OpenSim do not always"
            self.report.add("approximated", self.file.name, text, acts=True)
        for (text, acts), elements in self.lost.items():
            names = choices(shown(x.get("name")) for x in elements)
            text = f"{text}: {names}" if len(elements) > 1 else text
            self.report.add("left out", self.file.where(elements[0]), text, acts=acts)
        return list(found.values())

    def _start(
        self, bodies: Mapping[str, Body], at: tuple[str, int], before: tuple[Any, ...]
    ) -> float:
        if at not in self.follows or at in before:  # a leader, or a ring
            return bodies[at[0]].q[at[1]]
        leader, curve = self.follows[at]
        return curve.at(self._start(bodies, leader, (*before, at)))[1]

    def _made(self, kinds: Mapping[str, Any], element: Element, flag: str) -> None:
        """Convert an element of a set by its tag, or report it."""
        file = self.file
        on = file.flag(element, flag, True) and not file.flag(element, "isDisabled")
        if not on and element.tag not in CONSTRAINTS:
            self._lost(element, f"{element.tag}, which is switched off", acts=False)
            return
        if any(x.tag == "GeometryPath" for x in element.inside()):
            self.muscles.append(self.paths.muscle(element, on))
            return
        if element.tag not in kinds:
            self._lost(element, f"{element.tag}, which has no counterpart here", acts=on)
            return
        try:
            kinds[element.tag](self, element, on)
        except ModelError as error:
            where = file.where(element)
            raise ModelError([Problem(where, p.field, p.text) for p in error.problems]) from None

    def _others(self) -> None:
        """Report controllers, and parts that stand outside of the sets."""
        file = self.file
        for element in file.members("ControllerSet"):
            on = file.flag(element, "enabled", True) and not file.flag(element, "isDisabled")
            if not (on and element.tag == "PrescribedController"):
                self._lost(element, f"{element.tag}, a controller", acts=on)
        for element in file.members("ComponentSet"):
            acts = not element.tag.endswith(STILL)
            self._lost(element, f"{element.tag}, which is not read", acts=acts)
        for element in file.members("ProbeSet"):
            self._lost(element, f"{element.tag}, a probe", acts=False)

    def _lost(self, element: Element, text: str, *, acts: bool = True) -> None:
        self.lost.setdefault((text, acts), []).append(element)

    def name(self, element: Element) -> str:
        """Return the name of a part, which is its tag and line if the file has none."""
        return element.get("name") or f"{element.tag} {element.line}"

    def _told(
        self, element: Element, text: str, kind: Any = "converted", acts: bool = False
    ) -> None:
        where, name = self.file.where(element), element.get("name")
        self.report.add(kind, where, text, acts=acts, part=name)

    def _place(self, name: str, element: Element) -> tuple[str, int] | None:
        """Return the body of a coordinate and its place there, or None if it has none."""
        if name in self.joined:  # a function of another coordinate
            return None
        if name not in self.coordinates:
            text = f"names {shown(name)}; coordinates are {choices(self.coordinates)}"
            raise self.file.refuse(element, "coordinate", text)
        _, body, k = self.coordinates[name]
        return (body, k) if k >= 0 else None

    def _driven(self, element: Element) -> tuple[str, int] | None:
        """Return the place of the coordinate that a force names, or None with a line in the
        report."""
        name = self.file.socket(element, "coordinate").split("/")[-1]
        if (found := self._place(name, element)) is None:
            self._lost(element, f"{element.tag} {BALL}")
        return found

    def _end(self, element: Element, k: int) -> tuple[str, Pose]:
        """Return the body and the frame, or the point, of end k = 1 or 2 of an element."""
        names = (f"frame{k}", f"body_{k}", f"body{k}")
        body, pose = self.file.frame(self.file.socket(element, *names), element, names[0])
        place = self.file.numbers(element, f"location_body_{k}", ZERO)
        place = self.file.numbers(element, f"point{k}", place)
        turn = turned(self.file.numbers(element, f"orientation_body_{k}", ZERO))
        return body, self.poses[body] @ pose @ Pose(np.array(place), turn)

    def _ends(self, element: Element) -> tuple[dict[str, Any], Pose, Pose]:
        """Return the fields of a part between two points, from the ground to a body, and both
        frames."""
        (body, at), (other, at_other) = (self._end(element, k) for k in (2, 1))
        if body == "ground":
            (body, at), (other, at_other) = (other, at_other), (body, at)
        fields = {"name": self.name(element), "body": body, "other": other}
        return fields | {"point": at.point(ZERO), "other_point": at_other.point(ZERO)}, at, at_other

    # -- coordinates and their controls ----------------------------------------------------------

    def _held(self) -> None:
        """Hold locked coordinates, and let prescribed ones follow their functions of time."""
        for name, (c, body, k) in self.coordinates.items():
            if c.element is None or not (c.locked or c.prescribed is not None):
                continue
            word = "locked" if c.locked else "prescribed"
            if k < 0:
                self._lost(c.element, f"a {word} coordinate {BALL}")
                continue
            over_time: Any = Polynomial(coefficients=(c.start,))
            if not c.locked and c.prescribed is not None:
                over_time = self._over_time(c.prescribed, c.element)
            self.constraints.append(Motion(name=name, body=body, coordinate=k, q_of_t=over_time))
            self._told(c.element, f"the {word} coordinate is held by the motion {shown(name)}")

    def _over_time(self, element: Element, owner: Element) -> Any:
        """Return a function of time as a number, a polynomial or a table."""
        if element.tag == "PiecewiseLinearFunction":
            t, value = (self.file.list_of(element, x) for x in "xy")
            return Table(t=t, value=value)
        curve = function_of(self.file, element)
        if curve.rows:
            text = f"its {element.tag} of time is a table with another spline between its points"
            self._told(owner, text, "approximated", acts=True)
            t, value, _ = zip(*curve.rows)
            return Table(t=t, value=value)
        return Polynomial(coefficients=curve.powers)

    def _controls(self) -> dict[str, Any]:
        """Return the inputs of actuators that controllers prescribe, by the actuators' names."""
        found, file = dict[str, Any](), self.file
        for element in file.members("ControllerSet"):
            on = file.flag(element, "enabled", True) and not file.flag(element, "isDisabled")
            held = next((x for x in element.all("FunctionSet", "ControlFunctions")), None)
            held = held.first("objects") if held is not None else None
            if element.tag != "PrescribedController" or not on or held is None:
                continue
            names = [x.split("/")[-1] for x in file.text(element, "actuator_list").split()]
            names += [x.get("name") for x in held.children][len(names) :]
            for name, one in zip(names, held.children):
                try:
                    value = self._over_time(one, element)
                except FileError:  # a function that is not read
                    self._lost(element, f"{element.tag} of {shown(name)} by a {one.tag}")
                    continue
                if isinstance(value, Polynomial):
                    powers = value.coefficients
                    terms = (f"({c!r})*t^{k}" for k, c in enumerate(powers))
                    value = "=" + "+".join(terms) if any(powers[1:]) else powers[0]
                found[name] = value
        return found


# -- constraints -----------------------------------------------------------------------------------


class Coupler(NamedTuple):
    """A coordinate that follows a curve of others."""

    own: str
    leaders: list[str]
    curve: Curve
    on: bool


def coupler_of(file: Document, element: Element) -> Coupler | None:
    """Return the coupler of coordinates that an element is, or None. Raises FileError."""
    if element.tag != "CoordinateCouplerConstraint":
        return None
    held = element.first("coupled_coordinates_function")
    if held is None or not held.children:
        raise file.refuse(element, "coupled_coordinates_function", "is missing")
    leaders = file.text(element, "independent_coordinate_names").split()
    on = file.flag(element, "isEnforced", True) and not file.flag(element, "isDisabled")
    curve = Curve()
    if len(leaders) == 1:
        curve = function_of(file, held.children[0]).times(file.number(element, "scale_factor", 1.0))
    return Coupler(file.text(element, "dependent_coordinate_name"), leaders, curve, on)


def _coupler(self: Forces, element: Element, on: bool) -> None:
    coupler = coupler_of(self.file, element)
    assert coupler is not None, "it is one"
    if len(coupler.leaders) != 1:
        text = f"{element.tag}, a function of {len(coupler.leaders)} coordinates"
        self._lost(element, text, acts=on)
        return
    if coupler.own in self.joined:
        return
    own, other = (self._place(name, element) for name in (coupler.own, coupler.leaders[0]))
    if own is None or other is None:
        self._lost(element, f"{element.tag} {BALL}", acts=on)
        return
    fields: dict[str, Any] = {"name": self.name(element), "body": own[0], "coordinate": own[1]}
    fields |= {"other": other[0], "other_coordinate": other[1], "active": on}
    self.constraints.append(_relation(coupler.curve, fields))
    if on:
        self.follows[own] = other, coupler.curve
    self._told(element, f"is the {self.constraints[-1].kind} {shown(self.name(element))}")


def _relation(curve: Curve, fields: dict[str, Any]) -> Constraint:
    """Return the constraint by which a coordinate follows a curve of another one."""
    if (value := curve.constant) is not None:
        own = {name: fields[name] for name in ("name", "body", "coordinate", "active")}
        return Motion(**own, q_of_t=Polynomial(coefficients=(value,)))
    if (line := curve.line) is not None:
        return Gear(**fields, ratio=line[1], offset=line[0])
    if not curve.rows:
        return Relation(**fields, curve=Polynomial(coefficients=curve.powers))
    x, value, slope = zip(*curve.rows)
    return Relation(**fields, curve=Spline(x=x, value=value, slope=slope, kind="hermite"))


def _weld(self: Forces, element: Element, on: bool) -> None:
    fields, at, at_other = self._ends(element)
    self.constraints.append(Weld(**fields, active=on))
    self.welds.append((element, fields["body"], at.turn, fields["other"], at_other.turn))


def _point(self: Forces, element: Element, on: bool) -> None:
    self.constraints.append(Point(**self._ends(element)[0], active=on))


def _distance(self: Forces, element: Element, on: bool) -> None:
    length = self.file.number(element, "constant_distance")
    self.constraints.append(Distance(**self._ends(element)[0], length=length, active=on))


def _on_line(self: Forces, element: Element, on: bool) -> None:
    file, name = self.file, self.name(element)
    ends = [file.frame(file.socket(element, x), element, x) for x in ("follower_body", "line_body")]
    (body, at), (other, at_other) = ((x, self.poses[x] @ frame) for x, frame in ends)
    point = at.point(file.numbers(element, "point_on_follower", ZERO))
    on_line = at_other.point(file.numbers(element, "point_on_line", ZERO))
    way = at_other.turn @ file.numbers(element, "line_direction_vec", (1.0, 0.0, 0.0))
    fields: dict[str, Any] = {"name": name, "body": body, "other": other, "active": on}
    fields |= {"point": point, "other_point": on_line, "other_axis": tuple(way.tolist())}
    if body == "ground":
        fields |= {"body": other, "other": body, "point": on_line, "other_point": point}
        fields["axis"] = fields.pop("other_axis")
    self.constraints.append(Line(**fields))


CONSTRAINTS = {
    "CoordinateCouplerConstraint": _coupler,
    "WeldConstraint": _weld,
    "PointConstraint": _point,
    "ConstantDistanceConstraint": _distance,
    "PointOnLineConstraint": _on_line,
}

# -- forces ----------------------------------------------------------------------------------------


def _actuator(self: Forces, element: Element, on: bool) -> None:
    file, name = self.file, self.name(element)
    if (at := self._driven(element)) is None:
        return
    if not (gear := file.number(element, "optimal_force", 1.0)):
        self._lost(element, f"{element.tag} with an optimal_force of 0", acts=False)
        return
    fields: dict[str, Any] = {"name": name, "body": at[0], "coordinate": at[1], "gear": gear}
    for field, end in (("input_low", "min_control"), ("input_high", "max_control")):
        given = file.list_of(element, end)
        if given and math.isfinite(given[0]):
            fields[field] = given[0]
    self.forces.append(Motor(**fields, torque=self.controls.get(name, 0.0)))
    self._told(element, "is a motor, whose torque is the control and whose gear is optimal_force")


def _limit(self: Forces, element: Element, on: bool) -> None:
    """Add a motor with the stiffness and damping of a CoordinateLimitForce.

    They grow beyond a limit by the quintic step of Simbody.
    """
    file = self.file
    if (at := self._driven(element)) is None:
        return
    name = file.socket(element, "coordinate").split("/")[-1]
    radians = math.pi / 180.0 if self.coordinates[name][0].turns else 1.0
    high, low, over = (
        radians * file.number(element, x, y)
        for x, y in (("upper_limit", 0.0), ("lower_limit", 0.0), ("transition", 0.1))
    )
    up, down, damping = (
        file.number(element, x, y) / radians
        for x, y in (("upper_stiffness", 1.0), ("lower_stiffness", 1.0), ("damping", 0.001))
    )
    q, v = (f'{x}["{at[0]}"][{at[1]}]' for x in "qv")
    past = f"({q}-({high!r}))", f"(({low!r})-{q})"
    parts = (f"max(0,min(1,{x}/{over!r}))" for x in past)
    rise, fall = (f"{x}^3*(10-15*{x}+6*{x}^2)" for x in parts)
    law = f"={down!r}*{fall}*{past[1]}-{up!r}*{rise}*{past[0]}-{damping!r}*({rise}+{fall})*{v}"
    motor = Motor(name=self.name(element), body=at[0], coordinate=at[1], torque=law)
    self.forces.append(motor)
    self._told(element, "is a motor, whose torque is an expression with the same law")


def _passive(self: Forces, element: Element, on: bool) -> None:
    if (at := self._driven(element)) is None:
        return
    if at in self.springs:
        self._lost(element, f"{element.tag} on a coordinate that has one already")
        return
    values = [self.file.number(element, x) for x in ("stiffness", "rest_length", "viscosity")]
    if min(values[0], values[2]) < 0.0:
        raise self.file.refuse(element, "stiffness", "and viscosity must be >= 0")
    self.springs[at] = Spent(*values)
    self._told(element, f"is the stiffness, rest and damping of {shown(at[0])}")


def _spring(self: Forces, element: Element, on: bool) -> None:
    fields, file = self._ends(element)[0], self.file
    stiffness, rest = (file.number(element, x) for x in ("stiffness", "rest_length"))
    self.forces.append(Spring(**fields, stiffness=stiffness, rest=rest))


def _bushing(self: Forces, element: Element, on: bool) -> None:
    """Add a bushing: e is the pose of the second frame in the first one, as in OpenSim."""
    file = self.file
    (other, first), (body, second) = (self._end(element, k) for k in (1, 2))
    if body == "ground":
        (body, second), (other, first) = (other, first), (body, second)
    rows: dict[str, Any] = {
        field: [x for kind in ("translational", "rotational")
                for x in file.numbers(element, f"{kind}_{field}", ZERO)]
        for field in ("stiffness", "damping")
    }  # fmt: skip
    self.forces.append(
        Bushing(
            name=self.name(element), body=body, other=other, point=second.point(ZERO),
            other_point=first.point(ZERO), rotation=second.quaternion,
            other_rotation=first.quaternion, **rows,
        )
    )  # fmt: skip
    if any(rows["stiffness"][3:]) or any(rows["damping"][3:]):
        text = "its rotation is a vector here, in OpenSim three angles; small ones are the same"
        self._told(element, text, "approximated", acts=True)


def _wrench(self: Forces, element: Element, on: bool) -> None:
    file, turns = self.file, element.tag == "TorqueActuator"
    names = ("bodyA", "body_a") if turns else ("body",)
    body, frame = file.frame(file.socket(element, *names), element, "body")
    against = file.socket(element, "bodyB", "body_b") if turns else ""
    if body == "ground" or (against and file.frame(against, element, "bodyB")[0] != "ground"):
        self._lost(element, f"{element.tag} between two bodies")
        return
    whole = file.flag(element, "torque_is_global" if turns else "force_is_global", turns)
    fields: dict[str, Any] = {"name": self.name(element), "body": body}
    fields["frame"] = "world" if whole else "body"
    at = self.poses[body] @ frame
    if not turns and not file.flag(element, "point_is_global"):
        fields["point"] = at.point(file.numbers(element, "point", ZERO))
    way = np.array(file.numbers(element, "axis" if turns else "direction", (1.0, 0.0, 0.0)))
    way = file.number(element, "optimal_force", 1.0) * (way if whole else at.turn @ way)
    self.forces.append(Wrench(**fields))
    text = f"is a wrench of zero; a control of 1 is {shown(way.tolist())}"
    self._told(element, text)


FORCES = {
    "CoordinateActuator": _actuator,
    "CoordinateLimitForce": _limit,
    "SpringGeneralizedForce": _passive,
    "PointToPointSpring": _spring,
    "BushingForce": _bushing,
    "PointActuator": _wrench,
    "TorqueActuator": _wrench,
}
