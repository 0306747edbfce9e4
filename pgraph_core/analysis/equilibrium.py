"""Mechanism equilibria: minima of the potential energy, if one exists.

Newton's method is restricted to the motions that constraints and limits permit. If every force has
an energy, negative eigenvalues of the Hessian are reversed and a line search only decreases the
energy (Nocedal and Wright, Numerical Optimization, 2nd ed., section 3.4), so the search leaves
saddles.
Other forces are balanced by pseudo-transient continuation (Kelley and Keyes 1998), which follows
the flow of the forces, or by damped least squares if that flow is periodic.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..dynamics import Dynamics
from ..dynamics.scene import NO_CONSTRAINTS, Scene
from ..engine import motion
from ..errors import InputError, Problem, choices, shown
from ..forces import BetweenPoints
from ..model import Wrench
from ..packing import Array, Drives
from ..tolerances import (
    DIFFERENCED,
    EPS,
    LONGEST_STEP,
    NOTABLE,
    ROUNDING,
    SOLVED,
    SUFFICIENT_DECREASE,
)
from .assembly import Configuration, assemble
from .balance import Balance, Touching, state_of, touching
from .inverse import bounds, single
from .rows import apart
from .stops import Stops

BALANCE_ROUNDS = 300
ROUNDS_OF_STOPS = 8  # searches for each bound of a force, enough to hold and release it three times
STEP_HALVINGS = 40


def equilibrium(mech: Dynamics, q: Array | None, scenario: str | None) -> Configuration:
    """Compute the equilibrium q (nq,) near q. See `Mechanism.equilibrium`.

    A bound of a force that the search reaches holds as a constraint, until it would have to pull
    (the active sets of Nocedal and Wright, section 16.5).
    """
    q, _ = state_of(mech, q, None, scenario)
    stops = Stops(mech)
    start = here = _assembled(stops, q, scenario, held := stops.passed(q))
    search = _Search(here, *bounds(mech), stops, held)
    for _ in range(ROUNDS_OF_STOPS * (1 + len(stops.all))):
        found = search.found()
        added = stops.passed(found.q) - held if found else search.reached
        pulling = _pulling(stops, found, search.held, held) if found and not added else held - held
        if not added and not pulling:
            if found is None:
                break
            _refuse_overlaps(stops.mech, start, found, scenario)
            return found.q.view(Configuration)
        held = (held | added) - pulling
        here = _assembled(stops, search.here.q, scenario, held)
        search = _Search(here, *bounds(mech), stops, held)
    raise _unbalanced(search.best)


def _refuse_overlaps(mech: Dynamics, start: Place, found: Place, scenario: str | None) -> None:
    """Refuse an equilibrium that lies deeper in a contact than the start."""
    if not (contacts := touching(mech, scenario)):
        return
    at_start, at_end = (
        Touching(mech, contacts, (x.drives, x.loads), (x.q, x.v), x.s).overlaps
        for x in (start, found)
    )
    for name, depth in at_end.items():
        if depth > at_start.get(name, 0.0) + NOTABLE * start.size:
            text = f"the forces are balanced only {depth:.3g} m inside contact {shown(name)}, and "
            text += "contacts do not act here; a state of rest on them is the end of a run, "
            raise InputError(Problem("equilibrium", "q", f"{text}run.q[-1]"))


def _assembled(stops: Stops, q: Array, scenario: str | None, held: frozenset[int]) -> Place:
    """Return the position nearest to q (nq,) at which these bounds hold."""
    mech, also = stops.mech, stops.indices(held)
    here = Place(mech, q, np.zeros(mech.nv), scenario, also)
    if held:
        names = [mech.model.constraints[i].name for i in here.active]
        try:
            here = here.at(assemble(mech, q, here.v, names)[0], here.v)
        except InputError:
            labels = choices([stops.all[n].label for n in sorted(held)])
            text = f"{labels}: cannot be met {'together ' if len(held) > 1 else ''}near q; start "
            text += "from another q, or widen a limit"
            raise InputError(Problem("equilibrium", "q", text)) from None
    return here


def _pulling(
    stops: Stops, here: Place, limited: NDArray[np.bool_], held: frozenset[int]
) -> frozenset[int]:
    """Return the bounds that would have to pull at a row, beside the joint limits that hold."""
    rows = here.rows
    both = np.vstack((rows.J, np.eye(here.mech.nv)[limited]))
    forces = np.linalg.lstsq(both.T, here.pull, rcond=ROUNDING)[0]
    noise = NOTABLE * float(np.abs(forces).max(initial=0.0))
    found = set()
    for n in held:
        constraint = here.mech.model.constraints[stops.first + n]
        own = [g.rows for g in rows.groups if g.constraint is constraint]
        if any((stops.all[n].sign * forces[span] > noise).any() for span in own):
            found.add(n)
    return frozenset(found)


def _unbalanced(here: Place) -> InputError:
    """Return the error that no equilibrium was found, where this position has the least forces."""
    mech = here.mech
    push = here.M @ here.free @ (here.free.T @ here.pull)
    joint = max(mech.joints, key=lambda name: float(np.abs(push[mech.joints[name].v]).max()))
    left = f"{np.abs(push).max():.3g} (N m or N) remain, most of it in the joint of '{joint}'"
    text = f"no equilibrium was found near q: {left}; add a spring, or start from another q"
    if mech.model.contacts:
        text += ". Contacts do not act here; a state of rest on them is the end of a run, run.q[-1]"
    return InputError(Problem("equilibrium", "q", text))


class Place(Balance):
    """The forces on a mechanism at rest, and their derivatives along the free motions."""

    @cached_property
    def vdot(self) -> Array:
        return np.zeros(self.mech.nv)

    @cached_property
    def multipliers(self) -> Array:
        """Return λ (m,) that minimises the residual forces in the mass metric."""
        rows: Any = self.rows
        return np.linalg.lstsq(rows.scaled.T, rows.gradient(self.pull), rcond=ROUNDING)[0]

    @cached_property
    def motors(self) -> Drives:
        """The drives, excluding the joints' own springs and dampers."""
        return self.drives._replace(table=self.drives.table[self.drives.passive :], passive=0)

    @cached_property
    def motor_torque(self) -> Array:
        """Return the torque τ (nv,) from motors and servos."""
        tau: Array = np.zeros(self.mech.nv)
        if len(self.motors.table):
            scene = Scene(self.mech.packed, self.motors, self.loads, NO_CONSTRAINTS)
            found = np.zeros(self.mech.nv + len(self.s))
            motion.drive_torque(scene.address, *self.whole(self.q, self.v), found)
            tau = found[: self.mech.nv]
        return tau

    @property
    def has_energy(self) -> bool:
        """Return True if every force has an energy. Body torques, follower forces and what pulls
        along a path by an input have none."""
        wrenches = [f for f in self.forces if isinstance(f, Wrench)]
        balls = np.zeros(self.mech.nv, dtype=bool)
        for _, _, j in self.mech.packed.quaternions:
            balls[j : j + 3] = True
        pulls = any(isinstance(f, BetweenPoints) and not f.PASSIVE for f in self.forces)
        if pulls or len(self.loads.signals[1]):
            return False
        return not np.any(self.motor_torque[balls]) and not any(
            np.any(_first(f.torque)) or (f.frame == "body" and np.any(_first(f.force)))
            for f in wrenches
        )

    @cached_property
    def energy(self) -> float:
        """Potential energy of everything except motors and servos [J]."""
        found = motion.energy(self.scene.address, *self.whole(self.q, self.v))[1]
        for f in self.forces:
            if isinstance(f, Wrench):
                place, turn = self.mech.pose(self.q, f.body)
                found -= _first(f.force) @ (place + turn @ np.array(f.point or (0.0, 0.0, 0.0)))
        return float(found)

    def rise(self, new: Place) -> float:
        """Compute the energy required to move to another position [J].

        Motors and servos are linear in their own coordinate: the trapezoid of their work is exact.
        """
        step = apart(self.mech, self.q, new.q)
        work = (self.motor_torque + new.motor_torque) @ step / 2
        return new.energy - self.energy - float(work)

    def at(self, q: Array, v: Array) -> Place:
        """Evaluate the same forces at another position, keeping the initial length scale."""
        other = super().at(q, v)
        vars(other)["size"] = self.size
        return other

    @property
    def reach(self) -> Array:
        """The step scale of each coordinate (nv,): 1 rad of rotations, or the mechanism's size."""
        return np.where(self.rows.turns, 1.0, self.size)

    @cached_property
    def force(self) -> float:
        """Norm of the model's forces in the mass metric, or 1 if there are none."""
        acting = self.weights + np.abs(self.torque(self.q, self.v))
        return float(np.linalg.norm(self.rows.gradient(acting))) or 1.0

    @cached_property
    def energy_noise(self) -> float:
        """Rounding error in the energy [J], assuming about six products per coordinate."""
        return 6 * self.mech.nv * EPS * (float(self.weights @ self.reach) + abs(self.energy))


