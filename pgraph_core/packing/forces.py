"""Forces as tables for the kernels; columns in `engine/layout.py`.

*Drives* act in joints: springs, dampers, friction, motors, servos. *Loads* act on bodies and
between two: wrenches, springs, torsion springs.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from .. import joints
from ..engine import layout as at
from ..engine.records import APPLIED_FORCE, JOINT_FORCE, SPRING, TORSION, WRENCH, rows_of, table
from ..model import Body, Force, Model, Motor, Servo, Spring, Table, Torsion, VectorTable, Wrench
from ..model.force import OnBody
from ..rotation import normals_of, unit_vector
from ..topology import Topology
from .system import Array, Drives, Loads, System, joint_coordinates, point_in_row

NO_LOADS = Loads(table(APPLIED_FORCE, 0), np.zeros((0, 7)))
ORIGIN = (0.0, 0.0, 0.0)


def on_bodies(forces: Sequence[Force]) -> list[OnBody]:
    """Those that act on bodies; the others act in joints."""
    return [f for f in forces if isinstance(f, OnBody)]


def loads(
    model: Model,
    topology: Topology,
    packed: System,
    forces: tuple[Force, ...],
    home: tuple[Array, Array],
) -> Loads:
    """The wrenches and springs in `forces`; `home`: the bodies' poses in the initial state."""
    ours = on_bodies(forces)
    found = table(APPLIED_FORCE, len(ours))
    knots = [np.zeros((0, 7))]
    for one, f in zip(found, ours):
        ends = tuple(topology.number(name) for name in f.pair)
        one["kind"] = TYPES[type(f)]
        one["row_a"], one["row_b"] = (int(packed.bodies_i[n, at.ROW]) for n in ends)
        one["first_knot"] = sum(map(len, knots))
        match f:
            case Wrench():
                knots.append(_set_wrench(one, f, packed, ends[0]))
            case Spring():
                _set_spring(one, f, model, packed, ends, home)
            case Torsion():
                _set_torsion(one, f, packed, ends)
    return Loads(found, np.concatenate(knots))


TYPES: dict[type[OnBody], int] = {Wrench: WRENCH, Spring: SPRING, Torsion: TORSION}


def _set_wrench(one: Any, f: Wrench, packed: System, a: int) -> Array:
    """Its point; returns the knots (n, 7) of its torque and force over time."""
    one["point_a"] = point_in_row(packed, a, f.point or ORIGIN)
    own = _knots(f)
    one["knots"] = len(own)
    one["in_body"] = f.frame == "body"
    return _in_row(own, packed, a) if f.frame == "body" else own


def _set_spring(
    one: Any, f: Spring, model: Model, packed: System, ends: tuple[int, ...],
    home: tuple[Array, Array],
) -> None:  # fmt: skip
    """Its points, stiffness, damping and length at rest."""
    a, b = ends
    point, other = f.point or model.body(f.body).tip_point, f.other_point or ORIGIN
    one["point_a"], one["point_b"] = point_in_row(packed, a, point), point_in_row(packed, b, other)
    one["stiffness"], one["damping"] = f.stiffness, f.damping
    apart = _place(home, a, point) - _place(home, b, other)
    one["rest"] = np.linalg.norm(apart) if f.rest is None else f.rest


def _set_torsion(one: Any, f: Torsion, packed: System, ends: tuple[int, ...]) -> None:
    """Its axis, stiffness, damping and angle at rest."""
    axis = _home(packed, ends[0]) @ unit_vector(f.axis or (0.0, 0.0, 1.0))
    one["axis"] = axis
    # at q = 0 all rows have the world's axes
    one["reference_a"] = one["reference_b"] = normals_of(axis)[0]
    one["stiffness"], one["damping"], one["rest"] = f.stiffness, f.damping, f.rest


def _home(packed: System, number: int) -> Array:
    return packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)


def _place(home: tuple[Array, Array], number: int, point: Any) -> Array:
    """Where a point of a body is in the initial state [m]."""
    if number == 0:
        return np.array(point)
    return home[0][number - 1] + home[1][number - 1] @ np.array(point)


