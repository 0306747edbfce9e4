"""Mechanism: what users hold. Every answer is a function of (q, v): no hidden state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..columns import Columns
from ..constraints.assembly import Assembly, assembled, indices
from ..constraints.blocks import Blocks, blocks
from ..contact.tables import Tables, tables
from ..errors import InputError, Problem
from ..kernels import bodies, dynamics, motion, numbering
from ..kernels import layout as at
from ..kernels._jit import ready
from ..kernels.handle import address_of
from ..loads import TYPES as LOADS
from ..loads import loads
from ..plan import Plan
from ..schema import Contact, Force, Model
from ..schema.force import BETWEEN
from ..system import (
    Array,
    Drives,
    Ints,
    Loads,
    System,
    drives,
    packed,
    point_in_row,
    system,
)
from ..topology import Topology
from .back_ends import BackEnd, by_composite, by_operators, dense
from .bodies import BodyMotion, bodies_over, shifted, turned
from .carrying import Carried, Joint, carried, joints_of
from .scene import Scene

if TYPE_CHECKING:
    from ..constraints.mobility import Mobility

NOWHERE = np.zeros((0, 3)), np.zeros((0, 3, 3))
NEW = object.__new__
FORWARD = dynamics.forward_dynamics
NO_EXTERNAL = np.zeros((0, 6))
NO_CONSTRAINTS = np.zeros(0, dtype=np.int64)
NO_LOADS: Loads = (
    np.zeros((0, at.LOAD_I), dtype=np.int64),
    np.zeros((0, at.LOAD_F)),
    np.zeros((0, 7)),
)


class Mechanism:
    """A model numbered depth-first and packed for the kernels.

    q (nq,), v and tau (nv,) are in number order, names in `names`; body 0 is the ground.
    Raises InputError for arrays of the wrong length or with numbers that are not finite.
    """

    _driven: tuple[tuple[Force, ...], Drives] | None = None  # forces last asked for, packed

    def __init__(self, model: Model | Columns, /):
        """Number and pack a valid model, or a table in columns."""
        columns = model if isinstance(model, Columns) else Columns.of(model)
        self.columns = columns
        self._packed, springs = packed(columns)
        self._springs = springs + columns.springs_between
        self._rows, self._const, bodies_i, _, home = self._packed
        self.nb, self.nq = len(bodies_i) - 1, columns.nq
        self.nv = len(home) - self.nq
        self._nq, self._nv = (self.nq,), (self.nv,)
        self._zero = np.zeros(self.nv)
        self._work = np.zeros((len(self._rows), at.WORK))
        ready(FORWARD)

    @cached_property
    def system(self) -> System:
        """The packed constants."""
        return system(self._packed, self.nq)

    @property
    def tree(self) -> tuple[Ints, Array]:
        """Rows and constants of the tree, as most kernels take them."""
        return self._rows, self._const

    @cached_property
    def model(self) -> Model:
        """The description; of a table in columns it is made when first asked for."""
        return self.columns.model()

    def edit(self, name: str, /, **changes: Any) -> Mechanism:
        """`Mechanism(mech.model.edit(name, **changes))`, at the cost of what changes.

        A new parent, mass, com or link is written into the columns, and nothing else is looked at
        again. Itself where nothing changes. Raises ModelError; this mechanism stays as it is.
        """
        columns = self.columns.edited(name, changes)
        if columns is self.columns:
            return self
        if columns is None:
            return Mechanism(self.model.edit(name, **changes))
        return self._repacked(columns)

    def _repacked(self, columns: Columns) -> Mechanism:
        """A mechanism of the same sizes, on the same workspace: it holds nothing between calls."""
        new = NEW(Mechanism)
        new.columns = columns
        new._packed, springs = arrays, _ = packed(columns)
        new._springs = springs + columns.springs_between
        new._rows, new._const = arrays[0], arrays[1]
        new.nb, new.nq, new.nv = self.nb, self.nq, self.nv
        new._nq, new._nv = self._nq, self._nv
        new._zero, new._work = self._zero, self._work
        return new

    def plan(self, *, scenario: str | None = None, method: str = "auto") -> Plan:
        """What runs of this scene need, what is left out of them, and what that saves."""
        return Plan.of(self.model, scenario=scenario, method=method)

    # -- the digraph ---------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, by number."""
        return self.topology.names

    @cached_property
    def topology(self) -> Topology:
        """Names and numbers of the bodies."""
        numbers, names = self.system.bodies_i[1:], self.columns.names
        row, parent, dof = (numbers[:, k].copy() for k in (at.TABLE, at.BODY_PARENT, at.DOF))
        row -= 1
        return Topology(tuple([names[i] for i in row.tolist()]), row, parent, dof)

    @property
    def parent(self) -> Ints:
        """(nb,) numbers of the parents, 0 = ground."""
        return self.topology.parent

    @cached_property
    def pgraph(self) -> Ints:
        """The path-defined directed graph vector, Fig. 4."""
        return self._walk[0]

    @cached_property
    def jdof(self) -> Ints:
        """Joint degrees of freedom along Pgraph, Fig. 4."""
        return self._walk[1]

    @cached_property
    def _walk(self) -> tuple[Ints, Ints]:
        path, jdof = np.empty((2, 2 * self.nb + 1), np.int64)
        n = numbering.pgraph(self.system.bodies_i, path, jdof)
        return path[:n].copy(), jdof[:n].copy()

    @property
    def tips(self) -> Ints:
        """Numbers of the tip bodies, ascending."""
        return self.topology.tips

    @property
    def separation_bodies(self) -> Ints:
        """Numbers of the separation bodies, ascending."""
        return self.topology.separation_bodies

    def adjacency(self) -> Any:
        """S, eq. (1): (nb, nb) scipy.sparse."""
        return self.topology.adjacency()

    def kernel_operator(self, q: Array) -> Any:
        """ε_φ, eq. (13): (6 nb, 6 nb) scipy.sparse."""
        return self._operators(q).eps_phi

    def propagation_operator(self, q: Array) -> Any:
        """Φ, eq. (16): (6 nb, 6 nb) scipy.sparse."""
        return self._operators(q).Phi

    def _operators(self, q: Array, v: Array | None = None) -> Any:
        from ..operators import Operators

        speeds = self._zero if v is None else self.finite("v", v, self.nv)
        return Operators(self.model, self.topology, self.position(q), speeds)

    # -- states and places ---------------------------------------------------------------------

    def home(self) -> tuple[Array, Array]:
        """(q, v): the model's initial state."""
        return self.system.q.copy(), self.system.v.copy()

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """The joints that move: their motions, and where they stand in q and v, by body."""
        return joints_of(self.names, self.system, self.nq, self.nv)

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

    def poses(self, q: Array) -> tuple[Array, Array]:
        """((nb, 3) origins [m], (nb, 3, 3) rotations) of all body frames in the world."""
        position, rotation = np.empty((self.nb, 3)), np.empty((self.nb, 9))
        q = self.position(q)
        bodies.poses(*self.system[:4], q, self._zero, self._work, position, rotation)
        return position, rotation.reshape(self.nb, 3, 3)

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
        dynamics.mass_matrix(*self.tree, q, self._zero, self._work, m)
        return m

    def bias_force(self, q: Array, v: Array, *, back_end: BackEnd = "articulated") -> Array:
        """C (nv,) of eq. (25): velocity-dependent terms and gravity; no springs, no dampers."""
        if dense(back_end):
            return self._operators(q, v).bias_force
        q, v = self._state(q, v)
        return self._inverse(q, v, self._zero, NO_EXTERNAL)

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
        return tau - self._passive(q, v, self._zero) if self._springs else tau

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
        tau = self._zero if tau is None else tau
        vdot = np.empty(self.nv)
        if external is None and not self._springs and back_end == "articulated":
            try:  # arrays as the kernel takes them: checking costs as much as the dynamics
                if q.shape == self._nq and v.shape == self._nv and tau.shape == self._nv:
                    code = FORWARD(self._rows, self._const, q, v, tau, self._work, vdot)
                    if code == 0:
                        return vdot
            except (AttributeError, TypeError):
                pass
        return self._forward_checked(q, v, tau, external, back_end, vdot)

    def _forward_checked(
        self,
        q: Array,
        v: Array,
        tau: Array,
        external: Array | None,
        back_end: BackEnd,
        vdot: Array,
    ) -> Array:
        q, v = self._state(q, v)
        tau, wrench = self.check("tau", tau, self.nv), self._external(external)
        if self._springs:
            tau = self._passive(q, v, tau)
        if dense(back_end):
            code = by_operators(self, q, v, tau, wrench, vdot)
        elif back_end == "composite":
            code = by_composite(self, q, v, tau, wrench, vdot)
        elif external is None:
            code = FORWARD(*self.tree, q, v, tau, self._work, vdot)
        else:
            code = dynamics.forward_dynamics_external(
                *self.system[:4], q, v, tau, wrench, self._work, vdot
            )
        if code:
            given = {} if external is None else {"external": np.asarray(external, float)}
            self._explain(code, q=q, v=v, tau=tau, **given)
        return vdot

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
        number = self.topology.number(name)
        external, wrench = np.zeros((self.nb, 6)), self.finite("wrench", wrench, 6)
        if number > 0:  # the ground takes any force
            point = self.model.body(name).tip_point if point is None else point
            arm = self.pose(q, name)[1] @ self.finite("point", point, 3)
            external[number - 1] = shifted(wrench, arm)
        return external

    def external_at_tips(self, q: Array, wrench: Array) -> Array:
        """`external` (nb, 6) of wrenches (n_t, 6) on the tips, in the order of `tips`.

        At the bodies' `tip` points, in world axes: -F_T of eqs. (22)-(26), which acts *from* the
        tips (R10).
        """
        wrench = self.finite("wrench", wrench, len(self.tips), 6)
        tips = self.tips - 1
        points = np.array([self.model.body(self.names[k]).tip_point for k in tips])
        arm = np.einsum("tij,tj->ti", self.poses(q)[1][tips], points.reshape(-1, 3))
        external = np.zeros((self.nb, 6))
        external[tips] = shifted(wrench, arm)
        return external

    def constrained_dynamics(
        self, q: Array, v: Array, tau: Array | None = None
    ) -> tuple[Array, dict[str, Array]]:
        """(v', {name: (6,)}) with every active constraint imposed, eqs. (27)-(29).

        Forces are [torque, force] on the constraint's body at its point, world axes. Passive
        forces act, as in `forward_dynamics`.
        """
        scene = self.scene
        tau = self._zero if tau is None else tau
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
        given = self._zero if tau is None else self.finite("tau", tau, self.nv)
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
        rate = self._zero if vdot is None else self.finite("vdot", vdot, self.nv)
        wrench = np.zeros((self.nb, 6)) if external is None else self._external(external)
        motion = bodies_over(self.system, *(x[None] for x in (*state, rate, wrench)))
        return BodyMotion(*(x[0] for x in motion))

    def centre_of_mass(self, q: Array) -> Array:
        """(3,) of the whole mechanism in the world [m]."""
        mass, place, _, _ = self._masses(q, self._zero)
        return mass @ place / mass.sum()

    def momentum(self, q: Array, v: Array) -> Array:
        """(6,) momentum, world axes: angular about the centre of mass, then linear [kg m/s]."""
        mass, place, velocity, spin = self._masses(q, v)
        arm = place - mass @ place / mass.sum()
        linear = mass @ velocity
        angular = spin.sum(axis=0) + np.cross(arm, mass[:, None] * velocity).sum(axis=0)
        return np.concatenate((angular, linear))

    def _masses(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Masses, centres of mass, their velocities, and spins I ω of all bodies."""
        motion = self.body_motion(q, v)
        bodies = [self.model.body(name) for name in self.names]
        mass = np.array([b.mass for b in bodies])
        turn = motion.pose[:, 3:]
        arm = turned(turn, np.array([b.com for b in bodies]).reshape(-1, 3))
        omega = motion.velocity[:, :3]
        back = turn * np.array([1.0, -1.0, -1.0, -1.0])
        inertia = np.array([b.inertia for b in bodies]).reshape(-1, 3, 3)
        spin = turned(turn, np.einsum("bij,bj->bi", inertia, turned(back, omega)))
        velocity = motion.velocity[:, 3:] + np.cross(omega, arm)
        return mass, motion.pose[:, :3] + arm, velocity, spin

    # -- Jacobians -----------------------------------------------------------------------------

    def jacobian(self, q: Array, name: str, point: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """J (6, nv), eq. (20): V of `point` (body axes) of a body is J v, world axes."""
        number = self.topology.number(name)
        q = self.position(q)
        return self._jacobian(q, number, self.finite("point", point, 3))

    def jacobian_bias(
        self, q: Array, v: Array, name: str, point: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Array:
        """J' v (6,): V' of `point` of a body is J v' + J' v (R6)."""
        q, v = self.position(q), self.finite("v", v, self.nv)
        row, place = self._row_point(name, point)
        bias = np.empty(6)
        dynamics.jacobian_bias(*self.tree, q, v, self._zero, row, place, self._work, bias)
        return bias

    def tip_jacobian(self, q: Array) -> Array:
        """J (6 n_t, nv), eqs. (18)-(20), one block row a tip body, at the bodies' `tip` points."""
        q = self.position(q)
        blocks = [
            self._jacobian(q, int(tip), self.model.body(self.names[tip - 1]).tip_point)
            for tip in self.tips
        ]
        return np.concatenate(blocks) if blocks else np.zeros((0, self.nv))

    def _jacobian(self, q: Array, number: int, point: Any) -> Array:
        jac = np.zeros((6, self.nv))
        row = int(self.system.bodies_i[number, at.ROW])
        place = point_in_row(self.system, number, point)
        dynamics.jacobian(*self.tree, q, self._zero, row, place, self._work, jac)
        return jac

    # -- constraints and drives ----------------------------------------------------------------

    @cached_property
    def blocks(self) -> Blocks:
        """The model's constraints, active or not, as the kernels take them."""
        poses = self.poses(self.system.q) if self.model.constraints else NOWHERE
        return blocks(self.model, self.topology, self.system, poses)

    @cached_property
    def active(self) -> Ints:
        """Indices of the model's active constraints."""
        return np.array([i for i, c in enumerate(self.model.constraints) if c.active], np.int64)

    @cached_property
    def passive(self) -> Drives:
        """Springs and dampers of the joints."""
        return drives(self.model, self.topology, self.system, ())

    def drives(self, forces: tuple[Force, ...]) -> Drives:
        """Springs and dampers of the joints, and the given motors and servos.

        The last answer is kept: runs of one scenario ask again and again.
        """
        kept = self._driven
        if kept is None or kept[0] != forces:
            kept = (forces, drives(self.model, self.topology, self.system, forces))
            self._driven = kept
        return kept[1]

    def loads(self, forces: tuple[Force, ...]) -> Loads:
        """The given wrenches and springs between bodies."""
        if not any(force.kind in LOADS for force in forces):
            return NO_LOADS
        return loads(self.model, self.topology, self.system, forces, self.poses(self.system.q))

    def load_wrenches(self, forces: tuple[Force, ...], t: Array, q: Array, v: Array) -> Array:
        """(n, nb, 6) what wrenches and springs in `forces` do to bodies in n states at times t.

        [torque, force] at the bodies' origins, world axes: `external` of these states.
        """
        external = np.zeros((len(t), self.nb, 6))
        acting = [f for f in forces if f.kind in LOADS]
        if acting:
            number = self.topology.number
            carriers = np.array([(number(f.body), number(f.other)) for f in acting])
            scene = Scene(self, self.passive, self.loads(forces), NO_CONSTRAINTS)
            for i in range(len(t)):
                state = (t[i], q[i], v[i], external[i])
                motion.load_wrenches(scene.address, carriers, *self.system[2:4], *state)
        return external

    @cached_property
    def passive_loads(self) -> Loads:
        """Springs and torsion springs between bodies."""
        return self.loads(tuple(f for f in self.model.forces if f.kind in BETWEEN))

    def contacts(self, active: tuple[Contact, ...]) -> Tables | None:
        """What these contacts and the joints' limits make touch; None where nothing does."""
        if not active and not any(any(b.limits) for b in self.model.bodies):
            return None
        return tables(self, active)

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

    # -- checking what is given ----------------------------------------------------------------

    def _inverse(self, q: Array, v: Array, vdot: Array, external: Array) -> Array:
        tau = np.empty(self.nv)
        dynamics.inverse_dynamics(*self.system[:4], q, v, vdot, external, self._work, tau)
        if not np.isfinite(tau).all():
            self._explain(-1, q=q, v=v, vdot=vdot, external=external)
        return tau

    def _passive(self, q: Array, v: Array, given: Array) -> Array:
        tau, scene = np.empty(self.nv), self.scene
        scene.given[:] = given
        motion.drive_torque(scene.address, q, v, tau)
        return tau + self.load_torque(q, v) if len(scene.loads[0]) else tau

    def load_torque(self, q: Array, v: Array) -> Array:
        """τ (nv,) of springs and torsion springs between bodies."""
        tau = np.empty(self.nv)
        motion.load_torque(self.scene.address, q, v, tau)
        return tau

    def _row_point(self, name: str, point: Any) -> tuple[int, Array]:
        number = self.topology.number(name)
        place = point_in_row(self.system, number, self.finite("point", point, 3))
        return int(self.system.bodies_i[number, at.ROW]), place

    def _state(self, q: Array, v: Array) -> tuple[Array, Array]:
        return self.check("q", q, self.nq), self.check("v", v, self.nv)

    def _external(self, external: Array | None) -> Array:
        return NO_EXTERNAL if external is None else self.check("external", external, self.nb, 6)

    def check(self, name: str, value: Any, *shape: int) -> Array:
        """An argument as the contiguous float64 array the kernels take. Raises InputError."""
        if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:
            flags = value.flags
            if flags.c_contiguous and flags.writeable:
                return value
        try:
            array = np.asarray(value)
            if array.dtype.kind not in "fiu" and array.size:
                raise TypeError
            array = np.array(array, dtype=np.float64, order="C")
        except (TypeError, ValueError):
            raise InputError(Problem(name, "", f"must be numbers; given {value!r:.60}")) from None
        if array.shape != shape:
            text = f"must have shape {shape}; given {array.shape}"
            raise InputError(Problem(name, "", text))
        return array

    @cached_property
    def _quaternion_rows(self) -> list[int]:
        return np.flatnonzero(self._rows[:, at.KIND] >= at.BALL).tolist()

    def position(self, q: Any) -> Array:
        """q, finite and with quaternions that have a direction; their length does not count.

        Raises InputError.
        """
        q = self.finite("q", q, self.nq)
        for k in self._quaternion_rows:
            i = self._rows[k, at.QI] + (3 if self._rows[k, at.KIND] == at.FREE else 0)
            length = float(np.linalg.norm(q[i : i + 4]))
            if not 1e-3 < length < 1e3:
                text = f"the quaternion [w, x, y, z] of '{self.body_of(k)}' at q[{i}] must have "
                raise InputError(Problem("q", "", f"{text}length 1; its length is {length:.6g}"))
        return q

    def finite(self, name: str, value: Any, *shape: int) -> Array:
        """As `check`, and every number finite. (Dynamics look only where a result is not.)"""
        array = self.check(name, value, *shape)
        bad = np.flatnonzero(~np.isfinite(array))
        if len(bad):
            text = f"must be finite; entry {bad[0]} is {array.flat[bad[0]]}"
            raise InputError(Problem(name, "", text))
        return array

    def _explain(self, code: int, **given: Array) -> None:
        """Raise what a kernel's status code means."""
        for name, value in given.items():
            self.finite(name, value, *value.shape)
        self.position(given["q"])
        raise InputError(self.singular(code) if code > 0 else _overflow())

    def singular(self, row: int) -> Problem:
        """What to say of a row whose motion sees no inertia."""
        name = self.names[self.system.body_of_row[row] - 1]
        text = (
            "its joint moves nothing that has inertia about it; give it mass, inertia or armature"
        )
        return Problem(f"body '{name}'", "inertia", text)

    def row_of_velocity(self, index: int) -> int:
        """Row whose motion has v[index]."""
        return int(np.searchsorted(self.system.rows[1:, at.VI], index, side="right"))

    def body_of(self, row: int) -> str:
        """Name of the body whose joint a row belongs to."""
        return self.names[self.system.body_of_row[row] - 1]


def _overflow() -> Problem:
    return Problem("dynamics", "", "the result is not finite: the given numbers are too large")
