"""Functions of one coordinate, which another one follows in a relation."""

from __future__ import annotations

import math
from collections.abc import Container
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Tag, model_validator

from .curves import Polynomial
from .errors import shown
from .fields import Expression, Frozen, Numbers, field, refuse, several
from .signals import Node, parsed
from .signals.grammar import COMPARISONS, walk
from .tolerances import NOTABLE, SOLVED

Array = NDArray[np.float64]
Ends = Literal["natural", "clamped", "periodic", "quintic", "hermite"]


class Pieces(NamedTuple):
    """Polynomials of which each holds between two neighbouring places, and the value at the end."""

    places: Array  # (n + 1,)
    powers: Array  # (degree + 1, n) that of power 0 first, of the way from the first place
    end: float
    repeats: bool = False  # with the rise of a period, beyond its ends


class Curve(Frozen):
    """A smooth function through points, for a relation between two coordinates.

    A "natural" curve is a cubic spline that does not bend at its ends. A "clamped" one has no slope
    there. A "quintic" one is a spline of degree 5 with neither slope nor bend at its ends, as a cam
    with dwells, and between two points the 3-4-5 polynomial. Beyond its ends such a curve is a
    straight line, so that only the bend of a clamped one jumps there. A "periodic" cubic spline
    repeats its slope and its bend beyond its ends, and rises in each period by the same value. A
    "hermite" curve has the slopes of `slope` at its points, and a cubic between two of them.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> rise = pg.Curve(x=(0, 1.57, 3.14), value=(0, 0.012, 0.02), kind="quintic")
    """

    x: Numbers = field("two or more ascending coordinates [rad, m]", converter=several)
    value: Numbers = field("one finite number per coordinate [rad, m]", converter=several)
    kind: Ends = field("one of natural, clamped, periodic, quintic, hermite", default="natural")
    slope: Numbers = field(
        "one finite number per coordinate of a hermite curve", converter=several, default=()
    )

    @model_validator(mode="after")
    def _knots(self) -> Self:
        refuse(self._problems()[:1])  # the others follow from it
        return self

    def _problems(self) -> list[tuple[str, str]]:
        x, value = self.x, self.value
        if len(x) != len(value):
            sizes = f"{len(x)} coordinates and {len(value)} values"
            return [("value", f"needs one value per coordinate, got {sizes}")]
        wanted = len(x) if self.kind == "hermite" else 0
        if len(self.slope) != wanted:
            text = f"a {self.kind} curve of {len(x)} points has {wanted} slopes"
            return [("slope", f"{text}, got {len(self.slope)}")]
        least = 3 if self.kind == "periodic" else 2
        if len(x) < least:
            text = f"{self.kind} curve needs {least} or more points, got {len(x)}"
            do = "; two are a straight line, which is a gear" if len(x) == 2 else ""
            return [("x", f"a {text}{do}")]
        if not all(a < b for a, b in pairwise(x)):
            return [("x", f"the coordinates must ascend, got {shown(list(x))}")]
        for a, b in pairwise(x):
            if b - a <= NOTABLE * (x[-1] - x[0]):
                text = f"two coordinates are only {b - a:.3g} apart, {NOTABLE:g} of the range or"
                return [("x", f"{text} less, near {a:.6g}; leave one out")]
        if not self._is_finite():
            return [("value", "the slopes between its points are too large for numbers")]
        return []

    def _is_finite(self) -> bool:
        try:
            return bool(np.isfinite(self.pieces.powers).all())
        except ValueError:  # by SciPy, of its own equations
            return False

    @property
    def ends(self) -> tuple[float, float] | None:
        """The coordinates beyond which the curve is an assumption, None if it repeats or rests."""
        return None if self.kind in ("periodic", "quintic") else (self.x[0], self.x[-1])

    @cached_property
    def corners(self) -> tuple[float, ...]:
        """The coordinates at which the second derivative jumps."""
        if self.kind == "clamped":
            return self.x[0], self.x[-1]
        if self.kind != "hermite":
            return ()
        places, powers, *_ = self.pieces
        widths = np.diff(places)
        before = 2.0 * powers[2] + 6.0 * powers[3] * widths
        size = np.abs(np.concatenate((before, 2.0 * powers[2]))).max(initial=0.0)
        jumps = np.abs(before[:-1] - 2.0 * powers[2, 1:]) > SOLVED * size
        return tuple(places[1:-1][jumps].tolist())

    @cached_property
    def pieces(self) -> Pieces:
        """The polynomials between the points, and a straight line past each end if it is open."""
        with np.errstate(all="ignore"):
            powers, places, end = self._powers(), np.array(self.x), self.value[-1]
            if self.kind == "periodic":
                return Pieces(places, powers, end, True)
            width, span = places[-1] - places[-2], places[-1] - places[0]
            degrees = np.arange(1, len(powers))
            slope = float(degrees @ (powers[1:, -1] * width ** (degrees - 1)))
            first, last = np.zeros((2, len(powers)))
            first[:2] = self.value[0] - span * powers[1, 0], powers[1, 0]
            last[:2] = end, slope if self.kind in ("natural", "hermite") else 0.0
            places = np.concatenate(([places[0] - span], places, [places[-1] + span]))
            powers = np.column_stack((first, powers, last))
            return Pieces(places, powers, end + span * float(last[1]))

    def values(self, x: Array) -> Array:
        """Return the values at coordinates (n,) between the points."""
        places, powers, *_ = self.pieces
        piece = np.clip(np.searchsorted(places, x, "right") - 1, 0, len(places) - 2)
        found = np.zeros(len(x))
        for c in powers[::-1, piece]:
            found = found * (x - places[piece]) + c
        return found

    def _powers(self) -> Array:
        from scipy.interpolate import CubicHermiteSpline, CubicSpline, make_interp_spline

        x, value = np.array(self.x), np.array(self.value)
        if self.kind == "hermite":
            return np.array(CubicHermiteSpline(x, value, self.slope).c[::-1])
        if self.kind == "quintic":
            rest = [(1, 0.0), (2, 0.0)]
            spline = make_interp_spline(x, value, k=5, bc_type=(rest, rest))
            return np.array([spline(x[:-1], nu=k) / math.factorial(k) for k in range(6)])
        if self.kind != "periodic":
            return np.array(CubicSpline(x, value, bc_type=self.kind).c[::-1])
        rise = (value[-1] - value[0]) / (x[-1] - x[0])
        apart = value - value[0] - rise * (x - x[0])
        apart[-1] = apart[0]  # equal but for rounding
        found = np.array(CubicSpline(x, apart, bc_type="periodic").c[::-1])
        found[0] = value[:-1]
        found[1] += rise
        return found


