"""Columns -> System: the packed arrays of constants, in Pgraph order."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from . import joints
from .columns import Columns
from .engine import layout as at
from .engine.arrays import Drives as Drives
from .engine.arrays import Loads as Loads
from .engine.layout import BODIES_I, BODY, CONST
from .engine.packing.pack import pack
from .model import Body, Force, Model, Table
from .topology import Topology

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
INT = np.dtype(np.int64)
EMPTY = np.empty


class System(NamedTuple):
    """Constants of a mechanism; columns in `engine/layout.py`."""

    rows: Ints  # (n + 1, 4)
    const: Array  # (n + 1, 28)
    bodies_i: Ints  # (nb + 1, 11)
    bodies_f: Array  # (nb + 1, 22)
    q: Array  # (nq,) the model's initial state
    v: Array  # (nv,)
    body_of_row: Ints  # (n + 1,) number of the body whose joint a row belongs to


# rows, const, bodies_i, bodies_f of a System, and its q and v in one array
Packed: TypeAlias = tuple[Ints, Array, Ints, Array, Array]


def packed(columns: Columns) -> tuple[Packed, int]:
    """Number and pack a table in one compiled call; how many motions have a spring or damper.

    Raises ModelError where parents close a cycle.
    """
    parent, body, motion, start = columns.numbers
    nb, n = len(body), len(motion) + 1
    arrays = (
        EMPTY((n, 4), INT),
        EMPTY((n, CONST)),
        EMPTY((nb, BODIES_I), INT),
        EMPTY((nb, BODY)),
        EMPTY(len(start)),
    )
    springs = pack(parent, body, motion, start, *arrays)
    if springs < 0:
        columns.model()  # says in words which bodies close it
    return arrays, springs


def system(arrays: Packed, nq: int) -> System:
    """The packed arrays by name, and which body each row belongs to."""
    rows, const, bodies_i, bodies_f, home = arrays
    body_of_row = np.repeat(np.arange(len(bodies_i)), bodies_i[:, at.OWN_ROWS])
    return System(rows, const, bodies_i, bodies_f, home[:nq], home[nq:], body_of_row)


def drives(model: Model, topology: Topology, packed: System, forces: tuple[Force, ...]) -> Drives:
    """The rows of joint springs and dampers, and of the motors and servos in `forces`."""
    table: list[tuple[float, ...]] = []
    knots: list[tuple[float, float, float]] = []
    for number, row in enumerate(topology.row.tolist(), start=1):
        body = model.bodies[row]
        if has_springs(body):
            table += _springs(body, joint_coordinates(packed, number), knots)
    passive = len(table)
    for force in forces:
        if force.kind not in ("motor", "servo"):
            continue
        at_v, at_q = joint_coordinates(packed, topology.number(force.body))[force.coordinate]
        given = cast("float | Table", force.torque)  # of a motor or servo
        target, torque = _knots(force.target, knots), _knots(given, knots)
        limit = np.inf if force.torque_limit is None else force.torque_limit
        position = at_q if force.kind == "servo" and force.kp else -1
        table.append((at_v, position, force.kp, force.kd, limit, *target, *torque, 0.0))
    return Drives(np.array(table).reshape(-1, at.DRIVE), np.array(knots).reshape(-1, 3), passive)


def bends(drives: Drives) -> Array:
    """Ascending times at which a table of these drives bends [s]."""
    return np.unique(drives.knots[:, 0])


def has_springs(body: Body) -> bool:
    """Whether a joint has a spring, a damper or friction."""
    return any(body.stiffness) or any(body.damping) or any(body.friction)


def joint_coordinates(packed: System, number: int) -> list[tuple[int, int]]:
    """(index into v, index into q or -1) of each degree of freedom of a body's joint."""
    found: list[tuple[int, int]] = []
    for k in range(*np.searchsorted(packed.body_of_row, (number, number + 1))):
        _, kind, qi, vi = packed.rows[k].tolist()
        if kind <= at.TRANSLATE:
            found.append((vi, qi))
        else:
            found += [(vi + n, -1) for n in range(3 if kind == at.BALL else 6)]
    return found


def _springs(body: Any, at_vq: list[tuple[int, int]], knots: list[Any]) -> list[tuple[float, ...]]:
    """One row a degree of freedom of a joint with a spring, a damper or friction."""
    found: list[tuple[float, ...]] = []
    start = 0
    columns = (body.stiffness, body.damping, body.rest, body.friction)
    for m, k, d, rest, friction in zip(body.sequence, *columns):
        size = joints.SIZE[m.kind][1]
        for at_v, at_q in at_vq[start : start + size]:
            none = _knots(0.0, knots)
            place = (at_v, at_q if k else -1)
            found.append((*place, k, d, np.inf, *_knots(rest, knots), *none, friction))
        start += size
    return found


def _knots(value: float | Table, knots: list[tuple[float, float, float]]) -> tuple[int, int]:
    """(first knot, number of knots) of a constant or a table, appended to `knots`."""
    if isinstance(value, float | int):
        knots.append((0.0, value, 0.0))
        return len(knots) - 1, 1
    t, x = value.t, value.value
    slopes = [(b - a) / (u - s) for (s, u), (a, b) in zip(pairwise(t), pairwise(x))]
    rate = (len(t) - 1) / (t[-1] - t[0]) if len(t) > 1 else 0.0
    knots += zip(t, x, (*slopes, rate))
    return len(knots) - len(t), len(t)


def point_in_row(packed: System, number: int, point: Any) -> Array:
    """A point in a body's axes as one in the home axes of its row, from the row's origin."""
    home = packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)
    return packed.bodies_f[number, at.OFFSET : at.OFFSET + 3] + home @ np.asarray(point, float)
