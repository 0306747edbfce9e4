"""The bodies of a model as a table of numbers, with the columns of `engine/packing`."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from ..engine import packing
from ..fields import GROUND
from ..joints import AXIAL, CODES
from ..model import Body, Model
from . import Array, Ints

# parent (nb,) rows from 1, 0 = ground; body (nb + 1, 18) and motion (nm, 9); q and v (nq + nv,)
Numbers: TypeAlias = tuple[Ints, Array, Array, Array]
Record: TypeAlias = tuple[bytes, bytes, bytes, bytes]  # of the body, of its motions, q and v


def numbers_of(model: Model) -> Numbers:
    """Return the table of a valid model. Row 0 of its bodies holds gravity."""
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
    """Return records joined into an array of our own, which kernels may take."""
    return np.frombuffer(bytearray().join(records))


def record_of(body: Body) -> Record:
    """Return the float64 numbers of a row, which the body keeps.

    Body: link 3, rotation 4, mass, com 3, inertia 6 (xx, yy, zz, xy, xz, yz), number of motions. A
    motion: kind, axis 3, armature, stiffness, damping, rest, friction.
    """
    known = vars(body).get("record")
    if known is None:
        known = vars(body)["record"] = _record(body)
    return known


def _record(b: Body) -> Record:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = b.inertia
    row = (*b.link, *_unit(b.rotation), b.mass, *b.com, xx, yy, zz, xy, xz, yz, len(b.motions))
    motions: list[float] = []
    physics = zip(b.motions, b.armature, b.stiffness, b.damping, b.rest, b.friction)
    for (kind, axis), *numbers in physics:
        direction = _unit(axis) if kind in AXIAL else axis
        motions += (CODES[kind], *direction, *numbers)
    body, motion, q, v = (struct.pack(f"{len(x)}d", *x) for x in (row, motions, b.q, b.v))
    return body, motion, q, v


def _unit(x: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*x)
    return tuple(c / norm for c in x) if norm != 1.0 else x
