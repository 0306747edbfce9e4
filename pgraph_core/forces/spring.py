"""A linear spring and damper between two points, with limits on its length."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from ..engine.compiler.jit import part
from ..engine.records import REAL
from ..engine.rows import point_of, point_velocity
from ..engine.vec import dot, scale, sub, xyz
from ..fields import AtPoint, Expression, NotNegative, Number, Vec3, field, maybe_vector
from ..tolerances import TINY
from ..units import M, N, S
from .base import (
    KIND,
    Array,
    Between,
    Load,
    Places,
    Sprung,
    number_or_law,
    pack_rates,
    rates_of,
    refuse_crossed_ends,
    row,
)


class BetweenPoints(AtPoint, Between):
    """A force between a point on `body` and one on `other`, along the line joining them."""

    other_point: Vec3 | None = field(
        "three finite numbers in the axes of `other` [m]; default: its origin",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in the axes of the second body; default: its origin",
    )  # fmt: skip

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {"point": self.other_point or (0.0, 0.0, 0.0), "other_point": self.point}


def points_of(f: BetweenPoints, body: Any) -> tuple[Sequence[float], Sequence[float]]:
    """Return both points in their bodies' axes [m]. Defaults to a tip, and to the other's origin.

    `body` is the description of its first body.
    """
    return f.point or body.tip_point, f.other_point or (0.0, 0.0, 0.0)


def pack_points(f: BetweenPoints, one: Any, at: Places) -> float:
    """Write both points into the row, and return their distance in the initial state [m]."""
    own, other = points_of(f, at.body(f.body))
    one["point_a"], one["point_b"] = at.in_row(f.body, own), at.in_row(f.other, other)
    return float(np.linalg.norm(at.at_start(f.body, own) - at.at_start(f.other, other)))


class Spring(BetweenPoints, Sprung):
    """A spring and damper between two points, with their distance limited by `low` and `high`."""

    ABOUT: ClassVar[str] = "a spring between two points, with damper and limits of its length"
    NEW: ClassVar[dict[str, Any]] = {"stiffness": 100.0}

    kind: Literal["spring"] = field(KIND, default="spring")
    stiffness: NotNegative | Expression = field(
        "a number >= 0 [N/m], or an expression", converter=number_or_law, default=0.0, dim=N / M
    )
    damping: NotNegative | Expression = field(
        "a number >= 0 [N s/m], or an expression", converter=number_or_law, default=0.0,
        dim=N * S / M,
    )  # fmt: skip
    rest: Number | None = field(
        "a length >= 0 without force [m]; default: as in the initial state",
        default=None, ge=0, dim=M, help="rest length; default: as in the initial state",
    )  # fmt: skip
    low: Number | None = field(
        "the smallest length > 0 [m], or None",
        default=None, gt=0, dim=M, since=3, help="minimum length; default: unlimited",
    )  # fmt: skip
    high: Number | None = field(
        "the largest length > 0 [m], or None",
        default=None, gt=0, dim=M, since=3,
        help="maximum length, for example of a string; default: unlimited",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        refuse_crossed_ends(self)
        return self


def pack(f: Spring, one: Any, at: Places) -> Array | None:
    """Write the points, stiffness, damping and rest length."""
    apart = pack_points(f, one, at)
    one["rest"] = apart if f.rest is None else f.rest
    return pack_rates(f, one)


@part
def along(p, end):
    """Return (unit vector from `end` to p, distance)."""
    apart = sub(p, end)
    length = math.sqrt(dot(apart, apart) + TINY)
    return scale(1.0 / length, apart), length


@part
def line_of(one, work, linear):
    """Return (p on A, point on B, unit vector from B's to A's, length, rate) of a load."""
    p = point_of(xyz(one.point_a), work, one.row_a)
    end = point_of(xyz(one.point_b), work, one.row_b)
    d, length = along(p, end)
    u = sub(
        point_velocity(work, linear, one.row_a, p), point_velocity(work, linear, one.row_b, end)
    )
    return p, end, d, length, dot(d, u)


@part
def length_of(one, work):
    """Return the length of a straight load."""
    p = point_of(xyz(one.point_a), work, one.row_a)
    _, length = along(p, point_of(xyz(one.point_b), work, one.row_b))
    return length


@part
def law(one, knots, work, linear, t):
    """Compute the force -stiffness (length - rest) - damping x rate along the line."""
    p, end, d, length, speed = line_of(one, work, linear)
    stiffness, damping = rates_of(one, knots)
    elastic, damping = stiffness * (length - one.rest), damping * speed
    put_in = 0.0 if one.knots == 0 else -elastic * speed
    return p, (0.0, 0.0, 0.0), scale(-(elastic + damping), d), end, put_in, damping * speed


@part
def energy(one, knots, work):
    """Return the stored energy ½ stiffness (length - rest)²."""
    if one.knots > 0:
        return 0.0 * one.rest
    return 0.5 * one.stiffness * (length_of(one, work) - one.rest) ** 2


ROW = row(point_a=(REAL, 3), point_b=(REAL, 3), stiffness=REAL, damping=REAL, rest=REAL)
LOAD = Load(Spring, ROW, pack, law, energy, columns=len(Spring.VARIES))
