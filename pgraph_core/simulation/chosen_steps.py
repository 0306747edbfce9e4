"""Steps that a method chooses by their error."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine.records import COUNTERS, CURSOR, STEP_CONTROL, table
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
        self._cursor, self._counters = table(CURSOR, 1), table(COUNTERS, 1)
        self.cursor, self.counters = self._cursor[0], self._counters[0]
        self._control = table(STEP_CONTROL, 1)
        self.control = self._control[0]
        self._set_control(mech)
        self.matrices = matrices(mech.nv) if method.implicit else NO_MATRICES
        self.events = no_events()
        self.parted = 0  # steps of given width that were taken in parts
        self.links = links_of(method.attempt)

    def _set_control(self, mech: Mechanism) -> None:
        control, given = self.control, self.tolerance
        control["rtol"], control["atol"] = given.rtol, given.atol
        control["widest"], control["span"] = given.widest, float(np.ptp(self.times))
        control["time"] = self.times[0]
        control["length"], control["last_error"] = length_of(mech), 1e-4
        control["jacobian_rate"], control["jacobian_time"] = np.inf, np.nan
        control["width"] = given.widest if given.fixed else 0.0
        control["most"], control["fixed"] = given.most, given.fixed

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
        end = self.control["time"] + self.tolerance.widest * (1 - 1e-9)
        self.control["fixed"], self.control["width"] = 0, PART * self.tolerance.widest
        code = at.RUNNING
        while code == at.RUNNING and self.control["time"] < end:
            code = self._attempts(scene, 1, out)
        self.control["fixed"] = 1
        return code

    def _take_back(self) -> None:
        """The frame of a failure is none."""
        moved = np.flatnonzero(self.times != self.plan.times)
        if len(moved):
            self.cursor["frame"] = moved[0]
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
            self._cursor, budget, plan.project, self.stages,
            (self._control, self._counters), self.matrices, self.flow, self.failure,
            self.events, out,
        )  # fmt: skip

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        self.cursor["frame"] -= 1
        self.control["fresh"] = self.control["filled"] = 0
        self.control["jacobian_rate"] = 2.0

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        return float(min(1.0, (self.control["time"] - self.times[0]) / self.control["span"]))


def no_events() -> tuple[int, int, Array, Ints, Ints, Ints]:
    """Events of a run that looks for none, as kernels take them."""
    none = np.zeros(0, dtype=np.int64)
    return 0, 0, np.zeros(0), none, none, np.zeros(1, dtype=np.int64)


def matrices(nv: int) -> tuple[Array, Any]:
    """Workspace of implicit methods."""
    real = np.zeros((3 * nv + implicit.ROWS, max(2 * nv, implicit.LEAST)))
    return real, np.zeros((nv + 2, max(2 * nv, 1)), dtype=np.complex128)