def _which(value: Any) -> str | None:
    """Return the tag of a function: an object, a mapping, or an expression '=...'."""
    if isinstance(value, str):
        return "expression"
    if isinstance(value, dict):
        kind = value.get("kind", "natural")
        return kind if kind == "polynomial" else "curve" if kind in get_args(Ends) else None
    return type(value).__name__.lower() if isinstance(value, (Curve, Polynomial)) else None


Function = Annotated[
    Annotated[Curve, Tag("curve")]
    | Annotated[Polynomial, Tag("polynomial")]
    | Annotated[Expression, Tag("expression")],
    Discriminator(_which),
]


def corners_of(
    function: Function, x: Node, parameters: Container[str] = ()
) -> list[tuple[Node, Node]]:
    """Return the pairs of trees that are equal where the second derivative jumps at a coordinate x.

    These are the ends of a clamped curve, the points of a hermite one at which it does, and the
    ends of each smoothstep in an expression. A parameter that is called q is the parameter.
    """
    if isinstance(function, str):
        tree = parsed(function)
        tree = tree if "q" in parameters else _with_coordinate(tree, x)
        return [(n.args[0], end) for n in walk(tree) if n.op == "smoothstep" for end in n.args[1:]]
    if isinstance(function, Polynomial):
        return []
    return [(x, Node("number", value=end)) for end in function.corners]


def _with_coordinate(node: Node, x: Node) -> Node:
    """Return a tree with x in place of q, its short name."""
    if node.op == "name" and node.signal[1] == "q":
        return x
    return node._replace(args=tuple(_with_coordinate(arg, x) for arg in node.args))


SHARP = (*COMPARISONS, "and", "or", "not", "if", "min", "max", "abs", "table")


def problems_of(function: Function) -> list[str]:
    """Return why a function is none of a relation, which needs a slope everywhere."""
    if isinstance(function, Polynomial) and not any(function.coefficients[1:]):
        text = "a polynomial of a relation is of degree 1 to 7; use kind 'motion' to hold a joint"
        return [f"{text}, got {shown(list(function.coefficients))}"]
    sharp = (
        [n.op for n in walk(parsed(function)) if n.op in SHARP] if isinstance(function, str) else []
    )
    if sharp:
        text = "has a corner or a jump, where a relation would need an impulse; write it without "
        text += "comparisons, if, min, max, abs and table, as with smoothstep, or give points"
        return [f"{shown(function)} {text}"]
    return []
