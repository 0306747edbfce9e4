"""Paths of OpenSim, with the muscles, springs and ligaments that act along them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from .. import forces as kinds
from ..errors import ModelError, shown
from ..fields import GROUND
from ..forces import BetweenPoints, LinearActuator, Shift, Strut, Via, Within
from ..forces.muscle import STEEPEST
from ..forces.riding import CoordinateOf, shifted
from ..rotation import quaternion_of, unit_vector
from ..tolerances import NOTABLE, TINY
from .osim_functions import Curve, function_of
from .osim_text import Array, Document, Element, Pose, turned

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
    point: tuple[float, float, float]  # [m], of a moving one without its shifts
    coordinate: tuple[Where | None, ...] = ()
    range: tuple[float, float] | None = None
    curves: tuple[Curve, ...] = ()
    at: Pose | None = None

    @property
    def shifts(self) -> tuple[Shift, ...]:
        """The displacements of a moving point in its body. Raises ModelError."""
        assert self.at is not None or not self.curves, "a moving point has a frame"
        found = list[Shift]()
        for k, curve in enumerate(self.curves):
            if curve.constant is None and (where := self.coordinate[k]) is not None:
                along = self.at.turn[:, k] if self.at is not None else ZERO
                found.append(Shift(
                    body=where[0], coordinate=where[1], along=along, curve=_function_of(curve)
                ))  # fmt: skip
        return tuple(found)

    @property
    def when(self) -> Within | None:
        """The range of a coordinate in which it counts, or None."""
        if self.range is None or self.coordinate[0] is None:
            return None
        body, k = self.coordinate[0]
        return Within(body=body, coordinate=k, low=self.range[0], high=self.range[1])

    @property
    def lost(self) -> str:
        """The reason why there is no such point, or ""."""
        moving = any(c.constant is None and w is None for c, w in zip(self.curves, self.coordinate))
        if not moving and (self.range is None or self.coordinate[0] is not None):
            return ""
        word = "moving" if moving else "conditional"
        return (
            f"with a {word} point, by a coordinate that follows in its joint or is of a quaternion"
        )


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
    """An obstacle that a path wraps, between two of its points if `range` is given."""

    obstacle: Obstacle
    method: Literal["hybrid", "midpoint", "axial"]
    range: tuple[int, int] | None  # numbers of points, from 1


class Path(NamedTuple):
    """The points of a path in their order, and the obstacles that it wraps."""

    points: tuple[PathPoint, ...]
    wraps: tuple[Wrap, ...]


class Numbers:
    """The numbers and flags in an element by name, which know for which of them one asked.

    The texts of what is neither are NaN.
    """

    def __init__(self, given: Mapping[str, str]):
        self.given, self.asked = given, set[str]()

    def __contains__(self, name: str) -> bool:
        return name in self.given

    def __getitem__(self, name: str) -> float:
        self.asked.add(name)
        return value_of(self.given[name])

    def get(self, name: str, usual: float | None = None) -> Any:
        """Return a number, or `usual` without one."""
        return self[name] if name in self.given else usual

    def left(self) -> Iterator[str]:
        """Yield those for which nothing asked, and with which a force is not as without them."""
        for name, text in self.given.items():
            if name in self.asked or not IDLE.isdisjoint((name, name.split("/")[0])):
                continue
            if not math.isclose(value_of(text), NONE.get(name, math.nan), rel_tol=NOTABLE):
                yield f"{name} {text}"


class Muscle(NamedTuple):
    """A force along a path: its kind, such as Thelen2003Muscle, and all its numbers and flags."""

    name: str
    kind: str
    path: Path
    numbers: Numbers
    element: Element
    on: bool


AtStart = Callable[[str, Any], Array]  # body, point [m]: its place at the start (3,) [m]


def muscle_of(
    muscle: Muscle, at_start: AtStart, start: CoordinateOf, control: Any
) -> BetweenPoints | str:
    """Return the force that acts along a path, or the reason why there is none.

    `start(body, k)` is a coordinate at the start, and `control` its excitation, or its input.
    """
    ways = _ways(muscle.path, at_start, start)
    if isinstance(ways, str):
        return f"{muscle.kind} along a path {ways}"
    n, fields = muscle.numbers, dict[str, Any](ways)
    fields["name"] = muscle.name
    try:
        if muscle.kind in MODELS:
            return _muscle(muscle, {**fields, "excitation": control})
        if muscle.kind == "PathActuator":
            given = {"input_low": n.get("min_control"), "input_high": n.get("max_control")}
            bounds: dict[str, Any] = {
                k: x for k, x in given.items() if x is not None and math.isfinite(x)
            }
            gain = -n.get("optimal_force", 1.0)
            return LinearActuator(**fields, **bounds, gain=gain, input=control)
        if muscle.kind == "PathSpring" and not n.get("dissipation", 0.01):
            rest, stiffness = n.get("resting_length", 0.05), n.get("stiffness", 1.0)
            pull: Any = {"x": (0.0, rest, 2.0 * rest), "value": (0.0, 0.0, stiffness * rest)}
            return Strut(**fields, spring=pull)
    except ModelError as error:
        return f"{muscle.kind}: {error.problems[0]}"
    return f"{muscle.kind} along its path"


def losses(muscle: Muscle) -> Iterator[str]:
    """Yield texts about the numbers of a muscle that the force which was made of it lacks."""
    for text in muscle.numbers.left():
        yield f"{muscle.kind} with {text}, for which it has no number here"


def _muscle(muscle: Muscle, fields: dict[str, Any]) -> BetweenPoints:
    kind, n = MODELS[muscle.kind], muscle.numbers
    usual = {**USUAL, **kind.usual}
    for ours, theirs in FIELDS.items():
        if (value := n.get(theirs, usual.get(theirs))) is not None:
            fields[ours] = value
    shape = {ours: n[theirs] for theirs, ours in kind.shape.items() if theirs in n}
    if kind.model == "millard2012":
        shape |= _slopes(n)
        shape["least_active"] = 0.0
        if not n.get("fiber_damping", 0.1):
            shape["least_active"] = n.get("ActiveForceLengthCurve/minimum_value", 0.1)
        n.asked.add("ActiveForceLengthCurve/minimum_value")  # without effect if there is damping
    if n.get("ignore_passive_fiber_force"):
        shape["passive_force"] = 0.0
    if n.get("ignore_tendon_compliance"):
        fields["tendon"] = "rigid"
    if not fields["pennation"]:
        n.asked.add("maximum_pennation_angle")  # without effect if there is none
    return kinds.Muscle(**fields, model=kind.model, shape=shape)


def _slopes(n: Numbers) -> dict[str, float]:
    """Return the slopes of the curves of Millard at force 1, over the mean ones to there."""
    found = dict[str, float]()
    for curve, low, high, name in (
        ("Fiber", 0.0, 0.7, "passive"),
        ("Tendon", 0.0, 0.049, "tendon"),
    ):
        curve = f"{curve}ForceLengthCurve/"
        if (slope := n.get(f"{curve}stiffness_at_one_norm_force")) is not None:
            zero = n.get(f"{curve}strain_at_zero_force", low)
            strain = n.get(f"{curve}strain_at_one_norm_force", high)
            found[f"{name}_stiffness"] = slope * (strain - zero)
    return found


def _function_of(curve: Curve) -> Any:
    """Return a function of a coordinate, a spline with a straight line beyond its ends."""
    if not curve.rows:
        return {"kind": "polynomial", "coefficients": curve.powers}
    x, value, slope = zip(*curve.rows)
    return {"kind": "hermite", "x": x, "value": value, "slope": slope}


def _ways(given: Path, at_start: AtStart, start: CoordinateOf) -> dict[str, Any] | str:
    """Return the points and obstacles as fields of a path, or the reason why it has none."""
    if lost := next((x.lost for x in given.points if x.lost), ""):
        return lost
    if len(given.points) < 2:
        return "of less than two points"
    if given.points[0].range or given.points[-1].range:
        return "with a conditional point at an end, where it has no length without it"
    try:
        shifts = [x.shifts for x in given.points]
    except ModelError as error:
        return f"with a moving point, whose {error.problems[0].field} {error.problems[0].text}"
    places = [
        x._replace(point=shifted(x.point, own, start)) for x, own in zip(given.points, shifts)
    ]
    path = given._replace(points=tuple(places))  # at the start
    between: dict[int, list[Obstacle]] = {}
    for wrap in path.wraps:
        if not wrap.obstacle.active:
            continue
        if wrap.obstacle.kind == "WrapTorus":
            return f"around a {wrap.obstacle.kind}"
        between.setdefault(_span(path, wrap, at_start), []).append(wrap.obstacle)
    via = list[Via]()
    for k, point in enumerate(given.points):
        if 0 < k < len(path.points) - 1:
            fields = {"body": point.body, "point": point.point}
            via.append(Via(**fields, shifts=shifts[k], when=point.when))
        if own := between.get(k):
            ends = [at_start(x.body, x.point) for x in path.points[k : k + 2]]
            way = ends[1] - ends[0]
            own.sort(key=lambda x, way=way: float(way @ at_start(x.body, x.at.place)))
            via += [_via(x, ends, at_start, alone=len(own) == 1) for x in own]
    ends = (given.points[0], shifts[0]), (given.points[-1], shifts[-1])
    if ends[0][0].body == GROUND:
        ends, via = ends[::-1], via[::-1]
    (first, own), (last, other) = ends
    found = dict[str, Any](body=first.body, point=first.point, shifts=own)
    found |= {"other": last.body, "other_point": last.point, "other_shifts": other}
    return found | {"via": via}


def _span(path: Path, wrap: Wrap, at_start: AtStart) -> int:
    """Return the number of the point after which a path comes nearest to an obstacle."""
    low, high = wrap.range or (1, len(path.points))
    places = [at_start(x.body, x.point) for x in path.points]
    spans = range(max(low, 1) - 1, max(min(high, len(places)) - 1, low))
    return min(spans, key=lambda k: _apart(wrap.obstacle, places[k : k + 2], at_start)[0])


def _apart(obstacle: Obstacle, ends: Sequence[Array], at_start: AtStart) -> tuple[float, Array]:
    """Return the distance of a line from an obstacle's centre or axis at the start, and its
    direction."""
    centre, axis = _centred(obstacle, at_start)
    a, b = (x - centre - axis * (axis @ (x - centre)) for x in ends)
    way = b - a
    share = float(np.clip(-(a @ way) / max(way @ way, TINY), 0.0, 1.0))
    nearest = a + share * way
    return float(np.linalg.norm(nearest)), nearest


def _centred(obstacle: Obstacle, at_start: AtStart) -> tuple[Array, Array]:
    """Return the centre of an obstacle, and the axis of a cylinder or zero, at the start."""
    centre = at_start(obstacle.body, obstacle.at.place)
    if obstacle.kind != "WrapCylinder":
        return centre, np.zeros(3)
    return centre, at_start(obstacle.body, obstacle.at.point((0.0, 0.0, 1.0))) - centre


def _via(obstacle: Obstacle, ends: Sequence[Array], at_start: AtStart, *, alone: bool) -> Via:
    """Return an obstacle of a path, in a row with the side on which the line is at the start."""
    sizes = obstacle.sizes[:1] if obstacle.kind == "WrapCylinder" else obstacle.sizes
    at, far = obstacle.at, 2.0 * max(sizes)
    side = None
    if obstacle.quadrant != "all":
        sign = -1.0 if obstacle.quadrant[0] == "-" else 1.0
        way = sign * np.eye(3)["xyz".index(obstacle.quadrant[-1])]
        side = at.point(far * way)
    elif not alone:
        centre = at_start(obstacle.body, at.place)
        way = _apart(obstacle, ends, at_start)[1]
        units = [at_start(obstacle.body, at.place + x) - centre for x in np.eye(3)]
        way = np.array(units) @ unit_vector(way if way.any() else units[0])
        side = tuple((at.place + far * way).tolist())
    found: dict[str, Any] = {"body": obstacle.body, "point": tuple(at.place.tolist()), "side": side}
    if obstacle.kind == "WrapEllipsoid":
        return Via(**found, radii=obstacle.sizes, rotation=quaternion_of(at.turn))
    axis = tuple(at.turn[:, 2].tolist()) if obstacle.kind == "WrapCylinder" else None
    return Via(**found, radius=obstacle.sizes[0], axis=axis)


FIELDS = {  # fields of muscles: names in the file
    "f_max": "max_isometric_force",
    "l_opt": "optimal_fiber_length",
    "l_slack": "tendon_slack_length",
    "pennation": "pennation_angle_at_optimal",
    "fastest": "max_contraction_velocity",
    "weakest": "minimum_activation",
    "start": "default_activation",
    "rise": "activation_time_constant",
    "fall": "deactivation_time_constant",
    "damping": "fiber_damping",
}
USUAL = {  # values in OpenSim 4.6 without them in the file, where those of our models differ
    "max_isometric_force": 1000.0,
    "optimal_fiber_length": 0.1,
    "tendon_slack_length": 0.2,
    "pennation_angle_at_optimal": 0.0,
    "default_activation": 0.05,
}
# numbers that no field has, with the value at which they have no effect
NONE = {"ignore_activation_dynamics": 0.0, "maximum_pennation_angle": STEEPEST}
IDLE = frozenset((  # parts of paths, pictures and the start, which is in equilibrium
    "path", "GeometryPath", "components", "Appearance", "display", "appliesForce", "isDisabled",
    "default_fiber_length", "default_normalized_tendon_force",
    # without effect on runs of OpenSim 4.6
    "optimal_force", "min_control", "max_control", "tendon_compliance_dynamics_mode",
    "ForceVelocityCurve/concentric_slope_at_vmax", "ForceVelocityCurve/eccentric_slope_at_vmax",
    "MuscleFirstOrderActivationDynamicModel", "MuscleSecondOrderActivationDynamicModel",
    "Vmax", "Vmax0", "damping",  # names before version 3
))  # fmt: skip


OLD = {"pennation_angle": "pennation_angle_at_optimal"}  # names that OpenSim changes


class Kind(NamedTuple):
    """A kind of muscle of OpenSim."""

    model: Any
    shape: Mapping[str, str]  # numbers of its curves: names in the file, and ours
    usual: Mapping[str, float] = {}  # values that differ from USUAL


MODELS: dict[str, Kind] = {
    "Thelen2003Muscle": Kind("thelen2003", {
        "KshapeActive": "active_width", "FmaxMuscleStrain": "passive_strain",
        "KshapePassive": "passive_shape", "Af": "shortening", "Flen": "lengthening",
        "fv_linear_extrap_threshold": "followed", "FmaxTendonStrain": "tendon_strain",
    }),
    "Millard2012EquilibriumMuscle": Kind("millard2012", {
        "ActiveForceLengthCurve/min_norm_active_fiber_length": "shortest",
        "ActiveForceLengthCurve/transition_norm_fiber_length": "transition",
        "ActiveForceLengthCurve/max_norm_active_fiber_length": "longest",
        "ActiveForceLengthCurve/shallow_ascending_slope": "plateau_slope",
        "ForceVelocityCurve/max_eccentric_velocity_force_multiplier": "lengthening",
        "ForceVelocityCurve/concentric_slope_near_vmax": "shortening_slope",
        "ForceVelocityCurve/isometric_slope": "isometric_slope",
        "ForceVelocityCurve/eccentric_slope_near_vmax": "lengthening_slope",
        "ForceVelocityCurve/concentric_curviness": "shortening_curviness",
        "ForceVelocityCurve/eccentric_curviness": "lengthening_curviness",
        "FiberForceLengthCurve/strain_at_zero_force": "passive_zero",
        "FiberForceLengthCurve/strain_at_one_norm_force": "passive_strain",
        "FiberForceLengthCurve/stiffness_at_low_force": "passive_low",
        "FiberForceLengthCurve/curviness": "passive_curviness",
        "TendonForceLengthCurve/strain_at_one_norm_force": "tendon_strain",
        "TendonForceLengthCurve/norm_force_at_toe_end": "toe_force",
        "TendonForceLengthCurve/curviness": "tendon_curviness",
    }),
    "DeGrooteFregly2016Muscle": Kind("degroote2016", {
        "active_force_width_scale": "active_width",
        "passive_fiber_strain_at_one_norm_force": "passive_strain",
        "tendon_strain_at_one_norm_force": "tendon_strain",
        "activation_dynamics_smoothing": "steepness",
    }, {"default_activation": 0.5, "minimum_activation": 0.0, "fiber_damping": 0.0}),
}  # fmt: skip


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
        numbers = dict[str, str]()
        for child in (*self.file.defaults(element), *element.children):
            if child is not path:
                numbers |= _numbers(child)
        return Muscle(
            element.get("name"),
            element.tag,
            self.path(path),
            Numbers({OLD.get(k, k): x for k, x in numbers.items()}),
            element,
            on,
        )

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
            still = at.point(tuple(curve.constant or 0.0 for curve in curves))
            return PathPoint(name, body, still, tuple(where), None, tuple(curves), at)
        point = at.point(file.numbers(element, "location", ZERO))
        if element.tag != "ConditionalPathPoint":
            return PathPoint(name, body, point)
        low, high = file.numbers(element, "range", (0.0, 0.0))
        coordinate = self.placed(file.socket(element, "coordinate").split("/")[-1], element)
        return PathPoint(name, body, point, (coordinate,), (low, high))


def _numbers(element: Element, of: str = "") -> dict[str, str]:
    """Return the texts in an element by name, those in a curve as "Curve/number"."""
    name = of + element.tag
    if element.children:
        inside = (_numbers(x, f"{name}/") for x in element.children)
        return {k: v for found in inside for k, v in found.items()}
    text = element.text.strip()
    return {name: text} if text else {}


def value_of(text: str) -> float:
    """Return a number, 0 or 1 for a flag, or NaN for other texts."""
    flags = {"true": 1.0, "false": 0.0}
    try:
        return flags[low] if (low := text.lower()) in flags else float(text)
    except ValueError:
        return math.nan


def _held(element: Element, name: str) -> list[Element]:
    found = element.first(name)
    found = found.first("objects") if found is not None else None
    return found.children if found is not None else []
