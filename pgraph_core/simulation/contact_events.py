"""Event-driven contacts: phases of contact points and limits, and what ends them.

Compiled steps end at events. Only there Python decides what comes next.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.assembly import ASSEMBLY_ROUNDS
from ..contact import impacts
from ..dynamics.bodies import bodies_over
from ..engine import layout as at
from ..engine import motion
from ..engine.constraints.proximal import FACTORED
from ..engine.contact import phase_watch
from ..engine.contact import sites as site_kernels
from ..mechanism import Mechanism
from ..packing.system import Array, Ints
from ..result import Status
from ..result.contact_record import FREE, PHASES, STOP, ContactRecord, Event
from .event_scene import EventScene
from .loop import AdaptiveSteps, FixedSteps, Outcome
from .plan import Plan

TOUCHING = 1e-9  # relative to the size of the coordinates: a gap that is none at the start
SAME_TIME = 1e-10  # s: touchdowns within it are one impact
UNRESOLVED = 2e-10  # s: an instant of touchdown that rounding hides; the bounces are over
SHORTEST = 1e-11  # s: a flight below it is none
STUCK = 1e-8  # of the characteristic speed: slip that has ended
ALIGNED = 1e-10  # rad: a direction of slip this near is found
MOST_TURNS = 100
SLACK = 0.5 * phase_watch.FORCE_TOLERANCE
MANY = 300  # events within SAME_TIME: they do not end


class ContactEvents:
    """The contact points and limits of a run, which swing, slide and stand."""

    def __init__(
        self,
        mech: Mechanism,
        plan: Plan,
        scene: EventScene,
        steps: FixedSteps | AdaptiveSteps,
        ended: Outcome,
    ):
        """All contact points are in swing."""
        self.mech, self.plan, self.scene, self.steps = mech, plan, scene, steps
        self.q, self.v, self.ended = steps.q, steps.v, ended
        self.causes: dict[int, str] = {}
        self._ends: dict[int, float] = {}  # when the bounces of a point that comes to rest are over
        self.tally = {"phase_switches": 0, "impacts": 0, "bounces_left_out": 0}
        self.seconds = 0.0  # spent on events
        self._times: deque[float] = deque(maxlen=MANY)
        self._resting = np.zeros(len(plan.sites), dtype=bool)  # no normal velocity at this event
        self._vdot, self._flow = np.zeros(mech.nv), np.zeros(3)

    # -- the run -------------------------------------------------------------------------------

    def begin(self, t: float) -> None:
        """Phases of the initial state, and the scales of velocities."""
        self.scene.space.vectors[FACTORED, 2] = 0.0  # factors of other blocks are not ours
        f = self.scene.sites_f
        gravity = float(np.linalg.norm(self.mech.model.gravity))
        self._observe(t)
        size = float(np.max(np.abs(f[:, at.S_PLACE : at.S_PLACE + 3]), initial=0.0)) or 1.0
        speeds = np.abs(f[:, [at.S_RATE, *range(at.S_SLIP_V, at.S_SLIP_V + 3)]])
        self.speed = float(max(np.sqrt(gravity * size), np.max(speeds, initial=0.0))) or 1.0
        f[:, at.S_STILL] = max(1e-10, 10 * self.steps.blurred) * self.speed
        self.stuck = max(1e-8, 100 * self.steps.blurred) * self.speed
        self.steps.scale(self.speed / gravity if gravity else float(np.ptp(self.plan.times)))
        self._first_phases(t, TOUCHING * size)

    def _first_phases(self, t: float, touching: float) -> None:
        """Phases of the initial state: points that touch stand, slide or hit."""
        scene, f = self.scene, self.scene.sites_f
        hits = []
        for s in np.flatnonzero(f[:, at.S_DISTANCE] <= touching).tolist():
            if f[s, at.S_RATE] < -self.stuck:
                hits.append(s)
            elif f[s, at.S_RATE] <= self.stuck:
                self._close(s, at.SLIP)
            else:
                scene.sites_i[s, at.S_FRESH] = 1
        before = scene.phase.copy()
        if hits:
            self._impact(t, hits)
        self._settle(t)
        if self.plan.project and np.any(scene.phase != at.SWING):
            old = self.q.copy()
            rounds = motion.projection(scene.held, t, self.q, self.v, ASSEMBLY_ROUNDS)
            moved = float(np.max(np.abs(self.q - old), initial=0.0))
            if rounds < 0:
                self.ended.stop(
                    Status.CANNOT_CLOSE, f"{Status.CANNOT_CLOSE.value} from this initial state"
                )
            elif moved > 1e-6:
                self.ended.notices.append(
                    f"the initial state was moved by {moved:.3g} to meet what it touches"
                )
            self._observe(t)
        self._note_changes(t, before)

    def advance(self, budget: int, out: tuple[Array, ...]) -> int:
        """Take at most `budget` steps and frames; the kernel's status code, EVENT if it stopped."""
        steps = self.steps
        last = int(steps.counters["steps"]) + budget
        while budget > 0:
            code = steps.advance(self.scene.address, budget, out)
            if code != at.EVENT:
                return code
            began = time.perf_counter()
            self._observe(steps.event)  # frames may have been looked at since
            self._event(steps.event)
            steps.go_on()
            self.seconds += time.perf_counter() - began
            if not self.ended.ok:
                return at.EVENT
            budget = last - int(steps.counters["steps"])
        return at.RUNNING

    def impulse(self, t: float) -> None:
        """Impulses at everything that touches where constraints are switched, and new phases."""
        self._resting[:] = self.scene.phase != at.SWING
        before = self.scene.phase.copy()
        if self.scene.bilateral or self._resting.any():
            self._impact(t, [])
        self._settle(t)
        self._note_changes(t, before)

    # -- events --------------------------------------------------------------------------------

    def _event(self, t: float) -> None:
        """Phases after the event at t, and its impacts."""
        scene, f = self.scene, self.scene.sites_f
        self._guard(t)
        before = scene.phase.copy()
        self._resting[:] = before != at.SWING
        over = scene.watched[at.W_NOW].reshape(-1, 3) < 0
        hits = []
        for s in np.flatnonzero(over.any(axis=1)).tolist():
            if before[s] == at.SWING:
                if f[s, at.S_RATE] < 0:
                    hits.append(s)
                elif f[s, at.S_RATE] * UNRESOLVED <= f[s, at.S_NOISE]:
                    self._close(s, at.ACCEPTANCE)
            elif over[s, 2]:
                self._painleve(t, s)
            elif over[s, 0]:
                self._open(s, self._cannot_pull(s))
            elif before[s] == at.STANCE:
                self._slip(s, before[s])
            else:
                self._slip_ended(s)
        if hits:
            self._impact(t, hits)
        self._settle(t)
        self._note_changes(t, before)

    def _guard(self, t: float) -> None:
        """Stop where events follow each other without end."""
        self._times.append(t)
        if len(self._times) == MANY and t - self._times[0] < SAME_TIME:
            where = ", ".join(self.scene.sites[s].name for s in self._over())
            text = f"at t = {t:.9g} s ({where}); try method 'moreau_jean'"
            self.ended.stop(Status.CHATTER, f"{Status.CHATTER.value} {text}")

    def _over(self) -> list[int]:
        over = self.scene.watched[at.W_NOW].reshape(-1, 3) < 0
        return np.flatnonzero(over.any(axis=1)).tolist()

    def _note_changes(self, t: float, before: Ints) -> None:
        """Log the changes of phases and watch the new ones."""
        scene = self.scene
        for s in np.flatnonzero(before != scene.phase).tolist():
            scene.sites_i[s, at.S_FRESH] = 1
            self.tally["phase_switches"] += 1
            self._log(self._ends.get(s, t), s, before[s], self.causes.get(s, "forces closed it"))
        self.causes.clear()
        self._ends.clear()
        scene.arrange()
        self._observe(t)
        phase_watch.begin(scene.address, self.steps.turning)

    def _log(self, t: float, s: int, before: int, cause: str) -> None:
        site = self.scene.sites[s]
        after = int(self.scene.phase[s])
        names = (FREE, "", "", STOP) if site.limit is not None else PHASES
        self.ended.log.append(Event(t, site.name, site.body, names[before], names[after], cause))

    def _observe(self, t: float) -> None:
        site_kernels.observe(self.scene.address, t, self.q, self.v, self._vdot, self._flow)

    # -- changes of one site -------------------------------------------------------------------

    def _set(self, s: int, phase: int) -> None:
        self.scene.sites_i[s, at.S_PHASE] = phase
        self._resting[s] |= phase != at.SWING
        if phase == at.STANCE:
            self.scene.hold(s)
        self.scene.arrange()

    def _open(self, s: int, cause: str) -> None:
        self._set(s, at.SWING)
        self.causes[s] = cause

    def _close(self, s: int, sliding: int) -> None:
        """Stance where a site has no tangential velocity, else one of the two sliding phases."""
        f = self.scene.sites_f[s]
        u = f[at.S_SLIP_V : at.S_SLIP_V + 3]
        speed = float(np.linalg.norm(u))
        if self.scene.sites_i[s, at.S_LIMIT] or speed <= self.stuck:
            self._set(s, at.STANCE)
        else:
            f[at.S_WAY : at.S_WAY + 3] = u / speed
            self._set(s, sliding)

    def _slip(self, s: int, before: int) -> None:
        """From stance to slip, against the friction that no longer suffices."""
        f = self.scene.sites_f[s]
        normal = f[at.S_NORMAL : at.S_NORMAL + 3]
        force = f[at.S_FORCE : at.S_FORCE + 3]
        drag = force - (force @ normal) * normal
        size = float(np.linalg.norm(drag))
        if size > 0:
            f[at.S_WAY : at.S_WAY + 3] = -drag / size
        self._set(s, at.ACCEPTANCE if before in (at.SWING, at.ACCEPTANCE) else at.SLIP)
        self.scene.sites_i[s, at.S_FRESH] = 1
        share = f"{size:.4g} N would exceed {f[at.S_FRICTION]:g} of {f[at.S_PUSH]:.4g} N"
        self.causes[s] = f"friction of {share}"

    def _slip_ended(self, s: int) -> None:
        """Slip came to zero, or has only turned."""
        f = self.scene.sites_f[s]
        u = f[at.S_SLIP_V : at.S_SLIP_V + 3]
        speed = float(np.linalg.norm(u))
        if speed <= self.stuck:
            for k in np.flatnonzero(self._still() & self._sliding()).tolist():
                self._set(k, at.STANCE)
                self.causes[k] = "its slip came to zero"
        else:
            f[at.S_WAY : at.S_WAY + 3] = u / speed

    def _cannot_pull(self, s: int) -> str:
        return (
            "a limit cannot pull" if self.scene.sites_i[s, at.S_LIMIT] else "the ground cannot pull"
        )

    # -- phases that fit the forces ------------------------------------------------------------

    def _settle(self, t: float) -> None:
        """Change phases until forces push, stay in their cones, and nothing open closes."""
        before = self.scene.phase.copy()
        self._turns_taken = 0
        for _ in range(MOST_TURNS + 20 + 4 * len(self.scene.sites)):
            self.scene.arrange()
            self._observe(t)
            if not self._change(t, before):
                return
        self.ended.notices.append(
            f"t = {t:.6g} s: no phases fit all forces at once; the last are kept"
        )

    def _change(self, t: float, before: Ints) -> bool:
        """Change the phase that fits the forces least; whether there was one."""
        scene, f = self.scene, self.scene.sites_f
        closed = scene.phase != at.SWING
        sliding = self._sliding()
        points = scene.sites_i[:, at.S_LIMIT] == 0
        for s in np.flatnonzero(
            sliding & (f[:, at.S_PIVOT] < -phase_watch.PIVOT_TOLERANCE)
        ).tolist():
            self._painleve(t, s)
            return True
        push, drag = f[:, at.S_PUSH], f[:, at.S_DRAG]
        slack = SLACK * float(np.max(np.abs(f[:, [at.S_PUSH, at.S_DRAG]]), initial=0.0))
        s = int(np.argmin(np.where(closed, push, np.inf))) if len(f) else 0
        if closed.any() and push[s] < -slack:
            self._open(s, self._cannot_pull(s))
            return True
        excess = np.where((scene.phase == at.STANCE) & points, drag - f[:, at.S_FRICTION] * push, 0)
        for s in np.flatnonzero(excess > slack).tolist():
            self._slip(s, int(before[s]))
        return bool((excess > slack).any()) or self._change_rates(t)

    def _change_rates(self, t: float) -> bool:
        """Turn slip that is about to start; close open points that would penetrate."""
        scene, f = self.scene, self.scene.sites_f
        starting = self._still() & self._sliding()
        resting = self._resting & (scene.phase == at.SWING)
        if not (starting | resting).any():
            return False
        self._accelerations(t)
        rates = np.abs(f[:, [at.S_ACC_N, *range(at.S_ACC_T, at.S_ACC_T + 3)]])
        size = max(float(np.linalg.norm(self.mech.model.gravity)), float(np.max(rates)))
        for s in np.flatnonzero(resting & (f[:, at.S_ACC_N] < -1e-9 * size)).tolist():
            self._close(s, at.ACCEPTANCE)
            return True
        moved = 0.0
        for s in np.flatnonzero(starting).tolist():
            moved = max(moved, self._turn(s, 1e-9 * size))
        self._turns_taken += 1
        return moved > ALIGNED and self._turns_taken < MOST_TURNS

    def _turn(self, s: int, tiny: float) -> float:
        """Turn the direction in which s is about to slip to where it would go; by how much.

        The next direction is that of its acceleration without friction. Near the border of the
        cone the acceleration alone points anywhere.
        """
        f = self.scene.sites_f[s]
        way = f[at.S_WAY : at.S_WAY + 3].copy()
        rate = f[at.S_ACC_T : at.S_ACC_T + 3]
        if f[at.S_FRICTION] == 0 or float(np.linalg.norm(rate)) <= tiny:
            return 0.0
        drive = f[at.S_DRAG] * f[at.S_EASE] * way + rate
        f[at.S_WAY : at.S_WAY + 3] = drive / np.linalg.norm(drive)
        return float(np.linalg.norm(f[at.S_WAY : at.S_WAY + 3] - way))

    def _still(self) -> NDArray[np.bool_]:
        slip = self.scene.sites_f[:, at.S_SLIP_V : at.S_SLIP_V + 3]
        return np.linalg.norm(slip, axis=1) <= self.stuck

    def _sliding(self) -> NDArray[np.bool_]:
        return (self.scene.phase == at.SLIP) | (self.scene.phase == at.ACCEPTANCE)

    def _accelerations(self, t: float) -> None:
        site_kernels.site_accelerations(
            self.scene.address, t, self.q, self.v, self._vdot, self._flow
        )

    # -- impacts -------------------------------------------------------------------------------

    def _impact(self, t: float, hits: list[int], jammed: int = -1) -> None:
        """Impulses at all points that touch; points that hit bounce, or stay."""
        scene, f = self.scene, self.scene.sites_f
        closed = scene.phase != at.SWING
        near = ~closed & (f[:, at.S_RATE] < 0)
        near &= f[:, at.S_DISTANCE] <= np.maximum(-f[:, at.S_RATE] * SAME_TIME, f[:, at.S_NOISE])
        near |= closed
        near[hits] = True
        sites = np.flatnonzero(near).tolist()
        self._accelerations(t)
        before = scene.phase.copy()
        omega, u = scene.impact(t, self.q, self.v, sites)
        if not (np.isfinite(omega).all() and np.isfinite(u).all()):
            self.ended.stop(
                Status.NOT_FINITE, f"{Status.NOT_FINITE.value} in the impact at t = {t:g} s"
            )
            return
        rows, rest = self._impact_rows(t, sites, u, jammed)
        bilateral = len(u) - sum(row.size for row in rows)
        solved = impacts.impulses(omega, u, bilateral, rows)
        size = float(np.abs(solved.impulse) @ np.abs(u))
        if solved.gain > 1e-9 * size and any(row.back for row in rows):
            self.tally["bounces_left_out"] += 1
            self.ended.notices.append(
                f"t = {t:.6g} s: Newton's restitution with friction would raise the energy by "
                f"{solved.gain:.3g} J; this impact does not bounce"
            )
            rows = [row._replace(back=0.0) for row in rows]
            solved = impacts.impulses(omega, u, bilateral, rows)
        if solved.missed > 1e-9:
            self.ended.notices.append(
                f"t = {t:.6g} s: impulses of an impact are good to {solved.missed:.3g} only"
            )
        scene.strike(solved.impulse, self.v)
        self.steps.ledger[at.DISSIPATED] -= solved.gain
        self.tally["impacts"] += 1
        self._after_impact(t, sites, rows, u, solved, before, rest)

    def _impact_rows(
        self, t: float, sites: list[int], u: Array, jammed: int
    ) -> tuple[list[impacts.Row], dict[int, float]]:
        """The rows of all sites, and when the bounces of those end that come to rest now."""
        scene, f = self.scene, self.scene.sites_f
        sizes = [1 if scene.sites_i[s, at.S_LIMIT] else 3 for s in sites]
        first = len(u) - sum(sizes)
        rows, rest = [], {}
        tiny = 1e-13 * float(np.max(np.abs(u)))
        for s, size in zip(sites, sizes):
            site = scene.sites[s]
            back = site.restitution * min(u[first], 0.0) if u[first] < -tiny else 0.0
            fall = -f[s, at.S_ACC_N]
            if back < 0 and fall > 0:
                hidden = f[s, at.S_NOISE] > -back * UNRESOLVED
                if (hidden or -2 * back < SHORTEST * fall) and site.restitution < 1:
                    rest[s] = t - 2 * back / (fall * (1 - site.restitution))
                    back = 0.0
            rows.append(impacts.Row(first, size, site.friction, back, s == jammed))
            first += size
        return rows, rest

    def _after_impact(
        self,
        t: float,
        sites: list[int],
        rows: list[impacts.Row],
        u: Array,
        solved: impacts.Solution,
        before: Ints,
        rest: dict[int, float],
    ) -> None:
        """Phases from the velocities after an impact; points that bounce stay in swing."""
        scene = self.scene
        tiny = 1e-12 * float(np.max(np.abs(u)))
        self._observe_still(t)
        for s, row in zip(sites, rows):
            speed, pushed = -u[row.first], solved.impulse[row.first] > 0
            unit = "rad/s" if self._turns(s) else "m/s"
            hit = f"hit at {speed:.6g} {unit}"
            away = solved.velocity[row.first]
            if away > max(tiny, scene.sites_f[s, at.S_NOISE] / UNRESOLVED):
                self._set(s, at.SWING)
                self._resting[s] = False
                scene.sites_i[s, at.S_FRESH] = 2
                if before[s] == at.SWING and pushed:
                    self._log(t, s, at.SWING, f"{hit} and bounced at {away:.6g} {unit}")
                else:
                    self.causes[s] = "thrown off by an impact elsewhere"
                continue
            if before[s] == at.SWING:
                self.causes[s] = hit
                if s in rest:
                    self.causes[s] = f"came to rest; its last bounces, from t = {t:.9g} s, left out"
                    self._ends[s] = rest[s]
                self._close(s, at.ACCEPTANCE)
            else:
                self._close(s, int(before[s]) if before[s] != at.STANCE else at.SLIP)
                self.causes.setdefault(s, "an impact elsewhere")

    def _turns(self, s: int) -> bool:
        """Whether a site is the limit of a turning joint."""
        if not self.scene.sites_i[s, at.S_LIMIT]:
            return False
        row = self.scene.blocks.blocks_i[self.scene.sites_i[s, at.S_SLIDE], at.B_A]
        return bool(self.mech.packed.system.rows[row, at.KIND] == at.ROTATE)

    def _observe_still(self, t: float) -> None:
        """Gaps and rates after an impact, before phases are chosen: everything open."""
        phase = self.scene.phase.copy()
        self.scene.sites_i[:, at.S_PHASE] = at.SWING
        self._observe(t)
        self.scene.sites_i[:, at.S_PHASE] = phase

    def _painleve(self, t: float, s: int) -> None:
        """Sliding has no finite force, or two: an impulse ends the slip, or the point lifts off."""
        site = self.scene.sites[s]
        before = int(self.scene.phase[s])
        self._set(s, at.SWING)
        self._observe(t)
        self._accelerations(t)
        if self.scene.sites_f[s, at.S_ACC_N] >= 0:
            text = "Painlevé's case: sliding and leaving both fit; it leaves"
            self.causes[s] = text
        else:
            text = "Painlevé's case: no force of sliding fits; an impulse ended its slip"
            self.scene.sites_i[s, at.S_PHASE] = before
            self.scene.arrange()
            self._impact(t, [], jammed=s)
            self.causes[s] = text
        self.ended.notices.append(f"t = {t:.6g} s: contact '{site.name}': {text}")

    # -- the record ------------------------------------------------------------------------------

    def record(
        self, soft: ContactRecord, states: tuple[Array, Array, Array], rows: Any
    ) -> ContactRecord:
        """Forces, gaps and slips of each point and of each contact pair over states (q, v, v')."""
        mech, n = self.mech, len(states[0])
        frames, codes = self.scene.frames[rows], self.scene.frame_phases[rows]
        still = np.zeros((n, mech.nb, 6))
        origins = bodies_over(mech.packed.system, *states, still).pose[..., :3]
        found = {name: dict(getattr(soft, name)) for name in ("force", "gap", "slip", "limit")}
        normal: dict[str, Array] = {}
        phase: dict[str, Any] = {}
        wrench = still + soft.wrench if soft.wrench.size else still
        for s, site in enumerate(self.scene.sites):
            frame, code = frames[:, s], codes[:, s]
            push, gap = frame[:, at.F_PUSH].copy(), frame[:, at.F_GAP].copy()
            if site.limit is not None:
                found["limit"][site.name] = site.limit.sign * push
                found["gap"][site.name] = gap
                phase[site.name] = np.array((FREE, "", "", STOP))[code]
                continue
            b = mech.topology.number(site.body) - 1
            force = frame[:, at.F_FORCE : at.F_FORCE + 3]
            arm = frame[:, at.F_PLACE : at.F_PLACE + 3] - origins[:, b]
            own = np.concatenate((np.cross(arm, force), force), axis=1)
            slip = np.linalg.norm(frame[:, at.F_SLIP : at.F_SLIP + 3], axis=1)
            slip[code == at.SWING] = 0.0
            wrench[:, b] += own
            phase[site.name] = np.array(PHASES)[code]
            for name in dict.fromkeys((site.name, site.touch)):
                found["force"][name] = found["force"].get(name, 0.0) + own
                normal[name] = normal.get(name, 0.0) + push
                found["gap"][name] = np.minimum(found["gap"].get(name, np.inf), gap)
                found["slip"][name] = np.maximum(found["slip"].get(name, 0.0), slip)
        return ContactRecord(
            **found, wrench=wrench, normal=normal, phases=phase, events=tuple(self.ended.log)
        )
