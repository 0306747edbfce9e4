"""The frame update in Fig. 7, which moves all body frames from one q to the next by walking along
Pgraph.

The paper was only available as text. This module is reconstructed from sec. 4, which defines Rot,
find, P and F(P). Teaching and checking use it; `Mechanism` computes frames from
q (R14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..errors import counted, explained, refusal, shown
from ..joints import AXIAL, SIZE, Motion, units_of
from ..model import Body, Model
from ..model.poses import columns, displacement, elementary, turn
from ..rotation import Array, matrix, multiply, rodrigues, unit
from ..topology import Ints, Topology
from . import bodies_of, q_slices, v_slices

CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])  # factors that conjugate a quaternion


class Visit(NamedTuple):
    """One position in Pgraph. All counts start at 1, as in the paper."""

    kappa: int
    number: int  # Pgraph(κ), 0 for the ground
    find: int  # the first place of that number, less than κ at a re-entry (R2)
    P: tuple[int, ...]  # the body and everything that its joint carries, empty at a re-entry


class Movement(NamedTuple):
    """The indices of one joint motion in the array of frame vectors and in v."""

    turns: slice  # its angles in v [rad]
    slides: slice  # its displacements in v [m]
    slide: int  # row of its displacement
    axes: slice  # rows of its axes
    carried: Ints  # rows that it turns: F(P), without what comes before it in its own joint


@dataclass(frozen=True)
class FrameVectors:
    """The vectors updated in Fig. 7, which are links, motion axes and body frame axes in world
    axes.

    The first row of a body in `vectors` is the link vector. It is followed by the displacement [m]
    and the axes of each motion (one axis, or three for a ball or free motion). The three axes of
    the body's frame come last.
    """

    topology: Topology
    rows: tuple[slice, ...]  # rows of `vectors` by number
    walk: tuple[tuple[Visit, tuple[Movement, ...]], ...]  # along Pgraph
    vectors: Array  # (n, 3)

    @property
    def rotation(self) -> Array:
        """The rotations (nb, 3, 3) of the body frames."""
        return np.array([self.vectors[r][-3:].T for r in self.rows]).reshape(-1, 3, 3)

    @property
    def link(self) -> Array:
        """The vectors (nb, 3) from the parent's origin to the body's, with displacement [m]."""
        slides = [[m.slide for m in parts] for visit, parts in self.walk if visit.P]
        first = [visit.number for visit, _ in self.walk if visit.P]
        link = np.zeros((len(self.rows), 3))
        for number, slide in zip(first, slides):
            link[number - 1] = self.vectors[[self.rows[number - 1].start, *slide]].sum(axis=0)
        return link

    @property
    def position(self) -> Array:
        """The origins (nb, 3) of the body frames [m]."""
        position = np.zeros((len(self.rows) + 1, 3))
        for k, (p, link) in enumerate(zip(self.topology.parent, self.link), start=1):
            position[k] = position[p] + link
        return position[1:]

    def updated(self, increment: Sequence[float] | Array) -> FrameVectors:
        """Return the frames after `increment` (nv,) [rad, m], ordered like v, as in Fig. 7.

        `increments(model, q, q_next)` are exact for any step; the paper's θ' Δt drifts with Δt.
        """
        F, step = self.vectors.copy(), np.asarray(increment, dtype=float)
        for _, movements in self.walk:
            for move in movements:
                _carry(F, move, step)
        return replace(self, vectors=F)


def _carry(F: Array, move: Movement, step: Array) -> None:
    """Apply one motion. A slide adds l += h d, and a rotation gives F(P) = Rot(h, Δθ) F(P)."""
    axes = F[move.axes]
    if len(slid := step[move.slides]):
        F[move.slide] += slid @ axes
    if len(turned := step[move.turns]):
        F[move.carried] = F[move.carried] @ rotation_by(turned @ axes).T


def rotation_by(vector: Array) -> Array:
    """Return Rot(h, Δθ) (3, 3) for the rotation vector h Δθ, using Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    return rodrigues(vector / angle, angle) if angle else np.eye(3)


# -- the walk along Pgraph -------------------------------------------------------------------


