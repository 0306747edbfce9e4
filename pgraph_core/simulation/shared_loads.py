"""A notice of contacts whose loads the motion does not determine.

Impulses that cancel in all joints can be added to those of a solution: four wheels of one cart, a
box between walls with friction. The solver takes the solution of least norm. Here such combinations
are found among the points that carry at an instant, and kept where they change the sum of a pair of
bodies.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.rows import Rows
from ..dynamics.scene import NO_CONSTRAINTS, Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.records import RIGID
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.forces import NO_LOADS
from ..tolerances import NOTABLE, SOLVED

if TYPE_CHECKING:
    from ..contact.tables import Tables

MOST_POINTS = 200  # that are examined: the work grows with the third power of their number
LISTED = 4  # names in a notice


def shared_loads(
    mech: Mechanism, tables: Tables, active: Ints, state: tuple[float, Array, Array], pairs: Any
) -> list[str]:
    """Return a notice of the bodies whose contacts share loads in several ways, or nothing.

    `state` is (t, q, v), `active` the constraints, and `pairs` the records of contacts then.
    """
    t, q, v = state
    pushes = pairs["force"][: len(tables.touches)].any(axis=-1) & (tables.laws["law"] == RIGID)
    if not pushes.any():
        return []
    points = _points(mech, tables, q)
    points = points[pushes[points["pair"]]]
    if not 2 <= len(points) <= MOST_POINTS:
        return []
    effects, wrenches, names = _columns(mech, tables, points, q, v)
    held = _held(mech, tables, active, t, q, v)
    rows = np.vstack((effects, held))
    size = np.abs(rows).max(axis=0, initial=0.0)
    left, values, _ = np.linalg.svd(rows / np.where(size > 0.0, size, 1.0))
    rank = int(np.sum(values > NOTABLE * values.max(initial=0.0)))
    change = np.abs(wrenches @ left[: len(effects), rank:]).reshape(len(names), 6, -1)
    among = [name for name, x in zip(names, change) if x.max(initial=0.0) > NOTABLE]
    if not among:
        return []
    more = f" and {len(among) - LISTED} more" if len(among) > LISTED else ""
    return [
        f"at t = {t:.6g} s {', '.join(among[:LISTED])}{more} share their loads in more than one "
        "way: the forces are those of least norm"
    ]


def _points(mech: Mechanism, tables: Tables, q: Array) -> Any:
    """Return the contact points that are closed at q, as records of CONTACT."""
    from ..engine.contact import contacts as kernels
    from ..engine.contact.closing import DEPTH

    scene = Scene(mech.packed, mech.packed.passive, NO_LOADS, NO_CONSTRAINTS, contacts=tables)
    assert scene.touching is not None
    nothing = np.zeros(0)
    motion.residuals(scene.address, 0.0, q, np.zeros(mech.nv), nothing, nothing)
    found = scene.touching.found
    count = kernels.find(scene.address, DEPTH * mech.packed.length, 0)
    found = found[: min(count, len(found))].copy()
    bodies = scene.touching.shapes["body"]
    for name in ("shape_a", "shape_b"):  # numbers of bodies in place of those of shapes
        found[name] = np.where(found[name] >= 0, bodies[found[name]], 0)
    return found


def _columns(
    mech: Mechanism, tables: Tables, points: Any, q: Array, v: Array
) -> tuple[Array, Array, list[str]]:
    """(what unit forces do in the joints (m, nv), their wrenches (6 n, m), n pairs of bodies).

    A point that slides has one column, in which friction follows the normal force.
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
    """Return how a point of a body moves (3, nv), from the Jacobian of its origin."""
    return J[3:] - np.cross(place - origin, J[:3].T).T


def _named(mech: Mechanism, a: int, b: int) -> str:
    names = mech.topology.names
    return f"'{names[a - 1]}' on '{names[b - 1]}'" if b else f"'{names[a - 1]}' on the ground"


def _held(mech: Mechanism, tables: Tables, active: Ints, t: float, q: Array, v: Array) -> Array:
    """Return what unit forces of constraints and of friction in resting joints do, (m, nv)."""
    found = [Rows.of(mech, active, q, None, t).J] if len(active) else []
    ints, _, terms, factors = tables.friction_blocks
    for block in ints:
        own = slice(block[at.B_TERM], block[at.B_TERM] + block[at.B_TERMS])
        row = np.zeros(mech.nv)
        row[terms[own, 0]] = factors[own]
        if abs(row @ v) <= SOLVED:
            found.append(row[None])
    return np.vstack([np.zeros((0, mech.nv)), *found])
