"""Steps that a method chooses by their error."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine.stepping import adaptive, implicit
from ..mechanism import Mechanism
from ..mechanism.scale import length_of
from ..system import Array, Ints
from .links import links_of
from .run_plan import RunPlan

NO_MATRICES = (np.zeros((0, 0)), np.zeros((0, 0), dtype=np.complex128))
PART = 0.25  # of a step that could not be solved: what is tried first


class ChosenSteps:
    """Steps chosen by their error, frames on dense output."""

    def __init__(self, mech: Mechanism, plan: RunPlan, q: Array, v: Array):
        """Nothing is computed yet."""
        assert plan.tolerance is not None
        self.plan, self.tolerance = plan, plan.tolerance
        method, self.size = plan.method, (mech.nq, mech.nv)
        count = max(len(method.tableau.c), len(method.tableau.dense))
        self.stages = np.zeros((at.STAGE + count, mech.nq + mech.nv + 2))
        self.q = self.stages[at.Y, : mech.nq]
        self.v = self.stages[at.Y, mech.nq : mech.nq + mech.nv]
        self.ledger = self.stages[at.Y, mech.nq + mech.nv :]
        self.q[:], self.v[:], self.times = q, v, plan.times.copy()
        self.stop = len(plan.times)
        self.flow, self.failure = np.zeros(3), np.zeros(2)
        self.cursor = np.zeros(2, dtype=np.int64)
        self.counters = np.zeros(at.COUNTERS, dtype=np.int64)
        self.flags = np.zeros(at.FLAGS, dtype=np.int64)
        self.control = self._control(mech)
        self.flags[at.MOST], self.flags[at.FIXED] = self.tolerance.most, self.tolerance.fixed
        self.matrices = matrices(mech.nv) if method.implicit else NO_MATRICES
        self.events = no_events()
        self.parted = 0  # steps of given width that were taken in parts
        self.links = links_of(method.attempt)

    def _control(self, mech: Mechanism) -> Array:
        control, given = np.zeros(at.CONTROL), self.tolerance
        control[at.RTOL], control[at.ATOL] = given.rtol, given.atol
        control[at.WIDEST], control[at.SPAN] = given.widest, float(np.ptp(self.times))
        control[at.TIME] = self.times[0]
        control[at.LENGTH], control[at.LAST_ERROR] = length_of(mech), 1e-4
        control[at.JACOBIAN_RATE], control[at.JACOBIAN_AT] = np.inf, np.nan
        control[at.WIDTH] = given.widest if given.fixed else 0.0
        return control

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` attempts and frames on; the kernel's status code."""
        code = self._attempts(scene, budget, out)
        if code == at.NOT_SOLVED and self.tolerance.fixed:
            return self._in_parts(scene, out)
        return code

    def _in_parts(self, scene: int, out: tuple[Array, ...]) -> int:
        """A step of given width that could not be solved, in steps of the method's own choice."""
        self._take_back()
        self.parted += 1
        end = self.control[at.TIME] + self.tolerance.widest * (1 - 1e-9)
        self.flags[at.FIXED], self.control[at.WIDTH] = 0, PART * self.tolerance.widest
        code = at.RUNNING
        while code == at.RUNNING and self.control[at.TIME] < end:
            code = self._attempts(scene, 1, out)
        self.flags[at.FIXED] = 1
        return code

    def _take_back(self) -> None:
        """The frame of a failure is none."""
        moved = np.flatnonzero(self.times != self.plan.times)
        if len(moved):
            self.cursor[at.FRAME] = moved[0]
            self.times[moved] = self.plan.times[moved]

    def notices(self) -> list[str]:
        """How many steps were taken in parts."""
        if self.parted == 0:
            return []
        of = "1 step" if self.parted == 1 else f"{self.parted} steps"
        return [
            f"the equations of {of} of {self.tolerance.widest:.4g} s could not be solved at once, "
            "as where friction sets in: narrower ones were taken there"
        ]

    def _attempts(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        plan = self.plan
        return adaptive.run_adaptive(
            scene, self.links, tuple(plan.method.tableau), plan.method.controller,
            plan.method.order, self.size, self.times[: self.stop], self.tolerance.corners,
            self.cursor, budget, plan.project, self.stages,
            (self.control, self.flags, self.counters), self.matrices, self.flow, self.failure,
            self.events, out,
        )  # fmt: skip

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        self.cursor[at.FRAME] -= 1
        self.flags[at.FRESH] = self.flags[at.FILLED] = 0
        self.control[at.JACOBIAN_RATE] = 2.0

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        return float(min(1.0, (self.control[at.TIME] - self.times[0]) / self.control[at.SPAN]))


def no_events() -> tuple[int, int, Array, Ints, Ints, Ints]:
    """Events of a run that looks for none, as kernels take them."""
    none = np.zeros(0, dtype=np.int64)
    return 0, 0, np.zeros(0), none, none, np.zeros(1, dtype=np.int64)


def matrices(nv: int) -> tuple[Array, Any]:
    """Workspace of implicit methods."""
    real = np.zeros((3 * nv + implicit.ROWS, max(2 * nv, implicit.LEAST)))
    return real, np.zeros((nv + 2, max(2 * nv, 1)), dtype=np.complex128)