def visits(pgraph: Sequence[int] | Ints) -> tuple[Visit, ...]:
    """Return find and P at every position in Pgraph.

    The joint of a body moves all bodies that follow in Pgraph, up to the first entry that also
    occurs before the body. This entry is the re-entry at a preceding separation body.
    """
    places = np.asarray(pgraph, dtype=np.int64).tolist()
    find: dict[int, int] = {}
    for kappa, number in enumerate(places, start=1):
        find.setdefault(number, kappa)
    found = []
    for kappa, number in enumerate(places, start=1):
        entered = number > 0 and find[number] == kappa
        P = _carried(places, find, kappa) if entered else ()
        found.append(Visit(kappa, number, find[number], P))
    return tuple(found)


def _carried(places: list[int], find: dict[int, int], kappa: int) -> tuple[int, ...]:
    P = [places[kappa - 1]]
    for place in range(kappa + 1, len(places) + 1):
        number = places[place - 1]
        if find[number] < kappa:
            break
        if find[number] == place:
            P.append(number)
    return tuple(P)


# -- the vectors at some q -------------------------------------------------------------------


def frame_vectors(model: Model, q: Sequence[float] | Array) -> FrameVectors:
    """Compute the frame vectors at q directly, without increments, as the start for Fig. 7."""
    topology = Topology.of(model)
    bodies = bodies_of(model, topology)
    rotation, blocks = [np.eye(3)], []
    for body, p, place in zip(bodies, topology.parent, q_slices(bodies)):
        blocks.append(_vectors_of(body, rotation[p], np.asarray(q, dtype=float)[place]))
        rotation.append(blocks[-1][-3:].T)
    ends = np.cumsum([0, *(len(block) for block in blocks)]).tolist()
    rows = tuple(slice(a, b) for a, b in pairwise(ends))
    walk = []
    for visit in visits(topology.pgraph):
        moves = _movements(visit, bodies, rows) if visit.P else ()
        walk.append((visit, moves))
    return FrameVectors(topology, rows, tuple(walk), np.vstack([np.zeros((0, 3)), *blocks]))


def _vectors_of(body: Body, turned: Array, q: Array) -> Array:
    """Return the rows for a body whose parent has the rotation `turned`."""
    home = matrix(body.rotation)
    rows = [turned @ body.link]
    for motion, x in elementary(body, q):
        rows.append(displacement(motion, turned, home, x))
        turns, H = _turns(motion), columns(motion, turned, home, x)
        rows.extend(H[:3, :turns].T if turns else H[3:].T)
        turned = turned @ turn(motion, home, x)
    return np.array([*rows, *(turned @ home).T])


def _movements(visit: Visit, bodies: list[Body], rows: tuple[slice, ...]) -> tuple[Movement, ...]:
    """Return every motion of the visited body's joint, with the rows F(P) that it rotates."""
    own = rows[visit.number - 1]
    outer = [np.arange(rows[j - 1].start, rows[j - 1].stop) for j in visit.P[1:]]
    v = v_slices(bodies)[visit.number - 1].start
    row, moves = own.start + 1, []
    for motion in bodies[visit.number - 1].sequence:
        turns, slides = _turns_and_slides(motion, v)
        end = row + 1 + (_turns(motion) or 1)
        carried = np.concatenate((np.arange(end, own.stop), *outer))
        moves.append(Movement(turns, slides, row, slice(row + 1, end), carried))
        row, v = end, v + SIZE[motion.kind][1]
    return tuple(moves)


def _turns_and_slides(motion: Motion, v: int) -> tuple[slice, slice]:
    turns = _turns(motion)
    return slice(v, v + turns), slice(v + turns, v + SIZE[motion.kind][1])


def _turns(motion: Motion) -> int:
    """Return the number of rotations of a motion, which precede its translations in v."""
    return units_of(motion)[1].count("rad")


# -- increments ------------------------------------------------------------------------------


def increments(model: Model, q: Sequence[float] | Array, q_next: Sequence[float] | Array) -> Array:
    """Return Δθ (nv,) from q to q_next [rad, m]. Balls have relative rotation vectors."""
    bodies = bodies_of(model, Topology.of(model))
    found: list[float] = []
    for body, place in zip(bodies, q_slices(bodies)):
        pairs = zip(elementary(body, q[place]), elementary(body, q_next[place]))
        for (motion, x), (_, y) in pairs:
            found.extend(_increment(motion, np.asarray(x), np.asarray(y)))
    return np.array(found)


