"""The division of beams into rigid segments with springs between them.

A beam is cut into cells, and each cell has its joint in its middle, with the stiffness EI/h of the
cell. So the first and the last half of a cell are fixed to the ends, and loads at both ends, also
moments, meet the whole compliance: the error is of second order in h. Places along the beam and
corners of its axis are ends of cells. Each place that other parts name is a body without mass,
with the axes of the beam, fixed to its segment.
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..rotation import Array, matrix, quaternion_of, skew
from ..tolerances import COINCIDENT, NOTABLE
from .beam import AUTO, Beam, Strain
from .body import Body
from .shape import Shape

AUTO_FIRST = 8  # segments with which 'auto' begins, and those of a mechanism without a run
MARK = "@"  # stands between the name of a beam and a place along it
DRAWN = 100  # a beam without a section is drawn as slender as this

Counts = Mapping[str, Sequence[int]]  # cells in each span, by name of beam


class Cell(NamedTuple):
    """A part of a beam with a joint in its middle."""

    start: Array  # (3,) in the axes of the beam [m]
    axes: Array  # (3, 3) columns: along the axis, and y and z of the section
    length: float

    def point(self, share: float) -> Array:
        return self.start + share * self.length * self.axes[:, 0]


def place_in(name: str, beams: Container[str]) -> tuple[str, float] | None:
    """Return the beam and the place from 0 to 1 that a name of a body means, or None."""
    if name in beams:
        return name, 1.0
    beam, mark, text = name.rpartition(MARK)
    if not mark or beam not in beams:
        return None
    try:
        place = float(text)
    except ValueError:
        return None
    return (beam, place) if 0.0 <= place <= 1.0 else None


def named(parts: Mapping[str, Sequence[Any]]) -> list[str]:
    """Return the names of bodies that the parts of a model refer to, once each."""
    found = dict[str, None]()
    for key, some in parts.items():
        for part in some:
            if key in ("bodies", "beams"):
                found[part.parent] = None
            elif key == "scenarios":
                found |= {name: None for f in part.forces for name in f.touches}
            elif key != "formulas":
                found |= dict.fromkeys(getattr(part, "touches", ()))
    return list(found)


def places_of(
    beams: Mapping[str, Beam], bodies: Iterable[str], parts: Mapping[str, Sequence[Any]]
) -> dict[str, tuple[str, float]]:
    """Return the beam and the place of each place that parts name, and of each tip, by name."""
    own = set(bodies)
    found = {name: (name, 1.0) for name in beams}
    for name in named(parts):
        if name not in own and (place := place_in(name, beams)):
            found[name] = place
    return found


def renamed_places(parts: Mapping[str, Sequence[Any]], names: Mapping[str, str]) -> dict[str, str]:
    """Return the new names of bodies and beams, with those of the places on beams."""
    beams = {beam.name: beam for beam in parts["beams"]}
    if not beams:
        return dict(names)
    places = places_of(beams, (body.name for body in parts["bodies"]), parts)
    on = {name: of for name, (of, _) in places.items() if name != of and of in names}
    return {**names, **{name: names[of] + name[len(of) :] for name, of in on.items()}}


def rigid(parts: Mapping[str, Sequence[Any]]) -> tuple[Body, ...]:
    """Return a body without mass for every place of a beam that parts name, in the table's order.

    They stand for the beam where nobody asks how it deforms: in checks, edits and the digraph.
    """
    beams = {beam.name: beam for beam in parts["beams"]}
    if not beams:
        return ()
    names = (body.name for body in parts["bodies"])
    found = (stand_in(name, beams) for name in places_of(beams, names, parts))
    return tuple(body for body in found if body is not None)


def stand_in(name: str, beams: Mapping[str, Beam]) -> Body | None:
    """Return the body without mass for a beam or a place along it, or None for other names."""
    if (place := place_in(name, beams)) is None:
        return None
    beam, at = beams[place[0]], place[1]
    turned = matrix(beam.rotation) @ point_at(beam, at) + beam.link
    return _fixed(name, beam.parent, turned, beam.rotation)


def _fixed(name: str, parent: str, link: Array, rotation: Any = (1.0, 0.0, 0.0, 0.0)) -> Body:
    unseen = Shape(kind="sphere", radius=1.0, opacity=0.0, role="visual")
    return Body(
        name=name, parent=parent, joint="weld", mass=0.0, link=link.tolist(), rotation=rotation,
        shape=unseen, derived=(), inertia=(0.0, 0.0, 0.0),
    )  # fmt: skip


def point_at(beam: Beam, at: float) -> Array:
    """Return the point (3,) at a place from 0 to 1 of the axis, in the axes of the beam [m]."""
    points = beam.axis
    ends = _ends(points)
    return np.array([np.interp(at * ends[-1], ends, x) for x in points.T])


def _ends(points: Array) -> Array:
    """Return the lengths (k,) from the root to each point of an axis [m]."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


# -- cells -----------------------------------------------------------------------------------------


