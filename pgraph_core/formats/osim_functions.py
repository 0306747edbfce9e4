"""Functions of OpenSim: polynomials and cubic splines of one coordinate.

A spline has rows (x, value, slope) of a piecewise cubic, and is a straight line beyond its ends, as
in OpenSim.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..errors import shown
from ..tolerances import SOLVED
from .osim_text import Document, Element

Row = tuple[float, float, float]
LONGEST = 200  # characters of an expression of a track
MOST_POWERS = 8  # coefficients of a polynomial of a relation


class Curve(NamedTuple):
    """A function of a coordinate: the rows of a spline, or else the powers of a polynomial."""

    powers: tuple[float, ...] = (0.0,)  # coefficients of 1, x, x^2, ...
    rows: tuple[Row, ...] = ()

    @property
    def constant(self) -> float | None:
        """Its value if it does not depend on the coordinate, else None."""
        if self.rows:
            same = all(y == self.rows[0][1] and not slope for _, y, slope in self.rows)
            return self.rows[0][1] if same else None
        return None if any(self.powers[1:]) else self.powers[0]

    @property
    def line(self) -> tuple[float, float] | None:
        """The (offset, slope) of a straight line, or None."""
        if self.rows or any(self.powers[2:]):
            return None
        return self.powers[0], self.powers[1] if len(self.powers) > 1 else 0.0

    def times(self, factor: float) -> Curve:
        """Return the function multiplied by a number."""
        rows = tuple((x, factor * y, factor * slope) for x, y, slope in self.rows)
        return Curve(tuple(factor * c for c in self.powers), rows)

    def at(self, x: float) -> Row:
        """Return (x, value, slope) at a coordinate."""
        if not self.rows:
            p = np.polynomial.Polynomial(self.powers)
            return x, float(p(x)), float(p.deriv()(x))
        first, last = self.rows[0], self.rows[-1]
        for end, beyond in ((first, x < first[0]), (last, x > last[0])):
            if beyond:
                return x, end[1] + end[2] * (x - end[0]), end[2]
        for row in self.rows:
            if row[0] == x:
                return row
        k = int(np.searchsorted([row[0] for row in self.rows], x)) - 1
        (a, y, m), (b, z, n) = self.rows[k : k + 2]
        h, t = b - a, (x - a) / (b - a)
        rise = (z - y) / h
        c, d = 3.0 * rise - 2.0 * m - n, m + n - 2.0 * rise
        return x, y + h * t * (m + t * (c + t * d)), m + t * (2.0 * c + 3.0 * t * d)

    def within(self, low: float, high: float) -> float | str | tuple[Row, ...]:
        """Return it as a function of a track that goes from `low` to `high`.

        Raises ValueError for a polynomial that no expression holds.
        """
        if (value := self.constant) is not None:
            return value
        if self.rows:
            ends = [x for x in (low, high) if not self.rows[0][0] <= x <= self.rows[-1][0]]
            return tuple(sorted((*self.rows, *map(self.at, ends))))
        text = ""
        for c in self.powers[::-1]:
            text = f"{c!r}+q*({text})" if text else repr(c)
        if len(text) > LONGEST:
            degree = len(self.powers) - 1
            raise ValueError(f"a polynomial of degree {degree} is too long for a track")
        return text


def total(curves: Sequence[Curve]) -> Curve:
    """Return the sum of functions. Raises ValueError for one beyond cubic polynomials."""
    if not any(curve.rows for curve in curves):
        size = max((len(curve.powers) for curve in curves), default=1)
        padded = [np.pad(curve.powers, (0, size - len(curve.powers))) for curve in curves]
        return Curve(tuple(np.sum(padded, axis=0).tolist()) if padded else (0.0,))
    if any(any(curve.powers[4:]) for curve in curves if not curve.rows):
        raise ValueError("a spline along one axis and a polynomial beyond degree 3 along another")
    if len(curves) == 1:
        return curves[0]
    knots = sorted({x for curve in curves for x, _, _ in curve.rows})
    return Curve(rows=tuple(_summed(x, curves) for x in knots))


def _summed(x: float, curves: Iterable[Curve]) -> Row:
    rows = [curve.at(x) for curve in curves]
    return x, sum(row[1] for row in rows), sum(row[2] for row in rows)


def simm_rows(x: Sequence[float], y: Sequence[float]) -> tuple[Row, ...]:
    """Return the rows of a SimmSpline through points.

    It is the spline of Forsythe, Malcolm and Moler (Computer Methods for Mathematical Computations,
    1977): the third derivatives of its first and last pieces are those of the cubics through the
    first and the last four points. Through three points it is a parabola.
    """
    n = len(x)
    q, value = np.array(x), np.array(y)
    h, rise = np.diff(q), np.diff(value) / np.diff(q)
    if n == 2:
        return tuple((a, b, float(rise[0])) for a, b in zip(x, y))
    matrix, right = np.zeros((n, n)), np.zeros(n)
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i]
        right[i] = rise[i] - rise[i - 1]
    matrix[0, :2], matrix[-1, -2:] = (-h[0], h[0]), (-h[-1], h[-1])
    if n > 3:
        second = np.diff(rise) / (q[2:] - q[:-2])
        third = np.diff(second) / (q[3:] - q[:-3])
        right[0], right[-1] = third[0] * h[0] ** 2, third[-1] * h[-1] ** 2
    sigma = np.linalg.solve(matrix, right)  # a sixth of the second derivatives
    slopes = np.append(
        rise - h * (2.0 * sigma[:-1] + sigma[1:]),
        rise[-1] + h[-1] * (sigma[-2] + 2.0 * sigma[-1]),
    )
    return tuple(zip(x, y, slopes.tolist()))


SPLINES = {"SimmSpline": simm_rows, "NaturalCubicSpline": simm_rows, "natCubicSpline": simm_rows}


def function_of(file: Document, element: Element) -> Curve:
    """Return the function that an element holds. Raises FileError."""
    tag = element.tag
    if tag == "Constant":
        return Curve((file.number(element, "value", 0.0),))
    if tag == "LinearFunction":
        slope, offset = file.numbers(element, "coefficients", (1.0, 0.0))
        return Curve((offset, slope))
    if tag == "PolynomialFunction":
        return Curve(tuple(file.list_of(element, "coefficients"))[::-1] or (0.0,))
    if tag == "MultiplierFunction":
        inner = element.first("function")
        if inner is None or not inner.children:
            raise file.wrong(element, "function", "names no function to multiply")
        return function_of(file, inner.children[0]).times(file.number(element, "scale", 1.0))
    if tag not in (*SPLINES, "PiecewiseLinearFunction"):
        text = f"{tag} is not read; a joint takes Constant, LinearFunction, PolynomialFunction, "
        raise file.wrong(element, "", f"{text}SimmSpline and MultiplierFunction of them")
    x, y = (file.list_of(element, name) for name in ("x", "y"))
    if len(x) != len(y) or len(x) < 2 or not all(a < b for a, b in pairwise(x)):
        text = f"needs two or more ascending x and as many y, got {shown(x)} and {shown(y)}"
        raise file.wrong(element, "x", text)
    if tag in SPLINES:
        return Curve(rows=SPLINES[tag](x, y))
    slopes = np.diff(y) / np.diff(x)
    if np.ptp(slopes) > SOLVED * np.abs(slopes).max(initial=0.0):
        text = "a PiecewiseLinearFunction has corners, where a joint would need an impulse; make it"
        raise file.wrong(element, "", f"{text} a SimmSpline")
    return Curve((y[0] - float(slopes[0]) * x[0], float(slopes[0])))