def _in_row(knots: Array, packed: System, number: int) -> Array:
    """Torques and forces in body axes, taken to the home axes of the body's row."""
    turn = _home(packed, number)
    return np.hstack((knots[:, :1], knots[:, 1:4] @ turn.T, knots[:, 4:] @ turn.T))


def _knots(f: Wrench) -> Array:
    """(n, 7) time, torque, force of a wrench, at the times of both tables together."""
    parts = [f.torque, f.force]
    times = {t for part in parts if isinstance(part, VectorTable) for t in part.t}
    t = np.array(sorted(times) or [0.0])
    return np.hstack((t[:, None], *(_over(t, part) for part in parts)))


def _over(t: Array, value: Any) -> Array:
    """(n, 3) a vector, or a table of vectors, at times t."""
    if not isinstance(value, VectorTable):
        return np.tile(np.array(value, dtype=float), (len(t), 1))
    columns = np.array(value.value).T
    return np.stack([np.interp(t, value.t, column) for column in columns], axis=1)


# -- drives --------------------------------------------------------------------------------


def drives(model: Model, topology: Topology, packed: System, forces: tuple[Force, ...]) -> Drives:
    """The rows of joint springs and dampers, and of the motors and servos in `forces`."""
    rows: list[tuple[float, ...]] = []
    knots: list[tuple[float, float, float]] = []
    for number, row in enumerate(topology.row.tolist(), start=1):
        body = model.bodies[row]
        if has_springs(body):
            rows += _springs(body, joint_coordinates(packed, number), knots)
    passive = len(rows)
    for force in forces:
        match force:
            case Motor():
                kp, kd, target = 0.0, 0.0, 0.0
            case Servo():
                kp, kd, target = force.kp, force.kd, force.target
            case OnBody():
                continue
            case _:
                raise TypeError(f"a force of kind '{force.kind}' has no row in any table")
        at_v, at_q = joint_coordinates(packed, topology.number(force.body))[force.coordinate]
        spans = *_table_knots(target, knots), *_table_knots(force.torque, knots)
        limit = np.inf if force.torque_limit is None else force.torque_limit
        rows.append((at_v, at_q if kp else -1, kp, kd, limit, 0.0, *spans))
    return Drives(rows_of(JOINT_FORCE, rows), np.array(knots).reshape(-1, 3), passive)


def bends(drives: Drives) -> Array:
    """Ascending times at which a table of these drives bends [s]."""
    return np.unique(drives.knots[:, 0])


def has_springs(body: Body) -> bool:
    """Whether a joint has a spring, a damper or friction."""
    return any(body.stiffness) or any(body.damping) or any(body.friction)


def _springs(body: Any, at_vq: list[tuple[int, int]], knots: list[Any]) -> list[tuple[float, ...]]:
    """One row a degree of freedom of a joint with a spring, a damper or friction."""
    found: list[tuple[float, ...]] = []
    start = 0
    columns = (body.stiffness, body.damping, body.rest, body.friction)
    for m, k, d, rest, friction in zip(body.sequence, *columns):
        size = joints.SIZE[m.kind][1]
        for at_v, at_q in at_vq[start : start + size]:
            none = _table_knots(0.0, knots)
            place = (at_v, at_q if k else -1)
            found.append((*place, k, d, np.inf, friction, *_table_knots(rest, knots), *none))
        start += size
    return found


def _table_knots(value: float | Table, knots: list[tuple[float, float, float]]) -> tuple[int, int]:
    """(first knot, number of knots) of a constant or a table, appended to `knots`."""
    if isinstance(value, float | int):
        knots.append((0.0, value, 0.0))
        return len(knots) - 1, 1
    t, x = value.t, value.value
    slopes = [(b - a) / (u - s) for (s, u), (a, b) in zip(pairwise(t), pairwise(x))]
    rate = (len(t) - 1) / (t[-1] - t[0]) if len(t) > 1 else 0.0
    knots += zip(t, x, (*slopes, rate))
    return len(knots) - len(t), len(t)
