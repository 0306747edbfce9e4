"""From a description to the numbers of a table, and back."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from .. import joints
from ..engine.packing import pack
from ..joints import Motion
from ..model import Body, Model
from ..model.editing import edited
from ..model.names import GROUND
from .checks import INT, MOTIONS, PHYSICS, Array, Ints, joint_of

# parent (nb,) rows from 1, 0 = ground; body (nb + 1, 18) and motion (nm, 9), whose columns are in
# `engine/packing/pack.py`; q and v in one array (nq + nv,): all in the order of the table
Numbers: TypeAlias = tuple[Ints, Array, Array, Array]


def numbers_of(model: Model) -> tuple[Numbers, int]:
    """(numbers of a model's bodies, nq)."""
    bodies, rows = model.bodies, model.row
    parent = [0 if b.parent == GROUND else rows[b.parent] + 1 for b in bodies]
    records = [b.records for b in bodies]
    numbers = (
        np.array(parent, INT),
        _floats([_ground(model), *[r[0] for r in records]]).reshape(-1, pack.BODY),
        _floats([r[1] for r in records]).reshape(-1, pack.MOTION),
        _floats([*[r[2] for r in records], *[r[3] for r in records]]),
    )
    return numbers, sum([len(r[2]) for r in records]) // 8


def _ground(model: Model) -> bytes:
    """Row 0 of the table's bodies."""
    return struct.pack(f"{pack.BODY}d", *model.gravity, *(0.0,) * (pack.BODY - 3))


def _floats(records: list[bytes]) -> Array:
    """Records joined into an array of our own, which kernels may take."""
    return np.frombuffer(bytearray().join(records))


def with_fields(model: Model, changes: Mapping[str, Mapping[str, Any]]) -> Model:
    """The model after all of the edits; only the whole has to be valid. Raises ModelError."""
    bodies = list(model.bodies)
    for name, fields in changes.items():
        bodies[model.row[name]], _ = edited(model.body(name), fields)
    return model if bodies == list(model.bodies) else model.replace(bodies=tuple(bodies))


def described(names: tuple[str, ...], numbers: Numbers, nq: int) -> Model:
    """A model with these rows, whose numbers have been checked."""
    parent, body, motion, start = (x.tolist() for x in numbers)
    label = (GROUND, *names)
    bodies: list[Body] = []
    m = qi = 0
    vi = nq
    for name, p, row in zip(names, parent, body[1:]):
        count = int(row[pack.MOTIONS])
        mine = motion[m : m + count]
        motions = tuple(Motion(MOTIONS[int(x[0])], tuple(x[1:4])) for x in mine)
        q_end, v_end = qi + joints.nq(motions), vi + joints.nv(motions)
        xx, yy, zz, xy, xz, yz = row[pack.INERTIA : pack.INERTIA + 6]
        fields: dict[str, Any] = {
            "name": name,
            "parent": label[p],
            "joint": joint_of(motions),
            "axes": tuple([m.axis for m in motions if m.kind in ("rotate", "translate")]),
            "motions": motions,
            "link": tuple(row[pack.LINK : pack.LINK + 3]),
            "rotation": tuple(row[pack.ROTATION : pack.ROTATION + 4]),
            "mass": row[pack.MASS],
            "com": tuple(row[pack.COM : pack.COM + 3]),
            "inertia": ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)),
            "q": tuple(start[qi:q_end]),
            "v": tuple(start[vi:v_end]),
        }
        for column, field in enumerate(PHYSICS, start=pack.ARMATURE):
            fields[field] = tuple([x[column] for x in mine])
        fields["limit_restitution"] = (0.0,) * count
        bodies.append(Body.model_construct(None, **fields))
        m, qi, vi = m + count, q_end, v_end
    return Model(name="columns", gravity=tuple(body[0][:3]), bodies=tuple(bodies))
