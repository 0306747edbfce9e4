"""The two ends of a constraint, and the blocks of rows that tie them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..engine import layout as at
from ..errors import ModelError, Problem
from ..model import Constraint, Model
from ..rotation import unit_vector
from ..system import Array, System, joint_coordinates, point_in_row
from ..topology import Topology


class Block(NamedTuple):
    """Up to three rows of one type."""

    type: int
    rows: int
    values: Array  # (28,)
    terms: tuple[tuple[int, int, float], ...] = ()  # index into v, into q or -1, coefficient
    curve: tuple[tuple[float, ...], ...] = ()
    sine: bool = False


class Ends:
    """The two ends of a constraint: points and directions in the axes of its bodies."""

    def __init__(
        self,
        c: Constraint,
        model: Model,
        topology: Topology,
        packed: System,
        home: tuple[Array, Array],
        size: float,
    ):
        self.c, self.model, self.packed, self.size = c, model, packed, size
        self.topology = topology
        self.a, self.b = topology.number(c.body), topology.number(c.other)
        self.position_a, self.rotation_a = _pose(home, self.a)
        self.position_b, self.rotation_b = _pose(home, self.b)
        self.turn = self.rotation_b.T @ self.rotation_a  # from the axes of a to those of b
        self.point = np.array(model.point_of(c))
        self.other_point = self._other_point()

    def _other_point(self) -> Array:
        if self.c.other_point is not None:
            return np.array(self.c.other_point)
        if self.c.kind == "rolling":
            return np.zeros(3)
        world = self.position_a + self.rotation_a @ self.point
        return self.rotation_b.T @ (world - self.position_b)

    def directions(self) -> tuple[Array, Array]:
        """(axis, other_axis), unit vectors in their bodies; one left out is the other at home."""
        axis, other = self.c.axis, self.c.other_axis
        if axis is not None and other is not None:
            return unit_vector(axis), unit_vector(other)
        if axis is None and other is not None:
            return self.turn.T @ unit_vector(other), unit_vector(other)
        along = unit_vector(axis or (0.0, 0.0, 1.0))
        return along, self.turn @ along

    def values(
        self, value: float = 0.0, dirs: Sequence[Array] = (), aims: Sequence[Array] = ()
    ) -> Array:
        """(28,) with points, and directions of b and of a given in their bodies' axes."""
        out = np.zeros(at.BLOCK_F)
        out[at.PA : at.PA + 3] = point_in_row(self.packed, self.a, self.point)
        out[at.PB : at.PB + 3] = point_in_row(self.packed, self.b, self.other_point)
        for column, number, vectors in ((at.DIR, self.b, dirs), (at.AIM, self.a, aims)):
            home = self.packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)
            for r, vector in enumerate(vectors):
                out[column + 3 * r : column + 3 * r + 3] = home @ vector
        out[at.VALUE] = value
        return out

    # -- blocks --------------------------------------------------------------------------------

    def held(self, dirs: Sequence[Array] = tuple(np.eye(3))) -> Block:
        """The point stays where it is along directions of b."""
        return Block(at.T_POINT, len(dirs), self.values(dirs=dirs))

    def turned_as_at_home(self) -> Block:
        """No turn: row r, a_s · b_t = 0 with (r, s, t) cyclic, is about axis r of b."""
        b = np.eye(3)
        a = self.turn.T @ b
        aims = [a[:, (r + 1) % 3] for r in range(3)]
        dirs = [self.size * b[(r + 2) % 3] for r in range(3)]
        return Block(at.T_ALIGN, 3, self.values(dirs=dirs, aims=aims))

    def aligned(self, axis: Array, normals: Sequence[Array]) -> Block:
        """An axis of a stays normal to directions of b."""
        dirs = [self.size * normal for normal in normals]
        return Block(at.T_ALIGN, len(dirs), self.values(dirs=dirs, aims=[axis for _ in normals]))

    def coordinate(self, name: str, k: int | None, factor: float) -> tuple[int, int, float]:
        """A term of a block: (index in v, index in q, factor) of a joint's coordinate."""
        at_v, at_q = joint_coordinates(self.packed, self.topology.number(name))[k or 0]
        return at_v, at_q, factor

    def refuse(self, field: str, text: str) -> ModelError:
        """An error of this constraint."""
        return ModelError(Problem(f"constraint '{self.c.name}'", field, text))


def _pose(home: tuple[Array, Array], number: int) -> tuple[Array, Array]:
    if number == 0:
        return np.zeros(3), np.eye(3)
    return home[0][number - 1], home[1][number - 1]
