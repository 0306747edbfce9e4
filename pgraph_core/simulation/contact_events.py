"""Event-driven contacts: the phases of contact points and limits, and the events that end them.

Compiled steps end at events. The next phase is selected in Python.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.assembly import ASSEMBLY_ROUNDS
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import FACTORED, FACTORS
from ..engine.contact import points as point_kernels
from ..engine.motions import facts
from ..engine.records import ACCEPTANCE, SLIP, STANCE, SWING
from ..fields import GROUND
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..result import Status
from ..result.records import FREE, PHASES, STOP, Event
from ..tolerances import COINCIDENT, NOTABLE, SOLVED, VISIBLE
from .contact_log import COUNTED, named
from .event_scene import INSTEAD, EventScene, Impact
from .loop import Outcome, Steps
from .run_plan import RunPlan

MOST_TURNS = 100
SLACK = 0.5 * point_kernels.FORCE_TOLERANCE
ENDLESS = 300  # events at one time: they do not end
UNSETTLED = 300  # events of a run without consistent phases: its motion means nothing any more
STEPPING = "try method 'moreau_jean'"  # this method has no phases and no events


class ContactEvents:
    """The contact points and limits of a run, with their swing, slip and stance phases."""

    def __init__(
        self,
        mech: Mechanism,
        plan: RunPlan,
        scene: EventScene,
        steps: Steps,
        ended: Outcome,
        fine: float = 1.0,
    ):
        """Start with all contact points in swing. A finer run scales the tolerance by `fine`."""
        self.mech, self.plan, self.scene, self.steps = mech, plan, scene, steps
        self.q, self.v, self.ended = steps.q, steps.v, ended
        self.causes: dict[int, str] = {}
        self._ends: dict[int, float] = {}  # when the bounces of a point that comes to rest are over
        self.tally = {"phase_switches": 0, "impacts": 0, "bounces_left_out": 0}
        self._fine = fine
        self.seconds = 0.0  # spent on events
        self.noted: Callable[[float], None] | None = None  # told of each, for a user's events
        self._times: deque[float] = deque(maxlen=ENDLESS)
        self._struck: tuple[float, set[int]] = -np.inf, set()  # the last impact: time and points
        self._in_turn = False  # whether an impact has followed another one at the same time
        self._fell = set[int]()  # open points that would penetrate, of the event being settled
        self._contradictions = 0  # events after which no phases were consistent
        # points without normal velocity at this event
        self._resting = np.zeros(len(plan.contact_points), dtype=bool)
        self._vdot, self._flow = np.zeros(len(steps.v)), np.zeros(3)

    # -- the run -------------------------------------------------------------------------------

    def begin(self, t: float) -> None:
        """Set the phases for the initial state and the velocity scales."""
        # The factors of other blocks are not those of contacts.
        self.scene.space.vectors[FACTORED, FACTORS.known] = 0.0
        f = self.scene.points
        gravity = float(np.linalg.norm(self.mech.model.gravity))
        self._observe(t)
        for s in np.flatnonzero(np.isnan(f["gap"])).tolist():
            self._stop_flat(t, s)
            return
        heights = self.scene.points["rounding"] / point_kernels.GAP_ROUNDING
        limits = [point.limit for point in self.scene.contact_points]
        sizes = np.array([h if x is None else x.size for h, x in zip(heights.tolist(), limits)])
        size = float(np.max(sizes, initial=0.0)) or 1.0
        speeds = np.abs(np.column_stack((f["gap_rate"], f["slip_velocity"])))
        self.speed = float(max(np.sqrt(gravity * size), np.max(speeds, initial=0.0))) or 1.0
        f["slip_tolerance"] = max(1e-10, 10 * self.steps.blurred) * self.speed
        self.stuck = max(1e-8, 100 * self.steps.blurred) * self.speed
        span = float(np.ptp(self.plan.times))
        own = self.speed / gravity if gravity else span
        self._acceleration = self.speed / own  # typical of the run [m/s²]
        self.steps.scale(own)
        self._same_time, self._unresolved = COINCIDENT * min(span, own), COINCIDENT * max(span, own)
        self._first_phases(t, np.maximum(f["rounding"], SOLVED * self._fine * sizes))

    def _first_phases(self, t: float, touching: Array) -> None:
        """Set the initial phases. Points that touch either stick, slide or hit."""
        scene, f = self.scene, self.scene.points
        hits = []
        for s in np.flatnonzero(f["gap"] <= touching).tolist():
            if f["gap_rate"][s] < -self.stuck:
                hits += [s] if f["gap"][s] <= f["rounding"][s] else []  # else it hits later
            elif f["gap_rate"][s] <= self.stuck:
                self._close(s, SLIP)
            else:
                scene.points["fresh"][s] = 1
        before = scene.phase.copy()
        if hits:
            self._impact(t, hits)
        self._settle(t)
        if self.plan.project and np.any(scene.phase != SWING):
            old = self.q.copy()
            rounds = motion.projection(scene.held, t, self.q, self.v, ASSEMBLY_ROUNDS)
            moved = float(np.max(np.abs(self.q - old), initial=0.0))
            if rounds < 0:
                self.ended.stop(
                    Status.CANNOT_CLOSE, f"{Status.CANNOT_CLOSE.value} from this initial state"
                )
            elif moved > 1e-6:
                self.ended.notices.append(
                    f"the initial state was changed by {moved:.3g} to meet what it touches"
                )
            self._observe(t)
        self._note_changes(t, before)

    def look_at(self, q: Array, v: Array, times: Array) -> None:
        """Record gaps and positions of points at states before event handling began."""
        for i, t in enumerate(times.tolist()):
            state = (q[i].copy(), v[i].copy())
            point_kernels.observe(self.scene.address, t, *state, self._vdot, self._flow)
            for name in ("gap", "position"):
                self.scene.frames[name][i] = self.scene.points[name]

    def advance(self, budget: int) -> int:
        """Take at most `budget` steps and frames. Returns the kernel's status code."""
        steps = self.steps
        last = int(steps.counters["steps"]) + budget
        while budget > 0:
            code = steps.advance(budget)
            if code != at.EVENT:
                return code
            began = time.perf_counter()
            t = float(steps.clock["time"])
            self._observe(t)  # frames may have been looked at since
            if self.noted is not None:
                self.noted(t)
            self._event(t)
            steps.go_on()
            self.seconds += time.perf_counter() - began
            if self.ended.over:
                return at.EVENT
            budget = last - int(steps.counters["steps"])
        return at.RUNNING

    def impulse(self, t: float) -> None:
        """Apply impulses at all touching points as constraints switch, and update the phases."""
        self._observe(t)
        self._resting[:] = self.scene.phase != SWING
        before = self.scene.phase.copy()
        if self.scene.bilateral or self._resting.any():
            self._impact(t, [])
        self._settle(t)
        self._note_changes(t, before)

    # -- events --------------------------------------------------------------------------------

    def _event(self, t: float) -> None:
        """Handle the event at t by applying impacts and updating the phases."""
        scene, f = self.scene, self.scene.points
        self._guard(t)
        before = scene.phase.copy()
        self._resting[:] = before != SWING
        over = scene.over()
        hits = []
        for s in np.flatnonzero(over.any(axis=1)).tolist():
            if before[s] == SWING:
                if f["gap_rate"][s] < 0:
                    hits.append(s)
                elif f["gap_rate"][s] <= self._hidden(t, s):
                    self._close(s, ACCEPTANCE)
            elif over[s, 2]:
                if f["rim"][s] and f["arm"][s] @ f["start_arm"][s] < 0:
                    self._stop_flat(t, s)
                else:
                    self._painleve(t, s)
            elif over[s, 0]:
                self._open(s, self._cannot_pull(s))
            elif before[s] == STANCE:
                self._slip(s, before[s])
            else:
                self._slip_ended(s)
        if hits:
            self._impact(t, hits)
        self._settle(t)
        self._note_changes(t, before)

    def _guard(self, t: float) -> None:
        """Stop the run if events accumulate without end."""
        self._times.append(t)
        if len(self._times) == ENDLESS and t - self._times[0] < self._same_time:
            where = ", ".join(
                self.scene.contact_points[s].name
                for s in np.flatnonzero(self.scene.over().any(axis=1)).tolist()
            )
            text = f"at t = {t:.9g} s ({where}); {STEPPING}"
            self.ended.stop(Status.CHATTER, f"{Status.CHATTER.value} {text}")

    def _stop_flat(self, t: float, s: int) -> None:
        """Stop the run where an end of a cylinder touches along its whole circle."""
        name = self.scene.contact_points[s].name
        text = f"at t = {t:.9g} s: an end of {name} lies flat on the ground; {INSTEAD}"
        self.ended.stop(Status.CHATTER, f"{Status.CHATTER.value} {text}")

    def _note_changes(self, t: float, before: Ints) -> None:
        """Log the phase changes and monitor the new phases."""
        scene = self.scene
        for s in np.flatnonzero(before != scene.phase).tolist():
            scene.points["fresh"][s] = 1
            self.tally["phase_switches"] += 1
            self._log(self._ends.get(s, t), s, before[s], self.causes.get(s, "forces closed it"))
        self.causes.clear()
        self._ends.clear()
        scene.arrange()
        self._observe(t)
        f = scene.points
        f["fresh"][(scene.phase == SWING) & (f["gap"] > 2 * f["rounding"])] = 0
        point_kernels.begin(scene.address, float(self.steps.guard["turning"]))

    def _log(self, t: float, s: int, before: int, cause: str) -> None:
        point = self.scene.contact_points[s]
        after = int(self.scene.phase[s])
        names = (FREE, "", "", STOP) if point.limit is not None else PHASES
        self.ended.log.append(Event(t, point.name, point.body, names[before], names[after], cause))

    def _observe(self, t: float) -> None:
        point_kernels.observe(self.scene.address, t, self.q, self.v, self._vdot, self._flow)

    # -- changes of one point -------------------------------------------------------------------

    def _set(self, s: int, phase: int) -> None:
        self.scene.points["phase"][s] = phase
        self._resting[s] |= phase != SWING
        if phase == STANCE:
            self.scene.hold(s)
            if (limit := self.scene.contact_points[s].limit) is not None:
                # the event was located to rounding
                self.q[limit.at_q] = limit.bound / limit.weights
        self.scene.arrange()

    def _open(self, s: int, cause: str) -> None:
        self._set(s, SWING)
        self.scene.points["fresh"][s] = 1  # even if it was closed at this very event
        self.causes[s] = cause

    def _close(self, s: int, sliding: int) -> None:
        """Set stance if a point has no tangential velocity, or else the given sliding phase."""
        f = self.scene.points[s]
        u = f["slip_velocity"]
        speed = float(np.linalg.norm(u))
        if self.scene.points["limit"][s] or speed <= self.stuck:
            self._set(s, STANCE)
        else:
            f["slip_direction"] = u / speed
            self._set(s, sliding)

    def _slip(self, s: int, before: int) -> None:
        """Change from stance to slip if the friction force is no longer sufficient."""
        f = self.scene.points[s]
        normal = f["normal"]
        force = f["force"]
        drag = force - (force @ normal) * normal
        size = float(np.linalg.norm(drag))
        if size > 0:
            f["slip_direction"] = -drag / size
        self._set(s, ACCEPTANCE if before in (SWING, ACCEPTANCE) else SLIP)
        self.scene.points["fresh"][s] = 1
        share = f"{size:.4g} N would exceed {f['friction']:g} of {f['normal_force']:.4g} N"
        self.causes[s] = f"friction of {share}"

    def _slip_ended(self, s: int) -> None:
        """Handle a slip velocity that has reached zero or has only changed direction."""
        f = self.scene.points[s]
        u = f["slip_velocity"]
        speed = float(np.linalg.norm(u))
        if speed <= self.stuck:
            for k in np.flatnonzero(self._still() & self._sliding()).tolist():
                self._set(k, STANCE)
                self.causes[k] = "its slip came to zero"
        else:
            f["slip_direction"] = u / speed

    def _cannot_pull(self, s: int) -> str:
        return "a limit cannot pull" if self.scene.points["limit"][s] else "the ground cannot pull"

    # -- phases that fit the forces ------------------------------------------------------------

    def _settle(self, t: float) -> None:
        """Change phases until forces push, stay in their cones, and no open point closes."""
        scene, before = self.scene, self.scene.phase.copy()
        self._turns_taken = 0
        self._fell.clear()
        tried: set[tuple[bytes, bytes, int]] = set()
        for _ in range(MOST_TURNS + 20 + 4 * len(scene.contact_points)):
            scene.arrange()
            self._observe(t)
            closed = np.count_nonzero(scene.phase)
            if not self._change(t, before):
                return
            ways = scene.points["slip_direction"].tobytes()
            now = scene.phase.tobytes(), ways, min(self._turns_taken, MOST_TURNS)
            if now in tried and np.count_nonzero(scene.phase) <= closed:
                break  # the search goes round in a circle; leave it where no contact has to pull
            tried.add(now)
        self._unsettled(t)

    def _unsettled(self, t: float) -> None:
        """Tell the first event without consistent phases, and stop the run if they do not end."""
        self._contradictions += 1
        if self._contradictions == 1:
            self.ended.notices.append(
                f"t = {t:.6g} s: no phases satisfy all contact laws; the last ones are used"
            )
        elif self._contradictions == UNSETTLED:
            text = f"until t = {t:.9g} s: {UNSETTLED} times no phases satisfy all contact laws"
            self.ended.stop(Status.CHATTER, f"{Status.CHATTER.value} {text}; {STEPPING}")

    def _change(self, t: float, before: Ints) -> bool:
        """Change the phase least consistent with the forces. False if all are consistent."""
        scene, f = self.scene, self.scene.points
        closed = scene.phase != SWING
        sliding = self._sliding()
        contact = scene.points["limit"] == 0
        for s in np.flatnonzero(sliding & (f["pivot"] < -SOLVED)).tolist():
            self._painleve(t, s)
            return True
        push, drag = f["normal_force"], f["friction_force"]
        slack = SLACK * float(np.max(np.abs((push, drag)), initial=0.0))
        s = int(np.argmin(np.where(closed, push, np.inf))) if len(f) else 0
        if closed.any() and push[s] < -slack:
            if s in self._fell and scene.phase[s] == STANCE and drag[s] > slack:
                self._slip(s, SWING)  # open, it falls: what cannot stick may slide
            else:
                self._open(s, self._cannot_pull(s))
            return True
        excess = np.where((scene.phase == STANCE) & contact, drag - f["friction"] * push, 0)
        for s in np.flatnonzero(excess > slack).tolist():
            self._slip(s, int(before[s]))
        return bool((excess > slack).any()) or self._change_rates(t)

    def _change_rates(self, t: float) -> bool:
        """Update the direction of incipient slip, and close open points that would penetrate.

        A point that cannot stay where it is begins to slide. If the rows of stances and constraints
        depend on each other, no forces may give all of them the accelerations that they need.
        """
        scene, f = self.scene, self.scene.points
        starting = self._still() & self._sliding()
        resting = self._resting & (scene.phase == SWING)
        held = (scene.phase == STANCE) & (f["limit"] == 0)
        if not (starting | resting | held).any():
            return False
        self._accelerations(t)
        rates = np.abs(np.column_stack((f["normal_acceleration"], f["tangential_acceleration"])))
        size = max(float(np.linalg.norm(self.mech.model.gravity)), float(np.max(rates)))
        falls = np.flatnonzero(resting & (f["normal_acceleration"] < -SOLVED * size)).tolist()
        self._fell.update(falls)
        for s in falls:
            self._close(s, ACCEPTANCE)
        if falls:
            return True
        drift = np.where(held, np.linalg.norm(f["tangential_acceleration"], axis=1), 0.0)
        if drift[s := int(np.argmax(drift))] > NOTABLE * max(size, self._acceleration):
            f["slip_direction"][s] = f["tangential_acceleration"][s] / drift[s]
            self._set(s, SLIP)
            self.causes[s] = f"no forces hold it: it accelerates by {drift[s]:.4g} m/s²"
            return True
        moved = 0.0
        for s in np.flatnonzero(starting).tolist():
            moved = max(moved, self._turn(s, SOLVED * size))
        self._turns_taken += 1
        return moved > SOLVED and self._turns_taken < MOST_TURNS

    def _turn(self, s: int, tiny: float) -> float:
        """Align the slip direction of s with its motion. Returns the change.

        The next slip direction is the direction of its frictionless acceleration. Near the boundary
        of the cone, the direction of the acceleration is arbitrary.
        """
        f = self.scene.points[s]
        way = f["slip_direction"].copy()
        rate = f["tangential_acceleration"]
        if f["friction"] == 0 or float(np.linalg.norm(rate)) <= tiny:
            return 0.0
        drive = f["friction_force"] * f["compliance"] * way + rate
        f["slip_direction"] = drive / np.linalg.norm(drive)
        return float(np.linalg.norm(f["slip_direction"] - way))

    def _still(self) -> NDArray[np.bool_]:
        slip = self.scene.points["slip_velocity"]
        return np.linalg.norm(slip, axis=1) <= self.stuck

    def _sliding(self) -> NDArray[np.bool_]:
        return (self.scene.phase == SLIP) | (self.scene.phase == ACCEPTANCE)

    def _accelerations(self, t: float) -> None:
        point_kernels.point_accelerations(
            self.scene.address, t, self.q, self.v, self._vdot, self._flow
        )

    # -- impacts -------------------------------------------------------------------------------

    def _impact(self, t: float, hits: list[int], jammed: int = -1) -> None:
        """Apply impulses at all touching points. Impacting points bounce or stay."""
        scene, f = self.scene, self.scene.points
        closed = scene.phase != SWING
        near = ~closed & (f["gap_rate"] < 0)
        near &= f["gap"] <= np.maximum(-f["gap_rate"] * self._same_time, f["rounding"])
        near |= closed
        near[hits] = True
        touching = np.flatnonzero(near)
        self._accelerations(t)
        before = scene.phase.copy()
        restitution, rest = self._bounces(t, touching)
        found = scene.impact(t, self.q, self.v, touching, restitution, jammed)
        if found is None:
            self.ended.stop(
                Status.NOT_FINITE, f"{Status.NOT_FINITE.value} in the impact at t = {t:g} s"
            )
            return
        if found.calmed:
            self.tally["bounces_left_out"] += 1
            self.ended.notices.append(
                f"t = {t:.6g} s: Newton's restitution with friction would increase the energy; "
                "this impact does not bounce"
            )
        if found.missed > SOLVED:
            self.ended.notices.append(
                f"t = {t:.6g} s: impulses of an impact are accurate to {found.missed:.3g} only"
            )
        if found.loose is not None:
            point = scene.contact_points[found.loose]
            name = named(point.pair, (point.body, GROUND))
            self.ended.notices.append(COUNTED["loose"].format(loose_time=t, loose_name=name))
        self._note_order(t, set(hits))
        scene.strike(self.v, self.steps.ledger)
        self.tally["impacts"] += 1
        self._after_impact(t, touching.tolist(), found, before, rest)

    def _note_order(self, t: float, hits: set[int]) -> None:
        """Add a notice if impacts follow others at the same time, where their order decides."""
        last, before = self._struck
        if not hits:
            return
        self._struck = t, hits
        slow = max(-self.scene.points["gap_rate"][list(hits)]) < VISIBLE * self.speed
        if not before or t - last > self._same_time or hits == before or slow:
            return
        if not self._in_turn:
            struck = min(before), min(hits - before or hits)
            one, other = (self.scene.contact_points[s].name for s in struck)
            self.ended.notices.append(
                f"t = {t:.9g} s: {one} and {other} hit in turn at one time. The motion afterwards "
                "depends on the order of such impacts, which rounding decides"
            )
        self._in_turn = True

    def _bounces(self, t: float, touching: Ints) -> tuple[Array, dict[int, float]]:
        """Return the restitution of each touching point, and the end times of bounces to rest."""
        f, rest = self.scene.points, dict[int, float]()
        restitution = np.array([self.scene.contact_points[s].restitution for s in touching])
        for k, s in enumerate(touching.tolist()):
            e, fall = float(restitution[k]), -f["normal_acceleration"][s]
            back = e * min(f["gap_rate"][s], 0.0)
            hidden = -back <= _hidden(f[s]) or -2 * back < self._same_time * fall
            if back < 0 and fall > 0 and e < 1 and hidden:
                rest[s] = t - 2 * back / (fall * (1 - e))
                restitution[k] = 0.0
        return restitution, rest

    def _after_impact(
        self, t: float, touching: list[int], found: Impact, before: Ints, rest: dict[int, float]
    ) -> None:
        """Set phases from the velocities after an impact. Bouncing points stay in swing."""
        scene = self.scene
        tiny = 1e-12 * found.fastest
        phase = self.scene.phase.copy()
        self.scene.points["phase"] = SWING
        self._observe(t)
        self.scene.points["phase"] = phase
        for s, rate, away, push in zip(touching, *map(np.ndarray.tolist, found[:3])):
            unit = "rad/s" if self._turns(s) else "m/s"
            hit = f"hit at {-rate:.6g} {unit}"
            slowest = _hidden(scene.points[s])
            if before[s] != SWING:  # its fall back is unknown
                slowest = max(slowest, scene.points["rounding"][s] / self._unresolved)
            if away > max(tiny, slowest):
                self._set(s, SWING)
                self._resting[s] = False
                scene.points["fresh"][s] = 2
                if before[s] == SWING and push > 0:
                    self._log(t, s, SWING, f"{hit} and bounced at {away:.6g} {unit}")
                else:
                    self.causes[s] = "released by an impact elsewhere"
                continue
            if before[s] == SWING:
                self.causes[s] = hit
                if s in rest:
                    self.causes[s] = f"came to rest; its last bounces from t = {t:.9g} s, left out"
                    self._ends[s] = rest[s]
                self._close(s, ACCEPTANCE)
            else:
                self._close(s, int(before[s]) if before[s] != STANCE else SLIP)
                self.causes.setdefault(s, "an impact elsewhere")

    def _turns(self, s: int) -> bool:
        """Check whether a point is a limit of a rotating joint."""
        if not self.scene.points["limit"][s]:
            return False
        row = self.scene.blocks.blocks_i[self.scene.points["slide_block"][s], at.B_A]
        return bool(facts("angle")[self.mech.packed.system.rows[row, at.KIND]])

    def _hidden(self, t: float, s: int) -> float:
        """Return `_hidden` for point s in its present state."""
        self._accelerations(t)
        return _hidden(self.scene.points[s])

    def _painleve(self, t: float, s: int) -> None:
        """Resolve sliding without one finite force: an impulse ends the slip, or a point lifts."""
        point = self.scene.contact_points[s]
        before = int(self.scene.phase[s])
        self._set(s, SWING)
        self._observe(t)
        self._accelerations(t)
        if self.scene.points["normal_acceleration"][s] >= 0:
            text = "Painlevé's case: sliding and leaving are both possible; it leaves"
            self.causes[s] = text
        else:
            text = "Painlevé's case: no sliding force is possible; an impulse ended its slip"
            self.scene.points["phase"][s] = before
            self.scene.arrange()
            self._impact(t, [], jammed=s)
            self.causes[s] = text
        self.ended.notices.append(f"t = {t:.6g} s: contact '{point.name}': {text}")


def _hidden(point: Any) -> float:
    """Compute the bounce speed below which rounding visibly affects its height [m/s, rad/s]."""
    fall = max(-float(point["normal_acceleration"]), 0.0)
    return float(np.sqrt(2.0 * fall * float(point["rounding"]) / VISIBLE))
