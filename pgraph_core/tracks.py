"""The track of a curve joint: displacement and rotation as functions of its coordinate."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from .errors import choices, counted, shown
from .fields import (
    Finite,
    Flag,
    Frozen,
    Number,
    Vec3,
    Vec3s,
    field,
    listed,
    maybe_vector,
    refuse,
    vectors,
)
from .pieces import Ints, Pieces, Rough, check_closed, fitted, least, through_points
from .rotation import Array, unit_vector
from .signals.grammar import Unreadable, names_in, parsed
from .signals.meaning import CONSTANTS, constant
from .tolerances import NOTABLE, SOLVED
from .units import M

# directions that halve the sphere evenly: the axes, and others along a spiral
_TURNS = np.pi * (1.0 + 5.0**0.5) * np.arange(200)
_HEIGHTS = (np.arange(200) + 0.5) / 200
_ACROSS = np.sqrt(1.0 - _HEIGHTS**2)
_DIRECTIONS = np.vstack((
    np.eye(3), np.column_stack((_ACROSS * np.cos(_TURNS), _ACROSS * np.sin(_TURNS), _HEIGHTS)),
))  # fmt: skip

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

Pairs = Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=2)]
Triples = Annotated[tuple[tuple[Finite, Finite, Finite], ...], Field(min_length=2)]
Formula = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Function = Annotated[Finite | Pairs | Triples | Formula, BeforeValidator(listed)]
Given = float | str | Sequence[Sequence[float]]
_function: Callable[[Given], Function] = listed
_functions: Callable[[Sequence[Given]], tuple[Function, ...]] = listed
_range: Callable[[Sequence[float] | None], tuple[float, float] | None] = listed
FUNCTION = (
    "a number, pairs [q, value] of a cubic spline, triples [q, value, slope] of a piecewise cubic, "
    "or an expression of q such as 'cos(q)'"
)


MOST_STEPS = 32  # steps of a search for the nearest place, more than any smooth curve needs
GIVEN = ("points", "up", "x", "y", "z", "angles", "axes", "range", "closed", "unit")


class Track(Frozen):
    """The curve that the origin of a body follows, and how the body turns along it.

    It is given by `points`, with the way along the curve as the coordinate, or by functions of the
    coordinate for a displacement and up to three rotations, as in the joints of OpenSim. Both are
    in the axes of the body at a displacement and rotation of zero. Raises ModelError.
    """

    FOLLOWERS: ClassVar[dict[str, tuple[str, ...]]] = dict.fromkeys(GIVEN, GIVEN)

    points: Vec3s = field(
        "two or more points [x, y, z] [m], which a spline of degree 5 joins",
        converter=vectors, default=(), dim=M, role="point",
    )  # fmt: skip
    closed: Flag = field("true or false: the end of the curve is its beginning", default=False)
    up: Vec3 | None = field(
        "a direction [x, y, z], or None: the x axis of the body points along the curve, and its z "
        "axis as close to this direction as that allows; without it the body does not turn",
        converter=maybe_vector, default=None, role="direction",
    )  # fmt: skip
    x: Function = field(FUNCTION + " [m]", converter=_function, default=0.0)
    y: Function = field(FUNCTION + " [m]", converter=_function, default=0.0)
    z: Function = field(FUNCTION + " [m]", converter=_function, default=0.0)
    angles: tuple[Function, ...] = field(
        "up to three functions [rad], each " + FUNCTION, converter=_functions, default=()
    )
    axes: Vec3s = field(
        "one direction [x, y, z] per angle, in the axes after the rotations before it; by default "
        "x, y and z in this order",
        converter=vectors, default=(), role="direction",
    )  # fmt: skip
    range: tuple[Number, Number] | None = field(
        "the first and the last coordinate; by default those of the splines",
        converter=_range, default=None,
    )  # fmt: skip
    unit: Literal["rad", "m"] = field(
        "'rad' or 'm': the unit of the coordinate, by default 'm' with points", default="rad"
    )

    @model_validator(mode="before")
    @classmethod
    def _usual(cls, data: Any) -> Any:
        """Fill in the unit, and the usual axes of rotation."""
        if not isinstance(data, dict):
            return data
        data = {key: value for key, value in data.items() if value is not None}
        if "unit" not in data and len(listed(data.get("points", ())) or ()):
            data["unit"] = "m"
        angles = listed(data.get("angles", ()))
        if isinstance(angles, str):
            angles = data["angles"] = (angles,)
        if "axes" not in data and isinstance(angles, tuple):
            data["axes"] = (X, Y, Z)[: len(angles)]
        return data

    @model_validator(mode="after")
    def _smooth(self) -> Self:
        if "checked" not in vars(self):
            refuse(_problems(self)[:1])  # the others follow from it
            vars(self)["checked"] = True
            refuse(self._rough())
        return self

    def _rough(self) -> list[tuple[str, str]]:
        """Return a problem of functions that are not smooth, or do not move."""
        try:
            q = _stillest(self)
        except Rough as error:
            return [(error.field, str(error))]
        if q is None:
            return []
        text = f"nothing moves with q at q = {q:.6g}: all derivatives vanish, as at a cusp"
        return [(_given(self), f"{text}; choose other functions, or end the track before it")]

    @cached_property
    def pieces(self) -> Any:
        """SciPy's piecewise polynomial for x [m] and the quaternion, with 7 components."""
        found = fitted(
            through_points(self.points, self.closed, self.up)
            if self.points
            else _of_functions(self)
        )
        if self.closed and not self.points:  # a spline through points closes by itself
            check_closed(found)
        return found

    @cached_property
    def corners(self) -> tuple[float, ...]:
        """The coordinates at which second derivatives jump: of cubics with given slopes."""
        functions = (f for f in (self.x, self.y, self.z, *self.angles) if isinstance(f, tuple))
        given = sorted({row[0] for f in functions if len(f[0]) == 3 for row in f})
        if not given:
            return ()
        x, bends = self.pieces.x, self.pieces.derivative(2)
        inner = [i for i in np.searchsorted(x, given).tolist() if 0 < i < len(x) - 1]
        before = np.array([np.polyval(bends.c[:, i - 1], x[i] - x[i - 1]) for i in inner])
        after = bends.c[-1, inner]
        jumps = (np.abs(after - before) > NOTABLE * np.abs(bends.c[-1]).max(axis=0)).any(axis=-1)
        return tuple(x[i] for i, jump in zip(inner, jumps) if jump)

    @cached_property
    def rows(self) -> Array:
        """The rows (nt, 32) for the kernels, described in `engine.layout`."""
        x, c = self.pieces.x, self.pieces.c
        found = np.zeros((2 * len(x) - 1, 32))
        found[::2, 0] = x
        powers = c[::-1].transpose(1, 0, 2)  # (pieces, 8, 7)
        found[:-1:2, 1:25] = powers[:, :, :3].reshape(-1, 24)
        found[1::2] = powers[:, :, 3:].reshape(-1, 32)
        if self.closed:
            found[0, 25] = 1.0 / (x[-1] - x[0])
        found.setflags(write=False)
        return found

    def at(self, q: float) -> tuple[Array, Array]:
        """Return the displacement (3,) [m] and the rotation (3, 3) at a coordinate."""
        value = self._values(q)[0]
        return value[:3], _matrix(value[3:])

    def slope(self, q: float) -> Array:
        """Return the derivative (6,) of the motion in its coordinate, [a, x']."""
        value, slope, _ = self._values(q)
        return np.concatenate((_twist(value[3:], slope[3:]), slope[:3]))

    def bend(self, q: float) -> Array:
        """Return the derivative (6,) of `slope`."""
        value, slope, bend = self._values(q)
        p, rate = value[3:], slope[3:]
        shrinks = 2.0 * (p @ rate) / (p @ p)
        turn = _twist(p, bend[3:]) - shrinks * _twist(p, rate)
        return np.concatenate((turn, bend[:3]))

    def _values(self, q: float | Array) -> tuple[Array, Array, Array]:
        """Return x and p, (..., 7), and their derivatives. The second ones are constant beyond the
        ends."""
        first, last = self.pieces.x[[0, -1]]
        if self.closed:
            q = first + (q - first) % (last - first)
        inside = np.clip(q, first, last)
        value, slope, bend = (self.pieces(inside, nu=k) for k in range(3))
        beyond = np.asarray(q - inside)[..., None]
        return value + beyond * (slope + 0.5 * beyond * bend), slope + beyond * bend, bend

    def line(self, count: int = 100) -> Array:
        """Return points (count + 1, 3) of the track from its beginning to its end [m]."""
        first, last = self.pieces.x[[0, -1]].tolist()
        return self.pieces(np.linspace(first, last, count + 1))[:, :3]

    @cached_property
    def aside(self) -> Array:
        """A direction (3,) that the curve never has, of many the one farthest from its tangents.

        Past the ends of an open curve, too, by its length. It is normal to the plane of a flat one.
        """
        x = self.pieces.x
        q = (x[:-1, None] + np.diff(x)[:, None] * np.linspace(0.0, 1.0, 8)).ravel()
        tangents = self.pieces(q, nu=1)[:, :3]
        if not self.closed:
            way, bends = (x[-1] - x[0]) * np.linspace(0.0, 1.0, 64)[:, None], self.pieces(x, nu=2)
            ends = [tangents[k] + s * way * bends[k, :3] for k, s in ((0, -1.0), (-1, 1.0))]
            tangents = np.vstack((tangents, *ends))
        lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
        tangents = (tangents / np.where(lengths > 0.0, lengths, 1.0))[lengths[:, 0] > 0.0]
        chosen = _DIRECTIONS
        _, sizes, ways = np.linalg.svd(tangents, full_matrices=False)
        if sizes[1] > SOLVED * sizes[0]:  # a straight line has no plane
            chosen = np.vstack((chosen, ways[2] * np.sign(ways[2, np.argmax(np.abs(ways[2]))])))
        found: Array = chosen[np.argmin(np.abs(tangents @ chosen.T).max(axis=0))]
        return found

    def nearest(self, points: Array) -> Array:
        """Return the coordinates (n,) at which the curve is nearest to points (n, 3).

        They are beyond the ends of an open curve for points that are past them.
        """
        q, places = self._samples
        apart = np.linalg.norm(places[None] - points[:, None], axis=-1)
        return self._descended(points, q[np.argmin(apart, axis=1)])

    def around(self, point: Array, most: float) -> list[float]:
        """Return the coordinates of all places that are nearest to a point (3,) around them, and
        within the distance `most`."""
        q, places = self._samples
        apart = np.linalg.norm(places - point, axis=-1)
        before, after = np.append(np.inf, apart[:-1]), np.append(apart[1:], np.inf)
        start = q[(apart <= before) & (apart <= after)]
        span, found = q[-1] - q[0], list[float]()
        for s in self._descended(np.tile(point, (len(start), 1)), start).tolist():
            s = float(q[0] + (s - q[0]) % span) if self.closed else s
            ways = [abs(s - x) for x in found]
            ways += [span - way for way in ways if self.closed]
            if np.linalg.norm(self.at(s)[0] - point) <= most and all(w > most for w in ways):
                found.append(s)
        return found

    @cached_property
    def _samples(self) -> tuple[Array, Array]:
        """Coordinates (n,) along the curve, and its places there (n, 3)."""
        x = self.pieces.x
        q = np.append((x[:-1, None] + np.diff(x)[:, None] * np.arange(8) / 8).ravel(), x[-1])
        return q, self.pieces(q)[:, :3]

    def _descended(self, points: Array, q: Array) -> Array:
        """Return the coordinates (n,) of the nearest places around q (n,), by Newton's method."""
        for _ in range(MOST_STEPS):
            place, slope, bend = (x[:, :3] for x in self._values(q))
            left, square = points - place, np.einsum("ij,ij->i", slope, slope)
            below = np.maximum(square - np.einsum("ij,ij->i", left, bend), 0.5 * square)
            step = np.einsum("ij,ij->i", left, slope) / below
            q = q + step
            if not (np.abs(step) > SOLVED * np.ptp(self.pieces.x)).any():
                break
        return q

    def mirrored(self, sign: Sequence[float]) -> Track:
        """Return the mirror image that multiplies the components of vectors by `sign`."""

        def image(x: Sequence[float], s: float = 1.0) -> tuple[float, ...]:
            return tuple(s * a * b + 0.0 for a, b in zip(sign, x))

        found: dict[str, Any] = {
            "points": tuple(image(x) for x in self.points),
            "axes": tuple(image(x, -1.0) for x in self.axes),  # rotations have a hand
        }
        for name, s in zip("xyz", sign):
            if s < 0.0:
                found[name] = _negative(getattr(self, name))
        if self.up is not None:
            found["up"] = image(self.up)
        return self.model_copy(update=found)


