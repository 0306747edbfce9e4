"""What positions of one model share: where joints stand in q and v, and finite moves of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..model import Body, Model
from ..paper import Operators
from ..paper.constraint_rows import radius_of_gyration
from ..paper.motion import bodies_of, home_poses, q_slices, v_slices
from ..rotation import Array, multiply, unit
from ..topology import Ints, Topology

if TYPE_CHECKING:
    from .posed import Packed, Posed

SMALL = 40  # degrees of freedom up to which no kernel is worth loading the compiler for


@dataclass(frozen=True)
class Tree:
    """A model with its topology."""

    model: Model
    topology: Topology

    @cached_property
    def bodies(self) -> list[Body]:
        """The rows of the table in number order."""
        return bodies_of(self.model, self.topology)

    @cached_property
    def nv(self) -> int:
        """Degrees of freedom."""
        return sum(body.dof for body in self.bodies)

    @cached_property
    def home(self) -> tuple[Array, Array]:
        """Origins and rotations of all body frames in the initial state."""
        return home_poses(self.model)

    @cached_property
    def length(self) -> float:
        """What stands for one radian [m]."""
        return radius_of_gyration(self.bodies)

    @cached_property
    def places(self) -> list[tuple[slice, slice]]:
        """Where each body's joint stands in q and in v, by number."""
        return list(zip(q_slices(self.bodies), v_slices(self.bodies)))

    @cached_property
    def joints(self) -> list[tuple[str, slice]]:
        """Names of the bodies whose joints move, with their degrees of freedom."""
        spans = [(b.name, v) for b, (_, v) in zip(self.bodies, self.places)]
        return [(name, v) for name, v in spans if v.stop > v.start]

    @cached_property
    def turns(self) -> Array:
        """(nv,) whether a degree of freedom is an angle."""
        angles = np.zeros(self.nv, dtype=bool)
        for kind, _, j in self._motions:
            angles[j : j + {"rotate": 1, "ball": 3, "free": 3}.get(kind, 0)] = True
        return angles

    def posed(self, q: Array) -> Operators | Posed:
        """The bodies at q, at rest."""
        if self.nv <= SMALL:
            return Operators(self.model, self.topology, q)
        from .posed import Posed

        return Posed(self, q, self._packed)

    @cached_property
    def _packed(self) -> Packed:
        from .posed import Packed

        return Packed.of(self.model)

    # -- finite moves --------------------------------------------------------------------------

    @cached_property
    def _motions(self) -> list[tuple[str, int, int]]:
        """(kind, first coordinate, first degree of freedom) of every motion, in number order."""
        found: list[tuple[str, int, int]] = []
        for body, (p, s) in zip(self.bodies, self.places):
            i, j = p.start, s.start
            for motion in body.sequence:
                found.append((motion.kind, i, j))
                i += {"ball": 4, "free": 7}.get(motion.kind, 1)
                j += {"ball": 3, "free": 6}.get(motion.kind, 1)
        return found

    @cached_property
    def _single(self) -> tuple[Ints, Ints]:
        """Places in q and in v of motions with one coordinate."""
        single = [(i, j) for kind, i, j in self._motions if kind in ("rotate", "translate")]
        at_q, at_v = np.array(single, dtype=np.int64).reshape(-1, 2).T
        return at_q, at_v

    @cached_property
    def _balls(self) -> list[tuple[int, int]]:
        """Places in q of quaternions, and in v of their angular velocities."""
        first = {"ball": 0, "free": 3}
        return [(i + first[kind], j) for kind, i, j in self._motions if kind in first]

    @cached_property
    def _free(self) -> list[tuple[int, int]]:
        """Places in q and v of the shifts of free joints."""
        return [(i, j + 3) for kind, i, j in self._motions if kind == "free"]

    def advanced(self, q: Array, step: Array) -> Array:
        """q after a finite move along velocities: turns of balls and free joints multiply."""
        q = np.array(q, dtype=float)
        i, j = self._single
        q[i] += step[j]
        for i, j in self._free:
            q[i : i + 3] += step[j : j + 3]
        for i, j in self._balls:
            q[i : i + 4] = unit(multiply(_turn(step[j : j + 3]), q[i : i + 4].tolist()))
        return q

    def apart(self, start: Array, q: Array) -> Array:
        """(nv,) the move from one position to another, as `advanced` takes it."""
        step = np.zeros(self.nv)
        i, j = self._single
        step[j] = q[i] - start[i]
        for i, j in self._free:
            step[j : j + 3] = q[i : i + 3] - start[i : i + 3]
        for i, j in self._balls:
            w, x, y, z = unit(start[i : i + 4].tolist())
            w, *axis = unit(multiply(unit(q[i : i + 4].tolist()), (w, -x, -y, -z)))
            sine = float(np.linalg.norm(axis))
            angle = 2 * np.arctan2(sine, abs(w)) * (1 if w >= 0 else -1)
            step[j : j + 3] = np.array(axis) * (angle / sine if sine > 0 else 0.0)
        return step


def _turn(vector: Array) -> tuple[float, float, float, float]:
    """The quaternion of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    share = np.sinc(angle / 2 / np.pi) / 2
    x, y, z = (float(share * a) for a in vector)
    return (float(np.cos(angle / 2)), x, y, z)
