"""A stepper that advances a mechanism under external control."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from hashlib import sha256
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..dynamics.arguments import by_name, finite, whole_number
from ..dynamics.states import Sensors, bodies_over, no_motion
from ..engine import layout as at
from ..engine import motion as kernels
from ..engine.compiler.loading import cache_folder
from ..errors import InputError, Problem, explained, guarded, one_of, shown
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Model
from ..model.expressions import drives_read
from ..model.settings import STEP
from ..packing import Array
from ..packing.forces import drive_forces, on_bodies
from ..packing.signals import values_of
from ..portable import ReadOnly, Snapshots, put_back
from ..result import Result, Status
from ..result.bodies import add_constraint_wrenches
from ..result.records import OF_CONSTRAINTS, OF_DRIVES, ByTouch, Memory, Named
from ..tolerances import SOLVED
from .continuing import state_of
from .inputs import Inputs
from .loop import Outcome
from .options import Options, begun, driven, inputs_of, positive
from .plan import begun_with, plan_of, with_contacts
from .recorded import NO_ESTIMATE, notices, result_of, told
from .recording import Recording
from .start import by_names, given_states, torques_or_drives, with_state
from .switches import Change

if TYPE_CHECKING:
    from .clearance import Clearance
    from .one_step import LinearStep

STEPS_BETWEEN_LOOKS = 100_000  # steps between two looks at whether the user wants to stop
ADDRESSES = ("address", "approach")  # fields of a run's guard that belong to this process


@guarded(
    q_or_v_or_t="write st.reset(q=..., v=...)",
    step_or_dt_or_h_or_method_or_scenario="make a new one, pg.Stepper(mech, step=..., method=...)",
    tau="give it to each step, st.step(tau=...)",
    other="make a new one of the changed model, pg.Stepper(pg.Mechanism(model))",
)
@explained
class Stepper(Snapshots):
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

    # -- the state -------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time [s]."""
        return float(self._steps.clock["time"])

    @property
    def q(self) -> Array:
        """The current configuration (nq,), as a read-only view."""
        return self._q

    @property
    def v(self) -> Array:
        """The current velocity (nv,), as a read-only view."""
        return self._v

    @property
    def states(self) -> Array:
        """The current states (nx,) of the controls, as a read-only view."""
        return self._x

    @property
    def controls(self) -> Mapping[str, float]:
        """The current values of the controls, {control: value}."""
        state = np.array([self.t]), self._steps.q[None], self._steps.v[None]
        found = values_of(self.mech.model, self.mech.packed, self._forces, *state)
        return Named({name: float(x[0]) for name, x in found.items()}, "controls", "control")

    @property
    def vdot(self) -> Array:
        """The current acceleration (nv,), with the contact and limit forces of the last step."""
        return self._seen().out.vdot[0, : self.mech.nv].copy()

    @property
    def energy(self) -> tuple[float, float]:
        """The (kinetic, potential) energy, including springs [J]."""
        kinetic, potential = self._seen().out.energies[0, :2].tolist()
        return kinetic, potential

    @property
    def contact_force(self) -> Mapping[str, Array]:
        """Contact wrenches {contact pair: (6,) [torque, force]} on the body at its origin [N m, N],
        world axes.

        With time stepping, these are means over the last call of `step`. Two body names are
        accepted as well, as in `Result`.
        """

        def on_other(wrench: Array, a: str, b: str) -> Array:
            origins = (self.mech.pose(self._q, name)[0] for name in (a, b))
            arm = np.subtract(*origins)
            return -np.concatenate((wrench[:3] + np.cross(arm, wrench[3:]), wrench[3:]))

        found = self._touches(
            lambda pair: np.concatenate((pair["mean_torque"], pair["mean_force"]))
        )
        return ByTouch(found, "contact_force", self.mech.model, sum, on_other)

    @property
    def contact_gap(self) -> Mapping[str, float]:
        """Minimum gaps {contact pair: gap} [m] at the present state, negative for penetration."""
        return ByTouch(self._gaps(), "contact_gap", self.mech.model, min)

    def _gaps(self) -> dict[str, float]:
        """Return the gaps of contact pairs at the present state of the run."""
        contacts = self._record.plan.contacts
        if contacts is None:
            return {}
        found = self._clearance.gaps(self._record.scene, self._steps.q[None], len(contacts.touches))
        return {touch.name: gap for touch, gap in zip(contacts.touches, found[0].tolist())}

    @cached_property
    def _clearance(self) -> Clearance:
        from .clearance import Clearance

        assert self._record.plan.contacts is not None
        return Clearance(self.mech, self._record.plan.contacts)

    @property
    def constraint_force(self) -> Mapping[str, Array]:
        """Constraint wrenches {constraint: (6,)} on `body` at `point` [N m, N], world axes.

        With time stepping, these are means over the last call of `step`.
        """
        record = self._seen()
        wrenches = record.out.wrenches[0, :, -kernels.MEANS :].copy()
        return Named(record.scene.forces(wrenches), *OF_CONSTRAINTS)

    @property
    def drive_force(self) -> Mapping[str, float]:
        """The current {drive: torque or force} of motors, servos and actuators [N m, N].

        As in `Result`, they are within their limits and before the gear.
        """
        plan, state = self._record.plan, (self._steps.q[None], self._steps.v[None])
        found = drive_forces(plan.drives, plan.loads.signals, np.array([self.t]), *state)
        return Named(dict(zip(plan.driving, found[0].tolist())), *OF_DRIVES)

    @property
    def outputs(self) -> Mapping[str, Any]:
        """Readings {output: value}, each a number or an array (3,) or (4,). See `Output`."""
        out, sensors = self._seen().out, self._sensors
        states = out.q[:1], out.v[:1], out.vdot[:1]
        motion = no_motion(1)
        if sensors.moves:
            external = self._on_bodies() if sensors.loads else self._no_loads
            motion = bodies_over(self.mech.packed.system, *states, external)
        read = sensors.read(*states[:2], motion, self.pushes)[0]
        return Named(sensors.by_name(read), "outputs", "output")

    @property
    def pushes(self) -> Array:
        """Wrenches of contacts on bodies (1, nb, 6) at the state, or empty without contacts."""
        return self._seen().out.pushes[:1]

    @cached_property
    def _sensors(self) -> Sensors:
        return Sensors(self.mech.packed, self.mech.model)

    @cached_property
    def _no_loads(self) -> Array:
        return np.zeros((1, self.mech.nb, 6))

    def look_again(self) -> None:
        """Evaluate forces again when they are next read, after a change of the run's memory."""
        vars(self)["_looked"] = False

    def _on_bodies(self) -> Array:
        """Return the wrenches on bodies from forces, contacts and constraints at the state, (1, nb,
        6)."""
        record, packed = self._seen(), self.mech.packed
        external, out = np.zeros((1, self.mech.nb, 6)), record.out
        if len(self._carriers):
            state = self.t, out.q[0], out.v[0], external[0]
            kernels.load_wrenches(record.scene.address, *packed.system[2:4], *state)
        if out.pushes.size:
            external += out.pushes[:1]
        if record.scene.active[0]:
            states = out.q[:1], out.v[:1], out.vdot[:1]
            forces = record.scene.forces(out.wrenches[0, :, : kernels.MEANS])
            moved = bodies_over(packed.system, *states, external)
            each = {name: wrench[None] for name, wrench in forces.items()}
            add_constraint_wrenches(self.mech, each, moved, external)
        return external

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
        if self.status is not Status.DONE and not self.status.ok:
            text = f"the last step failed: {self.message}; call reset or restore"
            raise InputError(Problem("Stepper.step", "", text))
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
            code = steps.advance(min(left, STEPS_BETWEEN_LOOKS))
            left = end - steps.taken
        if code != at.RUNNING:
            self._record.fail(code)  # its frame is the state of which the message tells
            self._ended(self._record.ended)
            self._open()
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
        """
        return self._recorded(whole_number("Stepper", "n", n, 1), self._width, frames, tau)

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
        """
        dt = positive("dt", dt, call="Stepper.record_over")
        n = max(1, math.ceil(dt / self._width - SOLVED))
        whole = abs(n * self._width - dt) <= SOLVED * self._width
        return self._recorded(n, self._width if whole else dt / n, frames, tau)

    def _recorded(self, n: int, width: float, frames: int | None, tau: Any) -> Result:
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
            _, knot, _, slope, _ = self._inputs.known[name]
            chosen[name] = knot, slope
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
            If the name is unknown, or if the constraint cannot be satisfied.
        """
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
        mech, tau, name = self.mech, self._tau, self._options.scenario
        given = mech.model.scenario(name) if name is not None else None
        options = self._options.changed(t_start=t, t_end=t + self._width, memory=memory)
        plan = with_contacts(plan_of(mech, options, tau, q, v))
        if plan.contact_points and options.method is None:
            plan = with_contacts(plan_of(mech, options.changed(method="moreau_jean"), tau, q, v))
        elif plan.contact_points:
            text = f"{options.method} is event-driven for rigid contacts and limits, which a "
            text += "Stepper does not support; choose 'moreau_jean', or use simulate"
            raise InputError(Problem("Stepper", "method", text))
        vars(self).update(method=plan.method.name)
        state = with_state(mech, plan.start, q, v, t)
        forces = (*mech.model.forces, *(given.forces if given else ()), *self._options.forces)
        if self._options.inputs:
            forces = driven(forces, self._options.inputs, "Stepper", t)
        forces = begun(forces, t)
        drives = plan.drives._replace(knots=plan.drives.knots.copy())
        whole = np.arange(len(mech.model.constraints))
        bent = plan.method.order > 1
        loads = mech.packed.loads(forces, states=True, bent=bent, touching=bent and plan.yields)
        plan = replace(plan, drives=drives, loads=loads, ever=whole)
        if states is not None:
            plan = begun_with(plan, given_states(mech, states))
        tau = plan.tau if tau is None else tau
        self._record = Recording(mech, plan, *state, tau)
        self._steps, scene = self._record.steps, self._record.scene
        self._record.plan = replace(self._record.plan, drives=scene.drives, loads=scene.loads)
        self._active = set(plan.active.tolist())
        if not self._record.begin():
            raise InputError(Problem("Stepper.reset", "q", self._record.ended.message))
        vars(self).pop("_clearance", None)  # belongs to the old tables
        self._own = self._record.scene.given[: mech.nv].copy()
        self._q, self._v = self._steps.q[: mech.nq], self._steps.v[: mech.nv]
        self._x = self._steps.v[mech.nv :]
        for view in (self._q, self._v, self._x):
            view.flags.writeable = False
        carriers = [[mech.topology.number(x) for x in f.pair] for f in on_bodies(forces)]
        self._carriers = np.array(carriers, dtype=np.int64).reshape(-1, 2)
        self._forces = forces
        parts = (*forces, *mech.model.controls)
        read = {name for part in parts for name in drives_read(part)}
        self._inputs = Inputs(forces, self._record.plan.drives, read)
        self._ended(Outcome())
        self._open()

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

    def _ended(self, how: Outcome) -> None:
        vars(self).update(status=how.status, message=how.message)

    def _give(self, tau: Any) -> None:
        """Set the torques for the next steps. Raises InputError."""
        given = self._own
        if tau is not None:
            refuse_as_torques(tau, "Stepper")
            given = finite("tau", by_name(self.mech, "tau", tau), self.mech.nv)
        self._record.scene.given[: self.mech.nv] = given
        self._steps.anew()

    def _open(self) -> None:
        """Continue without scheduled frames."""
        self._steps.open_ended(self._width)
        self._recording, self._looked = False, False

    def _seen(self) -> Recording:
        """Return the recording with the present state as its only frame."""
        if self._recording:
            self._open()
        if not self._looked:
            self._record.look()
            self._looked = True
        return self._record

    def _touches(self, value: Any) -> dict[str, Any]:
        plan = self._record.plan
        if plan.contacts is None:
            return {}
        pairs = self._seen().out.pairs[0]
        return {touch.name: value(pair) for touch, pair in zip(plan.contacts.touches, pairs)}

    def _memory(self) -> list[Array]:
        self._open()
        scene, steps = self._record.scene, self._steps
        found = [steps.control_table, steps.counters_table, steps.stages, *steps.memory]
        found += [scene.given]
        found += [scene.active, scene.blocks.blocks_f, self._record.plan.drives.knots, *scene.space]
        if scene.touching is not None:
            found += scene.touching.memory
        if self._record.user is not None:
            found += self._record.user.memory
        return found


def refuse_as_torques(tau: Any, call: str) -> None:
    """Raise InputError if `step` receives a function or a count in place of torques."""
    text = ""
    if callable(tau):
        text = f"must be numbers; a function of (t, q, v) goes to pg.{call}(..., tau=function)"
    elif isinstance(tau, Integral):
        text = f"are torques, an array; for {tau} steps write step(n={tau})"
    if text:
        raise InputError(Problem(f"{call}.step", "tau", text))
