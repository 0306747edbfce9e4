"""The bodies of a model as a numeric table, with the columns defined in `engine/packing`."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from ..engine import packing
from ..fields import GROUND
from ..joints import AXIAL, CODES
from ..model import Body, Model
from . import Array, Ints

# parent (nb,) rows from 1, 0 = ground; body (nb + 1, 18) and motion (nm, 10); q and v (nq + nv,)
Numbers: TypeAlias = tuple[Ints, Array, Array, Array]
BODY, MOTION = (struct.Struct(f"{n}d").pack for n in (packing.TABLE_BODY, packing.TABLE_MOTION))
Record: TypeAlias = tuple[bytes, bytes, bytes, bytes]  # bytes of the body, its motions, q and v


def numbers_of(model: Model) -> Numbers:
    """Return the table for a valid model. Row 0 contains gravity."""
    rows = model.row
    parent = [0 if b.parent == GROUND else rows[b.parent] + 1 for b in model.bodies]
    ground = struct.pack("18d", *model.gravity, *(0.0,) * (packing.TABLE_BODY - 3))
    body, motion, q, v = zip(*map(record_of, model.bodies)) if rows else ((),) * 4
    return (
        np.array(parent, np.int64),
        _floats([ground, *body]).reshape(-1, packing.TABLE_BODY),
        _floats(motion).reshape(-1, packing.TABLE_MOTION),
        _floats([*q, *v]),
    )


def _floats(records: Iterable[bytes]) -> Array:
    """Join records into a newly allocated array that can be passed to kernels."""
    return np.frombuffer(bytearray().join(records))


def record_of(body: Body) -> Record:
    """Return the float64 numbers for a row, cached on the body.

    Body: link 3, rotation 4, mass, com 3, inertia 6 (xx, yy, zz, xy, xz, yz), number of motions. A
    motion: kind, axis 3, armature, stiffness, damping, rest, friction, pitch a radian.
    """
    own = vars(body)
    known = own.get("record")
    return known if known is not None else own.setdefault("record", _record(own))


def _record(b: Mapping[str, Any]) -> Record:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = b["inertia"]
    motions, q, v = b["motions"], b["q"], b["v"]
    row = BODY(
        *b["link"],
        *_unit(b["rotation"]),
        b["mass"],
        *b["com"],
        xx,
        yy,
        zz,
        xy,
        xz,
        yz,
        len(motions),
    )
    physics = zip(b["armature"], b["stiffness"], b["damping"], b["rest"], b["friction"], b["pitch"])
    moved = b""
    for (kind, axis), (*numbers, pitch) in zip(motions, physics):
        direction = _unit(axis) if kind in AXIAL else axis
        moved += MOTION(CODES[kind], *direction, *numbers, pitch / math.tau)
    return row, moved, struct.pack(f"{len(q)}d", *q), struct.pack(f"{len(v)}d", *v)


def _unit(x: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*x)
    return tuple(c / norm for c in x) if norm != 1.0 else x
