"""The result of a run: states over time, energies, forces, cost and status. `joined` joins runs."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..dynamics.states import (
    BodyMotion,
    ranges_of_motion,
    sizes_of_states,
)
from ..errors import InputError, Problem, choices, counted, explained, guarded, percent
from ..packing import Array
from ..packing.signals import values_of
from ..portable import EqualByFields, Portable, ReadOnly
from .balance import energy_drift, is_of_balance, of_balance
from .bodies import ALL, OF_POINTS, acting, body_motion, body_poses, of_point
from .cams import CamRecord, cams_of
from .columns import (
    OF_BODIES,
    Column,
    Labelled,
    by_body,
    by_position,
    by_velocity,
    columns_of,
    labelled,
    meant,
    no_column,
)
from .dense import states_at
from .exports import ARRAYS, Exports
from .functions import Evaluated
from .measured import Measuring
from .paths import Path, paths_of
from .pressure import Pressing
from .records import (
    NO_DERIVATIVES,
    NO_DRIVES,
    NO_FORCES,
    NOTHING,
    OF_PATHS,
    SWING,
    ByTouch,
    ContactRecord,
    Derivatives,
    Event,
    Memory,
    Named,
    Status,
    UserEvent,
)
from .slopes import slope_along

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..model import Model


MAKE = "_make"  # attribute with the functions that make what was left for later
MORE = "_more"  # attribute with the notices found so far, and the function that finds the others

BY_JOINT = {"q": by_position, "v": by_velocity, "vdot": by_velocity}  # arrays with names of joints


def read_only(name: str, given: Any, joints: Any) -> Array:
    """Return a view of an array of a run, which names of joints index if it has coordinates."""
    array, places = np.asarray(given), BY_JOINT.get(name)
    found = labelled(array, name, places, joints) if places else array.view()
    found.setflags(write=False)
    return found


def _vector(kind: str, what: str) -> Any:
    """Return a property with a vector of all bodies, a quantity of `OF_BODIES`."""
    unit, attribute, first = OF_BODIES[kind]

    def read(run: Any) -> Labelled:
        found = run._of_bodies(kind, getattr(run, attribute)[..., first : first + 3])
        found._at = partial(of_point, run, kind) if kind in OF_POINTS else None
        return found

    return property(
        read, doc=f"The {what} in world axes [{unit}], (n, nb, 3), or (n, 3) by name of body."
    )


def _moving(field: str, what: str) -> Any:
    """Return a property with an array (n, nb, 6) of `body_motion`."""
    name = "joint_force" if field == "force" else f"body_{field}"

    def read(run: Any) -> Labelled:
        return run._of_bodies(name, getattr(run.body_motion, field))

    return property(read, doc=f"{what} in world axes, (n, nb, 6), or (n, 6) by name of body.")


def _touching(kind: str, joined: Any, what: str) -> Any:
    """Return a property with an array of each contact pair, which `joined` joins for two bodies."""
    doc = f"{what}, {{contact pair: (n,)}}. Two names of bodies are accepted as well."
    return property(lambda run: run._by_touch(kind, joined), doc=doc)


@guarded(other="a run does not change; dataclasses.replace(run, q=...) makes another one")
@explained
@dataclass(frozen=True, eq=False)
class Result(Exports, Evaluated, Measuring, Pressing, EqualByFields, Portable):
    """The result of a run, with arrays that have one row per recorded frame.

    If a run fails, the frames up to the failure are available. Two runs are considered equal if
    their models and all recorded values are equal, regardless of their cost.
    """

    mechanism: Mechanism = field(compare=False)  # only its model is compared
    status: Status
    message: str  # the status with its time, its body and advice
    t: Array  # (n,) [s]
    q: Array  # (n, nq)
    v: Array  # (n, nv)
    vdot: Array  # (n, nv)
    kinetic_energy: Array  # (n,) [J]
    potential_energy: Array  # (n,) [J], springs included
    work: Array  # (n,) [J] by motors, servos, given torques, wrenches, prescribed motions and belts
    dissipation: Array  # (n,) [J] taken out by dampers and friction
    constraint_drift: Array  # (n, 2) largest |position| [m] and |velocity| [m/s] residual
    constraint_force: Named  # {name: (n, 6)} [torque, force] on `body` at `point`
    contacts: ContactRecord  # forces, gaps, slips of contacts and torques of joint limits
    counters: Mapping[str, int] = field(
        compare=False
    )  # steps, evaluations, projections, solver iterations, ...
    timing: Mapping[str, float] = field(compare=False)  # seconds a phase
    error_at: Array
    """(n,) Estimated error of q [rad, m], attitudes as angles: the largest difference so far from
    a finer run; inf from where it is not known on, which a notice says; nan without an estimate."""
    header: Mapping[str, Any]  # version, model hash, method, step, ...
    notices: tuple[str, ...] = field(default_factory=tuple)  # sentences on how the run went
    user_events: tuple[UserEvent, ...] = field(default=())
    """Where functions given as `events` crossed zero, in order of time."""
    derivatives: Derivatives = field(default_factory=lambda: NO_DERIVATIVES, compare=False)
    """{path: (n, nq + nv + 2)} of q, v, work and dissipation by what `wrt` names."""
    states: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """(n, nx) The states of the model's controls, in their order."""
    state_error_at: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """(n, nx) Estimated errors of the states, as `error_at`, in their units."""
    force_error_at: Array = field(default_factory=lambda: np.zeros(0))
    """(n,) Estimated errors of the forces of contacts [N] and joint limits [N m, N] at each frame:
    the largest difference from a finer run; inf and nan as for `error_at`."""
    space_error_at: Array = field(default_factory=lambda: np.zeros(0))
    """(n,) Estimated error of dividing beams into segments, of their places and of all bodies
    outside of them [m]: the largest so far; nan where it is not known."""
    memory: Memory | None = field(default=None, compare=False)
    """What `simulate(..., start=run)` goes on with beside the last frame."""
    drive_force: Named = field(default_factory=lambda: NO_DRIVES)
    """{name: (n,)} Torques or forces of motors, servos and actuators [N m, N], within their limits
    and before the gear."""

    def __post_init__(self) -> None:
        """Make the arrays read-only, because a run does not change."""
        own, joints = vars(self), self.mechanism.joints
        if MORE not in own:
            own[MORE] = own.pop("notices"), tuple
        for name in ARRAYS:
            own[name] = read_only(name, own[name], joints)
        for forces in (self.constraint_force, self.drive_force):
            if forces is not NO_FORCES and forces is not NO_DRIVES:
                forces.keep_unchanged()
        if self.contacts is not NOTHING:
            self.contacts.keep_unchanged()
        instead = "a run does not change; dict(...) makes a copy"
        for name in ("counters", "timing", "header"):
            own[name] = ReadOnly(own[name], f"run.{name}", instead)

    def _of_bodies(self, attribute: str, array: Array) -> Labelled:
        """Return an array (n, nb, ...) that can also be indexed by body names."""
        return labelled(array, attribute, by_body, self.mechanism.names)

    @classmethod
    def later(
        cls, arrays: Mapping[str, Array], mechanism: Callable[[], Mechanism],
        make: Callable[[], Result],
    ) -> Result:  # fmt: skip
        """Return a run of which only some arrays are known.

        The others are taken from `make` when one is first read, and the mechanism from its own
        function, because both take longer than most functions of a run.
        """
        found = object.__new__(cls)
        own = vars(found)
        own.update(arrays, notices=())
        own[MAKE] = mechanism, make
        return found

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            """Return a field of a run that was made `later`."""
            own = self.__dict__
            if MAKE not in own or name not in type(self).__dataclass_fields__:
                return super().__getattr__(name)
            mechanism, make = own[MAKE]
            own["mechanism"] = mechanism()
            if name != "mechanism":
                del own[MAKE]
                own.update(make().__dict__)
            return own[name]

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields, with all notices."""
        _ = self.status  # makes those that were left for later
        _ = self.notices
        return vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.__post_init__()

    def add_when_read(self, more: Callable[[], tuple[str, ...]]) -> None:
        """Let `more` find more warnings when they are first read, which costs as much as a run."""
        own = vars(self)
        own[MORE] = own[MORE][0], more

    def _all_notices(self) -> tuple[str, ...]:
        """Return the given notices and those found now.

        They exclude notices about the energy balance of the parts that this run is made of.
        """
        own = vars(self)
        first, more = own[MORE]
        given = [text for text in first if not is_of_balance(text)]
        found = (*given, *more())
        found += (*of_balance(self, found),)
        own[MORE] = found, tuple
        return found

    def __eq__(self, other: object) -> bool:
        """Compare the models and the numerical data, treating nan as equal to nan."""
        equal = super().__eq__(other)
        if equal is not True or not isinstance(other, Result):
            return equal
        return self.mechanism is other.mechanism or self.mechanism.model == other.mechanism.model

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        span = f"{self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else "no time"
        method = self.header.get("method", "?")
        error = f"error {self.error_estimate:.1e}"
        if not np.isfinite(self.error_estimate):
            error = f"error {self.accuracy}"
        text = f"<Result: {counted(len(self.t), 'frame')} over {span} by {method}, {error}"
        if self.notices:
            text += f", {len(self.notices)} notice{'s'[: len(self.notices) > 1]}"
        return f"{text}>" if self.status.ok else f"{text};\n {self.message}>"

    def __str__(self) -> str:
        """Return the repr, a line per notice, and the reason if there is no estimate."""
        left = [text for text in self.notices if self.status.ok or text not in self.message]
        lines = [f"notice: {text}" for text in left]
        if self.status.ok and np.isnan(self.error_estimate):
            lines += self.message.split("; ", 1)[1:]
        return "\n  ".join((repr(self), *lines))

    @property
    def success(self) -> bool:
        """True if the run reached its end, or an event that ends runs."""
        return self.status.ok

    @property
    def error_estimate(self) -> float:
        """Estimated maximum error in q [rad, m] at the recorded times, last of `error_at`."""
        return float(self.error_at[-1]) if len(self.error_at) else np.nan

    @property
    def space_error(self) -> float:
        """Estimated maximum error of dividing beams into segments [m], of `space_error_at`.

        It is 0 without beams, and nan without an estimate.
        """
        known = self.space_error_at[np.isfinite(self.space_error_at)]
        return float(known[-1]) if len(known) else np.nan

    def with_space_error(self, error: Array | None, notices: tuple[str, ...]) -> Result:
        """Return this run with the error of its segments (n,) [m], and notices about it."""
        error = np.full(len(self.t), np.nan) if error is None else error
        first, more = vars(self)[MORE]
        vars(self)[MORE] = (*first, *notices), more
        vars(self)["space_error_at"] = read_only("space_error_at", error, {})
        return self

    @property
    def force_error(self) -> float:
        """Estimated maximum error of contact and limit forces [N, N m], of `force_error_at`."""
        return float(self.force_error_at.max()) if len(self.force_error_at) else np.nan

    @property
    def relative_force_error(self) -> float:
        """The error of contact and limit forces, relative to the largest of them."""
        forces = [np.linalg.norm(f[:, 3:], axis=1) for f in self.contacts.force.values()]
        forces += [np.abs(f) for f in self.contacts.limit.values()]
        peak = max((float(f.max(initial=0.0)) for f in forces), default=0.0)
        return self.force_error / peak if peak > 0.0 else self.force_error

    @property
    def relative_error(self) -> Array:
        """Return the error of the motion or of a control state, relative to its range, (n,).

        The range of the motion is the largest displacement of a joint from its initial position. If
        nothing moves, the reference is 1.5e-8 of the length of the mechanism, or of the value of a
        state if this is larger.
        """
        share, own = self.error_at / self._size_of_motion(), self._shares_of_states()
        return np.maximum(share, own.max(axis=1)) if own.size else share

    def _size_of_motion(self) -> float:
        return ranges_of_motion(self.mechanism.packed, self.q)[2]

    def _shares_of_states(self) -> Array:
        """Return the errors of states over their ranges, (n, nx)."""
        return self.state_error_at / sizes_of_states(self.mechanism.packed, self.states)

    @property
    def model(self) -> Model:
        """The model that was simulated."""
        return self.mechanism.model.described

    @property
    def accuracy(self) -> str:
        """The error estimate as text: "3e-06 rad or m, 0.01 % of the motion", "not estimated"."""
        error = self.error_estimate
        if np.isnan(error):
            return "not estimated"
        if np.isfinite(error):
            size = self._size_of_motion()
            text = f"{error:.2g} rad or m, {percent(error / size)} of the motion"
            own = self._shares_of_states()[-1:].ravel()
            if own.max(initial=0.0) <= error / size:
                return text
            control, k, _ = self.mechanism.model.states[int(np.argmax(own))]
            share = percent(float(own.max())) if np.isfinite(own.max()) else "an unknown part"
            return f"{text}, {share} of the range of x.{control.name}[{k + 1}]"
        last = int(np.isfinite(self.error_at).sum()) - 1
        until, before = self.t[last], self.error_at[last]
        return f"known until t = {until:.4g} s only: {before:.2g} rad or m"

    def __getitem__(self, name: str) -> Array:
        """Return a joint's coordinates over time, (n,) or (n, k) for k > 1, or another column.

        Raises InputError if unknown.
        """
        q, v = cast(Labelled, self.q), cast(Labelled, self.v)
        joints = q._names[2]  # pyright: ignore[reportPrivateUsage]
        if not isinstance(name, str):
            raise InputError(Problem("run", "name", self._no_joint(name)))
        if name not in joints:
            if name[:2] == "v." and name[2:] in joints and v[name[2:]].ndim == 1:
                return v[name[2:]]
            columns = columns_of(self)
            if name in columns:
                return columns[name].values
            other = name in ARRAYS or name in self.mechanism.names
            if not other and (found := self._meant(name)):
                picked = [column.values for column in found.values()]
                return picked[0] if len(found) == 1 else np.stack(picked, axis=1)
            raise InputError(Problem("run", "name", self._no_joint(name)))
        return q[name]

    def _meant(self, name: str) -> dict[str, Column]:
        """Return the columns that match a name. Names of bodies are only suggested if there are no
        other matches."""
        for bodies in (False, True):
            columns = columns_of(self, bodies)
            if found := meant(columns, name):
                return {column: columns[column] for column in found}
        return {}

    def __bool__(self) -> bool:
        """Return True. Use `success` to test whether the run reached its end."""
        return True

    def _ipython_key_completions_(self) -> list[str]:
        """Return the joint names as completions for `run["` in a notebook."""
        return list(self.mechanism.joints)

    def _no_joint(self, name: Any) -> str:
        joints = tuple(self.mechanism.joints)
        if name in self.mechanism.names:
            return f"the joint of {name!r} has no coordinate; choose one of {choices(joints)}"
        if isinstance(name, str) and name in ARRAYS:
            return f"no body is named {name!r}; the array of all is run.{name}"
        if isinstance(name, (int, slice)):
            return f"no body is named {name!r}; frames are rows of run.q, run.v and run.t"
        return no_column(columns_of(self, True), str(name))

    def at(self, t: Any) -> tuple[Array, Array, Any]:
        """Interpolate the state between recorded frames.

        Parameters
        ----------
        t : float or (n,) array
            Times within the run [s].

        Returns
        -------
        q : (nq,) or (n, nq) array
            Configuration.
        v : (nv,) or (n, nv) array
            Velocity.
        error : float or (n,) array
            Estimated maximum error of q [rad, m]. This includes the error of the run at the next
            frame (`error_at`) and the interpolation error. If there is no error estimate, it is
            nan. After the time at which the error becomes unknown, it is inf.

        Raises
        ------
        InputError
            If a time is outside of the simulated interval.
        """
        frames = (self.t, self.q, self.v, self.vdot)
        return states_at(self.mechanism.packed.rows, frames, self.error_at, t)

    def sensitivity(self, path: str, /) -> Array:
        """Return the derivatives of coordinates and velocities with respect to a parameter.

        Parameters
        ----------
        path : str
            One of the paths passed to `simulate` as `wrt`.

        Returns
        -------
        ndarray (n, nq + nv)
            Derivative of [q, v] at each frame.

        Raises
        ------
        InputError
            If the run was not differentiated with respect to this parameter.
        """
        if path not in self.derivatives:
            asked = f"wrt=[{path!r}]"
            text = f"the run was not differentiated by {path!r}; give simulate(..., {asked})"
            if self.derivatives:
                text = f"the run was differentiated by {choices(self.derivatives)}, not by {path!r}"
            raise InputError(Problem("sensitivity", "path", text))
        return self.derivatives[path][:, : self.q.shape[1] + self.v.shape[1]]

    def gradient(self, function: Callable[[Result], Any], /) -> dict[str, Any]:
        """Return the derivatives of a function of this run with respect to the parameters in `wrt`.

        The function is differentiated by central differences along the exact sensitivities of the
        run, with an accuracy of about 1e-10. It can depend on any quantity of the run, such as
        coordinates, energies, forces or outputs.

        Parameters
        ----------
        function : callable
            Function of a run that returns a number or an array.

        Returns
        -------
        dict
            Derivatives by path. Each derivative has the shape of the return value of the function.
            Derivatives are nan, and a warning is issued, if the derivatives of the run have ended
            before.

        Raises
        ------
        InputError
            If the run has no derivatives, or if it was loaded from a file.

        Examples
        --------
            run = pg.simulate(model, t_end=1.0, wrt=["bodies.arm.mass"])
            run.gradient(lambda run: run.q[-1, 0])
        """
        if self.derivatives.source is None:
            text = "the run has no derivatives; give simulate(..., wrt=[paths])"
            raise InputError(Problem("gradient", "", text))
        found = {path: slope_along(self, function, path) for path in self.derivatives}
        lost = [path for path, slope in found.items() if not np.isfinite(slope).all()]
        if lost and np.isfinite(np.asarray(function(self), float)).all():
            ends = [text for text in self.notices if "derivatives" in text]
            why = (
                ends[0]
                if ends
                else "impulses and quantities that depend on them have no derivatives"
            )
            warnings.warn(f"gradient by {choices(lost)} is not finite: {why}", stacklevel=3)
        return found

    @property
    def contact_force(self) -> Mapping[str, Array]:
        """Contact wrenches {contact pair: (n, 6)}, [torque, force] on the body at its origin, world
        axes.

        To obtain the total wrench on a from all contacts between the bodies a and b, use
        `run.contact_force["a", "b"]`. One of them may be "ground". Unknown names raise
        NameLookupError, which is a KeyError.
        """

        def on_other(wrench: Array, a: str, b: str) -> Array:
            origins = [self._origins(name) for name in (a, b)]
            force = wrench[:, 3:]
            torque = wrench[:, :3] + np.cross(origins[0] - origins[1], force)
            return -np.concatenate((torque, force), axis=1)

        return self._by_touch("force", sum, on_other)

    def _origins(self, body: str) -> Array:
        """Return the positions of a body's origin as an (n, 3) or (3,) array."""
        number = self.mechanism.topology.number(body)
        return self.body_pose[:, number - 1, :3] if number else np.zeros(3)

    def _by_touch(self, kind: str, joined: Any, *swapped: Any) -> ByTouch:
        arrays = getattr(self.contacts, kind)
        return ByTouch(arrays, f"contact_{kind}", self.mechanism.model, joined, *swapped)

    contact_gap = _touching("gap", np.minimum.reduce, "Minimum gap [m] of contact pairs")
    contact_slip = _touching("slip", np.maximum.reduce, "Maximum slip speed [m/s]")
    contact_normal = _touching("normal", sum, "Normal force [N] of pairs with the ground")

    @property
    def contact_residual(self) -> Array:
        """Maximum violation of the contact laws since the previous frame, (n, 3).

        The columns are the residual of the complementarity condition [N], the residual of the
        friction cone [N] and the penetration [m]. Limits are included in their own units.
        """
        found = self.contacts.residual
        return found if len(found) else np.zeros((len(self.t), 3))

    @property
    def events(self) -> tuple[Event | UserEvent, ...]:
        """Changes of contacts, limits and switches, and `user_events`, in order of time.

        They are printed as sentences.
        """
        found = self.contacts.events
        return tuple(sorted((*found, *self.user_events), key=lambda event: event.t))

    @property
    def impacts(self) -> tuple[Event, ...]:
        """The events at which a contact began."""
        return tuple(event for event in self.contacts.events if event.before == SWING)

    @property
    def phases(self) -> Mapping[str, Any]:
        """Phases {point: (n,)}: swing, weight acceptance, slip, stance. Limits: free, stop."""
        return Named(self.contacts.phases, "phases", "contact point or limit")

    @property
    def energy(self) -> Array:
        """Total mechanical energy [J], (n,)."""
        return self.kinetic_energy + self.potential_energy

    @cached_property
    def energy_drift(self) -> float:
        """Maximum |E - E0 - work + dissipation|, relative to the range of the energies.

        If nothing moves, the reference is 1e-9 of the largest energy.
        """
        parts = self.kinetic_energy, self.potential_energy, self.work, self.dissipation
        return energy_drift(np.array(parts))[0]

    @cached_property
    def body_pose(self) -> Labelled:
        """Poses of all body frames, (n, nb, 7): x y z [m], w x y z. `run.body_pose["hand"]` is (n,
        7).
        """
        known = vars(self).get("body_motion")
        return self._of_bodies("body_pose", body_poses(self) if known is None else known.pose)

    position = _vector("position", "positions of all body frames")
    velocity = _vector("velocity", "velocities of all body frames")
    angular_velocity = _vector("angular_velocity", "angular velocities of all bodies")
    acceleration = _vector("acceleration", "accelerations of all body frames")
    angular_acceleration = _vector("angular_acceleration", "angular accelerations of all bodies")
    joint_torque = _vector("joint_torque", "torques of each joint on its body at its origin")
    body_velocity = _moving("velocity", "Velocities [angular, linear] of all body frames")
    body_acceleration = _moving("acceleration", "Accelerations [angular, linear] of body frames")
    joint_force = _moving("force", "Wrenches [torque, force] of joints on their bodies' origins")

    @cached_property
    def body_motion(self) -> BodyMotion:
        """Poses, velocities, accelerations and joint forces, computed on first access."""
        found = body_motion(self)
        return found if "body_pose" not in vars(self) else found._replace(pose=self.body_pose)

    @cached_property
    def cams(self) -> Mapping[str, CamRecord]:
        """The contact of each cam: its `pressure_angle`, `normal_force`, `point` and `force`."""
        return Named(cams_of(self), "cams", "cam")

    @cached_property
    def controls(self) -> Mapping[str, Array]:
        """The values {name: (n,)} of the model's controls."""
        model, packed = self.mechanism.model, self.mechanism.packed
        found = values_of(model, packed, acting(self), self.t, *self._with_states())
        return Named(found, "controls", "control")

    @cached_property
    def _paths(self) -> Mapping[str, Path]:
        """The tension and the length of every path by name."""
        return paths_of(self)

    @property
    def tension(self) -> Mapping[str, Array]:
        """Tensions {name: (n,)} of springs, struts, cables and ropes [N], negative if they push.

        A cable or rope has an entry "name[k]" for each of several segments, k from 1. In time
        stepping, those of ropes, and of cables that do not stretch, are means since the last frame.
        """
        return Named({name: path.tension for name, path in self._paths.items()}, *OF_PATHS)

    @property
    def path_length(self) -> Mapping[str, Array]:
        """Lengths {name: (n,)} of springs, struts, cables and ropes [m], as in `tension`."""
        found = {name: path.length for name, path in self._paths.items()}
        return Named(found, "path_length", OF_PATHS[1])

    def _with_states(self, rows: slice = ALL) -> tuple[Array, Array]:
        """Return q and v with the control states appended, as the kernels expect them."""
        q, v, x = self.q[rows], self.v[rows], self.states[rows]
        return np.hstack((q, np.zeros(x.shape))), np.hstack((v, x))


# a run whose notices are not complete has no value of its own: they are found when they are read
_NOTICES = cached_property(Result._all_notices)  # pyright: ignore[reportPrivateUsage]
_NOTICES.__set_name__(Result, "notices")
type.__setattr__(Result, "notices", _NOTICES)
