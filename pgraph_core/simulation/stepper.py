"""A stepper that advances a mechanism under external control."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..dynamics.arguments import by_name, finite, refuse_as_torques, whole_number
from ..engine import layout as at
from ..engine.compiler.loading import cache_folder
from ..errors import InputError, Problem, explained, guarded, one_of, shown
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Model
from ..model.expressions import drives_read
from ..model.settings import STEP
from ..packing import Array
from ..packing.forces import on_bodies
from ..packing.signals import inputs_of_states
from ..portable import ReadOnly, put_back
from ..result import Result, Status
from ..result.records import Memory
from ..tolerances import SOLVED
from .continuing import state_of
from .fresh import Fresh, memory_of, plan_of_steps, set_up
from .inputs import Inputs
from .loop import Outcome, paced
from .options import Options, inputs_of, positive
from .readings import Readings
from .recorded import NO_ESTIMATE, notices, result_of, told
from .recording import Recording
from .start import by_names, torques_or_drives, with_state
from .switches import Change

if TYPE_CHECKING:
    from .one_step import LinearStep

ADDRESSES = ("address", "approach")  # fields of a run's guard that belong to this process


@guarded(
    q_or_v_or_t="write st.reset(q=..., v=...)",
    step_or_dt_or_h_or_method_or_scenario="make a new one, pg.Stepper(mech, step=..., method=...)",
    tau="give it to each step, st.step(tau=...)",
    other="make a new one of the changed model, pg.Stepper(pg.Mechanism(model))",
)
@explained
class Stepper(Readings):
    """A stepper, which advances a mechanism one or more steps at a time.

    The results are identical to `simulate` with the same method and step size, but no time is spent
    on set-up between steps. Steps of `dopri5` and `dop853` that are taken one by one agree to
    rounding, because forces are evaluated again at the start of each call.

    Parameters
    ----------
    mechanism : Mechanism or Model
        The system to step.
    step : float, optional
        Step size [s]. The default is the step of the scenario, or 1e-3.
    method : str, optional
        Name of a method, or "auto". The default is the method of the scenario, or "auto". They have
        the same meaning as in `simulate` with this step, except that rigid contacts and joint
        limits always use "moreau_jean".
    scenario, forces, inputs, stabilise :
        As in `simulate`.
    tau : (nv,) array, dict, callable or Feedback, optional
        Constant torques, or a function f(t, q, v), as in `simulate`.
    switches : sequence, optional
        As in `simulate`. Use () to ignore the switches of the scenario, and call `switch` instead.
    q, v : array or dict, optional
        Initial state. The default is the initial state of the scenario or model.
    states : array or dict, optional
        Initial states of the controls, as in `simulate`.
    start : Result, optional
        A run at whose end the stepper begins, as in `simulate`.
    t_start : float
        Start time [s].

    Raises
    ------
    InputError
        If an argument is invalid, or if the constraints cannot be satisfied in the initial state.

    Examples
    --------
    Note that `q` and `v` are views that change with each step, so use `st.q.copy()` to keep them.

        st = pg.Stepper(mech, step=1e-3)
        while st.t < 2.0:
            st.step(tau=-5 * st.q - 0.1 * st.v)
    """

    mech: Mechanism
    method: str
    status: Status
    message: str
    _piece = 1  # steps that take about PIECE
    _fresh: Fresh | None = None

    def __init__(
        self,
        mechanism: Mechanism | Model,
        *,
        step: float | None = None,
        method: str | None = None,
        scenario: str | None = None,
        tau: npt.ArrayLike | Callable[[float, Array, Array], Any] | None = None,
        forces: Sequence[Force] = (),
        inputs: Mapping[str, float] | None = None,
        stabilise: str | None = "project",
        switches: Sequence[Any] | None = None,
        q: Any = None,
        v: Any = None,
        states: Any = None,
        start: Result | None = None,
        t_start: float = 0.0,
    ):
        """Start at (q, v), by default the initial state of the scenario or of the model."""
        mech = mechanism_of(mechanism, "Stepper")
        given = mech.model.scenario(scenario) if scenario is not None else None
        if step is None:
            step = (given.step if given is not None else None) or STEP
        for s in given.switches if given is not None and switches is None else ():
            if s.t is None or s.t > t_start:
                then = f"when {s.when}" if s.t is None else f"at t = {s.t:g} s"
                text = f"scenario '{scenario}' switches '{s.constraint}' {then}, which no step "
                text += "does by itself; give switches=(), and call `switch` of a Stepper there"
                raise InputError(Problem("Stepper", "scenario", text))
        self._tau = None
        if tau is not None:
            mech, forces, self._tau = torques_or_drives(mech, forces, tau)
        memory = None
        if start is not None:
            replaced = {"q": q, "v": v, "states": states, "t_start": t_start or None}
            q, v, states, t_start, memory = state_of(mech, start, "Stepper", replaced)
        vars(self).update(mech=mech)
        self._width = positive("step", step, call="Stepper")
        self._options = Options.unchecked(
            scenario=scenario,
            method=method,
            step=self._width,
            frames=2,
            stabilise=stabilise,
            forces=tuple(forces),
            switches=None if switches is None else tuple(switches),
            inputs=inputs_of(inputs, "Stepper"),
            memory=memory,
        )
        self._started = float(t_start)
        self._state = (None, None, None) if start is None else (q, v, states)
        self.reset(*([] if start is not None else (q, v, states)))

    @property
    def tau(self) -> Any:
        """The torques passed to the constructor, as an array, a function or None."""
        return self._tau

    @property
    def notices(self) -> tuple[str, ...]:
        """Warnings about the steps taken so far."""
        if not self.status.ok:
            return told(self._record)  # contacts tell of the step that was not taken
        record = self._record if self._recording else self._seen()
        return notices(record)

    def __repr__(self) -> str:
        name, width = self.mech.model.name, self._width
        return f"<Stepper of '{name}': t = {self.t:g} s, {self.method}, steps of {width:g} s>"

    # -- steps -----------------------------------------------------------------------------------

    def reset(self, q: Any = None, v: Any = None, states: Any = None) -> None:
        """Restart at t_start.

        A stepper that began at the end of a run begins there again if no state is given. Inputs
        and targets are reset to their initial values.

        Parameters
        ----------
        q, v : array_like or dict, optional
            Configuration and velocity, as for `simulate`. The default is the initial state.
        states : array_like or dict, optional
            States of the controls, as for `simulate`. The default is given by the model.

        Raises
        ------
        InputError
            If the state is invalid, or if the constraints cannot be satisfied.
        """
        own = q is None and v is None and states is None
        q, v, states = self._state if own else (q, v, states)
        q, v = by_names(self.mech, self._options.scenario, q, v, self._tau)
        self._begin(self._started, q, v, states, self._options.memory if own else None)

    def step(
        self,
        tau: npt.ArrayLike | None = None,
        n: int = 1,
        *,
        inputs: Mapping[str, float] | None = None,
    ) -> Status:
        """Take n steps and return the status of the run.

        Steps may be divided near soft or penalty contacts, but the time always advances by n full
        steps. If a step fails, the state does not change, and `status` and `message` contain the
        reason.

        Parameters
        ----------
        tau : array_like (nv,) or dict, optional
            Torques [N·m, N] that replace those given at the start.
        n : int, optional
            Number of steps.
        inputs : dict, optional
            New values of inputs by name, as for `input`.

        Raises
        ------
        InputError
            If a previous step failed and neither `reset` nor `restore` was called.

        Examples
        --------
        >>> stepper = pg.Stepper(pg.Model.serial(2), step=1e-3)
        >>> while stepper.t < 0.5:
        ...     status = stepper.step(tau=-0.1 * stepper.v)
        """
        if type(n) is not int or n < 1:
            n = whole_number("Stepper", "n", n, 1)
        self._refuse_failed("step")
        checked = () if inputs is None else self._inputs.all_checked(inputs)
        self._give(tau)
        for name, value in checked:
            self._put(name, value)
        if self._recording:
            self._open()
        vars(self)["_looked"] = False
        if (touching := self._record.scene.touching) is not None:
            touching.tally["elapsed"] = 0.0
        steps, left, code = self._steps, n, at.RUNNING
        end = steps.taken + n  # near stiff contacts a step is taken in parts
        while code == at.RUNNING and left > 0:
            piece, began = min(left, self._piece), time.perf_counter()
            with self._record.uninterrupted():
                code = steps.advance(piece)
                if code != at.RUNNING:
                    self._fail(code)
            left = end - steps.taken
            if left > 0:
                self._piece = paced(piece, time.perf_counter() - began)
        return self.status

    def record(self, n: int, frames: int | None = None, tau: Any = None) -> Result:
        """Take n steps and return them as a Result.

        Counters, work and dissipation only refer to these steps.

        Parameters
        ----------
        n : int
            Number of steps.
        frames : int, optional
            Number of evenly spaced frames to record. By default, every step is recorded.
        tau : array_like (nv,) or dict, optional
            Torques [N·m, N], as for `step`.

        Raises
        ------
        InputError
            If a previous step failed and neither `reset` nor `restore` was called.
        """
        n = whole_number("Stepper", "n", n, 1)
        return self._recorded("record", n, self._width, frames, tau)

    def because(self, why: str) -> None:
        """Set the reason for the choice of method, as shown in the headers of later records."""
        record = self._record
        record.plan = replace(record.plan, header={**record.plan.header, "why": why})

    def record_over(self, dt: float, frames: int | None = None, tau: Any = None) -> Result:
        """Advance by a duration and return the steps as a Result.

        Parameters
        ----------
        dt : float
            Duration [s]. If it is not a multiple of the step size, smaller steps are used.
        frames, tau
            As for `record`.

        Raises
        ------
        InputError
            If a previous step failed and neither `reset` nor `restore` was called.
        """
        dt = positive("dt", dt, call="Stepper.record_over")
        n = max(1, math.ceil(dt / self._width - SOLVED))
        whole = abs(n * self._width - dt) <= SOLVED * self._width
        return self._recorded("record_over", n, self._width if whole else dt / n, frames, tau)

    def _recorded(self, call: str, n: int, width: float, frames: int | None, tau: Any) -> Result:
        self._refuse_failed(call)
        before = time.perf_counter()
        k = np.arange(n + 1)
        if frames is not None and whole_number("Stepper", "frames", frames, 2) <= n:
            k = np.unique(np.round(np.linspace(0, n, frames)).astype(np.int64))
        control = self._steps.control
        times = control["clock"]["time"] + k * width
        if width == self._width:  # the same times as without recording
            times = control["ends"]["origin"] + (control["ends"]["taken"] + k) * width
        times[0] = control["clock"]["time"]
        self._give(tau)
        self._record.extend(times, np.diff(k), np.full(len(k) - 1, width))
        self._recording, self._looked = True, False
        built = time.perf_counter()
        self._record.advance_to_end(None)
        stepped = time.perf_counter()
        self._ended(self._record.ended)
        timing = {"build": built - before, "step": stepped - built}
        return result_of(self._record, NO_ESTIMATE, timing)

    def linearise(
        self, tau: npt.ArrayLike | None = None, *, inputs: Sequence[str] | None = None
    ) -> LinearStep:
        """Return the discrete dynamics of the next step, δx⁺ = A δx + B δu, exact to rounding.

        Joint limits and joint friction are included. If a derivative does not exist, for example at
        the onset of slip, the corresponding entries are nan and `notices` gives the reason.

        Parameters
        ----------
        tau : array_like (nv,) or dict, optional
            Torques of the step [N·m, N], as for `step`.
        inputs : sequence of str, optional
            Names of the inputs u. By default, u contains the torques of all joints.

        Returns
        -------
        LinearStep
            The matrices A (2 nv, 2 nv) and B (2 nv, len(inputs) or nv), and warnings. The vector x
            contains the changes of coordinates and velocities, with small rotations [rad] for ball
            and free joints.

        Raises
        ------
        InputError
            If an input is unknown, or if the model has elements without derivatives.
        """
        from .one_step import linear_step

        chosen = {}
        for name in inputs or ():
            self._inputs.checked(name, self.inputs.get(name, 0.0))
            chosen[name] = self._inputs.known[name].acts()
        acting = self._tau if callable(self._tau) else self._record.scene.given.copy()
        torques = acting if tau is None else by_name(self.mech, "tau", tau)
        return linear_step(self._record, self.options_of_step, self.width, torques, chosen)

    # -- changes between steps -------------------------------------------------------------------

    def switch(self, constraint: str, active: bool) -> None:
        """Switch a constraint on or off.

        When a constraint is switched on, it is satisfied immediately by an impulse.

        Parameters
        ----------
        constraint : str
            Name of the constraint.
        active : bool
            Whether the constraint is active from now on.

        Raises
        ------
        InputError
            If the name is unknown, if the constraint cannot be satisfied, or if a previous step
            failed.
        """
        self._refuse_failed("switch")
        names = [c.name for c in self.mech.model.constraints]
        if constraint not in names:
            text = f"no constraint is named {shown(constraint)}; {one_of(names)}"
            raise InputError(Problem("Stepper.switch", "constraint", text))
        number = names.index(constraint)
        if (number in self._active) == bool(active):
            return
        now = self._active | {number} if active else self._active - {number}
        one = np.array([number])
        none = one[:0]
        acting = np.array(sorted(now), dtype=np.int64)
        on, off = (one, none) if active else (none, one)
        before = self._content()
        try:
            self._record.switching.apply_now(Change(self.t, acting, on, off))
        except InputError:
            self._restore(before)
            raise
        self._active, self._looked = now, False

    @property
    def inputs(self) -> dict[str, float]:
        """Constant inputs of motors, servos and actuators, by name."""
        return ReadOnly(
            self._inputs.values(), "Stepper.inputs", "write st.step(inputs={name: value})"
        )

    def input(self, name: str, value: float) -> None:
        """Set an input, which stays constant until `reset`.

        Parameters
        ----------
        name : str
            Name of a motor, servo or actuator.
        value : float
            Value of the input, in its unit.

        Raises
        ------
        InputError
            If the name is unknown, or the value is outside the range of the input.
        """
        self._put(name, self._inputs.checked(name, value))

    def _put(self, name: str, x: float) -> None:
        """Set an input to x from now on."""
        self._inputs.put(name, x, self.t)
        self._steps.anew()
        self._looked = False

    def target(self, servo: str, value: float) -> None:
        """Set the target of a servo, which stays constant until `reset`.

        Parameters
        ----------
        servo : str
            Name of the servo.
        value : float
            Target [rad, m].

        Raises
        ------
        InputError
            If the name is unknown or the value is not finite.
        """
        self._inputs.aim(servo, value)
        self._steps.anew()
        self._looked = False

    # -- snapshots -------------------------------------------------------------------------------

    GIVEN = ("mech", "method", "_width", "_options", "_tau", "_started", "_state")

    def _folder(self) -> Any:
        return cache_folder()

    def _words(self) -> tuple[str, ...]:
        return self._key, ",".join(map(str, sorted(self._active)))

    def _renew(self) -> None:
        self.reset()

    def _resume(self, words: list[str], state: memoryview, memory: list[Array]) -> None:
        active = words[0].split(",") if len(words) == 1 and words[0] else []
        if len(words) != 1 or not {*active} <= {*map(str, range(len(self.mech.model.constraints)))}:
            text = "names constraints that this mechanism does not have"
            raise InputError(Problem("Stepper.restore", "snapshot", text))
        guard = self._steps.guard
        here = {name: guard[name] for name in ADDRESSES}
        self._active = {*map(int, active)}
        self._record.scene.activate(np.array(sorted(self._active), dtype=np.int64))
        put_back(state, memory)
        for name, address in here.items():
            guard[name] = address
        self._record.ended = Outcome()
        self._ended(Outcome())
        self._open()
        self._record.bound()  # the width of a step is not taken from a snapshot

    # -- inside ----------------------------------------------------------------------------------

    def _begin(self, t: float, q: Any, v: Any, states: Any, memory: Memory | None) -> None:
        mech, tau = self.mech, self._tau
        options = self._options.changed(t_start=t, t_end=t + self._width, memory=memory)
        plan = plan_of_steps(mech, options, tau, q, v)
        vars(self).update(method=plan.method.name)
        state = with_state(mech, plan.start, q, v, t)
        tau = plan.tau if tau is None else tau
        fresh = self._fresh if states is None else None
        if fresh is not None and fresh.fits(self._record, plan):
            self._record = fresh.again(self._record, state, tau)
        else:
            self._record, self._forces = set_up(mech, options, plan, state, states, tau)
            self._fresh = Fresh.of(self._record, plan) if states is None else None
            self._look_up()
        self._active = set(plan.active.tolist())
        if not self._record.begin():
            raise InputError(Problem("Stepper.reset", "q", self._record.ended.message))
        self._own = self._record.scene.given[: mech.nv].copy()
        self._ended(Outcome())
        self._open()

    def _look_up(self) -> None:
        """Look up the state and the inputs in the tables of a new run."""
        mech, forces, plan = self.mech, self._forces, self._record.plan
        self._steps = steps = self._record.steps
        vars(self).pop("_clearance", None)  # belongs to the old tables
        self._q, self._v, self._x = steps.q[: mech.nq], steps.v[: mech.nv], steps.v[mech.nv :]
        for view in (self._q, self._v, self._x):
            view.flags.writeable = False
        carriers = [[mech.topology.number(x) for x in f.pair] for f in on_bodies(forces)]
        self._carriers = np.array(carriers, dtype=np.int64).reshape(-1, 2)
        parts = (*forces, *mech.model.controls)
        read = {name for part in parts for name in drives_read(part)}
        self._inputs = Inputs(forces, plan.drives, plan.loads, read)
        rows = inputs_of_states(mech.model, plan.loads.signals[2])
        self._inputs.add_of_states(forces, plan.loads.signals[0], rows)

    @cached_property
    def _key(self) -> str:
        """Return a key that identifies the mechanism and the options of a snapshot."""
        given = self._options
        own = (self.method, self._width, given.scenario, given.forces, given.stabilise)
        words = (self.mech.model.hash, *map(repr, own))
        return sha256("\n".join(words).encode()).hexdigest()[:16]

    @property
    def recording(self) -> Recording:
        """The underlying run, with its scene and its steps."""
        return self._record

    @property
    def options_of_step(self) -> Options:
        """The options of a run over the next step."""
        return self._options.changed(t_start=self.t, t_end=self.t + self._width)

    @property
    def width(self) -> float:
        """The step size [s]."""
        return self._width

    @property
    def servos(self) -> dict[str, int]:
        """Return {name: knot of the constant target} for the servos."""
        return self._inputs.servos

    def _refuse_failed(self, call: str) -> None:
        """Raise InputError after a step that failed, whose state does not change any more."""
        if self.status is not Status.DONE and not self.status.ok:
            text = f"the last step failed: {self.message}; call reset or restore"
            raise InputError(Problem(f"Stepper.{call}", "", text))

    def _fail(self, code: int) -> None:
        try:
            self._record.fail(code)  # its frame is the state of which the message tells
        finally:
            self._ended(self._record.ended)
            self._open()

    def _ended(self, how: Outcome) -> None:
        vars(self).update(status=how.status, message=how.message)

    def _give(self, tau: Any) -> None:
        """Set the torques for the next steps. Raises InputError."""
        given = self._own
        if tau is not None:
            refuse_as_torques(tau, "Stepper")
            tau = by_name(self.mech, "tau", tau)
            given = finite("tau", tau, self.mech.nv, of=self.mech.packed)
        self._record.scene.given[: self.mech.nv] = given
        self._steps.anew()

    def _memory(self) -> list[Array]:
        self._open()
        return memory_of(self._record)
