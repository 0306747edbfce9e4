"""Constraints as blocks of rows, which is what kernels take; columns in `kernels/layout.py`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .kernels import layout as at
from .schema import Constraint, Model
from .system import Array, Ints, System, point_in_row
from .topology import Topology


class Blocks(NamedTuple):
    """Every constraint of a model, active or not, in its order."""

    names: tuple[str, ...]
    first: Ints  # (nc + 1,) constraint i has the blocks first[i] to first[i + 1] - 1
    blocks_i: Ints  # (nb, 8)
    blocks_f: Array  # (nb, 28)
    terms_i: Ints  # (nt, 2)
    terms_f: Array  # (nt,)
    curves: Array  # (nk, 5)


class Poses(NamedTuple):
    """Where the bodies are in the initial state, by number from 1 [m]."""

    position: Array  # (nb, 3)
    rotation: Array  # (nb, 3, 3)


def blocks(model: Model, topology: Topology, packed: System, home: tuple[Array, Array]) -> Blocks:
    """The blocks of a valid model; `home` are the poses of its bodies in its initial state."""
    place = _Places(model, topology, packed, Poses(*home))
    found = [_blocks_of(c, place) for c in model.constraints]
    count = np.array([len(items) for items in found], dtype=np.int64)
    flat = [block for items in found for block in items]
    return Blocks(
        tuple(c.name for c in model.constraints),
        np.concatenate(([0], np.cumsum(count))).astype(np.int64),
        np.array([i for i, _ in flat], dtype=np.int64).reshape(-1, at.BLOCK_I),
        np.array([f for _, f in flat]).reshape(-1, at.BLOCK_F),
        np.zeros((0, 2), dtype=np.int64),
        np.zeros(0),
        np.zeros((0, 5)),
    )


class _Places:
    """Points and directions of bodies at home and in their rows."""

    def __init__(self, model: Model, topology: Topology, packed: System, home: Poses):
        self.model, self.topology, self.packed = model, topology, packed
        ground = (np.zeros((1, 3)), np.eye(3)[None])
        self.position = np.concatenate((ground[0], home.position))
        self.rotation = np.concatenate((ground[1], home.rotation))

    def seen(self, point: Array, a: int, b: int) -> Array:
        """A point of body a as a point of body b, both at home."""
        world = self.position[a] + self.rotation[a] @ point
        return self.rotation[b].T @ (world - self.position[b])


def _blocks_of(c: Constraint, place: _Places) -> list[tuple[list[int], Array]]:
    a, b = place.topology.number(c.body), place.topology.number(c.other)
    point = np.array(place.model.body(c.body).tip_point if c.point is None else c.point)
    other = place.seen(point, a, b) if c.other_point is None else np.array(c.other_point)
    row_a, row_b = (int(place.packed.bodies_i[n, at.ROW]) for n in (a, b))
    values = np.zeros(at.BLOCK_F)
    values[at.PA : at.PA + 3] = point_in_row(place.packed, a, point)
    values[at.PB : at.PB + 3] = point_in_row(place.packed, b, other)
    home = place.packed.bodies_f[b, at.HOME : at.HOME + 9].reshape(3, 3)
    values[at.DIR : at.DIR + 9] = home.T.ravel()
    return [([at.T_POINT, row_a, row_b, 3, 0, 0, 0, 0], values)]
