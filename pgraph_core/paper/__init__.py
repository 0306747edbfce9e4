"""The paper's operators in plain NumPy and SciPy, for inspection and as a reference for the
kernels.

The implementation is not optimised and follows the notation of the paper, including the corrections
in docs/paper.md. `Operators(model, topology, q, v)` contains all of them for one state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from .. import joints
from ..errors import InputError, Problem, explained, shown
from ..joints import SIZE
from ..model import Body, Model
from ..model.poses import Pose, bends, carried, columns, displacement, elementary, poses, turn
from ..rotation import Array, matrix, skew
from ..tolerances import EPS
from ..topology import Ints, Topology, find


@dataclass(frozen=True)
class Operators:
    """All operators at (q, v), computed on first access, in world axes and at the body origins.

    Spatial vectors are [angular; linear]. Bodies are in number order. Sparse matrices are SciPy's.
    `v` may be left out if only positions matter.
    """

    model: Model
    topology: Topology
    q: Array
    v: Array = field(default_factory=lambda: np.zeros(0))

    # -- the state ---------------------------------------------------------------------------

    @cached_property
    def bodies(self) -> list[Body]:
        """The rows of the table in number order."""
        return bodies_of(self.model, self.topology)

    @cached_property
    def nv(self) -> int:
        """The number of degrees of freedom of the model."""
        return sum(body.dof for body in self.bodies)

    @cached_property
    def speeds(self) -> Array:
        """The velocities v, or zeros if none were given."""
        return np.asarray(self.v, dtype=float) if len(self.v) else np.zeros(self.nv)

    @cached_property
    def joints(self) -> list[Joint]:
        """The rotation, link vector, angular velocity, H and a of each body, outboard."""
        q = np.asarray(self.q, dtype=float)
        found: list[Joint] = []
        places = zip(q_slices(self.bodies), v_slices(self.bodies))
        for body, p, (i, j) in zip(self.bodies, self.topology.parent, places):
            rotation, omega = (
                (found[p - 1].rotation, found[p - 1].omega) if p else (np.eye(3), np.zeros(3))
            )
            found.append(joint_motion(body, rotation, omega, q[i], self.speeds[j]))
        return found

    def joint(self, k: int) -> Joint:
        """Return the joint of body number k."""
        return self.joints[k - 1]

    def omega(self, k: int) -> Array:
        """Return the angular velocity (3,) of body number k [rad/s]."""
        return self.joints[k - 1].omega

    @cached_property
    def home(self) -> tuple[Array, Array]:
        """The origins (nb, 3) and rotations (nb, 3, 3) of the bodies at the initial q."""
        return home_poses(self.model)

    @cached_property
    def link(self) -> Array:
        """The vectors (nb, 3) from the parent's origin to the body's, with displacement [m]."""
        return np.array([joint.link for joint in self.joints]).reshape(-1, 3)

    @cached_property
    def rotation(self) -> Array:
        """The rotations (nb, 3, 3) of the body frames."""
        return np.array([joint.rotation for joint in self.joints]).reshape(-1, 3, 3)

    @cached_property
    def position(self) -> Array:
        """The origins (nb, 3) of the body frames [m]."""
        position = np.zeros((self.topology.nb + 1, 3))
        for k, p in enumerate(self.topology.parent, start=1):
            position[k] = position[p] + self.link[k - 1]
        return position[1:]

    # -- the operators -----------------------------------------------------------------------

    @cached_property
    def H(self) -> Any:
        """The motion axes (6 nb, nv), eqs. (6), (7), with one 6 x dof diagonal block per body."""
        from scipy import sparse

        return sparse.block_diag([joint.H for joint in self.joints], format="csr")

    @cached_property
    def eps_phi(self) -> Any:
        """The spatial kernel operator ε_φ (6 nb, 6 nb), eq. (13)."""
        return kernel_operator(self.topology.parent, self.link)

    @cached_property
    def Phi(self) -> Any:
        """The spatial propagation operator Φ (6 nb, 6 nb), eq. (16)."""
        return propagation_operator(self.topology.parent, self.link)

    @cached_property
    def Phi_T(self) -> Any:
        """The operator Φ_T (6 n_t, 6 nb), eq. (18), one block row per `tip` point (R5)."""
        tips = self.topology.tips - 1
        data = np.array([phi(self.rotation[k] @ self.bodies[k].tip_point) for k in tips])
        return blocks(range(len(tips)), tips, data, (len(tips), self.topology.nb))

    @cached_property
    def a(self) -> Array:
        """The velocity-dependent accelerations (6 nb,) across the joints, eq. (9) with R4."""
        return np.array([joint.a for joint in self.joints]).reshape(-1)

    @cached_property
    def M(self) -> Any:
        """The spatial mass matrix (6 nb, 6 nb), below eq. (12)."""
        data = [self._spatial_mass(k) for k in range(self.topology.nb)]
        from scipy import sparse

        return sparse.block_diag(data, format="bsr")

    @cached_property
    def b(self) -> Array:
        """The gyroscopic and centrifugal forces (6 nb,), below eq. (12)."""
        return np.concatenate([self._bias(k) for k in range(self.topology.nb)])

    def _spatial_mass(self, k: int) -> Array:
        """Return M_k = [[I, m l_c ×], [-m l_c ×, m 1]], I about the origin, world axes (R8)."""
        body, R = self.bodies[k], self.rotation[k]
        c = skew(R @ body.com)
        inertia = R @ np.array(body.inertia) @ R.T - body.mass * c @ c
        m = body.mass * np.eye(3)
        return np.block([[inertia, body.mass * c], [-body.mass * c, m]])

    def _bias(self, k: int) -> Array:
        """Return b_k = [ω × I ω, m ω × (ω × l_c)]."""
        body, w = self.bodies[k], self.joints[k].omega
        spin = self._spatial_mass(k)[:3, :3] @ w
        c: Array = self.rotation[k] @ body.com * body.mass
        return np.concatenate((np.cross(w, spin), np.cross(w, np.cross(w, c))))

    @cached_property
    def armature(self) -> Array:
        """The armature (nv,) of the degrees of freedom, one number for all of a motion."""
        added = np.zeros(self.nv)
        for body, place in zip(self.bodies, v_slices(self.bodies)):
            i = place.start
            for motion, value in zip(body.sequence, body.armature):
                size = SIZE[motion.kind][1]
                added[i : i + size] = value
                i += size
        return added

    # -- velocities, accelerations, Jacobians ------------------------------------------------

    @cached_property
    def V(self) -> Array:
        """The spatial velocities (6 nb,) of the bodies, eq. (17)."""
        return self.Phi @ (self.H @ self.speeds)

    @cached_property
    def base(self) -> Array:
        """The acceleration V'_0 = [0, -g] (6 nb,) of the roots' parent: gravity (R7)."""
        held = np.concatenate((np.zeros(3), -np.array(self.model.gravity)))
        return np.outer(self.topology.parent == 0, held).reshape(-1)

    def acceleration(self, vdot: Array) -> Array:
        """Return V' = Φ (H θ'' + a) (6 nb,), eq. (21) as in R6, without gravity."""
        return self.Phi @ (self.H @ vdot + self.a)

    @cached_property
    def jacobian(self) -> Array:
        """The tip Jacobian J = Φ_T Φ H (6 n_t, nv), eq. (20)."""
        return (self.Phi_T @ self.Phi @ self.H).toarray()

    @cached_property
    def _motions(self) -> Any:
        return self.Phi @ self.H

    @cached_property
    def _biases(self) -> Any:
        return self.Phi @ self.a

    def point_jacobian(self, k: int, point: Array) -> Array:
        """Compute the Jacobian (6, nv) at a point in the frame of body number k."""
        shift = phi(self.rotation[k - 1] @ point)
        return shift @ self._motions[6 * k - 6 : 6 * k].toarray()

    def point_bias(self, k: int, point: Array) -> Array:
        """Return J' θ' (6,) for a point, φ (Φ a) + [0, ω × (ω × l_T)] (R6)."""
        arm, w = self.rotation[k - 1] @ point, self.joints[k - 1].omega
        a = self._biases[6 * k - 6 : 6 * k]
        return phi(arm) @ a + np.concatenate((np.zeros(3), np.cross(w, np.cross(w, arm))))

    def point_position(self, k: int, point: Array) -> Array:
        """Compute the world position (3,) of a point in the frame of body number k [m]."""
        return self.position[k - 1] + self.rotation[k - 1] @ point

    # -- equations of motion -----------------------------------------------------------------

    @cached_property
    def mass_matrix(self) -> Array:
        """The mass matrix HᵀΦᵀMΦH (nv, nv), eq. (25), with the armature added on its diagonal."""
        motion = self.Phi @ self.H
        return (motion.T @ self.M @ motion).toarray() + np.diag(self.armature)

    @cached_property
    def Omega(self) -> Array:
        """The operator Ω = J M⁻¹ Jᵀ (6 n_t, 6 n_t), below eq. (29). Raises InputError if the mass
        matrix is singular."""
        return tip_mobility(self.mass_matrix, self.jacobian, self.bodies)

    @cached_property
    def bias_force(self) -> Array:
        """The bias force C = HᵀΦᵀ(MΦa + b) (nv,), eq. (25), including gravity (R7)."""
        return self.inverse_dynamics(np.zeros(self.nv))

    def joint_force(self, vdot: Array, external: Array | None = None) -> Array:
        """Return F = Φᵀ(M V' + b - F_ext) (6 nb,), eq. (22), the force across each joint at its
        body's O.

        `external` (nb, 6) acts on the bodies, whereas F_T in the paper is exerted by them, hence
        the sign.
        """
        F = self.M @ (self.acceleration(vdot) + self.Phi @ self.base) + self.b
        return self.Phi.T @ (F if external is None else F - np.reshape(external, -1))

    def inverse_dynamics(self, vdot: Array, external: Array | None = None) -> Array:
        """Return τ = HᵀF (nv,), eqs. (23), (24)."""
        return self.H.T @ self.joint_force(vdot, external) + self.armature * vdot

    def forward_dynamics(self, tau: Array | None = None, external: Array | None = None) -> Array:
        """Return θ'' = M⁻¹(τ - C - JᵀF) (nv,), eq. (26), computed by a dense solve."""
        tau = np.zeros(self.nv) if tau is None else tau
        rest = self.inverse_dynamics(np.zeros(self.nv), external)
        from scipy.linalg import solve

        return solve(self.mass_matrix, tau - rest, assume_a="pos")

    # -- energy ------------------------------------------------------------------------------

    @cached_property
    def kinetic_energy(self) -> float:
        """The kinetic energy ½ VᵀMV, including the armature's contribution [J]."""
        return float(self.V @ (self.M @ self.V) + self.armature @ self.speeds**2) / 2

    @cached_property
    def potential_energy(self) -> float:
        """The potential energy -Σ m g · x_c [J]."""
        at = [self.point_position(k, np.array(b.com)) for k, b in enumerate(self.bodies, start=1)]
        return -sum(b.mass * float(np.dot(self.model.gravity, x)) for b, x in zip(self.bodies, at))


