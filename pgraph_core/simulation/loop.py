"""The stepping loop of a run: its state, its given or chosen steps, and how it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import Frames, Run, RunLinks
from ..engine.arrays import Tableau as Coefficients
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.records import (
    ALWAYS,
    COUNTERS,
    METHOD,
    STEP_CONTROL,
    offsets,
    rows_of,
    table,
)
from ..engine.signals import SAMPLE
from ..engine.stepping import run
from ..engine.stepping.control import clock, ends, error, guard, newton
from ..errors import InputError
from ..integrators import METHODS, Method
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.programs import count_of_edges, count_of_held
from ..result import Status
from ..result.records import Event
from ..tolerances import SOLVED
from .options import FRAMES, MOST_CHOSEN, RTOL, STEPS_ALLOWED
from .plan import MANY_STEPS, keep
from .run_plan import RunPlan, Way

if TYPE_CHECKING:
    from .clearance import Clearance
    from .monitors import Watch

NO_MATRICES = (np.zeros((0, 0)), np.zeros((0, 0), dtype=np.complex128))
NO_EVENTS = np.zeros(0, dtype=np.int64)
ANY_NUMBER = (1 << 63) - 1  # limit on steps if none is given
UNCOUNTED = 1 << 62  # steps to the next frame if none is recorded
TAKEN, FRESH, FRAME = (offsets(STEP_CONTROL)[x] // 8 for x in ("taken", "fresh", "frame"))
PIECE = 0.02  # s of computation between two looks at Ctrl+C, and between two calls of `progress`
TURNED = 0.03  # limit on how fast friction may rotate the slip direction, relative to √rtol


def paced(steps: int, seconds: float) -> int:
    """Return how many steps take about PIECE if `steps` have taken `seconds`, up to four times as
    many."""
    return max(1, min(STEPS_ALLOWED, int(steps * PIECE / max(seconds, 0.25 * PIECE))))


class Steps:
    """The state of a run in progress, which `advance` continues."""

    carried: Any = None  # a `sensitivity.Carried`, which computes derivatives
    finer: Workplace | None = None  # left by the finer run of the last run

    def __init__(self, plan: RunPlan, q: Array, v: Array, frames: tuple[Array, ...]):
        """Start at (q, v) and record states in `frames`."""
        nq, nv = len(q), len(v)
        self.plan, self.tolerance = plan, plan.tolerance
        self.times = plan.times.copy()  # if a run fails, its last frame gets another time
        count = max(_stages(plan), _stages(plan.way or plan))
        self.stages = np.zeros((at.STAGE + count, nq + nv + 2))
        y = self.stages[at.Y]
        self.q, self.v, self.ledger = y[:nq], y[nq : nq + nv], y[nq + nv :]
        self.q[:], self.v[:] = q, v
        self.control_table, self.counters_table = table(STEP_CONTROL, 1), table(COUNTERS, 1)
        self.control, self.counters = self.control_table[0], self.counters_table[0]
        self.clock, self.error, self.ends, self.guard, self.newton = (
            self.control[name] for name in ("clock", "error", "ends", "guard", "newton")
        )
        self._begin()
        self.frames = frames
        self.clearance: Clearance | None = None  # guard of shapes that may touch
        # signs and values of events, kept between scenes
        self._signs, self._values = NO_EVENTS, np.full(1, -1.0)
        self._buffer = buffer()
        self.address = address_of_array(self._buffer)

    def _begin(self) -> None:
        control, plan, given = self.control, self.plan, self.tolerance
        control["nq"], control["nv"] = len(self.q), len(self.v)
        lags = plan.drives.table["lag"]
        code, _, states = plan.loads.signals
        lag, samples = lags[lags > 0.0].min(initial=np.inf), states[:, SAMPLE] >= 0
        ends.begin(
            self.ends, self.times[0], plan.parts, lag, int(samples.sum()), count_of_edges(code)
        )
        error.begin(self.error, plan.length, plan.project)
        guard.begin(self.guard)
        newton.begin(self.newton)
        span = self.times[-1] - self.times[0]
        if given is not None:
            clock.begin(self.clock, self.times, span, given.most)
            error.choose_widths(self.error, given.rtol, given.atol, given.widest)
            return
        assert plan.step is not None, "a run without a tolerance has a step"
        if plan.method.implicit:  # solved to a speed that no Stepper knows from its end
            span = FRAMES * plan.step
        clock.begin(self.clock, self.times, span, ANY_NUMBER)
        guard.set_turning(self.guard, plan.step / plan.parts)
        measured = plan.method.implicit or plan.method.adaptive
        error.take_given_widths(self.error, SOLVED if measured else 0.0)

    def join(
        self, scene: int, links: RunLinks, watched: Array, wanted: Ints = NO_EVENTS, user: int = 0
    ) -> None:
        """Step the scene at this address.

        `watched` (ROWS, 3 points + user events) contains the event monitors, and `wanted` the
        directions of the user events (-1 falling, 1 rising, 0 both). `user` is the address of the
        function that evaluates them, or 0. Events are due after every step, but for conditions that
        a guard watches.
        """
        always = user or watched.shape[1] > len(wanted)
        guard.set_due(self.guard, ALWAYS if always else 0)
        plan, method = self.plan, self.plan.method
        matrices = _matrices(method, len(self.v)) if method.implicit else NO_MATRICES
        if method.starts and count_of_held(plan.loads.signals[0]):
            from ..engine.stepping.crossings import cross

            links = links._replace(cross=address_of(cross))
        self.links = links
        if len(self._signs) != len(wanted):
            self._signs = np.zeros(len(wanted), dtype=np.int64)
            self._values = np.full(len(wanted) + 1, -1.0)  # -1: not reached
        self._values[-1] = user
        self._kept = Run(
            scene, links, Coefficients(*method.tableau), _method(method.name), self.times,
            plan.substeps.copy(), plan.width.copy(), plan.corners, self.stages, *matrices,
            self.control_table, self.counters_table, np.zeros(3), watched,
            self._signs, wanted, self._values, self.frames,
        )  # fmt: skip
        control, counters = (x.view(np.int64) for x in (self.control_table, self.counters_table))
        self._words = control, counters, control.copy()  # numpy is slow at copies of records
        run.save_run(self._buffer, unnamed(self._kept))

    def extend(self, plan: RunPlan, frames: tuple[Array, ...]) -> None:
        """Continue with the given steps of another plan, recording in `frames`."""
        self.plan, n = plan, len(plan.times)
        clock.set_frames(self.clock, 0, n)
        self.counters_table[:] = 0
        self.ledger[:] = 0.0
        kept = self._kept
        if n > len(kept.times) or frames is not kept.out:
            times, substeps, width = plan.times.copy(), plan.substeps.copy(), plan.width.copy()
            self._kept = kept._replace(times=times, substeps=substeps, width=width, out=frames)
            self.times = times
            run.save_run(self._buffer, unnamed(self._kept))
        else:  # saving a run costs as much as a few steps
            kept.times[:n], kept.substeps[: n - 1] = plan.times, plan.substeps
            kept.width[: n - 1] = plan.width

    @property
    def kept(self) -> Run:
        """The run as kernels take it."""
        return self._kept

    @property
    def taken(self) -> int:
        """Return the number of steps of this size since the origin."""
        return self._words[0].item(TAKEN)

    @property
    def recorded(self) -> int:
        """Return the number of recorded frames."""
        return self._words[0].item(FRAME)

    def anew(self) -> None:
        """Re-evaluate the acceleration after forces have changed."""
        self._words[0][FRESH] = 0

    def control_of_duals(self) -> Any:
        """Return a copy of the control for derivatives, which repeat steps and look for nothing."""
        control = self.control_table.copy()
        clock.forget(control["clock"])
        guard.set_addresses(control["guard"], {"address": 0})
        error.choose_widths(control["error"])  # not used
        return control

    def search_again(self) -> None:
        """Search for the clearance again at the next look."""
        guard.check_again(self.guard)

    def factor_again(self) -> None:
        """Evaluate the Jacobian of an implicit method again if it converges slowly."""
        newton.factor_again(self.newton)

    def end_at(self, frames: int) -> None:
        """Go on until this number of frames is recorded."""
        clock.set_frames(self.clock, self.recorded, frames)

    def count_frames(self, frames: int) -> None:
        """Set the number of frames that are recorded already."""
        clock.set_frames(self.clock, frames, self.clock["last"])

    def forget_event(self) -> None:
        """Do not report what ended the last step."""
        guard.forget_event(self.guard)

    def guarded_by(self, **addresses: int) -> None:
        """Set addresses of what looks at steps, by the names in GUARD_STATE."""
        guard.set_addresses(self.guard, addresses)

    @property
    def watched(self) -> Array:
        """The event monitors, (4, 3 points + user events)."""
        return self._kept.watched

    def forget_sides(self, numbers: Sequence[int]) -> None:
        """Reset the known signs of these events' values, so that they are determined again."""
        self._signs[numbers] = 0

    def begin_again(self, q: Array, v: Array) -> None:
        """Restart the same steps from another state, for runs that store no history."""
        control, counters, start = self._words
        control[:], counters[:], self._signs[:] = start, 0, 0
        self.q[:], self.v[:], self.ledger[:], self.times[:] = q, v, 0.0, self.plan.times
        self.stages[at.WEIGHT] = self.stages[at.UNSWITCHED] = 0.0

    def rehearse(self, tally: Any, pairs: Any) -> None:
        """Take a trial step of time stepping to obtain the forces for frame 0.

        A frame has the forces of the step that ends there; the first frame has the forces of the
        step that begins there. If an impact occurs in that step, its impulse is applied at the end.
        `tally` (1,) is the tally of the contacts, and `pairs` are the forces of contacts.
        """
        from ..engine.contact.contacts import FROZEN

        before = tally.copy(), self.counters_table.copy()
        first = self.plan.width[0] if self.tolerance is None else self.times[1] - self.times[0]
        self.plan.method.kernel(
            self.address, min(float(first), float(self.error["widest"]) or np.inf)
        )
        hit = tally["cuts"][0] > before[0]["cuts"][0]
        tally[:], self.counters_table[:] = before
        pairs["mean_force"], pairs["mean_torque"] = pairs["force"], pairs["torque"]
        tally["frozen"] = 0 if hit else FROZEN

    def solve_tighter(self) -> None:
        """Solve the equations of given implicit steps to the tolerance of half the step."""
        if self.tolerance is None:
            error.tighten(self.error, self.plan.method.gain)

    def open_ended(self, width: float) -> None:
        """Continue with steps of this size, without frames."""
        if self.error["widest"] != width:
            error.set_width(self.error, width)
            ends.start_count(self.ends, self.clock["time"])
        clock.set_frames(self.clock, 1, 2)
        self.anew()
        ends.set_left(self.ends, UNCOUNTED)
        kept = self._kept
        kept.times[:2] = self.clock["time"], np.inf
        kept.substeps[0], kept.width[0] = UNCOUNTED, width

    @property
    def memory(self) -> list[Array]:
        """Return the memory of implicit methods: accelerations, the Jacobian and its factors."""
        return [self.stages[at.STAGE :], self._kept.real] if self.plan.method.implicit else []

    @property
    def given(self) -> tuple[Array, Ints, Array]:
        """Return the frame times and the given steps between them in the kernel's format."""
        return self._kept.times, self._kept.substeps, self._kept.width

    def advance(self, budget: int) -> int:
        """Attempt at most `budget` steps and frames. Returns the kernel's status code."""
        if self.carried is not None:
            return self.carried.advance(self.address, budget)
        return run.advance_run(self.address, budget)

    @property
    def divided(self) -> int:
        """The number of given steps whose equations did not converge, so that they were divided."""
        given = self.tolerance is None and self.plan.method.implicit
        return int(self.counters["rejected_steps"]) if given else 0

    @property
    def blurred(self) -> float:
        """The fraction of the velocities that may be due to step errors."""
        return self.tolerance.rtol if self.tolerance is not None else 0.0

    def scale(self, time: float) -> None:
        """Let adaptive steps redirect slip that is negligible within a fraction of `time` [s]."""
        if self.tolerance is not None:
            guard.set_turning(self.guard, TURNED * np.sqrt(self.tolerance.rtol) * time)

    def go_on(self) -> None:
        """Continue from the state after an event, using the last step size before the event."""
        clock.forget(self.clock)
        error.begin_again(self.error)

    def note_switch(self, t: float, v: Array) -> None:
        """Let what touches at t rebound from the velocities v, before constraints were switched."""
        from ..engine.stepping.moreau import WAITS

        self.stages[at.UNSWITCHED, len(self.q) :] = *v, t, WAITS

    def restart(self) -> None:
        """Continue with a changed state or changed equations, recording the last frame again."""
        clock.set_frames(self.clock, self.recorded - 1, self.clock["last"])
        clock.forget(self.clock)
        self.factor_again()

    def go_another_way(self, plan: RunPlan, frames: Frames) -> None:
        """Continue with the method and steps of `plan`, in the scene provided next by `join`.

        Frames, counters and the energy ledger continue.
        """
        before, given = self.control.copy(), self.tolerance is None
        self.plan, self.tolerance, self.frames = plan, plan.tolerance, tuple(frames)
        self.control_table[:] = 0
        for row in range(len(self.stages)):
            if row != at.Y:
                self.stages[row] = 0.0
        self._begin()
        frame = int(before["clock"]["frame"])
        clock.go_on(self.clock, before["clock"])
        error.go_on(self.error, before["error"])
        ends.start_count(self.ends, before["clock"]["time"])
        if self.tolerance is not None:
            return
        if given:
            ends.go_on(self.ends, before["ends"])
            error.set_width(self.error, before["error"]["widest"])
            return
        left = float(self.times[frame] - self.clock["time"])
        count = max(int(np.ceil(left / plan.width.max() - 1e-9)), 1)
        ends.set_left(self.ends, count)
        error.set_width(self.error, left / count)

    def fraction(self) -> float:
        """The completed fraction of the run, 0 to 1."""
        first, last = self.times[0], self.times[-1]
        return float(min(1.0, (self.clock["time"] - first) / (last - first)))

    def crawl(self) -> str:
        """Return a message if the run would need more than MANY_STEPS at its current step sizes.

        This check starts after √MANY_STEPS steps, because an initial transient may require small
        steps.
        """
        n, given = int(self.counters["steps"]), self.tolerance
        if given is None or n * n < MANY_STEPS or n <= MANY_STEPS * self.fraction():
            return ""
        count, t = n / max(self.fraction(), 1.0 / MOST_CHOSEN), float(self.clock["time"])
        width = (t - float(self.times[0])) / n
        what = f"rtol={RTOL:g}, the default" if given.rtol < RTOL else "a larger rtol"
        stiff = "" if self.plan.method.implicit else ", or method='radau5' if it is stiff"
        return (
            f"at t = {t:.4g} s the run takes steps of {width:.2g} s, {count:.2g} in all: give "
            f"{what}{stiff}. A tolerance near rounding gains no digits"
        )

    def notices(self) -> list[str]:
        """Return a notice about fixed steps that were divided, some of them repeatedly."""
        count = self.divided
        if count == 0:
            return []
        times = "once" if count == 1 else f"{count} times"
        return [
            f"the equations of steps of {self.plan.step:.4g} s did not converge {times}, for "
            "example because forces change or oscillate quickly, so these steps were divided"
        ]


