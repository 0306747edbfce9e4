"""Joints of OpenSim as motions of bodies.

A joint is a displacement along axes of its parent's frame and then rotations, each by a function of
a coordinate. A coordinate of one motion is this motion, and one of several, or with another
function, moves a body along a curve. Frames of bodies are those of their joints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..errors import ModelError, choices, shown
from ..rotation import quaternion_of, rodrigues, unit_vector
from ..tracks import Track
from .conversion import NO_LIMIT
from .osim_functions import Curve, function_of, total
from .osim_text import Array, Document, Element, Pose, turned

X, Y, Z = np.eye(3)
ROTATIONS, LINE = ("rotation1", "rotation2", "rotation3"), Curve((0.0, 1.0))
SINGLE = {  # joints by their motions: whether it turns, its axis, its coordinate
    "WeldJoint": (),
    "PinJoint": ((True, Z, 0),),
    "SliderJoint": ((False, X, 0),),
    "UniversalJoint": ((True, X, 0), (True, Y, 1)),
    "GimbalJoint": ((True, X, 0), (True, Y, 1), (True, Z, 2)),
    "PlanarJoint": ((False, X, 1), (False, Y, 2), (True, Z, 0)),
}
SIZES = {"BallJoint": 3, "FreeJoint": 6} | {
    kind: 1 + max((k for _, _, k in own), default=-1) for kind, own in SINGLE.items()
}
READ = (*SINGLE, "BallJoint", "FreeJoint", "CustomJoint")


class Coordinate(NamedTuple):
    """A coordinate of a joint as the file gives it."""

    name: str
    element: Element | None
    start: float = 0.0  # [rad, m]
    speed: float = 0.0
    range: tuple[float, float] | None = None
    clamped: bool = False
    locked: bool = False
    prescribed: Element | None = None
    turns: bool = False  # alone and evenly, so that forces on it are given in degrees


class Axis(NamedTuple):
    """A displacement along, or a rotation about, an axis by a function of a coordinate."""

    turns: bool
    axis: Array
    curve: Curve
    coordinate: int | None  # None if it is constant


class Joint(NamedTuple):
    """A joint of the file, between a frame on its parent and one on its child."""

    name: str
    kind: str
    element: Element
    parent: str
    child: str
    at_parent: Pose
    at_child: Pose
    coordinates: list[Coordinate]
    follows: Mapping[str, tuple[str, Curve]] = MappingProxyType({})  # to leaders in this joint


class Link(NamedTuple):
    """A body or a massless one before it: its fields, and the coordinates of its q by number."""

    fields: dict[str, Any]
    numbers: list[int]


def coordinate_of(file: Document, element: Element) -> Coordinate:
    """Return a coordinate. Raises FileError."""
    ends = file.list_of(element, "range")
    if ends and len(ends) != 2:
        text = f"takes a lower and an upper end, got {shown(file.text(element, 'range'))}"
        raise file.refuse(element, "range", text)
    bounded = bool(ends) and ends[0] < ends[1] and max(map(abs, ends)) < NO_LIMIT
    function = element.first("prescribed_function")
    held = function is not None and function.children and file.flag(element, "prescribed")
    start = file.number(element, "default_value")
    return Coordinate(
        element.get("name"), element, start, file.number(element, "default_speed_value"),
        (ends[0], ends[1]) if bounded else None, file.flag(element, "clamped"),
        file.flag(element, "locked"), function.children[0] if function and held else None,
    )  # fmt: skip


# -- the motions of a joint ------------------------------------------------------------------------


class Chain:
    """The bodies of a joint: the child, and a massless body before each curve but the last."""

    def __init__(self, file: Document, joint: Joint):
        self.file, self.joint = file, joint
        self.links: list[Link] = []
        self.home = joint.at_parent  # pose of the frame before the next motion in that of its body
        self.turn = np.eye(3)  # constant rotations since then
        self.motions: list[tuple[str, Array]] = []  # kind, axis in the axes of the body before
        self.curve: tuple[Array, list[Axis], Coordinate] | None = None
        self.numbers: list[int] = []
        if joint.kind in SIZES:
            self._sized(SIZES[joint.kind])
        if joint.kind not in READ:
            known = choices(kind.removesuffix("Joint") for kind in READ)
            text = f"{joint.kind} is not read; joints that are: {known}. "
            text += "Replace it by a CustomJoint with the same motions in OpenSim"
            raise file.refuse(joint.element, "", text)

    def result(self) -> list[Link]:
        """Return the bodies from the parent to the child. Raises FileError."""
        if self.joint.kind in ("BallJoint", "FreeJoint"):
            return [self._ball()]
        axes = self._axes()
        for one in axes:
            if one.coordinate is not None and abs((one.curve.line or (0.0, 0.0))[1]) == 1.0:
                c = self.joint.coordinates[one.coordinate]
                self.joint.coordinates[one.coordinate] = c._replace(turns=one.turns)
        for block in self._blocks([self._led(x) for x in axes]):
            self._add(block)
        self._close()
        return self.links

    def _sized(self, count: int) -> None:
        given = len(self.joint.coordinates)
        if given != count:
            text = f"a {self.joint.kind} has {count}, got {given}"
            raise self.file.refuse(self.joint.element, "coordinates", text)

    def _axes(self) -> list[Axis]:
        """Return all displacements and then all rotations, without those that are zero."""
        if self.joint.kind in SINGLE:
            return [Axis(turns, axis, LINE, k) for turns, axis, k in SINGLE[self.joint.kind]]
        file, element = self.file, self.joint.element
        transform = element.first("SpatialTransform")
        if transform is None:
            raise file.refuse(element, "SpatialTransform", "is missing in a CustomJoint")
        names = [c.name for c in self.joint.coordinates]
        found = list[Axis]()
        for one in transform.all("TransformAxis"):
            given = file.text(one, "coordinates").split() or file.text(one, "coordinate").split()
            what = f"axis {shown(one.get('name'))}"
            if len(given) > 1:
                text = f"its {what} is a function of {len(given)} coordinates, {choices(given)}; "
                raise file.refuse(element, "SpatialTransform", text + "one at most is read")
            if unknown := [x for x in given if x not in names]:
                text = f"its {what} names {shown(unknown[0])}, which is no coordinate of the joint:"
                raise file.refuse(element, "SpatialTransform", f"{text} {choices(names) or 'none'}")
            curve = self._curve_of(one)
            axis = np.array(file.numbers(one, "axis", (1.0, 0.0, 0.0)))
            if not 1e-9 < math.hypot(*axis) < 1e9:
                text = f"the axis of its {what} must not be zero, got {axis.tolist()}"
                raise file.refuse(element, "SpatialTransform", text)
            moves = bool(given) and curve.constant is None
            number = names.index(given[0]) if moves else None
            found.append(Axis(one.get("name") in ROTATIONS, unit_vector(axis), curve, number))
        found = [x for x in found if x.coordinate is not None or x.curve.constant != 0.0]
        self._all_used(found, names)
        return [*(x for x in found if not x.turns), *(x for x in found if x.turns)]

    def _led(self, one: Axis) -> Axis:
        """Return a motion whose coordinate follows another of the joint as a motion of this one."""
        coordinates = self.joint.coordinates
        while one.coordinate is not None:
            name = coordinates[one.coordinate].name
            if name not in self.joint.follows:
                break
            leader, curve = self.joint.follows[name]
            if (line := one.curve.line) is None:
                text = f"{shown(name)} follows {shown(leader)}, and moves by a curve of its own; "
                text += "give it a LinearFunction, or let it follow nothing"
                raise self.file.refuse(self.joint.element, "SpatialTransform", text)
            curve = total([curve.times(line[1]), Curve((line[0],))])
            number = [c.name for c in coordinates].index(leader)
            one = one._replace(
                curve=curve, coordinate=None if curve.constant is not None else number
            )
        return one

    def _all_used(self, axes: list[Axis], names: list[str]) -> None:
        used = {x.coordinate for x in axes}
        if idle := [name for k, name in enumerate(names) if k not in used]:
            text = f"coordinate {shown(idle[0])} moves nothing; remove it, or give it an axis"
            raise self.file.refuse(self.joint.element, "coordinates", text)

    def _curve_of(self, one: Element) -> Curve:
        held = one.first("function")
        inner = held.children if held is not None else []
        if not inner:  # versions before 3 have the function without the element around it
            inner = [x for x in one.children if x.tag not in ("coordinates", "axis", "function")]
        return function_of(self.file, inner[0]) if inner else Curve((0.0,))

    def _blocks(self, axes: list[Axis]) -> list[list[Axis]]:
        """Return the motions in their order, those of a coordinate with several as one block."""
        slides, turns = [x for x in axes if not x.turns], [x for x in axes if x.turns]
        after, waiting = list[list[Axis]](), list[Axis]()
        for x in turns:
            if x.coordinate is None:
                waiting.append(x)
                continue
            moving = [block for block in after if block[0].coordinate is not None]
            if moving and moving[-1][0].coordinate == x.coordinate:
                moving[-1] += [*waiting, x]
            elif earlier := [block for block in moving if block[0].coordinate == x.coordinate]:
                self._refuse(earlier[0][0], moving[-1][0])
            else:
                after += [*([y] for y in waiting), [x]]
            waiting = []
        after += [[y] for y in waiting]
        both = {x.coordinate for x in slides} & {x.coordinate for x in turns} - {None}
        first = next((k for k, x in enumerate(after) if x[0].coordinate is not None), 0)
        for k in both - {after[first][0].coordinate if after else None}:
            self._refuse(next(x for x in turns if x.coordinate == k), after[first][0])
        if both:  # its displacement is before all rotations, also constant ones
            own = [x for x in slides if x.coordinate in both]
            after[: first + 1] = [[*own, *(x for block in after[: first + 1] for x in block)]]
        before = list[list[Axis]]()
        for k in dict.fromkeys(x.coordinate for x in slides if x.coordinate not in both):
            own = [x for x in slides if x.coordinate == k]
            before += [[x] for x in own] if k is None else [own]
        return [*before, *after]

    def _refuse(self, own: Axis, other: Axis) -> None:
        names = [self.joint.coordinates[x.coordinate or 0].name for x in (own, other)]
        text = f"the motions of {shown(names[0])} have a rotation of {shown(names[1])} between "
        text += "them, which no curve of one coordinate has; put a body between them"
        raise self.file.refuse(self.joint.element, "SpatialTransform", text)

    def _add(self, block: list[Axis]) -> None:
        """Append a motion, a curve or a constant."""
        one = block[0]
        if one.coordinate is None:
            self._fix(one, one.curve.constant or 0.0)
            return
        line = one.curve.line
        number = next(x.coordinate for x in block if x.coordinate is not None)
        if len(block) > 1 or line is None or abs(line[1]) != 1.0:
            if self.curve is not None:
                self._close(self.joint.coordinates[number].name)
            self.curve = self.home.turn @ self.turn, block, self.joint.coordinates[number]
            self.motions.append(("curve", Z))
        else:
            axis = self.home.turn @ self.turn @ one.axis * line[1]
            self.motions.append(("rotate" if one.turns else "translate", axis))
            self._fix(one, line[0])
        self.numbers.append(number)

    def _fix(self, one: Axis, value: float) -> None:
        """Append a constant displacement or rotation."""
        if one.turns:
            self.turn = self.turn @ rodrigues(one.axis, value)
        else:
            place = self.home.place + self.home.turn @ one.axis * value
            self.home = Pose(place, self.home.turn)

    def _close(self, before: str = "") -> None:
        """Finish a body, which is massless if it comes before a coordinate."""
        turn = self.home.turn @ self.turn
        axes = [tuple((turn.T @ axis).tolist()) for _, axis in self.motions]
        fields: dict[str, Any] = {
            "link": tuple(self.home.place.tolist()),
            "rotation": quaternion_of(turn),
            "motions": [(kind, axis) for (kind, _), axis in zip(self.motions, axes)],
        }
        if self.curve is not None:
            fields["track"] = self._track(turn)
        if before:
            fields["before"] = before
        self.links.append(Link(fields, self.numbers))
        self.home, self.turn = Pose(np.zeros(3), np.eye(3)), np.eye(3)
        self.motions, self.numbers, self.curve = [], [], None

    # -- curves ----------------------------------------------------------------------------------

    def _track(self, turn: Array) -> Track:
        """Return the track in the axes of the body, whose orientation at home is `turn`."""
        assert self.curve is not None, "the body has one"
        start, block, coordinate = self.curve
        own, low, high = turn.T @ start, *self._ends(block, coordinate)
        slides, turns = [x for x in block if not x.turns], [x for x in block if x.turns]
        try:
            along = [
                total([x.curve.times(float(c)) for x, c in zip(slides, row) if c])
                for row in np.array([own @ x.axis for x in slides]).reshape(-1, 3).T
            ]
            fields: dict[str, Any] = {n: f.within(low, high) for n, f in zip("xyz", along)}
            fields["angles"] = tuple(x.curve.within(low, high) for x in turns)
            fields["axes"] = tuple(tuple((own @ x.axis).tolist()) for x in turns)
            fields["unit"] = "rad" if turns else "m"
            return Track(range=(low, high), **fields)
        except (ValueError, ModelError) as error:
            text = error.problems[0].text if isinstance(error, ModelError) else str(error)
            text = f"the curve of {shown(coordinate.name)}: {text}"
            raise self.file.refuse(self.joint.element, "SpatialTransform", text) from None

    def _ends(self, block: list[Axis], coordinate: Coordinate) -> tuple[float, float]:
        """Return the ends of a track: all knots and the range, and half a turn beyond.

        The range counts within two turns, since ±99999.9 stands for none.
        """
        most = 2.0 * math.tau
        places = [row[0] for x in block for row in x.curve.rows]
        places += [coordinate.start, *(min(max(x, -most), most) for x in coordinate.range or ())]
        low, high = min(places), max(places)
        more = math.pi if any(x.turns for x in block) else max(high - low, 1.0)
        return low - more, high + more

    # -- joints with a quaternion ----------------------------------------------------------------

    def _ball(self) -> Link:
        """Return the body of a ball or free joint, with q from angles about x, y and z."""
        place, turn = self.joint.at_parent
        starts = [c.start for c in self.joint.coordinates]
        whole = turn @ turned(tuple(starts[:3]))
        speeds = [turn @ np.array(x) for x in self._speeds()]
        if self.joint.kind == "FreeJoint":
            q = (place + turn @ np.array(starts[3:])).tolist() + list(quaternion_of(whole))
            fields: dict[str, Any] = {"joint": "free", "q": q}
        else:
            q = list(quaternion_of(whole @ turn.T))
            fields = {"joint": "spherical", "q": q, "link": tuple(place.tolist())}
            fields["rotation"] = quaternion_of(turn)
        return Link(fields | {"v": np.concatenate(speeds).tolist()}, [])

    def _speeds(self) -> list[list[float]]:
        """Return the angular and the linear velocity: OpenSim's speeds of the joint."""
        speeds = [c.speed for c in self.joint.coordinates]
        return [speeds[:3], speeds[3:]] if len(speeds) > 3 else [speeds]
