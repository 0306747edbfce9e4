"""The track of a curve joint: displacement and rotation as functions of its coordinate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from .errors import counted, shown
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
from .rotation import Array, quaternion_of, unit_vector
from .signals.grammar import Unreadable, parsed
from .signals.meaning import constant
from .tolerances import EPS, NOTABLE, SOLVED
from .units import M

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DEGREE = 7  # of the polynomials, see `engine.layout`
CLOSE = 512 * EPS  # largest distance of the polynomials from the functions, relative to their size
MOST_POLYNOMIALS = 2000  # more would be needed by a function with a corner only
START = 8  # parts of a piece in the first trial

Pairs = Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=2)]
Formula = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Function = Annotated[Finite | Pairs | Formula, BeforeValidator(listed)]
Given = float | str | Sequence[Sequence[float]]
_function: Callable[[Given], Function] = listed
_functions: Callable[[Sequence[Given]], tuple[Function, ...]] = listed
_range: Callable[[Sequence[float] | None], tuple[float, float] | None] = listed
FUNCTION = "a number, pairs [q, value] of a cubic spline, or an expression of q such as 'cos(q)'"


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
        except _Rough as error:
            return [(error.field, str(error))]
        if q is None:
            return []
        text = f"nothing moves with q at q = {q:.6g}: all derivatives vanish, as at a cusp"
        return [(_given(self), f"{text}; choose other functions, or end the track before it")]

    @cached_property
    def pieces(self) -> Any:
        """SciPy's piecewise polynomial for x [m] and the quaternion, with 7 components."""
        closed = self.closed and not self.points  # a spline through points closes by itself
        return _joined([_fitted(piece) for piece in self._pieces()], closed)

    def _pieces(self) -> list[_Piece]:
        return _of_points(self) if self.points else _of_functions(self)

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

    def _values(self, q: float) -> tuple[Array, Array, Array]:
        """Return x and p, (7,), and their derivatives. The second ones are constant beyond the
        ends."""
        first, last = self.pieces.x[[0, -1]]
        if self.closed:
            q = first + (q - first) % (last - first)
        inside = min(max(q, first), last)
        value, slope, bend = (self.pieces(inside, nu=k) for k in range(3))
        beyond = q - inside
        return value + beyond * (slope + 0.5 * beyond * bend), slope + beyond * bend, bend

    def line(self, count: int = 100) -> Array:
        """Return points (count + 1, 3) of the track from its beginning to its end [m]."""
        first, last = self.pieces.x[[0, -1]].tolist()
        return self.pieces(np.linspace(first, last, count + 1))[:, :3]

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
        return tuple((q, 0.0 - y) for q, y in function)
    return 0.0 - function


# -- problems --------------------------------------------------------------------------------------


class _Rough(ValueError):
    """A function that no knots follow, with its field."""

    def __init__(self, field: str, text: str):
        super().__init__(text)
        self.field = field


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
    doubled = np.flatnonzero(apart <= SOLVED * apart.max())
    if len(doubled):
        i = int(doubled[0])
        text = f"points {i + 1} and {(i + 1) % len(points) + 1} are equal: {shown(track.points[i])}"
        return [("points", f"{text}; leave one out")]
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
    elif isinstance(function, str):
        try:
            constant(parsed(_readable(function)), {"q": 0.5})
        except Unreadable as error:
            text = f"{shown(function)} is not an expression of q: {error}"
            return [(name, text)]
        except ArithmeticError:
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

    q, least = _least(speed, begins)
    return q if least <= NOTABLE else None


def _least(function: Callable[[Array], Array], begins: Array) -> tuple[float, float]:
    """Return where a function is least, and its value, from eight places of each piece."""
    from scipy.optimize import minimize_scalar

    parts = np.linspace(0.0, 1.0, 8, endpoint=False)
    q = np.append((begins[:-1, None] + np.diff(begins)[:, None] * parts).ravel(), begins[-1])
    i = int(np.argmin(function(q)))
    bounds = q[max(i - 1, 0)], q[min(i + 1, len(q) - 1)]
    found = minimize_scalar(
        lambda x: float(function(np.array([x]))[0]), bounds=bounds, method="bounded",
        options={"xatol": EPS},
    )  # fmt: skip
    places = np.array([found.x, q[i]])
    values = function(places)
    best = int(np.argmin(values))
    return float(places[best]), float(values[best])