# -- joint motion, eqs. (5)-(9) --------------------------------------------------------------------


class Joint(NamedTuple):
    """A joint at a given state in world axes, with H and a at the body's origin."""

    rotation: Array  # (3, 3) attitude of the body
    link: Array  # (3,) from the parent's origin to the body's, displacement included [m]
    omega: Array  # (3,) angular velocity of the body [rad/s]
    H: Array  # (6, dof), eqs. (6), (7)
    a: Array  # (6,), eq. (9) with R4


def bodies_of(model: Model, topology: Topology) -> list[Body]:
    """Return the rows of the table in number order. Raises InputError for a model with beams."""
    if model.beams:
        text = "a beam has many joints here; give model.expanded, in which its segments are bodies"
        raise InputError(Problem("model", "beams", text))
    return [model.bodies[row] for row in topology.row]


def q_slices(bodies: Sequence[Body]) -> list[slice]:
    """Return each body's slice of q."""
    return _slices([joints.nq(body.sequence) for body in bodies])


def v_slices(bodies: Sequence[Body]) -> list[slice]:
    """Return each body's slice of v."""
    return _slices([joints.nv(body.sequence) for body in bodies])


def _slices(sizes: list[int]) -> list[slice]:
    ends = list(accumulate(sizes))
    return [slice(end - size, end) for size, end in zip(sizes, ends)]


