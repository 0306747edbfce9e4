"""Mechanism: what users hold. Every answer is a function of (q, v): no hidden state."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..constraints.assembly import Assembly, assembled, indices
from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.compiler.jit import ready
from ..engine.tree import dynamics
from ..model import Force
from ..system import Array
from . import jacobians, masses, wrenches
from .back_ends import NO_EXTERNAL, BackEnd, accelerated, dense
from .bodies import BodyMotion, bodies_over
from .carrying import Carried, carried
from .packed import FORWARD, NO_LOADS, Packed
from .scene import Scene

if TYPE_CHECKING:
    from ..constraints.mobility import Mobility


class Mechanism(Packed):
    """A model numbered depth-first and packed for the kernels.

    q (nq,), v and tau (nv,) are in number order, names in `names`; body 0 is the ground.
    Raises InputError for arrays of the wrong length or with numbers that are not finite.
    """

    # -- the paper's operators -------------------------------------------------------------------

    def kernel_operator(self, q: Array) -> Any:
        """ε_φ, eq. (13): (6 nb, 6 nb) scipy.sparse."""
        return self._operators(q).eps_phi

    def propagation_operator(self, q: Array) -> Any:
        """Φ, eq. (16): (6 nb, 6 nb) scipy.sparse."""
        return self._operators(q).Phi

    def _operators(self, q: Array, v: Array | None = None) -> Any:
        from ..paper import Operators

        speeds = self.rest if v is None else self.finite("v", v, self.nv)
        return Operators(self.model, self.topology, self.position(q), speeds)

    # -- states and places ---------------------------------------------------------------------

    def state_from(self, other: Mechanism, q: Array, v: Array) -> Carried:
        """(q, v, reset): the state (q, v) of another mechanism, by names and kinds of joints.

        A joint that the other has under the same name, with the same kinds of motions, keeps its
        coordinates, whatever its parent; the joints named in `reset` take the model's initial ones.
        """
        return carried(self, other, other.position(q), other.finite("v", v, other.nv))

    def pose(self, q: Array, name: str) -> tuple[Array, Array]:
        """((3,) origin [m], (3, 3) rotation) of a body frame in the world."""
        number = self.topology.number(name)
        if number == 0:
            return np.zeros(3), np.eye(3)
        position, rotation = self.poses(q)
        return position[number - 1], rotation[number - 1]

    def energy(self, q: Array, v: Array) -> tuple[float, float]:
        """(kinetic, potential) energy [J]; springs of joints and between bodies included."""
        q, v = self.position(q), self.finite("v", v, self.nv)
        return motion.energy(self.scene.address, q, v)

    # -- dynamics of the tree ------------------------------------------------------------------
    # All take `back_end`: "articulated" (default), "composite" or "operators", with the same
    # numbers; `back_ends.py` says which algorithm each one stands for. What is passive acts here:
    # springs, dampers and friction of joints, springs and torsion springs between bodies. What may
    # depend on time (wrenches, motors, servos) acts in runs only.

    def mass_matrix(self, q: Array, *, back_end: BackEnd = "articulated") -> Array:
        """M (nv, nv) of eq. (25), armature included."""
        if dense(back_end):
            return self._operators(q).mass_matrix
        m = np.zeros((self.nv, self.nv))
        q = self.position(q)
        dynamics.mass_matrix(*self.tree, q, self.rest, self.work, m)
        return m

    def bias_force(self, q: Array, v: Array, *, back_end: BackEnd = "articulated") -> Array:
        """C (nv,) of eq. (25): velocity-dependent terms and gravity; no springs, no dampers."""
        if dense(back_end):
            return self._operators(q, v).bias_force
        q, v = self._state(q, v)
        return self._inverse(q, v, self.rest, NO_EXTERNAL)

    def inverse_dynamics(
        self,
        q: Array,
        v: Array,
        vdot: Array,
        external: Array | None = None,
        *,
        back_end: BackEnd = "articulated",
    ) -> Array:
        """τ (nv,) that gives v', eq. (24), beside springs and dampers of joints and between bodies.

        `external` (nb, 6): [torque, force] on each body at its origin, world axes; `external_at`
        makes it from wrenches elsewhere.
        """
        q, v = self._state(q, v)
        vdot, wrench = self.check("vdot", vdot, self.nv), self._external(external)
        if dense(back_end):
            op = self._operators(q, v)
            vdot = self.finite("vdot", vdot, self.nv)
            tau = op.inverse_dynamics(vdot, wrench if len(wrench) else None)
        else:
            tau = self._inverse(q, v, vdot, wrench)
        return tau - self._passive(q, v, self.rest) if self._springs else tau

    def forward_dynamics(
        self,
        q: Array,
        v: Array,
        tau: Array | None = None,
        external: Array | None = None,
        *,
        back_end: BackEnd = "articulated",
    ) -> Array:
        """v' (nv,) of the tree without its constraints, eq. (26); O(n).

        Springs and dampers of joints and between bodies act; wrenches, motors and servos act in
        `simulate`.
        """
        tau = self.rest if tau is None else tau
        vdot = np.empty(self.nv)
        if external is None and not self._springs and back_end == "articulated":
            try:  # arrays as the kernel takes them: checking costs as much as the dynamics
                if q.shape == self._nq and v.shape == self._nv and tau.shape == self._nv:
                    code = FORWARD(self._rows, self._const, q, v, tau, self.work, vdot)
                    if code == 0:
                        return vdot
            except (AttributeError, TypeError):
                pass
        return self._forward_checked(q, v, tau, external, back_end, vdot)

    def _forward_checked(
        self, q: Array, v: Array, tau: Array, external: Any, back_end: str, vdot: Array
    ) -> Array:
        q, v = self._state(q, v)
        tau = self.check("tau", tau, self.nv)
        wrench = None if external is None else self._external(external)
        if self._springs:
            tau = self._passive(q, v, tau)
        code = accelerated(self, back_end, (q, v, tau), wrench, vdot)
        if code:
            given = {} if external is None else {"external": np.asarray(external, float)}
            self._explain(code, q=q, v=v, tau=tau, **given)
        return vdot

    def _inverse(self, q: Array, v: Array, vdot: Array, external: Array) -> Array:
        tau = np.empty(self.nv)
        dynamics.inverse_dynamics(*self.system[:4], q, v, vdot, external, self.work, tau)
        if not np.isfinite(tau).all():
            self._explain(-1, q=q, v=v, vdot=vdot, external=external)
        return tau

    def _passive(self, q: Array, v: Array, given: Array) -> Array:
        tau, scene = np.empty(self.nv), self.scene
        scene.given[:] = given
        motion.drive_torque(scene.address, q, v, tau)
        return tau + self.load_torque(q, v) if len(scene.loads.loads_i) else tau

    def load_torque(self, q: Array, v: Array) -> Array:
        """τ (nv,) of springs and torsion springs between bodies."""
        tau = np.empty(self.nv)
        motion.load_torque(self.scene.address, q, v, tau)
        return tau

    def external_at(
        self,
        q: Array,
        name: str,
        wrench: Sequence[float] | Array,
        point: Sequence[float] | Array | None = None,
    ) -> Array:
        """`external` (nb, 6) of one wrench (6,) [torque, force] on a body; several add up.

        The wrench is in world axes, at `point` in the body's axes, its `tip` unless given.
        """
        return wrenches.external_at(self, q, name, wrench, point)

    def external_at_tips(self, q: Array, wrench: Array) -> Array:
        """`external` (nb, 6) of wrenches (n_t, 6) on the tips, in the order of `tips`.

        At the bodies' `tip` points, in world axes: -F_T of eqs. (22)-(26), which acts *from* the
        tips (R10).
        """
        return wrenches.external_at_tips(self, q, wrench)

    def load_wrenches(self, forces: tuple[Force, ...], t: Array, q: Array, v: Array) -> Array:
        """(n, nb, 6) what wrenches and springs in `forces` do to bodies in n states at times t.

        [torque, force] at the bodies' origins, world axes: `external` of these states.
        """
        return wrenches.load_wrenches(self, forces, t, q, v)

    def constrained_dynamics(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, dict[str, Array]]:
        """(v', {name: (6,)}) with every active constraint imposed, eqs. (27)-(29).

        Forces are [torque, force] on the constraint's body at its point, world axes. Passive
        forces act, as in `forward_dynamics`.
        """
        scene = self.scene
        tau = self.rest if tau is None else tau
        vdot, wrenches = np.empty(self.nv), np.empty(self._wrenches)
        asked = (scene.address, self._accelerate, 0.0)
        try:  # as in `forward_dynamics`
            if q.shape == self._nq and v.shape == self._nv and tau.shape == self._nv:
                code = self._constrained(*asked, q, v, tau, self._flow, vdot, wrenches)
                if code == 0:
                    return vdot, scene.forces(wrenches)
        except (AttributeError, TypeError):
            pass
        q, v = self._state(q, v)
        tau = self.check("tau", tau, self.nv)
        code = self._constrained(*asked, q, v, tau, self._flow, vdot, wrenches)
        if code:
            self._explain(code, q=q, v=v, tau=tau)
        return vdot, scene.forces(wrenches)

    def forward_derivatives(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """∂v'/∂q, ∂v'/∂v, ∂v'/∂τ, (nv, nv) each, of `forward_dynamics`.

        Exact to rounding, about 1e-16 of the largest entry times the condition of M, springs and
        dampers of joints included; springs between bodies add differences good to 1e-11 of theirs.
        Columns of the first are moves along v (a rotation vector in a ball's axes), not along q.
        """
        from .derivatives import forward_derivatives

        q, v = self.position(q), self.finite("v", v, self.nv)
        given = self.rest if tau is None else self.finite("tau", tau, self.nv)
        return forward_derivatives(self, q, v, given)

    # -- bodies --------------------------------------------------------------------------------

    def body_motion(
        self, q: Array, v: Array, vdot: Array | None = None, external: Array | None = None
    ) -> BodyMotion:
        """Poses, velocities, accelerations of all bodies and the full force in every joint.

        (nb, 7 | 6 | 6 | 6), by number, world axes at the bodies' origins, eqs. (17), (21), (22).
        Without `vdot` the accelerations are those at v' = 0.
        """
        state = (self.position(q), self.finite("v", v, self.nv))
        rate = self.rest if vdot is None else self.finite("vdot", vdot, self.nv)
        wrench = np.zeros((self.nb, 6)) if external is None else self._external(external)
        motion = bodies_over(self.system, *(x[None] for x in (*state, rate, wrench)))
        return BodyMotion(*(x[0] for x in motion))

    def centre_of_mass(self, q: Array) -> Array:
        """(3,) of the whole mechanism in the world [m]."""
        return masses.centre_of_mass(self, q)

    def momentum(self, q: Array, v: Array) -> Array:
        """(6,) momentum, world axes: angular about the centre of mass, then linear [kg m/s]."""
        return masses.momentum(self, q, v)

    # -- Jacobians -----------------------------------------------------------------------------

    def jacobian(self, q: Array, name: str, point: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """J (6, nv), eq. (20): V of `point` (body axes) of a body is J v, world axes."""
        return jacobians.jacobian(self, q, name, point)

    def jacobian_bias(
        self, q: Array, v: Array, name: str, point: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Array:
        """J' v (6,): V' of `point` of a body is J v' + J' v (R6)."""
        return jacobians.jacobian_bias(self, q, v, name, point)

    def tip_jacobian(self, q: Array) -> Array:
        """J (6 n_t, nv), eqs. (18)-(20), one block row a tip body, at the bodies' `tip` points."""
        return jacobians.tip_jacobian(self, q)

    # -- constraints and drives ----------------------------------------------------------------

    @cached_property
    def scene(self) -> Scene:
        """The mechanism with its passive forces and active constraints, for single questions."""
        self._accelerate = address_of(motion.acceleration)
        self._constrained = ready(motion.constrained_dynamics)
        self._flow = np.zeros(3)
        scene = Scene(self, self.passive, self.passive_loads, self.active)
        self._wrenches = (len(scene.active) - 1, 6)
        return scene

    def assemble(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> tuple[Array, Array, Assembly]:
        """(q, v, report): the state near (q, v) that meets its constraints, in the mass metric.

        `active` names constraints, the model's active ones by default. Raises InputError that
        names the constraints that cannot be met, and by how much they miss.
        """
        home_q, home_v = self.home()
        q = home_q if q is None else self.position(q)
        v = home_v if v is None else self.finite("v", v, self.nv)
        chosen = indices(self, active)
        scene = Scene(self, self.passive, NO_LOADS, chosen)
        return assembled(self, q, v, chosen, scene)

    def mobility(
        self, q: Array | None = None, v: Array | None = None, active: Sequence[str] | None = None
    ) -> Mobility:
        """Degrees of freedom, redundant rows and singular positions at q; `str` of it is a report.

        `v` chooses between branches where the position is singular. Raises InputError where the
        constraints cannot be met.
        """
        from ..constraints.mobility import mobility

        q = self.home()[0] if q is None else self.position(q)
        v = None if v is None else self.finite("v", v, self.nv)
        names = tuple(self.model.constraints[i].name for i in indices(self, active).tolist())
        return mobility(self.model, self.topology, q, v, names)

    def batch(self, size: int | None = None, **options: Any) -> Any:
        """`Batch(self, size, models=..., threads=...)`: many instances at once."""
        from .batch import Batch

        return Batch(self, size, **options)
