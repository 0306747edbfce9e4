"""Redundant rows, singular positions and blocked motions in a run, found at negligible cost.

*Redundant rows* are named from the null directions that the solver of a run finds. *Singular
positions*: the kernels keep the places where pivots fell far below their largest
(`watch` in `engine/constraints`); from there the smallest eigenvalue of Ω that is not always 0 is
followed along the velocity. At a singular position it touches zero, as the square of the distance.
*Blocked motions* are those that constraints leave free to first order and block to second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import FACTORED, FACTORS
from ..packing import Array, Drives, Ints, Loads
from ..packing.constraints import Blocks
from ..tolerances import FAINT, NAMED, NEARBY, NOTABLE
from .rows import COORDINATES, Rows, axis_name

ROWS_LISTED = 4
TOO_LOW = "its error estimate may be too low"  # part of warnings about the estimate
PARABOLAS = 4  # parabolas through the eigenvalue
NULL = FAINT**2  # null eigenvalue of Ω relative to its mean diagonal: the square of FAINT
LIGHT = 10 * NULL  # ratio of masses whose rows differ from null rows, as n rows share a trace

# -- redundant rows ---------------------------------------------------------------------------


def redundancy(scene: Scene) -> str:
    """Return a message about redundant rows in the last factorisation, or "" if there are none.

    A null direction of Ω is a combination of rows without effect. The last row of a direction that
    is not the last row of another direction is reported as redundant, as in `mobility`.
    """
    count = int(scene.space.vectors[FACTORED, FACTORS.nulls])
    blocks = sum(end - first for _, first, end in scene.spans)
    if count == 0 or blocks != scene.active[0]:  # contacts take part, which change at any moment
        return ""
    rows = _rows(scene)
    chosen = named(scene, standing_for(scene.space.nulls[:count, : len(rows)]))
    more = f" and {len(chosen) - ROWS_LISTED} more" if len(chosen) > ROWS_LISTED else ""
    are = "row is" if len(rows) == 1 else "rows is" if len(chosen) == 1 else "rows are"
    return (
        f"{len(chosen)} of {len(rows)} constraint {are} redundant at the start: "
        f"{', '.join(chosen[:ROWS_LISTED])}{more}; the forces of least norm are returned"
    )


def named(scene: Scene, rows: list[int]) -> list[str]:
    """Return the directions of the active constraints' rows, as last located."""
    every = _rows(scene)
    return [_name(scene, every[r]) for r in rows]


def standing_for(nulls: Array, share: float = NOTABLE) -> list[int]:
    """Choose one column for each null direction, starting from the last. Returned in ascending
    order.

    Entries below `share` of the largest count as zero.
    """
    left, found = nulls.copy(), []
    for column in range(left.shape[1] - 1, -1, -1):
        if not len(left):
            break
        pivot = int(np.abs(left[:, column]).argmax())
        if abs(left[pivot, column]) > share:
            found.append(column)
            row = left[pivot] / left[pivot, column]
            left = left - left[:, column, None] * row
            left = left[np.arange(len(left)) != pivot]
    return found[::-1]


def _rows(scene: Scene) -> list[tuple[str, int, int]]:
    """Return (constraint, block, row within the block) for all rows in order."""
    sizes = scene.blocks.blocks_i[:, at.B_SIZE].tolist()
    return [
        (name, i, r)
        for name, first, end in scene.spans
        for i in range(first, end)
        for r in range(sizes[i])
    ]


def _name(scene: Scene, row: tuple[str, int, int]) -> str:
    constraint, i, r = row
    d = scene.space.place[i, at.PLACE_D + 3 * r : at.PLACE_D + 3 * r + 3]
    return f"{_direction(int(scene.blocks.blocks_i[i, at.B_TYPE]), d)} of constraint '{constraint}'"


def _direction(kind: int, d: Array) -> str:
    if kind in COORDINATES:
        return "coordinate"
    what = "rotation about" if kind == at.T_ALIGN else "translation along"
    return f"{what} {axis_name(d / (float(np.linalg.norm(d)) or 1.0))}"


# -- singular positions -----------------------------------------------------------------------


