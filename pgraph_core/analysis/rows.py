"""Constraint rows at a state: Jacobian and residuals, also in the mass metric."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..dynamics import Dynamics
from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.cable_places import spans_of_segment
from ..engine.tree import dynamics
from ..model import Constraint
from ..model.constraint import AtPoints
from ..model.curve_point import CurvePoint
from ..packing import Array, Ints, plain
from ..packing.constraints import radius_of_gyration
from ..packing.forces import NO_LOADS
from ..rotation import multiply, unit
from ..tolerances import NOTABLE, SOLVED

COORDINATES = (at.T_COORD, at.T_VELOCITY, at.T_RELATION)  # types of rows on joint coordinates
LENGTH, ANGLE, SLIP, COORDINATE = "translation", "rotation", "slip", "coordinate"

# Degrees of freedom below which no solver makes threads: OpenBLAS's triangular one does for any
# matrix, and waits a hundred times as long for them as it computes if processors are busy.
ALONE = 200


class Group(NamedTuple):
    """The rows that share one constraint and one type."""

    constraint: Constraint
    nature: str  # translation, rotation, slip or coordinate
    rows: slice
    directions: Array  # (rows, 3) unit vectors in world axes, zero for rows without a direction
    holonomic: bool  # True if they constrain positions


class _Evaluated(NamedTuple):
    """The rows at one position, as returned by the kernels."""

    J: Array  # (m, nv)
    gap: Array  # (m,) residuals of positions [m], 0 for rows of velocities alone
    asked: Array  # (m,) speeds of prescribed motions [m/s]
    groups: tuple[Group, ...]


@dataclass(frozen=True)
class Rows:
    """The rows for selected constraints of a mechanism at (q, v) and at a time [s].

    Rotation rows are multiplied by the radius of gyration of all bodies, so that residuals are in
    metres.
    """

    mech: Dynamics
    scene: Scene
    held: tuple[int, ...]  # indices of constraints
    q: Array
    v: Array
    t: float = 0.0

    @classmethod
    def of(
        cls, mech: Dynamics, active: Ints, q: Array, v: Array | None = None, t: float = 0.0
    ) -> Rows:
        """Return the rows for the constraints with these indices, at rest unless `v` is given."""
        scene = Scene(mech.packed, mech.packed.passive, NO_LOADS, active)
        v = np.zeros(mech.nv) if v is None else v
        return cls(mech, scene, tuple(active.tolist()), q[: mech.nq], v[: mech.nv], t)

    def at(self, q: Array, v: Array | None = None) -> Rows:
        """Return the same constraints at another state."""
        return Rows(self.mech, self.scene, self.held, q, self.v if v is None else v, self.t)

    def without(self, name: str) -> Rows:
        """Return the remaining constraints at this state."""
        constraints = self.mech.model.constraints
        held = tuple(i for i in self.held if constraints[i].name != name)
        return Rows(self.mech, self.scene, held, self.q, self.v, self.t)

    # -- the mechanism ---------------------------------------------------------------------------

    @property
    def nv(self) -> int:
        """Number of degrees of freedom of the tree."""
        return self.mech.nv

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints that are enforced."""
        return tuple(self.mech.model.constraints[i] for i in self.held)

    @property
    def joints(self) -> list[tuple[str, slice]]:
        """Names of the bodies with movable joints, with their degrees of freedom."""
        return [(name, joint.v) for name, joint in self.mech.joints.items()]

    @cached_property
    def poses(self) -> tuple[Array, Array]:
        """Body origins (nb, 3) and rotations (nb, 3, 3)."""
        return self.mech.poses(self.q)

    @cached_property
    def length(self) -> float:
        """Length scale for rotations [m], equal to the radius of gyration."""
        return radius_of_gyration(self.mech.packed.system)

    @cached_property
    def turns(self) -> NDArray[np.bool_]:
        """A mask (nv,) that is True for rotational degrees of freedom."""
        return turns(self.mech)

    @cached_property
    def size(self) -> float:
        """Extent of the mechanism [m], which sets the scale for rounding errors in positions."""
        tied = [c for c in self.constraints if isinstance(c, AtPoints)]
        points = [p for c in tied for p in (c.point, c.other_point) if p is not None]
        points += [p for c in self.constraints if isinstance(c, CurvePoint) for p in c.curve.line()]
        farthest = [np.abs(x).max() for x in [self.poses[0], *map(np.array, points)] if x.size]
        return float(max(farthest, default=0.0)) or 1.0

    def advanced(self, step: Array) -> Array:
        """Return q after a finite displacement along velocities, rotating ball and free joints."""
        q = self.q.copy()
        motion.move(self.mech.packed.rows, q, np.ascontiguousarray(step), 1.0)
        return q

    # -- rows ------------------------------------------------------------------------------------

    @property
    def J(self) -> Array:
        """Jacobian (m, nv) of all rows."""
        return self._evaluated.J

    @property
    def gap(self) -> Array:
        """Position residuals (m,) [m], 0 for velocity-only rows."""
        return self._evaluated.gap

    @cached_property
    def slip(self) -> Array:
        """Velocity residuals (m,) [m/s]."""
        return self.J @ self.v - self._evaluated.asked

    @property
    def groups(self) -> tuple[Group, ...]:
        """All rows grouped by constraint and type, in model order."""
        return self._evaluated.groups

    @cached_property
    def holonomic(self) -> Ints:
        """Indices of the rows that constrain positions."""
        spans = [range(g.rows.start, g.rows.stop) for g in self.groups if g.holonomic]
        return np.array([r for span in spans for r in span], dtype=np.int64)

    @cached_property
    def _evaluated(self) -> _Evaluated:
        scene, table = self.scene, self.scene.blocks.blocks_i
        scene.activate(np.array(self.held, dtype=np.int64))
        spans = scene.spans
        m = sum(int(table[i, at.B_SIZE]) for _, a, b in spans for i in range(a, b))
        gap, speed, J = np.zeros(m), np.zeros(m), np.zeros((m, self.nv))
        if m == 0:
            return _Evaluated(J, gap, speed, ())
        motion.residuals(scene.address, self.t, self.q, np.zeros(self.nv), gap, speed)
        groups: list[Group] = []
        row = 0
        for c, (_, first, end) in zip(self.constraints, spans):
            for i in range(first, end):
                size = int(table[i, at.B_SIZE])
                J[row : row + size] = self._jacobian(i)
                groups += _groups(c, int(table[i, at.B_TYPE]), row, self._directions(i))
                row += size
        return _Evaluated(J, gap, -speed, tuple(_joined(groups)))

    def _directions(self, i: int) -> Array:
        """Return the force or torque directions (rows, 3) for block i in world axes."""
        size = int(self.scene.blocks.blocks_i[i, at.B_SIZE])
        where = self.scene.space.place[i, at.PLACE_D : at.PLACE_D + 3 * size]
        return where.reshape(size, 3).copy()

    def _jacobian(self, i: int) -> Array:
        """Compute the Jacobian (rows, nv) of block i after the kernel has located it."""
        blocks = self.scene.blocks
        table = blocks.blocks_i[i]
        if table[at.B_TYPE] in COORDINATES:
            jac = np.zeros((1, self.nv))
            first = table[at.B_TERM]
            factors = blocks.terms_f[first : first + table[at.B_TERMS]]
            if table[at.B_TYPE] == at.T_RELATION:
                factors = 1.0, -self.scene.space.place[i, at.PLACE_SLOPE]
            for n, x in enumerate(factors, start=first):
                jac[0, blocks.terms_i[n, 0]] += x
            return jac
        if table[at.B_TYPE] == at.T_CABLE:
            return self._cable_jacobian(*table[[at.B_STATION, at.B_STATIONS]].tolist())
        place, part = self.scene.space.place[i], slice(0, 3) if _turns(table) else slice(3, 6)
        mine = self._point_jacobian(int(table[at.B_A]), place[at.PLACE_P : at.PLACE_P + 3])
        other = self._point_jacobian(int(table[at.B_B]), place[at.PLACE_Q : at.PLACE_Q + 3])
        return self._directions(i) @ (mine - other)[part]

    def _cable_jacobian(self, first: int, count: int) -> Array:
        """Compute the Jacobian (1, nv) of the length of a segment of a cable."""
        stations = self.scene.blocks.stations[first : first + count]
        spans, jac = np.zeros((count - 1, 9)), np.zeros((1, self.nv))
        spans_of_segment(stations, self.scene.work, self.q, spans)
        for a, b, (*ends, along) in zip(stations, stations[1:], spans.reshape(-1, 3, 3)):
            mine, other = map(self._point_jacobian, (int(b["row"]), int(a["row"])), ends[::-1])
            jac += along @ (mine - other)[3:]
        return jac

    def _point_jacobian(self, row: int, x: Array) -> Array:
        """Compute the Jacobian (6, nv) of the material point of a row now at x in the world."""
        jac, work = np.zeros((6, self.nv)), self.scene.work
        if row > 0:
            turn = work[row, at.R : at.R + 9].reshape(3, 3)
            place = turn.T @ (x - work[row, at.X : at.X + 3])
            tree, rest = self.mech.packed.tree, np.zeros(self.nv)
            # overwrites frames in `work` by the same numbers
            dynamics.jacobian(*tree, self.q, rest, row, place, work, jac)
        return jac

    # -- the mass metric -------------------------------------------------------------------------

    @cached_property
    def root(self) -> Array:
        """The lower triangular L (nv, nv) with M = L Lᵀ. Joints without inertia get a small one."""
        M = self.mech.mass_matrix(self.q)
        try:
            root = np.linalg.cholesky(M)
        except np.linalg.LinAlgError:
            largest = float(np.max(np.diag(M), initial=0.0)) or 1.0
            root = np.linalg.cholesky(M + SOLVED * largest * np.eye(len(M)))
        return np.array(root, dtype=np.float64)

    @cached_property
    def scaled(self) -> Array:
        """The scaled rows J L⁻ᵀ (m, nv), with lengths and angles measured in the mass metric."""
        return self._solved(self.root, self.J.T).T

    @cached_property
    def parts(self) -> tuple[Array, Array, Array]:
        """U, s, Vᵀ of the scaled position rows, without singular values due to rounding."""
        rows = self.scaled[self.holonomic]
        left, sizes, right = np.linalg.svd(rows, full_matrices=False)
        kept = sizes > np.finfo(float).eps * max(rows.shape) * sizes.max(initial=0.0)
        return left[:, kept], sizes[kept], right[kept]

    def gradient(self, way: Array) -> Array:
        """Return L⁻¹ g for a gradient g (nv,), in the form of a scaled row."""
        return self._solved(self.root, way)

    def step(self, y: Array) -> Array:
        """Return L⁻ᵀ y for y (nv,) or (nv, n), converting back from the mass metric."""
        return self._solved(self.root.T, y)

    def _solved(self, triangle: Array, y: Array) -> Array:
        if self.nv < ALONE:
            x: Array = np.linalg.solve(triangle, y).astype(float, copy=False)
            return x
        from scipy.linalg import solve_triangular

        return solve_triangular(triangle, y, lower=triangle is self.root)


