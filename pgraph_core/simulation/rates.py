"""The fastest rate of a motion, used to select methods and step sizes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.motions import facts
from ..engine.records import JOINT_FORCE, table
from ..engine.stepping import stiffness
from ..integrators import Method
from ..mechanism import Mechanism
from ..packing import Array, Drives, Ints, Loads, row_of_velocity
from ..packing.forces import NO_LOADS
from ..packing.programs import hold
from ..tolerances import NOTABLE

RESOLVED = 0.25  # rate times step that a method of order 4 resolves
# part of the stability limit that is advised: rates are known to 10 %, at some states of a motion
MARGIN = 1 / math.sqrt(2)
STIFF = "stiff:"  # beginning of the notice of too large steps if the fastest mode is damped
FAST = "too wide:"  # and where it swings
FEW_FREEDOMS = 32  # for which all eigenvalues are computed at many states
MOST_FREEDOMS = 200  # for which a notice computes all eigenvalues of the motion
NO_FORCES = (Drives(table(JOINT_FORCE, 0), np.zeros((0, 3)), 0, np.zeros((0, 3))), NO_LOADS)


def advised_step(method: Method, rate: float, of_contacts: float = 0.0) -> float:
    """Return the step [s] to advise for a motion with this fastest rate and that of its contacts
    [1/s].

    It is infinite for methods that are stable at any step, without contacts.
    """
    limit = math.inf
    if method.limit > 0.0 and not method.stable:
        limit = MARGIN * (method.damped or method.limit)
    step = limit / rate if rate > 0.0 else math.inf
    return min(step, resolving_step(of_contacts))


def resolving_step(rate: float, order: int = 4) -> float:
    """Return the step [s] with which a method of order 4 or less resolves a rate [1/s] well.

    The errors of all methods, rate times step to the power of the order, are the same.
    """
    return RESOLVED ** (4 / order) / rate if rate > 0.0 else math.inf


class Rate:
    """The fastest rate of the motion at the start, computed on first use.

    Torques of a function are not included, because it may remember its calls.
    """

    def __init__(
        self,
        mech: Mechanism,
        forces: tuple[Drives, Loads],
        active: Ints,
        start: tuple[Array, Array],
        span: float,
    ):
        self.mech, self.forces, self.active, self.start = mech, forces, active, start
        self.span = span
        self.found: float | None = None

    def __call__(self) -> float:
        """Return the rate [1/s]."""
        if self.found is None:
            self.found = self._of(self.forces)
        return self.found

    def swings(self) -> bool:
        """Return True if the fastest mode swings rather than decays, or False if unknown."""
        return fastest_swings(self.mech, self.forces, self.active, *self.start)

    def exact(self) -> float:
        """Return the rate by all eigenvalues, if they are few [1/s]."""
        if self.mech.nv > FEW_FREEDOMS:
            return self()
        found = abs(fastest_mode(self.mech, self.forces, self.active, *self.start))
        return found if found >= 0.0 else self()

    def steady(self, step: float) -> float:
        """Return the largest step [s], up to `step`, of the semi-implicit Euler method."""
        slopes = _slopes(self.mech, self.forces, self.active, *self.start)
        return steady_step(slopes, self.span, step)

    def explicit(self) -> float:
        """The fastest explicit rate of time stepping [1/s]: dampers and friction are implicit."""
        drives, loads = self.forces
        table = drives.table.copy()
        implicit = (table["terms"] == 0) & (table["damping"] > 0.0) & self._has_armature(table)
        table["damping"][implicit] = table["stiffness"][implicit] = table["friction"] = 0.0
        return self._of((drives._replace(table=table), loads))

    def _has_armature(self, table: Any) -> Any:
        """Return for each drive whether its row may have an armature, as in time stepping."""
        rows = self.mech.packed.system.rows
        of_rows = facts("transmits")[rows[:, at.KIND]] | (rows[:, at.PARENT] == 0)
        own = [row_of_velocity(rows, j) for j in table["velocity"].tolist()]
        return of_rows[np.array(own, dtype=int)]

    def without_forces(self) -> float:
        """The rate of the same motion without springs, dampers and other forces [1/s]."""
        return self._of(NO_FORCES)

    def _of(self, forces: Any) -> float:
        return fastest_rate(self.mech, forces, self.active, *self.start)


def fastest_rate(
    mech: Mechanism, forces: tuple[Drives, Loads], active: Ints, q: Array, v: Array
) -> float:
    """Return the largest rate of the linearised motion [1/s], to about 10 %.

    Oscillations are included, contacts are not.
    """
    scene, size = _held(mech, forces, active, q, v), (len(q), len(v))
    stages = np.zeros((stiffness.POWER.total, sum(size)))
    stages[stiffness.POWER.state, : len(q)] = q
    stages[stiffness.POWER.state, len(q) :] = v
    rate = stiffness.fastest_rate(scene.address, scene.accelerate, size, stages, np.zeros(3))
    return float(rate) if np.isfinite(rate) else 0.0


def fastest_swings(
    mech: Mechanism, forces: tuple[Drives, Loads], active: Ints, q: Array, v: Array
) -> bool:
    """Check whether the imaginary part of the largest eigenvalue exceeds its real part.

    False for more than MOST_FREEDOMS.
    """
    largest = fastest_mode(mech, forces, active, q, v)
    return bool(abs(largest.imag) > abs(largest.real))


def fastest_mode(
    mech: Mechanism, forces: tuple[Drives, Loads], active: Ints, q: Array, v: Array
) -> complex:
    """Return the largest eigenvalue of the linearised motion [1/s].

    It is nan for more than MOST_FREEDOMS, or if it is not known.
    """
    by_q, by_v = _slopes(mech, forces, active, q, v)
    n = len(by_q)
    values = _eigenvalues(np.block([[np.zeros((n, n)), np.eye(n)], [by_q, by_v]]))
    return complex(values[np.argmax(np.abs(values))]) if len(values) else complex(np.nan)


def steady_step(slopes: tuple[Array, Array], span: float, step: float) -> float:
    """Return the largest step [s], up to `step`, of the semi-implicit Euler method over a span [s].

    The method uses the velocity at the start of a step in v'. A mode that swings by forces of
    velocities, such as a nutation of rate ω, therefore grows in steps h of any size, by (h ω)² / 2
    in each. Over the span, modes may grow by a factor of e more than in the motion.
    """
    by_q, by_v = slopes
    n = len(by_q)
    one, none = np.eye(n), np.zeros((n, n))
    growth = max(_eigenvalues(np.block([[none, one], [by_q, by_v]])).real, default=0.0)
    while np.isfinite(step) and step > NOTABLE * span:
        new_v = step * by_q, one + step * by_v
        taken = np.block([[one + step * new_v[0], step * new_v[1]], [*new_v]])
        largest = np.abs(_eigenvalues(taken)).max(initial=0.0)
        if np.log(max(largest, 1.0)) * span <= (1.0 + max(growth, 0.0) * span) * step:
            break
        step *= MARGIN
    return step


def _eigenvalues(slope: Array) -> Any:
    """Return the eigenvalues of a matrix, or none if it is not finite."""
    return np.linalg.eigvals(slope) if np.isfinite(slope).all() else np.zeros(0)


def _slopes(
    mech: Mechanism, forces: tuple[Drives, Loads], active: Ints, q: Array, v: Array
) -> tuple[Array, Array]:
    """Return the slopes (nv, nv) of v' by changes of the pose and by v, empty beyond
    MOST_FREEDOMS.
    """
    if mech.nv > MOST_FREEDOMS:
        return np.zeros((0, 0)), np.zeros((0, 0))
    scene, n = _held(mech, forces, active, q, v), len(v)
    tau, flow = np.zeros(n), np.zeros(3)

    def acceleration(at: Array, speed: Array) -> Array:
        vdot = np.zeros(n)
        motion.acceleration(scene.address, 0.0, at, speed, tau, vdot, flow)
        return vdot

    def moved(e: Array) -> Array:
        at = q.copy()
        motion.move(scene.packed.rows, at, e, NOTABLE)
        return at

    axes, h = np.eye(n), NOTABLE
    by_q = np.array([acceleration(moved(e), v) - acceleration(moved(-e), v) for e in axes]).T
    by_v = np.array([acceleration(q, v + h * e) - acceleration(q, v - h * e) for e in axes]).T
    return by_q / (2 * h), by_v / (2 * h)


def _held(mech: Mechanism, forces: tuple[Drives, Loads], active: Ints, q: Array, v: Array) -> Scene:
    """Return a scene whose comparisons keep their results: a jump has no slope."""
    scene = Scene(mech.packed, *forces, active)
    hold(scene.loads.signals[0], q, v)
    return scene
