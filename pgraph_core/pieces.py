"""Polynomials that follow the smooth pieces of a track."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import shown
from .rotation import Array, quaternion_products, unit_vector
from .tolerances import EPS, NOTABLE, SOLVED

DEGREE = 7  # degree of the polynomials, see `engine.layout`
CLOSE = 512 * EPS  # largest distance of the polynomials from the functions, relative to their size
MOST_POLYNOMIALS = 2000  # more would be needed by a function with a corner only
START = 8  # parts of a piece in the first trial

Ints = NDArray[np.int64]


class Rough(ValueError):
    """A function that no knots follow, with its field."""

    def __init__(self, field: str, text: str):
        super().__init__(text)
        self.field = field


class Pieces(NamedTuple):
    """The smooth pieces of a track, with a parameter u and the coordinate q as a function of it.

    Functions take numbers of pieces (n,), and ascending places (n, m) in them.
    """

    knots: Array  # (pieces + 1,) ends in u
    ends: Array  # (pieces + 1,) and in q
    coordinate: Callable[[Ints, Array], Array]  # q of u
    parameter: Callable[[Ints, Array], Array]  # u of q
    pose: Callable[[Ints, Array], Array]  # x and p (n, m, 7) of u
    field: str
    turned: bool = False  # by the direction `up`


def through_points(
    points: Sequence[Sequence[float]], closed: bool, up: Sequence[float] | None
) -> Pieces:
    """Return the spline through points [m], with the way along it as the coordinate.

    With `up`, x points along it. Raises Rough if the spline has a cusp.
    """
    from scipy.interpolate import make_interp_spline

    places = np.array([*points, *points[: int(closed)]])
    chord = np.linalg.norm(np.diff(places, axis=0), axis=1)
    u = np.concatenate(([0.0], np.cumsum(chord)))
    if closed:
        spline = make_interp_spline(u, places, k=5, bc_type="periodic")
    elif len(places) == 2:
        spline = make_interp_spline(u, places, k=1)
    else:
        free = [(3, np.zeros(3)), (4, np.zeros(3))]
        spline = make_interp_spline(u, places, k=5, bc_type=(free, free))
    slope = spline.derivative()
    place, lowest = least(lambda x: np.linalg.norm(slope(x), axis=1), u)
    if lowest <= NOTABLE:
        near = shown([round(float(c), 6) + 0.0 for c in spline(place)])
        raise Rough("points", f"turn back in a cusp near {near}; move a point beside it")
    powers = np.array([spline(u[:-1], nu=k) / math.factorial(k) for k in range(6)])
    slopes = powers[1:] * np.arange(1.0, 6.0)[:, None, None]
    nodes, weights = np.polynomial.legendre.leggauss(16)

    def speed(i: Ints, x: Array) -> Array:
        return np.linalg.norm(_horner(slopes[:, i], x), axis=-1)

    def way(i: Ints, x: Array) -> Array:
        at = 0.5 * x[..., None] * (1.0 + nodes)
        along = speed(i, at.reshape(len(i), -1)).reshape(at.shape)
        return 0.5 * x * (along @ weights)

    widths = np.diff(u)
    ends = np.cumsum([0.0, *way(np.arange(len(widths)), widths[:, None])[:, 0]])

    def coordinate(i: Ints, x: Array) -> Array:
        return ends[i, None] + way(i, x - u[i, None])

    def parameter(i: Ints, q: Array) -> Array:
        own = lambda x: way(i, x), lambda x: speed(i, x)
        return u[i, None] + _inverse(*own, q - ends[i, None], widths[i, None])

    def pose(i: Ints, x: Array) -> Array:
        x = x - u[i, None]
        p = np.tile((1.0, 0.0, 0.0, 0.0), (*x.shape, 1))
        if up is not None:
            p = _along(_horner(slopes[:, i], x), up)
        return np.concatenate((_horner(powers[:, i], x), p), axis=-1)

    return Pieces(u, ends, coordinate, parameter, pose, "points", up is not None)


def _horner(powers: Array, x: Array) -> Array:
    """Return the values (n, m, 3) of polynomials (k, n, 3) at places (n, m)."""
    value = np.zeros((*x.shape, 3))
    for c in powers[::-1]:
        value *= x[..., None]
        value += c[:, None]
    return value


def _inverse(
    function: Callable[[Array], Array], slope: Callable[[Array], Array], values: Array, most: Array
) -> Array:
    """Return where an ascending function has these values, from 0 to `most` (n, 1).

    Newton's method, and bisection where it leaves the interval.
    """
    low, high = np.zeros(values.shape), np.broadcast_to(most, values.shape)
    x = values * (most / values.max(axis=1, keepdims=True))
    while True:
        excess = function(x) - values
        low, high = np.where(excess < 0.0, x, low), np.where(excess > 0.0, x, high)
        new = x - excess / slope(x)
        new = np.where((new < low) | (new > high), 0.5 * (low + high), new)
        moved, x = np.abs(new - x), new
        if not (moved > EPS**0.5 * most).any():  # the error is its square
            return x


def _along(tangent: Array, up: Sequence[float]) -> Array:
    """Return the quaternions (n, m, 4) with x along the tangents and z as close to `up` as that
    allows."""
    x = tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)
    side = np.cross(unit_vector(up), x)
    length = np.linalg.norm(side, axis=-1, keepdims=True)
    if length.min() < SOLVED**0.5:
        text = f"the curve is parallel to it somewhere, got {shown(list(up))}; "
        raise Rough("up", text + "give a direction that the curve never takes")
    y = side / length
    products = quaternion_products(np.stack((x, y, np.cross(x, y)), axis=-1))
    largest = np.diagonal(products, axis1=-2, axis2=-1).argmax(axis=-1)
    p = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    p /= np.linalg.norm(p, axis=-1, keepdims=True)
    return p * _signs(p[:, :-1], p[:, 1:])[..., None]


def least(function: Callable[[Array], Array], begins: Array) -> tuple[float, float]:
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


# -- polynomials -----------------------------------------------------------------------------------


def _signs(before: Array, after: Array) -> Array:
    """Return the signs (..., m + 1) with which each of m + 1 quaternions is close to the one
    before."""
    flips = np.where((before * after).sum(axis=-1) < 0.0, -1.0, 1.0)
    return np.cumprod(np.insert(flips, 0, 1.0, axis=-1), axis=-1, dtype=float)


def fitted(pieces: Pieces) -> Any:
    """Return the polynomials of all pieces, in each as many as its values need.

    Pieces whose q grows evenly with u are fitted together, and others one by one. Signs of
    quaternions are continuous. Raises Rough.
    """
    from scipy.interpolate import PPoly

    begins, lengths = pieces.ends[:-1, None], np.diff(pieces.ends)[:, None]
    every, s = np.arange(len(lengths)), np.linspace(0.0, 1.0, 2 * START + 1)
    q = begins + s * lengths
    q[:, -1] = pieces.ends[1:]
    y = _finite(pieces, q, pieces.pose(every, pieces.parameter(every, q)))
    knots, powers, good = _followed(s, y.swapaxes(0, 1))
    scale = lengths ** -np.arange(DEGREE, -1.0, -1.0)
    powers *= scale.T[:, None, :, None]
    found = [
        (begins[i] + knots * lengths[i], powers[:, :, i]) if good[i] else _alone(pieces, i)
        for i in every.tolist()
    ]
    signs = _signs(y[:-1, -1, 3:], y[1:, 0, 3:])
    c = np.concatenate([own for _, own in found], axis=1)
    c[:, :, 3:] *= np.repeat(signs, [own.shape[1] for _, own in found])[:, None]
    return PPoly(c, np.array([*(x for own, _ in found for x in own[:-1]), pieces.ends[-1]]))


def _alone(pieces: Pieces, i: int) -> tuple[Array, Array]:
    """Return the knots of a piece in q, and its polynomials (8, n, 7)."""
    one, (a, b), count = np.array([i]), pieces.knots[i : i + 2], START
    while count <= MOST_POLYNOMIALS:
        u = np.linspace(a, b, 2 * count + 1)[None]
        q = pieces.coordinate(one, u)
        y = _finite(pieces, q, pieces.pose(one, u))
        knots, powers, good = _followed(q[0], y.swapaxes(0, 1))
        if good[0]:
            return knots, powers[:, :, 0]
        count = 3 * count // 2
    text = "has a corner, a jump or too short waves between "
    text += f"q = {pieces.ends[i]:.6g} and {pieces.ends[i + 1]:.6g}; round it, or give a spline"
    text += " (a curve close to `up`, too)" if pieces.turned else ""
    raise Rough(pieces.field, text)


def _finite(pieces: Pieces, q: Array, y: Array) -> Array:
    if not (finite := np.isfinite(y).all(axis=-1)).all():
        raise Rough(pieces.field, f"has no finite value at q = {q[~finite][0]:.6g}")
    return y


def _followed(x: Array, y: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the knots of splines through every other value of y (m, n, 7) at x (m,), their
    polynomials (8, knots, n, 7), and whether each is close to the values between (n,)."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(x[::2], y[::2], k=DEGREE)
    size = np.ones(y.shape[1:])
    size[:, :3] = np.abs(y[..., :3]).max(axis=(0, 2))[:, None]
    size[size == 0.0] = 1.0
    near = np.abs(spline(x[1::2]) - y[1::2]) <= CLOSE * size
    knots = np.unique(spline.t)
    powers = [spline(knots[:-1], nu=k) / math.factorial(k) for k in range(DEGREE, -1, -1)]
    return knots, np.array(powers), near.all(axis=(0, 2))


def check_closed(found: Any) -> None:
    """Raise Rough if the motion does not end as it begins, up to the second derivative."""
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
            raise Rough("closed", f"{text} differ between q = {first:.6g} and {last:.6g}")
