"""Mechanism: what users hold. The dynamics of a model, and the analyses of it as methods."""

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
from .portable import TRIED, Elsewhere

if TYPE_CHECKING:
    from .analysis.linear import Linearisation

OF_TOPOLOGY = {"adjacency", "parent", "separation_bodies", "tips"}  # names that it has too

OF_PACKAGE = {"simulate", "sweep", "stability_map", "work_precision", "verify"}  # functions of it
HINTED = TRIED["Mechanism"]  # methods of other programs


@cache
def _derivatives() -> Any:
    from .analysis.linear import forward_derivatives  # compiled when first used

    return forward_derivatives


@explained
class Mechanism(Dynamics):
    """A model numbered depth-first and packed for the kernels.

    q (nq,), v and tau (nv,) are in number order, names in `names`; body 0 is the ground. Nothing is
    kept of a state: every answer is a function of its arguments.
    Raises InputError for arrays of the wrong length or with numbers that are not finite.
    """

    def __dir__(self) -> Iterable[str]:
        return sorted(set(super().__dir__()) - OF_TOPOLOGY - OF_PACKAGE - HINTED)

    def __contains__(self, name: Any) -> bool:
        """True if its model has a part `name`."""
        return name in self.model

    def __eq__(self, other: object) -> bool:
        """Compare the models."""
        return self is other or (isinstance(other, Mechanism) and self.model == other.model)

    def __hash__(self) -> int:
        return hash(self.model)

    def assemble(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> tuple[Array, Array, Assembly]:
        """(q, v, report): the state near (q, v) that meets its constraints, in the mass metric.

        All coordinates may move, those that you set too; a `pg.Motion` in the model holds one.
        `active` names constraints, the model's active ones by default. Raises InputError that
        names the constraints that cannot be met, and by how much they miss.
        """
        return assemble(self, q, v, active)

    def mobility(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> Mobility:
        """Return degrees of freedom, redundant rows and singular positions at q.

        Printing the result shows a report. `v` selects a branch at a singular position. Raises
        InputError if the constraints cannot be met.
        """
        return mobility(self, q, v, active)

    def constrained_inverse_dynamics(
        self,
        q: Array,
        v: Array,
        vdot: Array,
        actuated: Sequence[str] | None = None,
        weights: Array | Mapping[str, float] | None = None,
        contacts: Sequence[str] | None = None,
    ) -> Array:
        """τ (nv,) [N m, N] that gives v' with every active constraint imposed.

        In addition to the passive forces; the inverse of `constrained_dynamics`. Of the torques
        that do it, those of least Σ weights τ². `actuated`: names of bodies whose joints carry
        torques, by default all. `weights`: > 0, (nv,) or by name of body. `contacts`: names of
        contacts that carry at q; their forces stay within the friction cones, and leave the
        torques as small as they can. Prescribed motions bring their own forces.
        Raises InputError where q, v or v' break a constraint, or where no torque of these joints
        gives the motion: what is left of the equations is above 1e-9 of the forces at hand.
        """
        from .analysis.inverse import constrained_inverse_dynamics

        given = (actuated, weights, contacts)
        return constrained_inverse_dynamics(self, q, v, vdot, *given)

    def forward_derivatives(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """∂v'/∂q, ∂v'/∂v, ∂v'/∂τ, (nv, nv) each, of `forward_dynamics`.

        Exact to rounding, about 1e-16 of the largest entry times the condition of M, springs and
        dampers of joints included; springs between bodies add differences good to 1e-11 of theirs.
        Columns of the first are moves along v (a rotation vector in a ball's axes), not along q.
        """
        return _derivatives()(self, q, v, tau)

    def linearise(
        self, q: Array | None = None, v: Array | None = None, scenario: str | None = None
    ) -> Linearisation:
        """x' = drift + A x + B δτ about (q, v) in independent coordinates, with eigenvalues, modes.

        About the initial state (of the scenario) unless q is given, at rest unless v is given;
        with all forces and active constraints of a run at t = 0. Soft and penalty contacts are
        springs and dampers here; rigid contacts and limits that are shut have no slope: `notices`
        names them, and says where (q, v) is no equilibrium (`drift` is x' there). Rows that bind
        velocities alone reduce the velocities only. Conservative mechanisms at rest have
        eigenvalues ±iω from two symmetric problems, good to 1e-12 on a chain of 1000. Raises
        InputError where the constraints cannot be met.
        """
        from .analysis.linear import linearise  # compiled for lanes

        return linearise(self, q, v, scenario)

    def equilibrium(self, q: Array | None = None, scenario: str | None = None) -> Array:
        """Return q (nq,) of an equilibrium near q, by default near the initial state.

        All forces of a run at t = 0 act, with the active constraints and the limits of joints.
        Contacts and limits of tendons and springs are ignored, so bodies may end inside the ground.
        If every force has an energy, it only decreases during the search, and the result is stable
        unless the start is an equilibrium already. Raises InputError if none is found, naming the
        joint that moves on.
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
        """q (nq,) near q, the initial state by default, with bodies and sites at their targets.

        A target is a place (3,) of the body's origin in the world [m], a pair of a place and a
        rotation, (3, 3) or a quaternion [w, x, y, z], or {"place": ..., "rotation": ..., "point":
        ...} with what is wanted; `point` is the body's point that goes to the place, in its axes.
        Joint limits and active constraints hold. The search starts at q and, until the targets are
        met, at `starts` - 1 random places within the limits, the same in each call. Raises
        InputError naming the targets that are missed, and by how much at best.
        """
        from .analysis.targets import inverse_kinematics

        return inverse_kinematics(self, targets, q, scenario, starts)

    linearize = linearise
    center_of_mass = Dynamics.centre_of_mass


for _name in OF_PACKAGE | HINTED:
    setattr(Mechanism, _name, Elsewhere(_name))


def mechanism_of(value: Any, where: str) -> Mechanism:
    """The mechanism of a Mechanism or a Model, for `where`. Raises InputError for other types."""
    if isinstance(value, Mechanism):
        return value
    if isinstance(value, Model):
        return Mechanism(value)
    raise wrong_type(where, "mechanism", "a pg.Mechanism or a pg.Model", value)


def derivatives_at_once(checked: Called) -> Called:
    """`forward_derivatives(q, v, tau)`, directly where the kernel takes the state as it is."""

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