def _negative(function: Any) -> Any:
    if isinstance(function, str):
        return f"-({function})"
    if isinstance(function, tuple):
        return tuple((q, *(0.0 - y for y in others)) for q, *others in function)
    return 0.0 - function


# -- problems --------------------------------------------------------------------------------------


def _problems(track: Track) -> list[tuple[str, str]]:
    """Return the problems of the numbers as given."""
    functions = (track.x, track.y, track.z, *track.angles)
    names = ("x", "y", "z", *("angles",) * len(track.angles))
    if track.points:
        return _problems_of_points(track, any(f != 0.0 for f in functions))
    found = []
    if track.up is not None:
        found.append(("up", "is for a track through points; turn by `angles` instead"))
    if len(track.angles) > 3:
        found.append(("angles", f"has at most 3 functions, got {len(track.angles)}"))
    if len(track.axes) != len(track.angles):
        text = f"needs one direction per angle, {counted(len(track.angles), 'direction')}"
        found.append(("axes", f"{text}, got {len(track.axes)}"))
    found += _problems_of_axes(track.axes)
    found += [x for f, name in zip(functions, names) for x in _problems_of_function(f, name)]
    if found:
        return found
    if all(isinstance(f, float) for f in functions):
        text = "one of x, y, z and angles must depend on q, or give `points`; all are constant"
        return [("x", text)]
    return _problems_of_range(track, functions, names)


