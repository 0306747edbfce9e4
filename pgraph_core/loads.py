"""Wrenches, springs and torsion springs as tables for the kernels; columns in `layout.py`."""

from __future__ import annotations

from typing import Any

import numpy as np

from .engine import layout as at
from .model import Force, Model, VectorTable
from .rotation import normals_of, unit_vector
from .system import Array, Loads, System, point_in_row
from .topology import Topology

ORIGIN = (0.0, 0.0, 0.0)


def loads(
    model: Model,
    topology: Topology,
    packed: System,
    forces: tuple[Force, ...],
    home: tuple[Array, Array],
) -> Loads:
    """The wrenches and springs in `forces`; `home`: the bodies' poses in the initial state."""
    ints: list[tuple[int, ...]] = []
    floats: list[Array] = []
    knots: list[Array] = []
    for f in forces:
        if f.kind not in TYPES:
            continue
        a, b = topology.number(f.body), topology.number(f.other)
        own = _knots(f) if f.kind == "wrench" else np.zeros((0, 7))
        first = sum(map(len, knots))
        rows = (int(packed.bodies_i[n, at.ROW]) for n in (a, b))
        ints.append((TYPES[f.kind], *rows, int(f.frame == "body"), first, len(own), 0, 0))
        floats.append(_numbers(f, model, packed, a, b, home))
        knots.append(_in_row(own, packed, a) if f.frame == "body" else own)
    return Loads(
        np.array(ints, dtype=np.int64).reshape(-1, at.LOAD_I),
        np.array(floats).reshape(-1, at.LOAD_F),
        np.concatenate((np.zeros((0, 7)), *knots)),
    )


TYPES = {"wrench": at.WRENCH, "spring": at.SPRING, "torsion": at.TORSION}


def _numbers(
    f: Force, model: Model, packed: System, a: int, b: int, home: tuple[Array, Array]
) -> Array:
    """(20,) points, axis, stiffness, damping and rest of a load."""
    out = np.zeros(at.LOAD_F)
    tip = model.body(f.body).tip_point if f.kind == "spring" else ORIGIN
    point, other = f.point or tip, f.other_point or ORIGIN
    axis = unit_vector(f.axis or (0.0, 0.0, 1.0))
    turned = _home(packed, a) @ axis
    across = normals_of(turned)[0]
    rest = f.rest or 0.0
    if f.kind == "spring" and f.rest is None:
        rest = float(np.linalg.norm(_place(home, a, point) - _place(home, b, other)))
    for column, values in (
        (at.L_PA, point_in_row(packed, a, point)),
        (at.L_PB, point_in_row(packed, b, other)),
        (at.L_AXIS, turned),
        (at.L_REF, across),
        (at.L_REF_B, across),  # at q = 0 the axes of all rows are those of the world
    ):
        out[column : column + 3] = values
    out[at.L_STIFF], out[at.L_DAMP], out[at.L_REST] = f.stiffness or 0.0, f.damping or 0.0, rest
    return out


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


def _knots(f: Force) -> Array:
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