Instant = tuple[float, Array, Array]  # t, q, v


class Passed(NamedTuple):
    """A singular position encountered during a run."""

    t: float
    rows: tuple[str, ...]  # rows that are redundant only there
    q: Array


class _Look:
    """Ω for a scene's constraints at positions along a velocity."""

    def __init__(self, scene: Scene, t: float, q: Array, v: Array):
        self.scene, self.t, self.q, self.v = scene, t, q, v
        self.rows = int(scene.space.watch[0]["rows"])
        self.seen: dict[float, tuple[Array, Array]] = {}
        self.places: dict[float, Array] = {}

    def eigen(self, tau: float) -> tuple[Array, Array]:
        """Return (values over the mean diagonal, vectors) for Ω after a time tau, on the
        constraints.

        If the run diverged and Ω is not finite, no row is dependent.
        """
        if tau not in self.seen:
            self.seen[tau] = self._eigen(tau)
        return self.seen[tau]

    def _eigen(self, tau: float) -> tuple[Array, Array]:
        q, v = self.q.copy(), self.v.copy()
        motion.move(self.scene.packed.rows, q, v, tau)
        for _ in range(2):  # onto the constraints, and Ω there
            self.scene.space.vectors[FACTORED, FACTORS.known] = 0.0
            motion.projection(self.scene.held, self.t + tau, q, v, 1)
        self.places[tau] = q
        omega = self.scene.space.omega[: self.rows, : self.rows]
        size = float(omega.trace()) / max(self.rows, 1) or 1.0
        if not (np.isfinite(size) and np.isfinite(scaled := omega / size).all()):
            return np.ones(self.rows), np.eye(self.rows)
        return np.linalg.eigh(scaled)

    def only_there(self, tau: float, usual: Array) -> Passed | None:
        """Compute the position after a time tau if it has more dependent rows than the `usual`
        ones."""
        values, vectors = self.eigen(tau)
        count = int((values < NULL).sum())
        if count <= usual.shape[1]:
            return None
        always = standing_for(usual.T)
        rows = [r for r in standing_for(vectors[:, :count].T, 10 * FAINT) if r not in always]
        return Passed(self.t + tau, tuple(named(self.scene, rows)), self.places[tau])

    def lowest(self, width: float, nulls: int) -> float:
        """Compute the time within `width` at which eigenvalue `nulls` is smallest, by parabolas."""
        seen = [(x, float(self.eigen(x)[0][nulls])) for x in (-width, 0.0, width)]
        for _ in range(PARABOLAS):
            (a, at_a), (b, at_b), (c, at_c) = sorted(seen)
            rise = (at_b - at_a) / (b - a)
            bend = ((at_c - at_b) / (c - b) - rise) / (c - a)
            if not bend > 0:
                break
            x = float(np.clip(0.5 * (a + b - rise / bend), -width, width))
            if min(abs(x - other) for other, _ in seen) <= NOTABLE * width:
                break
            seen.remove(max(seen, key=lambda pair: pair[1]))
            seen.append((x, float(self.eigen(x)[0][nulls])))
        return min(seen, key=lambda pair: pair[1])[0]


def passed(scene: Scene, dips: Any, states: Array) -> list[Passed]:
    """Compute the distinct singular positions among the first dips of the active constraints."""
    found: list[Passed] = []
    nq, nv = scene.packed.nq, scene.packed.nv
    for dip, state in zip(dips, states):
        if dip["depth"] > 0:
            q, v = np.split(state[: nq + nv].copy(), [nq])
            look, apart = _Look(scene, float(dip["time"]), q, v), float(dip["apart"])
            place = _touched(look, 2 * apart)
            if place and not any(abs(place.t - other.t) <= apart for other in found):
                found.append(place)
    return found


def _touched(look: _Look, width: float) -> Passed | None:
    """Compute the singular position within `width` of a dip's minimum, or None."""
    fastest = float(np.max(np.abs(look.v), initial=0.0))
    if fastest == 0.0 or look.rows == 0:
        return None
    around = [look.eigen(sign * max(width, NEARBY / fastest)) for sign in (-1.0, 1.0)]
    values, usual = min(around, key=lambda eigen: int((eigen[0] < NULL).sum()))
    nulls = int((values < NULL).sum())
    if nulls == len(values):
        return None
    tau = look.lowest(width, nulls)
    return look.only_there(tau, usual[:, :nulls])