def _problems_of_points(track: Track, others: bool) -> list[tuple[str, str]]:
    points = np.array(track.points)
    if np.abs(points).max() > 1e9:
        return [("points", f"must be within 1e9 m, got {shown(track.points)}")]
    if others:
        return [("points", "stand in place of x, y, z and angles; give one of the two")]
    if track.range is not None or track.unit != "m":
        text = "is for functions: the coordinate of points is the way along them [m]"
        return [("range" if track.range is not None else "unit", text)]
    least = 3 if track.closed else 2
    if len(points) < least:
        kind = "a closed curve" if track.closed else "a curve"
        return [("points", f"{kind} needs at least {least} points, got {len(points)}")]
    if track.closed and np.array_equal(points[0], points[-1]):
        text = "a closed curve returns to its first point by itself; leave the last point out"
        return [("points", f"{text}, got {shown(track.points[0])} at both ends")]
    ends = np.vstack((points, points[:1])) if track.closed else points
    apart = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    size = float(np.ptp(points, axis=0).max())
    doubled = np.flatnonzero(apart <= NOTABLE * size)
    if len(doubled):
        i = int(doubled[0])
        text = f"points {i + 1} and {(i + 1) % len(points) + 1} are "
        if apart[i] > 0.0:
            text += f"only {apart[i]:.3g} m apart, {NOTABLE:g} of the track's size or less, near "
        else:
            text += "equal: "
        return [("points", f"{text}{shown(track.points[i])}; leave one out")]
    if track.up is not None and not any(track.up):
        return [("up", "a direction must not be zero, got [0, 0, 0]")]
    return []


