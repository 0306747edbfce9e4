"""The result of a run: states over time, energies, forces, cost and status. `joined` joins runs."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from zipfile import ZipFile

import numpy as np

from .. import hooks
from ..dynamics.states import BodyMotion, Sensors, no_motion, size_of_motion, sizes_of_states
from ..errors import (
    FileError,
    InputError,
    ModelError,
    PgraphError,
    Problem,
    choices,
    explained,
    guarded,
)
from ..markup import ordinary, reason_of
from ..model.files import shown_path, write_atomic
from ..packing import Array
from ..packing.signals import states_of, values_of
from ..portable import EqualByFields, Portable, ReadOnly
from ..tolerances import EPS
from .bodies import acting, body_motion, body_poses
from .columns import OF_BODIES, Column, columns_of, dataset, frame, matlab, meant, no_column
from .dense import states_at
from .labelled import Labelled, by_body, by_position, by_velocity, labelled
from .records import (
    NO_DERIVATIVES,
    NOTHING,
    ByTouch,
    ContactRecord,
    Derivatives,
    Event,
    Named,
    UserEvent,
)
from .stored import ARRAYS, fields_of, file_of

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class Status(Enum):
    """The final status of a run: reached its end, stopped or failed."""

    DONE = "the run reached its end"
    STOPPED = "an event stopped the run"
    NOT_FINITE = "the motion stopped being finite"
    SINGULAR = "singular mass matrix: no inertia about the axis of a joint"
    CANNOT_CLOSE = "the constraints cannot all be met"
    STEP_TOO_SMALL = "the step that the tolerance requires fell below the resolution of time"
    TOO_MANY_STEPS = "the run reached its largest number of steps"
    NOT_SOLVED = "the equations of an implicit step could not be solved"
    CHATTER = "contacts switch without end"
    CANCELLED = "the run was cancelled"

    @property
    def ok(self) -> bool:
        """Return True if the run reached its end or a terminal user event."""
        return self in (Status.DONE, Status.STOPPED)


# weights of f(x + k h) for 2 h f'(x): central, and on one side if the other is invalid
SLOPES = ({1: 1, -1: -1}, {0: -3, 1: 4, 2: -1}, {0: 3, -1: -4, -2: 1})
BESIDE = np.cbrt(EPS)  # rad, m, or of a number: where rounding and curvature are about equal
MORE = "_more"  # attribute with the notices found so far, and the function that finds the others
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a cell that begins so is calculated

BY_JOINT = {"q": by_position, "v": by_velocity, "vdot": by_velocity}  # arrays with names of joints


@guarded(other="a run does not change; dataclasses.replace(run, q=...) makes another one")
@explained
@dataclass(frozen=True, eq=False)
class Result(EqualByFields, Portable):
    """The result of a run, with arrays that have one row per recorded frame.

    If a run fails, the frames up to the failure are kept. Two runs are equal if their models and
    all their numbers are equal. Their costs are not compared.
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

    def __post_init__(self) -> None:
        """Make the arrays read-only, because a run does not change."""
        own, joints = vars(self), self.mechanism.joints
        for name in ARRAYS:
            array = np.asarray(own[name])
            places = BY_JOINT.get(name)
            view = labelled(array, name, places, joints) if places else array.view()
            own[name] = view
            view.flags.writeable = False
        self.constraint_force.keep_unchanged()
        if self.contacts is not NOTHING:
            self.contacts.keep_unchanged()
        instead = "a run does not change; dict(...) makes a copy"
        for name in ("counters", "timing", "header"):
            own[name] = ReadOnly(own[name], f"run.{name}", instead)

    def _of_bodies(self, attribute: str, array: Array) -> Labelled:
        """Return an array (n, nb, ...) that names of bodies index too."""
        return labelled(array, attribute, by_body, self.mechanism.names)

    def _vector(self, kind: str) -> Labelled:
        """Return a vector of all bodies, a quantity of `OF_BODIES`."""
        _, attribute, first = OF_BODIES[kind]
        return self._of_bodies(kind, getattr(self, attribute)[..., first : first + 3])

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields, with all notices."""
        _ = self.notices
        return vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.__post_init__()

    def add_when_read(self, more: Callable[[], tuple[str, ...]]) -> None:
        """Let `more` find further notices when they are first read: it takes as long as a run."""
        own = vars(self)
        own[MORE] = own.pop("notices"), more

    def _all_notices(self) -> tuple[str, ...]:
        own = vars(self)
        first, more = own[MORE]
        found = (*first, *more())
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
        text = f"<Result: {len(self.t)} frames over {span} by {method}, {error}"
        if self.notices:
            text += f", {len(self.notices)} notice{'s'[: len(self.notices) > 1]}"
        return f"{text}>" if self.status.ok else f"{text};\n {self.message}>"

    def __str__(self) -> str:
        """Return the repr, followed by one line per notice."""
        left = [text for text in self.notices if self.status.ok or text not in self.message]
        return "\n".join((repr(self), *(f"  notice: {text}" for text in left)))

    @property
    def success(self) -> bool:
        """True if the run reached its end, or an event that ends runs."""
        return self.status.ok

    @property
    def error_estimate(self) -> float:
        """Estimated maximum error in q [rad, m] at the recorded times, last of `error_at`."""
        return float(self.error_at[-1]) if len(self.error_at) else np.nan

    @property
    def relative_error(self) -> Array:
        """Return the largest part of its range by which the motion or a state is off, (n,).

        The motion's range is the largest displacement of a joint from the start. Where nothing
        moves, it is 1.5e-8 of the mechanism's length, or of a state's value if that is larger.
        """
        packed = self.mechanism.packed
        share = self.error_at / (size_of_motion(packed.rows, self.q, packed.length) or 1.0)
        own = self._shares_of_states()
        return np.maximum(share, own.max(axis=1)) if own.size else share

    def _shares_of_states(self) -> Array:
        """Return the errors of states over their ranges, (n, nx)."""
        return self.state_error_at / sizes_of_states(self.states, self.mechanism.packed.length)

    @property
    def accuracy(self) -> str:
        """The error estimate as text: "3e-06 rad or m, 0.01 % of the motion", "not estimated"."""
        error = self.error_estimate
        if np.isnan(error):
            return "not estimated"
        if np.isfinite(error):
            packed = self.mechanism.packed
            size = size_of_motion(packed.rows, self.q, packed.length) or 1.0
            text = f"{error:.2g} rad or m, {100.0 * error / size:.2g} % of the motion"
            own = self._shares_of_states()[-1:].ravel()
            if own.max(initial=0.0) <= error / size:
                return text
            control, k, _ = states_of(self.mechanism.model)[int(np.argmax(own))]
            share = f"{100.0 * own.max():.2g} %" if np.isfinite(own.max()) else "an unknown part"
            return f"{text}, {share} of the range of x.{control.name}[{k + 1}]"
        last = int(np.isfinite(self.error_at).sum()) - 1
        until, before = self.t[last], self.error_at[last]
        return f"known until t = {until:.4g} s only: {before:.2g} rad or m"

    def __getitem__(self, name: str) -> Array:
        """Return a joint's coordinates over time, (n,) or (n, k) for k > 1, or another column.

        Raises InputError if unknown.
        """
        joints = self.mechanism.joints
        if not isinstance(name, str):
            raise InputError(Problem("run", "name", self._no_joint(name)))
        if name not in joints:
            columns = columns_of(self)
            if name in columns:
                return columns[name].values
            other = name in ARRAYS or name in self.mechanism.names
            if not other and (found := self._meant(name)):
                picked = [column.values for column in found.values()]
                return picked[0] if len(found) == 1 else np.stack(picked, axis=1)
            raise InputError(Problem("run", "name", self._no_joint(name)))
        return cast(Labelled, self.q)[name]

    def _meant(self, name: str) -> dict[str, Column]:
        """Return the columns that match a name. Those of bodies match only if no others do."""
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
        near = get_close_matches(str(name), joints)
        hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ";"
        return f"no body is named {name!r}{hint} choose one of {choices(joints)}"

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
            Estimated largest error of q, of the run at the next frame (`error_at`) and of the
            interpolation [rad, m]. It is nan without an error estimate, and inf after the time
            until which the error is known.

        Raises
        ------
        InputError
            If a time is outside the run.
        """
        frames = (self.t, self.q, self.v, self.vdot)
        return states_at(self.mechanism.packed.rows, frames, self.error_at, t)

    def sensitivity(self, path: str, /) -> Array:
        """Return the derivative of coordinates and velocities by one number of the model.

        Parameters
        ----------
        path : str
            One of the paths given as `wrt`.

        Returns
        -------
        ndarray (n, nq + nv)
            Derivative of [q, v] in each frame.

        Raises
        ------
        InputError
            If the run was not differentiated by this number.
        """
        if path not in self.derivatives:
            asked = f"wrt=[{path!r}]"
            text = f"the run was not differentiated by {path!r}; give simulate(..., {asked})"
            if self.derivatives:
                text = f"the run was differentiated by {choices(self.derivatives)}, not by {path!r}"
            raise InputError(Problem("sensitivity", "path", text))
        return self.derivatives[path][:, : self.q.shape[1] + self.v.shape[1]]

    def gradient(self, function: Callable[[Result], Any], /) -> dict[str, Any]:
        """Return the derivatives of a function of this run by the numbers of `wrt`.

        The function is differentiated by central differences along the exact sensitivities of the
        run, to about 1e-10. It can use any quantity of the run, such as coordinates, energies,
        forces or outputs.

        Parameters
        ----------
        function : callable
            Function of a run that returns a number or an array.

        Returns
        -------
        dict
            {path: derivative}, with the shape of the function's result.

        Raises
        ------
        InputError
            If the run has no derivatives, or was read from a file.
        """
        if self.derivatives.source is None:
            text = "the run has no derivatives; give simulate(..., wrt=[paths])"
            raise InputError(Problem("gradient", "", text))
        return {path: self._slope_along(function, path) for path in self.derivatives}

    def _slope_along(self, function: Callable[[Result], Any], path: str) -> Any:
        source, moves = self.derivatives.source, np.abs(self.sensitivity(path))
        step = BESIDE / max(float(np.nanmax(moves, initial=0.0)), 1.0 / source.scale_of(path))
        refused: ModelError | None = None
        for weights in SLOPES:
            try:
                parts = [
                    weight * np.asarray(function(source.beside(self, path, k * step)), float)
                    for k, weight in weights.items()
                ]
                slope = np.asarray(sum(parts) / (2.0 * step))
                return slope if slope.ndim else float(slope)
            except ModelError as error:  # on this side no model is valid
                refused = error
        assert refused is not None
        raise refused

    def to_pandas(self, *, bodies: bool = False) -> Any:
        """Return a pandas DataFrame of `columns` with one row per frame, indexed by time t [s].

        Columns of words, such as the phases of contacts, are omitted. `table["trunk"]` returns all
        columns of the joint. An unknown name raises a KeyError that lists the columns.
        `table.attrs["units"]` contains the units. `bodies` as for `columns`. Needs pandas.
        """
        return frame(columns_of(self, bodies))

    def to_xarray(self, *, bodies: bool = False) -> Any:
        """Return an xarray Dataset of `columns` over time t [s], with units.

        Columns of words are omitted. `bodies` as for `columns`. Needs xarray.
        """
        return dataset(columns_of(self, bodies))

    def plot(self, *names: str) -> Any:
        """Plot columns over time with Matplotlib, by default all coordinates.

        Parameters
        ----------
        names : str
            Names of columns, or the beginnings of several: "knee", "v", "energy", "contact_force".

        Returns
        -------
        Figure
            A Matplotlib figure.

        Raises
        ------
        InputError
            If no column has such a name.

        Examples
        --------
            run.plot("knee", "energy").savefig("knee.png")
        """
        picked = dict[str, Column]()
        for name in names or ("q",):
            found = self._meant(name)
            found.pop("t", None)
            if not found and names:
                raise InputError(Problem("plot", "", no_column(columns_of(self, True), name)))
            picked |= found
        return _show().figure(self.t, picked, self.mechanism.model.name)

    def to_html(self, path: str | Path, /, *, live: bool = False, open: Sequence[str] = ()) -> None:
        """Write the run as a 3D animation in one self-contained HTML file.

        Parameters
        ----------
        path : str or path
            The file to write.
        live : bool
            Whether readers can run the mechanism and pull on it (docs/gallery.md).
        open : iterable of str
            Fields that readers can change in a live figure, PATH or PATH=low:high, such as
            "bodies.lower.mass=0.2:5".

        Raises
        ------
        InputError
            If a field cannot be left open.
        FileError
            If the file has another suffix or cannot be written.
        """
        if Path(path).suffix.lower() not in (".html", ".htm"):
            text = "is not a web page; give a name that ends in .html"
            raise FileError(Problem(str(path), "", text))
        if live or open:
            write_atomic(path, hooks.page(self, open).encode())
            return
        write_atomic(path, _show().animation_html(self).encode())

    def to_image(
        self, path: str | Path, /, *, t: float | None = None, size: tuple[int, int] = (1280, 720),
        view: str = "start", dark: bool = False,
    ) -> None:  # fmt: skip
        """Draw the mechanism in 3D at one instant of the run. No display is needed.

        Parameters
        ----------
        path : str or path
            The file to write, with the suffix .png.
        t : float, optional
            Time [s], by default the start.
        size : (int, int)
            Width and height in pixels.
        view : {"start", "front", "side", "top", "isometric"}
            Direction of the view.
        dark : bool
            Whether the background is dark.

        Raises
        ------
        InputError, FileError
            If arguments do not fit, or the file cannot be written.
        """
        from ..show import pictures  # with its kernels

        write_atomic(path, pictures.moment(self, path, t, size=size, view=view, dark=dark))

    def to_plot(self, path: str | Path, /, *names: str, size: tuple[int, int] = (900, 600)) -> None:
        """Write the plot of `plot` to an image file.

        Parameters
        ----------
        path : path
            The file, .png or .svg.
        *names : str
            Quantities, as for `plot`.
        size : (int, int), optional
            Width and height [pixels].

        Raises
        ------
        InputError
            If a quantity does not exist.
        FileError
            If the file cannot be written.
        MissingPackage
            If Matplotlib is not installed.
        """
        from ..show import pictures

        write_atomic(path, pictures.plot(self, path, names, size=size))

    def to_film(
        self, path: str | Path, /, *, size: tuple[int, int] = (960, 540), fps: float = 30,
        speed: float = 1.0, view: str = "start", dark: bool = False,
        progress: Callable[[float], Any] | None = None,
    ) -> None:  # fmt: skip
        """Write a video of the run.

        Parameters
        ----------
        path : str or path
            The file to write, .mp4 (H.264) or .gif.
        speed : float
            Playback speed: 0.5 plays at half speed.
        fps : float
            Pictures per second.
        size : (int, int)
            Width and height in pixels.
        view : {"start", "front", "side", "top", "isometric"}
            Direction of the view.
        dark : bool
            Whether the background is dark.
        progress : callable, optional
            Function of the completed fraction, called after each frame. Nothing is written if it
            returns False.

        Raises
        ------
        InputError, FileError
            If arguments do not fit, or the file cannot be written.
        MissingPackage
            If a package has to be installed first.
        """
        options = {"size": size, "fps": fps, "speed": speed, "view": view, "dark": dark}
        from ..show import pictures

        made = pictures.film(self, path, **options, progress=progress)
        if made is not None:
            write_atomic(path, made)

    def show(self) -> Any:
        """Show the animation. Returns an object to display in a notebook, or opens a browser."""
        return _show().opened(_show().animation_html(self))

    def _repr_html_(self) -> str:
        """Return the summary with a live figure if the browser can compute it, or an animation."""
        facts = _show().run_html(self)
        if not len(self.t) or not self.mechanism.names:
            return facts
        return facts + _show().Embedded(hooks.page(self), FIGURE)._repr_html_()

    @property
    def contact_force(self) -> Mapping[str, Array]:
        """Contact wrenches {contact pair: (n, 6)}, [torque, force] on the body at its origin, world
        axes.

        `run.contact_force["a", "b"]` is the total wrench on a of all contacts between the bodies a
        and b, one of which may be "ground". Raises NameLookupError, a KeyError, for names that are
        not there.
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

    @property
    def contact_gap(self) -> Mapping[str, Array]:
        """Minimum gap [m] as {contact pair: (n,)}. Also accepts two names like `contact_force`."""
        return self._by_touch("gap", np.minimum.reduce)

    @property
    def contact_slip(self) -> Mapping[str, Array]:
        """Maximum slip speed [m/s] as {contact pair: (n,)}. Two names of bodies are also
        accepted."""
        return self._by_touch("slip", np.maximum.reduce)

    @property
    def contact_residual(self) -> Array:
        """Maximum violation of the contact laws since the previous frame, (n, 3).

        Of complementarity [N]: by how much normal forces differ from those that end the approach;
        of the cone [N]: by how much friction differs from what Coulomb's disc allows against the
        slip; and the penetration [m]. Limits are included in their own units.
        """
        found = self.contacts.residual
        return found if len(found) else np.zeros((len(self.t), 3))

    @property
    def contact_normal(self) -> Mapping[str, Array]:
        """Normal force [N] for pairs with the ground, as {contact pair: (n,)}."""
        return self._by_touch("normal", sum)

    @property
    def events(self) -> tuple[Event, ...]:
        """Contact point and limit changes in event-driven runs. Each prints as a sentence."""
        return self.contacts.events

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
        """Maximum |E - E0 - work + dissipation|, relative to the range of the energies."""
        if len(self.t) < 2:
            return 0.0
        ledger = self.energy - self.work + self.dissipation
        balance = ledger - ledger[0]
        parts = (self.kinetic_energy, self.potential_energy, self.work, self.dissipation)
        scale = max(float(np.ptp(part)) for part in parts)
        scale = max(scale, float(np.max(self.kinetic_energy)))
        worst = float(np.max(np.abs(balance)))
        return worst / scale if scale > 0 else worst

    @cached_property
    def body_pose(self) -> Labelled:
        """Poses of all body frames, (n, nb, 7): x y z [m], w x y z. `run.body_pose["hand"]` is (n,
        7).
        """
        known = vars(self).get("body_motion")
        return self._of_bodies("body_pose", body_poses(self) if known is None else known.pose)

    @property
    def position(self) -> Labelled:
        """Positions of all body frames [m], (n, nb, 3). `run.position["hand"]` is (n, 3)."""
        return self._vector("position")

    @property
    def velocity(self) -> Labelled:
        """Velocities of all body frames in world axes [m/s], (n, nb, 3) or by name of body."""
        return self._vector("velocity")

    @property
    def angular_velocity(self) -> Labelled:
        """Angular velocities in world axes [rad/s], (n, nb, 3) or by name of body."""
        return self._vector("angular_velocity")

    @property
    def acceleration(self) -> Labelled:
        """Accelerations of all body frames in world axes [m/s^2], (n, nb, 3) or by name of body."""
        return self._vector("acceleration")

    @property
    def angular_acceleration(self) -> Labelled:
        """Angular accelerations in world axes [rad/s^2], (n, nb, 3) or by name of body."""
        return self._vector("angular_acceleration")

    @property
    def body_velocity(self) -> Labelled:
        """Velocities [angular, linear] of all body frames in world axes, (n, nb, 6)."""
        return self._of_bodies("body_velocity", self.body_motion.velocity)

    @property
    def body_acceleration(self) -> Labelled:
        """Accelerations [angular, linear] of all body frames in world axes, (n, nb, 6)."""
        return self._of_bodies("body_acceleration", self.body_motion.acceleration)

    @property
    def joint_force(self) -> Labelled:
        """Wrenches [torque, force] of each joint on its body at its origin, (n, nb, 6)."""
        return self._of_bodies("joint_force", self.body_motion.force)

    @property
    def joint_torque(self) -> Labelled:
        """Torques of each joint on its body at its origin, in world axes [N m], (n, nb, 3)."""
        return self._vector("joint_torque")

    @cached_property
    def body_motion(self) -> BodyMotion:
        """Poses, velocities, accelerations and joint forces, computed on first access."""
        found = body_motion(self)
        return found if "body_pose" not in vars(self) else found._replace(pose=self.body_pose)

    @cached_property
    def outputs(self) -> Mapping[str, Array]:
        """Readings of the model's outputs, {name: (n,), (n, 3) or (n, 4)}. See `Output`."""
        sensors = Sensors(self.mechanism.packed, self.mechanism.model)
        motion = self.body_motion if sensors.moves else no_motion(len(self.t))
        read = sensors.read(self.q.copy(), self.v.copy(), motion)
        return Named(sensors.by_name(read), "outputs", "output")

    @cached_property
    def controls(self) -> Mapping[str, Array]:
        """The values {name: (n,)} of the model's controls."""
        model, packed = self.mechanism.model, self.mechanism.packed
        found = values_of(model, packed, acting(self), self.t, *self._with_states())
        return Named(found, "controls", "control")

    def _with_states(self) -> tuple[Array, Array]:
        """Return q and v as kernels take them, which end with the states of controls."""
        none = np.zeros(self.states.shape)
        return np.hstack((self.q, none)), np.hstack((self.v, self.states))

    # -- files -------------------------------------------------------------------------------

    def save(self, path: str | Path, /) -> None:
        """Save the run with its model, or its columns as a table.

        Parameters
        ----------
        path : path
            A `.npz` file contains the run with its model, and meshes from other folders are copied
            to `meshes` next to it. A `.csv` file is a table. A `.mat` file (MATLAB, Octave) has one
            variable per column, with `_` in place of characters other than letters and digits, and
            the lists `names` and `units`.

        Raises
        ------
        FileError
            If the file cannot be written or has another suffix.
        """
        suffix = Path(path).suffix.lower()
        if suffix == ".csv":
            self.to_csv(path)
            return
        if suffix == ".mat":
            write_atomic(path, matlab(columns_of(self)))
            return
        if suffix != ".npz":
            text = "must end in .npz (the whole run), .csv or .mat (tables); to_html animates"
            raise FileError(Problem(str(path), "", text))
        write_atomic(path, file_of(self, Path(path).parent))

    @classmethod
    def load(cls, path: str | Path, /, *, roots: Iterable[str | Path] = ()) -> Result:
        """Load a run that `save` wrote.

        Parameters
        ----------
        path : path
            An `.npz` file.
        roots : iterable of paths, optional
            Additional folders for meshes, apart from the folder of the file.

        Raises
        ------
        FileError
            If the file cannot be read.
        ModelError
            If its model is not valid.
        """
        try:
            file = ordinary(path)
        except (OSError, ValueError) as error:
            reason = reason_of(error)
            text = f"cannot be read: {reason[:1].lower()}{reason[1:]}; {WRITTEN}"
            raise FileError(Problem(shown_path(path), "", text)) from None
        try:
            with file:
                if file.read(2) != b"PK":  # the first bytes of a zip file, hence of an .npz file
                    text = f"is not a saved run (.npz); {WRITTEN}"
                    raise FileError(Problem(str(path), "", text))
                given = fields_of(ZipFile(file), path, roots)
                status = Status(Status.__members__.get(given["status"]))
                return cls(**{**given, "status": status})
        except PgraphError:
            raise
        except KeyError as missing:
            text = f"holds no whole run: {missing} is missing; {WRITTEN}"
        except (TypeError, ValueError, AttributeError):
            text = f"holds no whole run; {WRITTEN}"
        except Exception:  # zip, zlib, numpy and its parser raise any error on damaged files
            text = (
                "is damaged and cannot be read as a run; save the run again, or copy the file again"
            )
        raise FileError(Problem(str(path), "", text))

    def to_csv(self, path: str | Path | None = None, /, *, bodies: bool = False) -> str:
        """Return `columns` as CSV text with units in the header line, "knee [rad]".

        A name that a spreadsheet would interpret as a formula begins with a quote. The text is
        also written to a `path`, if one is given. `bodies` as for `columns`. Raises FileError.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        columns = columns_of(self, bodies)
        heads = (f"{name} [{c.unit}]" if c.unit else name for name, c in columns.items())
        writer.writerow(f"'{head}" if head[:1] in FORMULA else head for head in heads)
        writer.writerows(zip(*(c.values.tolist() for c in columns.values())))
        if path is not None:
            write_atomic(path, text.getvalue())
        return text.getvalue()

    def columns(self, *, bodies: bool = False) -> dict[str, Any]:
        """Return the columns of the run as a table {name: (n,)}.

        A coordinate has the name of its body, "knee". Every other column begins with the name of
        its quantity: "v.knee", "energy", "contact_force.paw.z". `to_csv` adds the units.

        Parameters
        ----------
        bodies : bool, optional
            Whether to add the motion of all body frames in world axes and the wrenches of their
            joints: "position.hand.x", "angular_acceleration.hand.z", "joint_force.hand.x". These
            are found by `run["position.hand"]` and `run.plot("velocity.hand")` in any case.
        """
        return {name: column.values for name, column in columns_of(self, bodies).items()}


WRITTEN = "give a file written by Result.save"


def _show() -> Any:
    from .. import show

    return show


FIGURE = 560  # [pixels] height of the figure of a run in a notebook

# a run whose notices are not complete has no value of its own: they are found when they are read
_NOTICES = cached_property(Result._all_notices)  # pyright: ignore[reportPrivateUsage]
_NOTICES.__set_name__(Result, "notices")
type.__setattr__(Result, "notices", _NOTICES)
