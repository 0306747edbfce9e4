"""Kinematics: the digraph, poses, motion and Jacobians of bodies, as functions of (q, v)."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .. import words
from ..engine.tree import bodies, dynamics
from ..errors import InputError, Problem, choices, explained, shown
from ..fields import GROUND
from ..model import Model
from ..model.poses import Pose
from ..packing import Array, Ints, point_in_row
from ..packing.packed import Joint, Packed
from ..paper import Operators
from ..portable import Portable, ReadOnly, keep_unchanged
from ..rotation import matrix, unit
from ..topology import Topology
from .arguments import by_name, finite, for_each_state, named_in, numbers, position
from .states import BodyMotion, Carried, bodies_over, carried, mass_points, shifted

NO_EXTERNAL = np.zeros((0, 6))
FRAMES = ("world", "body")  # whose axes a velocity is in


@explained
class Kinematics(Portable):
    """The tree of a mechanism, without its equations of motion."""

    packed: Packed  # the arrays of the kernels
    nb: int
    nq: int
    nv: int
    _rest: Array  # (nv,) v = 0
    _work: Array  # workspace of kernels, unused between calls
    _lock: threading.Lock  # guards `_work` and the scene's workspace

    @property
    def model(self) -> Model:
        """The description."""
        return self.packed.model

    # -- the digraph -----------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """The body names, by number."""
        return self.packed.topology.names

    @property
    def topology(self) -> Topology:
        """The names and numbers of the bodies."""
        return self.packed.topology

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """The movable joints by body, with their motions and their positions in q and v."""
        return ReadOnly(
            self.packed.joints, "Mechanism.joints", "model.edit(name, ...) makes another"
        )

    @property
    def parent(self) -> Ints:
        """The parent numbers (nb,), with 0 for the ground."""
        return self.topology.parent

    @cached_property
    def pgraph(self) -> Ints:
        """The path-defined directed graph vector, Fig. 4."""
        found = self.topology.pgraph
        keep_unchanged((found,))
        return found

    @cached_property
    def jdof(self) -> Ints:
        """The joint degrees of freedom along Pgraph, Fig. 4."""
        found = self.topology.jdof
        keep_unchanged((found,))
        return found

    @property
    def tips(self) -> Ints:
        """The numbers of the tip bodies, in ascending order."""
        return self.topology.tips

    @property
    def separation_bodies(self) -> Ints:
        """The numbers of the separation bodies, in ascending order."""
        return self.topology.separation_bodies

    def adjacency(self) -> Any:
        """The adjacency matrix S, eq. (1), as an (nb, nb) scipy.sparse array."""
        return self.topology.adjacency()

    def kernel_operator(self, q: Array) -> Any:
        """The kernel operator ε_φ, eq. (13), as a (6 nb, 6 nb) scipy.sparse array."""
        (q,) = self._numbers(q=q)
        return self._operators(q).eps_phi

    def propagation_operator(self, q: Array) -> Any:
        """The propagation operator Φ, eq. (16), as a (6 nb, 6 nb) scipy.sparse array."""
        (q,) = self._numbers(q=q)
        return self._operators(q).Phi

    def _operators(self, q: Array) -> Operators:
        """Return the paper's operators at q and v = 0. Raises InputError."""
        return Operators(self.model, self.topology, position(self.packed, q), self._rest)

    # -- states and places -----------------------------------------------------------------------

    def home(self) -> tuple[Array, Array]:
        """The model's initial state as (q, v)."""
        system = self.packed.system
        return system.q.copy(), system.v.copy()

    def _by_names(self, named: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Array]:
        """Return arrays for q, v, vdot and tau that are dictionaries by body name.

        Other joints have the initial q, and 0 for the rest. `given` has all arguments.
        """
        return {kind: by_name(self, kind, entries) for kind, entries in named.items()}

    def _numbers(self, **given: Any) -> Iterable[Any]:
        """Return arguments in their order, as arrays where they are given by body name."""
        named = named_in(given)
        return ({**given, **self._by_names(named, given)} if named else given).values()

    def state_from(self, other: Kinematics, q: Array, v: Array) -> Carried:
        """Transfer the state of another mechanism to this one.

        Joints with the same name and the same kinds of motions keep their coordinates, even if
        their parents differ. Other joints take the initial values of the model.

        Parameters
        ----------
        other : Mechanism
            The other mechanism.
        q, v : arrays or dict
            Its configuration and velocity.

        Returns
        -------
        q, v : (nq,) and (nv,) arrays
            The state of this mechanism.
        reset : tuple of str
            Names of the joints that took initial values.
        """
        q, v = other._numbers(q=q, v=v)
        return carried(self.packed, other.packed, position(other.packed, q), other._speed(v))

    @for_each_state
    def poses(self, q: Array) -> Pose:
        """Return ((nb, 3) origins [m], (nb, 3, 3) rotations) of all body frames in the world."""
        place, rotation = np.empty((self.nb, 3)), np.empty((self.nb, 9))
        q = position(self.packed, q)
        tables = self.packed.system[:4]
        with self._lock:
            bodies.poses(*tables, q, self._rest, self._work, place, rotation)
        return Pose(place, rotation.reshape(self.nb, 3, 3))

    if TYPE_CHECKING:

        @overload
        def pose(self, q: Array, name: str) -> Pose: ...
        @overload
        def pose(self, q: Array) -> Mapping[str, Pose]: ...

    @for_each_state
    def pose(self, q: Array, name: str | None = None) -> Any:
        """Compute the pose of a body or site frame in the world.

        Parameters
        ----------
        q : (nq,) array
            Configuration.
        name : str, optional
            Name of the body or site.

        Returns
        -------
        Pose or dict
            The pose, `position, rotation = pose`, with (3,) position of the origin [m] and (3, 3)
            rotation. Its `matrix` is the homogeneous transformation (4, 4), and `quaternion` is [w,
            x, y, z]. If no name is given, return a dictionary with the poses of all bodies and
            sites.

        Examples
        --------
        >>> mech = pg.Mechanism(pg.Model.serial(2))
        >>> position, rotation = mech.pose([0.1, 0.2], "2")
        >>> T = mech.pose([0.1, 0.2])["2"].matrix
        """
        if name is None:
            poses = {GROUND: Pose(np.zeros(3), np.eye(3))}
            poses |= zip(self.names, map(Pose, *self.poses(q)))
            for site in self.model.sites:
                on, rotation = poses[site.body], np.array(matrix(unit(site.rotation)))
                poses[site.name] = Pose(on.place(site.point), on.rotation @ rotation)
            return ReadOnly(poses, "mech.pose(q)", "it is computed from q")
        number, point, turn = self._frame(name)
        place, rotation = np.zeros(3), np.eye(3)
        if number > 0:
            places, rotations = self.poses(q)
            place, rotation = places[number - 1], rotations[number - 1]
        if turn is not None:
            place, rotation = place + rotation @ point, rotation @ turn
        return Pose(place, rotation)

    def _frame(self, name: str) -> tuple[int, Array, Array | None]:
        """Return (body number, origin in the body's axes, rotation or None) for a body or site."""
        try:
            return self.topology.number(name), np.zeros(3), None
        except InputError as error:
            sites = {s.name: s for s in self.model.sites}
            if name not in sites:
                more = f"; or of the sites {choices(sites)}" if sites else ""
                raise InputError(
                    [Problem(p.where, p.field, p.text + more) for p in error.problems]
                ) from None
        site = sites[name]
        turn = np.array(matrix(unit(site.rotation)))
        return self.topology.number(site.body), np.array(site.point), turn

    def _on_body(self, name: str, point: Array) -> tuple[int, Array]:
        """Return (body number, point in the body's axes) for a point on a body or site."""
        number, origin, turn = self._frame(name)
        return number, point if turn is None else origin + turn @ point

    @for_each_state
    def body_motion(
        self, q: Array, v: Array, vdot: Array | None = None, external: Array | None = None
    ) -> BodyMotion:
        """Return the poses, velocities and accelerations of all bodies, and the full joint forces.

        (nb, 7 | 6 | 6 | 6), by number, world axes at the bodies' origins, eqs. (17), (21), (22).
        Without `vdot`, the accelerations are computed for v' = 0.
        """
        state = (position(self.packed, q), self._speed(v))
        rate = self._rest if vdot is None else finite("vdot", vdot, self.nv, of=self.packed)
        wrench = np.zeros((self.nb, 6)) if external is None else self._external(external)
        found = bodies_over(self.packed.system, *(x[None] for x in (*state, rate, wrench)))
        return BodyMotion(*(x[0] for x in found))

    @for_each_state
    def centre_of_mass(self, q: Array) -> Array:
        """Compute the centre of mass of the whole mechanism.

        Parameters
        ----------
        q : array_like (nq,)
            Coordinates [rad, m].

        Returns
        -------
        ndarray (3,)
            Position in world axes [m].
        """
        mass, place, _, _ = mass_points(self._bodies, self.body_motion(q, self._rest))
        return mass @ place / mass.sum()

    @for_each_state
    def momentum(self, q: Array, v: Array) -> Array:
        """Compute the momentum (6,) [kg m/s] in world axes, angular about the mass centre first."""
        mass, place, velocity, spin = mass_points(self._bodies, self.body_motion(q, v))
        arm = place - mass @ place / mass.sum()
        angular = spin.sum(axis=0) + np.cross(arm, mass[:, None] * velocity).sum(axis=0)
        return np.concatenate((angular, mass @ velocity))

    # -- wrenches on bodies ----------------------------------------------------------------------

    @for_each_state
    def external_at(
        self,
        q: Array,
        name: str,
        wrench: Sequence[float] | Array,
        point: Sequence[float] | Array | None = None,
    ) -> Array:
        """Return the `external` argument for one wrench on a body. Several such arrays may be
        added.

        Parameters
        ----------
        q : (nq,) array
            Configuration.
        name : str
            Name of the body.
        wrench : (6,) sequence
            [torque, force] in world axes [N m, N].
        point : (3,) sequence, optional
            The point of application in body axes, by default the `tip` [m].

        Returns
        -------
        (nb, 6) array
            [torque, force] on all bodies at their origins.
        """
        number = self.topology.number(name)
        external, wrench = np.zeros((self.nb, 6)), finite("wrench", wrench, 6)
        if number > 0:  # the ground takes any force
            point = self.model.body(name).tip_point if point is None else point
            arm = self.pose(q, name)[1] @ finite("point", point, 3)
            external[number - 1] = shifted(wrench, arm)
        return external

    # -- Jacobians -------------------------------------------------------------------------------

    @for_each_state
    def jacobian(
        self, q: Array, name: str, point: Sequence[float] = (0.0, 0.0, 0.0), *, frame: str = "world"
    ) -> Array:
        """Return the Jacobian of a point on a body or site, eq. (20).

        The velocity [angular, linear] of the point is J v.

        Parameters
        ----------
        q : (nq,) array
            Configuration.
        name : str
            Name of the body or site.
        point : (3,) sequence
            The point in its axes [m].
        frame : {"world", "body"}
            Axes of the velocity: the world, or the body or site.

        Returns
        -------
        (6, nv) array
            J.
        """
        q = position(self.packed, q)
        found = self._jacobian(q, *self._on_body(name, finite("point", point, 3)))
        frame = words.chosen(frame, FRAMES) or frame
        if frame == "body":
            turn = self.pose(q, name)[1].T
            return (turn @ found.reshape(2, 3, self.nv)).reshape(6, self.nv)
        if frame not in FRAMES:
            text = f"must be 'world' or 'body', got {shown(frame)}"
            raise InputError(Problem("jacobian", "frame", text))
        return found

    @for_each_state
    def velocity(
        self,
        q: Array,
        v: Array,
        name: str,
        point: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        frame: str = "world",
    ) -> Array:
        """Return the velocity (6,) [angular, linear] of a point on a body or site [rad/s, m/s].

        `point` and `frame` are as in `jacobian`.
        """
        return self.jacobian(q, name, point, frame=frame) @ self._speed(v)

    @for_each_state
    def jacobian_bias(
        self, q: Array, v: Array, name: str, point: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Array:
        """Return J' v (6,), so that a point on a body or site accelerates by J v' + J' v (R6)."""
        q, v, bias = position(self.packed, q), self._speed(v), np.empty(6)
        place = self._place(*self._on_body(name, finite("point", point, 3)))
        with self._lock:
            dynamics.jacobian_bias(*self.packed.tree, q, v, self._rest, *place, self._work, bias)
        return bias

    @for_each_state
    def tip_jacobian(self, q: Array) -> Array:
        """Return J (6 n_t, nv) of the `tip` points of all tips, eqs. (18)-(20), by `tips`."""
        q = position(self.packed, q)
        points = [self.model.body(self.names[tip - 1]).tip_point for tip in self.tips]
        found = [self._jacobian(q, int(tip), point) for tip, point in zip(self.tips, points)]
        return np.concatenate(found) if found else np.zeros((0, self.nv))

    def _jacobian(self, q: Array, number: int, point: Any) -> Array:
        jac, place = np.zeros((6, self.nv)), self._place(number, point)
        with self._lock:
            dynamics.jacobian(*self.packed.tree, q, self._rest, *place, self._work, jac)
        return jac

    def _place(self, number: int, point: Any) -> tuple[int, Array]:
        """Return (row, point in the row's axes) for a point on a body."""
        system = self.packed.system
        return system.row_of(number), point_in_row(system, number, point)

    # -- arguments -------------------------------------------------------------------------------

    @property
    def _bodies(self) -> list[Any]:
        return [self.model.body(name) for name in self.names]

    def _speed(self, v: Any) -> Array:
        return finite("v", v, self.nv, of=self.packed)

    def _external(self, external: Array | None) -> Array:
        return NO_EXTERNAL if external is None else numbers("external", external, self.nb, 6)
