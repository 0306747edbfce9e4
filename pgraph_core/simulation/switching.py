"""The constraints that are active in a run, which times and conditions switch."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.assembly import NOTABLE
from ..analysis.singular import Instant, Stretch, nulls_of, redundancy, unequal
from ..analysis.sticking import Stuck
from ..engine import layout as at
from ..engine import motion
from ..errors import InputError
from ..result import Result, Status
from ..tolerances import ROUNDING
from .running import Running
from .switches import Change, closed, hold_here, switched_by

if TYPE_CHECKING:
    from .monitors import Monitor


MOST_MET = 1000  # conditions that become true while no time passes: more have no end


class Switching:
    """The active constraints of a run and the changes that are still to come."""

    first: Instant | None = None  # the first state with the active constraints

    def __init__(self, record: Running):
        """Begin with the constraints and the changes of the plan of `record`."""
        self.record = record
        record.held = set(record.plan.active.tolist())
        self.since: dict[int, float] = {}  # when constraints were switched last [s]
        self._ahead = deque(record.plan.changes)
        self._samples = deque[float](record.plan.samples[1:].tolist())
        self.acted: set[int] = set()  # conditions that have switched a constraint
        self._undone: set[int] = set()  # those that did so again where it was switched back
        # [s]: for a motion from rest, the rounding of its position is that of time squared
        self._near = float(np.sqrt(ROUNDING) * np.ptp(record.plan.times))
        self._met, self._met_since = 0, -np.inf  # conditions met since then within that time
        self._together: list[int] = []  # conditions met at the time of the next change, after it
        self._redundant = False  # whether constraints are redundant in the first state
        self._stretches: list[Stretch] = []  # to be searched for singular positions
        self._stuck: list[Stuck] = []  # states in which joints stick by dry friction
        self._looked_at = 0  # frames at which this was looked for

    def begin(self) -> None:
        """Note the first state, with a warning if constraints are redundant there."""
        record = self.record
        self._set_first(record.start)
        if notice := redundancy(record.scene):
            self._redundant = nulls_of(record.mech, record.active, record.start, record.q) > 0
            notice = notice if self._redundant else unequal(record.mech, record.active)
            record.ended.notices += [notice] if notice else []

    def _next(self) -> float:
        """Return the time of the next change or sample, or else the end [s]."""
        due = [change.t for change in self._ahead][:1] + [*self._samples][:1]
        return min(due, default=float(self.record.plan.times[-1]))

    def stop_at_next(self) -> None:
        """Set the loop to stop at the next change or sample, or at the end."""
        times = self.record.plan.times
        self.record.steps.end_at(int(np.searchsorted(times, self._next())) + 1)

    def apply_next(self) -> bool:
        """Apply the next change, and take the sample at its time, or the next sample.

        Returns False if there is none, or if the run ends.
        """
        if not (self._ahead or self._samples):
            return False
        t = self._next()
        if sampled := bool(self._samples) and self._samples[0] == t:
            self._samples.popleft()
        if changes := bool(self._ahead) and self._ahead[0].t == t:
            if not self._apply(self._ahead.popleft()):
                return False
            together, self._together = self._together, []
            self.switch_where_true(t, together)
        if sampled:
            self.record.take_sample(t)
            if not changes:
                self.record.steps.restart()
                self.stop_at_next()
        return True

    def meet(self, t: float, conditions: Sequence[int]) -> None:
        """Switch what `conditions` switch at t, after a change that is due at that time."""
        self._note_met(t, conditions[0])
        if self._ahead and self._ahead[0].t == t:
            self._together = list(conditions)
        else:
            self.switch_where_true(t, conditions)

    def switch_where_true(self, t: float, conditions: Sequence[int]) -> None:
        """Switch constraints whose conditions have become true, including dependent switches."""
        record, left = self.record, list(conditions)
        waiting = record.plan.conditions
        while left and not record.ended.over:
            given = waiting[number := left.pop(0)]
            acted = number in self.acted
            if (given.constraint in record.held) == given.active or (acted and given.when.once):
                continue
            if acted and given.when.constraint is None:
                self._note_undone(t, number)
            self.acted.add(number)
            on, off = ([given.constraint], []) if given.active else ([], [given.constraint])
            by = record.watch.monitors[number] if record.watch is not None else None
            if not self._apply(switched_by(record.held, on, off, t), by=by):
                return
            left += [
                i for i, other in enumerate(waiting)
                if other.when.constraint is not None and not other.when.after
                and other.place == given.constraint
                and other.when.active == given.active
            ]  # fmt: skip
        self.heed()

    def heed(self) -> None:
        """Watch the conditions that have something to switch.

        A constraint may hold the motion at the threshold of the condition that has switched it on,
        where rounding decides about the side.
        """
        record, watch = self.record, self.record.watch
        if watch is None:
            return
        for number, given in enumerate(record.plan.conditions):
            met = (given.constraint in record.held) == given.active
            spent = given.when.once and number in self.acted
            watch.heed(number, not (met or spent))

    def _note_met(self, t: float, number: int) -> None:
        """End the run if conditions become true again and again while no time passes."""
        record = self.record
        self._met = self._met + 1 if t - self._met_since <= self._near else 0
        self._met_since = self._met_since if self._met else t
        if self._met > MOST_MET:
            given = record.plan.conditions[number]
            name = record.mech.model.constraints[given.constraint].name
            record.ended.stop(
                Status.CHATTER,
                f"the condition {given.when} of '{name}' is met {MOST_MET} times from t = "
                f"{self._met_since:.6g} s to {t:.6g} s: what it switches leads back to its "
                "threshold; give it once=True, or two conditions with different thresholds",
            )

    def _note_undone(self, t: float, number: int) -> None:
        """Add a notice if a condition acts again where its constraint was switched back.

        A motion from rest leaves the rounding of its position after the root of it, in time.
        """
        record, given = self.record, self.record.plan.conditions[number]
        if number in self._undone or t - self.since[given.constraint] > self._near:
            return
        self._undone.add(number)
        name = record.mech.model.constraints[given.constraint].name
        record.ended.notices.append(
            f"at t = {t:.6g} s '{name}' is switched {'on' if given.active else 'off'} again as "
            f"soon as it was switched {'off' if given.active else 'on'}: the motion is at the "
            f"threshold of its condition {given.when}, where rounding decides; give the condition "
            "once=True, or a threshold that the motion has left"
        )

    def _apply(self, change: Change, *, by: Monitor | None = None) -> bool:
        """Apply a change between two steps. Returns False if the run ends.

        If `by` is not given, the last frame has this time and is recorded again.
        """
        record = self.record
        mech, scene, steps = record.mech, record.scene, record.steps
        change = switched_by(record.held, change.on.tolist(), change.off.tolist(), change.t)
        carried, late, places = steps.carried, None, scene.blocks.blocks_f
        if carried is not None and by is not None and len(record.q) > mech.nq:
            carried.stop(
                record, "a condition switches a constraint in combination with control states"
            )
            carried = None
        if carried is not None:
            late = None if by is None else carried.lateness(record, change.t, by)
            places = places[:, : at.PULL].copy()
        self._end_stretch()
        self.since |= dict.fromkeys([*change.on.tolist(), *change.off.tolist()], change.t)
        before, booked = self._energy(), steps.ledger.copy()
        old = record.q.copy(), record.v.copy()
        try:
            hold_here(scene, change, record.q)
            scene.switch(change.active)
            if record.events is not None:
                record.events.impulse(change.t)
            moved = closed(mech, scene, change, record.q, record.v, steps.ledger)
            steps.note_switch(change.t, old[1])
        except InputError as refused:
            record.ended.refuse(refused)
            return False
        if carried is not None:
            carried.keep_late([*change.on.tolist(), *change.off.tolist()], late)
            now = scene.blocks.blocks_f[:, : at.PULL]
            if np.array_equal(places, now, equal_nan=True):
                carried.switch(record, change.t, old, late)
            else:
                carried.stop(
                    record,
                    "a constraint holds bodies in a position that depends on the parameters",
                )
        work, lost = steps.ledger - booked
        gain = self._energy() - before - work + lost  # by moving joints onto the constraints
        steps.ledger[at.WORK_DONE if gain > 0 else at.DISSIPATED] += abs(gain)
        from .contact_log import switched

        record.ended.log += switched(mech, change, float(work), float(lost))
        if moved > NOTABLE:
            text = f"joints were moved by up to {moved:.3g} to meet the constraints switched on"
            record.ended.notices.append(f"at t = {change.t:g} s {text}")
        record.held = set(change.active.tolist())
        if by is None:
            steps.restart()
            self.stop_at_next()
        else:
            steps.go_on()
            steps.factor_again()
        steps.search_again()
        self.heed()
        self._set_first(change.t)
        return record.ended.ok

    def apply_now(self, change: Change) -> None:
        """Apply a change at the present state. Raises InputError if it cannot be satisfied."""
        record = self.record
        hold_here(record.scene, change, record.q)
        record.scene.switch(change.active)
        steps, old = record.steps, record.v.copy()
        closed(record.mech, record.scene, change, record.q, record.v, steps.ledger)
        steps.note_switch(float(steps.clock["time"]), old)
        steps.anew()

    def _energy(self) -> float:
        record = self.record
        return float(sum(motion.energy(record.scene.address, record.q, record.v)))

    # -- singular positions ------------------------------------------------------------------------

    def _set_first(self, t: float) -> None:
        self.first = t, self.record.q.copy(), self.record.v.copy()

    def _end_stretch(self) -> None:
        """Keep what a search for singular positions since the last switch needs."""
        record = self.record
        if self.first is None or not record.steps.recorded:
            return
        last = record.steps.recorded - 1
        end = float(record.steps.times[last]), record.out.q[last], record.out.v[last]
        found = Stretch.of(record.scene, record.active, self.first, end, self._redundant)
        self._stretches += [found] if found else []
        self._redundant = False
        self._keep_stuck(last + 1)

    def _keep_stuck(self, end: int) -> None:
        """Keep a state since the last switch in which joints stick, in time stepping."""
        record, tables = self.record, self.record.plan.contacts
        begin, self._looked_at = self._looked_at, end
        if tables is None or not tables.frictions or not record.plan.method.time_stepping:
            return
        blocks, _, terms, factors = tables.friction_blocks
        frictions = np.zeros((len(blocks), record.mech.nv))
        for i, block in enumerate(blocks.tolist()):
            own = slice(block[at.B_TERM], block[at.B_TERM] + block[at.B_TERMS])
            frictions[i, terms[own, 0]] = factors[own]
        frames = slice(begin, end)
        q, v = record.out.q[frames, : record.mech.nq], record.out.v[frames, : record.mech.nv]
        gravity = float(np.linalg.norm(record.mech.model.gravity))
        found = Stuck.of(record.active, record.steps.times[frames], q, v, frictions, gravity)
        self._stuck += [found] if found else []

    def add_singular(self, result: Result) -> None:
        """Let `result` search for singular positions when its notices are read."""
        self._end_stretch()
        if self._stretches or self._stuck:
            kept = (*self._stretches, *self._stuck[:1])
            found = partial(_singular, self.record.mech, kept)
            result.add_when_read(found)


def _singular(mech: Any, stretches: tuple[Stretch | Stuck, ...]) -> tuple[str, ...]:
    """Return notices about singular configurations and stuck loops of a run."""
    return tuple(text for part in stretches if (text := part.notice(mech)))
