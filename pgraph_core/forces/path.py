"""Paths of forces: straight spans from a point of a body through via points to the other end.

A force along a path is one tension in all its spans, since it passes the via points without
friction. Its kind defines the tension from the length of the path and its rate.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from ..engine.compiler.jit import part
from ..engine.rows import point_of, point_velocity
from ..engine.vec import dot, scale, sub, xyz
from ..errors import shown
from ..fields import (
    AtPoint,
    Flag,
    Frozen,
    Number,
    Quat,
    Text,
    Vec3,
    field,
    maybe_part_of,
    maybe_vector,
    parts_of,
    refuse,
    refuse_no_direction,
    vector,
)
from ..rotation import Array
from ..tolerances import TINY
from ..units import M
from .base import Action, Between, Places, opposed
from .obstacle_rows import Past, end_of_way, passed, past_obstacles, settle, start_of_way
from .obstacles import POINT
from .riding import CoordinateOf, Shift, Within, shifted

Place = tuple[str, Sequence[float]]  # a body and a point in its axes [m]


class Via(Frozen):
    """A point of a body through which a path leads, or a round obstacle on which it lies.

    A point may move in its body by `shifts` with joint coordinates, and count only `when` a
    coordinate is in a range: outside of it, the path leads from the point before to the next one.

    With a `radius`, `point` is the centre of a sphere, or with an `axis` that of a cylinder. With
    `radii` it is the centre of an ellipsoid, whose axes are turned by `rotation`. The path touches
    it without friction, on its shorter side or on that of the point `side`, and leaves it where it
    is straight without it. If it is `inner`, the path leads through it as through a ring, and is
    straight where the straight line meets it.
    """

    FOLLOWERS: ClassVar[dict[str, tuple[str, ...]]] = {
        "radius": ("axis", "side", "inner"),
        "radii": ("rotation", "side"),
    }

    body: Text = field("the name of a body, or 'ground'", label="Body")
    point: Vec3 = field(
        "three finite numbers in the axes of its `body` [m]",
        converter=vector, dim=M, role="point", help="in the axes of its body",
    )  # fmt: skip
    radius: Number | None = field(
        "a length > 0 [m], or None for a point",
        default=None, gt=0, dim=M, since=9, help="radius of an obstacle; default: a point",
    )  # fmt: skip
    axis: Vec3 | None = field(
        "a direction in the axes of its `body`, or None for a sphere",
        converter=maybe_vector, default=None, role="direction", since=9,
        help="axis of a cylinder, in the axes of its body; default: a sphere",
    )  # fmt: skip
    side: Vec3 | None = field(
        "three finite numbers in the axes of its `body` [m], or None for the shorter side",
        converter=maybe_vector, default=None, dim=M, role="point", since=9,
        help="point on whose side the path lies; default: the shorter side",
    )  # fmt: skip
    inner: Flag = field(
        "true or false", default=False, since=9,
        help="the path leads through the obstacle, as through a ring",
    )  # fmt: skip
    shifts: tuple[Shift, ...] = field(
        "a list of displacements {'body': name, 'along': [x, y, z], 'curve': ...} of the point",
        converter=parts_of(Shift), default=(), role="parts", since=9,
        help="displacements of the point in its body by functions of joint coordinates",
    )  # fmt: skip
    when: Within | None = field(
        "a range {'body': name, 'low': q, 'high': q} of a joint coordinate, or None",
        converter=maybe_part_of(Within), default=None, since=9,
        help="range of a joint coordinate in which the point counts; default: always",
    )  # fmt: skip

    radii: Vec3 | None = field(
        "three lengths > 0 [m], or None",
        converter=maybe_vector, default=None, label="Half axes", dim=M, since=9,
        help="half axes of an ellipsoid; default: no ellipsoid",
    )  # fmt: skip
    rotation: Quat | None = field(
        "a nonzero quaternion [w, x, y, z] in the axes of its `body`, or None",
        default=None, role="frame", since=9,
        help="orientation of an ellipsoid; default: along the axes of its body",
    )  # fmt: skip

    @property
    def rides(self) -> bool:
        """True if it moves in its body, or counts in a range only."""
        return bool(self.shifts) or self.when is not None

    @property
    def is_obstacle(self) -> bool:
        """True if it is an obstacle, and no point."""
        return self.radius is not None or self.radii is not None

    @property
    def largest(self) -> float:
        """The radius of an obstacle, or the largest half axis [m]."""
        return max(self.radii) if self.radii is not None else self.radius or 0.0

    @model_validator(mode="after")
    def _round(self) -> Self:
        refuse_no_direction(axis=self.axis)
        if self.is_obstacle and self.rides:
            text = "is of a point, and this one is an obstacle; leave it or the radius out, or put "
            text += "the obstacle on a body that moves"
            refuse([("shifts" if self.shifts else "when", text)])
        names = "axis", "side", "inner", "rotation"
        given = [name for name in names if getattr(self, name) not in (None, False)]
        if given and not self.is_obstacle:
            text = "belongs to an obstacle; give its radius [m], such as radius=0.02, or leave it"
            refuse([(given[0], f"{text} out for a point")])
        if self.radii is not None:
            if not min(self.radii) > 0.0:
                refuse([("radii", f"must be three lengths > 0 [m], got {shown(self.radii)}")])
            for name in ("radius", "axis", "inner"):
                if getattr(self, name) not in (None, False):
                    text = "is of a sphere or cylinder, and `radii` make an ellipsoid; leave one "
                    refuse([(name, f"{text}of them out")])
            if self.rotation is not None and not any(self.rotation):
                refuse([("rotation", "a quaternion must not be zero")])
        elif self.rotation is not None:
            text = "is of an ellipsoid; give its `radii` [m], such as radii=[0.03, 0.02, 0.02], or "
            refuse([("rotation", f"{text}leave it out")])
        if self.inner and self.side is not None:
            text = "is of a path past an obstacle, and this one is `inner`; leave one of them out"
            refuse([("side", text)])
        if self.side is not None and self.side == self.point:
            text = "must not be the centre of the obstacle; give a point on the side on which the "
            refuse([("side", f"{text}path lies, got {shown(self.side)}")])
        return self


class BetweenPoints(AtPoint, Between):
    """A force between a point on `body` and one on `other`, along the line joining them.

    If there are points in `via`, it acts along the straight spans from each point to the next one.
    """

    PLACES: ClassVar[tuple[str, ...]] = ("via",)
    # the fields of its path
    PATH: ClassVar[tuple[str, ...]] = (
        "body", "other", "point", "other_point", "via", "shifts", "other_shifts",
    )  # fmt: skip

    other_point: Vec3 | None = field(
        "three finite numbers in the axes of `other` [m]; default: its origin",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in the axes of the second body; default: its origin",
    )  # fmt: skip
    via: tuple[Via, ...] = field(
        "a list of points (body, [x, y, z]) [m] between both ends, in their order, and obstacles "
        "{'body': name, 'point': [x, y, z], 'radius': length}, or with 'radii': [a, b, c]",
        converter=parts_of(Via), default=(), role="parts", since=9,
        help="points between both ends, or round obstacles, which it passes without friction",
    )  # fmt: skip
    shifts: tuple[Shift, ...] = field(
        "a list of displacements {'body': name, 'along': [x, y, z], 'curve': ...} of `point`",
        converter=parts_of(Shift), default=(), role="parts", since=9,
        help="displacements of the first point by functions of joint coordinates",
    )  # fmt: skip
    other_shifts: tuple[Shift, ...] = field(
        "a list of displacements {'body': name, 'along': [x, y, z], 'curve': ...} of `other_point`",
        converter=parts_of(Shift), default=(), role="parts", since=9,
        help="displacements of the other point by functions of joint coordinates",
    )  # fmt: skip

    @property
    def _rides(self) -> bool:
        """True if one of its points moves in its body, or counts in a range only."""
        return bool(self.shifts or self.other_shifts) or any(via.rides for via in self.via)

    @property
    def _fits_one_body(self) -> bool:
        return bool(self.via) or self._rides

    @property
    def _riding(self) -> tuple[Shift | Within, ...]:
        """All displacements and ranges of its points."""
        own = [*self.shifts, *self.other_shifts]
        for via in self.via:
            own += [*via.shifts, *([via.when] if via.when else ())]
        return tuple(own)

    def _riding_with(self, change: Callable[[Any], Any], via: Any = None) -> dict[str, Any]:
        """Return its fields with changed displacements and ranges, of the points `via` if given."""

        def all_of(parts: Sequence[Any]) -> tuple[Any, ...]:
            return tuple(map(change, parts))

        points = tuple(
            x.unchecked_copy({"shifts": all_of(x.shifts), "when": x.when and change(x.when)})
            for x in (self.via if via is None else via)
        )
        ends = {name: all_of(getattr(self, name)) for name in ("shifts", "other_shifts")}
        return {**ends, "via": points}

    @property
    def touches(self) -> tuple[str, ...]:
        """The names of the bodies on which it acts, excluding the ground."""
        return tuple(dict.fromkeys((*super().touches, *(x.body for x in self._riding))))

    @property
    def _bends(self) -> bool:
        jumps = any(via.when is not None for via in self.via)
        return jumps or any(isinstance(x, Shift) and x.corners for x in self._riding)

    @model_validator(mode="before")
    @classmethod
    def _pairs(cls, data: Any) -> Any:
        """Accept pairs (body, point) among the points in `via`."""
        via = data.get("via") if isinstance(data, dict) else None
        if not isinstance(via, (list, tuple)):
            return data

        def place(x: Any) -> Any:
            pair = isinstance(x, (list, tuple)) and len(x) == 2 and isinstance(x[0], str)
            return {"body": x[0], "point": x[1]} if pair else x

        return {**data, "via": [place(x) for x in via]}

    @model_validator(mode="after")
    def _has_a_way_without(self) -> Self:
        """Refuse a point between two obstacles that does not always count."""
        round_ = [False, *(via.is_obstacle for via in self.via), False]
        for k, via in enumerate(self.via, start=1):
            if via.when is None:
                continue
            before, after = k - 1, k + 1
            while before > 0 and self.via[before - 1].when is not None:
                before -= 1
            while after <= len(self.via) and self.via[after - 1].when is not None:
                after += 1
            if round_[before] and round_[after]:
                text = f"point {k} counts in a range only, and stands between obstacles, points "
                text += f"{before} and {after}; put a point that always counts beside it"
                refuse([("via", text)])
        return self

    @model_validator(mode="after")
    def _passes_in_a_row(self) -> Self:
        """Refuse a ring beside an obstacle, and an obstacle there whose side may change."""
        for k, pair in enumerate(itertools.pairwise(self.via), start=1):
            if not all(via.is_obstacle for via in pair):
                continue
            text = f"points {k} and {k + 1} are obstacles that follow each other, and one of them "
            if any(via.inner for via in pair):
                text += "is `inner`; put a point without a radius between them, through which the "
                refuse([("via", f"{text}path passes")])
            if any(via.side is None for via in pair):
                text += "has no side, so that the length may jump from one side to the other; give "
                refuse(
                    [("via", f"{text}each a `side`, such as [0, 0, 0.1], or put a point between")]
                )
        return self

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        ends: dict[str, Any] = {
            "point": self.other_point or (0.0, 0.0, 0.0), "other_point": self.point,
        }  # fmt: skip
        if self.shifts or self.other_shifts:
            ends |= {"shifts": self.other_shifts, "other_shifts": self.shifts}
        return {**ends, "via": self.via[::-1]} if self.via else ends


def points_of(f: BetweenPoints, body: Any) -> tuple[Sequence[float], Sequence[float]]:
    """Return both points in their bodies' axes [m]. Defaults to a tip, and to the other's origin.

    `body` is the description of its first body.
    """
    return f.point or body.tip_point, f.other_point or (0.0, 0.0, 0.0)


def path_of(f: BetweenPoints, body: Any) -> list[Place]:
    """Return (body, point in its axes [m]) of all points of a path in order."""
    own, other = points_of(f, body)
    return [(f.body, own), *((via.body, via.point) for via in f.via), (f.other, other)]


def at_state(f: BetweenPoints, body: Any, coordinate: CoordinateOf) -> BetweenPoints:
    """Return a force whose path has the points of this one at a state, and none that ride.

    `body` is the description of its first body, and `coordinate(body, index)` a coordinate.
    """
    if not f._rides:
        return f
    own, other = points_of(f, body)
    via = tuple(
        x.unchecked_copy({
            "point": shifted(x.point, x.shifts, coordinate), "shifts": (), "when": None
        })
        for x in f.via
        if x.when is None or x.when.holds(coordinate(x.when.body, x.when.coordinate))
    )  # fmt: skip
    ends = {"point": shifted(own, f.shifts, coordinate), "shifts": (), "other_shifts": ()}
    ends["other_point"] = shifted(other, f.other_shifts, coordinate)
    return f.unchecked_copy({**ends, "via": via})


def legs_of(f: BetweenPoints, body: Any) -> Iterator[tuple[Place, tuple[Via, ...], Place]]:
    """Yield (point, obstacles, next point) of a path, with points as in `path_of`."""
    start, past = path_of(f, body)[0], list[Via]()
    for via, place in zip((*f.via, None), path_of(f, body)[1:]):
        if via is not None and via.is_obstacle:
            past.append(via)
        else:
            yield start, tuple(past), place
            start, past = place, []


def pack_points(f: BetweenPoints, one: Any, at: Places) -> float:
    """Write both ends into the row, and return the length of the path in the initial state [m]."""
    own, other = points_of(f, at.body(f.body))
    one["point_a"], one["point_b"] = at.in_row(f.body, own), at.in_row(f.other, other)
    f = at_state(f, at.body(f.body), at.coordinate_at_start)
    return length_along(f, at.body(f.body), at.at_start, at.turn_at_start)


def length_along(
    f: BetweenPoints, body: Any, at: Callable[..., Array], turn: Callable[[str], Array]
) -> float:
    """Return the length of a path without points that ride [m], with arguments as of `lines_of`."""
    first, *others = (
        float(np.linalg.norm(at(*p) - at(*q)))
        if not past
        else sum(x.length for x in ways_past(past, at, turn, p, q)[0])
        for p, past, q in legs_of(f, body)
    )
    return sum(others, first)


def lines_of(
    f: BetweenPoints, body: Any, at: Callable[..., Array], turn: Callable[[str], Array]
) -> Iterator[tuple[Array, bool]]:
    """Yield the lines (n, 3) of a path, and whether each lies on an obstacle.

    `at(body, point)` returns a point in world axes [m], and `turn(body)` an orientation (3, 3).
    """
    for p, past, q in legs_of(f, body):
        begin = at(*p)
        for way in ways_past(past, at, turn, p, q)[0] if past else ():
            if not way.free:
                yield np.array([begin, way.first]), False
                yield way.arc, True
                begin = way.last
        yield np.array([begin, at(*q)]), False


def ways_past(
    past: Sequence[Via], at: Any, turn: Any, p: Place, q: Place
) -> tuple[list[Past], float]:
    """Return the parts of a path from p to q, one past each obstacle, and its largest kink.

    The kink is the length of the difference of unit vectors where parts meet, 0 in a shortest path.
    """
    places = [(turn(via.body), at(via.body, via.point)) for via in past]
    return past_obstacles(past, places, at(*p), at(*q))


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
    """Return (row, body, point) of the via point n or, after the last one, of B."""
    if n == one.vias:
        return one.row_b, one.body_b, point_of(xyz(one.point_b), work, one.row_b)
    via = vias[one.first_via + n]
    return via.row, via.body, point_of(xyz(via.point), work, via.row)


@part
def is_obstacle(one, vias, n):
    """Check whether element n of a path between its ends is an obstacle."""
    return n < one.vias and vias[one.first_via + n].shape != POINT


@part
def end_of(one, vias, n, work):
    """Return (number, row, body, point) of the point at the end of a leg that begins with element
    n."""
    last = n
    while is_obstacle(one, vias, last):
        last += 1
    b, body, q = next_of(one, vias, last, work)
    return last, b, body, q


@part
def settled(one, vias, n, end, work, p, q):
    """Divide the leg from p to q between its obstacles, if it has several."""
    if end > n + 1:
        settle(one.first_via + n, end - n, one.room + n, vias, work, p, q)


@part
def way_past(one, vias, n, end, m, work, p, q):
    """Return `passed` for obstacle m of the leg from p to q with the elements n to `end` - 1."""
    room = one.room + n
    begin = start_of_way(m - n, room, work, p)
    after = end_of_way(m - n, end - n, room, work, q)
    return passed(vias[one.first_via + m], end - n, work, begin, after)


@part
def rate_of(work, linear, d, a, p, b, q):
    """Return the rate of a span from p on row a to q on row b, with unit vector d from q to p."""
    return dot(d, sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, q)))


@part
def span(work, linear, a, p, b, q):
    """Return (unit vector from q to p, length, rate) of the span from p on row a to q on row b."""
    d, length = along(p, q)
    return d, length, rate_of(work, linear, d, a, p, b, q)


@part
def leg(one, vias, n, work, linear, a, p):
    """Return the part of a path from p on row a to the next point, past element n if it is round.

    It is given as (number of the point, its row, body and place, length, rate, unit vector from its
    end to its start, for a straight one).
    """
    end, b, body, q = end_of(one, vias, n, work)
    if end == n:
        d, length, rate = span(work, linear, a, p, b, q)
        return end, b, body, q, length, rate, d
    settled(one, vias, n, end, work, p, q)
    _, length, start, first, last, stop = way_past(one, vias, n, end, n, work, p, q)
    d, c = scale(-1.0, start), vias[one.first_via + n].row
    rate = rate_of(work, linear, d, a, p, c, first)
    for m in range(n + 1, end):
        _, more, start, first, after, ahead = way_past(one, vias, n, end, m, work, p, q)
        e = vias[one.first_via + m].row
        rate += rate_of(work, linear, scale(-1.0, start), c, last, e, first)
        length += more
        c, last, stop = e, after, ahead
    rate += rate_of(work, linear, scale(-1.0, stop), c, last, b, q)
    return end, b, body, q, length, rate, d


@part
def with_the_rest(one, vias, work, linear, n, b, q, length, rate):
    """Return length and rate of a path up to its point n, at q on row b, plus those of the rest."""
    while n < one.vias:
        n, b, _, q, more, faster, _ = leg(one, vias, n + 1, work, linear, b, q)
        length += more
        rate += faster
    return length, rate


@part
def measured(one, vias, work, linear):
    """Return the length of a path and its rate."""
    first = first_of(one, work)
    n, b, _, q, length, rate, _ = leg(one, vias, 0, work, linear, one.row_a, first)
    return with_the_rest(one, vias, work, linear, n, b, q, length, rate)


@part
def leg_length(one, vias, n, work, p):
    """Return (number of the next point, its place, length of the way to it) as `leg`."""
    end, _, _, q = end_of(one, vias, n, work)
    if end == n:
        _, length = along(p, q)
    else:
        settled(one, vias, n, end, work, p, q)
        _, length, _, _, _, _ = way_past(one, vias, n, end, n, work, p, q)
        for m in range(n + 1, end):
            _, more, _, _, _, _ = way_past(one, vias, n, end, m, work, p, q)
            length += more
    return end, q, length


@part
def length_of(one, vias, work):
    """Return the length of a path."""
    n, q, length = leg_length(one, vias, 0, work, first_of(one, work))
    while n < one.vias:
        n, q, more = leg_length(one, vias, n + 1, work, q)
        length += more
    return length


def drawn(push: Any) -> Any:
    """Return the function that pulls the ends of a leg, and its obstacles, towards each other."""
    both = opposed(push)

    @part
    def draw(to, one, vias, n, end, work, a, body_a, p, b, body_b, q, d, tension):
        none = (0.0, 0.0, 0.0)
        if end > n:
            c, body_c, x, away = a, body_a, p, d
            for m in range(n, end):
                via = vias[one.first_via + m]
                _, _, start, first, last, stop = way_past(one, vias, n, end, m, work, p, q)
                both(to, c, body_c, x, via.row, via.body, first, none, scale(tension, start))
                c, body_c, x, away = via.row, via.body, last, stop
            both(to, c, body_c, x, b, body_b, q, none, scale(tension, away))
        else:
            both(to, a, body_a, p, b, body_b, q, none, scale(-tension, d))

    return draw


def on_path(pull: Any, energy: Any) -> Action:
    """Return the wrenches of a tension along a path.

    `pull(one, knots, length, rate, t)` returns (tension, power put in, power lost).
    `energy(one, knots, length)` returns the stored energy.
    """

    def onto(push):
        draw = drawn(push)

        @part
        def exert(one, knots, vias, work, linear, at_q, t, to):
            a, body_a, p = one.row_a, one.body_a, first_of(one, work)
            n, b, body_b, q, length, rate, d = leg(one, vias, 0, work, linear, a, p)
            length, rate = with_the_rest(one, vias, work, linear, n, b, q, length, rate)
            tension, put_in, lost = pull(one, knots, length, rate, t)
            draw(to, one, vias, 0, n, work, a, body_a, p, b, body_b, q, d, tension)
            while n < one.vias:
                a, body_a, p, begun = b, body_b, q, n + 1
                n, b, body_b, q = end_of(one, vias, begun, work)
                d, _ = along(p, q)
                draw(to, one, vias, begun, n, work, a, body_a, p, b, body_b, q, d, tension)
            return put_in, lost

        return exert

    @part
    def stored(one, knots, vias, work, q):
        return energy(one, knots, length_of(one, vias, work))

    @part
    def tension(one, knots, vias, work, linear, q, t):
        length, rate = measured(one, vias, work, linear)
        force, _, _ = pull(one, knots, length, rate, t)
        return force, length, rate

    def unit(push):
        draw = drawn(push)

        @part
        def pulled(one, vias, work, to):
            a, body_a, p = one.row_a, one.body_a, first_of(one, work)
            n, total = -1, 0.0 * p[0]
            while n < one.vias:
                begun = n + 1
                n, b, body_b, q = end_of(one, vias, begun, work)
                _, _, length = leg_length(one, vias, begun, work, p)
                d, _ = along(p, q)
                draw(to, one, vias, begun, n, work, a, body_a, p, b, body_b, q, d, 1.0)
                total += length
                a, body_a, p = b, body_b, q
            return total

        return pulled

    return Action(onto, stored, tension, unit)