def _turns(table: Ints) -> bool:
    return bool(table[at.B_TYPE] == at.T_ALIGN)


def _groups(c: Constraint, kind: int, first: int, directions: Array) -> Iterator[Group]:
    """Group the rows of one block by type."""
    size = len(directions)
    if kind in COORDINATES:
        none = np.zeros((size, 3))
        yield Group(c, COORDINATE, slice(first, first + size), none, kind != at.T_VELOCITY)
        return
    norms = np.linalg.norm(directions, axis=1, keepdims=True)
    units = directions / np.where(norms > 0, norms, 1.0)
    if kind == at.T_ROUND:
        yield Group(c, LENGTH, slice(first, first + 1), units[:1], True)
        yield Group(c, SLIP, slice(first + 1, first + size), units[1:], False)
        return
    nature = ANGLE if kind == at.T_ALIGN else SLIP if kind == at.T_BLADE else LENGTH
    yield Group(c, nature, slice(first, first + size), units, kind != at.T_BLADE)


def _joined(groups: list[Group]) -> Iterator[Group]:
    """Merge neighbouring groups with the same constraint and type."""
    before: Group | None = None
    for g in groups:
        if before is not None and before.constraint is g.constraint and before.nature == g.nature:
            rows = slice(before.rows.start, g.rows.stop)
            directions = np.vstack((before.directions, g.directions))
            before = Group(g.constraint, g.nature, rows, directions, g.holonomic)
            continue
        if before is not None:
            yield before
        before = g
    if before is not None:
        yield before


