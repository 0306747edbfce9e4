"""Paths of forces: straight spans from a point of a body through via points to the other end.

A force along a path is one tension in all its spans, since it passes the via points without
friction. Its kind defines the tension from the length of the path and its rate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from ..engine.compiler.jit import part
from ..engine.rows import point_of, point_velocity
from ..engine.vec import dot, scale, sub, xyz
from ..fields import AtPoint, Frozen, Text, Vec3, field, maybe_vector, parts_of, vector
from ..tolerances import TINY
from ..units import M
from .base import Action, Between, Places, opposed


class Via(Frozen):
    """A point of a body through which a path leads."""

    body: Text = field("the name of a body, or 'ground'", label="Body")
    point: Vec3 = field(
        "three finite numbers in the axes of its `body` [m]",
        converter=vector, dim=M, role="point", help="in the axes of its body",
    )  # fmt: skip


class BetweenPoints(AtPoint, Between):
    """A force between a point on `body` and one on `other`, along the line joining them.

    If there are points in `via`, it acts along the straight spans from each point to the next one.
    """

    PLACES: ClassVar[tuple[str, ...]] = ("via",)

    other_point: Vec3 | None = field(
        "three finite numbers in the axes of `other` [m]; default: its origin",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in the axes of the second body; default: its origin",
    )  # fmt: skip
    via: tuple[Via, ...] = field(
        "a list of points {'body': name, 'point': [x, y, z]} [m] between both ends, in their order",
        converter=parts_of(Via), default=(), role="parts", since=9,
        help="points between both ends through which it passes without friction",
    )  # fmt: skip

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        ends = {"point": self.other_point or (0.0, 0.0, 0.0), "other_point": self.point}
        return {**ends, "via": self.via[::-1]} if self.via else ends


def points_of(f: BetweenPoints, body: Any) -> tuple[Sequence[float], Sequence[float]]:
    """Return both points in their bodies' axes [m]. Defaults to a tip, and to the other's origin.

    `body` is the description of its first body.
    """
    return f.point or body.tip_point, f.other_point or (0.0, 0.0, 0.0)


def path_of(f: BetweenPoints, body: Any) -> list[tuple[str, Sequence[float]]]:
    """Return (body, point in its axes [m]) of all points of a path in order."""
    own, other = points_of(f, body)
    return [(f.body, own), *((via.body, via.point) for via in f.via), (f.other, other)]


def spans_of(
    f: BetweenPoints, body: Any
) -> Iterator[tuple[tuple[str, Sequence[float]], tuple[str, Sequence[float]]]]:
    """Yield the (body, point) at both ends of each span of a path."""
    return pairwise(path_of(f, body))


def pack_points(f: BetweenPoints, one: Any, at: Places) -> float:
    """Write both ends into the row, and return the length of the path in the initial state [m]."""
    own, other = points_of(f, at.body(f.body))
    one["point_a"], one["point_b"] = at.in_row(f.body, own), at.in_row(f.other, other)
    places = [at.at_start(*place) for place in path_of(f, at.body(f.body))]
    first, *others = (float(np.linalg.norm(a - b)) for a, b in pairwise(places))
    return sum(others, first)


@part
def along(p, end):
    """Return (unit vector from `end` to p, distance)."""
    apart = sub(p, end)
    length = math.sqrt(dot(apart, apart) + TINY)
    return scale(1.0 / length, apart), length


@part
def first_of(one, work):
    """Return the point A of a path, world axes."""
    return point_of(xyz(one.point_a), work, one.row_a)


@part
def next_of(one, vias, n, work):
    """Return (row, body, point) at the end of span n: a via point or, after the last one, B."""
    if n == one.vias:
        return one.row_b, one.body_b, point_of(xyz(one.point_b), work, one.row_b)
    via = vias[one.first_via + n]
    return via.row, via.body, point_of(xyz(via.point), work, via.row)


@part
def span(work, linear, a, p, b, q):
    """Return (unit vector from q to p, length, rate) of the span from p on row a to q on row b."""
    d, length = along(p, q)
    u = sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, q))
    return d, length, dot(d, u)


@part
def with_the_rest(one, vias, work, linear, b, q, length, rate):
    """Return the length and rate of the first span, which ends at q on row b, plus the others'."""
    for n in range(1, one.vias + 1):
        a, p = b, q
        b, _, q = next_of(one, vias, n, work)
        _, more, faster = span(work, linear, a, p, b, q)
        length += more
        rate += faster
    return length, rate


@part
def measured(one, vias, work, linear):
    """Return the length of a path and its rate."""
    b, _, q = next_of(one, vias, 0, work)
    _, length, rate = span(work, linear, one.row_a, first_of(one, work), b, q)
    return with_the_rest(one, vias, work, linear, b, q, length, rate)


@part
def length_of(one, vias, work):
    """Return the length of a path."""
    _, _, q = next_of(one, vias, 0, work)
    _, length = along(first_of(one, work), q)
    for n in range(1, one.vias + 1):
        p = q
        _, _, q = next_of(one, vias, n, work)
        _, more = along(p, q)
        length += more
    return length


def on_path(pull: Any, energy: Any) -> Action:
    """Return the wrenches of a tension along a path.

    `pull(one, knots, length, rate, t)` returns (tension, power put in, power lost).
    `energy(one, knots, length)` returns the stored energy.
    """

    def onto(push):
        both = opposed(push)

        @part
        def exert(one, knots, vias, work, linear, t, to):
            a, body_a, p = one.row_a, one.body_a, first_of(one, work)
            b, body_b, q = next_of(one, vias, 0, work)
            d, length, rate = span(work, linear, a, p, b, q)
            length, rate = with_the_rest(one, vias, work, linear, b, q, length, rate)
            tension, put_in, lost = pull(one, knots, length, rate, t)
            none = (0.0, 0.0, 0.0)
            both(to, a, body_a, p, b, body_b, q, none, scale(-tension, d))
            for n in range(1, one.vias + 1):
                a, body_a, p = b, body_b, q
                b, body_b, q = next_of(one, vias, n, work)
                d, _ = along(p, q)
                both(to, a, body_a, p, b, body_b, q, none, scale(-tension, d))
            return put_in, lost

        return exert

    @part
    def stored(one, knots, vias, work):
        return energy(one, knots, length_of(one, vias, work))

    return Action(onto, stored)
