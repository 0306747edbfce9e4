"""What takes an event-driven run on to its next event: steps of given or of chosen width."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.contact import phases
from ..engine.contact import sites as site_kernels
from ..engine.records import CLOCK, table
from ..engine.stepping import phase_dense, phase_events
from ..mechanism import Mechanism
from ..system import Array
from .chosen_steps import ChosenSteps
from .given_steps import GivenSteps
from .run_plan import RunPlan

TURNED = 0.03  # of √rtol: beyond it slow slip is turned as slowly as explicit steps can follow


class PhasedGivenSteps(GivenSteps):
    """Steps of given width; one that ends a phase is taken again, shorter."""

    blurred = 0.0  # part of the velocities that errors of a step may be
    turning = 0.0  # s in which friction may turn slow slip around: steps say it themselves

    def __init__(self, mech: Mechanism, plan: RunPlan, q: Array, v: Array):
        """Nothing is computed yet."""
        super().__init__(mech, plan, q, v)
        self.links = _links(motion.projection, plan.method.step)
        self._clock = table(CLOCK, 1)
        self.clock = self._clock[0]

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` steps and frames on; the kernel's status code, EVENT at `event`."""
        plan = self.plan
        return phase_events.run_phased(
            scene, self.links, plan.method.tableau[:3], self.schedule, self._cursor, budget,
            plan.project, self.q, self.v, self.stages, self.flow, self.ledger, self._counters,
            self.failure, out, self._clock,
        )  # fmt: skip

    @property
    def event(self) -> float:
        """When the last phase ended [s]."""
        return float(self.clock["event"])

    def go_on(self) -> None:
        """Take up from what an event has made of the state."""

    def scale(self, time: float) -> None:
        """Nothing here goes by the motion's own time."""


class PhasedChosenSteps(ChosenSteps):
    """Steps chosen by their error; one that ends a phase is cut there, on dense output."""

    def __init__(self, mech: Mechanism, plan: RunPlan, q: Array, v: Array):
        """Nothing is computed yet."""
        super().__init__(mech, plan, q, v)
        self.links = _links(phase_dense.phased_projection, plan.method.attempt)
        self.blurred = 0.0 if self.tolerance.fixed else self.tolerance.rtol
        look = address_of(phase_dense.look_for_phases)
        self.events = (look, 0, np.zeros(1), *self.events[3:])

    @property
    def event(self) -> float:
        """When the last phase ended [s]."""
        return float(self.control["time"])

    @property
    def turning(self) -> float:
        """Time in which friction may turn slow slip around [s]."""
        return float(self.events[2][0])

    def scale(self, time: float) -> None:
        """Friction turns slip of no account in a part of the motion's own time that rtol allows."""
        self.events[2][0] = TURNED * np.sqrt(self.tolerance.rtol) * time

    def go_on(self) -> None:
        """Take up from what an event has made of the state, at the width found before it."""
        self.control["fresh"] = self.control["filled"] = self.control["rejected"] = 0
        self.control["last_error"] = 1e-4


def phased_stepping(
    mech: Mechanism, plan: RunPlan, q: Array, v: Array
) -> PhasedGivenSteps | PhasedChosenSteps:
    """What the plan's method needs."""
    return (PhasedGivenSteps if plan.tolerance is None else PhasedChosenSteps)(mech, plan, q, v)


def _links(projection: Any, step: Any) -> tuple[int, ...]:
    kernels = (phases.phased_acceleration, projection, site_kernels.phased_record, step)
    return tuple(address_of(kernel) for kernel in kernels)