class Workplace(NamedTuple):
    """A scene with its stepping loop and frames. A short run passes it on to the next run.

    Creating them takes longer than some tens of steps. A workplace is used by one run at a time.
    """

    scene: Scene
    steps: Steps
    out: Frames
    watch: Watch | None  # conditions that compiled steps know


def free(mech: Mechanism, what: Any) -> list[Any]:
    """Return the pool of idle workspaces for `what`, stored on the mechanism."""
    kept: dict[Any, list[Any]] = mech.__dict__.setdefault("_left_by_runs", {})
    found = kept.get(what)
    return keep(kept, what, []) if found is None else found


def taken(mech: Mechanism, what: Any) -> Any:
    """Take an idle workspace for `what`, or return None if there is none. Threads share them."""
    try:
        return mech.__dict__["_left_by_runs"][what].pop()
    except (KeyError, IndexError):
        return None


@dataclass(eq=False, slots=True)
class Outcome:
    """The status, the notices and the events of a run, which is not over until it is stopped."""

    status: Status = Status.DONE
    message: str = Status.DONE.value
    ok: bool = True
    over: bool = False  # something has ended the run early
    notices: list[str] = field(default_factory=list[str])
    log: list[Event] = field(default_factory=list[Event])

    def stop(self, status: Status, message: str) -> None:
        """End the run."""
        self.status, self.message, self.ok, self.over = status, message, status.ok, True

    def refuse(self, refused: InputError) -> None:
        """End the run since constraints cannot be met."""
        self.stop(Status.CANNOT_CLOSE, f"{Status.CANNOT_CLOSE.value}: {refused}")


