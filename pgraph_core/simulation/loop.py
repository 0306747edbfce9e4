"""The stepping loop: fixed steps, and adaptive steps chosen by their error."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.records import CLOCK, COUNTERS, CURSOR, STEP_CONTROL, table
from ..engine.stepping import adaptive, implicit, run
from ..mechanism import Mechanism
from ..packing.system import Array, Ints
from ..result import Status
from ..result.contact_record import Event
from .plan import Plan

NO_MATRICES = (np.zeros((0, 0)), np.zeros((0, 0), dtype=np.complex128))
PART = 0.25  # of a step that could not be solved: the first width that is tried
TURNED = 0.03  # of √rtol: slow slip is turned no faster than explicit steps can follow


def steps_of(mech: Mechanism, plan: Plan, q: Array, v: Array) -> FixedSteps | AdaptiveSteps:
    """The stepping loop of a plan, at the state (q, v)."""
    return (FixedSteps if plan.tolerance is None else AdaptiveSteps)(mech, plan, q, v)


class FixedSteps:
    """Fixed steps between frames. With events, a step that ends a phase is repeated, shorter."""

    blurred = 0.0  # part of the velocities that errors of a step may be
    turning = 0.0  # [s] in which friction may turn slow slip around; 0: the width of the step

    def __init__(self, mech: Mechanism, plan: Plan, q: Array, v: Array):
        """Nothing is computed yet."""
        self.plan = plan
        self.q, self.v = q.copy(), v.copy()
        self.times = plan.times.copy()  # if a run fails, its last frame gets another time
        self.stop = len(plan.times)  # number of frames until which it goes on
        self.stages = np.zeros((5 + 2 * plan.method.evaluations, max(mech.nq, mech.nv)))
        self.flow, self.ledger, self.failure = np.zeros(3), np.zeros(2), np.zeros(2)
        self._cursor, self._counters, self._clock = (
            table(kind, 1) for kind in (CURSOR, COUNTERS, CLOCK)
        )
        self.cursor, self.counters = self._cursor[0], self._counters[0]
        self.links = links_of(plan.method.step, motion.projection, bool(plan.contact_points))

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """Take at most `budget` steps and frames; the kernel's status code."""
        plan, last = self.plan, self.stop - 1
        schedule = (self.times[: self.stop], plan.substeps[:last], plan.width[:last])
        given = (
            scene, self.links, plan.method.tableau[:3], schedule, self._cursor, budget,
            plan.project, self.q, self.v, self.stages, self.flow, self.ledger, self._counters,
            self.failure, out,
        )  # fmt: skip
        if not plan.contact_points:
            return run.run(*given)
        from ..engine.stepping import phase_events

        return phase_events.run_events(*given, self._clock)

    @property
    def event(self) -> float:
        """Time of the last event [s]."""
        return float(self._clock["event"][0])

    def go_on(self) -> None:
        """Continue from the state after an event."""

    def scale(self, time: float) -> None:
        """Take note of the motion's own time [s]."""

    def restart(self) -> None:
        """Continue with a changed state or changed equations; the last frame is recorded again."""
        self.cursor["frame"] -= 1
        self.cursor["taken"] = self.plan.substeps[self.cursor["frame"] - 1]

    def fraction(self) -> float:
        """Fraction of the run that is done, 0 to 1."""
        frame, taken = int(self.cursor["frame"]), int(self.cursor["taken"])
        last = len(self.times) - 1
        part = taken / self.plan.substeps[frame - 1] if 0 < frame <= last else 0.0
        return float(min(1.0, max(0.0, frame - 1 + part) / max(last, 1)))

    def notices(self) -> list[str]:
        """Nothing: every step is as wide as asked for."""
        return []


