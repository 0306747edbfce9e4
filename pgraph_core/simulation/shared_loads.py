"""Notices about contacts whose forces are not determined by the motion or the contact points.

Impulses that cancel in all joints can be added to any solution. Examples are the four wheels of a
cart and a box between walls with friction. The solver returns the solution of least norm. This
module finds such combinations for the loaded contact points at a given time. Only combinations that
change the total force between two bodies are reported. For a face that spins on another, friction
acts at the outer contact points instead of the whole area.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.rows import Rows
from ..dynamics.scene import NO_CONSTRAINTS, Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.contact.contacts import SLIDING
from ..engine.records import CONTACT, RIGID, table
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.forces import NO_LOADS
from ..tolerances import NOTABLE, SOLVED, VISIBLE

if TYPE_CHECKING:
    from ..contact.tables import Tables

MOST_WORK = 300_000_000  # forces times the square of degrees of freedom: a fifth of a second
LISTED = 4  # names in a notice


def shared_loads(
    mech: Mechanism, tables: Tables, active: Ints, state: tuple[float, Array, Array], pairs: Any
) -> list[str]:
    """Return a notice about bodies whose contacts can share loads in several ways, if any.

    `state` is (t, q, v), `active` contains the constraints, and `pairs` the contact records at that
    state.
    """
    t, q, v = state
    points = _points(mech, tables, q, pairs)
    if len(points) < 2 or 3 * len(points) * mech.nv**2 > MOST_WORK:
        return []
    effects, wrenches, names = _columns(mech, tables, points, q, v)
    held = _held(mech, tables, active, t, q, v)
    rows = np.vstack((effects, held))
    size = np.abs(rows).max(axis=0, initial=0.0)
    left, values, _ = np.linalg.svd(rows / np.where(size > 0.0, size, 1.0), full_matrices=False)
    felt = left[: len(effects), values > NOTABLE * values.max(initial=0.0)]
    unfelt = wrenches - (wrenches @ felt) @ felt.T  # by the part of each force without an effect
    change = np.abs(unfelt).reshape(len(names), -1).max(axis=1, initial=0.0)
    among = [name for name, x in zip(names, change) if x > NOTABLE]
    if not among:
        return []
    more = f" and {len(among) - LISTED} more" if len(among) > LISTED else ""
    return [
        f"at t = {t:.6g} s {', '.join(among[:LISTED])}{more} have contact forces that are not "
        "unique; the forces of least norm are returned"
    ]


def spun_faces(
    mech: Mechanism, tables: Tables, times: tuple[Array, Array, Array], pairs: Any
) -> list[str]:
    """Return a notice about a face that spins on another, at the frames (t, q, v) and `pairs`.

    Such a face has three or more points, whose slip differs from that of its centre. Each pair is
    examined at the frame with the fastest slip, for up to LISTED frames.
    """
    t, q, v = times
    slides = (pairs["slip"] > SLIDING) & pairs["force"].any(axis=-1)
    slides = slides[:, : len(tables.touches)] & (tables.laws["friction"] > 0.0)
    fastest = (slides * pairs["slip"][:, : len(tables.touches)]).argmax(axis=0)
    for i in np.unique(fastest[slides.any(axis=0)])[:LISTED]:
        points = _points(mech, tables, q[i], pairs[i])
        points = points[slides[i][points["pair"]]]
        for a, b in {(int(p["shape_a"]), int(p["shape_b"])) for p in points}:
            own = points[(points["shape_a"] == a) & (points["shape_b"] == b)]
            if len(own) < 3:
                continue
            slip = np.array([_slip(mech, p, q[i], v[i]) for p in own])
            middle = slip.mean(axis=0)
            spin = np.linalg.norm(slip - middle, axis=1).min()
            if spin > VISIBLE * np.linalg.norm(middle):
                return [
                    f"at t = {t[i]:.6g} s {_named(mech, a, b)} spins on a flat face. Its friction "
                    "torque is computed from the outer contact points, and is 1.5 (disc) to 1.9 "
                    "(square) times the torque of a uniform pressure, or 2 to 3 times while it "
                    "mainly slides; to change it, use spinning_friction or a smaller face"
                ]
    return []


def _slip(mech: Mechanism, point: Any, q: Array, v: Array) -> Array:
    """Compute the tangential velocity (3,) of A relative to B at a contact point."""
    speed, place = np.zeros(3), 0.5 * (point["point_a"] + point["point_b"])
    for sign, k in ((1.0, int(point["shape_a"])), (-1.0, int(point["shape_b"]))):
        if k:
            name = mech.topology.names[k - 1]
            speed += sign * _way(mech.jacobian(q, name), mech.pose(q, name)[0], place) @ v
    return speed - point["normal"] * (point["normal"] @ speed)


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


def _columns(
    mech: Mechanism, tables: Tables, points: Any, q: Array, v: Array
) -> tuple[Array, Array, list[str]]:
    """Compute (unit force effects on the joints (m, nv), their wrenches (6 n, m), n pairs of
    bodies).

    A sliding point has one column, in which friction is proportional to the normal force.
    """
    turns = {0: (np.zeros((6, mech.nv)), np.zeros(3))}
    number: dict[tuple[int, int], int] = {}
    effects, wrenches = [], []
    for point in points:
        a, b = int(point["shape_a"]), int(point["shape_b"])
        for k in (a, b):
            if k not in turns:
                name = mech.topology.names[k - 1]
                turns[k] = mech.jacobian(q, name), mech.pose(q, name)[0]
        place, normal = 0.5 * (point["point_a"] + point["point_b"]), point["normal"]
        way = _way(*turns[a], place) - _way(*turns[b], place)
        slip = way @ v - normal * (normal @ way @ v)
        mu, speed = float(tables.laws[point["pair"]]["friction"]), float(np.linalg.norm(slip))
        chosen = [normal]
        if mu > 0.0 and speed > SOLVED:
            chosen = [normal - mu / speed * slip]
        elif mu > 0.0:
            chosen += list(np.linalg.svd(normal[None])[2][1:])
        pair = number.setdefault((a, b), len(number))
        for d in chosen:
            effects.append(way.T @ d)
            wrenches.append((pair, np.concatenate((np.cross(place - turns[a][1], d), d))))
    out = np.zeros((6 * len(number), len(effects)))
    for column, (pair, wrench) in enumerate(wrenches):
        out[6 * pair : 6 * pair + 6, column] = wrench
    names = [_named(mech, a, b) for a, b in number]
    return np.array(effects), out, names


def _way(J: Array, origin: Array, place: Array) -> Array:
    """Compute the translational Jacobian (3, nv) of a point, given the Jacobian of the body
    origin."""
    return J[3:] - np.cross(place - origin, J[:3].T).T


def _named(mech: Mechanism, a: int, b: int) -> str:
    names = mech.topology.names
    return f"'{names[a - 1]}' on '{names[b - 1]}'" if b else f"'{names[a - 1]}' on the ground"


def _held(mech: Mechanism, tables: Tables, active: Ints, t: float, q: Array, v: Array) -> Array:
    """Compute the effects of unit forces of constraints and resting friction, (m, nv)."""
    found = [Rows.of(mech, active, q, None, t).J] if len(active) else []
    ints, _, terms, factors = tables.friction_blocks
    for block in ints:
        own = slice(block[at.B_TERM], block[at.B_TERM] + block[at.B_TERMS])
        row = np.zeros(mech.nv)
        row[terms[own, 0]] = factors[own]
        if abs(row @ v) <= SOLVED:
            found.append(row[None])
    return np.vstack([np.zeros((0, mech.nv)), *found])
