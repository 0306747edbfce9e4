"""Model + Topology -> System: the packed arrays of constants, in Pgraph order."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import joints
from .kernels import layout as at
from .kernels import pack
from .schema import Body, Force, Model, Table
from .topology import Topology

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]


class System(NamedTuple):
    """Constants of a mechanism; columns in `kernels/layout.py`."""

    rows: Ints  # (n + 1, 4)
    const: Array  # (n + 1, 28)
    bodies_i: Ints  # (nb + 1, 2)
    bodies_f: Array  # (nb + 1, 22)
    q: Array  # (nq,) the model's initial state
    v: Array  # (nv,)
    body_of_row: Ints  # (n + 1,) number of the body whose joint a row belongs to


# Springs and dampers of joints, then motors and servos, as kernels take them (a plain tuple: numba
# would compile everything again for a named one): table (nd, 10), knots (nk, 2) of time [s] and
# value, and how many rows are springs and dampers.
Drives: TypeAlias = tuple[Array, Array, int]
# Forces on bodies and between two, as kernels take them: integers (nl, 8), numbers (nl, 20), knots
Loads: TypeAlias = tuple[Ints, Array, Array]


def system(model: Model, topology: Topology) -> System:
    """Pack a valid model; bulk work in one compiled call."""
    bodies = model.bodies
    body = np.frombuffer(b"".join([b.record for b in bodies])).reshape(-1, pack.BODY)
    motion = np.frombuffer(b"".join([b.motion_record for b in bodies])).reshape(-1, 8)
    count = body[:, pack.MOTIONS].astype(np.int64)
    first = np.cumsum(count) - count
    order = topology.row
    n, nb = len(motion), len(bodies)
    rows = np.zeros((n + 1, 4), dtype=np.int64)
    const = np.zeros((n + 1, at.CONST))
    bodies_i = np.zeros((nb + 1, 2), dtype=np.int64)
    bodies_f = np.zeros((nb + 1, at.BODY))
    gravity = np.array(model.gravity)
    pack.pack(
        _own(body),
        _own(motion),
        order,
        topology.parent,
        first,
        gravity,
        rows,
        const,
        bodies_i,
        bodies_f,
    )
    ordered = [bodies[i] for i in order.tolist()]
    return System(
        rows,
        const,
        bodies_i,
        bodies_f,
        np.frombuffer(b"".join([b.home_record[0] for b in ordered])).copy(),
        np.frombuffer(b"".join([b.home_record[1] for b in ordered])).copy(),
        np.repeat(np.arange(nb + 1), np.concatenate(([1], count[order]))),
    )


def _own(a: Array) -> Array:
    """A writable copy: numba types read-only arrays apart, which would compile again."""
    return np.array(a)


def drives(model: Model, topology: Topology, packed: System, forces: tuple[Force, ...]) -> Drives:
    """The rows of joint springs and dampers, and of `forces`."""
    table: list[tuple[float, ...]] = []
    knots: list[tuple[float, float]] = []
    for number, row in enumerate(topology.row.tolist(), start=1):
        body = model.bodies[row]
        if has_springs(body):
            table += _springs(body, _coordinates(packed, number), knots)
    passive = len(table)
    for force in forces:
        at_v, at_q = _coordinates(packed, topology.number(force.body))[force.coordinate]
        target, torque = _knots(force.target, knots), _knots(force.torque, knots)
        limit = np.inf if force.torque_limit is None else force.torque_limit
        position = at_q if force.kind == "servo" and force.kp else -1
        table.append((at_v, position, force.kp, force.kd, limit, *target, *torque, 0.0))
    return np.array(table).reshape(-1, at.DRIVE), np.array(knots).reshape(-1, 2), passive


def has_springs(body: Body) -> bool:
    """Whether a joint has a spring, a damper or friction."""
    return any(body.stiffness) or any(body.damping) or any(body.friction)


def _coordinates(packed: System, number: int) -> list[tuple[int, int]]:
    """(index into v, index into q or -1) of each degree of freedom of a body's joint."""
    found: list[tuple[int, int]] = []
    for k in np.flatnonzero(packed.body_of_row == number):
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


def _knots(value: float | Table, knots: list[tuple[float, float]]) -> tuple[int, int]:
    """(first knot, number of knots) of a constant or a table, appended to `knots`."""
    first = len(knots)
    knots += [(0.0, value)] if isinstance(value, float | int) else list(zip(value.t, value.value))
    return first, len(knots) - first


def point_in_row(packed: System, number: int, point: Any) -> Array:
    """A point in a body's axes as one in the home axes of its row, from the row's origin."""
    home = packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)
    return packed.bodies_f[number, at.OFFSET : at.OFFSET + 3] + home @ np.asarray(point, float)