def frames(model: Model, topology: Topology, q: Sequence[float] | Array) -> tuple[Array, Array]:
    """Return origins (nb, 3) and rotations (nb, 3, 3) of the bodies in the world, by number."""
    bodies = bodies_of(model, topology)
    found = [Pose(np.zeros(3), np.eye(3))]  # pose of the ground
    for body, p, place in zip(bodies, topology.parent.tolist(), q_slices(bodies)):
        found.append(carried(found[p], body, q[place]))
    return _arrays(found[1:])


@explained
def home_poses(model: Model) -> tuple[Array, Array]:
    """Return positions and rotations of all bodies at the initial coordinates of the model.

    Parameters
    ----------
    model : Model
        The model.

    Returns
    -------
    ndarray (n, 3), ndarray (n, 3, 3)
        Origins [m] and rotations in the order of body numbers, as returned by `frames`.

    Raises
    ------
    InputError
        If `model` is not a Model.
    """
    if not isinstance(model, Model):
        text = f"must be a pg.Model, got {shown(model)}"
        raise InputError(Problem("home_poses", "model", text))
    found = poses(model.standing)
    return _arrays([found[name] for name in Topology.of(model).names])


def _arrays(found: Sequence[Pose]) -> tuple[Array, Array]:
    """Return the origins (nb, 3) and rotations (nb, 3, 3) of these poses."""
    position = np.array([pose.position for pose in found]).reshape(-1, 3)
    return position, np.array([pose.rotation for pose in found]).reshape(-1, 3, 3)