def _increment(motion: Motion, x: Array, y: Array) -> Array:
    if motion.kind in AXIAL:
        return y - x
    w, *axis = multiply(unit(y[-4:].tolist()), unit((x[-4:] * CONJUGATE).tolist()))
    sine = float(np.linalg.norm(axis))
    angle = 2 * np.arctan2(sine, abs(w)) * np.copysign(1.0, w)
    turned = np.array(axis) * (angle / sine if sine else 0.0)
    return np.concatenate((turned, y[:-4] - x[:-4]))


# -- the trace -------------------------------------------------------------------------------


@dataclass(frozen=True)
class FrameUpdateTrace:
    """A step-by-step record of one update, as in Fig. 8. `print` shows the table."""

    names: tuple[str, ...]  # names of the bodies by number
    steps: tuple[tuple[Visit, str], ...]  # and what the joint does, in words
    frames: FrameVectors  # after the update

    def __str__(self) -> str:
        rows = [["κ", "Pgraph(κ)", "find", "P", "F(P)"]]
        for visit, does in self.steps:
            P = " ".join(map(str, visit.P)) or "-"
            rows.append([str(visit.kappa), str(visit.number), str(visit.find), P, does])
        wide = [max(len(row[i]) for row in rows) for i in range(4)]
        return "\n".join(_line(row, wide) for row in rows)


def _line(row: list[str], wide: list[int]) -> str:
    numbers = [cell.rjust(w) for cell, w in zip(row[:3], wide)]
    return "  ".join((*numbers, row[3].ljust(wide[3]), row[4]))


@explained
def frame_update_trace(
    model: Model, q: Sequence[float] | Array, q_next: Sequence[float] | Array
) -> FrameUpdateTrace:
    """Update all frames from q to q_next by exact increments, recording steps, as in Fig. 8."""
    q, q_next = _position(model, "q", q), _position(model, "q_next", q_next)
    for body in model.bodies:
        for m in body.sequence:
            if m.facts.single and not m.facts.flat:
                text = f"has a {m.kind}, which the update of the paper does not cover"
                raise refusal("frame_update_trace", "model", f"body '{body.name}' {text}")
    start, step = frame_vectors(model, q), increments(model, q, q_next)
    bodies = bodies_of(model, start.topology)
    steps = []
    for visit, moves in start.walk:
        if visit.P:
            body = bodies[visit.number - 1]
            text = _in_words(visit.number, moves, step)
        else:
            text = "the start: ground" if visit.kappa == visit.find else "a re-entry: nothing turns"
        steps.append((visit, text))
    return FrameUpdateTrace(start.topology.names, tuple(steps), start.updated(step))


def _position(model: Model, name: str, given: Sequence[float] | Array) -> Array:
    """Return the coordinates in number order. Raises InputError."""
    count = sum(SIZE[m.kind][0] for body in model.bodies for m in body.sequence)
    try:
        q = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        q = np.full(count, np.nan)
    if q.shape != (count,) or not np.isfinite(q).all():
        text = f"must be {counted(count, 'number')}, all finite, got {shown(given)}"
        raise refusal("frame_update_trace", name, text)
    return q


def _in_words(number: int, moves: tuple[Movement, ...], step: Array) -> str:
    if not moves:
        return "a weld: nothing turns"
    said = []
    for m, move in enumerate(moves, start=1):
        h = f"h{number}" if len(moves) == 1 else f"h{number},{m}"
        if len(turned := step[move.turns]):
            said.append(f"Rot({h}, {np.linalg.norm(turned) if len(turned) > 1 else turned[0]:.3f})")
        if len(slid := step[move.slides]):
            d = (
                f"{slid[0]:.3f}"
                if len(slid) == 1
                else "[" + " ".join(f"{x:.3f}" for x in slid) + "]"
            )
            said.append(f"l{number} += {h} {d}")
    return ", ".join(said)
