"""The mechanism, which holds the dynamics of a model and provides its analyses as methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache, wraps
from typing import TYPE_CHECKING, Any, cast

from .analysis.assembly import Assembly, assemble
from .analysis.mobility import Mobility, mobility
from .dynamics import Dynamics
from .dynamics.arguments import wrong_type
from .dynamics.dynamics import EMPTY, UNFIT
from .errors import Called, explained
from .model import Model
from .packing import Array

if TYPE_CHECKING:
    from .analysis.linear import Linearisation

OF_TOPOLOGY = {"adjacency", "parent", "separation_bodies", "tips"}  # names that it has too


@cache
def _derivatives() -> Any:
    from .analysis.linear import forward_derivatives  # compiled when first used

    return forward_derivatives


@explained
class Mechanism(Dynamics):
    """A model with depth-first numbering, packed for the compiled kernels.

    q (nq,), v (nv,) and tau (nv,) are in number order, with names in `names`. Body 0 is the ground.
    A mechanism keeps no state: every answer depends on its arguments only. Methods raise InputError
    for arrays of the wrong length or with numbers that are not finite.

    Example: the angular acceleration of two rods at rest.

        mech = pg.Mechanism(pg.Model.serial(2))
        vdot = mech.forward_dynamics(q=[0.1, 0.2], v=[0, 0])
    """

    def __dir__(self) -> Iterable[str]:
        return sorted(set(super().__dir__()) - OF_TOPOLOGY)

    def __contains__(self, name: Any) -> bool:
        """Return True if the model has a part `name`."""
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

        The distance is measured with the mass matrix. All coordinates may move, including those
        that you set; a `pg.Motion` in the model holds one.

        Parameters
        ----------
        q : (nq,) array, optional
            Configuration to start from, by default the initial one [rad, m].
        v : (nv,) array, optional
            Velocity to start from, by default the initial one [rad/s, m/s].
        active : sequence of str, optional
            Names of the constraints to meet, by default the active ones of the model.

        Returns
        -------
        q : (nq,) array
            The assembled configuration.
        v : (nv,) array
            The velocity that is consistent with it.
        report : Assembly
            The changes that were made, and the remaining errors.

        Raises
        ------
        InputError
            If constraints cannot be met. The message names them and gives the remaining errors.
        """
        return assemble(self, q, v, active)

    def mobility(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> Mobility:
        """Return the degrees of freedom, redundant rows and singular positions at q.

        Parameters
        ----------
        q : (nq,) array, optional
            Configuration, by default the initial one.
        v : (nv,) array, optional
            Velocity that selects a branch at a singular position.
        active : sequence of str, optional
            Names of constraints, by default the active ones of the model.

        Returns
        -------
        Mobility
            Printing it shows a report.

        Raises
        ------
        InputError
            If the constraints cannot be met.
        """
        return mobility(self, q, v, active)

    def constrained_inverse_dynamics(
        self,
        q: Array,
        v: Array,
        vdot: Array,
        actuated: Sequence[str] | None = None,
        weights: Array | Mapping[str, float] | None = None,
    ) -> Array:
        """Return the joint torques that produce v' while all active constraints hold.

        This is the inverse of `constrained_dynamics`. The torques act in addition to the passive
        forces of the model; prescribed motions bring their own forces. If several sets of torques
        give the motion, the one with the least Σ weights τ² is returned.

        Parameters
        ----------
        q, v, vdot : (nq,), (nv,) and (nv,) arrays
            State and acceleration, which must satisfy the constraints.
        actuated : sequence of str, optional
            Names of the bodies whose joints carry torques, by default all.
        weights : (nv,) array or dict, optional
            Positive weights of the torques, in number order or by name of body.

        Returns
        -------
        (nv,) array
            Torques [N m] and forces [N].

        Raises
        ------
        InputError
            If q, v or v' violate a constraint, or if no torque of these joints gives the motion.
            The tolerance is 1e-9 of the forces.
        """
        from .analysis.inverse import constrained_inverse_dynamics

        return constrained_inverse_dynamics(self, q, v, vdot, actuated, weights)

    def forward_derivatives(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Return the derivatives of `forward_dynamics` with respect to q, v and τ.

        They are exact to rounding: about 1e-16 of the largest entry times the condition number of
        M. The contribution of springs between bodies comes from differences and is good to 1e-11.

        Parameters
        ----------
        q, v : (nq,) and (nv,) arrays
            State.
        tau : (nv,) array, optional
            Torques, by default zero.

        Returns
        -------
        by_q, by_v, by_tau : (nv, nv) arrays
            ∂v'/∂q, ∂v'/∂v and ∂v'/∂τ. The columns of the first belong to displacements along v, a
            rotation vector in body axes for a ball joint, and not to entries of q.
        """
        return _derivatives()(self, q, v, tau)

    def linearise(
        self, q: Array | None = None, v: Array | None = None, scenario: str | None = None
    ) -> Linearisation:
        """Linearise the equations of motion about a state: x' = drift + A x + B δτ.

        x contains independent coordinates, velocities and the states of controls. The states are
        those at which they stay and hold the position, if there are any. All forces and active
        constraints of a run at t = 0 are included. Soft and penalty contacts act as springs and
        dampers. Closed rigid contacts and limits have no derivative and are listed in `notices` of
        the result, as is a state that is not an equilibrium. Constraints of velocities alone reduce
        the velocities only. The eigenvalues of a conservative mechanism at rest are ±iω from two
        symmetric problems, good to 1e-12 on a chain of 1000 bodies.

        Parameters
        ----------
        q : (nq,) array, optional
            Configuration, by default the initial one of the scenario or of the model.
        v : (nv,) array, optional
            Velocity, by default zero if q is given.
        scenario : str, optional
            Name of a scenario.

        Returns
        -------
        Linearisation
            A, B and drift with eigenvalues and modes. Its `state_space` fits SciPy and
            python-control.

        Raises
        ------
        InputError
            If the constraints cannot be met, or if a control acts at samples.
        """
        from .analysis.linear import linearise  # compiled for lanes

        return linearise(self, q, v, scenario)

    def equilibrium(self, q: Array | None = None, scenario: str | None = None) -> Array:
        """Find an equilibrium near q.

        All forces of a run at t = 0 act, with active constraints and joint limits, and states of
        controls at which they stay, such as the integral of a PID. Contacts and
        limits of tendons and springs are ignored, so bodies may end inside the ground. If all
        forces have an energy, the search only decreases it: the result is stable unless the start
        was an equilibrium.

        Parameters
        ----------
        q : (nq,) array, optional
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
            If no equilibrium is found, with the joint that moves on, or if a control acts at
            samples.
        """
        from .analysis.equilibrium import equilibrium  # compiled for lanes

        return equilibrium(self, q, scenario)

    def inverse_kinematics(
        self,
        targets: Mapping[str, Any],
        q: Array | None = None,
        *,
        scenario: str | None = None,
        starts: int = 32,
    ) -> Array:
        """Find a configuration near q that brings bodies and sites to their targets.

        Joint limits and active constraints are satisfied. The search starts at q. If it fails, it
        starts again from random configurations within the limits, the same ones in each call.

        Parameters
        ----------
        targets : dict
            Targets by name of body or site. A target is a place (3,) of the origin in the world
            [m], or a pair of a place and a rotation, (3, 3) or a quaternion [w, x, y, z]. A
            dictionary has some of "place", "rotation" and "point". "point" is the point of the
            body, in its axes, that goes to the place.
        q : (nq,) array, optional
            Configuration to start from, by default the initial one.
        scenario : str, optional
            Name of the scenario that provides the initial state and the active constraints.
        starts : int
            Largest number of starts.

        Returns
        -------
        (nq,) array
            The configuration [rad, m].

        Raises
        ------
        InputError
            If targets are missed. The message names them and the smallest distances reached.

        Examples
        --------
        >>> mech = pg.Mechanism(pg.Model.serial(3))
        >>> q = mech.inverse_kinematics({"3": (0.2, 0.0, -0.2)})
        """
        from .analysis.inverse import inverse_kinematics

        return inverse_kinematics(self, targets, q, scenario, starts)

    linearize = linearise
    center_of_mass = Dynamics.centre_of_mass


def mechanism_of(value: Any, where: str) -> Mechanism:
    """Return the mechanism of a Mechanism or a Model. Raises InputError for other types."""
    if isinstance(value, Mechanism):
        return value
    if isinstance(value, Model):
        return Mechanism(value)
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
