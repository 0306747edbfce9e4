"""Notices about contacts whose forces are not determined by the motion or the contact points.

Impulses that cancel in all joints can be added to any solution. Examples are the four wheels of a
cart and a box between walls with friction. So can those that miss none of the conditions of the
contact laws: more than three points of a body that slides and spins share its weight in many ways,
and their friction differs. The solver returns one of the solutions. This module finds such
combinations for the loaded contact points at some times. Only combinations that change the total
force between two bodies are reported. For a face that spins on another, friction acts at the outer
contact points instead of the whole area.

The loaded points of time stepping are searched at the states of frames, and those of event-driven
runs were recorded with their phases.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..analysis.rows import Rows
from ..dynamics.scene import NO_CONSTRAINTS, Scene
from ..dynamics.states import BodyMotion
from ..engine import layout as at
from ..engine import motion
from ..engine.contact.contacts import SLIDING
from ..engine.records import CONTACT, RIGID, SWING, table
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.forces import NO_LOADS
from ..tolerances import NOTABLE, SOLVED, VISIBLE

if TYPE_CHECKING:
    from ..contact.tables import Tables
    from .event_scene import EventScene

MOST_WORK = 300_000_000  # forces times the square of degrees of freedom: about half a second
LISTED = 4  # names in a notice, and frames that are examined for slip

CANCELS = "{have} contact forces that are not unique; the forces of least norm are returned"
SLIDES = (
    "{have} contact forces that are not unique in sliding: others satisfy the contact laws as well "
    "and lead to another motion, which another method may return"
)
SPINS = (
    "spins on a flat face. Its friction torque is computed from the outer contact points, and is "
    "1.5 (disc) to 1.9 (square) times the torque of a uniform pressure, or 2 to 3 times while it "
    "mainly slides; to change it, use spinning_friction or a smaller face. Where it slides, other "
    "loads of these points satisfy the contact laws as well, which another method may return"
)


class Noted(NamedTuple):
    """Pairs of bodies to tell about."""

    t: float  # [s]
    names: tuple[str, ...]
    what: str  # CANCELS, SLIDES or SPINS

    def text(self) -> str:
        """Return the notice."""
        more = f" and {len(self.names) - LISTED} more" if len(self.names) > LISTED else ""
        what = self.what.format(have="has" if len(self.names) == 1 else "have")
        return f"at t = {self.t:.6g} s {', '.join(self.names[:LISTED])}{more} {what}"


class Point(NamedTuple):
    """A loaded contact point of body number a on body number b, or on the ground if b is 0."""

    a: int
    b: int
    place: Array  # (3,) in world axes [m]
    normal: Array  # (3,) from b to a
    friction: float
    of_shape: bool  # a shape touches there: it was not given as a point


@dataclass(frozen=True)
class Loads:
    """The loaded contact points of a run at its frames (t, q, v)."""

    mech: Mechanism
    active: Ints  # constraints
    frames: tuple[Array, Array, Array]
    slip: Array  # (n, pairs) largest slip of the loaded points with friction, or 0 [m/s]
    points: Callable[[int], list[Point]]  # the loaded ones of a frame
    resting: Callable[[Array], Array]  # rows of joints whose friction holds them at a v

    def sliding(self) -> Ints:
        """Return the frames at which a pair slides fastest."""
        if not self.slip.size:
            return np.zeros(0, dtype=np.int64)
        fastest = self.slip.argmax(axis=0)
        return np.unique(fastest[self.slip.max(axis=0) > SLIDING])[:LISTED]

    def held(self, i: int) -> Array:
        """Compute the effects of unit forces of constraints and resting friction, (m, nv)."""
        t, q, v = (x[i] for x in self.frames)
        found = [Rows.of(self.mech, self.active, q, None, float(t)).J] if len(self.active) else []
        return np.vstack([np.zeros((0, self.mech.nv)), *found, self.resting(v)])

    def notices(self) -> list[str]:
        """Return the notices about these loads, at most one of each kind."""
        sliding = self.sliding().tolist()
        looks = dict.fromkeys([len(self.frames[0]) - 1, *sliding])
        shared = next(filter(None, map(self.shared, self._affordable(looks))), None)
        spun = next(filter(None, map(self.spun, sliding)), None)
        found = []
        if shared and not (spun and shared.what == SLIDES and shared.names == spun.names):
            found.append(shared.text())
        if spun:
            found.append(spun.text())
        return found

    def shared(self, i: int) -> Noted | None:
        """Return the bodies whose contacts can share loads in several ways, if there are any."""
        mech, (t, q, v) = self.mech, (x[i] for x in self.frames)
        points = self.points(i)
        if len(points) < 2:
            return None
        columns, held = _columns(mech, points, q, v), self.held(i)
        if names := _free(columns.effects, columns, held):
            return Noted(float(t), tuple(names), CANCELS)
        slides = columns.conditions is not columns.effects
        if slides and (names := _free(columns.conditions, columns, held)):
            return Noted(float(t), tuple(names), SLIDES)
        return None

    def _affordable(self, looks: Iterable[int]) -> Iterator[int]:
        """Yield these frames while the work on them is at most MOST_WORK."""
        work = 0
        for i in looks:
            work += 3 * len(self.points(i)) * self.mech.nv**2
            if work > MOST_WORK:
                return
            yield i

    def spun(self, i: int) -> Noted | None:
        """Return a body with a face that spins on another at a frame, if there is one.

        Such a face has three or more points, whose slip differs from that of its centre.
        """
        mech, (t, q, v) = self.mech, (x[i] for x in self.frames)
        points = [p for p in self.points(i) if p.of_shape and p.friction > 0.0]
        moving = mech.body_motion(q, v)
        for a, b in {(p.a, p.b) for p in points}:
            own = [p for p in points if (p.a, p.b) == (a, b)]
            slip = np.array([_slip(p, moving) for p in own])
            middle = slip.mean(axis=0)
            spin = np.linalg.norm(slip - middle, axis=1).min()
            if len(own) >= 3 and spin > max(VISIBLE * np.linalg.norm(middle), SLIDING):
                return Noted(float(t), (_named(mech, a, b),), SPINS)
        return None


def of_steps(
    mech: Mechanism, tables: Tables, active: Ints, frames: tuple[Array, Array, Array], pairs: Any
) -> Loads:
    """Return the loads of time stepping, where `pairs` are the contact records of the frames."""
    slip, laws = pairs["slip"][:, : len(tables.touches)], tables.laws
    pushed = pairs["force"][:, : len(tables.touches)].any(axis=-1)
    of_shape = [not pair.contact.points for pair in tables.touches]

    @cache
    def points(i: int) -> list[Point]:
        found = _points(mech, tables, frames[1][i], pairs[i])
        places = 0.5 * (found["point_a"] + found["point_b"])
        ends = zip(found["shape_a"].tolist(), found["shape_b"].tolist())
        return [
            Point(a, b, place, normal, float(laws[k]["friction"]), of_shape[k])
            for (a, b), place, normal, k in zip(ends, places, found["normal"], found["pair"])
        ]

    return Loads(
        mech, active, frames, slip * pushed * (laws["friction"] > 0.0), points,
        lambda v: _resting(mech, tables, v),
    )  # fmt: skip


def of_events(
    mech: Mechanism, scene: EventScene, active: Ints, frames: tuple[Array, Array, Array]
) -> Loads:
    """Return the loads of an event-driven run, which has recorded its points at these frames."""
    seen = scene.frames[: len(frames[0])]
    touches = np.array([p.limit is None for p in scene.contact_points], dtype=bool)
    loaded = (seen["phase"] != SWING) & (seen["normal_force"] > 0.0) & touches
    rubs = np.array([p.friction > 0.0 for p in scene.contact_points])
    normal = np.array(mech.model.ground_normal)

    @cache
    def points(i: int) -> list[Point]:
        found = []
        for s in np.flatnonzero(loaded[i]).tolist():
            p, place = scene.contact_points[s], seen["position"][i, s]
            number = mech.topology.number(p.body)
            found.append(Point(number, 0, place, normal, p.friction, p.of_shape))
        return found

    slip = np.linalg.norm(seen["slip_velocity"], axis=-1) * loaded * rubs
    return Loads(mech, active, frames, slip, points, lambda v: np.zeros((0, mech.nv)))


def _slip(point: Point, moving: BodyMotion) -> Array:
    """Compute the tangential velocity (3,) of A relative to B at a contact point."""
    speed = np.zeros(3)
    for sign, k in ((1.0, point.a), (-1.0, point.b)):
        if k:
            spin, shift = moving.velocity[k - 1].reshape(2, 3)
            speed += sign * (shift + np.cross(spin, point.place - moving.pose[k - 1, :3]))
    return speed - point.normal * (point.normal @ speed)


def _points(mech: Mechanism, tables: Tables, q: Array, pairs: Any) -> Any:
    """Return the closed rigid contact points with a normal force, as CONTACT records.

    Shape numbers are replaced by body numbers. `pairs` contains the contact records at q.
    """
    from ..engine.contact import contacts as kernels
    from ..engine.contact.closing import DEPTH

    pushes = pairs["force"][: len(tables.touches)].any(axis=-1) & (tables.laws["law"] == RIGID)
    if not pushes.any():
        return table(CONTACT, 0)
    scene = Scene(mech.packed, mech.packed.passive, NO_LOADS, NO_CONSTRAINTS, contacts=tables)
    assert scene.touching is not None
    nothing = np.zeros(0)
    motion.residuals(scene.address, 0.0, q, np.zeros(mech.nv), nothing, nothing)
    found = scene.touching.found
    count = kernels.find(scene.address, DEPTH * mech.packed.length, 0)
    found = found[: min(count, len(found))].copy()
    bodies = scene.touching.shapes["body"]
    for name in ("shape_a", "shape_b"):
        found[name] = np.where(found[name] >= 0, bodies[found[name]], 0)
    return found[pushes[found["pair"]]]


class Columns(NamedTuple):
    """Unit forces of contact points. Friction of a sliding point is proportional to its force."""

    effects: Array  # (m, nv) on the joints
    # (m, nv) velocities that the law fixes, of a sliding point the normal one; else the same array
    conditions: Array
    wrenches: Array  # (6 n, m) on the bodies A of n pairs
    names: list[str]  # the names of the pairs


def _columns(mech: Mechanism, points: list[Point], q: Array, v: Array) -> Columns:
    """Compute the unit forces of loaded points at a state. A sliding point has one column."""
    turns, origins = {0: (np.zeros((6, mech.nv)), np.zeros(3))}, mech.poses(q).position
    number: dict[tuple[int, int], int] = {}
    effects, conditions, wrenches, slides = [], [], [], False
    for point in points:
        a, b, place, normal = point[:4]
        for k in (a, b):
            if k not in turns:
                turns[k] = mech.jacobian(q, mech.topology.names[k - 1]), origins[k - 1]
        way = _way(*turns[a], place) - _way(*turns[b], place)
        slip = way @ v - normal * (normal @ way @ v)
        mu, speed = point.friction, float(np.linalg.norm(slip))
        chosen = [(normal, normal)]
        if mu > 0.0 and speed > SOLVED:
            slides = True
            chosen = [(normal - mu / speed * slip, normal)]
        elif mu > 0.0:
            chosen += [(d, d) for d in np.linalg.svd(normal[None])[2][1:]]
        pair = number.setdefault((a, b), len(number))
        for d, fixed in chosen:
            effects.append(way.T @ d)
            conditions.append(way.T @ fixed)
            wrenches.append((pair, np.concatenate((np.cross(place - turns[a][1], d), d))))
    out = np.zeros((6 * len(number), len(effects)))
    for column, (pair, wrench) in enumerate(wrenches):
        out[6 * pair : 6 * pair + 6, column] = wrench
    names = [_named(mech, a, b) for a, b in number]
    own = np.array(effects)
    return Columns(own, np.array(conditions) if slides else own, out, names)


def _free(of_points: Array, columns: Columns, held: Array) -> list[str]:
    """Return the pairs whose total forces may change while these rows (m, nv) are not felt.

    Rows `held` (k, nv) of other forces may change too.
    """
    rows = np.vstack((of_points, held))
    size = np.abs(rows).max(axis=0, initial=0.0)
    rows /= np.where(size > 0.0, size, 1.0)
    blocks = [(own, rows[np.ix_(own, columns_of)]) for own, columns_of in _apart(rows)]
    parts = [(own, *np.linalg.svd(block, full_matrices=False)[:2]) for own, block in blocks]
    largest = max((values.max(initial=0.0) for _, _, values in parts), default=0.0)
    unfelt = columns.wrenches.copy()  # by the part without an effect
    for own, left, values in parts:
        mine = own < len(of_points)
        felt, on = left[mine][:, values > NOTABLE * largest], own[mine]
        unfelt[:, on] -= (unfelt[:, on] @ felt) @ felt.T
    change = np.abs(unfelt).reshape(len(columns.names), -1).max(axis=1, initial=0.0)
    return [name for name, x in zip(columns.names, change) if x > NOTABLE]


def _apart(rows: Array) -> Iterator[tuple[Ints, Ints]]:
    """Yield the rows and columns of each block of a matrix, which no entry joins to another."""
    entries, n = rows != 0.0, rows.shape[1]
    labels, before = np.arange(n), np.zeros(0)
    of_rows = np.full(len(rows), n)
    while not np.array_equal(labels, before):  # all columns of a block get its least number
        before = labels
        of_rows = np.where(entries, labels, n).min(axis=1, initial=n)
        labels = np.minimum(labels, np.where(entries, of_rows[:, None], n).min(axis=0, initial=n))
    for label in np.unique(of_rows[of_rows < n]):
        yield np.flatnonzero(of_rows == label), np.flatnonzero(labels == label)


def _way(J: Array, origin: Array, place: Array) -> Array:
    """Compute the translational Jacobian (3, nv) of a point, given the Jacobian of the body
    origin."""
    return J[3:] - np.cross(place - origin, J[:3].T).T


def _named(mech: Mechanism, a: int, b: int) -> str:
    names = mech.topology.names
    return f"'{names[a - 1]}' on '{names[b - 1]}'" if b else f"'{names[a - 1]}' on the ground"


def _resting(mech: Mechanism, tables: Tables, v: Array) -> Array:
    """Return the rows (m, nv) of joints and tendons with friction that are at rest."""
    found = [np.zeros((0, mech.nv))]
    ints, _, terms, factors = tables.friction_blocks
    for block in ints:
        own = slice(block[at.B_TERM], block[at.B_TERM] + block[at.B_TERMS])
        row = np.zeros(mech.nv)
        row[terms[own, 0]] = factors[own]
        if abs(row @ v) <= SOLVED:
            found.append(row[None])
    return np.vstack(found)
