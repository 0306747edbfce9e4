"""Constraint forces that are not unique while joints stick by dry friction.

A joint that sticks is held by a force of its own, as by a constraint. In a loop it shares the load
with the constraint that closes the loop, and only their sum is known from the motion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..dynamics import Dynamics
from ..packing import Array, Ints
from ..tolerances import FAINT, NAMED, SOLVED
from .rows import Rows


class Stuck(NamedTuple):
    """A state in which joints stick, with the active constraints."""

    active: Ints
    t: float
    q: Array
    rows: Array  # (k, nv) rows of the frictions that stick

    @classmethod
    def of(
        cls, active: Ints, times: Array, q: Array, v: Array, frictions: Array, gravity: float
    ) -> Stuck | None:
        """Return the first of these states in which most frictions stick, or None if none does.

        A friction sticks if its speeds at a frame and the one before are rounding, of the largest
        one or of what gravity [m/s²] adds between frames.
        """
        if not len(active) or len(times) < 2:
            return None
        speeds = np.abs(v @ frictions.T)
        fall = gravity * float(np.diff(times).max())
        still = speeds <= SOLVED * max(float(speeds.max(initial=0.0)), fall)
        still = still[1:] & still[:-1]
        count = still.sum(axis=1)
        i = int(count.argmax())
        if not count[i]:
            return None
        return cls(active, float(times[i + 1]), q[i + 1].copy(), frictions[still[i]])

    def notice(self, mech: Dynamics) -> str:
        """Return a notice if the forces of constraints are not unique here, or ""."""
        rows = Rows.of(mech, self.active, self.q, t=self.t)
        both = np.concatenate((rows.J, self.rows[:, : rows.nv]))
        sizes = np.linalg.norm(both, axis=1)
        both = both / np.where(sizes > 0.0, sizes, 1.0)[:, None]
        left, values, _ = np.linalg.svd(both)
        nulls = left[:, np.count_nonzero(values > FAINT * values[0]) :]
        own = len(rows.J)
        shared = nulls[:, np.linalg.norm(nulls[own:], axis=0) > NAMED]
        if not shared.shape[1]:
            return ""
        loads = np.abs(shared[:own]).max(axis=1)
        names = [
            f"'{group.constraint.name}'"
            for group in rows.groups
            if loads[group.rows].max(initial=0.0) > NAMED * loads.max(initial=0.0) > 0.0
        ]
        if not names:
            return ""
        return (
            f"at t = {self.t:.4g} s joints of a loop stick by dry friction: the forces of "
            f"{' and '.join(dict.fromkeys(names))} and of these joints are not unique, others lead "
            "to the same motion"
        )
