"""Constraints as blocks of rows, which is what kernels take; columns in `engine/layout.py`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from ..engine import layout as at
from ..model import Constraint, Model
from ..system import Array, Ints, System
from ..topology import Topology
from .ends import Block, Ends
from .kinds import blocks_of


class Blocks(NamedTuple):
    """Every constraint of a model, active or not, in its order."""

    names: tuple[str, ...]
    first: Ints  # (nc + 1,) constraint i has the blocks first[i] to first[i + 1] - 1
    blocks_i: Ints  # (nb, 8)
    blocks_f: Array  # (nb, 28)
    terms_i: Ints  # (nt, 2)
    terms_f: Array  # (nt,)
    curves: Array  # (nk, 5)


def blocks(model: Model, topology: Topology, packed: System, home: tuple[Array, Array]) -> Blocks:
    """The blocks of a valid model; `home` are its bodies' poses in the initial state.

    Raises ModelError where a constraint contradicts that state.
    """
    size = radius_of_gyration(packed)
    found = [blocks_of(Ends(c, model, topology, packed, home, size)) for c in model.constraints]
    flat = [block for items in found for block in items]
    ends = [
        _rows(c, b, topology, packed) for c, items in zip(model.constraints, found) for b in items
    ]
    terms = [term for block in flat for term in block.terms]
    curves = [knot for block in flat for knot in block.curve]
    starts = _starts([len(block.terms) for block in flat]), _starts([len(b.curve) for b in flat])
    table = [
        (b.type, *rows, b.rows, term, len(b.terms), knot, at.SINE if b.sine else len(b.curve))
        for b, rows, term, knot in zip(flat, ends, *starts)
    ]
    return Blocks(
        tuple(c.name for c in model.constraints),
        np.array([*_starts([len(items) for items in found]), len(flat)], dtype=np.int64),
        np.array(table, dtype=np.int64).reshape(-1, at.BLOCK_I),
        np.array([block.values for block in flat]).reshape(-1, at.BLOCK_F),
        np.array([term[:2] for term in terms], dtype=np.int64).reshape(-1, 2),
        np.array([term[2] for term in terms]),
        np.array(curves).reshape(-1, 5),
    )


def values_of(
    c: Constraint, model: Model, topology: Topology, packed: System, poses: tuple[Array, Array]
) -> list[Array]:
    """(28,) of each block of a constraint, what it leaves out being as in these poses."""
    ends = Ends(c, model, topology, packed, poses, radius_of_gyration(packed))
    return [block.values for block in blocks_of(ends)]


def _starts(counts: Sequence[int]) -> list[int]:
    return list(accumulate(counts, initial=0))[: len(counts)]


def _rows(c: Constraint, block: Block, topology: Topology, packed: System) -> tuple[int, int]:
    """Rows of the two bodies; of a block of coordinates the row that has the first of them."""
    a, b = (int(packed.bodies_i[topology.number(name), at.ROW]) for name in (c.body, c.other))
    if block.terms:
        a = int(np.searchsorted(packed.rows[1:, at.VI], block.terms[0][0], side="right"))
    return a, b


def radius_of_gyration(packed: System) -> float:
    """How far a body's mass is from its origin, over all bodies [m]; 1 where none is.

    A turn times this length compares with a displacement: what Ω then has on its diagonal is of
    one size.
    """
    mass = packed.bodies_f[1:, at.B_MASS]
    com = packed.bodies_f[1:, at.B_COM : at.B_COM + 3]
    trace = packed.bodies_f[1:, at.B_INERTIA : at.B_INERTIA + 3].sum(axis=1)
    moment = float(np.sum(trace / 2 + mass * (com**2).sum(axis=1)))
    return float(np.sqrt(moment / mass.sum())) if moment > 0 and mass.sum() > 0 else 1.0
