"""A model's bodies in a position and at rest, by compiled kernels: what rows of constraints ask.

It answers as `operators.Operators` does where nothing moves, in O(n) for each point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..columns import Columns
from ..engine import layout as at
from ..engine.tree import bodies as kernels
from ..engine.tree import dynamics
from ..model import Body, Model
from ..paper.motion import Joint, joint_motion
from ..rotation import Array
from ..system import System, packed, point_in_row, system
from ..topology import Topology
from .tree import Tree

NOWHERE = np.zeros(3)
STILL = np.zeros(6)


class Packed(NamedTuple):
    """What the kernels take of a model in any position."""

    system: System
    work: Array  # their workspace; it holds nothing between calls

    @classmethod
    def of(cls, model: Model) -> Packed:
        """Of a valid model."""
        columns = Columns.of(model)
        constants = system(packed(columns)[0], columns.nq)
        return cls(constants, np.zeros((len(constants.rows), at.WORK)))


@dataclass(frozen=True)
class Posed:
    """The bodies of a tree at q, at rest; world axes, answers made when first asked for."""

    tree: Tree
    q: Array
    packed: Packed

    @property
    def model(self) -> Model:
        return self.tree.model

    @property
    def topology(self) -> Topology:
        return self.tree.topology

    @cached_property
    def bodies(self) -> list[Body]:
        return self.tree.bodies

    @cached_property
    def home(self) -> tuple[Array, Array]:
        return self.tree.home

    @cached_property
    def nv(self) -> int:
        return self.tree.nv

    @cached_property
    def speeds(self) -> Array:
        """(nv,) zeros."""
        return np.zeros(self.nv)

    @cached_property
    def _poses(self) -> tuple[Array, Array]:
        nb, (constants, work) = self.topology.nb, self.packed
        position, rotation = np.empty((nb, 3)), np.empty((nb, 9))
        kernels.poses(*constants[:4], self.q, self.speeds, work, position, rotation)
        return position, rotation.reshape(nb, 3, 3)

    @cached_property
    def position(self) -> Array:
        """(nb, 3) origins of the body frames [m]."""
        return self._poses[0]

    @cached_property
    def rotation(self) -> Array:
        """(nb, 3, 3) rotations of the body frames."""
        return self._poses[1]

    @cached_property
    def mass_matrix(self) -> Array:
        """(nv, nv) of eq. (25), armature included."""
        (constants, work), m = self.packed, np.zeros((self.nv, self.nv))
        dynamics.mass_matrix(*constants[:2], self.q, self.speeds, work, m)
        return m

    def point_position(self, k: int, point: Array) -> Array:
        """(3,) place in the world of a point in the frame of body number k [m]."""
        return self.position[k - 1] + self.rotation[k - 1] @ point

    def point_jacobian(self, k: int, point: Array) -> Array:
        """(6, nv) of a point in the frame of body number k."""
        (constants, work), jac = self.packed, np.zeros((6, self.nv))
        where = int(constants.bodies_i[k, at.ROW]), point_in_row(constants, k, point)
        dynamics.jacobian(*constants[:2], self.q, self.speeds, *where, work, jac)
        return jac

    def point_bias(self, k: int, point: Array) -> Array:
        """(6,) zeros: J' θ' of a point at rest."""
        return STILL

    def omega(self, k: int) -> Array:
        """(3,) zeros: angular velocity of a body at rest."""
        return NOWHERE

    def joint(self, k: int) -> Joint:
        """The joint of body number k, with its H."""
        p, (i, j) = int(self.topology.parent[k - 1]), self.tree.places[k - 1]
        carrying = self.rotation[p - 1] if p else np.eye(3)
        return joint_motion(self.bodies[k - 1], carrying, NOWHERE, self.q[i], self.speeds[j])
