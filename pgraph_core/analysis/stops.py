"""Bounds on lengths and on sums of coordinates, as constraints that hold where they act.

A string is a rod where it is taut, a tendon at its end is a coupling, and a cable without stretch
is a rope. Each force states the constraint that its bound becomes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..dynamics import Dynamics
from ..model import Constraint
from ..packing import Array, Ints
from ..tolerances import SOLVED
from .rows import Rows


class Stop(NamedTuple):
    """A bound of a force, and the constraint that holds where the bound acts."""

    label: str  # its name in sentences
    sign: float  # 1 for an upper bound, -1 for a lower one


class Stops:
    """The bounds of the forces of a mechanism, which has their constraints as inactive ones."""

    def __init__(self, mech: Dynamics):
        model, constraints = mech.model, []
        self.all: list[Stop] = []
        for f in model.forces:
            for sign, fields in f._stops(model.body):
                name = f"{f.kind} {f.name} {'high' if sign > 0 else 'low'} limit"
                self.all.append(Stop(f"the limit of {f.kind} '{f.name}'", sign))
                constraints.append(Constraint(name=name, active=False, **fields))
        self.first = len(model.constraints)  # index of their constraints in `mech`
        self.mech = mech
        if constraints:
            both = (*model.constraints, *constraints)
            self.mech = Dynamics(model.unchecked_copy({"constraints": both}))

    def indices(self, numbers: Iterable[int]) -> Ints:
        """Return the indices of their constraints."""
        return np.array([self.first + n for n in sorted(numbers)], dtype=np.int64)

    def rows(self, q: Array) -> list[tuple[Array, Array]]:
        """Return the room (m,) [m, rad] that each bound leaves at q (nq,), and its slopes (m, nv).

        The room is negative beyond the bound. A cable has a row for each of its segments.
        """
        if not self.all:
            return []
        rows = Rows.of(self.mech, self.indices(range(len(self.all))), q)
        found = []
        for stop, constraint in zip(self.all, rows.constraints):
            own = [g.rows for g in rows.groups if g.constraint is constraint]
            gap = np.concatenate([rows.gap[span] for span in own])
            slopes = np.concatenate([rows.J[span] for span in own])
            found.append((-stop.sign * gap, -stop.sign * slopes))
        return found

    def reached(self, q: Array) -> list[int]:
        """Return the numbers of the bounds that q (nq,) has reached or passed."""
        return [n for n, (room, _) in enumerate(self.rows(q)) if np.min(room) <= self._near]

    def passed(self, q: Array) -> frozenset[int]:
        """Return the number of the bound that q (nq,) passes most, in a set, or none."""
        rooms = [float(np.min(room)) for room, _ in self.rows(q)]
        least = min(rooms, default=0.0)
        return frozenset([rooms.index(least)] if least < -self._near else [])

    @property
    def _near(self) -> float:
        return SOLVED * max(1.0, self.mech.packed.length)
