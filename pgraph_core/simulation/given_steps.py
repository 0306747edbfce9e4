"""Steps of given width between frames."""

from __future__ import annotations

import numpy as np

from ..engine.records import COUNTERS, CURSOR, table
from ..engine.stepping import run
from ..mechanism import Mechanism
from ..system import Array, Ints
from .links import links_of
from .run_plan import RunPlan


class GivenSteps:
    """Steps of given width between frames."""

    def __init__(self, mech: Mechanism, plan: RunPlan, q: Array, v: Array):
        """Nothing is computed yet."""
        self.plan = plan
        self.q, self.v, self.times = q.copy(), v.copy(), plan.times.copy()
        self.stop = len(plan.times)
        self.stages = np.zeros((5 + 2 * plan.method.evaluations, max(mech.nq, mech.nv)))
        self.flow, self.ledger, self.failure = np.zeros(3), np.zeros(2), np.zeros(2)
        self._cursor, self._counters = table(CURSOR, 1), table(COUNTERS, 1)
        self.cursor, self.counters = self._cursor[0], self._counters[0]
        self.links = links_of(plan.method.step)

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` steps and frames on; the kernel's status code."""
        plan = self.plan
        return run.run(
            scene, self.links, plan.method.tableau[:3], self.schedule, self._cursor, budget,
            plan.project, self.q, self.v, self.stages, self.flow, self.ledger, self._counters,
            self.failure, out,
        )  # fmt: skip

    @property
    def schedule(self) -> tuple[Array, Ints, Array]:
        """Times, substeps and width up to where it stops."""
        last = self.stop - 1
        return self.times[: self.stop], self.plan.substeps[:last], self.plan.width[:last]

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        self.cursor["frame"] -= 1
        i = int(self.cursor["frame"])
        self.cursor["taken"] = self.plan.substeps[i - 1]

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        frame, taken = self.cursor.item()
        last = len(self.times) - 1
        part = taken / self.plan.substeps[frame - 1] if 0 < frame <= last else 0.0
        return float(min(1.0, max(0.0, frame - 1 + part) / max(last, 1)))

    def notices(self) -> list[str]:
        """Nothing: every step is as wide as asked for."""
        return []
