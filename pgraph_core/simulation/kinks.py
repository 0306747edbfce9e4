"""Corners of prescribed motions: where the value or the rate of an expression of time jumps.

An interval in which something jumps is halved until rounding ends it. What is smooth changes less
and less there; a jump stays as large as it was.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..engine.signals import rates
from ..mechanism import Mechanism
from ..model.constraint import Motion
from ..packing import Array, Ints
from ..packing.signals import of_time
from ..signals import parsed
from ..signals.grammar import walk
from ..tolerances import NOTABLE

BENT = {"min", "max", "abs", "if", "table", "smoothstep"}  # operations that may have corners
LOOKS = 1000  # intervals of a run in which corners are looked for


class Kink(NamedTuple):
    """A corner of a prescribed motion."""

    name: str
    t: float  # [s]
    value: float  # jump of the value [rad, m]
    rate: float  # jump of the rate [rad/s, m/s]

    def __str__(self) -> str:
        what, size = ("value", self.value) if self.value else ("rate", self.rate)
        return (
            f"constraint '{self.name}': the {what} of its expression jumps by {size:.4g} at t = "
            f"{self.t:.6g} s. The work of that impulse is not in the energies of the run; give an "
            "expression with a continuous slope, as with smoothstep"
        )


def kinks_of(mech: Mechanism, active: Ints, begin: float, end: float) -> list[Kink]:
    """Return the corners of the active prescribed motions between two times."""
    found = list[Kink]()
    for i in active.tolist():
        c = mech.model.constraints[i]
        text = c.q_of_t if isinstance(c, Motion) else None
        if isinstance(text, str) and any(n.op in BENT for n in walk(parsed(text))):
            code = of_time(text, mech.model.parameters)
            found += _of_program(c.name, code, np.linspace(begin, end, LOOKS + 1))
    return found


def _of_program(name: str, code: Array, times: Array) -> list[Kink]:
    out = np.empty((len(times), 2))
    rates(code, times, out)
    scale = np.abs(out).max(axis=0)
    if not np.isfinite(out).all():
        return []
    found = list[Kink]()
    for k in np.flatnonzero((np.abs(np.diff(out, axis=0)) > NOTABLE * scale).any(axis=1)):
        low, high = times[k], times[k + 1]
        while low < (middle := 0.5 * (low + high)) < high:
            part = np.empty((3, 2))
            rates(code, np.array([low, middle, high]), part)
            first, second = (np.abs(x) / np.where(scale, scale, 1.0) for x in np.diff(part, axis=0))
            low, high = (low, middle) if first.max() > second.max() else (middle, high)
        ends = np.empty((2, 2))
        rates(code, np.array([low, high]), ends)
        jump = ends[1] - ends[0]
        jump[np.abs(jump) <= NOTABLE * scale] = 0.0
        if jump.any() and (not found or high > found[-1].t):
            found.append(Kink(name, float(high), *jump.tolist()))
    return found
