"""Columns -> System: the packed arrays of constants, in Pgraph order."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..columns import Columns
from ..engine import layout as at
from ..engine.arrays import Drives as Drives
from ..engine.arrays import Loads as Loads
from ..engine.layout import BODIES_I, BODY, CONST
from ..engine.packing import pack

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
Arrays: TypeAlias = tuple[Ints, Array, Ints, Array, Array]


def pack_columns(columns: Columns) -> tuple[Arrays, int]:
    """Number and pack a table in one compiled call; how many motions have a spring or damper.

    Raises ModelError where parents close a cycle.
    """
    parent, body, motion, start = columns.numbers
    nb, n = len(body), len(motion) + 1
    rows, const = EMPTY((n, 4), INT), EMPTY((n, CONST))
    bodies_i, bodies_f, home = EMPTY((nb, BODIES_I), INT), EMPTY((nb, BODY)), EMPTY(len(start))
    springs = pack(parent, body, motion, start, rows, const, bodies_i, bodies_f, home)
    if springs < 0:
        columns.model()  # says in words which bodies close it
    return (rows, const, bodies_i, bodies_f, home), springs


def system(arrays: Arrays, nq: int) -> System:
    """The packed arrays by name, and which body each row belongs to."""
    rows, const, bodies_i, bodies_f, home = arrays
    body_of_row = np.repeat(np.arange(len(bodies_i)), bodies_i[:, at.OWN_ROWS])
    return System(rows, const, bodies_i, bodies_f, home[:nq], home[nq:], body_of_row)


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


def point_in_row(packed: System, number: int, point: Any) -> Array:
    """A point in a body's axes as one in the home axes of its row, from the row's origin."""
    home = packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)
    return packed.bodies_f[number, at.OFFSET : at.OFFSET + 3] + home @ np.asarray(point, float)
