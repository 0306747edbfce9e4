"""Dynamics: equations of motion of a mechanism. Every result is a function of (q, v)."""

from __future__ import annotations

import functools
import sys
import threading
import warnings
from functools import cached_property
from typing import Any, Self, cast

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.compiler.jit import JIT, closed, ready
from ..engine.tree import dynamics
from ..errors import Called, InputError, Problem, choices, explained, guarded
from ..model import Model
from ..packing import Array
from ..packing.packed import Packed, passive
from .arguments import finite, for_each_state, numbers, position, wrong_type
from .kinematics import NO_EXTERNAL, Kinematics
from .paths import Paths
from .scene import Scene

FORWARD = closed(dynamics.forward_dynamics)  # simulations do not need it
EMPTY = np.empty
UNFIT = (TypeError, ValueError, AttributeError)  # errors of fast calls with unsuitable arguments
WITH_GIL = getattr(sys, "_is_gil_enabled", lambda: True)()
DIRECT = JIT and WITH_GIL  # kernels refuse what does not fit, and one call is atomic
COPIED_ALONE = 500  # numbers: NumPy lets other threads run while it copies more into `given`
FOLLOWED = ", and a pg.Motion constraint lets a joint follow a given motion in a run"
IGNORED_BY = {
    "active constraints": ("inverse_dynamics", "forward_dynamics"),
    "forces": ("forward_dynamics", "constrained_dynamics"),
}
OVERFLOW = Problem("dynamics", "", "the result is not finite: the given numbers are too large")


OF_MODEL = "gravity_or_up_or_ground_or_name_or_bodies_or_constraints_or_contacts_or_forces"