# -- pieces ----------------------------------------------------------------------------------------


class _Piece(NamedTuple):
    """A smooth piece of a track: `pose(u)` returns (q, x and p (n, 7)) for ascending parameters."""

    begin: float
    end: float
    pose: Callable[[Array], tuple[Array, Array]]
    field: str
    turned: bool = False  # by the direction `up`


def _of_functions(track: Track) -> list[_Piece]:
    """Return a piece between each two neighbouring knots of the splines."""
    functions = (track.x, track.y, track.z, *track.angles)
    low, high = _range_of(track)
    breaks = {q for f in functions if isinstance(f, tuple) for q, _ in f if low < q < high}
    of_q = [_evaluator(f, track.closed) for f in functions]
    axes = [unit_vector(axis) for axis in track.axes]

    def pose(q: Array) -> tuple[Array, Array]:
        values = [f(q) for f in of_q]
        p = np.tile((1.0, 0.0, 0.0, 0.0), (len(q), 1))
        for axis, angle in zip(axes, values[3:]):
            turn = np.column_stack((np.cos(0.5 * angle), np.sin(0.5 * angle)[:, None] * axis))
            p = _product(p, turn)
        return q, np.column_stack((*values[:3], p))

    places = [low, *sorted(breaks), high]
    return [_Piece(a, b, pose, _given(track)) for a, b in pairwise(places)]


def _given(track: Track) -> str:
    """Return the first field that gives the track."""
    if track.points:
        return "points"
    functions = {"x": track.x, "y": track.y, "z": track.z}
    return next((name for name, f in functions.items() if not isinstance(f, float)), "angles")


def _evaluator(function: Any, closed: bool) -> Callable[[Array], Array]:
    from scipy.interpolate import CubicSpline

    if isinstance(function, tuple):
        q, y = np.array(function).T
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


def _readable(text: str) -> str:
    return "=" + text.strip().removeprefix("=")


def _of_points(track: Track) -> list[_Piece]:
    """Return the spline through the points, with the way along it as the coordinate."""
    from scipy.interpolate import make_interp_spline

    points = np.array(track.points)
    if track.closed:
        points = np.vstack((points, points[:1]))
    chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.concatenate(([0.0], np.cumsum(chord)))
    if track.closed:
        spline = make_interp_spline(u, points, k=5, bc_type="periodic")
    elif len(points) == 2:
        spline = make_interp_spline(u, points, k=1)
    else:
        free = [(3, np.zeros(3)), (4, np.zeros(3))]
        spline = make_interp_spline(u, points, k=5, bc_type=(free, free))
    slope = spline.derivative()
    place, least = _least(lambda x: np.linalg.norm(slope(x), axis=1), u)
    if least <= NOTABLE:
        near = shown([round(float(c), 6) + 0.0 for c in spline(place)])
        raise _Rough("points", f"turn back in a cusp near {near}; move a point beside it")
    nodes, weights = np.polynomial.legendre.leggauss(16)

    def way(a: Array, b: Array) -> Array:
        places = 0.5 * (a + b)[:, None] + 0.5 * (b - a)[:, None] * nodes
        return 0.5 * (b - a) * (np.linalg.norm(slope(places), axis=2) @ weights)

    whole = np.concatenate(([0.0], np.cumsum(way(u[:-1], u[1:]))))

    def pose(x: Array) -> tuple[Array, Array]:
        i = np.clip(np.searchsorted(u, x, side="right") - 1, 0, len(u) - 2)
        p = np.tile((1.0, 0.0, 0.0, 0.0), (len(x), 1))
        if track.up is not None:
            p = _along(slope(x), np.array(track.up))
        return whole[i] + way(u[i], x), np.column_stack((spline(x), p))

    turned = track.up is not None
    return [_Piece(a, b, pose, "points", turned) for a, b in pairwise(u.tolist())]


