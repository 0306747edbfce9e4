"""Kinks in time: corners of tables, and comparisons in the expressions of prescribed motions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.edges import edges
from ..engine.signals import rates
from ..mechanism import Mechanism
from ..model.joint_constraint import Motion
from ..packing import Array, Drives, Ints, Loads
from ..packing.forces import bends_of_loads
from ..packing.programs import count_of_edges, of_time
from ..result.balance import UNBOOKED
from ..tolerances import NOTABLE
from .monitors import MOST_EVENTS


class Kink(NamedTuple):
    """An edge of a prescribed motion."""

    name: str
    t: float  # [s]
    value: float  # jump of the value [rad, m]
    rate: float  # jump of the rate [rad/s, m/s]

    def __str__(self) -> str:
        what, size = ("value", self.value) if self.value else ("rate", self.rate)
        return (
            f"constraint '{self.name}': the {what} of its expression jumps by {size:.4g} at t = "
            f"{self.t:.6g} s. {UNBOOKED}; give an expression with a continuous slope, as with "
            "smoothstep."
        )


def kinks_of(mech: Mechanism, active: Ints, begin: float, end: float) -> list[Kink]:
    """Return the edges of the active prescribed motions between two times."""
    found = list[Kink]()
    for i in active.tolist():
        c = mech.model.constraints[i]
        text = c.q_of_t if isinstance(c, Motion) else None
        if isinstance(text, str):
            code = of_time(text, mech.model.parameters)
            found += _of_program(c.name, code, begin, end) if count_of_edges(code) else ()
    return found


def told(kinks: Sequence[Kink]) -> list[str]:
    """Return notices about prescribed motions whose value or rate jumps, or that jump too often."""
    found = list[str]()
    for name in dict.fromkeys(kink.name for kink in kinks):
        own = [kink for kink in kinks if kink.name == name]
        sharp = [kink for kink in own if kink.value or kink.rate]
        if sharp:
            others = f" {len(sharp) - 1} more follow until t = {sharp[-1].t:.6g} s."
            found.append(f"{sharp[0]}{others if sharp[1:] else ''}")
        if len(own) == MOST_EVENTS:
            found.append(
                f"constraint '{name}': its slope jumps more than {MOST_EVENTS} times; steps "
                f"end at these bends until t = {own[-1].t:.6g} s only"
            )
    return found


def _of_program(name: str, code: Array, begin: float, end: float) -> list[Kink]:
    t = np.empty(MOST_EVENTS)
    t = t[: edges(code, begin, end, t)]
    ends = np.concatenate(([begin], t, [end]))
    scale = np.abs(_values(code, np.append(ends, 0.5 * (ends[1:] + ends[:-1])))).max(axis=0)
    if not np.isfinite(scale).all():
        return []
    jumps = _values(code, np.nextafter(t, end)) - _values(code, np.nextafter(t, begin))
    jumps[np.abs(jumps) <= NOTABLE * scale] = 0.0
    return [Kink(name, *row) for row in np.column_stack((t, jumps)).tolist()]


def _values(code: Array, t: Array) -> Array:
    """Return the value and the rate of a program at times (n,), as (n, 2)."""
    out = np.empty((len(t), 2))
    rates(code, t, out)
    return out


def corners(mech: Mechanism, drives: Drives, loads: Loads, active: Ints, begin: float) -> Array:
    """Return the times after `begin` at which a force or motion table has a kink [s]."""
    found = [mech.packed.bends(drives), bends_of_loads(loads)]
    blocks = mech.packed.blocks
    for i in active.tolist() if len(blocks.curves) else ():
        for block in range(blocks.first[i], blocks.first[i + 1]):
            columns = [at.B_TYPE, at.B_CURVE, at.B_KNOTS]
            kind, first, count = blocks.blocks_i[block, columns].tolist()
            if kind in (at.T_COORD, at.T_VELOCITY) and count > 1:
                found.append(blocks.curves[first : first + count, 0])
    others = any(len(x) for x in found[1:])
    times = np.unique(np.concatenate(found)) if others else found[0]
    return times[times > begin]
