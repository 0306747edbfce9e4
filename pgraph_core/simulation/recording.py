"""A run in progress: compiled steps in chunks, events, and recorded frames."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.assembly import NOTABLE, assembled
from ..dynamics.arguments import UserTorque, acting, finite
from ..dynamics.scene import Scene, empty_frames
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import Frames
from ..engine.compiler.address import address_of
from ..engine.records import PHASE_CHANGE, SWING, table
from ..errors import InputError
from ..interrupts import Deferred
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.constraints import NO_BLOCKS
from ..result import Status
from ..result.records import Memory
from ..tolerances import EPS
from .conditions import Condition, limits_of
from .continuing import left_by, recall
from .failures import failure, trouble
from .loop import Outcome, Steps, Workplace, free, links_of, paced, taken
from .monitors import room_for
from .options import Progress
from .remarks import remarks, remembering
from .run_plan import RunPlan
from .running import Running
from .sampling import Sampled
from .switching import Switching

if TYPE_CHECKING:
    from .monitors import Monitor, Watch

KEPT_NUMBERS = 32_768  # numbers in the frames of a run, for which a mechanism keeps room
FIRST = 16384  # freedoms in the first chunk, times steps: a few milliseconds
NO_CHANGES = table(PHASE_CHANGE, 0)
WATCHING = "the method that detects contacts"


class Recording(Running):
    """A run that is stepped and recorded."""

    progress: Progress = None
    watch: Watch | None = None  # conditions of switches, then a user's events
    _last: Monitor | None = None  # the terminal event that ended the run
    _crawls = ""  # the warning that the run would take very many steps
    carried: Any = None  # a `sensitivity.Carried`, which computes derivatives
    memory: Memory | None = None  # the memory of a run that has ended
    calls_python = False  # whether steps call functions of the user that are not compiled
    uninterrupted: type[AbstractContextManager[Any]] = nullcontext  # Deferred if they do

    def __init__(
        self, mech: Mechanism, plan: RunPlan, q: Array, v: Array, tau: Any,
        monitors: Sequence[Monitor] = (), coarser: Recording | None = None,
        place: Workplace | None = None,
    ):  # fmt: skip
        """Set up without computing anything yet. Raises InputError if `tau` is invalid.

        `coarser` is a run of the same motion, whose error is estimated with this one. `place` is
        that of a run by this plan, which is over.
        """
        self.coarser = coarser
        self.mech, self.plan, self.tau = mech, plan, tau
        self.planned = plan  # the initial plan, with the recorded frames
        self.given = (q.copy(), v.copy()) if coarser is None else coarser.given  # not assembled
        self.size = len(q), len(v)  # with the states of controls
        self.start = float(plan.times[0])  # [s]
        if len(plan.samples):
            self.sampled = Sampled(tau, goes_on=plan.memory is not None)
        elif tau is not None:
            self.user = acting(tau, mech.nq, mech.nv, max(len(q), len(v)))
            if self.user is not None and plan.driving:
                self.user.keep_most()
        self.ended = Outcome()
        self.switching = Switching(self)
        self._events = monitors
        self._prepare(q, v, place)
        self._changes = [NO_CHANGES]  # changes of contact phases logged by the kernels
        self.unlogged = 0  # changes that there was no room for

    def _prepare(self, q: Array, v: Array, left: Workplace | None = None) -> None:
        """Build the scene, frames and stepping loop for the plan, at (q, v)."""
        plan, before, (nq, nv) = self.plan, self.coarser, self.size
        size = len(plan.times) * (nq + 2 * nv + 6 * (1 + len(plan.ever)))
        alone = (
            self.user is not None
            or self.sampled is not None
            or self._events
            or (before is not None and not before.reused)
        )
        # whether other frames may come into these arrays
        self.reused = plan.reusable and not alone and size <= KEPT_NUMBERS
        if self.reused and before is None:
            left = left or taken(self.mech, plan)
        elif self.reused and before is not None and before.steps.finer is not None:
            left = before.steps.finer  # loop in the scene of the coarser run
            left = left if left.steps.plan is plan else None
        if left is not None:
            self.scene, self.steps, self.out, self.watch = left
            if self.watch is not None:
                self.watch.follow(self)
            if len(plan.active):
                self.scene.forget(plan.active)
            self.steps.begin_again(q, v)
        else:
            self.watch = self._watching()
            self.scene = self._scene() if before is None else self._scene_of_finer(before)
            self.out = self._empty_frames(len(plan.times))
        self._arrays = tuple(self.out)  # arguments of kernels
        if self.user is None:
            tau = self.tau if self.sampled is None else None
            own, of = self.mech.nv, self.mech.packed
            self.scene.given[:own] = 0.0 if tau is None else finite("tau", tau, own, of=of)
        if left is None:
            self.steps = Steps(plan, q, v, self._arrays)
        self.q, self.v = self.steps.q, self.steps.v
        if left is None:
            self._join()
        if plan.stops:
            self.switching.stop_at_next()

    def _scene_of_finer(self, before: Recording) -> Scene:
        """Return the scene of the original run, unless it remembers or has friction to refine."""
        alone = before.user is not self.user or before.scene.remembers or before.scene.rubs
        return self._scene() if alone else before.scene

    def leave(self) -> None:
        """Finish the run and release its workspace for the next run of this kind."""
        if self.reused and not self.ended.log:
            place = Workplace(self.scene, self.steps, self.out, self.watch)
            if self.coarser is None:
                free(self.mech, self.plan).append(place)
            else:
                self.coarser.steps.finer = place
        elif self.coarser is None and self.steps.clearance is not None and not self.met:
            free(self.mech, (self.plan, WATCHING)).append(self.steps.clearance)

    def _empty_frames(self, n: int) -> Frames:
        nb = self.mech.nb if self.plan.contacts else 0
        blocks, touches = len(self.scene.active) - 1, self.plan.touches
        means = self.plan.method.time_stepping and self.scene.touching is not None
        return empty_frames(n, self.size, blocks, nb, touches, means=means)

    def _scene(self) -> Scene:
        watched = len(self.watch.monitors) if self.watch else 0
        return scene_of(self.mech, self.plan, self.user, watched)

    def _join(self) -> None:
        """Connect the scene to the stepping loop, with its monitors and event handling."""
        plan, points, watch = self.plan, bool(self.plan.contact_points), self.watch
        if len(plan.ever) > len(self.held):
            self.scene.switch(self.active)
        steps, held = self.steps, bool(len(plan.ever)) or plan.contacts is not None
        woken = watch.wake(plan.conditions) if watch is not None and plan.way is None else []
        called = watch is not None and len(watch.called) > 0
        self.calls_python = called or (self.user is not None and self.user.interpreted)
        self.uninterrupted = Deferred if self.calls_python else nullcontext
        if self.coarser is not None:
            steps.solve_tighter()
            self.scene.solve_tighter()
        links = links_of(plan.method.name, points, watch is not None, held)
        wanted: Any = () if watch is None else (watch.wanted, watch.address)
        conditions = limits_of(self.mech, plan.conditions)
        tables = plan.declared if plan.way is not None else None
        if tables is not None or len(conditions):
            from .clearance import Clearance

            guard: Clearance | None = None
            if self.coarser is None and not self.met:
                guard = taken(self.mech, (plan, WATCHING))
            elif self.coarser is not None and not (self.met or self.coarser.met):
                guard = self.coarser.steps.clearance
            margin = max((c.margin for c in plan.conditions), default=0.0)
            guard = guard or Clearance(self.mech, tables, conditions, margin)
            steps.clearance = guard
            steps.guarded_by(address=guard.address)
            links = links._replace(watch=guard.look_back)
        if points or (plan.contacts and plan.contacts.compliant):
            from ..engine.contact.approach import bound_step

            steps.guarded_by(approach=address_of(bound_step))
        if not points:
            watched = room_for(0 if watch is None else len(watch.monitors))
            steps.join(self.scene.address, links, watched, *wanted)
            steps.forget_sides(woken)
            return
        from .contact_events import ContactEvents
        from .event_scene import EventScene

        assert isinstance(self.scene, EventScene)
        steps.join(self.scene.address, links, self.scene.watched, *wanted)
        steps.forget_sides(woken)
        fine = 1.0 if self.coarser is None else 0.5
        self.events = ContactEvents(self.mech, plan, self.scene, steps, self.ended, fine)
        self.events.noted = None if watch is None else self._user_event

    def _watching(self) -> Watch | None:
        """Return the monitor of switch conditions and user events, or None if there are none."""
        if not (self._events or self.plan.conditions):
            return None
        from .monitors import Watch

        waiting = [Condition(given, self) for given in self.plan.conditions]
        return Watch(waiting, self._events, *self.size)

    # -- the run ---------------------------------------------------------------------------------

    def run(self, progress: Progress = None) -> None:
        """Record all frames, or stop if the run fails or is cancelled."""
        self.progress, self.whole = progress, True
        if self.begin():
            self.advance_to_end(progress)
        if not self.steps.recorded:
            out = self.out
            out.q[0], out.v[0], out.vdot[0] = self.q, self.v, np.nan
            out.energies[0, :2] = motion.energy(self.scene.address, self.q, self.v)
            self.steps.count_frames(1)
        elif self.ended.status is Status.DONE:
            self.ended.notices += remarks(self)
        if self.coarser is None:
            self.memory = left_by(self)

    def repeated(self, plan: RunPlan) -> Recording:
        """Return a run of the same motion by another plan, as far as it comes, without warnings."""
        other = Recording(self.mech, plan, *self.began, self.tau)
        other.progress = lambda _: None
        if other.begin():
            other.advance_to_end(None)
        return other

    def advance_to_end(self, progress: Progress) -> None:
        """Record all remaining frames."""
        budget = max(64, FIRST // max(self.mech.nv, 1))
        if progress is not None or self.calls_python:
            budget = 1
        while True:
            began = time.perf_counter()
            code = self._advance(budget)
            if self.watch is not None and self.watch.error is not None:
                raise self.watch.error
            chatter = self.ended.status is Status.CHATTER and self.events is None
            if self.ended.status is Status.STOPPED or chatter:
                self._last_frame()
                if self.carried is not None and self._last is not None:
                    self.carried.end_at(self, self._last)
                return
            if code == at.DONE:
                if not self.switching.apply_next():
                    return
                continue
            if code == at.NEAR:
                if not self._come_near():
                    return
                continue
            if code != at.RUNNING:
                self.fail(code)
                return
            self._note_crawl()
            budget = paced(budget, time.perf_counter() - began)
            if progress is not None and _stops(progress(self.steps.fraction())):
                t = self.steps.times[self.steps.recorded - 1]
                text = f"{Status.CANCELLED.value}; kept up to t = {t:.6g} s"
                self.ended.stop(Status.CANCELLED, text)
                return

    def _note_crawl(self) -> None:
        """Tell of a run that would take very many steps, once, and immediately if nobody follows
        its progress."""
        if self.coarser is None and not self._crawls and (text := self.steps.crawl()):
            text = next(remembering(self.user, False), text)
            self._crawls = text
            self.ended.notices.append(text)
            if self.progress is None:
                warnings.warn(text, stacklevel=2)

    def fail(self, code: int) -> None:
        """End the run with a kernel's status code. Re-raises exceptions from a user's function."""
        if self.ended.ok:
            self.ended.stop(*failure(self, code))
        self._raise_user_error()

    def begin(self) -> bool:
        """Check whether the run can start: joints have inertia and constraints can be met."""
        mech, plan, first = self.mech, self.plan, self.coarser is None
        touched = plan.memory is not None and recall(self, plan.memory)
        if first and len(plan.active) and plan.project:
            try:
                self.q[:], self.v[:], report = assembled(
                    mech, self.q, self.v, plan.active, self.scene, self.start
                )
            except InputError as refused:
                self.ended.refuse(refused)
                return False
            if report.notable:
                self.ended.notices.append(f"at the start {report}")
        if first and self.size != (mech.nq, mech.nv):
            near = 4.0 * EPS * abs(self.start)
            self.scene.begin_controls(self.start, near, self.q, self.v)
            if plan.states is not None:  # a sample at the start has been taken
                known = ~np.isnan(plan.states)
                self.v[mech.nv :][known] = plan.states[known]
        self.began = self.q.copy(), self.v.copy()
        if self.sampled is not None:
            self.take_sample(self.start)
        with self.uninterrupted():
            code = self._first_evaluation() if first or self.scene.remembers else 0
        if code and self.user is not None:
            self._raise_user_error()
        if code > 0:
            raise InputError(mech.packed.singular(code))
        elif code < 0:
            text = f"{Status.NOT_FINITE.value} at t = {self.start:g} s{trouble(self, self.start)}"
            self.ended.stop(Status.NOT_FINITE, text)
        elif first and len(plan.active):
            self.switching.begin()
        if self.events is not None and self.ended.ok:
            self.events.begin(self.start)
        stepped = self.events is None and plan.method.time_stepping and len(plan.times) > 1
        stepped = stepped and not touched
        if self.watch is not None and self.ended.ok:
            if stepped and any(given.reads_force for given in plan.conditions):
                self._rehearse()
            self._begin_watching(self.watch)
        if plan.contacts is not None or plan.contact_points:
            self._hold_touches(touched)
            self.bound()
        if touched and self.scene.touching is not None:
            self._changes = [self.scene.touching.begin_log(self.start)]
        if stepped and self.user is None:
            self._rehearse()
        if self.carried is not None and self.ended.ok:
            self.carried.join(self, self.given)
        return self.ended.ok

    def take_sample(self, t: float) -> None:
        """Call the held torque function at t and at the present state. Raises InputError."""
        assert self.sampled is not None
        nq, nv = self.mech.nq, self.mech.nv
        self.scene.given[:nv] = self.sampled.at(t, self.q[:nq], self.v[:nv])

    def _rehearse(self) -> None:
        """Compute the forces of the first step of time stepping, for frame 0 and conditions."""
        if self.scene.touching is not None and self.ended.ok:
            held = self.scene.blocks.blocks_f[:, at.HELD]  # first guesses of frictions
            before = held.copy()
            self.steps.rehearse(self.scene.touching.tally_table, self.scene.touching.pairs)
            held[:] = before

    def _begin_watching(self, watch: Watch) -> None:
        """Check events at the start, and switch constraints whose conditions are already true."""
        margins = watch.begin(self.start, self.q, self.v)
        self.switching.heed()
        if self.plan.memory is not None:  # conditions that are true have acted
            return
        if max(margins[: watch.waiting], default=-1.0) < 0.0:
            return
        start = self.start, self.q, self.v
        ahead = self._ahead_of_start() if 0.0 in margins[: watch.waiting] else start
        already = [
            i for i, x in enumerate(margins[: watch.waiting])
            if x > 0.0 or (x == 0.0 and watch.monitors[i](*ahead) > 0.0)
        ]  # fmt: skip
        for i in already:
            name = self.mech.model.constraints[self.plan.conditions[i].constraint].name
            text = f"'{name}' is switched at the start: {watch.monitors[i].name} is true already"
            self.ended.notices.append(text)
        self.switching.switch_where_true(self.start, already)

    def _ahead_of_start(self) -> tuple[float, Array, Array]:
        """Compute (t, q, v) shortly after the start, to determine the sign of a margin."""
        h, vdot = NOTABLE * (float(self.planned.times[-1]) - self.start), np.zeros(self.size[1])
        self._first_evaluation(vdot)
        q, v = self.q.copy(), self.v + h * vdot
        motion.move(self.scene.packed.rows, q, self.v + 0.5 * h * vdot, h)
        return self.start + h, q, v

    def _first_evaluation(self, vdot: Array | None = None) -> int:
        """Return 0, or -1 if v' is not finite at the start, or the first row without inertia.

        v' is written into `vdot`.
        """
        return motion.constrained_dynamics(
            self.scene.address, self.scene.accelerate, self.start, *self.began,
            self.scene.given, np.zeros(3), np.empty(self.size[1]) if vdot is None else vdot,
            np.empty_like(self.out.wrenches[0]),
        )  # fmt: skip

    def _advance(self, budget: int) -> int:
        """Take at most `budget` steps and frames. Returns the kernel's status code."""
        with self.uninterrupted():
            code = (self.events or self.steps).advance(budget)
        if code == at.EVENT and self.events is None:
            self._user_event(float(self.steps.clock["time"]))
            self.steps.go_on()
            code = at.RUNNING
        touching = self.scene.touching
        if touching is not None:  # keep the logged changes of phases, make room for more
            count = int(touching.tally["logged"])
            self._changes.append(touching.changes[:count].copy())
            self.unlogged += max(count - len(touching.changes), 0)
            touching.tally["logged"] = 0
        return code

    def _user_event(self, t: float) -> None:
        """Log user events at t, and end the run if one is terminal."""
        watch = self.watch
        assert watch is not None
        fired = watch.fired(self.steps.watched)
        if fired and fired[0] < watch.waiting:
            self.switching.meet(t, [i for i in fired if i < watch.waiting])
        nq, nv = self.mech.nq, self.mech.nv
        self._last = watch.note(t, fired, self.q[:nq], self.v[:nv])
        if self._last is not None:
            text = f"{Status.STOPPED.value} at t = {t:.9g} s: {self._last.name}"
            self.ended.stop(Status.STOPPED, text)

    def _last_frame(self) -> None:
        """Record the current state as the last frame."""
        steps, t = self.steps, float(self.steps.clock["time"])
        # the step from which the event led back may have changed phases after t
        self._changes = [rows[rows["when"] <= t] for rows in self._changes]
        i = steps.recorded
        if i and steps.times[i - 1] == t:
            return
        steps.times[i] = t
        steps.end_at(i + 1)
        steps.forget_event()
        steps.advance(1)

    def _raise_user_error(self) -> None:
        if self.user is not None and self.user.error is not None:
            raise self.user.error

    # -- where something comes near ---------------------------------------------------------------

    def _come_near(self) -> bool:
        """Continue with contacts. Returns False if the run ends. Raises InputError."""
        plan, t, done = self.plan, float(self.steps.clock["time"]), self.steps.recorded
        assert plan.way is not None
        refused = plan.way.refused
        if refused is not None and (t == self.start or refused.problems[0].where == "simulate"):
            raise refused  # a method that takes no contacts at all, or none as at the start
        if t == self.start:
            self.plan = self.planned = plan.touching
            self.ended, self.switching = Outcome(), Switching(self)
            if self.carried is not None:
                self.carried.take_plan(self.plan)
            again = self.given if self.coarser is None else self.began  # begin() tells of moves
            q, v = (x.copy() for x in again)
            self._prepare(q, v)
            return self.begin()
        if refused is not None:
            text = f"t = {t:.6g} s: bodies come close, and the run continues with"
            self.ended.notices.append(f"{text} '{plan.way.method.name}': {refused}")
        self.met = f"{plan.method.name} until bodies came close at t = {t:.6g} s"
        self.plan, self.reused, before = plan.onward(), False, self.steps.watched
        apart, self.scene, old = self.scene, self._scene(), self.out
        held = apart.blocks.blocks_f
        self.scene.blocks.blocks_f[: len(held)] = held  # places of switched constraints
        self.scene.given[:] = apart.given
        same = {name: getattr(old, name) for name in ("q", "v", "vdot", "energies", "drifts")}
        self.out = self._empty_frames(len(old.q))._replace(**same)
        for begin in range(0, self.out.wrenches.shape[2], motion.MEANS):
            kinds = slice(begin, begin + motion.MEANS)
            self.out.wrenches[:done, : old.wrenches.shape[1], kinds] = old.wrenches[:done]
        self._arrays, self.steps.clearance = tuple(self.out), None
        self.steps.go_another_way(self.plan, self.out)
        self._join()
        self.steps.watched[:, self.steps.watched.shape[1] - before.shape[1] :] = before
        if self.steps.carried is not None:
            self.steps.carried.go_on(self)
        if self.scene.touching is not None:
            self.scene.touching.pairs["phase"] = SWING  # no contact has occurred yet
            self.scene.touching.tally["elapsed"] = t - self.steps.times[max(done - 1, 0)]
            means = self.scene.blocks.blocks_f[:, at.MEAN_PULL : at.MEAN_PULL + motion.MEANS]
            means[: old.wrenches.shape[1]] = old.wrenches[max(done - 1, 0)]
            self._changes = [self.scene.touching.begin_log(self.start)]
        if self.events is not None:
            self.events.look_at(old.q[:done], old.v[:done], self.plan.times[:done])
            self.events.begin(t)
        self._hold_touches()
        self.bound()
        return self.ended.ok

    def _hold_touches(self, recalled: bool = False) -> None:
        """Let steps end where soft and penalty contacts touch, with what touches now.

        What the run before has kept is `recalled`, with the stretch of its friction springs.
        """
        if self.steps.links.cross and self.plan.yields:
            from ..engine.contact.contacts import begin_touches
            from ..engine.contact.touches import HOLDING

            assert self.scene.touching is not None
            self.scene.touching.tally["frozen"] = HOLDING
            if not recalled:
                begin_touches(self.scene.address, self.q, self.v)

    def bound(self) -> None:
        """Limit the next step by approaching bodies if contacts are compliant."""
        if self.steps.guard["approach"]:
            from ..engine.contact.approach import bound_step

            bound_step(self.steps.address, at.Y)

    # -- for a stepper ---------------------------------------------------------------------------

    def extend(self, times: Array, substeps: Ints, width: Array) -> None:
        """Record additional frames with these fixed steps, with the present state as frame 0."""
        header = {**self.plan.header, "t_start": float(times[0]), "t_end": float(times[-1])}
        self.plan = replace(self.plan, times=times, substeps=substeps, width=width, header=header)
        if len(times) > len(self.out.q):
            self.out = self._empty_frames(len(times))
            self._arrays = tuple(self.out)
        self.reused = True
        self.steps.extend(self.plan, self._arrays)
        self.ended.log, self.switching.first, self.unlogged = [], None, 0
        if (touching := self.scene.touching) is not None:
            self._changes = [touching.begin_log(float(times[0]))]

    def look(self) -> None:
        """Record the present state as frame 0."""
        steps = self.steps
        motion.record(
            self.scene.address, self.scene.accelerate, float(steps.clock["time"]),
            self.q, self.v, np.zeros(3), steps.ledger, 0, self._arrays,
        )  # fmt: skip
        self._raise_user_error()

    @property
    def changes(self) -> Any:
        """The PHASE_CHANGE records logged by the kernels, in chronological order."""
        return np.concatenate(self._changes)


def scene_of(
    mech: Mechanism, plan: RunPlan, user: UserTorque | None = None, watched: int = 0
) -> Scene:
    """Return the scene of a run with `watched` monitors."""
    acts: Any = {"contacts": plan.contacts, "user": user}
    if plan.contact_points:
        from .event_scene import EventScene

        frames = len(plan.times)
        return EventScene(
            mech, plan.drives, plan.loads, plan.ever, plan.contact_points, frames,
            watched=watched, **acts,
        )  # fmt: skip
    own = mech.packed.blocks
    if not (len(plan.ever) or plan.contacts):
        own = NO_BLOCKS
    elif len(own.blocks_f):  # may hold places that are known only when they are switched on
        own = own._replace(blocks_f=own.blocks_f.copy())
    acts |= {"gains": plan.gains, "blocks": own}
    return Scene(mech.packed, plan.drives, plan.loads, plan.ever, **acts)


def _stops(answer: Any) -> bool:
    """Check whether the answer of `progress` ends the run: false but not None."""
    return answer is not None and not answer