def _problems_of_axes(axes: Sequence[tuple[float, ...]]) -> list[tuple[str, str]]:
    found = []
    for axis in axes:
        if not 1e-9 < math.hypot(*axis) < 1e9:
            found.append(("axes", f"a direction must not be zero, got {list(axis)}"))
    if found:
        return found
    for a, b in pairwise(axes):
        if np.linalg.norm(np.cross(unit_vector(a), unit_vector(b))) <= SOLVED:
            text = f"two successive directions are parallel, got {list(a)} and {list(b)}"
            found.append(("axes", f"{text}; put the other axis between them or add their angles"))
    return found


def _problems_of_function(function: Any, name: str) -> list[tuple[str, str]]:
    if isinstance(function, tuple):
        q = [pair[0] for pair in function]
        if not all(a < b for a, b in pairwise(q)):
            return [(name, f"the coordinates of a spline must ascend, got {shown(q)}")]
        for a, b in pairwise(q):
            if b - a <= NOTABLE * (q[-1] - q[0]):
                text = f"two coordinates of the spline are only {b - a:.3g} apart, {NOTABLE:g} of "
                return [(name, f"{text}its range or less, near q = {a:.6g}; leave one out")]
    elif isinstance(function, str):
        try:
            constant(
                parsed(_readable(function)), {"q": 0.5, **dict.fromkeys(_others(function), 0.5)}
            )
        except Unreadable as error:
            text = f"{shown(function)} is not an expression of q: {error}"
            return [(name, text)]
        except ArithmeticError:
            pass
        if others := _others(function):
            text = f"{shown(function)} reads {choices(map(shown, others))}, but a function of a "
            text += "track reads only q; write the number in its place, in Python "
            return [(name, text + f"{name}=f{_with_numbers(function, others)!r}")]
    return []
    return []