@guarded(**{
    OF_MODEL: "it is the model's: make a new one, mech = pg.Mechanism(mech.model.replace(...))",
    "q_or_v_or_tau": "a mechanism has no state: pass q, v or tau, as in pg.simulate(mech, q=...)",
    "other": "change a part by mech = mech.edit(name, ...); pass the rest to each call",
})  # fmt: skip
@explained
class Dynamics(Kinematics):
    """A model with canonical numbers, with its equations of motion.

    The arrays q (nq,), v and tau (nv,) are ordered by body number, as given by `names`. Body 0 is
    the ground. Raises InputError for arrays of the wrong length or with numbers that are not
    finite.
    """

    divided: bool  # whether it has the segments of beams
    _springs: int
    _free: tuple[Any, ...]  # arguments of `at_once`, empty if the kernel does not suffice
    _untold: dict[tuple[str, str], str]  # (call, what it ignores): names, without a warning so far
    _bound: tuple[Any, ...] = ()  # arguments of `constrained_at_once`, after a first call
    _slopes: tuple[Any, ...] = ()  # arguments of derivatives, after a first call

    def __init__(self, model: Model, /):
        """Number and pack a valid model. Raises InputError if it is invalid."""
        if not isinstance(model, Model):
            raise wrong_type(type(self).__name__, "model", "a pg.Model", model)
        model = model.expanded
        packed = Packed(model)
        nq, nv, work = packed.nq, packed.nv, np.zeros((len(packed.rows), at.WORK))
        left, rest = _left_out(model), np.zeros(nv)
        untold = {(call, what): left[what] for what in left for call in IGNORED_BY[what]}
        direct = DIRECT and not packed.springs and not untold
        free = (nq, nv, packed.rows, packed.const, work, rest) if direct else ()
        vars(self).update(  # at once: setting an attribute is guarded
            nb=packed.nb, nq=nq, nv=nv, packed=packed, _springs=packed.springs, _free=free,
            _untold=untold, _rest=rest, _work=work, _lock=threading.Lock(),
            divided=bool(model.segments),
        )  # fmt: skip

    def __getstate__(self) -> Model:
        return self.model.described

    def __setstate__(self, model: Model) -> None:
        Dynamics.__init__(self, model)

    def __repr__(self) -> str:
        model, kind = self.model, type(self).__name__
        counts = f"{len(model.bodies)} bodies, nq {self.nq}, nv {self.nv}"
        for field in ("constraints", "contacts", "forces"):
            if parts := getattr(model, field):
                counts += f", {len(parts)} {field if len(parts) > 1 else field[:-1]}"
        return f"<{kind} '{model.name}': {counts}>" if model.name else f"<{kind}: {counts}>"

    def _repr_html_(self) -> str:
        from ..show import mechanism_html  # only notebooks need it

        return mechanism_html(self)

    def edit(self, name: str, /, **changes: Any) -> Self:
        """Return the mechanism for `model.edit(name, **changes)`.

        The mechanism is unchanged if ModelError is raised.
        """
        return type(self)(self.model.described.edit(name, **changes))

    @for_each_state
    def energy(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the (kinetic, potential) energy [J], including all springs."""
        address, q, v = self._scene.address, position(self.packed, q), self._speed(v)
        with self._lock:
            return motion.energy(address, q, v)

    @property
    def path_names(self) -> tuple[str, ...]:
        """The names of all forces along paths, such as springs and struts, in model order."""
        return self._paths.names

    @for_each_state
    def path_length(self, q: Array) -> Array:
        """Return the lengths (n,) [m] of the paths of all forces along paths, as `path_names`."""
        return self._along_paths(q)[0]

    @for_each_state
    def moment_arms(self, q: Array) -> Array:
        """Return the moment arms of all forces along paths, such as springs, as `path_names`.

        They are the generalised forces of a tension of 1 N, and exactly -dL/dq of the lengths L. A
        tension T along path i exerts τ = T r[i].

        Parameters
        ----------
        q : (nq,) array
            Configuration.

        Returns
        -------
        (n, nv) array
            r [m] for angles, a number without a unit for lengths.

        Examples
        --------
            mech = pg.Mechanism(pg.Model.load("arm.json"))
            elbow = mech.moment_arms(mech.home()[0])[:, mech.joints["forearm"].v]
        """
        return self._along_paths(q)[1]

    def _along_paths(self, q: Array) -> tuple[Array, Array]:
        """Return lengths and moment arms, and warn of each path without a shortest way at q."""
        q = position(self.packed, q)
        with self._lock:
            lengths, arms = self._paths.measured(q)
        for text in self._paths.doubts(q, arms):
            warnings.warn(text, stacklevel=5)
        return lengths, arms

    @cached_property
    def _paths(self) -> Paths:
        return Paths(self.packed)

    # -- equations of motion ---------------------------------------------------------------------
    # Passive forces act here: springs, dampers and friction of joints, and springs, dampers and
    # drags between bodies. Forces that may depend on time (wrenches, motors, servos) act in runs.

    @for_each_state
    def mass_matrix(self, q: Array) -> Array:
        """Return the mass matrix M (nv, nv) in eq. (25), including armature."""
        m = np.zeros((self.nv, self.nv))
        q = position(self.packed, q)
        with self._lock:
            dynamics.mass_matrix(*self.packed.tree, q, self._rest, self._work, m)
        return m

    @for_each_state
    def bias_force(self, q: Array, v: Array) -> Array:
        """Return C (nv,) in eq. (25): velocity terms and gravity, without springs and dampers."""
        q, v = self._state(q, v)
        return self._inverse(q, v, self._rest, NO_EXTERNAL)

    @for_each_state
    def inverse_dynamics(
        self, q: Array, v: Array, vdot: Array, external: Array | None = None
    ) -> Array:
        """Return the τ (nv,) that produces v' in the tree, eq. (24), in addition to passive forces.

        Active constraints are ignored, with a warning at the first call. See
        `constrained_inverse_dynamics`.

        `external` (nb, 6) is [torque, force] on each body at its origin in world axes.
        `external_at` computes it from wrenches at other points.
        """
        if self._untold:
            self._tell("inverse_dynamics", "constrained_inverse_dynamics(q, v, vdot)", 5, FOLLOWED)
        return self._tree_torque(q, v, vdot, external)

    def _tree_torque(self, q: Array, v: Array, vdot: Array, external: Array | None = None) -> Array:
        """The same as `inverse_dynamics`, for callers that add the constraints themselves."""
        q, v = self._state(q, v)
        vdot, wrench = numbers("vdot", vdot, self.nv, of=self.packed), self._external(external)
        tau = self._inverse(q, v, vdot, wrench)
        return tau - self._passive(q, v, self._rest) if self._springs else tau

    @for_each_state
    def forward_dynamics(
        self, q: Array, v: Array, tau: Array | None = None, external: Array | None = None
    ) -> Array:
        """Return v' (nv,) of the tree without its constraints, eq. (26), in O(n).

        Active constraints are ignored, with a warning at the first call. `constrained_dynamics`
        imposes them. Springs and dampers of joints and between bodies act. Wrenches, motors, servos
        and time-dependent elements only act in `simulate`, and the first call issues a warning.
        """
        if self._untold:
            self._tell("forward_dynamics", "constrained_dynamics(q, v, tau)", 6)
            self._tell_forces("forward_dynamics", 6)
        return self._tree_acceleration(q, v, tau, external)

    def _tree_acceleration(
        self, q: Array, v: Array, tau: Array | None = None, external: Array | None = None
    ) -> Array:
        """The same as `forward_dynamics`, for callers that add the constraints themselves."""
        q, v = self._state(q, v)
        tau = self._rest if tau is None else numbers("tau", tau, self.nv, of=self.packed)
        wrench = None if external is None else self._external(external)
        vdot = np.empty(self.nv)
        if self._springs:
            tau = self._passive(q, v, tau)
        with self._lock:
            code = accelerated(self.packed, (q, v, tau), wrench, self._work, vdot)
        if code:
            given = {} if external is None else {"external": np.asarray(external, float)}
            self._explain(code, q=q, v=v, tau=tau, **given)
        return vdot

    def _tell(self, call: str, instead: str, level: int, more: str = "") -> None:
        """Warn once per call and mechanism that constraints are ignored."""
        text = f"Mechanism.{instead} imposes them{more}"
        self._warn(call, "active constraints", text, level + 1)

    def _tell_forces(self, call: str, level: int) -> None:
        """Warn once per call and mechanism that forces are ignored."""
        text = "they act in simulate and in a Stepper; give their torques as tau"
        self._warn(call, "forces", text, level + 1)

    def _warn(self, call: str, what: str, text: str, level: int) -> None:
        """Warn once per mechanism about elements that a call ignores.

        `forward_dynamics` only uses its fast path after this warning, so later calls have no
        overhead.
        """
        packed, own = self.packed, vars(self)
        if names := self._untold.pop((call, what), ""):
            warnings.warn(f"{call} ignores the {what} {names}; {text}", stacklevel=level)
        quiet = not any(other == "forward_dynamics" for other, _ in self._untold)
        if DIRECT and not packed.springs and quiet:
            own["_free"] = self.nq, self.nv, *packed.tree, self._work, self._rest

    @for_each_state
    def constrained_dynamics(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, dict[str, Array]]:
        """Return (v', {name: (6,)}) with every active constraint enforced, eqs. (27)-(29).

        Forces are [torque, force] on the constraint's body at its point, world axes. Passive
        forces act, as in `forward_dynamics`.
        """
        if self._untold:
            self._tell_forces("constrained_dynamics", 6)
        return self._constrained_acceleration(q, v, tau)

    def _constrained_acceleration(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, dict[str, Array]]:
        """The same as `constrained_dynamics`, for callers to whom drives do not matter."""
        scene = self._scene
        q, v = self._state(q, v)
        tau = self._rest if tau is None else numbers("tau", tau, self.nv, of=self.packed)
        constrained, *given, flow, shape = self._constrained
        vdot, wrenches = np.empty(self.nv), np.empty(shape)
        with self._lock:
            code = constrained(*given, q, v, tau, flow, vdot, wrenches)
        if code:
            self._explain(code, q=q, v=v, tau=tau)
        return vdot, scene.forces(wrenches)

    @cached_property
    def _scene(self) -> Scene:
        """Build a scene with the passive forces and active constraints, for single states."""
        packed, kernel = self.packed, ready(motion.constrained_dynamics)
        scene = Scene(packed, packed.passive, packed.passive_loads, packed.active)
        asked = scene.address, scene.accelerate, 0.0
        shape = len(scene.active) - 1, 6
        state = self.nq, self.nv, self._rest
        self._constrained = kernel, *asked, np.zeros(3), shape
        direct = DIRECT and self.nv <= COPIED_ALONE
        self._bound = (*state, *self._constrained, scene.forces) if direct else ()
        return scene

    # -- arguments and passive forces ------------------------------------------------------------

    def _inverse(self, q: Array, v: Array, vdot: Array, external: Array) -> Array:
        tau, tables = np.empty(self.nv), self.packed.system[:4]
        with self._lock:
            dynamics.inverse_dynamics(*tables, q, v, vdot, external, self._work, tau)
        if not np.isfinite(tau).all():
            self._explain(-1, q=q, v=v, vdot=vdot, external=external)
        return tau

    def _passive(self, q: Array, v: Array, given: Array) -> Array:
        """Return the sum of `given` (nv,) and the passive forces."""
        tau, scene = np.empty(self.nv), self._scene
        with self._lock:
            scene.given[:] = given
            motion.drive_torque(scene.address, q, v, tau)
        return tau + self._load_torque(q, v) if scene.loads.number else tau

    def _load_torque(self, q: Array, v: Array) -> Array:
        """Return τ (nv,) from springs and torsion springs between bodies."""
        tau, address = np.empty(self.nv), self._scene.address
        with self._lock:
            motion.load_torque(address, q, v, tau)
        return tau

    def _state(self, q: Array, v: Array) -> tuple[Array, Array]:
        of = self.packed
        return numbers("q", q, self.nq, of=of), numbers("v", v, self.nv, of=of)

    def _explain(self, code: int, **given: Array) -> None:
        """Raise the error that corresponds to a kernel's status code."""
        for name, value in given.items():
            finite(name, value, *value.shape)
        position(self.packed, given["q"])
        raise InputError(self.packed.singular(code) if code > 0 else OVERFLOW)


def _left_out(model: Model) -> dict[str, str]:
    """Return the names of the elements that act in runs but not in the dynamics at a given state,
    by kind.

    A motor without a torque only defines an input.
    """
    rows = [c.name for c in model.constraints if c.active]
    idle = lambda f: f.kind == "motor" and f.torque == 0.0  # noqa: E731
    forces = [f.name for f in model.forces if not (passive(f) or idle(f))]
    found = {"active constraints": rows, "forces": forces}
    return {what: choices([f"'{x}'" for x in names], 3) for what, names in found.items() if names}


# -- the calls of a user's own loops ---------------------------------------------------------------
# Arrays that the kernel takes as they are cost one frame of Python: to check them, and the frame
# that explains wrong calls, takes half as long as the dynamics of an animal. Kernels refuse other
# arrays, and what fails goes through the methods, which say why.


def at_once(checked: Called) -> Called:
    """Compute `forward_dynamics(q, v, tau)` by a direct kernel call if the kernel accepts the
    state."""

    @functools.wraps(checked)
    def forward_dynamics(*args: Any, **named: Any) -> Any:
        try:
            mech, q, v, tau = args if len(args) == 4 else (*args, None)
            if mech._free and not named:
                nq, nv, rows, const, work, rest = mech._free
                tau = rest if tau is None else tau
                if len(q) == nq and len(v) == nv and len(tau) == nv:
                    vdot = EMPTY(nv)
                    if FORWARD(rows, const, q, v, tau, work, vdot) == 0:
                        return vdot
        except UNFIT:
            pass
        return checked(*args, **named)

    return cast("Called", forward_dynamics)


def constrained_at_once(checked: Called) -> Called:
    """Compute `constrained_dynamics(q, v, tau)` in the same way, after a first call."""

    @functools.wraps(checked)
    def constrained_dynamics(*args: Any, **named: Any) -> Any:
        try:
            mech, q, v, tau = args if len(args) == 4 else (*args, None)
            if mech._bound and not named:
                nq, nv, rest, kernel, scene, accelerate, t, flow, shape, forces = mech._bound
                tau = rest if tau is None else tau
                if len(q) == nq and len(v) == nv and len(tau) == nv:
                    vdot, wrenches = EMPTY(nv), EMPTY(shape)
                    with mech._lock:  # `_passive` gives its torques to the same scene
                        code = kernel(scene, accelerate, t, q, v, tau, flow, vdot, wrenches)
                    if code == 0:
                        return vdot, forces(wrenches)
        except UNFIT:
            pass
        return checked(*args, **named)

    return cast("Called", constrained_dynamics)


Dynamics.forward_dynamics = at_once(Dynamics.forward_dynamics)
Dynamics.constrained_dynamics = constrained_at_once(Dynamics.constrained_dynamics)


def accelerated(
    packed: Packed,
    state: tuple[Array, Array, Array],
    external: Array | None,
    work: Array,
    vdot: Array,
) -> int:
    """Write v' for (q, v, tau) into `vdot`, and return the kernel's status code."""
    if external is None:
        return ready(FORWARD)(*packed.tree, *state, work, vdot)
    return dynamics.forward_dynamics_external(*packed.system[:4], *state, external, work, vdot)


def model_of(call: str, value: Any, more: str = "") -> Model:
    """Return the model of a mechanism, or the model itself. Raises InputError."""
    model = value.model if isinstance(value, Dynamics) else value
    if not isinstance(model, Model):
        raise wrong_type(call, "model", "a pg.Model or a pg.Mechanism", value, more)
    return model