def _began(scene: Scene, start: Instant, end: Instant) -> Passed | None:
    """Return the initial position if it has dependent rows that are independent at the end of the
    run."""
    values, usual = _Look(scene, *end).eigen(0.0)
    return _Look(scene, *start).only_there(0.0, usual[:, values < NULL])


class Stretch(NamedTuple):
    """A stretch of a run with the same active constraints, and the positions at which pivots were
    small.

    The arrays are not shared, so that the run can be checked when its notices are read.
    """

    forces: tuple[Drives, Loads]
    active: Ints  # indices of the constraints
    blocks: Blocks
    start: Instant
    end: Instant
    redundant: bool  # whether rows are redundant at the start
    dipped: tuple[int, Any, Array]  # number of dips, the first ones and their states

    @classmethod
    def of(
        cls, scene: Scene, active: Ints, start: Instant, end: Instant, redundant: bool
    ) -> Stretch | None:
        """Return the stretch that ends now, or None if it cannot contain a singular position."""
        space, own = scene.space, scene.packed.blocks
        count = int(space.watch[0]["count"])
        if not count and not redundant:
            return None
        blocks = own._replace(blocks_f=scene.blocks.blocks_f[: len(own.blocks_f)].copy())
        t, q, v = end
        dipped = count, space.dips.copy(), space.dip_states.copy()
        forces = scene.drives, scene.loads
        return cls(forces, active, blocks, start, (t, q.copy(), v.copy()), redundant, dipped)

    def notice(self, mech: Dynamics) -> str:
        """Return a warning about singular positions that were passed, or "".

        The dependence of rows is determined by their directions and does not depend on masses.
        """
        scene = Scene(mech.packed, *self.forces, self.active, blocks=self.blocks)
        dips, *kept = self.dipped
        found = passed(scene, *kept) if dips else []
        places = [p for p in found if nulls_of(mech, self.active, p.t, p.q)]
        if not places:
            began = _began(scene, self.start, self.end) if self.redundant else None
            where = "the run began at a singular position"
        else:
            began = places[0]
            most = "at least " if dips > len(kept[0]) else ""
            many = f", the first of {most}{len(places)}," if len(places) > 1 else ""
            where = (
                f"at t = {began.t:.4g} s the run passed a singular position{many} or close by one"
            )
        if began is None:
            return ""
        more = " ..." if len(began.rows) > ROWS_LISTED else ""
        listed = ", ".join(began.rows[:ROWS_LISTED]) + more
        return (
            f"{where}: {listed} {'is' if len(began.rows) < 2 else 'are'} dependent there, so "
            "more than one motion is possible; it followed its velocity or rounding errors, and "
            f"{TOO_LOW}"
        )


# -- masses that hide rows -------------------------------------------------------------------------


def nulls_of(mech: Dynamics, active: Ints, t: float, q: Array) -> int:
    """Count the rows of J that are redundant at or near q, for any masses.

    The rows are scaled to unit length, with one radian equivalent to the extent of the mechanism.
    They are redundant if a singular value is below ten times FAINT, relative to the largest.
    """
    state = Rows.of(mech, active, q, None, t)
    rows = np.where(state.turns, state.J / state.size, state.J)
    sizes = np.linalg.norm(rows, axis=1)
    if not len(rows) or not sizes.all():
        return len(rows)
    found = np.linalg.svd(rows / sizes[:, None], compute_uv=False)
    return len(rows) - int((found > 10 * FAINT * found[0]).sum())


