"""BatchStepper: step many instances of one mechanism together under external control."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from hashlib import sha256
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..dynamics.arguments import (
    by_name,
    names_in,
    positions,
    refuse_as_torques,
    rows_by_name,
    whole_number,
)
from ..dynamics.states import Sensors, bodies_over, no_motion
from ..engine import layout as at
from ..engine.compiler.loading import cache_folder
from ..errors import InputError, PgraphError, explained, guarded, one_of, shown
from ..forces import OnJoint
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Model
from ..packing import Array, Ints, System
from ..portable import Snapshots, put_back
from ..result.records import OF_DRIVES, OF_PATHS, Named
from ..simulation.failures import STATUS
from ..simulation.paths import Path, with_numbers
from ..simulation.recorded import told
from ..simulation.stepper import Stepper
from .arguments import chosen_in, compiled, kinds_of, numbers_of, places_in, refused, values_of
from .instances import (
    Instances,
    TreeLanes,
    Worker,
    fits_lanes,
    number_arrays,
    state_arrays,
    words_of,
)
from .lanes import FeetLanes, on_feet

CALL = "BatchStepper"
MOST_COPIES = 10_000_000  # instances


@guarded(
    q_or_v_or_t="write batch.reset(q, v)",
    step_or_dt_or_h_or_method_or_scenario_or_size_or_threads=(
        "make a new one, pg.BatchStepper(mech, size, step=..., method=...)"
    ),
    tau="give it to each step, batch.step(tau)",
    other="numbers of the description are given as set={path: values}",
)
@explained
class BatchStepper(Snapshots):
    """A stepper for many instances of a mechanism.

    Trees, closed loops and contacts are supported. The results are identical to the results of
    individual `Stepper` objects and do not depend on the number of threads or instances. An
    exception are free trees that differ in their bodies or in the targets of servos without a
    limit. Such instances are computed in SIMD lanes, and the results agree to rounding. A failed
    instance remains at its last valid state until it is reset, and is listed in `failures`.

    Parameters
    ----------
    mechanism : Mechanism or Model
        The system to step.
    size : int
        Number of instances.
    step, method, scenario, forces, stabilise, switches :
        As in `Stepper`. All instances use the same values.
    tau : (nv,) or (size, nv) array, dict, or callable, optional
        Constant torques, or a function of (t, q, v) compiled with `numba.njit`.
    threads : int, optional
        Number of threads. By default, one per core is used.
    set : dict, optional
        Fields that differ between instances, as a dictionary that maps paths (see `sweep`) to one
        value per instance. Longer lists contain additional values, which can be selected with
        `reset(numbers=...)`. No other fields are changed.

    Raises
    ------
    InputError
        If an argument is invalid.

    Examples
    --------
    Sixty-four robots with trunks of 8 to 12 kg:

        batch = pg.BatchStepper(mech, 64, set={"bodies.trunk.mass": np.linspace(8, 12, 64)})
        for _ in range(1000):
            batch.step(-5 * batch.q - 0.1 * batch.v)
    """

    mech: Mechanism
    size: int
    threads: int
    method: str

    def __init__(
        self,
        mechanism: Mechanism | Model,
        size: int,
        *,
        step: float | None = None,
        method: str | None = None,
        scenario: str | None = None,
        tau: npt.ArrayLike | Callable[[float, Array, Array], Any] | None = None,
        forces: Sequence[Force] = (),
        stabilise: str | None = "project",
        switches: Sequence[Any] | None = None,
        threads: int | None = None,
        set: Mapping[Any, Any] | None = None,
    ):
        """Start each instance at the initial state of the scenario, or of the model."""
        mech = mechanism_of(mechanism, "BatchStepper")
        cores = (os.cpu_count() or 1) if threads is None else threads
        counts = {
            "size": whole_number(CALL, "size", size, 1, MOST_COPIES),
            "threads": whole_number(CALL, "threads", cores, 1),
        }
        vars(self).update(mech=mech, **counts)
        self._options: dict[str, Any] = {
            "step": step, "method": method, "scenario": scenario, "forces": tuple(forces),
            "stabilise": stabilise, "switches": switches,
        }  # fmt: skip
        own = tau is not None and not callable(tau) and np.ndim(tau) == 2
        self._options["tau"] = None if own else compiled(tau, bool(set))
        self._set = {} if set is None else values_of(mech.model, set, self.size, self._options)
        self._begin()
        given = self._many.given[:, : mech.nv].copy()
        self._tau = numbers_of("tau", tau, self.size, mech.nv) if own else given

    def _begin(self) -> None:
        """Build the tables and set every instance to its initial state."""
        kinds, self._entries = kinds_of(self._set, self.size)
        first, starts, numbers, varying = _tables(self._noted(kinds))
        record = first.recording
        self._pushed = len(record.scene.active) > 1 or record.scene.touching is not None
        self._pushed |= record.plan.loads.number > 0
        made = [first]
        for _ in range(min(self.threads, self.size) - 1):
            made.append(Stepper(Mechanism(first.mech.model), **self._options))
        workers = [Worker(stepper, varying) for stepper in made]
        tables = starts, numbers, self._entries[: self.size].copy(), workers
        if fits_lanes(first, varying):
            self._many: Instances = TreeLanes(*tables)
            self._many.prepare(varying)
        elif on_feet(first):
            self._many = FeetLanes(*tables)
            self._many.prepare()
        else:
            self._many = Instances(*tables)
        vars(self)["method"] = first.method

    def _noted(self, kinds: Array) -> Iterator[Stepper]:
        """Yield the steppers, saving their output data before steps share the arrays."""
        self._sensed: list[tuple[Sensors, System]] = []
        self._told: dict[str, list[int]] = {}
        for kind, stepper in enumerate(self._steppers(kinds)):
            for text in told(stepper.recording):
                self._told.setdefault(text, []).append(kind)
            if self.mech.model.outputs or not self._sensed:
                packed = stepper.mech.packed
                system: Any = System._make(a.copy() for a in packed.system)
                self._sensed.append((Sensors(packed, stepper.mech.model), system))
            yield stepper

    def _steppers(self, kinds: Array) -> Iterator[Stepper]:
        """Create one stepper for each row of values (kinds, paths), all with the same method."""
        paths = [Path(self.mech.model, path, "BatchStepper") for path in self._set]
        options = self._options
        for i, row in enumerate(kinds.tolist()):
            try:
                model = with_numbers(self.mech.model, paths, row)
                made = Stepper(Mechanism(model), **options)
                options = {**options, "method": made.method}
                yield made
            except PgraphError as error:
                if not paths:
                    raise
                first = int(np.flatnonzero(self._entries == i)[0])
                said = ", ".join(f"{p.text} = {x:.9g}" for p, x in zip(paths, row))
                raise refused("set", f"entry {first} ({said}): {error}") from None

    # -- the state -------------------------------------------------------------------------------

    @property
    def t(self) -> Array:
        """(size,) times [s]."""
        return self._many.control["clock"]["time"].copy()

    @property
    def q(self) -> Array:
        """Current configurations (size, nq), as a read-only view.

        NumPy refuses `st.q[0, 0] = 1`. To restart an instance at other values, write `q =
        st.q[:1].copy(); q[0, 0] = 1; st.reset(q=q, v=st.v[:1], which=[0])`.
        """
        return _read_only(self._many.q[:, : self.mech.nq])

    @property
    def v(self) -> Array:
        """Current velocities (size, nv), as a read-only view."""
        return _read_only(self._many.v[:, : self.mech.nv])

    @property
    def states(self) -> Array:
        """Current states of the controls (size, nx), as a read-only view."""
        return _read_only(self._many.v[:, self.mech.nv :])

    @property
    def work(self) -> Array:
        """Work done by motors, servos and given torques since the start (size,) [J]."""
        return self._many.ledger[:, at.WORK_DONE].copy()

    @property
    def ok(self) -> NDArray[np.bool_]:
        """A boolean mask (size,) of the instances that are still running."""
        return self._many.codes == at.RUNNING

    @property
    def failures(self) -> dict[int, str]:
        """The failed instances as {instance: reason}."""
        failed, control = np.flatnonzero(~self.ok), self._many.control
        return {i: self._reason(int(self._many.codes[i]), control[i]) for i in failed.tolist()}

    @property
    def notices(self) -> dict[str, Ints]:
        """Warnings about the models and initial states, {message: (n,) indices of instances}."""
        kind = self._many.kind
        found = {text: np.flatnonzero(np.isin(kind, own)) for text, own in self._told.items()}
        return {text: which for text, which in found.items() if len(which)}

    def _reason(self, code: int, control: Any) -> str:
        moved = self.mech.packed.moved_fastest(int(control["clock"]["fastest"]))
        where = f"at t = {control['clock']['failed']:.6g} s; {moved}"
        return f"{STATUS[code].value} {where}"

    @property
    def contact_force(self) -> Mapping[str, Array]:
        """Contact wrenches as {contact pair: (size, 6) [torque, force]} at the body origin, in
        world axes [N m, N].

        With time stepping, these are means over the last call of `step`.
        """
        if self._first.recording.plan.method.starts:
            return self._of_each(self._touches(len), lambda one: one.contact_force)
        names = "mean_torque", "mean_force"
        return self._touches(lambda pairs: np.concatenate([pairs[x] for x in names], axis=-1))

    @property
    def contact_gap(self) -> Mapping[str, Array]:
        """Current minimum gaps as {contact pair: (size,)} [m], negative for penetration."""
        return self._of_each(self._touches(len), Stepper._gaps)

    def _of_each(self, names: Iterable[str], read: Callable[[Stepper], Any]) -> dict[str, Array]:
        """Return {name: (size, ...)} of what `read` returns for the stepper of each instance."""
        found: dict[str, list[Any]] = {name: [] for name in names}
        for i in range(self.size) if found else ():
            values = read(self._many.into_worker(i).stepper)
            for name, each in found.items():
                each.append(values[name])
        return {name: np.array(each) for name, each in found.items()}

    @property
    def outputs(self) -> Mapping[str, Array]:
        """Current sensor readings as {output: (size,), (size, 3) or (size, 4)}. See `Output`.

        They include the torques of the last step.
        """
        many, shared = self._many, self._sensed[0][0]
        read = np.empty((self.size, shared.width))
        vdot = many.accelerations() if shared.moves else self.v
        external = np.zeros((self.size, self.mech.nb, 6))
        if shared.loads:
            for i in range(self.size) if self._pushed else ():
                external[i] = many.into_worker(i).stepper._on_bodies()[0]
        pushes = np.zeros_like(external)
        if shared.touches and self._pushed:
            for i in range(self.size):
                found = many.into_worker(i).stepper.pushes
                pushes[i] = found[0] if found.size else 0.0
        for kind, (sensors, system) in enumerate(self._sensed):
            which = np.flatnonzero(many.kind == kind)
            q, v, rates = (np.ascontiguousarray(x[which]) for x in (many.q, many.v, vdot))
            motion = no_motion(len(which))
            if shared.moves:
                motion = bodies_over(system, q, v, rates, external[which])
            read[which] = sensors.read(q, v, motion, pushes[which])
        return Named(shared.by_name(read), "outputs", "output")

    @property
    def drive_force(self) -> Mapping[str, Array]:
        """Current {drive: (size,)} torques or forces of motors, servos and actuators [N m, N].

        As in `Result`, they are within their limits and before the gear.
        """
        names = self._first.recording.plan.driving
        return Named(self._of_each(names, lambda one: one.drive_force), *OF_DRIVES)

    @property
    def tension(self) -> Mapping[str, Array]:
        """Current tensions {name: (size,)} of springs, struts, cables and ropes [N], as in
        `Stepper`."""
        return Named(self._of_each(self._first.tension, lambda one: one.tension), *OF_PATHS)

    def _touches(self, value: Any) -> dict[str, Array]:
        contacts = self._first.recording.plan.contacts
        if contacts is None or self._many.pairs is None:
            return {}
        pairs = self._many.pairs
        return {touch.name: value(pairs[:, i]) for i, touch in enumerate(contacts.touches)}

    @property
    def _first(self) -> Stepper:
        return self._many.workers[0].stepper

    def __repr__(self) -> str:
        failed = f", {int((~self.ok).sum())} failed" if not self.ok.all() else ""
        many = f"{self.size} instances of '{self.mech.model.name}'"
        return f"<BatchStepper of {many}: {self.method}{failed}>"

    # -- steps -----------------------------------------------------------------------------------

    def step(self, tau: npt.ArrayLike | None = None, n: int = 1) -> NDArray[np.bool_]:
        """Take n steps and return which instances are still running.

        Parameters
        ----------
        tau : array_like (size, nv) or (nv,), or dict, optional
            Torques [N·m, N] that replace those given at the start.
        n : int, optional
            Number of steps.

        Returns
        -------
        ndarray of bool (size,)
            False for instances that have failed. Their state is the last one before the failed
            step.
        """
        self._give(tau)
        self._many.step(whole_number(CALL, "n", n, 1))
        return self.ok

    def trace(self, tau: npt.ArrayLike | None = None, n: int = 1) -> Array:
        """Take n steps and return the states after each of them.

        Parameters
        ----------
        tau, n
            As for `step`.

        Returns
        -------
        ndarray (n, size, nq + nv)
            Coordinates and velocities of each instance.
        """
        self._give(tau)
        found, nq, nv = self._many.trace(whole_number(CALL, "n", n, 1)), self.mech.nq, self.mech.nv
        own = self.states.shape[1]
        return np.delete(found, [*range(nq, nq + own), *range(nq + own + nv, found.shape[2])], 2)

    def _give(self, tau: Any) -> None:
        refuse_as_torques(tau, "BatchStepper")
        given = self._tau if tau is None else self._given("tau", tau, self.size)
        self._many.given[:, : self.mech.nv] = given

    def reset(
        self, q: Any = None, v: Any = None, which: Any = None, numbers: Any = None,
        states: Any = None,
    ) -> None:  # fmt: skip
        """Reset instances to t = 0.

        The targets of servos are reset to the values of the model. Note that the default stiffness
        of soft and penalty contacts depends on the initial state of the model and is not updated.
        It should be set explicitly if results must be identical to a Stepper with a different
        initial state.

        Parameters
        ----------
        q : array_like (k, nq) or (nq,), or dict, optional
            Configurations of the k instances, or of all instances. The default is their initial
            state. A dictionary maps body names to a value, or to k values.
        v : array_like (k, nv) or (nv,), or dict, optional
            Velocities in the same form.
        which : array_like, optional
            Indices of the instances to reset, or a boolean mask (size,). By default, all are reset.
        numbers : array_like (k,), optional
            Indices into the lists of `set` that select the values of the instances.
        states : array_like (k, nx) or (nx,), optional
            States of the controls, after a sample at t = 0. The default is given by the model.

        Raises
        ------
        InputError
            If a state is invalid or cannot satisfy the constraints.
        """
        chosen, many = chosen_in(which, self.size), self._many
        entries = self._entries
        kinds = many.kind[chosen] if numbers is None else places_in(numbers, entries, len(chosen))
        if numbers is not None and not self._set:
            raise refused("numbers", "requires set={path: values}", "reset")
        qs = None if q is None else self._given("q", q, len(chosen))
        if qs is not None:
            positions(self.mech.packed, qs)
        vs = None if v is None else self._given("v", v, len(chosen))
        nx = self.states.shape[1]
        own = None if states is None else numbers_of("states", states, len(chosen), nx)
        before = many.states[chosen], many.codes[chosen], many.kind[chosen]
        many.kind[chosen], many.codes[chosen] = kinds, at.RUNNING
        many.states[chosen] = many.starts[kinds]
        if qs is not None:
            many.q[chosen, : self.mech.nq] = qs
        if vs is not None:
            many.v[chosen, : self.mech.nv] = vs
        record = self._first.recording
        begun = len(record.plan.active) or nx or record.steps.guard["approach"]
        try:
            for i in chosen.tolist() if begun and not (qs is None and vs is None) else ():
                worker = many.into_worker(i)
                if why := worker.begin():
                    raise refused("q", f"instance {i}: {why}", "reset")
                many.states[i] = worker.state()
        except InputError:
            many.states[chosen], many.codes[chosen], many.kind[chosen] = before
            raise
        if own is not None:
            many.v[chosen, self.mech.nv :] = own

    def _given(self, kind: str, value: Any, n: int) -> Array:
        """Return finite q, v, vdot or tau of n instances, which may be by name of body.

        Other joints then have their initial values, or 0 of vdot and tau. Raises InputError.
        """
        width = self.mech.nq if kind == "q" else self.mech.nv
        if (entries := names_in(value)) is not None:
            start = dict(zip("qv", self._first.recording.given)).get(kind)
            rest = np.zeros(width) if start is None else start[:width]
            rows = rows_by_name(self.mech, kind, entries)
            value = [by_name(self.mech, kind, row, rest) for row in rows]
            value = value[0] if len(value) == 1 else value
        return numbers_of(kind, value, n, width)

    def acceleration(self, tau: npt.ArrayLike | None = None) -> Array:
        """Return the accelerations of all instances.

        Forces, constraints and compliant contacts are included. Since rigid contacts and limits act
        through impulses, their forces are taken from the last step, and are zero after `reset`.

        Parameters
        ----------
        tau : array_like (size, nv) or (nv,), or dict, optional
            Torques [N·m, N], as for `step`.

        Returns
        -------
        ndarray (size, nv)
            Accelerations [rad/s², m/s²].
        """
        acted = self._many.given.copy()
        self._give(tau)
        found = self._many.accelerations()
        self._many.given[:] = acted  # `outputs` tell of the last step
        return found

    def inverse_dynamics(self, vdot: Any) -> Array:
        """Return the torques that produce given accelerations in addition to passive forces.

        Constraints and contacts are ignored, as in `Mechanism.inverse_dynamics`.

        Parameters
        ----------
        vdot : array_like (size, nv), or dict
            Accelerations [rad/s², m/s²].

        Returns
        -------
        ndarray (size, nv)
            Torques [N·m, N].

        Raises
        ------
        InputError
            If the instances do not use SIMD lanes.
        """
        if not isinstance(self._many, TreeLanes):
            text = "is for free trees that are stepped in lanes; call `inverse_dynamics` of a "
            raise refused("", text + "mechanism for each instance", "inverse_dynamics")
        return self._many.torques(self._given("vdot", vdot, self.size))

    def target(self, servo: str, value: Any) -> None:
        """Set the target of a servo, which stays constant until `reset`.

        Parameters
        ----------
        servo : str
            Name of the servo.
        value : float or array_like (size,)
            Target [rad, m] of all instances or of each one.
        """
        targets = self._many.targets
        if servo not in targets:
            text = f"no servo with a constant target is named {shown(servo)}; {one_of(targets)}"
            for force in self.mech.model.forces:
                if force.name == servo and isinstance(force, OnJoint):
                    text += "; torques of a drive that is no servo are given to each step: "
                    text += f"batch.step({{{force.body!r}: values}})"
            raise refused("servo", text, "target")
        given = numbers_of("value", value, self.size, None)
        for force in self.mech.model.forces:
            if force.name == servo and isinstance(force, OnJoint):
                for one in (given.min(), given.max()):
                    if text := force.input_problem(float(one)):
                        raise refused(f"'{servo}'", text, "target")
        targets[servo][:] = given

    # -- snapshots -------------------------------------------------------------------------------

    GIVEN = ("mech", "size", "threads", "_options", "_set", "_tau")

    def _folder(self) -> Any:
        return cache_folder()

    def _memory(self) -> list[Any]:
        return list(self._many.memory)

    def _words(self) -> tuple[str, ...]:
        given = {**self._options, "tau": None}
        values = [np.ascontiguousarray(x).tobytes() for x in self._set.values()]
        many = self.size, len(self._many.starts)
        said = "\n".join([self.mech.model.hash, repr(given), repr(list(self._set)), repr(many)])
        return (sha256(said.encode() + b"".join(values)).hexdigest()[:16],)

    def _renew(self) -> None:
        self._begin()

    def _resume(self, words: list[str], state: memoryview, memory: list[Any]) -> None:
        put_back(state, memory)
        self._many.relink()


def _tables(steppers: Iterator[Stepper]) -> tuple[Stepper, Ints, Ints, Ints]:
    """Return (first stepper, states, varying numbers, their places), one row a stepper."""
    first = next(steppers)
    base, states = words_of(number_arrays(first)), [words_of(state_arrays(first))]
    shapes, always = _shapes(first), sum(a.size for a in first.recording.steps.given)
    others: list[tuple[Ints, Ints]] = []
    for stepper in steppers:
        if _shapes(stepper) != shapes:
            text = "some values add or remove a spring, a damper or another element, but all "
            text += "instances have the same structure; start with nonzero values (not 1 for gears)"
            raise refused("set", text)
        numbers = words_of(number_arrays(stepper))
        places = np.flatnonzero(numbers != base)
        others.append((places, numbers[places]))
        states.append(words_of(state_arrays(stepper)))
    varying = np.unique(np.concatenate([np.arange(always), *(places for places, _ in others)]))
    table = np.repeat(base[varying][None], len(states), axis=0)
    for row, (places, values) in zip(table[1:], others):
        row[np.searchsorted(varying, places)] = values
    return first, np.stack(states), table, varying


def _shapes(stepper: Stepper) -> list[tuple[int, ...]]:
    return [a.shape for a in (*state_arrays(stepper), *number_arrays(stepper))]


def _read_only(view: Array) -> Array:
    view = view.view()
    view.flags.writeable = False
    return view
