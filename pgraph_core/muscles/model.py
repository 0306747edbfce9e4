"""The questions that each model of a muscle answers, and its curves as polynomials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..signals import Node

Array = NDArray[np.float64]
DEGREE = 7  # degree of the polynomials in `engine.pieces`
ACTIVE, PASSIVE, VELOCITY, TENDON = range(4)  # places in `Curves`
PARTS_OF_BEZIER = 32  # polynomials for each part, which leave an error of about 1e-12
KEPT = 64  # curves of different shapes that are not made again
HALVINGS = 60  # halvings of an interval until numbers follow each other


class Smooth(NamedTuple):
    """A function that is smooth between ascending places, and linear before and after them.

    `value` takes places (n,), and is only asked within the piece of the number that it gets first.
    """

    places: tuple[float, ...]
    value: Callable[[int, Array], Array]
    parts: int = 8  # polynomials in each piece, as many as leave an error of about 1e-12
    knots: tuple[Array, ...] = ()  # the ends of these in each piece, if they are not even

    def rows(self, width: int) -> Array:
        """Return the polynomials as rows for `engine.pieces`, which have this many columns."""
        x = np.array(self.places)
        even = [np.linspace(a, b, self.parts + 1) for a, b in pairwise(x)]
        unit = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
        nodes, degrees = np.vander(unit, increasing=True), np.arange(DEGREE + 1.0)
        begins, powers = list[Array](), list[Array]()
        for k, ends in enumerate(self.knots or even):
            h = np.diff(ends)[:, None]
            at = np.clip(ends[:-1, None] + h * unit, x[k], x[k + 1])
            values = self.value(k, at.ravel()).reshape(at.shape)
            begins.append(ends[:-1])
            powers.append(np.linalg.solve(nodes, values.T).T * h**-degrees)
        return _with_lines(np.concatenate(begins), x[-1], np.concatenate(powers), width)


def _with_lines(begins: Array, last: float, powers: Array, width: int) -> Array:
    """Return the rows of polynomials, and of lines as which they go on at both ends."""
    degrees = np.arange(DEGREE + 1.0)
    way = last - begins[-1]
    end = powers[-1] @ way**degrees
    slope = (powers[-1][1:] * degrees[1:]) @ way ** degrees[:-1]
    found, reach = np.zeros((len(begins) + 3, width)), last - begins[0]
    found[0, :3] = begins[0] - reach, powers[0][0] - reach * powers[0][1], powers[0][1]
    found[1:-2, 0], found[1:-2, 1 : DEGREE + 2] = begins, powers
    found[-2, :3] = last, end, slope
    found[-1, :2] = last + reach, end + reach * slope
    return found


class Curves(NamedTuple):
    """The curves of a muscle: forces over the largest isometric force.

    `active` and `passive` depend on the length of the fibre over its optimal one, `velocity` on its
    speed over the largest one, and `tendon` on its length over the slack length. It is None if a
    tendon is always rigid.
    """

    active: Smooth
    passive: Smooth
    velocity: Smooth
    tendon: Smooth | None


class MuscleModel(NamedTuple):
    """A model of a muscle.

    `shape` names its further numbers with their defaults, of which `curves` makes the curves.
    """

    about: str
    shape: Mapping[str, float]
    curves: Callable[[Mapping[str, float]], Curves]
    # the rate of the activation a [1/s] by the excitation u, times `rise`, `fall` [s] and the shape
    activation: Callable[[Node, Node, Node, Node, Mapping[str, float]], Node]
    rise: float
    fall: float
    fastest: float  # largest speed of shortening over the optimal length [1/s]
    damping: float = 0.0  # damping of the fibre
    speed: tuple[float, float] = (1.0, 0.0)  # s0, s1 of the speed at which the active force ends
    least: float = 0.01  # the shortest fibre over its optimal length
    weakest: float = 0.01  # the smallest activation

    def rows(self, shape: Mapping[str, float], width: int) -> tuple[Array | None, ...]:
        """Return the polynomials of the four curves, None for a tendon that is always rigid.

        Raises ArithmeticError or ValueError if no curve has this shape.
        """
        return _rows(self.curves, tuple(sorted({**self.shape, **shape}.items())), width)

    def problem(self, shape: Mapping[str, float]) -> str:
        """Return why no curve has this shape, or ""."""
        try:
            rows = [x for x in self.rows(shape, DEGREE + 3) if x is not None]
        except (ArithmeticError, ValueError) as error:
            return str(error)
        return "" if all(np.isfinite(x).all() for x in rows) else "gives a curve that is not finite"


@lru_cache(maxsize=KEPT)
def _rows(curves: Any, shape: tuple[tuple[str, float], ...], width: int) -> tuple[Any, ...]:
    with np.errstate(all="ignore"):
        found = curves(dict(shape))
    return tuple(None if x is None else x.rows(width) for x in found)


def bezier(corners: Sequence[tuple[float, float, float]], curviness: Sequence[float]) -> Smooth:
    """Return the curve through (x, y, slope) that has a corner with rounded ends in between.

    Each part is a Bezier curve of degree 5, whose inner points lie on its end tangents [Millard et
    al. 2013, appendix]. `curviness` from 0 to 1 moves them towards the corner. Raises ValueError if
    the tangents do not meet between two points.
    """
    parts = [_corner(a, b, 0.1 + 0.8 * c) for a, b, c in zip(corners, corners[1:], curviness)]
    u = np.linspace(0.0, 1.0, PARTS_OF_BEZIER + 1)
    knots = tuple(_bernstein(along, u) for along, _ in parts)

    def value(k: int, x: Array) -> Array:
        along, up = parts[k]
        return _bernstein(up, _parameter(along, x))

    return Smooth(tuple(x for x, _, _ in corners), value, knots=knots)


def _parameter(along: Array, x: Array) -> Array:
    """Return u at which a rising Bezier curve has the values x (n,), by Newton's method."""
    u, low, high = np.full(len(x), 0.5), np.zeros(len(x)), np.ones(len(x))
    for _ in range(HALVINGS):
        miss = _bernstein(along, u) - x
        low, high = np.where(miss < 0.0, u, low), np.where(miss < 0.0, high, u)
        new = u - miss / _bernstein(5.0 * np.diff(along), u)
        u = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
    return u


def _corner(
    a: tuple[float, float, float], b: tuple[float, float, float], c: float
) -> tuple[Array, Array]:
    """Return the control points x and y of a part of `bezier`."""
    (x0, y0, slope0), (x1, y1, slope1) = a, b
    if slope0 == slope1:
        x = 0.5 * (x0 + x1)
    else:
        x = (y1 - y0 - x1 * slope1 + x0 * slope0) / (slope0 - slope1)
    y = (x - x1) * slope1 + y1
    if not x0 < x < x1:
        raise ValueError(f"the tangents at {x0:.4g} and {x1:.4g} of a curve do not meet between")
    before = x0 + c * (x - x0), y0 + c * (y - y0)
    after = x1 + c * (x - x1), y1 + c * (y - y1)
    return (
        np.array([x0, before[0], before[0], after[0], after[0], x1]),
        np.array([y0, before[1], before[1], after[1], after[1], y1]),
    )


def _bernstein(points: Array, u: Array) -> Array:
    """Return the Bezier curve of these points at u (n,)."""
    found = [np.full(len(u), p) for p in points]
    while len(found) > 1:
        found = [(1.0 - u) * p + u * q for p, q in pairwise(found)]
    return found[0]