def _problems_of_range(
    track: Track, functions: Sequence[Any], names: Sequence[str]
) -> list[tuple[str, str]]:
    splines = [(f, name) for f, name in zip(functions, names) if isinstance(f, tuple)]
    if track.range is None and not splines:
        text = "must be given with expressions: the first and the last coordinate, such as [0, 6.3]"
        return [("range", text)]
    low, high = _range_of(track)
    if not low < high:
        return [("range", f"the first coordinate must be less than the last, got {[low, high]}")]
    for f, name in splines:
        slack = SOLVED * (high - low)
        if f[0][0] > low + slack or f[-1][0] < high - slack:
            text = f"the spline covers q = {f[0][0]:.6g} to {f[-1][0]:.6g}"
            return [(name, f"{text}, but the track goes from {low:.6g} to {high:.6g}")]
    return []


def _range_of(track: Track) -> tuple[float, float]:
    if track.range is not None:
        return track.range
    splines = [f for f in (track.x, track.y, track.z, *track.angles) if isinstance(f, tuple)]
    return min(f[0][0] for f in splines), max(f[-1][0] for f in splines)


def _stillest(track: Track) -> float | None:
    """Return a coordinate at which neither the origin nor the body moves, or None."""
    begins = track.pieces.x
    value, slope = track.pieces(begins), track.pieces(begins, nu=1)
    fastest = float(np.linalg.norm(slope[:, :3], axis=1).max())
    turning = float(np.linalg.norm(_twist(value[:, 3:], slope[:, 3:]), axis=1).max())
    if turning * (begins[-1] - begins[0]) < SOLVED:  # rounding of a constant rotation
        turning = math.inf

    def speed(q: Array) -> Array:
        value, slope = track.pieces(q), track.pieces(q, nu=1)
        turned = np.linalg.norm(_twist(value[:, 3:], slope[:, 3:]), axis=1) / turning
        return np.hypot(np.linalg.norm(slope[:, :3], axis=1) / (fastest or math.inf), turned)

    q, lowest = least(speed, begins)
    return q if lowest <= NOTABLE else None


