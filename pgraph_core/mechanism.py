"""The mechanism, which holds the dynamics of a model and provides its analyses as methods."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, wraps
from threading import Lock
from typing import TYPE_CHECKING, Any, cast
from warnings import warn
from weakref import ref

import numpy as np

from .analysis.assembly import Assembly, assemble, changes, followed
from .analysis.mobility import Mobility, mobility
from .dynamics import Dynamics
from .dynamics.arguments import by_name, finite, for_each_state, named_in, wrong_type
from .dynamics.dynamics import EMPTY, UNFIT
from .dynamics.many import parameters, regressor
from .errors import Called, InputError, Problem, explained, shown
from .model import Model, Motion, Polynomial
from .packing import Array

if TYPE_CHECKING:
    from .analysis.activations import Activations
    from .analysis.linear import Linearisation

OF_MODEL = "_mechanism"  # among the attributes of a model
MOST_KEPT = 8  # models that keep their mechanism
OF_TOPOLOGY = {"adjacency", "parent", "separation_bodies", "tips"}  # names that it has too


@cache
def _derivatives() -> Any:
    from .analysis.linear import forward_derivatives  # compiled when first used

    return forward_derivatives


@explained
class Mechanism(Dynamics):
    """A model with canonical numbers, packed for the compiled kernels.

    The arrays q (nq,), v (nv,) and tau (nv,) are ordered by body number, as given by `names`. Body
    0 is the ground. A dictionary or pandas row by body name is accepted in place of each of them. A
    mechanism has no internal state, so results only depend on the arguments.
    Methods raise InputError for arrays that have the wrong length or contain values that are not
    finite.

    For example, to compute the angular acceleration of two rods at rest:

        mech = pg.Mechanism(pg.Model.serial(2))
        vdot = mech.forward_dynamics(q=[0.1, 0.2], v=[0, 0])
    """

    _spread: bool = False  # a call has warned that all joints are actuated

    def __dir__(self) -> Iterable[str]:
        return sorted(set(super().__dir__()) - OF_TOPOLOGY)

    def __contains__(self, name: Any) -> bool:
        """Check whether the model has a part `name`."""
        return name in self.model

    def __eq__(self, other: object) -> bool:
        """Compare the models."""
        return self is other or (isinstance(other, Mechanism) and self.model == other.model)

    def __hash__(self) -> int:
        return hash(self.model)

    def assemble(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> tuple[Array, Array, Assembly]:
        """Find the state closest to (q, v) that satisfies the constraints.

        The distance is defined by the mass matrix. All coordinates may change, including those
        given in an array. A dictionary holds the coordinates that it names. The loops then stay on
        the branch of the initial configuration if it reaches that far.

        Parameters
        ----------
        q : (nq,) array or dict, optional
            Initial guess for the configuration [rad, m]. The default is the initial state.
        v : (nv,) array or dict, optional
            Initial guess for the velocity [rad/s, m/s]. The default is the initial state.
        active : sequence of str, optional
            Names of the constraints to satisfy. By default, all active constraints.

        Returns
        -------
        q : (nq,) array
            The assembled configuration.
        v : (nv,) array
            A consistent velocity.
        report : Assembly
            The changes and the remaining errors.

        Raises
        ------
        InputError
            If the constraints cannot be satisfied.
        """
        named = named_in({"q": q, "v": v})
        if not named or active is not None:
            q, v = by_name(self, "q", q), by_name(self, "v", v, self.home()[1])
            return assemble(self, q, v, active)
        given = {"q": q, "v": v, **super()._by_names(named, {})}
        q, v, _ = assemble(self, *{"q": q, "v": v, **self._by_names(named, {"q": q})}.values())
        home_q, home_v = self.home()
        before = home_q if given["q"] is None else given["q"]
        speeds = home_v if given["v"] is None else given["v"]
        return q, v, changes(self, before, speeds, q, v)

    def _by_names(self, named: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Array]:
        """Return a state by names, with the joints that are not named as the constraints demand.

        The named joints go from the initial position to the given one, and the others follow, so
        that closed loops stay on their branch.
        """
        found = super()._by_names(named, given)
        names = dict.fromkeys(name for kind in ("q", "v", "vdot") for name in named.get(kind, ()))
        if not names or not len(self.packed.active) or names.keys() == self.joints.keys():
            return found
        rest, joints = np.zeros(self.nv), self.joints
        for name in names:
            if joints[name].v.stop - joints[name].v.start > 1:
                text = "has several numbers, which no dictionary holds where constraints act; give "
                text += "arrays, such as those that mech.assemble(q, v) returns"
                raise InputError(Problem(f"Mechanism, '{name}'", "q", text))
        q, v, vdot = (found.get(kind, rest) for kind in ("q", "v", "vdot"))
        if "q" not in named:
            q = self.home()[0] if given.get("q") is None else np.asarray(given["q"], float)
        spans = {name: (joints[name].q, joints[name].v) for name in names}
        there: Array | None = q
        if "q" in named:
            start = assemble(self)[0]
            way = {name: (*start[i], *(q - start)[i]) for name, (i, _) in spans.items()}
            there = followed(self._held(way), start)
        terms = {name: (*q[i], *v[j], *vdot[j] / 2) for name, (i, j) in spans.items()}
        other = self._held(terms)
        q, v, _ = assemble(other, q if there is None else there, v, None)
        if there is None:
            warn(
                "the loops do not follow the named joints from the initial position to the given "
                "one, so they were closed anew, perhaps on another branch; give every joint",
                stacklevel=4,
            )
        whole = {"q": q, "v": v, "vdot": other._constrained_acceleration(q, v)[0]}
        return {kind: whole.get(kind, values) for kind, values in found.items()}

    def _held(self, terms: Mapping[str, tuple[float, ...]]) -> Mechanism:
        """Return the mechanism with joints that follow polynomials of time."""
        held = [
            Motion(name=f"{name} as given", body=name, q_of_t=Polynomial(coefficients=numbers))
            for name, numbers in terms.items()
        ]
        return Mechanism(self.model.replace(constraints=(*self.model.constraints, *held)))

    def mobility(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> Mobility:
        """Return the degrees of freedom, redundant rows and singular positions at q.

        Parameters
        ----------
        q : (nq,) array or dict, optional
            Configuration, by default the initial one.
        v : (nv,) array or dict, optional
            Velocity used to select a branch at a singular position.
        active : sequence of str, optional
            Names of the constraints. By default, all active constraints.

        Returns
        -------
        Mobility
            The result, which can be printed as a report.

        Raises
        ------
        InputError
            If the constraints cannot be met.
        """
        if active is None:
            q, v = self._numbers(q=q, v=v)
        return mobility(self, by_name(self, "q", q), by_name(self, "v", v), active)

    @for_each_state
    def constrained_inverse_dynamics(
        self,
        q: Array,
        v: Array,
        vdot: Array,
        actuated: Sequence[str] | None = None,
        weights: Array | Mapping[str, float] | None = None,
        nearest: bool = False,
    ) -> Array:
        """Compute the joint torques that produce v', subject to all active constraints.

        This is the inverse of `constrained_dynamics`. The torques act in addition to the passive
        forces of the model and to the forces of prescribed motions. If the solution is not unique,
        the torques that minimise Σ weights τ² are returned.

        Parameters
        ----------
        q, v, vdot : (nq,), (nv,) and (nv,) arrays, or dict
            State and acceleration. Arrays must satisfy the constraints. In dictionaries by body
            name, the values of other joints follow from the constraints.
        actuated : sequence of str, optional
            Names of the bodies whose joints are actuated. By default, all joints are, and a warning
            says so once if the constraints leave a choice of torques.
        weights : (nv,) array or dict, optional
            Positive weights of the torques, in number order or by name of body.
        nearest : bool, optional
            Whether to replace a v' that the constraints exclude, for example from finite
            differences, by the nearest one in the mass metric that they permit.

        Returns
        -------
        (nv,) array
            Torques [N m] and forces [N].

        Raises
        ------
        InputError
            If q, v or v' violate a constraint, or if the acceleration cannot be produced by the
            actuated joints. The relative tolerance of the forces is 1e-9.
        """
        from .analysis.inverse import constrained_inverse_dynamics

        if nearest not in (True, False):
            text = f"must be True or False, got {shown(nearest)}"
            raise InputError(Problem("constrained_inverse_dynamics", "nearest", text))
        tau = constrained_inverse_dynamics(self, q, v, vdot, actuated, weights, nearest)
        if actuated is None and weights is None and len(self.packed.active) and not self._spread:
            self._spread = True
            text = "gives every joint a torque, the least in all: name the joints that have a drive"
            warn(
                f"constrained_inverse_dynamics {text}, actuated=[...], or give weights",
                stacklevel=4,
            )
        return tau

    @for_each_state
    def forward_derivatives(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Compute the derivatives of `forward_dynamics` with respect to q, v and τ.

        The derivatives are exact to rounding, i.e. about 1e-16 of the largest entry times the
        condition number of M. The contribution of springs between bodies is computed by finite
        differences with an accuracy of 1e-11.

        Parameters
        ----------
        q, v : (nq,) and (nv,) arrays
            State.
        tau : (nv,) array, optional
            Torques, by default zero.

        Returns
        -------
        by_q, by_v, by_tau : (nv, nv) arrays
            ∂v'/∂q, ∂v'/∂v and ∂v'/∂τ. Note that the columns of ∂v'/∂q refer to displacements along
            v, such as a rotation vector in body axes for a ball joint, instead of the entries of q.
        """
        return _derivatives()(self, q, v, tau)

    def regressor(self, q: Array, v: Array, vdot: Array) -> Array:
        """Return the matrix Y with which joint torques are linear in masses and inertias.

        τ = Y π of the bodies' inertial parameters π, in addition to armature and passive forces, as
        in `inverse_dynamics`. Where constraints act, τ includes the torques of their forces.

        Parameters
        ----------
        q, v, vdot : (nq,), (nv,) and (nv,) arrays, or one row for each of n states
            State and acceleration.

        Returns
        -------
        (nv, 10 nb) or (n, nv, 10 nb) array
            Y, with ten columns for each body by number.

        Examples
        --------
            Y = mech.regressor(q, v, vdot)
            tau = Y @ mech.inertial_parameters()
        """
        states = tuple(self._numbers(q=q, v=v, vdot=vdot))
        one = all(np.ndim(x) < 2 for x in states)
        q, v, vdot = (np.atleast_2d(np.asarray(x)) for x in states)
        n = max(map(len, (q, v, vdot)))
        sizes = {"q": (q, self.nq), "v": (v, self.nv), "vdot": (vdot, self.nv)}
        given = [finite(name, x, len(x), size) for name, (x, size) in sizes.items()]
        found = regressor(self, *(np.broadcast_to(x, (n, x.shape[1])) for x in given))
        return found[0] if one else found

    def inertial_parameters(self) -> Array:
        """Return the ten inertial parameters of each body by number, (10 nb,).

        They are the mass [kg], the mass times the centre of mass [kg m], and the inertia about the
        body's origin, xx, xy, xz, yy, yz and zz [kg m^2], in body axes.
        """
        return parameters(self)

    def linearise(
        self, q: Array | None = None, v: Array | None = None, scenario: str | None = None
    ) -> Linearisation:
        """Linearise the equations of motion about a state: x' = drift + A x + B δτ.

        The vector x contains independent coordinates, their velocities and the states of controls.
        If possible, the control states are chosen such that the system is at rest. All forces and
        active constraints of a run at t = 0 are included. Soft and penalty contacts act as springs
        and dampers, whereas closed rigid contacts and limits are ignored because they have no
        derivative. In this case, or if the state is not an equilibrium, a warning is added to
        `notices` of the result. Velocity constraints only reduce the number of velocities. For a
        conservative mechanism at rest, the eigenvalues ±iω are computed from two symmetric problems
        and are accurate to 1e-12 for a chain of 1000 bodies.

        Parameters
        ----------
        q : (nq,) array or dict, optional
            Configuration. The default is the initial state of the scenario or model.
        v : (nv,) array or dict, optional
            Velocity. If q is given, v defaults to zero.
        scenario : str, optional
            Name of a scenario.

        Returns
        -------
        Linearisation
            The matrices A and B, drift, eigenvalues and modes. Its method `state_space` can be used
            with SciPy and python-control.

        Raises
        ------
        InputError
            If the constraints cannot be satisfied, or if the model has a sampled control.
        """
        from .analysis.linear import linearise  # compiled for lanes

        return linearise(self, q, v, scenario)

    def equilibrium(self, q: Array | None = None, scenario: str | None = None) -> Array:
        """Find an equilibrium, starting from q.

        All forces of a run at t = 0 are included, as well as active constraints, joint limits, and
        control states such as the integral of a PID controller. Lagging inputs have reached their
        values. Tendons and springs rest on their limits, and cables that do not stretch are taut or
        slack. Contacts exert no force here. If all forces are conservative, the energy is
        minimised, so the result is stable unless q is already an equilibrium.

        Parameters
        ----------
        q : (nq,) array or dict, optional
            Configuration to start from, by default the initial one.
        scenario : str, optional
            Name of a scenario.

        Returns
        -------
        (nq,) array
            The configuration [rad, m].

        Raises
        ------
        InputError
            If no equilibrium is found, if it lies inside a contact, or if the model has a sampled
            control.
        """
        from .analysis.equilibrium import equilibrium  # compiled for lanes

        return equilibrium(self, q, scenario)

    def activations(
        self, torques: Mapping[str, float], q: Any = None, v: Any = None
    ) -> Activations:
        """Find activations of the muscles that exert these torques, with the least sum of squares.

        This is static optimisation: the torques and the state are given, and the muscles share the
        torques. Tendons are rigid. Joints without a given torque may get any. If the muscles do not
        reach the torques, the nearest ones that they reach are returned, with a notice.

        Parameters
        ----------
        torques : dict
            Torque or force for each joint by name [N m, N], "hip.1" for one of several coordinates.
        q, v : array or dict, optional
            State, by default the initial coordinates and rest.

        Returns
        -------
        Activations
            `activation`, `tension` and `torque` by name, and `notices`.

        Raises
        ------
        InputError
            If the model has no muscle, or a joint or number is invalid.

        Examples
        --------
            found = mech.activations({"forearm": 12.0}, q={"forearm": 1.2})
            found.activation["biceps"]
        """
        from .analysis.activations import activations

        home, rest = self.home()[0], np.zeros(self.nv)
        at, speed = home if q is None else q, rest if v is None else v
        at, speed = self._state(by_name(self, "q", at, home), by_name(self, "v", speed, rest))
        finite("q", at, self.nq, of=self.packed)
        finite("v", speed, self.nv, of=self.packed)
        return activations(self, torques, at, speed)

    def inverse_kinematics(
        self,
        targets: Mapping[str, Any] | str,
        q: Array | None = None,
        *,
        position: Array | None = None,
        rotation: Array | None = None,
        point: Array | None = None,
        scenario: str | None = None,
        starts: int = 32,
    ) -> Array:
        """Find a configuration near q that brings bodies and sites to their targets.

        Joint limits and active constraints are taken into account. If the search from q fails, it
        is repeated from random configurations within the limits. The random numbers are the same in
        each call, so results are reproducible.

        Parameters
        ----------
        targets : dict
            Targets by name of body or site. A target is a position (3,) of the origin in the world
            [m], a homogeneous matrix (4, 4), or a pair of a position and a rotation. A rotation is
            a matrix (3, 3) or a quaternion [w, x, y, z]. Alternatively, use a dictionary with keys
            "place", "rotation" and "point", where "point" is the point in body axes that should be
            moved to "place".
            For a single target, give its name, and position, rotation and point as arguments.
        q : (nq,) array or dict, optional
            Configuration to start from, by default the initial one.
        position, rotation, point : arrays, optional
            Target of a single body or site, whose name is `targets`.
        scenario : str, optional
            Name of a scenario. It determines the initial state and the active constraints.
        starts : int
            Maximum number of starting points.

        Returns
        -------
        (nq,) array
            The configuration [rad, m]. Its attribute `residual` is the remaining distance [m].

        Raises
        ------
        InputError
            If a target cannot be reached. The message contains the smallest distances that were
            found.

        Examples
        --------
        >>> mech = pg.Mechanism(pg.Model.serial(3))
        >>> q = mech.inverse_kinematics({"3": (0.2, 0.0, -0.2)})
        >>> q = mech.inverse_kinematics("3", position=(0.2, 0.0, -0.2), point=(0.0, 0.0, 0.0))
        """
        from .analysis.inverse import inverse_kinematics

        alone = {"place": position, "rotation": rotation, "point": point}
        alone = {name: value for name, value in alone.items() if value is not None}
        return inverse_kinematics(self, targets, q, scenario, starts, alone)

    linearize = linearise
    center_of_mass = Dynamics.centre_of_mass


