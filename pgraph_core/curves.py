"""Time-dependent numbers: tables, and the few formulas needed for prescribed motions."""

from __future__ import annotations

import operator
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from .fields import Expression, Frozen, Number, Numbers, Vec3s, field, refuse, several, vectors


class Table(Frozen):
    """A scalar over time, interpolated linearly and constant outside of the given times.

    A table used as `q_of_t` of a constraint is interpolated by `spline` instead.
    """

    t: Numbers = field("ascending times [s], at least one", converter=several)
    value: Numbers = field("one finite number per time", converter=several)

    @model_validator(mode="after")
    def _knots(self) -> Self:
        refuse(_knot_problems(self.t, self.value))
        return self

    @cached_property
    def lines(self) -> NDArray[np.float64]:
        """Return an (n, 4) read-only array with time, value, slope and value again for each knot.

        The last slope is the number of knots per second, which kernels use as the initial guess of
        the interval.
        """
        t, x = np.array(self.t), np.array(self.value)
        slopes = np.zeros(len(t))
        slopes[:-1] = np.diff(x) / np.diff(t)
        slopes[-1] = (len(t) - 1) / (t[-1] - t[0]) if len(t) > 1 else 0.0
        found = np.stack((t, x, slopes, x), axis=1)
        found.flags.writeable = False
        return found

    def spline(self, interpolation: str) -> Any:
        """Create a SciPy cubic spline through two or more knots, at rest at the first and the last.

        A "monotone" one has the slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984)
        at inner knots, so that it stays between the values of neighbouring knots.
        """
        from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

        if interpolation == "spline":
            return CubicSpline(self.t, self.value, bc_type="clamped")
        slopes = PchipInterpolator(self.t, self.value).derivative()(self.t)
        slopes[[0, -1]] = 0.0
        return CubicHermiteSpline(self.t, self.value, slopes)


class VectorTable(Frozen):
    """A vector over time, interpolated linearly and constant outside of the given times."""

    t: Numbers = field("ascending times [s], at least one", converter=several)
    value: Vec3s = field("one [x, y, z] per time", converter=vectors)

    @model_validator(mode="after")
    def _knots(self) -> Self:
        refuse(_knot_problems(self.t, self.value))
        return self


def _knot_problems(t: tuple[float, ...], value: tuple[object, ...]) -> list[tuple[str, str]]:
    found = []
    if not t or len(t) != len(value):
        sizes = f"{len(t)} times, {len(value)} values"
        found.append(("value", f"needs one value per time, at least one, got {sizes}"))
    if not all(map(operator.lt, t, t[1:])):
        found.append(("t", f"the times t must ascend, got {list(t)}"))
    return found


class Sine(Frozen):
    """The sine curve mean + amplitude sin(frequency t + phase), for all times."""

    kind: Literal["sine"] = Field(default="sine", description="'sine'")
    mean: Number = Field(default=0.0, description="a finite number [rad, m]")
    amplitude: Number = Field(default=1.0, description="a finite number [rad, m]")
    frequency: Number = Field(default=1.0, description="a finite number [rad/s]")
    phase: Number = Field(default=0.0, description="a finite number [rad]")


class Polynomial(Frozen):
    """The polynomial c0 + c1 t + c2 t^2 + ... For example, (0, 2) is a rotation at 2 rad/s.

    A motion over time t is of degree 3 or less, and a relation to a coordinate of degree 1 to 7.
    """

    kind: Literal["polynomial"] = Field(default="polynomial", description="'polynomial'")
    coefficients: Annotated[Numbers, Field(min_length=1, max_length=8)] = field(
        "one to eight finite numbers, that of t^0 first", converter=several
    )


def _which(value: Any) -> str | None:
    """Return the tag of a curve, which may be an object, a mapping or an expression '=...'."""
    if isinstance(value, str):
        return "expression"
    if isinstance(value, dict):
        return str(value.get("kind", "table"))
    return type(value).__name__.lower() if isinstance(value, (Table, Sine, Polynomial)) else None


OverTime = Annotated[
    Annotated[Table, Tag("table")]
    | Annotated[Sine, Tag("sine")]
    | Annotated[Polynomial, Tag("polynomial")]
    | Annotated[Expression, Tag("expression")],
    Discriminator(_which),
]
