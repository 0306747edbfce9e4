"""The constraints of a model at a state as dense rows in the mass metric: to close and to count.

Plain NumPy on the paper's operators: nothing is compiled for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..operators import Operators
from ..operators.constraint_rows import Rows, radius_of_gyration, rows_of
from ..operators.motion import bodies_of, q_slices, v_slices
from ..rotation import Array, multiply, unit
from ..schema import Constraint, Model
from ..topology import Topology

LENGTH, ANGLE, SLIP, COORDINATE = "translation", "rotation", "slip", "coordinate"
IN_COORDINATES = ("gear", "motion", "velocity")
ONLY_SPEEDS = ("skate", "velocity")  # kinds that say nothing of positions


class Group(NamedTuple):
    """Rows of one constraint that are of one nature."""

    constraint: Constraint
    nature: str  # translation, rotation, slip or coordinate
    rows: slice
    directions: Array  # (rows, 3) unit vectors in world axes; zero where it has none
    holonomic: bool  # whether positions obey them


@dataclass(frozen=True)
class Tied:
    """Rows of the constraints `held` of a model at (q, v), and at a time [s]."""

    model: Model
    topology: Topology
    held: tuple[Constraint, ...]
    q: Array
    v: Array = field(default_factory=lambda: np.zeros(0))
    t: float = 0.0

    def at(self, q: Array, v: Array | None = None) -> Tied:
        """The same constraints at another state."""
        return Tied(self.model, self.topology, self.held, q, self.v if v is None else v, self.t)

    def without(self, name: str) -> Tied:
        """The other constraints at this state."""
        held = tuple(c for c in self.held if c.name != name)
        return Tied(self.model, self.topology, held, self.q, self.v, self.t)

    @cached_property
    def op(self) -> Operators:
        """The paper's operators."""
        return Operators(self.model, self.topology, self.q, self.v)

    @cached_property
    def length(self) -> float:
        """What stands for one radian [m]."""
        return radius_of_gyration(self.op)

    @cached_property
    def size(self) -> float:
        """Of the mechanism [m]: what rounding of positions is relative to."""
        points = [p for c in self.held for p in (c.point, c.other_point) if p is not None]
        farthest = [np.abs(x).max() for x in (self.op.position, *map(np.array, points)) if x.size]
        return float(max(farthest, default=0.0)) or 1.0

    @cached_property
    def _rows(self) -> list[Rows]:
        return [rows_of(self.op, c, self.length, self.t) for c in self.held]

    @cached_property
    def J(self) -> Array:
        """(m, nv) of all rows."""
        return np.vstack([np.zeros((0, self.op.nv)), *(rows.J for rows in self._rows)])

    @cached_property
    def gap(self) -> Array:
        """(m,) residuals of positions [m]; 0 for rows that only velocities obey."""
        return np.concatenate([np.zeros(0), *(rows.residual for rows in self._rows)])

    @cached_property
    def slip(self) -> Array:
        """(m,) residuals of velocities [m/s]."""
        asked = np.concatenate([np.zeros(0), *(rows.speed for rows in self._rows)])
        return self.J @ self.op.speeds - asked

    @cached_property
    def root(self) -> Array:
        """(nv, nv) lower L with M = L Lᵀ; joints without inertia get a little."""
        M = self.op.mass_matrix
        try:
            root = np.linalg.cholesky(M)
        except np.linalg.LinAlgError:
            largest = float(np.max(np.diag(M), initial=0.0)) or 1.0
            root = np.linalg.cholesky(M + 1e-9 * largest * np.eye(len(M)))
        return np.array(root, dtype=np.float64)

    @cached_property
    def scaled(self) -> Array:
        """(m, nv) J L⁻ᵀ: rows whose lengths and angles are those of the mass metric."""
        from scipy.linalg import solve_triangular

        return solve_triangular(self.root, self.J.T, lower=True).T

    def step(self, y: Any) -> Array:
        """(nv,) L⁻ᵀ y: back from the mass metric."""
        from scipy.linalg import solve_triangular

        return solve_triangular(self.root.T, y, lower=False)

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