class AdaptiveSteps:
    """Steps chosen by their error, frames and events on dense output."""

    def __init__(self, mech: Mechanism, plan: Plan, q: Array, v: Array):
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
        self._cursor, self._counters, self._control = (
            table(kind, 1) for kind in (CURSOR, COUNTERS, STEP_CONTROL)
        )
        self.cursor, self.counters = self._cursor[0], self._counters[0]
        self.control = self._control[0]
        self._set_control()
        self.matrices = _matrices(mech.nv) if method.implicit else NO_MATRICES
        self.events: Any = _no_events()
        project, event_driven = motion.projection, bool(plan.contact_points)
        if event_driven:
            from ..engine.stepping import phase_dense

            project = phase_dense.event_projection
            look = address_of(phase_dense.look_for_phases)
            self.events = (look, 0, np.zeros(1), *self.events[3:])
        self.links = links_of(method.attempt, project, event_driven)
        self.blurred = 0.0 if self.tolerance.fixed else self.tolerance.rtol
        self.divided = 0  # steps of fixed width that were taken in parts

    def _set_control(self) -> None:
        control, given = self.control, self.tolerance
        control["rtol"], control["atol"] = given.rtol, given.atol
        control["widest"], control["span"] = given.widest, self.times[-1] - self.times[0]
        control["time"] = self.times[0]
        control["length"], control["last_error"] = self.plan.length, 1e-4
        control["jacobian_rate"], control["jacobian_time"] = np.inf, np.nan
        control["width"] = given.widest if given.fixed else 0.0
        control["most"], control["fixed"] = given.most, given.fixed

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """Make at most `budget` attempts and frames; the kernel's status code."""
        code = self._attempts(scene, budget, out)
        if code == at.NOT_SOLVED and self.tolerance.fixed:
            return self._in_parts(scene, out)
        return code

    def _in_parts(self, scene: int, out: tuple[Array, ...]) -> int:
        """Divide a fixed step that could not be solved into steps of the method's own choice."""
        self._take_back()
        self.divided += 1
        end = self.control["time"] + self.tolerance.widest * (1 - 1e-9)
        self.control["fixed"], self.control["width"] = 0, PART * self.tolerance.widest
        code = at.RUNNING
        while code == at.RUNNING and self.control["time"] < end:
            code = self._attempts(scene, 1, out)
        self.control["fixed"] = 1
        return code

    def _take_back(self) -> None:
        """Remove the frame of a failure."""
        moved = np.flatnonzero(self.times != self.plan.times)
        if len(moved):
            self.cursor["frame"] = moved[0]
            self.times[moved] = self.plan.times[moved]

    def _attempts(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        plan, method = self.plan, self.plan.method
        return adaptive.run_adaptive(
            scene, self.links, tuple(method.tableau), method.controller, method.order, self.size,
            self.times[: self.stop], self.tolerance.corners, self._cursor, budget, plan.project,
            self.stages, (self._control, self._counters), self.matrices, self.flow,
            self.failure, self.events, out,
        )  # fmt: skip

    @property
    def event(self) -> float:
        """Time of the last event [s]."""
        return float(self.control["time"])

    @property
    def turning(self) -> float:
        """Time in which friction may turn slow slip around [s]."""
        return float(self.events[2][0])

    def scale(self, time: float) -> None:
        """Let friction turn negligible slip within a part of the motion's own time [s]."""
        self.events[2][0] = TURNED * np.sqrt(self.tolerance.rtol) * time

    def go_on(self) -> None:
        """Continue from the state after an event, at the width found before it."""
        self.control["fresh"] = self.control["filled"] = self.control["rejected"] = 0
        self.control["last_error"] = 1e-4

    def restart(self) -> None:
        """Continue with a changed state or changed equations; the last frame is recorded again."""
        self.cursor["frame"] -= 1
        self.control["fresh"] = self.control["filled"] = 0
        self.control["jacobian_rate"] = 2.0

    def fraction(self) -> float:
        """Fraction of the run that is done, 0 to 1."""
        return float(min(1.0, (self.control["time"] - self.times[0]) / self.control["span"]))

    def notices(self) -> list[str]:
        """A notice of the fixed steps that were divided."""
        if self.divided == 0:
            return []
        of = "1 step" if self.divided == 1 else f"{self.divided} steps"
        return [
            f"the equations of {of} of {self.tolerance.widest:.4g} s could not be solved at once, "
            "as where friction sets in: narrower ones were taken there"
        ]


class Outcome:
    """How a run ended, its notices, and its events so far."""

    def __init__(self) -> None:
        """The run has reached its end, until something stops it."""
        self.status, self.message, self.ok = Status.DONE, Status.DONE.value, True
        self.notices: list[str] = []
        self.log: list[Event] = []

    def stop(self, status: Status, message: str) -> None:
        """End the run."""
        self.status, self.message, self.ok = status, message, status.ok


@cache
def links_of(step: Any, project: Any, event_driven: bool) -> tuple[int, ...]:
    """Addresses of the kernels that a step calls: acceleration, projection, record, step."""
    accelerate, record = motion.acceleration, motion.record
    if event_driven:
        from ..engine.contact.phases import event_acceleration as accelerate
        from ..engine.contact.points import event_record as record
    return tuple(address_of(kernel) for kernel in (accelerate, project, record, step))


def _no_events() -> tuple[int, int, Array, Ints, Ints, Ints]:
    none = np.zeros(0, dtype=np.int64)
    return 0, 0, np.zeros(0), none, none, np.zeros(1, dtype=np.int64)


def _matrices(nv: int) -> tuple[Array, Any]:
    """Workspace of implicit methods."""
    real = np.zeros((3 * nv + implicit.ROWS, max(2 * nv, implicit.LEAST)))
    return real, np.zeros((nv + 2, max(2 * nv, 1)), dtype=np.complex128)