# -- functions -------------------------------------------------------------------------------------


def _of_functions(track: Track) -> Pieces:
    """Return a piece between each two neighbouring knots of the splines."""
    functions = (track.x, track.y, track.z, *track.angles)
    low, high = _range_of(track)
    breaks = {q for f in functions if isinstance(f, tuple) for q, *_ in f if low < q < high}
    of_q = [_evaluator(f, track.closed) for f in functions]
    axes = [unit_vector(axis) for axis in track.axes]

    def pose(_: Ints, q: Array) -> Array:
        values = [f(q.ravel()) for f in of_q]
        p = np.tile((1.0, 0.0, 0.0, 0.0), (q.size, 1))
        for axis, angle in zip(axes, values[3:]):
            turn = np.column_stack((np.cos(0.5 * angle), np.sin(0.5 * angle)[:, None] * axis))
            p = _product(p, turn)
        return np.column_stack((*values[:3], p)).reshape(*q.shape, 7)

    ends, same = np.array([low, *sorted(breaks), high]), lambda _, q: q
    return Pieces(ends, ends, same, same, pose, _given(track))


def _given(track: Track) -> str:
    """Return the first field that gives the track."""
    if track.points:
        return "points"
    functions = {"x": track.x, "y": track.y, "z": track.z}
    return next((name for name, f in functions.items() if not isinstance(f, float)), "angles")


def _evaluator(function: Any, closed: bool) -> Callable[[Array], Array]:
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    if isinstance(function, tuple):
        q, y, *slopes = np.array(function).T
        if slopes:
            return CubicHermiteSpline(q, y, *slopes)
        ends = "periodic" if closed and y[0] == y[-1] else "natural"
        return CubicSpline(q, y, bc_type=ends)
    if isinstance(function, str):
        tree = parsed(_readable(function))
        return lambda q: np.array([_value(tree, x) for x in q.tolist()])
    return lambda q: np.full(len(q), function)


def _value(tree: Any, q: float) -> float:
    try:
        value = constant(tree, {"q": q})
    except (ArithmeticError, ValueError):
        return math.nan
    return math.nan if isinstance(value, complex) else float(value)


def _others(text: str) -> list[str]:
    """Return the names beside q and constants in an expression."""
    return sorted(names_in(_readable(text)) - {"q", *CONSTANTS})


def _with_numbers(text: str, names: Sequence[str]) -> str:
    """Return an expression with names in braces, for an f-string."""
    for name in names:
        text = re.sub(rf"\b{name}\b", f"{{{name}}}", text)
    return text


def _readable(text: str) -> str:
    return "=" + text.strip().removeprefix("=")


# -- quaternions -----------------------------------------------------------------------------------


def _product(a: Array, b: Array) -> Array:
    """Return the products (n, 4) of two rows of quaternions."""
    w = a[:, 0] * b[:, 0] - np.einsum("ij,ij->i", a[:, 1:], b[:, 1:])
    v = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.column_stack((w, v))


def _matrix(p: Array) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion of any length."""
    w, x, y, z = p / np.linalg.norm(p)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _twist(p: Array, rate: Array) -> Array:
    """Return a = 2 vec(p' p̄) / |p|², with which rotations by p (..., 4) turn."""
    v = p[..., :1] * rate[..., 1:] - rate[..., :1] * p[..., 1:]
    v = v - np.cross(rate[..., 1:], p[..., 1:])
    return 2.0 * v / (p * p).sum(axis=-1, keepdims=True)
