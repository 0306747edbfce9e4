"""A strut: a spring and damper tabulated over length and speed, with a bump stop."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from ..engine.compiler.jit import part
from ..engine.records import INTEGER, REAL
from ..fields import Frozen, Number, Numbers, field, refuse, several
from ..units import M, N, S
from .base import KIND, Array, Load, Places, row
from .path import BetweenPoints, on_path, pack_points

STOP = 2  # knots of the stop
PULL = 1  # column of the knot of a drive that has its pull


class Lines(Frozen):
    """A piecewise linear curve, extrapolated beyond its first and last knots."""

    x: Numbers = field("ascending numbers, at least one", converter=several)
    value: Numbers = field("one finite number for each x", converter=several)

    @model_validator(mode="after")
    def _knots(self) -> Self:
        x, value = self.x, self.value
        if not x or len(x) != len(value):
            refuse([("x", f"must be as many as the values, got {len(x)} and {len(value)}")])
        if any(a >= b for a, b in pairwise(x)):
            refuse([("x", "must ascend")])
        return self


class Strut(BetweenPoints):
    """A spring and damper between two points, with forces given by tables.

    `spring` defines the force over the length, and `damper` the force over its rate. If the length
    is smaller than `bump_length` by d and decreases at a speed u, a bump stop adds the force
    bump_stiffness d (1 + bump_damping u), which never pulls [Hunt & Crossley 1975].
    """

    ABOUT: ClassVar[str] = "spring and damper by tables over length and speed, with a bump stop"
    SCALES: ClassVar[tuple[str, ...]] = ("spring", "damper", "bump_stiffness")
    SINCE: ClassVar[int] = 5
    NEW: ClassVar[dict[str, Any]] = {"spring": {"x": (0.0, 1.0), "value": (0.0, 100.0)}}

    kind: Literal["strut"] = field(KIND, default="strut")
    spring: Lines | None = field(
        "a table {'x': lengths [m], 'value': pulls [N]}, or None",
        default=None, dim=N, over=M, help="force over length, m N; m N; ...",
    )  # fmt: skip
    damper: Lines | None = field(
        "a table {'x': rates of the length [m/s], 'value': pulls [N]}, or None",
        default=None, dim=N, over=M / S, help="force over rate of length, m/s N; m/s N; ...",
    )  # fmt: skip
    bump_length: Number = field(
        "the length >= 0 below which the stop pushes [m]",
        default=0.0, ge=0, dim=M, help="length at which the bump stop engages",
    )  # fmt: skip
    bump_stiffness: Number = field("a number >= 0 [N/m]", default=0.0, ge=0, dim=N / M)
    bump_damping: Number = field(
        "a number >= 0 [s/m]",
        default=0.0,
        ge=0,
        dim=S / M,
        help="damping coefficient of the bump stop",
    )

    @model_validator(mode="after")
    def _stop_pushes(self) -> Self:
        if self.bump_stiffness and not self.bump_length:
            refuse([("bump_length", "must be > 0 if the bump stop has a stiffness, got 0")])
        return self

    @property
    def _bends(self) -> bool:
        tables = (bends(x)[1] for x in (self.spring, self.damper))
        return super()._bends or bool(self.bump_stiffness) or any(map(len, tables))


def bends(lines: Lines | None) -> tuple[tuple[float, float, float], Array]:
    """Return (x, value, slope) of the first segment, and (x, change of slope) of bends (n, 2)."""
    if lines is None:
        return (0.0, 0.0, 0.0), np.zeros((0, 2))
    x, value = np.array(lines.x), np.array(lines.value)
    slopes = np.diff(value) / np.diff(x)
    first = (x[0], value[0], slopes[0] if len(slopes) else 0.0)
    return first, np.stack((x[1:-1], np.diff(slopes)), axis=1) if len(x) > 2 else np.zeros((0, 2))


def pack(f: Strut, one: Any, at: Places) -> Array:
    """Write the points, first segments and stop, and return the bends in both tables."""
    pack_points(f, one, at)
    one["spring"], springs = bends(f.spring)
    one["damper"], dampers = bends(f.damper)
    one["springs"] = len(springs)
    one["bump_length"], one["bump_stiffness"] = f.bump_length, f.bump_stiffness
    one["bump_damping"] = f.bump_damping
    knots = np.concatenate((springs, dampers, np.zeros((STOP, 2))))
    return np.column_stack((knots, np.zeros(len(knots)), np.full(len(knots), np.inf)))


@part
def above(x, knot):
    """Return x if it is positive, else 0, unless a run holds one of them at this knot."""
    return min(max(x, knot[2]), knot[3])


@part
def value_of(line, knots, first, end, x):
    """Evaluate a piecewise linear table at x, as its first segment plus a ramp from each bend."""
    y = line[1] + line[2] * (x - line[0])
    for n in range(first, end):
        y += knots[n, 1] * above(x - knots[n, 0], knots[n])
    return y


@part
def integral_of(line, knots, first, end, x):
    """Integrate a piecewise linear table from its first knot to x."""
    from_first = x - line[0]
    y = (line[1] + 0.5 * line[2] * from_first) * from_first
    for n in range(first, end):
        beyond = max(x - knots[n, 0], 0.0)
        y += 0.5 * knots[n, 1] * beyond * beyond
    return y


@part
def pull(one, knots, length, rate, t):
    """Compute the pull of spring, damper and drive minus the push of the stop."""
    first = one.first_knot
    middle = first + one.springs
    stop = first + one.knots - STOP
    driven = 0.0
    for n in range(stop - one.drives, stop):
        driven += knots[n, PULL]
    damping = value_of(one.damper, knots, middle, stop - one.drives, rate)
    elastic = one.bump_stiffness * above(one.bump_length - length, knots[stop])
    push = above(elastic * (1.0 - one.bump_damping * rate), knots[stop + 1])
    tension = value_of(one.spring, knots, first, middle, length) + damping + driven - push
    return tension, -driven * rate, (damping - push + elastic) * rate


@part
def energy(one, knots, length):
    """Return the spring's energy, integrated from its first knot, plus the energy in the stop."""
    first = one.first_knot
    deep = max(one.bump_length - length, 0.0)
    stored = integral_of(one.spring, knots, first, first + one.springs, length)
    return stored + 0.5 * one.bump_stiffness * deep * deep


def linear(table: Any) -> bool:
    """Check whether no strut has a damper with bends or a damped stop."""
    straight = table["knots"] == table["springs"] + table["drives"] + STOP
    return bool((straight & (table["bump_damping"] == 0.0)).all())


ROW = row(
    point_a=(REAL, 3),
    point_b=(REAL, 3),
    spring=(REAL, 3),  # x, value and slope of the first line [m, N, N/m]
    damper=(REAL, 3),  # [m/s, N, N s/m]
    springs=INTEGER,  # knots of the spring; the damper's and drive's follow
    drives=INTEGER,
    bump_length=REAL,  # [m]
    bump_stiffness=REAL,  # [N/m]
    bump_damping=REAL,  # [s/m]
)
# knots: where a table bends, by how much its slope changes, and the least and most that it adds for
# that; then of the stop, where it engages and where it would pull
LOAD = Load(Strut, ROW, pack, on_path(pull, energy), columns=4, linear=linear)