def joint_motion(body: Body, rotation: Array, omega: Array, q: Array, v: Array) -> Joint:
    """Return the joint of a body whose parent has this rotation and angular velocity.

    Eqs. (5) and (8) are applied to each motion, and φ, H and a are combined such that one block H
    (6 x dof) and one a represent the whole joint.
    """
    turned, home = rotation, matrix(body.rotation)
    link = rotation @ body.link
    H, a = np.zeros((6, 0)), bias(omega, link, np.zeros(6))
    start = 0
    for motion, x in elementary(body, q):
        step = displacement(motion, turned, home, x)
        axes = columns(motion, turned, home, x)
        speeds = v[start : start + axes.shape[1]]
        relative = axes @ speeds
        H = np.hstack((phi(step) @ H, axes))
        a = phi(step) @ a + bias(omega, step, relative)
        if len(x) == 1:
            a += bends(motion, turned, home, x) @ speeds**2
        link, omega = link + step, omega + relative[:3]
        turned = turned @ turn(motion, home, x)
        start += axes.shape[1]
    return Joint(turned @ home, link, omega, H, a)


def bias(omega: Array, link: Array, relative: Array) -> Array:
    """Return a from eq. (9) for any motion (R4). `relative` = H θ' is the velocity across it.

    [ω × ω_rel; ω × (ω × l) + 2 ω × l'_rel], ω of the body before the motion. The published term ω_j
    × ω_κ is the first term of a hinge, without the Coriolis term 2 ω × l'.
    """
    slide = np.cross(omega, np.cross(omega, link)) + 2 * np.cross(omega, relative[3:])
    return np.concatenate((np.cross(omega, relative[:3]), slide))


