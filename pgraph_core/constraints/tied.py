"""The constraints of a model at a state as dense rows in the mass metric: to close and to count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..model import Constraint, Model
from ..paper.constraint_rows import Rows, rows_of
from ..paper.motion import bodies_of
from ..rotation import Array
from ..topology import Topology
from .tree import Tree

if TYPE_CHECKING:
    from ..paper import Operators
    from .posed import Posed

LENGTH, ANGLE, SLIP, COORDINATE = "translation", "rotation", "slip", "coordinate"
IN_COORDINATES = ("gear", "motion", "velocity")
ONLY_SPEEDS = ("skate", "velocity")  # kinds that say nothing of positions

# Degrees of freedom below which no solver makes threads: OpenBLAS's triangular one does for any
# matrix, and waits a hundred times as long for them as it computes where processors are busy.
ALONE = 200


class Group(NamedTuple):
    """Rows of one constraint that are of one nature."""

    constraint: Constraint
    nature: str  # translation, rotation, slip or coordinate
    rows: slice
    directions: Array  # (rows, 3) unit vectors in world axes; zero where it has none
    holonomic: bool  # whether positions obey them


@dataclass(frozen=True)
class Tied:
    """Rows of the constraints `held` of a tree at (q, v), and at a time [s]."""

    tree: Tree
    held: tuple[Constraint, ...]
    q: Array
    v: Array = field(default_factory=lambda: np.zeros(0))
    t: float = 0.0

    def at(self, q: Array, v: Array | None = None) -> Tied:
        """The same constraints at another state."""
        return Tied(self.tree, self.held, q, self.v if v is None else v, self.t)

    def without(self, name: str) -> Tied:
        """The other constraints at this state."""
        held = tuple(c for c in self.held if c.name != name)
        return Tied(self.tree, held, self.q, self.v, self.t)

    @cached_property
    def posed(self) -> Operators | Posed:
        """The bodies at q."""
        return self.tree.posed(self.q)

    @property
    def nv(self) -> int:
        """Degrees of freedom of the tree."""
        return self.tree.nv

    @property
    def speeds(self) -> Array:
        """(nv,) v, or zeros where none was given."""
        return np.asarray(self.v, dtype=float) if len(self.v) else np.zeros(self.nv)

    @property
    def length(self) -> float:
        """What stands for one radian [m]."""
        return self.tree.length

    @cached_property
    def size(self) -> float:
        """Of the mechanism [m]: what rounding of positions is relative to."""
        points = [p for c in self.held for p in (c.point, c.other_point) if p is not None]
        farthest = [
            np.abs(x).max() for x in [self.posed.position, *map(np.array, points)] if x.size
        ]
        return float(max(farthest, default=0.0)) or 1.0

    @cached_property
    def _rows(self) -> list[Rows]:
        return [rows_of(self.posed, c, self.length, self.t) for c in self.held]

    @cached_property
    def J(self) -> Array:
        """(m, nv) of all rows."""
        return np.vstack([np.zeros((0, self.nv)), *(rows.J for rows in self._rows)])

    @cached_property
    def gap(self) -> Array:
        """(m,) residuals of positions [m]; 0 for rows that only velocities obey."""
        return np.concatenate([np.zeros(0), *(rows.residual for rows in self._rows)])

    @cached_property
    def slip(self) -> Array:
        """(m,) residuals of velocities [m/s]."""
        asked = np.concatenate([np.zeros(0), *(rows.speed for rows in self._rows)])
        return self.J @ self.speeds - asked

    @cached_property
    def root(self) -> Array:
        """(nv, nv) lower L with M = L Lᵀ; joints without inertia get a little."""
        M = self.posed.mass_matrix
        try:
            root = np.linalg.cholesky(M)
        except np.linalg.LinAlgError:
            largest = float(np.max(np.diag(M), initial=0.0)) or 1.0
            root = np.linalg.cholesky(M + 1e-9 * largest * np.eye(len(M)))
        return np.array(root, dtype=np.float64)

    @cached_property
    def scaled(self) -> Array:
        """(m, nv) J L⁻ᵀ: rows whose lengths and angles are those of the mass metric."""
        return self._solved(self.root, self.J.T).T

    @cached_property
    def parts(self) -> tuple[Array, Array, Array]:
        """U, s, Vᵀ of the scaled rows that positions obey, without what is rounding."""
        rows = self.scaled[self.holonomic]
        left, sizes, right = np.linalg.svd(rows, full_matrices=False)
        kept = sizes > np.finfo(float).eps * max(rows.shape) * sizes.max(initial=0.0)
        return left[:, kept], sizes[kept], right[kept]

    def step(self, y: Array) -> Array:
        """L⁻ᵀ y, (nv,) or (nv, n): back from the mass metric."""
        return self._solved(self.root.T, y)

    def _solved(self, triangle: Array, y: Array) -> Array:
        if self.nv < ALONE:
            x: Array = np.linalg.solve(triangle, y).astype(float, copy=False)
            return x
        from scipy.linalg import solve_triangular

        return solve_triangular(triangle, y, lower=triangle is self.root)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """All rows by constraint and nature, in the order of the model."""
        found: list[Group] = []
        start = 0
        for c, rows in zip(self.held, self._rows):
            for nature, span, holonomic in _natures(c, rows):
                place = slice(start + span.start, start + span.stop)
                turns = nature == ANGLE
                along = rows.wrench[span, :3] if turns else rows.wrench[span, 3:]
                along = np.zeros_like(along) if nature == COORDINATE else _units(along)
                found.append(Group(c, nature, place, along, holonomic))
            start += len(rows.J)
        return tuple(found)

    @cached_property
    def holonomic(self) -> NDArray[np.int64]:
        """Indices of the rows that positions obey."""
        spans = [range(g.rows.start, g.rows.stop) for g in self.groups if g.holonomic]
        return np.array([r for span in spans for r in span], dtype=np.int64)


def _natures(c: Constraint, rows: Rows) -> list[tuple[str, slice, bool]]:
    m = len(rows.J)
    if c.kind in IN_COORDINATES:
        return [(COORDINATE, slice(0, m), c.kind not in ONLY_SPEEDS)]
    if c.kind == "skate":
        return [(SLIP, slice(0, m), False)]
    if c.kind == "rolling":
        return [(LENGTH, slice(0, 1), True), (SLIP, slice(1, m), False)]
    turns = (np.abs(rows.wrench[:, 3:]).max(axis=1) == 0.0).tolist()
    first = turns.index(True) if True in turns else m
    last = first + sum(turns)
    spans = [(LENGTH, 0, first), (ANGLE, first, last), (LENGTH, last, m)]
    return [(nature, slice(a, b), True) for nature, a, b in spans if b > a]


def _units(vectors: Array) -> Array:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(size > 0, size, 1.0)


def held_by(model: Model, names: Sequence[str] | None = None) -> tuple[Constraint, ...]:
    """The named constraints, or those that the model calls active, in its order."""
    return tuple(c for c in model.constraints if (c.active if names is None else c.name in names))


def home(model: Model, topology: Topology) -> Array:
    """q of the model's initial state."""
    values = [np.asarray(body.q, dtype=float) for body in bodies_of(model, topology)]
    return np.concatenate([np.zeros(0), *values])


def axis_name(direction: Array, tied: Tied, other: int) -> str:
    """ "x", or "x of 'rod'" for an axis of body number `other`, or the direction in world axes."""
    frames = [(np.eye(3), "")]
    if other:
        name = tied.tree.bodies[other - 1].name
        frames.append((tied.posed.rotation[other - 1], f" of '{name}'"))
    for frame, of in frames:
        along = np.abs(frame.T @ direction)
        if along.max() > 1 - 1e-9:
            return "xyz"[int(along.argmax())] + of
    first = direction[np.abs(direction) > 1e-6][0]  # the largest may be two, equal to rounding
    x, y, z = direction if first > 0 else -direction
    return f"({x + 0.0:.3g}, {y + 0.0:.3g}, {z + 0.0:.3g})"