def spans_of(beam: Beam, places: Iterable[float]) -> Array:
    """Return the ends (k + 1,) of the spans between places and corners [m along the axis]."""
    ends = _ends(beam.axis)
    length = float(ends[-1])
    all_ends = np.sort([*ends, *(at * length for at in places)])
    apart = np.append(True, np.diff(all_ends) > COINCIDENT * length)
    return all_ends[apart]


def divided(lengths: Array, nodes: int) -> list[int]:
    """Return the number of cells of each span, at least one, which are `nodes` in all if possible.

    They are even if possible, so that another run can take half of them.
    """
    each = 2 if nodes % 2 == 0 and nodes >= 2 * len(lengths) else 1
    share = nodes / each * lengths / lengths.sum()
    found = np.maximum(np.floor(share), 1.0)
    while (left := int(nodes / each - found.sum())) > 0:
        found[np.argsort(found - share)[:left]] += 1.0
    while found.sum() > max(nodes / each, len(lengths)):
        found[np.argmax(np.where(found > 1.0, found - share, -np.inf))] -= 1.0
    return [each * int(x) for x in found]


def number_of(beam: Beam) -> int:
    """Return the number of segments asked for, or the first one of 'auto'."""
    return AUTO_FIRST if beam.nodes == AUTO else int(beam.nodes)


def counts_of(parts: Mapping[str, Sequence[Any]]) -> dict[str, list[int]]:
    """Return the number of cells in each span of every beam, by name."""
    beams = {beam.name: beam for beam in parts["beams"]}
    places = places_of(beams, (body.name for body in parts["bodies"]), parts)
    return {
        name: divided(
            np.diff(spans_of(beam, (at for of, at in places.values() if of == name))),
            number_of(beam),
        )
        for name, beam in beams.items()
    }