def turns(mech: Dynamics) -> NDArray[np.bool_]:
    """Return a mask (nv,) that is True for rotational degrees of freedom."""
    return ~mech.packed.slides


def apart(mech: Dynamics, start: Array, q: Array) -> Array:
    """Compute the displacement (nv,) along velocities from one position to another."""
    step = np.zeros(mech.nv)
    of_q, of_v = plain(mech.packed.rows)
    step[of_v] = q[of_q] - start[of_q]
    for _, i, j in mech.packed.quaternions:
        w, x, y, z = unit(start[i : i + 4].tolist())
        w, *axis = unit(multiply(unit(q[i : i + 4].tolist()), (w, -x, -y, -z)))
        sine = float(np.linalg.norm(axis))
        angle = 2 * np.arctan2(sine, abs(w)) * (1 if w >= 0 else -1)
        step[j : j + 3] = np.array(axis) * (angle / sine if sine > 0 else 0.0)
    return step


def axis_name(direction: Array, rows: Rows | None = None, other: int = 0) -> str:
    """Return "x", "x of 'rod'" for an axis fixed in body number `other`, or a world direction."""
    frames = [(np.eye(3), "")]
    if rows is not None and other:
        frames.append((rows.poses[1][other - 1], f" of '{rows.mech.names[other - 1]}'"))
    for frame, of in frames:
        along = np.abs(frame.T @ direction)
        if along.max() > 1 - NOTABLE:
            return "xyz"[int(along.argmax())] + of
    first = direction[np.abs(direction) > NOTABLE]  # the largest may be two, equal to rounding
    x, y, z = -direction if len(first) and first[0] < 0 else direction
    return f"({x + 0.0:.3g}, {y + 0.0:.3g}, {z + 0.0:.3g})"