def advanced(tied: Tied, step: Array) -> Array:
    """q after a finite move along velocities: turns of balls and free joints multiply."""
    q = np.array(tied.q, dtype=float)
    for kind, i, j in _motions(tied):
        if kind in ("rotate", "translate"):
            q[i] += step[j]
            continue
        if kind == "free":
            q[i : i + 3] += step[j + 3 : j + 6]
            i += 3
        q[i : i + 4] = unit(multiply(_turn(step[j : j + 3]), q[i : i + 4].tolist()))
    return q


def apart(tied: Tied, q: Array) -> Array:
    """(nv,) the move from the state of `tied` to q, as `advanced` takes it."""
    step = np.zeros(tied.op.nv)
    for kind, i, j in _motions(tied):
        if kind in ("rotate", "translate"):
            step[j] = q[i] - tied.q[i]
            continue
        if kind == "free":
            step[j + 3 : j + 6] = q[i : i + 3] - tied.q[i : i + 3]
            i += 3
        w, x, y, z = unit(tied.q[i : i + 4].tolist())
        w, *axis = unit(multiply(unit(q[i : i + 4].tolist()), (w, -x, -y, -z)))
        sine = float(np.linalg.norm(axis))
        angle = 2 * np.arctan2(sine, abs(w)) * (1 if w >= 0 else -1)
        step[j : j + 3] = np.array(axis) * (angle / sine if sine > 0 else 0.0)
    return step


def _motions(tied: Tied) -> list[tuple[str, int, int]]:
    """(kind, first coordinate, first degree of freedom) of every motion, in number order."""
    found: list[tuple[str, int, int]] = []
    bodies = tied.op.bodies
    for body, places, (start, _) in zip(bodies, q_slices(bodies), _starts(tied)):
        i, j = places.start, start
        for motion in body.sequence:
            found.append((motion.kind, i, j))
            i += {"ball": 4, "free": 7}.get(motion.kind, 1)
            j += {"ball": 3, "free": 6}.get(motion.kind, 1)
    return found


def _starts(tied: Tied) -> list[tuple[int, int]]:
    return [(s.start, s.stop) for s in v_slices(tied.op.bodies)]


def _turn(vector: Array) -> tuple[float, float, float, float]:
    """The quaternion of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    share = np.sinc(angle / 2 / np.pi) / 2
    x, y, z = (float(share * a) for a in vector)
    return (float(np.cos(angle / 2)), x, y, z)


def is_turn(tied: Tied) -> Array:
    """(nv,) whether a degree of freedom is an angle."""
    turns = np.zeros(tied.op.nv, dtype=bool)
    for kind, _, j in _motions(tied):
        turns[j : j + {"rotate": 1, "ball": 3, "free": 3}.get(kind, 0)] = True
    return turns


def joints_of(tied: Tied) -> list[tuple[str, slice]]:
    """Names of the bodies whose joints move, with their degrees of freedom."""
    names = [body.name for body in tied.op.bodies]
    return [(n, slice(a, b)) for n, (a, b) in zip(names, _starts(tied)) if b > a]


def axis_name(direction: Array, tied: Tied, other: int) -> str:
    """ "x", or "x of 'rod'" for an axis of body number `other`, or the direction in world axes."""
    frames = [(np.eye(3), "")]
    if other:
        name = tied.op.bodies[other - 1].name
        frames.append((tied.op.rotation[other - 1], f" of '{name}'"))
    for frame, of in frames:
        along = np.abs(frame.T @ direction)
        if along.max() > 1 - 1e-9:
            return "xyz"[int(along.argmax())] + of
    first = direction[np.abs(direction) > 1e-6][0]  # the largest may be two, equal to rounding
    x, y, z = direction if first > 0 else -direction
    return f"({x + 0.0:.3g}, {y + 0.0:.3g}, {z + 0.0:.3g})"