def unequal(mech: Dynamics, active: Ints) -> str:
    """Return a message about the most unequal masses joined by active constraints, or "".

    Ω = J M⁻¹ Jᵀ then has eigenvalues whose ratio is that of the masses. A singular value below the
    square of FAINT is treated as zero.
    """
    mass = {body.name: body.mass for body in mech.model.bodies}
    held = [mech.model.constraints[i] for i in active.tolist()]
    tied = sorted({n for c in held for n in (c.body, getattr(c, "other", "")) if mass.get(n)})
    if len(tied) < 2:
        return ""
    light, heavy = min(tied, key=mass.__getitem__), max(tied, key=mass.__getitem__)
    if mass[light] >= (1 - NOTABLE) * LIGHT * mass[heavy]:
        return ""
    return (
        f"'{light}' has {mass[light]:.3g} kg and '{heavy}' {mass[heavy]:.3g} kg: constraints "
        f"resolve mass ratios up to {1 / LIGHT:.3g}; give '{light}' at least "
        f"{LIGHT * mass[heavy]:.3g} kg, or join the bodies as parent and child, where no ratio is "
        "too large"
    )


# -- motions blocked to second order ----------------------------------------------------------


def blocked(mech: Dynamics, active: Ints, t: float, q: Array, v: Array) -> str:
    """Return a message about a motion whose gap grows while the rows of J vanish, or "".

    The gap of such a motion grows as its square, against a force of infinite size, and projection
    by J cannot close it.
    """
    state = Rows.of(mech, active, q, v, t)
    rows, gap = state.scaled[state.holonomic], state.gap[state.holonomic]
    whole = float(np.linalg.norm(gap))
    if not 0.0 < whole < np.inf:
        return ""
    u, s, _ = np.linalg.svd(rows)
    sizes = np.concatenate((s, np.zeros(len(u) - len(s))))
    faint = u[:, sizes <= FAINT * sizes[0]]
    combination = faint @ (faint.T @ gap)
    if np.linalg.norm(combination) < np.linalg.norm(gap - combination):
        return ""
    motion = state.step(rows.T @ combination)
    joint, _ = max(state.joints, key=lambda j: float(np.linalg.norm(motion[j[1]])))
    full = np.zeros(len(state.gap))
    full[state.holonomic] = combination
    names = " and ".join(f"'{name}'" for name in _parts(state, full))
    return (
        f"constraints {names} leave '{joint}' free to move to first order and block it to second, "
        f"so no finite force can close them: the gap is {np.abs(gap).max():.2g} m where their rows "
        "are dependent. Use a kind with fewer rows for one of them (line, plane, distance), or add "
        "the missing freedom to a joint; with stabilise=None the run continues, and "
        "constraint_drift contains the gap"
    )


# -- constraints against contacts and limits ----------------------------------------------------


def holding(
    mech: Dynamics, active: Ints, t: float, q: Array, way: Array, closed: Sequence[Array] = ()
) -> list[str]:
    """Return the names of the constraints that determine a gap's rate, or [] if it is free.

    `way` (nv,) is the gradient of the gap. `closed` contains the gradients of the gaps that are
    closed at that time.
    """
    if len(active) == 0 or not np.any(way):
        return []
    state = Rows.of(mech, active, q, None, t)
    wanted = state.gradient(way)
    rows = np.vstack((state.scaled, *(state.gradient(other) for other in closed)))
    combination = np.asarray(np.linalg.lstsq(rows.T, wanted)[0], dtype=np.float64)
    left = rows.T @ combination - wanted
    own = combination[: len(state.scaled)]
    if max(np.linalg.norm(left), FAINT - np.abs(own).max()) > FAINT * np.linalg.norm(wanted):
        return []
    return _parts(state, own)


def approach(mech: Dynamics, q: Array, body: str, point: Array, normal: Array) -> Array:
    """Compute the gradient (nv,) of the position along `normal` of a body's point (world axes)."""
    J = mech.jacobian(q, body)
    arm = point - mech.pose(q, body)[0]
    return np.asarray(J[3:].T @ normal + J[:3].T @ np.cross(arm, normal), dtype=float)


def _parts(state: Rows, combination: Array) -> list[str]:
    """Return the constraints that contribute significantly to a combination of rows."""
    share = {g.constraint.name: 0.0 for g in state.groups}
    for g in state.groups:
        most = float(np.abs(combination[g.rows]).max(initial=0.0))
        share[g.constraint.name] = max(share[g.constraint.name], most)
    largest = max(share.values())
    return [name for name, x in share.items() if x > NAMED * largest]