def _first(value: object) -> Array:
    """Return a vector as a (3,) array, or the first entry if it is a time table."""
    return np.array(getattr(value, "value", [value])[0], dtype=float)


class _Ways(NamedTuple):
    """The free motions at a position, with the forces and stiffness along them."""

    free: Array  # (nv, n) orthonormal in the mass metric
    slope: Array  # (n,)
    values: Array  # (n,) eigenvalues of the symmetric stiffness, ascending
    vectors: Array  # (n, n)

    @property
    def left(self) -> float:
        return float(np.linalg.norm(self.slope))

    @property
    def curved_down(self) -> bool:
        """Return True if the energy decreases in both directions along some eigenvector."""
        return bool(len(self.values) and self.values[0] < -DIFFERENCED * np.abs(self.values).max())

    @property
    def newton(self) -> Array:
        """The Newton step (nv,), reversed along directions of increasing energy."""
        largest = float(np.abs(self.values).max(initial=0.0))
        stiff = np.maximum(np.abs(self.values), max(DIFFERENCED * largest, 1e-300))
        return -self.free @ (self.vectors @ ((self.vectors.T @ self.slope) / stiff))


class _Search:
    """A search from one position, subject to the joint limits.

    It ends where it reaches a bound of a force that does not hold yet.
    """

    def __init__(
        self, start: Place, low: Array, high: Array, stops: Stops, holding: frozenset[int]
    ):
        self.low, self.high, self.stops, self.holding = low, high, stops, holding
        self.reached: frozenset[int] = frozenset()  # the bound at which it has ended
        self.names = [start.mech.model.constraints[i].name for i in start.active]
        self._begin(start)

    def _begin(self, start: Place) -> None:
        """Begin at a position, or at the nearest one within the joint limits."""
        low, high = self.low, self.high
        self.here = self.best = start
        self.stop = -1  # the bound that shortened the last step
        self.size = start.force
        at_q = single(start.rows)
        self.held = (at_q <= low) | (at_q >= high)  # joints that rest on a limit
        self.stopper = -1  # the joint whose limit shortened the last step
        if np.any((at_q < low) | (at_q > high)):
            self.here = self.moved(start, np.clip(at_q, low, high) - at_q)
            self.held &= self.limited(self.here)

    def found(self) -> Place | None:
        """Return a position at which the forces are balanced, or None."""
        here = self.here
        if len(here.s):
            return self.balanced()
        if here.has_energy:
            return self.downhill()
        if (found := self.along_the_forces()) or self.reached:
            return found
        self._begin(here)
        return self.balanced()

    def limited(self, here: Place) -> NDArray[np.bool_]:
        """Return a mask (nv,) of the joints at a limit, to within the solution's tolerance."""
        at_q, near = single(here.rows), SOLVED * here.reach
        return (at_q <= self.low + near) | (at_q >= self.high - near)

    def slope(self, here: Place, free: Array) -> Array:
        return free.T @ here.pull

    def ways(self) -> _Ways:
        here, free = self.here, self.free(self.here)
        slope = self.slope(here, free)
        K = free.T @ here.stiffness @ free
        return _Ways(free, slope, *np.linalg.eigh((K + K.T) / 2))

    def free(self, here: Place) -> Array:
        """Return an (nv, n) basis for the motions permitted by constraints and limits."""
        free = here.free
        if not self.held.any():
            return free
        _, sizes, right = np.linalg.svd(free[self.held])
        return free @ right[int(np.sum(sizes > ROUNDING * sizes.max(initial=0.0))) :].T

    def released(self) -> bool:
        """Release the joint pushed hardest away from its limit. Return False if there is none."""
        if not self.held.any():
            return False
        here, held = self.here, np.flatnonzero(self.held)
        push = -self.slope(here, here.free)
        along = np.linalg.lstsq(here.free[held].T, push, rcond=ROUNDING)[0]
        at_q = single(here.rows)[held]
        upper = self.high[held] - at_q < at_q - self.low[held]  # the nearer limit stopped it
        inwards = np.where(upper, -along, along)
        most = int(inwards.argmax())
        scale = self.size * float(np.linalg.norm(here.free[held[most]])) or 1.0
        if inwards[most] * np.linalg.norm(here.free[held[most]]) ** 2 <= ROUNDING * scale:
            return False
        self.held[held[most]] = False
        return True

    def moved(self, here: Place, step: Array) -> Place:
        """Compute the position after a step, with the loops closed."""
        new = here.at(here.rows.advanced(step), here.v)
        for _ in range(STEP_HALVINGS if self.names else 0):
            q, _, _ = assemble(here.mech, new.q, np.zeros(here.mech.nv), self.names)
            new = here.at(q, here.v)
            at_q = single(new.rows)
            off = np.clip(at_q, self.low, self.high) - at_q
            if not (beyond := np.abs(off) > SOLVED * here.reach).any():
                break
            kept = beyond | self.held  # closing the loops takes joints off and beyond their limits
            ways = new.free @ np.linalg.lstsq(new.free[kept], off[kept], rcond=ROUNDING)[0]
            new = here.at(new.rows.advanced(ways), here.v)
        return new

    def share(self, step: Array) -> float:
        """Compute the fraction of a step that is short enough and respects the limits."""
        longest = float(np.max(np.abs(step) / self.here.reach, initial=0.0))
        most = 1.0 / max(longest / LONGEST_STEP, 1.0)
        at_q = single(self.here.rows)
        room = np.where(step > 0, self.high - at_q, at_q - self.low)
        stopped = np.flatnonzero((np.abs(step) * most > room) & ~self.held)
        self.stopper = -1
        if len(stopped):
            self.stopper = int(stopped[np.argmin(room[stopped] / np.abs(step[stopped]))])
            most = max(float(room[self.stopper] / abs(step[self.stopper])), 0.0)
        self.stop = -1
        for n, (left, slopes) in enumerate(self.stops.rows(self.here.q)):
            closing = -slopes @ step
            if n not in self.holding and np.any(hit := (closing > 0.0) & (closing * most > left)):
                most = max(float(np.min(left[hit] / closing[hit])), 0.0)
                self.stop, self.stopper = n, -1
        return most if most * longest > ROUNDING else 0.0

    def taken(self, new: Place) -> Place:
        """Accept the position after a step, and hold the joint stopped by its limit.

        Closing the loops may have taken it and others off their limits.
        """
        limited = self.limited(new)
        self.held &= limited
        if self.stopper >= 0 and limited[self.stopper]:
            self.held[self.stopper] = True
        passed = self.stops.passed(new.q) - self.holding
        self.reached = frozenset([self.stop]) if self.stop >= 0 else passed
        return new

    # -- with an energy --------------------------------------------------------------------------

    def downhill(self) -> Place | None:
        """Return an energy minimum, the start if it is already an equilibrium, or None."""
        least = np.inf
        for taken in range(BALANCE_ROUNDS):
            if self.reached:
                return None
            here, ways = self.here, self.ways()
            self.size = max(self.size, here.force)
            left = ways.left / self.size
            if left <= NOTABLE and self.released():
                least = np.inf
                continue
            if taken == 0 and left <= ROUNDING:
                return here
            if left <= NOTABLE and ways.curved_down and (new := self.off_the_saddle(ways)):
                self.here, least = new, np.inf
                continue
            if left <= SOLVED and left >= least / 2:
                return self.best
            if left < least:
                self.best, least = here, left
            if left == 0.0:
                return here
            new = self.lower(ways)
            if new is None:
                break
            self.here = new
        return self.best if least <= SOLVED else None

    def off_the_saddle(self, ways: _Ways) -> Place | None:
        """Return a position of lower energy along the direction of the most negative curvature."""
        way = ways.vectors[:, 0]
        way = way if way @ ways.slope <= 0 else -way
        for side in (ways.free @ way, -(ways.free @ way)):
            step = side * LONGEST_STEP / float(np.max(np.abs(side) / self.here.reach))
            step = self.share(step) * step
            for _ in range(8):
                new = self.moved(self.here, step)
                if self.here.rise(new) < -10 * self.here.energy_noise:
                    return self.taken(new)
                step, self.stopper, self.stop = step / 2, -1, -1
        return None

    def lower(self, ways: _Ways) -> Place | None:
        """Backtrack along the Newton step until the energy decreases sufficiently.

        If the change is below rounding, accept a full step that reduces the residual forces.
        """
        step = ways.newton
        share = self.share(step)
        if share == 0.0:
            return self.taken(self.here)
        promised = float(self.here.pull @ step)
        if abs(promised) <= 100 * self.here.energy_noise:
            new = self.moved(self.here, share * step)
            left = float(np.linalg.norm(self.slope(new, self.free(new))))
            return self.taken(new) if left < ways.left else None
        for _ in range(STEP_HALVINGS):
            new = self.moved(self.here, share * step)
            if self.here.rise(new) <= SUFFICIENT_DECREASE * share * promised:
                return self.taken(new)
            share, self.stopper, self.stop = share / 2, -1, -1
        return None

    # -- with states of controls, or without an energy -------------------------------------------

    def balanced(self) -> Place | None:
        """Find q and states of controls together by Newton's method, or None. It may be unstable.

        Steps are halved until the residual decreases, with each equation scaled by its largest
        slope. Forces that no step changes may be left, so that a small step alone is no solution.
        """
        for _ in range(BALANCE_ROUNDS):
            if self.reached:
                return None
            here, free = self.here, self.free(self.here)
            by_q, by_v, by_s = here.rate_slopes
            slope = np.block(
                [[free.T @ here.stiffness @ free, -free.T @ here.state_slopes], [by_q @ free, by_s]]
            )
            scale = np.abs(slope).max(axis=1, initial=0.0)
            scale[scale == 0.0] = 1.0
            left = self.left_of(here, free) / scale
            step: Any = -np.linalg.lstsq(slope / scale[:, None], left, rcond=ROUNDING)[0]
            moves, change = free @ step[: free.shape[1]], step[free.shape[1] :]
            longest = float(np.max(np.abs(moves) / here.reach, initial=0.0))
            state = max(float(np.abs(here.s).max(initial=0.0)), 1.0)
            far = max(longest, float(np.abs(change).max(initial=0.0)) / state)
            share = self.share(moves) if longest > ROUNDING else 1.0
            for _ in range(STEP_HALVINGS):
                new = self.moved(here, share * moves).with_states(here.s + share * change)
                other = self.left_of(new, self.free(new)) / scale
                if len(other) == len(left) and np.linalg.norm(other) < np.linalg.norm(left):
                    self.here = self.best = self.taken(new)
                    break
                share *= 0.5
            else:
                return here if far <= NOTABLE and np.linalg.norm(left) <= NOTABLE else None
            if far <= SOLVED:
                return new if np.linalg.norm(other) <= NOTABLE else None
        return None

    def left_of(self, here: Place, free: Array) -> Array:
        """Return the forces left along free motions, and the rates of states of controls."""
        return np.concatenate((self.slope(here, free), here.unrest[0]))

    # -- without ---------------------------------------------------------------------------------

    def along_the_forces(self) -> Place | None:
        """Follow the force flow to its end, using implicit Euler with increasing step sizes."""
        least, before, h = np.inf, 0.0, 0.0
        for taken in range(BALANCE_ROUNDS):
            if self.reached:
                return None
            here, free = self.here, self.free(self.here)
            slope = self.slope(here, free)
            self.size = max(self.size, here.force)
            norm = float(np.linalg.norm(slope))
            left = norm / self.size
            if left <= NOTABLE and self.released():
                least = np.inf
                continue
            if left == 0.0 or (taken == 0 and left <= ROUNDING):
                return here
            if left <= SOLVED and left >= least / 2:
                return self.best
            if left < least:
                self.best, least = here, left
            K = free.T @ here.stiffness @ free
            h = h * before / norm if before else 1.0 / (float(np.abs(K).max(initial=0.0)) or 1.0)
            unstable = -float(np.min(np.linalg.eigvals(K).real, initial=0.0))
            h = (
                min(h, 0.5 / unstable) if unstable > 0 else h
            )  # else it would end where it pushes off
            before = norm
            step = -free @ np.linalg.lstsq(np.eye(len(K)) / h + K, slope, rcond=ROUNDING)[0]
            self.here = self.taken(self.moved(here, self.share(step) * step))
        return self.best if least <= SOLVED else None
