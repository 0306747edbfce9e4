"""Packing of a model into arrays for the kernels. `System` names its constants, in Pgraph order."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..engine import layout as at
from ..engine.arrays import Drives as Drives
from ..engine.arrays import Loads as Loads
from ..engine.motions import facts

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]


class System(NamedTuple):
    """The constants of a mechanism, with the columns defined in `engine/layout.py`."""

    rows: Ints  # (n + 1, 6)
    const: Array  # (n + 1 + nt, 32)
    bodies_i: Ints  # (nb + 1, 12)
    bodies_f: Array  # (nb + 1, 22)
    q: Array  # (nq,) the model's initial state
    v: Array  # (nv,)
    body_of_row: Ints  # (n + 1,) number of the body whose joint a row belongs to

    def row_of(self, number: int) -> int:
        """Return the row that moves a body."""
        return int(self.bodies_i[number, at.ROW])


# rows, const, bodies_i, bodies_f of a System, and its q and v in one array
Arrays: TypeAlias = tuple[Ints, Array, Ints, Array, Array]


def system(arrays: Arrays, nq: int) -> System:
    """Return the packed arrays by name, and the body that each row belongs to."""
    rows, const, bodies_i, bodies_f, home = arrays
    body_of_row = np.repeat(np.arange(len(bodies_i)), bodies_i[:, at.OWN_ROWS])
    return System(rows, const, bodies_i, bodies_f, home[:nq], home[nq:], body_of_row)


def length_in(count: int, const: Array, home: Array) -> float:
    """Find the largest characteristic length of a mechanism [m], from the constants in its rows.

    The length is the largest of all links, centres of mass and radii of gyration. Points that slide
    have none. If all of these are zero, the largest initial position in `home` is used, or 1 m.
    """
    const = const[1:count]
    mass = np.where(const[:, at.MASS] > 0, const[:, at.MASS], np.inf)
    gyration = const[:, at.INERTIA : at.INERTIA + 3].sum(axis=1) / mass
    found = [np.sqrt(gyration.max(initial=0.0))]
    for column in (at.LINK, at.COM):
        found.append(np.linalg.norm(const[:, column : column + 3], axis=1).max(initial=0.0))
    return float(max(found)) or float(np.abs(home).max(initial=0.0)) or 1.0


def quaternions(rows: Ints) -> list[tuple[int, int, int]]:
    """Return (row, first index into q, first index into v) for each quaternion."""
    found: list[tuple[int, int, int]] = []
    for k in (1 + np.flatnonzero(facts("attitude")[rows[1:, at.KIND]])).tolist():
        _, kind, i, j, *_ = rows[k].tolist()
        found.append((k, i + int(facts("coordinates")[kind]) - 4, j))
    return found


def plain(rows: Ints) -> tuple[Ints, Ints]:
    """Return the indices into q and v for coordinates whose rates are velocities."""
    _, of_q, of_v = numbers(rows)
    return of_q, of_v


def numbers(rows: Ints) -> tuple[Ints, Ints, Ints]:
    """Return (row, index into q, index into v) for each coordinate outside quaternions."""
    kinds = rows[1:, at.KIND]
    first = 3 * facts("attitude")[kinds]  # angular velocities precede in v
    count = facts("freedoms")[kinds] - first
    row = np.repeat(np.arange(1, len(rows)), count)
    n = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    return row, rows[row, at.QI] + n, rows[row, at.VI] + np.repeat(first, count) + n


def row_of_velocity(rows: Ints, index: int) -> int:
    """Return the row of the motion that contains v[index]."""
    return int(np.searchsorted(rows[1:, at.VI], index, side="right"))


def home_of(packed: System, number: int) -> Array:
    """Return the home orientation of a body as a (3, 3) matrix."""
    return packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)


def joint_coordinates(packed: System, number: int) -> list[tuple[int, int]]:
    """Return (index into v, index into q or -1) for each degree of freedom of a body's joint."""
    found: list[tuple[int, int]] = []
    for k in range(*np.searchsorted(packed.body_of_row, (number, number + 1))):
        _, kind, qi, vi, *_ = packed.rows[k].tolist()
        known = not facts("attitude")[kind]
        found += [(vi + n, qi + n if known else -1) for n in range(int(facts("freedoms")[kind]))]
    return found


def point_in_row(packed: System, number: int, point: Any) -> Array:
    """Convert a point from body axes to the home axes of its row, relative to the row's origin."""
    offset = packed.bodies_f[number, at.OFFSET : at.OFFSET + 3]
    return offset + home_of(packed, number) @ np.asarray(point, float)