# -- operators of the structure --------------------------------------------------------------------


def phi(link: Sequence[float] | Array) -> Array:
    """Return the propagation matrix φ (6, 6) of eq. (6): V at the far end of `link` = φ V."""
    shift = np.eye(6)
    shift[3:, :3] = -skew(link)
    return shift


def blocks(
    rows: Sequence[int] | Ints, columns: Sequence[int] | Ints, data: Array, shape: tuple[int, int]
) -> Any:
    """Return a sparse block matrix with `shape` blocks, and a 6x6 block at each (row, column)."""
    at, column = np.asarray(rows, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    order = np.lexsort((column, at))
    start = np.searchsorted(at[order], np.arange(shape[0] + 1))
    data = np.reshape(data, (-1, 6, 6))[order]
    size = (6 * shape[0], 6 * shape[1])
    from scipy import sparse

    matrix = sparse.bsr_array((data, column[order], start), shape=size, blocksize=(6, 6)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def kernel_operator(parent: Ints, link: Array) -> Any:
    """Return ε_φ = Σ e_κ φ_κ,j e_jᵀ (6 nb, 6 nb), eq. (13), of `link` (nb, 3) in world axes [m]."""
    child = np.flatnonzero(parent)
    data = np.array([phi(link[k]) for k in child])
    return blocks(child, parent[child] - 1, data, (len(parent), len(parent)))


def kernel_operator_of_pgraph(pgraph: Sequence[int] | Ints, link: Array) -> Any:
    """Build ε_φ from Pgraph alone, Fig. 6. No adjacency matrix is required or formed.

    Walk Pgraph: the entry before the first occurrence of a body is its parent.
    """
    pgraph = np.asarray(pgraph, dtype=np.int64)
    first = find(pgraph)
    inner = [i for i in first if i > 0 and pgraph[i] > 0 and pgraph[i - 1] > 0]
    rows, columns = pgraph[inner] - 1, pgraph[[i - 1 for i in inner]] - 1
    data = np.array([phi(link[k]) for k in rows])
    return blocks(rows, columns, data, (len(link), len(link)))


def propagation_operator(parent: Ints, link: Array) -> Any:
    """Return Φ = (1 - ε_φ)⁻¹, eq. (16), from products of φ along paths, as a sparse (6 nb, 6 nb)
    matrix.

    Block row κ is φ_κ,ρ(κ) times block row ρ(κ), plus the identity at κ, so no inverse is computed.
    Block (κ, j) is only nonzero if j is κ or one of its ancestors. O(n · depth).
    """
    paths: list[Ints] = []
    rows: list[Array] = []
    for k, p in enumerate(parent.tolist()):
        path = np.append(paths[p - 1], k) if p else np.array([k])
        ahead = phi(link[k]) @ rows[p - 1] if p else np.zeros((0, 6, 6))
        paths.append(path)
        rows.append(np.concatenate((ahead, np.eye(6)[None])))
    at = np.repeat(np.arange(len(parent)), [len(path) for path in paths])
    return blocks(at, np.concatenate(paths), np.concatenate(rows), (len(parent), len(parent)))


def tip_mobility(M: Array, J: Array, bodies: Sequence[Body]) -> Array:
    """Return Ω = J M⁻¹ Jᵀ, below eq. (29): the accelerations of the tips by unit forces on them.

    `bodies` are the rows of the table in number order. Raises InputError if M is singular, at least
    up to rounding.
    """
    size = np.sqrt(M.diagonal())
    size[size == 0.0] = 1.0
    values, ways = np.linalg.eigh(M / np.outer(size, size))
    if len(M) and values[0] <= len(M) * EPS:
        of = [body.name for body in bodies for _ in range(body.dof)][np.abs(ways[:, 0]).argmax()]
        text = f"the mass matrix is singular: no inertia moves with '{of}'; give it mass or inertia"
        raise InputError(Problem("operators", "Omega", text))
    return J @ np.linalg.solve(M, J.T)
