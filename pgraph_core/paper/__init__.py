"""The paper's operators in plain NumPy and SciPy, for inspection and as a reference for the
kernels.

Nothing here is fast, everything stands as the paper writes it, with the errata of
docs/conventions.md. `Operators(model, topology, q, v)` holds them all for one state.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..joints import SIZE
from ..model import Body, Model
from ..rotation import Array, skew
from ..topology import Topology
from .motion import Joint, blocks, bodies_of, joint_motion, q_slices, v_slices
from .motion import frames as frames
from .motion import home_poses as home_poses
from .motion import kernel_operator as kernel_operator
from .motion import kernel_operator_of_pgraph as kernel_operator_of_pgraph
from .motion import phi as phi
from .motion import propagation_operator as propagation_operator


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
        """The inertia (nv,) added to the degrees of freedom of rotate and translate motions."""
        added = np.zeros(self.nv)
        for body, place in zip(self.bodies, v_slices(self.bodies)):
            i = place.start
            for motion, value in zip(body.sequence, body.armature):
                size = SIZE[motion.kind][1]
                added[i : i + size] = value if size == 1 else 0.0
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
        """Return the Jacobian (6, nv) at a point in the frame of body number k."""
        shift = phi(self.rotation[k - 1] @ point)
        return shift @ self._motions[6 * k - 6 : 6 * k].toarray()

    def point_bias(self, k: int, point: Array) -> Array:
        """Return J' θ' (6,) for a point, φ (Φ a) + [0, ω × (ω × l_T)] (R6)."""
        arm, w = self.rotation[k - 1] @ point, self.joints[k - 1].omega
        a = self._biases[6 * k - 6 : 6 * k]
        return phi(arm) @ a + np.concatenate((np.zeros(3), np.cross(w, np.cross(w, arm))))

    def point_position(self, k: int, point: Array) -> Array:
        """Return the world position (3,) of a point in the frame of body number k [m]."""
        return self.position[k - 1] + self.rotation[k - 1] @ point

    # -- equations of motion -----------------------------------------------------------------

    @cached_property
    def mass_matrix(self) -> Array:
        """The mass matrix HᵀΦᵀMΦH (nv, nv), eq. (25), with the armature added on its diagonal."""
        motion = self.Phi @ self.H
        return (motion.T @ self.M @ motion).toarray() + np.diag(self.armature)

    @cached_property
    def bias_force(self) -> Array:
        """The bias force C = HᵀΦᵀ(MΦa + b) (nv,), eq. (25), including gravity (R7)."""
        return self.inverse_dynamics(np.zeros(self.nv))

    def joint_force(self, vdot: Array, external: Array | None = None) -> Array:
        """Return F = Φᵀ(M V' + b - F_ext) (6 nb,), eq. (22), the force across each joint at its
        body's O.

        `external` (nb, 6) acts on the bodies; the paper's F_T acts from them, hence the sign.
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