def _along(tangent: Array, up: Array) -> Array:
    """Return the quaternions (n, 4) with x along the tangents and z as close to `up` as that
    allows."""
    x = tangent / np.linalg.norm(tangent, axis=1)[:, None]
    side = np.cross(unit_vector(up), x)
    length = np.linalg.norm(side, axis=1)
    if length.min() < SOLVED**0.5:
        text = f"the curve is parallel to it somewhere, got {shown(up.tolist())}; "
        raise _Rough("up", text + "give a direction that the curve never takes")
    y = side / length[:, None]
    z = np.cross(x, y)
    found = np.array([quaternion_of(np.column_stack(axes)) for axes in zip(x, y, z)])
    for k in range(1, len(found)):  # the sign that is closer to the quaternion before
        if found[k] @ found[k - 1] < 0.0:
            found[k] *= -1.0
    return found


def _fitted(piece: _Piece) -> Any:
    """Return the polynomials of a piece, as many as its values need."""
    from scipy.interpolate import PPoly, make_interp_spline

    count, q = START, np.zeros(1)
    while count <= MOST_POLYNOMIALS:
        q, y = piece.pose(np.linspace(piece.begin, piece.end, 2 * count + 1))
        if not np.isfinite(y).all():
            text = f"has no finite value at q = {q[~np.isfinite(y).all(axis=1)][0]:.6g}"
            raise _Rough(piece.field, text)
        spline = make_interp_spline(q[::2], y[::2], k=DEGREE)
        size = np.array([np.abs(y[:, :3]).max() or 1.0] * 3 + [1.0] * 4)
        if (np.abs(spline(q[1::2]) - y[1::2]) <= CLOSE * size).all():
            x = np.unique(spline.t)
            powers = [spline(x[:-1], nu=k) / math.factorial(k) for k in range(DEGREE, -1, -1)]
            return PPoly(np.array(powers), x)
        count = 3 * count // 2
    text = "has a corner, a jump or too short waves between "
    text += f"q = {q[0]:.6g} and {q[-1]:.6g}; round it, or give a spline"
    text += " (a curve close to `up`, too)" if piece.turned else ""
    raise _Rough(piece.field, text)


def _joined(parts: Sequence[Any], closed: bool) -> Any:
    """Return the polynomials of all pieces as one, with quaternions of continuous sign."""
    from scipy.interpolate import PPoly

    ends = parts[0](parts[0].x[-1])
    coefficients, begins = [parts[0].c], [parts[0].x]
    for part in parts[1:]:
        c = part.c.copy()
        if ends[3:] @ part(part.x[0])[3:] < 0.0:
            c[:, :, 3:] *= -1.0
        coefficients.append(c)
        begins.append(part.x[1:])
        ends = PPoly(c, part.x)(part.x[-1])
    found = PPoly(np.concatenate(coefficients, axis=1), np.concatenate(begins))
    if closed:
        _check_closed(found)
    return found


def _check_closed(found: Any) -> None:
    """Raise _Rough if the motion does not end as it begins, up to the second derivative."""
    first, last = found.x[[0, -1]]
    radian = (last - first) / math.tau
    turn = 1.0 if found(first)[3:] @ found(last)[3:] > 0.0 else -1.0
    size = np.repeat((np.abs(found(found.x)[:, :3]).max() or 1.0, 1.0), (3, 4))
    for k in range(3):
        a, b = found(first, nu=k), found(last, nu=k)
        apart = np.abs(np.concatenate((a[:3] - b[:3], a[3:] - turn * b[3:])))
        if (apart * radian**k > NOTABLE * size).any():
            text = (
                "a closed track ends as it begins, with equal places, rotations and slopes; these"
            )
            raise _Rough("closed", f"{text} differ between q = {first:.6g} and {last:.6g}")


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
