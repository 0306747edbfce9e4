"""Limits of coordinates, lengths and cables as rows of constraints that may let go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.motions import facts
from ..forces.cable import Cable, longest_of
from ..forces.path import points_of
from ..model import Spring, Tendon
from ..packing import Array, Ints, point_in_row, row_of_velocity
from ..packing.constraints import (
    Block,
    Term,
    block_values,
    radius_of_gyration,
)
from ..packing.forces import terms_of
from ..pulleys import cable_limit, segment_names

if TYPE_CHECKING:
    from ..packing.packed import Packed


class Limit(NamedTuple):
    """A limit on a weighted sum of coordinates."""

    name: str
    row: int  # row of its first coordinate
    at_v: Ints
    at_q: Ints
    weights: Array
    bound: float
    size: float  # scale of its gaps [rad, m]
    rebound: float  # restitution

    def gap(self, q: Array) -> Array:
        """Return the gap (...) at states q (..., nq) [rad, m]."""
        return q[..., self.at_q] @ self.weights - self.bound

    def slope(self, nv: int) -> Array:
        """Return the derivative of the gap in the motion of the joints (nv,)."""
        return self.weights @ np.eye(nv)[self.at_v]


def limit_rows(mech: Packed) -> Iterator[tuple[str, Block]]:
    """Yield (name, block) for all joint, tendon and spring limits, with one row each."""
    for body in mech.model.bodies:
        if not any(body.limits):
            continue
        number = mech.topology.number(body.name)
        motions = np.flatnonzero(mech.system.body_of_row == number).tolist()
        many = sum(pair is not None for pair in body.limits) > 1
        for m, (k, pair, bounce) in enumerate(zip(motions, body.limits, body.limit_restitution)):
            if pair is None:
                continue
            for sign, bound, side in _sides(*pair):
                _, _, qi, vi, *_ = mech.system.rows[k].tolist()
                size = _size(mech, k, pair)
                values = {at.VALUE: sign * bound, at.REBOUND: bounce, at.SIZE: size}
                name = f"{body.name} {side} limit" + (f" {m}" if many else "")
                yield name, _limit(values, ((vi, qi, sign),), k)
    for tendon in mech.model.forces:
        if not isinstance(tendon, Tendon):
            continue
        own, low, high = terms_of(tendon, mech.topology, mech.system), tendon.low, tendon.high
        for sign, bound, side in _sides(low, high):
            moves = max(abs(x) for *_, x in own)  # a joint's turn by a radian
            near = min(high - low, moves) if low is not None and high is not None else moves
            row = row_of_velocity(mech.system.rows, min(own)[0])
            terms = tuple((at_v, at_q, sign * x) for at_v, at_q, x in own)
            values = {at.VALUE: sign * bound, at.SIZE: near}
            yield f"tendon {tendon.name} {side} limit", _limit(values, terms, row)
    for spring in mech.model.forces:
        if not isinstance(spring, Spring):
            continue
        a, b = (mech.topology.number(name) for name in spring.pair)
        ends = mech.system.row_of(a), mech.system.row_of(b)
        p, q = points_of(spring, mech.model.body(spring.body))
        points = {at.PA: point_in_row(mech.system, a, p), at.PB: point_in_row(mech.system, b, q)}
        for sign, bound, side in _sides(spring.low, spring.high):
            values = block_values({**points, at.VALUE: sign * bound, at.SIZE: bound})
            block = Block(at.T_SPAN, 1, values, ends=ends, bodies=(a, b))
            yield f"spring {spring.name} {side} limit", block


def cable_rows(mech: Packed) -> Iterator[tuple[Cable, tuple[str, Block]]]:
    """Yield (cable, (name, block)) for each segment of the cables that do not stretch."""
    for f in mech.model.forces:
        if isinstance(f, Cable) and f.stiffness is None:
            found = mech.placed().segments(f)
            for own, one in zip(segment_names(f.name, len(found)), found):
                kind, rows = at.T_SLACK, one.chain.rows
                if one.number:  # friction on the wheel at its first station
                    kind, rows = at.T_WRAP, rows[one.chain.starts[one.number] :]
                longest = longest_of(f, one)
                values = block_values({at.VALUE: longest, at.SIZE: abs(longest)})
                ends = int(rows[0]["row"]), int(rows[-1]["row"])
                block = Block(kind, 1, values, ends=ends, stations=rows, chain=one.number)
                yield f, (cable_limit(own), block)


def _limit(values: dict[int, float], terms: tuple[Term, ...], row: int) -> Block:
    return Block(at.T_LIMIT, 1, block_values(values), terms, ends=(row, 0))


def _sides(low: float | None, high: float | None) -> Iterator[tuple[float, float, str]]:
    """Yield (sign, bound, side) of each bound that is given."""
    for sign, bound, side in ((1.0, low, "low"), (-1.0, high, "high")):
        if bound is not None:
            yield sign, bound, side


def _size(mech: Packed, row: int, pair: Sequence[float | None]) -> float:
    """Compute the gap scale for a limit: its range, but at most one radian [rad, m].

    For a slider with one limit, the size is the radius of gyration. If all masses are at body
    origins, the size is the largest of three lengths: that of the mechanism, the limit, and the
    initial distance from the limit.
    """
    low, high = pair
    turns = facts("angle")[mech.system.rows[row, at.KIND]]
    bounds = [x for x in pair if x is not None]
    start = mech.system.q[mech.system.rows[row, at.QI]]
    ways = [mech.length, *(abs(x) for x in bounds), *(abs(start - x) for x in bounds)]
    usual = 1.0 if turns else radius_of_gyration(mech.system, float(max(ways)) or 1.0)
    if low is None or high is None or low == high:
        return usual
    return min(high - low, usual) if turns else high - low
