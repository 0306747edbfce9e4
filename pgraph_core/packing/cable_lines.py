"""Lines of cables, ropes and belts in present poses, for pictures and notices."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.cable_places import spans_of_segment
from ..errors import ModelError, Problem
from ..forces import Cable
from ..forces.obstacles import DRAWN
from ..model import Rope
from . import Array
from .cables import Segment, carrier_of
from .placed import Placed


class Grip(NamedTuple):
    """A wheel at an end of a segment that it grips."""

    station: int
    carrier: str  # the body in which the angle of the cable is counted
    side: Array  # (3,) in its axes: the normal of the cable in the initial state


class Lying(NamedTuple):
    """A cable in the axes of the bodies along it."""

    part: Cable | Rope
    # records VIA, the body of each, and grips
    segments: tuple[tuple[Any, tuple[str, ...], tuple[Grip, ...]], ...]


def cables_of(packed: Any) -> tuple[Lying, ...]:
    """Return the cables and active ropes of a packed model, without those that are impossible."""
    return tuple(x for _, x in _laid(packed) if isinstance(x, Lying))


def ropes_of(packed: Any) -> list[Lying]:
    """Return the active ropes of a packed model, without those that are impossible."""
    held = {id(c) for c in packed.model.constraints}
    return [x for x in cables_of(packed) if id(x.part) in held]


def faults_of(packed: Any) -> dict[str, str]:
    """Return why a cable or active rope of a packed model is impossible, by its name."""
    found = ((part, x) for part, x in _laid(packed) if isinstance(x, ModelError))
    return {part.name: "; ".join(one.text for one in x.problems) for part, x in found}


def led_problems(packed: Any) -> list[Problem]:
    """Return the problems of the cables and active ropes of a packed model."""
    found = (x.problems for _, x in _laid(packed) if isinstance(x, ModelError))
    return [problem for problems in found for problem in problems]


def _laid(packed: Any) -> Iterator[tuple[Cable | Rope, Lying | ModelError]]:
    """Yield the cables and active ropes of a packed model, each with its lines or its problem."""
    model = packed.model
    parts = [
        *(f for f in model.forces if isinstance(f, Cable)),
        *(c for c in model.constraints if isinstance(c, Rope) and c.active),
    ]
    if not parts:
        return
    places = Placed(model, packed.topology, packed.system, packed.home_poses)
    for part in parts:
        try:
            own = tuple(_in_bodies(one, places, model) for one in places.segments(part))
        except ModelError as problem:
            yield part, problem
        else:
            yield part, Lying(part, own)


def _in_bodies(
    one: Segment, places: Placed, model: Any
) -> tuple[Any, tuple[str, ...], tuple[Grip, ...]]:
    """Return a segment with points and axes in the axes of its bodies, in rows of its own."""
    rows, names = one.rows.copy(), tuple(x.pulley.body for x in one.stations)
    for k, (row, station) in enumerate(zip(rows, one.stations), start=1):
        row["row"], row["frame"], row["coordinate"] = k, 0, 0
        row["point"] = station.pulley.point
        row["axis"] = places.turn_at_start(station.pulley.body).T @ station.axis
    ends = ((k, one.stations[k]) for k in (0, len(names) - 1))
    grips = [
        Grip(k, name, places.home(name).T @ one.rows[k]["side"])
        for k, x in ends
        if x.grips and (name := carrier_of(x, model))
    ]
    return rows, names, tuple(grips)


def cable_lines(
    cable: Lying, point: Callable[..., Array], turn: Callable[[str], Array]
) -> Iterator[Array]:
    """Yield the lines (n, 3) of a cable in world axes: its spans, and its arcs on wheels.

    `point(body, place)` returns a point in world axes [m], and `turn(body)` an orientation (3, 3).
    """
    before: tuple[Any, Array, Array] | None = None  # wheel, place and direction at the last end
    for rows, names, _ in cable.segments:
        spans = spans_in(rows, names, point, turn)
        for k, span in enumerate(spans):
            a, b, along = span.reshape(3, 3)
            wheel, name = rows[k], names[k]
            if before is not None and wheel["radius"]:
                yield _arc(wheel, point(name, wheel["point"]), turn(name), *before[1:], a, along)
            yield np.array([a, b])
            before = rows[k + 1], b, along
    rows, names, _ = cable.segments[0]
    if cable.part.closed and before is not None:
        a, _, along = spans_in(rows, names, point, turn)[0].reshape(3, 3)
        centre = point(names[0], rows[0]["point"])
        yield _arc(rows[0], centre, turn(names[0]), *before[1:], a, along)


def spans_in(rows: Any, names: tuple[str, ...], point: Any, turn: Any) -> Array:
    """Return the spans (n, 9) of a segment: first point, last point and direction."""
    work = np.zeros((len(rows) + 1, at.WORK))
    work[:, at.R : at.R + 9] = np.eye(3).ravel()
    for k, name in enumerate(names, start=1):
        work[k, at.R : at.R + 9] = turn(name).ravel()
        work[k, at.X : at.X + 3] = point(name, (0.0, 0.0, 0.0))
    spans = np.zeros((len(rows) - 1, 9))
    spans_of_segment(rows, work, np.zeros(1), spans)
    return spans


def _arc(
    wheel: Any, centre: Array, turn: Array, a: Array, before: Array, b: Array, after: Array
) -> Array:
    """Return points of the arc on a wheel from a to b, between the directions there."""
    axis = turn @ wheel["axis"]
    sense = float(np.sign(wheel["radius"]))
    flat = [x - (x @ axis) * axis for x in (before, after)]
    angle = sense * float(np.arctan2(axis @ np.cross(*flat), flat[0] @ flat[1]))
    angle += 2.0 * np.pi * (angle < -1e-9)
    s = np.linspace(0.0, 1.0, 2 + int(angle / DRAWN))[:, None]
    out, rise = a - centre, (b - a) @ axis
    along = (out @ axis) * axis
    across = sense * np.cross(axis, out)
    return (
        centre
        + along
        + np.cos(s * angle) * (out - along)
        + np.sin(s * angle) * across
        + s * rise * axis
    )
