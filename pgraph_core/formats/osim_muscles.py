"""Paths of OpenSim, with the muscles, springs and ligaments that act along them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np

from ..errors import shown
from ..model import Force
from .osim_functions import Curve, function_of
from .osim_text import Document, Element, Pose, turned

ZERO = (0.0, 0.0, 0.0)
Where = tuple[str, int]  # body and number of a coordinate
Placed = Callable[[str, Element], Where | None]
SIZES = {  # obstacles: the elements of their sizes [m]
    "WrapSphere": (("radius", 1),),
    "WrapCylinder": (("radius", 1), ("length", 1)),
    "WrapEllipsoid": (("dimensions", 3),),
    "WrapTorus": (("inner_radius", 1), ("outer_radius", 1)),
}
QUADRANTS = ("all", "x", "+x", "-x", "y", "+y", "-y", "z", "+z", "-z")


class PathPoint(NamedTuple):
    """A point of a path in the axes of a body.

    One with a `range` belongs to the path only while its `coordinate` is within it. One with
    `curves` moves: they are its x, y and z in the frame `at`, by a `coordinate` each.
    """

    name: str
    body: str
    point: tuple[float, float, float]  # [m], none of a moving one
    coordinate: tuple[Where | None, ...] = ()
    range: tuple[float, float] | None = None
    curves: tuple[Curve, ...] = ()
    at: Pose | None = None


class Obstacle(NamedTuple):
    """A round obstacle on a body that a path wraps. Axes: z is that of a cylinder or torus."""

    name: str
    kind: str  # a key of SIZES
    body: str
    at: Pose
    sizes: tuple[float, ...]
    quadrant: str  # the side on which the path lies: one of QUADRANTS
    active: bool


class Wrap(NamedTuple):
    """That a path wraps an obstacle, between two of its points if `range` is given."""

    obstacle: Obstacle
    method: Literal["hybrid", "midpoint", "axial"]
    range: tuple[int, int] | None  # numbers of points, from 1


class Path(NamedTuple):
    """The points of a path in their order, and the obstacles that it wraps."""

    points: tuple[PathPoint, ...]
    wraps: tuple[Wrap, ...]


class Muscle(NamedTuple):
    """What acts along a path: its kind, such as Thelen2003Muscle, and all its numbers and flags."""

    name: str
    kind: str
    path: Path
    numbers: Mapping[str, float]
    element: Element
    on: bool


def muscle_of(muscle: Muscle) -> Force | str:
    """Return the force that a muscle is, or the reason why there is none."""
    return f"{muscle.kind} along its path"


# -- reading ---------------------------------------------------------------------------------------


def obstacles_of(file: Document, poses: Mapping[str, Pose]) -> dict[str, Obstacle]:
    """Return the obstacles of all bodies by name. Raises FileError."""
    found = dict[str, Obstacle]()
    bodies = [x for x in file.members("BodySet") if x.tag == "Body"]
    for body in (*bodies, *file.model.all("Ground")):
        name = body.get("name") or "ground"
        held = body.first("WrapObjectSet")
        held = held.first("objects") if held is not None else None
        for element in held.children if held is not None else ():
            if element.tag not in SIZES:
                text = f"{element.tag} is not read; obstacles are {', '.join(SIZES)}"
                raise file.refuse(element, "", text)
            turn = turned(file.numbers(element, "xyz_body_rotation", ZERO))
            at = poses[name] @ Pose(np.array(file.numbers(element, "translation", ZERO)), turn)
            sizes = [x for n, k in SIZES[element.tag] for x in file.numbers(element, n, (0.0,) * k)]
            if not all(x > 0.0 for x in sizes):
                raise file.refuse(element, "", f"its sizes must be > 0 [m], got {shown(sizes)}")
            quadrant = file.text(element, "quadrant", "all").lower() or "all"
            if quadrant not in QUADRANTS:
                text = f"must be one of {', '.join(QUADRANTS)}, got {shown(quadrant)}"
                raise file.refuse(element, "quadrant", text)
            active = file.flag(element, "active", True)
            own = element.get("name")
            found[own] = Obstacle(own, element.tag, name, at, tuple(sizes), quadrant, active)
    return found


class Paths:
    """Reads paths."""

    def __init__(self, file: Document, poses: Mapping[str, Pose], placed: Placed):
        self.file, self.poses, self.placed = file, poses, placed
        self.obstacles = obstacles_of(file, poses)

    def muscle(self, element: Element, on: bool) -> Muscle:
        """Return what acts along the path inside an element. Raises FileError."""
        path = next(x for x in element.inside() if x.tag == "GeometryPath")
        numbers = dict[str, float]()
        for child in (*self.file.defaults(element), *element.children):
            text = child.text.strip()
            if child.children or len(text.split()) != 1:
                continue
            if text.lower() in ("true", "false"):
                numbers[child.tag] = float(text.lower() == "true")
                continue
            try:
                numbers[child.tag] = float(text)
            except ValueError:  # a name
                continue
        return Muscle(element.get("name"), element.tag, self.path(path), numbers, element, on)

    def path(self, element: Element) -> Path:
        """Return a path. Raises FileError."""
        points = [self._point(x) for x in _held(element, "PathPointSet")]
        wraps = list[Wrap]()
        for one in _held(element, "PathWrapSet"):
            name = self.file.socket(one, "wrap_object").split("/")[-1]
            if name not in self.obstacles:
                text = f"names {shown(name)}, which is no obstacle of a body"
                raise self.file.refuse(one, "wrap_object", text)
            low, high = (int(x) for x in self.file.numbers(one, "range", (-1.0, -1.0)))
            method = self.file.text(one, "method", "hybrid").lower()
            ends = (
                None if low < 1 and high < 1 else (max(low, 1), high if high > 0 else len(points))
            )
            if method not in ("hybrid", "midpoint", "axial"):
                text = f"must be one of hybrid, midpoint, axial, got {shown(method)}"
                raise self.file.refuse(one, "method", text)
            wraps.append(Wrap(self.obstacles[name], method, ends))
        return Path(tuple(points), tuple(wraps))

    def _point(self, element: Element) -> PathPoint:
        file = self.file
        body, frame = file.frame(file.socket(element, "parent_frame", "body"), element, "body")
        at, name = self.poses[body] @ frame, element.get("name")
        if element.tag == "MovingPathPoint":
            curves, where = list[Curve](), list[Where | None]()
            for axis in "xyz":
                held = element.first(f"{axis}_location")
                curve = function_of(file, held.children[0]) if held and held.children else Curve()
                curves.append(curve)
                path = file.socket(element, f"{axis}_coordinate").split("/")[-1]
                still = curve.constant is not None
                where.append(None if still else self.placed(path, element))
            return PathPoint(name, body, ZERO, tuple(where), None, tuple(curves), at)
        point = at.point(file.numbers(element, "location", ZERO))
        if element.tag != "ConditionalPathPoint":
            return PathPoint(name, body, point)
        low, high = file.numbers(element, "range", (0.0, 0.0))
        coordinate = self.placed(file.socket(element, "coordinate").split("/")[-1], element)
        return PathPoint(name, body, point, (coordinate,), (low, high))


def _held(element: Element, name: str) -> list[Element]:
    found = element.first(name)
    found = found.first("objects") if found is not None else None
    return found.children if found is not None else []