class _Kept:
    """The mechanism of a model among its attributes, which copies of the model do not have."""

    mechanism: Mechanism | None = None

    def __reduce__(self) -> Any:
        return _Kept, ()


_KEEPING = Lock()  # threads share models
_LAST = deque[ref[_Kept]]()


def _keep(kept: _Kept, made: Mechanism) -> Mechanism:
    """Keep a mechanism, or return the one that another thread has made meanwhile."""
    with _KEEPING:
        if (found := kept.mechanism) is None:
            found = kept.mechanism = made
            _LAST.append(ref(kept))
            if len(_LAST) > MOST_KEPT and (old := _LAST.popleft()()) is not None:
                old.mechanism = None
        return found


def mechanism_of(value: Any, where: str) -> Mechanism:
    """Return the mechanism of a Mechanism or a Model. Raises InputError for other types.

    The last models keep theirs, with the plans and the room for frames that short runs share.
    """
    if isinstance(value, Mechanism):
        return value
    if isinstance(value, Model):
        kept = vars(value).setdefault(OF_MODEL, _Kept())
        return kept.mechanism or _keep(kept, Mechanism(value))
    raise wrong_type(where, "mechanism", "a pg.Mechanism or a pg.Model", value)


def derivatives_at_once(checked: Called) -> Called:
    """Return `forward_derivatives(q, v, tau)` without conversion if the state fits the kernel."""

    @wraps(checked)
    def forward_derivatives(*args: Any, **named: Any) -> Any:
        try:
            mech, q, v, tau = args if len(args) == 4 else (*args, None)
            if mech._slopes and not named:
                nq, nv, *_, rest = mech._free
                kernel, space, shape, by_q, by_v, by_tau, _, _ = mech._slopes
                tau = rest if tau is None else tau
                if len(q) == nq and len(v) == nv and len(tau) == nv:
                    found = EMPTY(shape)
                    if kernel(space, q, v, tau, found) == 0:
                        return found[by_q], found[by_v], found[by_tau]
        except UNFIT:
            pass
        return checked(*args, **named)

    return cast("Called", forward_derivatives)


Mechanism.forward_derivatives = derivatives_at_once(Mechanism.forward_derivatives)