def refined(counts: Counts) -> tuple[dict[str, list[int]], float]:
    """Return another division, and the factor of Richardson's rule for the error of the first.

    It has half the cells if all numbers are even, else twice as many. The error of the first is the
    factor times the difference of both.
    """
    if all(n % 2 == 0 for some in counts.values() for n in some):
        return {name: [n // 2 for n in some] for name, some in counts.items()}, 1 / 3
    return {name: [2 * n for n in some] for name, some in counts.items()}, 4 / 3


def cells_of(beam: Beam, ends: Array, counts: Sequence[int]) -> list[Cell]:
    """Return the cells of a beam from its root to its tip."""
    points = beam.axis
    corners, frames = _ends(points), _frames(points)
    found = list[Cell]()
    for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True):
        k = min(int(np.searchsorted(corners, (a + b) / 2)) - 1, len(frames) - 1)
        start = points[k] + (a - corners[k]) * frames[k][:, 0]
        h = float(b - a) / n
        found += [Cell(start + i * h * frames[k][:, 0], frames[k], h) for i in range(n)]
    return found


def _frames(points: Array) -> list[Array]:
    """Return the axes (3, 3) of the section on each straight piece, as columns.

    The first has y of the beam's axes, but for its part along the piece. At corners the axes turn
    about the normal of both pieces.
    """
    steps = np.diff(points, axis=0)
    along = steps / np.linalg.norm(steps, axis=1)[:, None]
    t = along[0]
    side = np.eye(3)[1 if abs(t[1]) < 1 - NOTABLE else 2]
    one = side - (side @ t) * t
    one /= np.linalg.norm(one)
    y, z = (one, np.cross(t, one)) if abs(t[1]) < 1 - NOTABLE else (np.cross(one, t), one)
    found = [np.column_stack((t, y, z))]
    for before, after in itertools.pairwise(along):
        axis, cosine = np.cross(before, after), float(before @ after)
        cross = skew(axis)
        turn = np.eye(3) + cross + cross @ cross / (1.0 + cosine)
        found.append(turn @ found[-1])
    return found


# -- bodies ----------------------------------------------------------------------------------------


def axis_points(
    parts: Mapping[str, Sequence[Any]], counts: Counts
) -> dict[str, list[tuple[str, Array]]]:
    """Return the end of every cell of each beam, as a segment and a point (3,) of it [m]."""
    beams = {beam.name: beam for beam in parts["beams"]}
    places = places_of(beams, (body.name for body in parts["bodies"]), parts)
    found = dict[str, list[tuple[str, Array]]]()
    for name, beam in beams.items():
        ends = spans_of(beam, (at for of, at in places.values() if of == name))
        cells = cells_of(beam, ends, counts[name])
        found[name] = [
            (segment(name, k), cell.point(1.0) - cell.point(0.5)) for k, cell in enumerate(cells, 1)
        ]
    return found


def expanded(parts: Mapping[str, Sequence[Any]], counts: Counts | None = None) -> tuple[Body, ...]:
    """Return the bodies of a model, followed by the segments and places of its beams."""
    beams = {beam.name: beam for beam in parts["beams"]}
    places = places_of(beams, (body.name for body in parts["bodies"]), parts)
    counts = counts_of(parts) if counts is None else counts
    found = list[Body](parts["bodies"])
    for name, beam in beams.items():
        own = {word: at for word, (of, at) in places.items() if of == name}
        ends = spans_of(beam, own.values())
        cells = cells_of(beam, ends, counts[name])
        found += _segments(beam, cells)
        before = np.append(0, np.cumsum(counts[name]))  # cells before each end of a span
        for word, at in own.items():
            k = int(before[np.abs(ends - at * ends[-1]).argmin()])
            origin = cells[k - 1].point(0.5) if k else cells[0].start
            end = cells[k - 1].point(1.0) if k else origin
            found.append(_fixed(word, segment(name, k), end - origin))
    return tuple(found)


def segment(beam: str, k: int) -> str:
    """Return the name of segment k of a beam, where 0 is the fixed one."""
    return f"{beam}[{k}]"


def direction(k: int) -> int:
    """Return 1 if the motions of segment k have the order of the beam's strains, -1 if reversed.

    Hinges turn about successive axes, so that a cell which bends both ways also twists by half the
    product of its angles. Cells in turns reverse the order, which takes this back.
    """
    return 1 if k % 2 else -1


def strains_of(beam: Beam, k: int) -> tuple[Strain, ...]:
    """Return the strains of segment k, in the order of its motions."""
    return beam.deforms[:: direction(k)]


def _segments(beam: Beam, cells: Sequence[Cell]) -> list[Body]:
    """Return the segments, from the half cell at the root to that at the tip."""
    stiff = beam.stiff
    beta = 2.0 * beam.damping_ratio / beam.lowest_frequency if beam.damping_ratio else 0.0
    found, known = list[Body](), dict[Any, Body]()
    origin = cells[0].start
    for k in range(len(cells) + 1):
        cell = cells[k - 1] if k else None
        halves = [(c.axes, c.length / 2) for c in (cell, *cells[k : k + 1]) if c is not None]
        name, parent = segment(beam.name, k), segment(beam.name, k - 1) if k else beam.parent
        link = beam.link
        if cell is not None:
            link = tuple((cell.point(0.5) - origin).tolist())
            origin = cell.point(0.5)
        strains = strains_of(beam, k)
        key = (k == 0, strains, *((id(axes), h) for axes, h in halves), len(halves))
        if key not in known:
            fields = _solid(beam, halves)
            if cell is None:
                fields |= {"joint": "weld", "rotation": beam.rotation}
            else:
                fields |= _joint(stiff, strains, beta, cell)
            known[key] = Body(name=name, parent=parent, link=link, **fields)
        found.append(known[key].unchecked_copy({"name": name, "parent": parent, "link": link}))
    return found


def _joint(stiff: Any, strains: Sequence[Strain], beta: float, cell: Cell) -> dict[str, Any]:
    """Return the joint in the middle of a cell: what it turns about, and its springs."""
    own = {"stretch": 0, "twist": 0, "bend_y": 1, "bend_z": 2}
    motions = [
        ("translate" if x == "stretch" else "rotate", tuple(cell.axes[:, own[x]].tolist()))
        for x in strains
    ]
    stiffness = [stiff.of(x) / cell.length for x in strains]
    return {
        "joint": "compound", "motions": motions, "stiffness": stiffness,
        "damping": [beta * k for k in stiffness],
    }  # fmt: skip


def _solid(beam: Beam, halves: Sequence[tuple[Array, float]]) -> dict[str, Any]:
    """Return mass, centre, inertia and shapes of a segment: straight pieces, one after another."""
    stiff = beam.stiff
    mass, moment, second = 0.0, np.zeros(3), np.zeros((3, 3))
    start, shapes = np.zeros(3), list[Shape]()
    for axes, h in halves:
        m, middle = stiff.rho_a * h, start + h / 2 * axes[:, 0]
        across = m * h * h / 12
        own = np.diag(
            [h * stiff.rho_i[0], across + h * stiff.rho_i[1], across + h * stiff.rho_i[2]]
        )
        mass, moment = mass + m, moment + m * middle
        second += axes @ own @ axes.T + m * (middle @ middle * np.eye(3) - np.outer(middle, middle))
        shapes.append(_drawn(beam, axes, middle, h))
        start = start + h * axes[:, 0]
    com = moment / mass
    second -= mass * (com @ com * np.eye(3) - np.outer(com, com))
    second = (second + second.T) / 2
    return {
        "mass": mass, "com": com.tolist(), "inertia": second.tolist(), "tip": start.tolist(),
        "shapes": shapes, "derived": (),
    }  # fmt: skip


def _drawn(beam: Beam, axes: Array, middle: Array, h: float) -> Shape:
    """Return the shape of a straight piece, which is drawn only."""
    place = {"position": middle.tolist(), "role": "visual"}
    if beam.section is not None and beam.section[0] == "rectangle":
        size = (h, *beam.section[1:])
        return Shape(kind="box", size=size, rotation=quaternion_of(axes), **place)
    radius = beam.extent / DRAWN if beam.section is None else float(beam.section[1])
    upright = np.column_stack((axes[:, 1], axes[:, 2], axes[:, 0]))
    return Shape(kind="capsule", radius=radius, length=h, rotation=quaternion_of(upright), **place)
