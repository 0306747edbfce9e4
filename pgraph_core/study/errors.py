"""How far two motions differ, and the order of convergence that follows from such errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..dynamics.bodies import bodies_over, turned
from ..dynamics.states import angles, length_of
from ..engine import layout as at
from ..mechanism import Mechanism
from ..packing.system import Array

COARSE, FINE = 0.1, 1e-4  # errors above show no order; below FINE only where there are enough
FLOOR = 10.0  # times the smallest error: closer to it rounding dominates
ROUNDING = 1e-15
LEAST = 3  # points of a slope
SMALL = 1e-9  # larger errors are not rounding
MOST_STEPS = 2048


class Errors(NamedTuple):
    """Dimensionless error of one run: 1e-6 is six digits."""

    rms: float  # over all times and observables
    end: float  # largest at the last time
    largest: float  # over all times and observables

    @classmethod
    def of(cls, e: Array) -> Errors:
        """From the errors (n, m) of every observable at every time."""
        if not np.isfinite(e).all():
            return cls(np.inf, np.inf, np.inf)
        return cls(rms(e), float(np.max(e[-1], initial=0.0)), float(np.max(e, initial=0.0)))


def rms(e: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(e * e)))


# -- of bodies: for error against run time, where engines have other coordinates -------------------


class Observables(NamedTuple):
    """What is compared at n states."""

    points: Array  # (n, a, 3) tips of the bodies [m]
    rotations: Array  # (n, b, 4) of the bodies, unit quaternions [w, x, y, z]


def observer(mech: Mechanism) -> Callable[[Array], Observables]:
    """A function of states q (n, nq): the tip and the rotation of every body."""
    tips = np.array([mech.model.body(name).tip_point for name in mech.names]).reshape(-1, 3)

    def observe(q: Array) -> Observables:
        n = len(q)
        still, none = np.zeros((n, mech.nv)), np.zeros((n, mech.nb, 6))
        pose = bodies_over(mech.packed.system, q, still, still, none).pose
        return Observables(pose[..., :3] + turned(pose[..., 3:], tips), pose[..., 3:])

    return observe


def differences(found: Observables, reference: Observables, scale: float) -> Array:
    """(n, a + b) |y - y_ref| / max(|y_ref|, scale); rotations as angles [rad].

    Points count from where the reference starts, so that a mechanism far from the origin is not
    measured against its distance.
    """
    gap = np.linalg.norm(found.points - reference.points, axis=-1)
    moved = np.linalg.norm(reference.points - reference.points[:1], axis=-1)
    turned_by = angles(found.rotations, reference.rotations)
    return np.concatenate((gap / np.maximum(moved, scale), turned_by), axis=1)


def reach(mech: Mechanism) -> float:
    """The characteristic length: the longest path from a root to a tip, along the links [m]."""
    model, far = mech.model, {"ground": 0.0}
    longest = length_of(mech.packed)
    for name in mech.names:
        body = model.body(name)
        link = 0.0 if body.parent == "ground" else float(np.linalg.norm(body.link))
        far[name] = far[body.parent] + link
        longest = max(longest, far[name] + float(np.linalg.norm(body.tip_point)))
    return longest or 1.0


# -- of joints: for the stability map, which names the joint that fails ----------------------------


def joint_errors(mech: Mechanism, q: Array, other: Array) -> Array:
    """(n, elementary motions) difference of two motions q, other (n, nq); inf where not finite.

    Rotations [rad]; translations over the mechanism's length.
    """
    rows = mech.packed.system.rows[1:].tolist()
    found = np.zeros((len(q), len(rows)))
    size = length_of(mech.packed)
    for k, (_, kind, i, _) in enumerate(rows):
        a, b = q[:, i : i + 7], other[:, i : i + 7]
        if kind == at.ROTATE:
            found[:, k] = np.abs(a[:, 0] - b[:, 0])
        elif kind == at.TRANSLATE:
            found[:, k] = _distances(a[:, :1], b[:, :1], size)
        elif kind == at.BALL:
            found[:, k] = angles(a[:, :4], b[:, :4])
        else:
            moved, turned_by = _distances(a[:, :3], b[:, :3], size), angles(a[:, 3:], b[:, 3:])
            found[:, k] = np.maximum(moved, turned_by)
    return np.where(np.isfinite(found), found, np.inf)


def _distances(x: Array, y: Array, size: float) -> Array:
    """(n,) distance over the larger of the mechanism's length and the farthest y."""
    scale = max(size, float(np.abs(y).max(initial=0.0)))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.linalg.norm(x - y, axis=1) / (scale or 1.0)


# -- order of convergence --------------------------------------------------------------------------


def step_counts() -> list[int]:
    """Numbers of steps, each about a fifth more than the last, all multiples of four."""
    found = {4 * round(2.0 ** (1.0 + k / 4.0)) for k in range(40)}
    return sorted(n for n in found if n <= MOST_STEPS)


def levelled(errors: Sequence[float]) -> bool:
    """Whether shorter steps no longer help, because of rounding or an inner tolerance."""
    return len(errors) > 4 and min(errors) < SMALL and errors[-1] > 0.7 * min(errors[-5:-3])


def observed_order(points: Sequence[tuple[float, float]]) -> float | None:
    """-d log E / d log n over the middle third of the usable points (n steps, E).

    None if there are fewer than three.
    """
    errors = [e for _, e in sorted(points)]
    floor = max(ROUNDING, FLOOR * min(errors)) if levelled(errors) else ROUNDING
    usable = sorted((n, e) for n, e in points if n > 0 and floor < e < COARSE)
    fine = [(n, e) for n, e in usable if e < FINE]
    pairs = fine if len(fine) >= 2 * LEAST else usable
    if len(pairs) < LEAST:
        return None
    count = max(LEAST, round(len(pairs) / 3))
    first = (len(pairs) - count) // 2
    n, e = np.log(np.array(pairs[first : first + count])).T
    return float(-np.polyfit(n, e, 1)[0])
