"""Points of paths that ride: shifts in their body with coordinates, and ranges where they count."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Self

import numpy as np
from pydantic import model_validator

from ..curves import Polynomial
from ..errors import shown
from ..fields import (
    Frozen,
    Number,
    Text,
    Vec3,
    Whole,
    field,
    listed,
    refuse,
    refuse_no_direction,
    vector,
)
from ..functions import Curve, Function, Pieces
from ..units import NONE, M, Q

_function: Callable[[Any], Function] = listed
COORDINATE = "the index of a degree of freedom of the joint of `body`, starting at 0"
MOST_POWERS = 3  # coefficients of a polynomial: a piece goes on beyond its ends up to this


class Shift(Frozen):
    """A displacement of a point in its body by a function of a joint coordinate.

    The point moves by the value of the curve times the vector `along`, in the axes of its own body.
    A tension at the point acts on the coordinate, too, by its power.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> x = pg.Curve(x=(-2, -1, 0), value=(0.01, 0.03, 0.05))
    >>> pg.Shift(body="shank", along=(1, 0, 0), curve=x).coordinate
    0
    """

    body: Text = field("the name of a body, whose joint coordinate shifts the point", label="Body")
    coordinate: Whole = field(COORDINATE, default=0, ge=0, le=5)
    along: Vec3 = field(
        "a vector [x, y, z] in the axes of the point's body, by which a value of 1 m shifts it",
        converter=vector, dim=NONE, role="direction",
    )  # fmt: skip
    curve: Function = field(
        "points {'x': [...], 'value': [...], 'kind': ...} as of a relation, or {'kind': "
        "'polynomial', 'coefficients': [...]} of degree 2 at most [m]",
        converter=_function, dim=M, over=Q,
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        refuse_no_direction(along=self.along)
        text = "points of a curve, such as {'x': [0, 1], 'value': [0.02, 0.03]}"
        if isinstance(self.curve, str):
            refuse([("curve", f"a shift is no expression, got {shown(self.curve)}; give {text}")])
        if isinstance(self.curve, Polynomial) and len(c := self.curve.coefficients) > MOST_POWERS:
            degree = f"is a polynomial of degree 2 at most, got degree {len(c) - 1}"
            refuse([("curve", f"{degree}; give {text}")])
        return self

    @property
    def pieces(self) -> Pieces:
        """The polynomials of its function."""
        if isinstance(self.curve, Curve):
            return self.curve.pieces
        assert isinstance(self.curve, Polynomial), "no expression"
        c = np.array(self.curve.coefficients)
        return Pieces(np.array([0.0, 1.0]), c[:, None], float(c.sum()))

    @property
    def corners(self) -> tuple[float, ...]:
        """The coordinates at which the second derivative of its function jumps."""
        return self.curve.corners if isinstance(self.curve, Curve) else ()

    def at(self, q: float) -> float:
        """Return its value at a coordinate [m], as kernels compute it."""
        places, powers, end, repeats = self.pieces
        rise, x = end - powers[0, 0], q
        turns = np.floor((q - places[0]) / (places[-1] - places[0])) if repeats else 0.0
        x -= turns * (places[-1] - places[0])
        k = int(np.clip(np.searchsorted(places, x, "right") - 1, 0, len(places) - 2))
        inside = min(max(x - places[k], 0.0), places[k + 1] - places[k])
        own = np.polynomial.Polynomial(powers[:, k])
        beyond = x - places[k] - inside
        slope = own.deriv()(inside) + 0.5 * beyond * own.deriv(2)(inside)
        return float(own(inside) + beyond * slope + turns * rise)


class Within(Frozen):
    """A range of a joint coordinate, from `low` to `high` with both ends, in which a point counts.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> behind = pg.Within(body="shank", low=-0.8, high=0.2)
    >>> pg.Via(body="thigh", point=(0, 0, -0.4), when=behind).when.low
    -0.8
    """

    body: Text = field("the name of a body, in whose joint's range the point counts", label="Body")
    coordinate: Whole = field(COORDINATE, default=0, ge=0, le=5)
    low: Number = field("the least coordinate with the point [rad, m]", dim=Q)
    high: Number = field("the largest coordinate with the point [rad, m]", dim=Q)

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        if self.low > self.high:
            text = f"must be at most high, {shown(self.high)}, got {shown(self.low)}; exchange them"
            refuse([("low", text)])
        return self

    def holds(self, q: float) -> bool:
        """Check whether a coordinate is in the range."""
        return self.low <= q <= self.high


CoordinateOf = Callable[[str, int], float]  # body and index of a degree of freedom: [rad, m]


def shifted(
    point: Sequence[float], shifts: Iterable[Shift], coordinate: CoordinateOf
) -> Sequence[float]:
    """Return a point with its shifts at a state."""
    for one in shifts:
        value = one.at(coordinate(one.body, one.coordinate))
        point = tuple(x + value * d for x, d in zip(point, one.along))
    return point
