"""Cables as stations for the kernels: sides, angles of wrap, and what a wheel is wound by.

See `engine/cables.py` for the mathematics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.cable_places import spans_of_segment
from ..engine.cables import EYE, GRIP, WHEEL
from ..engine.records import joined, rows_of
from ..fields import GROUND
from ..forces import VIA
from ..pulleys import Pulley
from ..rotation import unit_vector
from ..tolerances import NOTABLE, SOLVED, VISIBLE
from . import Array, joint_coordinates

MOST_WRAP = 1.5 * math.pi  # rad: beyond this angle the wheel has to lie on the other side

Refuse = Callable[[str], Exception]


class Hinge(NamedTuple):
    """A hinge in the initial state."""

    body: str
    place: Array  # (3,) a point on its axis, world axes [m]
    axis: Array  # (3,) unit vector


class Station(NamedTuple):
    """A station of a cable in the initial state, in world axes [m]."""

    pulley: Pulley
    centre: Array
    axis: Array  # unit vector, zero for a point
    hinge: Hinge | None  # parallel to the axis
    gear: float  # 1 or -1: the sense of its hinge's angle about the axis, 0 without one
    grips: bool
    sense: float  # 1 or -1: the sense of the cable about the axis, 0 for a point

    @property
    def signed(self) -> float:
        """The signed radius [m]."""
        return self.sense * self.pulley.radius

    @property
    def slips(self) -> bool:
        """True if it is a wheel with friction."""
        return bool(self.pulley.friction)


class Chain(NamedTuple):
    """The part of a cable between two stations on which it does not slip: segments between wheels
    with friction."""

    rows: Any  # records VIA
    starts: tuple[int, ...]  # the first station of each segment in them
    length: float  # length of the spans and of the arcs on inner wheels at the start [m]
    value: float  # `engine.cables.cable_length` at the start [m]


class Segment(NamedTuple):
    """The part of a cable with one tension, between two stations that hold it."""

    stations: tuple[Station, ...]
    rows: Any  # records VIA
    spans: Array  # (n - 1, 9) first point, last point and direction of every span at the start
    length: float  # length of the spans and of the arcs on inner wheels at the start [m]
    value: float  # `engine.cables.cable_length` at the start [m]
    chain: Chain
    number: int = 0  # number of the segment in its chain, from 0


def segments(
    through: Sequence[Pulley], closed: bool, at_: Any, model: Any, packed: Any, refuse: Refuse
) -> list[Segment]:
    """Return the segments of a cable, with `at_` as `Places`. Raises what `refuse` returns."""
    found = [_station(k, p, at_, model, refuse) for k, p in enumerate(through, start=1)]
    if closed:
        first = next((k for k, x in enumerate(found) if x.grips and not x.slips), None)
        if first is None:
            raise refuse("a closed belt needs a wheel that it grips: on a hinge, or with grip=True")
        found = [*found[first:], *found[:first], found[first]]
    for k in {0, len(found) - 1} if not closed else ():
        one = found[k]
        if one.pulley.grip is False:
            text = f"it ends at a wheel of '{one.pulley.body}' over which it would slide; leave "
            raise refuse(f"{text}grip=False out for a drum, or end the rope at a point")
        if one.pulley.friction is not None:
            text = f"it ends at the drum '{one.pulley.body}', on which it does not slip; leave "
            raise refuse(f"{text}friction={one.pulley.friction:g} out, or end it at a point")
        if one.pulley.radius:
            found[k] = one._replace(grips=True)
    points = [k for k, x in enumerate(found) if not x.pulley.radius]
    for a, b in pairwise(sorted({0, *points, len(found) - 1})):
        _orient(found, a, b, closed, refuse)
    begins = [k for k, x in enumerate(found) if x.grips and 0 < k < len(found) - 1]
    ends = [0, *begins, len(found) - 1]
    made = [_segment(found[a : b + 1], at_, packed, model, refuse) for a, b in pairwise(ends)]
    for before, after in (*pairwise(made), *([(made[-1], made[0])] if closed else ())):
        one = after.stations[0]
        angle = _wrap(one, before.spans[-1, 6:], after.spans[0, 6:], refuse)
        before.rows[-1]["wrap"] = after.rows[0]["wrap"] = one.sense * angle if one.slips else 0.0
    firsts = [k for k, x in enumerate(made) if not (k and x.stations[0].slips)]
    groups = [made[a:b] for a, b in pairwise([*firsts, len(made)])]
    return [x for own in groups for x in _chained(own, at_, packed, model)]


def _chained(own: Sequence[Segment], at_: Any, packed: Any, model: Any) -> Sequence[Segment]:
    """Return the segments of a chain with what they are together."""
    if len(own) == 1:
        return own
    stations = [*own[0].stations, *(x for one in own[1:] for x in one.stations[1:])]
    rows = joined(VIA, [own[0].rows, *(one.rows[1:] for one in own[1:])])
    starts = (0, *np.cumsum([len(one.rows) - 1 for one in own[:-1]]).tolist())
    work, q = _frames(rows, stations, at_, model, len(packed.rows)), np.array(packed.q, float)
    value = float(spans_of_segment(rows, work, q, np.zeros((len(rows) - 1, 9))))
    chain = Chain(rows, starts, value + _wound(stations, rows, q), value)
    return [one._replace(chain=chain, number=k) for k, one in enumerate(own)]


def one_length(kind: str, count: int) -> str:
    """Return the reason why a rope or cable of several segments has no length."""
    return (
        f"the {kind} divides into {count} segments at the wheels that it grips; leave it out, so "
        "that each keeps its initial length, or give those wheels grip=False"
    )


def _station(k: int, p: Pulley, at_: Any, model: Any, refuse: Refuse) -> Station:
    """Return a station without its sense."""
    centre = at_.at_start(p.body, p.point)
    if not p.radius:
        return Station(p, centre, np.zeros(3), None, 0.0, False, 0.0)
    turn, hinge = at_.turn_at_start(p.body), _hinge(p.body, at_, model)
    if p.axis is None and hinge is None:
        text = f"number {k}, a wheel of '{p.body}', needs an axis in the axes of its body, such as "
        raise refuse(f"{text}axis=(0, 1, 0), as this body has no hinge")
    axis = hinge.axis if p.axis is None and hinge is not None else turn @ unit_vector(p.axis or ())
    along = 0.0 if hinge is None else float(hinge.axis @ axis)
    sense = float(np.sign(along)) if abs(along) > 1.0 - SOLVED else 0.0
    centred = hinge is not None and bool(sense) and _is_on(centre, hinge, p.radius)
    grips = centred if p.grip is None else p.grip
    if p.friction is not None:
        grips = p.friction > 0.0
    return Station(p, centre, axis, hinge if sense else None, sense, grips, float(p.side or 0))


def _hinge(name: str, at_: Any, model: Any) -> Hinge | None:
    """Return the hinge about which a body turns, also if it is fixed to one that does."""
    while name != GROUND and not model.body(name).sequence:
        name = model.body(name).parent
    motions = [] if name == GROUND else list(model.body(name).sequence)
    facts = [m.facts for m in motions]
    if not (len(facts) == 1 and facts[0].single and facts[0].turns and not facts[0].travels):
        return None
    axis = at_.turn_at_start(name) @ unit_vector(motions[0].axis)
    return Hinge(name, at_.at_start(name, (0.0, 0.0, 0.0)), axis)


def _is_on(centre: Array, hinge: Hinge, radius: float) -> bool:
    """Check whether a wheel is centred on a hinge."""
    apart = centre - hinge.place
    return float(np.linalg.norm(np.cross(hinge.axis, apart))) <= NOTABLE * radius


def _segment(
    stations: Sequence[Station], at_: Any, packed: Any, model: Any, refuse: Refuse
) -> Segment:
    """Return a segment of stations whose senses are known."""
    found, last = stations, len(stations) - 1
    rows = rows_of(VIA, [_row(x, at_, packed) for x in found])
    work = _frames(rows, found, at_, model, len(packed.rows))
    spans, q = np.zeros((last, 9)), np.array(packed.q, float)
    spans_of_segment(rows, work, q, spans)
    for k, one in enumerate(found[1:last], start=1):
        if one.sense:
            rows[k]["wrap"] = one.sense * _wrap(one, spans[k - 1, 6:], spans[k, 6:], refuse)
    for k, span in ((0, spans[0]), (last, spans[-1])):
        if found[k].grips:
            normal = np.cross(found[k].axis, span[6:])
            rows[k]["side"] = _carrier(found[k], at_, model).T @ normal
    value = float(spans_of_segment(rows, work, q, spans))
    length = value + _wound(found, rows, q)
    _part(found, spans, refuse)
    return Segment(tuple(found), rows, spans, length, value, Chain(rows, (0,), length, value))


def _wound(found: Sequence[Station], rows: Any, q: Array) -> float:
    """Return the length by which the wheels at both ends have turned the cable away."""
    ends = ((0, 1.0), (len(found) - 1, -1.0))
    return sum(
        sign * found[k].signed * float(rows[k]["gear"] * q[rows[k]["coordinate"]])
        for k, sign in ends
        if found[k].grips
    )


def _orient(found: list[Station], a: int, b: int, closed: bool, refuse: Refuse) -> None:
    """Turn the axes of the wheels from a to b in one direction, and find missing senses."""
    wheels = [k for k in range(a, b + 1) if found[k].pulley.radius]
    if not wheels:
        return
    u = found[wheels[0]].axis
    for k in wheels:
        one = found[k]
        along = float(one.axis @ u)
        if abs(along) < 1.0 - NOTABLE:
            names = f"'{found[wheels[0]].pulley.body}' and '{one.pulley.body}'"
            angle = math.degrees(math.acos(min(abs(along), 1.0)))
            text = f"the axes of the wheels {names} are {angle:.3g} degrees apart; wheels that "
            raise refuse(f"{text}follow each other need parallel axes, or a point between them")
        if along < 0.0:
            flipped = {"axis": -one.axis, "gear": -one.gear, "sense": -one.sense}
            found[k] = one._replace(**flipped)
    for k in wheels:
        if not found[k].sense:
            found[k] = found[k]._replace(sense=_sense(found, k, closed, refuse))


def _sense(found: list[Station], k: int, closed: bool, refuse: Refuse) -> float:
    """Return the sense in which the line through the centres turns at station k."""
    u, last = found[k].axis, len(found) - 1
    if k in (0, last) and not closed:
        body = found[k].pulley.body
        text = f"it ends at the drum '{body}' and may leave it on both sides; give side=1 if it "
        raise refuse(f"{text}turns about the axis by the right hand there, or side=-1")
    before = found[k].centre - found[k - 1 if k else last - 1].centre
    after = found[k + 1 if k < last else 1].centre - found[k].centre
    bend = float(np.arctan2(u @ np.cross(before, after), _flat(before, u) @ _flat(after, u)))
    if abs(bend) < VISIBLE or abs(bend) > math.pi - VISIBLE:
        text = f"it may pass the wheel '{found[k].pulley.body}' on both sides; give side=1 if it "
        raise refuse(f"{text}turns about the axis by the right hand there, or side=-1")
    return float(np.sign(bend))


def _flat(x: Array, u: Array) -> Array:
    flat: Array = x - (x @ u) * u
    return flat


def _wrap(one: Station, before: Array, after: Array, refuse: Refuse) -> float:
    """Return the angle by which a cable turns on a wheel, from its directions there [rad]."""
    u = one.axis
    turned = float(np.arctan2(u @ np.cross(before, after), _flat(before, u) @ _flat(after, u)))
    angle = one.sense * turned
    angle = angle if angle > -SOLVED else angle + 2.0 * math.pi
    if angle > MOST_WRAP:
        own, other = math.degrees(angle), math.degrees(2.0 * math.pi - angle)
        side = int(one.pulley.side or one.sense)
        text = f"it would turn by {own:.3g} degrees about the wheel '{one.pulley.body}'; give side="
        raise refuse(f"{text}{-side} for {other:.3g} degrees on its other side, or a point between")
    return max(angle, 0.0)


def _part(found: Sequence[Station], spans: Array, refuse: Refuse) -> None:
    """Refuse wheels that overlap, and spans without a length."""
    for one, other, span in zip(found, found[1:], spans):
        u = one.axis if one.sense else other.axis
        far = float(np.linalg.norm(_flat(other.centre - one.centre, u)))
        near = abs(other.signed - one.signed)
        names = f"'{one.pulley.body}' and '{other.pulley.body}'"
        if far <= near or not float(np.linalg.norm(span[3:6] - span[:3])) > 0.0:
            if not near:
                raise refuse(f"two neighbouring points of {names} are at the same place")
            text = f"the centres of {names} are {far:.4g} m apart, and the rope needs more than "
            raise refuse(f"{text}{near:.4g} m to lead from one to the other; move them apart")


def _row(one: Station, at_: Any, packed: Any) -> tuple[Any, ...]:
    """Return the fields of VIA for a station, whose wrap and side are not known yet."""
    body = at_.number(one.pulley.body)
    row = packed.row_of(body)
    home, turn = at_.home(one.pulley.body), at_.turn_at_start(one.pulley.body)
    axis = home @ turn.T @ one.axis
    frame, coordinate = row if one.grips else 0, 0
    if one.grips and one.hinge is not None:
        frame = int(packed.rows[row, at.PARENT])
        coordinate = joint_coordinates(packed, at_.number(one.hinge.body))[0][1]
    point = at_.in_row(one.pulley.body, one.pulley.point)
    shape = GRIP if one.grips else WHEEL if one.sense else EYE
    none = np.zeros(3)
    rough = one.pulley.friction or 0.0
    station = frame, coordinate, one.gear, 0.0, rough
    return row, body, point, shape, 0, one.signed, axis, none, none, np.zeros(9), *station


def carrier_of(one: Station, model: Any) -> str:
    """Return the body in which the angle of a cable on a wheel is counted."""
    return one.pulley.body if one.hinge is None else str(model.body(one.hinge.body).parent)


def _carrier(one: Station, at_: Any, model: Any) -> Array:
    """Return the present orientation of the row from which the angle of a cable is counted."""
    name = carrier_of(one, model)
    axes: Array = at_.turn_at_start(name) @ at_.home(name).T
    return axes


def _frames(rows: Any, stations: Sequence[Station], at_: Any, model: Any, count: int) -> Array:
    """Return a workspace with the initial frames of the stations and of their carriers."""
    work = np.zeros((count, at.WORK))
    work[:, at.R : at.R + 9] = np.eye(3).ravel()
    for one, station in zip(rows, stations):
        body = station.pulley.body
        if one["row"]:
            turn = at_.turn_at_start(body) @ at_.home(body).T
            work[one["row"], at.R : at.R + 9] = turn.ravel()
            origin = at_.at_start(body, (0.0, 0.0, 0.0)) - turn @ at_.in_row(body, (0.0,) * 3)
            work[one["row"], at.X : at.X + 3] = origin
        if one["frame"]:
            work[one["frame"], at.R : at.R + 9] = _carrier(station, at_, model).ravel()
    return work