@cache
def links_of(name: str, event_driven: bool, watched: bool = False, held: bool = True) -> RunLinks:
    """Return the addresses of the kernels called by a run with this method.

    Without constraints (`held`), the projection kernel is not loaded, because its compilation is
    slow.
    """
    method = METHODS[name]
    if watched:
        from ..engine.stepping.events import look_back, user_events

        events = {"look_back": address_of(look_back), "events": address_of(user_events)}
        return links_of(name, event_driven, held=held)._replace(**events)
    if not event_driven:
        project = address_of(motion.projection) if held else 0
        accelerate, record = address_of(motion.acceleration), address_of(motion.record)
        return RunLinks(accelerate, project, record, address_of(method.kernel))
    from ..engine.contact.phases import event_acceleration
    from ..engine.contact.points import event_record
    from ..engine.stepping.events import event_projection, look_back

    kernels = (event_acceleration, event_projection, event_record, method.kernel, look_back)
    return RunLinks(*map(address_of, kernels))


def _stages(way: Way) -> int:
    """Count the stages required by the method."""
    tableau = way.method.tableau
    return max(len(tableau.c), len(tableau.dense), 1)


@cache
def _method(name: str) -> Any:
    """Return the method record for the stepping loop."""
    method = METHODS[name]
    ends = method.tableau.dense.size > 0
    return rows_of(METHOD, [(method.order, method.starts, ends, *method.controller)])


def _matrices(method: Method, nv: int) -> tuple[Array, Any]:
    """Allocate the workspace for an implicit method."""
    from ..engine.stepping.implicit import LEAST_COLUMNS

    real = np.zeros((method.matrix_rows(nv), max(2 * nv, LEAST_COLUMNS)))
    return real, np.zeros((nv + 2, max(2 * nv, 1)), dtype=np.complex128)
