"""Derivatives of a run by numbers of its model, its initial state and its inputs.

The primal run determines all steps. Each step is repeated with dual numbers from the same state,
with seven derivatives at a time. Everything after packing is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.lifted import MOST
from ..engine import layout as at
from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.compiler.dual import WIDTH
from ..engine.records import CONTACT_AHEAD
from ..engine.signals import AT_MOST, HELD_FROM, LESS, SIDE, values
from ..errors import InputError, Problem, percent
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.programs import edges_moved
from ..result import Result
from ..result.records import Derivatives
from ..result.result import read_only
from ..tolerances import EPS, NOTABLE, VISIBLE
from .corners import Corners
from .duals import Parts, RunOfDuals, State
from .options import Options
from .recorded import NO_ESTIMATE, result_of
from .recording import Recording, scene_of
from .remedies import more_accurate
from .run_plan import RunPlan
from .touch_times import Touch, Within, begun_at, touch_of
from .variables import CENTRAL, SHARE, Given, Slope, Slopes, Variable, refuse, variables_of

NO_TIMES = np.zeros(0)
ENDS = {
    1: "a contact is about to slip or to stick",
    2: "several impacts coincide, but not for neighbouring values",
    3: "an impact occurs at the start of a step, where its time has no derivatives yet",
    4: "shapes that touch already hit each other, at a time that has no derivatives",
    5: "contacts slide in different directions, and how they share their load is not determined",
    6: "a parameter changes the gap of bodies or of a limit that carry load from the start; begin "
    "with a gap, or leave the parameter out",
    7: "several impacts coincide, and their impulses depend on earlier ones; leave events out",
}

NO_CROSSING = "what ends the step jumps there without an impact, or touches its threshold"


class Lateness(NamedTuple):
    """The derivatives of an event time, and the rates of the state before the event."""

    times: Array
    rates: Array
    hits: bool = False  # the time is that of an impact


class Jump(NamedTuple):
    """A discontinuity of a force at the end of a step, and the derivatives of its time."""

    times: list[Array]  # (MOST,) of each run
    rates: Array  # change of the rates of the state at the jump, before minus after


def derivatives_of(record: Recording, options: Options, q: Any, v: Any, wrt: Any) -> Carried:
    """Return the derivatives of a recording that was begun with these arguments of `simulate`.

    Raises InputError for unknown parameters, and for a run that has no derivatives.
    """
    mech, plan = record.mech, record.plan
    alone = mech.packed.run is mech.packed  # the start of a control may depend on q and v
    kept = plan.__dict__.setdefault("_slopes", {}) if alone else None
    plan = replace(plan, start=record.given)
    given = Given(mech, options, plan, record.tau, q, v, wrt, kept)
    return Carried(given, variables_of(given, wrt))


class Carried:
    """The derivatives of a run in progress."""

    def __init__(self, given: Given, variables: Sequence[Variable]):
        """Raises InputError for a run that has no derivatives."""
        self.given, self.variables = given, variables
        self._ended: list[str] = []
        self._parts: Parts | None = None
        self._corners: Corners | None = None
        self._strayed = False
        self.slopes: list[Slope] = []
        self._beside: Given | None = None  # the run of which they are, if not of this one
        self._jump: Jump | None = None  # awaits the frames of the step that ended there
        self._touch: Touch | None = None  # with which the next step begins, after the same frames
        self._begins = False  # whether the derivatives of the state are those of that start
        self._within: Within | None = None  # the step that began there, until its frames are noted
        self._jumped: list[float] = []  # [s] discontinuities of the derivatives
        self._late: dict[int, Array] = {}  # derivatives of when constraints were switched last
        self._end: tuple[int, Lateness] | None = None  # the last frame, if it moves
        self._most = MOST
        self.out = np.zeros((0, 0, 0, WIDTH))  # empty until a run starts
        refuse(given)

    def join(self, record: Recording, start: tuple[Array, Array]) -> None:
        """Start computing derivatives at the beginning of a recording.

        `start` is the initial state before it was assembled. Raises InputError.
        """
        from ..engine.stepping import duals

        n = len(record.plan.times)
        if not self.slopes:
            slopes = Slopes(self.given)
            self.slopes = slopes.by(self.variables)
            self._beside = slopes.beside
        if record.steps.carried is not self:
            self._begun = self.given, self.variables, self.slopes, self._beside
        slopes, stepped = self.slopes, record.plan.contacts is not None
        most = self._most = MOST - stepped  # the last derivative is by the time of an impact there
        size = -(-len(slopes) // most)
        self.out = np.full((size, n, record.steps.stages.shape[1], WIDTH), np.nan)
        groups = [slopes[k : k + most] for k in range(0, len(slopes), most)]
        acting = record.scene
        if (beside := self._beside) is not None:
            acting = scene_of(beside.mech, beside.plan)
        self._runs = [RunOfDuals(record, acting, start, group) for group in groups]
        self._strayed |= any(run.strayed for run in self._runs)
        self._addresses = np.array([run.address for run in self._runs])
        self._step, self._note = map(address_of, (record.plan.method.of_duals, duals.note_duals))
        self._advance = address_of(_advance_run())
        self._kernel = duals.advance_with_duals
        if stepped:
            self._parts = Parts(record, self._runs)
            record.steps.guarded_by(carried=self._parts.address)
        record.steps.carried = self
        record.reused = False  # nobody else steps it
        corners = Corners(record)
        self._corners = corners if corners.laws else None
        self._record, self._aside = record, None
        self._refuse_moved_edges()

    def _refuse_moved_edges(self) -> None:
        """Raise InputError if a parameter changes the time of a jump at which no step ends."""
        for n, run in enumerate(self._runs):
            for k in edges_moved(run.code):
                path = self.variables[n * self._most + k].path
                text = (
                    "moves the time of a jump of an expression, which has no derivatives; give a "
                )
                text += "smoothstep, or a comparison of the motion"
                raise InputError(Problem("simulate", path, text))

    def advance(self, run: int, budget: int) -> int:
        """`advance_run`, with derivatives."""
        clock, times = self._record.steps.clock, self._record.steps.times
        if self._within is not None:
            later = np.searchsorted(times, self._within.end)
            if later > clock["frame"]:
                return self._advanced_within(run, min(budget, int(later - clock["frame"])))
            self._within = None
        if self._jump is not None or self._touch is not None:
            later = np.searchsorted(times, clock["time"], side="right")
            if later > clock["frame"]:
                return self._advanced(run, min(budget, int(later - clock["frame"])))
            if self._jump is not None:
                self._shift(self._jump.rates, self._jump.times)
            self._jump = None
        if self._touch is not None and not self._begins:
            self._shift(self._touch.rates, self._touch.times)
            self._begins = True
        before = int(self._record.steps.counters["steps"])
        code = self._advanced(run, 1 if self._begins else budget)
        if int(self._record.steps.counters["steps"]) > before:
            if self._touch is not None:
                self._end_of_touch(self._touch)
            if code == at.RUNNING:
                self._look_for_jump()
        return code

    def _shift(self, rates: Array, times: Sequence[Array]) -> None:
        """Move the derivatives of the state by those of a time, with these rates."""
        for one, late in zip(self._runs, times):
            one.shift(np.outer(rates, late))

    def _end_of_touch(self, touch: Touch) -> None:
        """Return to derivatives at a given time, after the step that began at a touch."""
        record = self._record
        self._touch, self._begins = None, False
        if record.steps.guard["fired"] == CONTACT_AHEAD:  # the step is taken back
            self._shift(-touch.rates, touch.times)
            return
        back, self._within = begun_at(touch, record, rates(record, record.steps.clock["time"]))
        self._shift(back, touch.times)

    def _advanced_within(self, run: int, budget: int) -> int:
        """Note frames within the step that began at a touch."""
        within = self._within
        assert within is not None
        record, first = self._record, int(self._record.steps.clock["frame"])
        code = self._advanced(run, budget)
        for i in range(first, int(record.steps.clock["frame"])):
            t, y = float(record.steps.times[i]), (record.out.q[i], record.out.v[i])
            share = (t - within.begin) / (within.end - within.begin)
            back = share * within.by_start - rates(record, t, state=y)
            for out, late in zip(self.out, within.times):
                out[i, :, 1:] += np.outer(back, late)
        return code

    def _look_for_jump(self) -> None:
        """Differentiate the time of a comparison that changed at the end of the last step.

        The difference in time causes a difference of the state, because the rates before and after
        the change differ.
        """
        record, nq = self._record, len(self._record.q)
        t, sliding = record.steps.clock["time"], record.steps.ends["slid"]
        if record.steps.links.cross == 0 or record.steps.carried is not self:
            return
        if sliding:
            self.stop(record, "the motion slides along the threshold of an expression")
            return
        if self._aside is None:  # the scene of the run keeps its memory
            self._aside = scene_of(record.mech, replace(record.plan, contacts=None))
        scene = self._aside
        code, given = scene.loads.signals[0], record.scene.loads.signals[0]
        scene.activate(record.active)
        code[:] = given
        before, held = rates(record, t, scene), code.copy()
        code[1::2, SIDE] = 0.0
        after = rates(record, t, scene)
        jumps = np.isin(held[::2, 0], (HELD_FROM + LESS, HELD_FROM + AT_MOST))
        changed = jumps & (code[1::2, 0] != held[1::2, 0])
        self._jump = None
        for k in np.flatnonzero(changed).tolist():
            a, b = (2 * held[2 * k, 1:3]).astype(int) + 1

            def margin(t: float, q: Array, v: Array, a: int = a, b: int = b) -> float:
                values(held, t, q, v)
                return float(held[a, 0] - held[b, 0])

            y = np.concatenate((record.q, record.v))
            rate = slope_along(margin, t, y, nq, before[: len(y)], 1.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                times = [-run.margin(t, a, b) / rate for run in self._runs]
            if self._jump and not np.allclose(times, self._jump.times, NOTABLE, 0.0):
                self.stop(
                    record, "two comparisons change simultaneously, but not for neighbouring values"
                )
                break
            self._jump = Jump(times, before - after)
            self._jumped.append(float(t))
        if self._jump is None and record.steps.ends["sided"] == 0:
            self._touch = touch_of(record, self._runs, rates(record, t))

    def _advanced(self, run: int, budget: int) -> int:
        given, corners = (self._addresses, self._step, self._note, self.out), self._corners
        until = np.inf if corners is None else corners.next
        code = self._kernel(run, self._advance, *given, until, budget)
        if corners is None or corners.record.steps.clock["time"] < until:
            return code
        if why := corners.passed():
            self.out[:, corners.frame :] = np.nan
            self.stop(corners.record, why)
        return code

    def take_plan(self, plan: RunPlan) -> None:
        """Differentiate a run that continues with another plan. Raises InputError."""
        given = self.given._replace(plan=replace(plan, start=self.given.plan.start), kept=None)
        refuse(given)
        self.given, self.slopes, self._beside = given, [], None
        self.variables = variables_of(given, given.wrt)

    def go_on(self, record: Recording) -> None:
        """Copy the derivatives of the state to the scene that continues the recording."""
        try:
            count, old, before = len(self.variables), self._runs, self._each()
            lanes = [one for run in old for one in run.derivatives(None)]
            lanes = [one for k, one in enumerate(lanes) if k % MOST < self._most][:count]
            self.take_plan(record.plan)
            self.join(record, (record.q, record.v))
        except InputError as refused:
            self.stop(record, refused.problems[0].text)
            return
        for now, past in zip(self._each(), before):
            now[:] = past
        for k, one in enumerate(lanes):
            self._runs[k // self._most].take(k % self._most, one)

    def stop(self, record: Recording, why: str) -> None:
        """Go on without derivatives."""
        t = float(record.steps.clock["time"])
        record.steps.carried = None
        record.steps.guarded_by(carried=0)
        self._ended.append(f"at t = {t:.6g} s derivatives end: {why}")

    def switch(self, record: Recording, t: float, old: State, late: Lateness | None) -> None:
        """Differentiate a switch of constraints at t in the state `old`, after the primal run.

        `late` are the derivatives of t, if it depends on the state.
        """
        self._jumped.append(t)
        after = rates(record, t) if late else None
        for run, k in zip(self._runs, range(0, len(self.slopes), self._most)):
            times = late.times[k : k + self._most] if late else NO_TIMES
            run.switch(t, old, (record.q, record.v), times, late and late.rates, after)

    def lateness(self, record: Recording, t: float, condition: Any) -> Lateness:
        """Return the derivatives of the time t at which a condition becomes true. Raises
        InputError."""
        when, before = condition.given.when, rates(record, t)
        if when.constraint is not None:  # follows a switch, at once or after a given time
            known = self._late.get(condition.given.place)
            return Lateness(np.zeros(len(self.slopes)) if known is None else known, before)
        # impulses of the step are in the rates after the switch, too
        return self._lateness(record, t, condition, before)._replace(rates=before)

    def _lateness(self, record: Recording, t: float, monitor: Any, before: Array) -> Lateness:
        """Differentiate the time t at which a monitor crosses zero, or jumps in an impact."""
        if record.steps.carried is not self:  # derivatives have ended
            return Lateness(np.full(len(self.slopes), np.nan), before)
        nq, n, old = len(record.q), len(record.q) + len(record.v), record.steps.stages[at.Y_OLD]
        y, since = record.steps.stages[at.Y, :n], float(record.steps.clock["old_time"])

        def value(t: float, y: Array) -> float:
            return monitor(t, y[:nq].copy(), y[nq:n].copy())

        here, begin, width = value(t, y), value(since, old), t - since
        if record.plan.method.time_stepping:
            parts = [run.last_part for run in self._runs]
            before = parts[0].rates
            if parts[0].width < record.steps.clock["old_width"]:
                there = value(t - parts[0].width, parts[0].start)
                if there == 0.0 or here * there > 0.0:
                    times = np.concatenate([part.times for part in parts])
                    return Lateness(times[: len(self.slopes)], before, True)
        given = monitor, t, y, nq
        rate = slope_along(*given, before[:n], 1.0)
        size = max(abs(begin), abs(rate * width))
        if abs(here) > NOTABLE * size or abs(rate * width) <= NOTABLE * size:
            self._ended.append(f"at t = {t:.6g} s derivatives end: {NO_CROSSING}")
            rate = np.nan
        ways = [run.derivatives(n) for run in self._runs]
        found = [slope_along(*given, d, 0.0) for run in ways for d in run[: self._most]]
        return Lateness(-np.array(found[: len(self.slopes)]) / rate, before)

    def end_at(self, record: Recording, monitor: Any) -> None:
        """Differentiate the time of a terminal event, with which the last frame moves."""
        t = float(record.steps.clock["time"])
        self._end = record.steps.recorded - 1, self._lateness(record, t, monitor, rates(record, t))

    def keep_late(self, constraints: Sequence[int], late: Lateness | None) -> None:
        """Store the times at which these constraints were switched, for conditions with a delay."""
        for one in constraints:
            self._late[one] = late.times if late else np.zeros(len(self.slopes))

    @property
    def ended(self) -> list[str]:
        """Messages that tell when derivatives end, and why."""
        if self._parts is None or not self._parts.ended[1]:
            return self._ended
        t, why = self._parts.ended
        return [*self._ended, f"at t = {t:.6g} s derivatives end: {ENDS[int(why)]}"]

    def notices(self, frames: int) -> list[str]:
        """Notices about the end of derivatives and about parameters without influence, over the
        first `frames`."""
        each = [d[:frames] for d in self._each()]
        idle = [one.path for one, d in zip(self.variables, each) if not d.any()]
        ended = self.ended
        found = ended + [f"{path} has no influence on the motion" for path in idle]
        if self._strayed:
            text = "derivatives refer to a different initial state, because the given one does not "
            text += "satisfy the constraints: use mech.assemble(q, v)"
            found.append(text)
        touching = self._record.scene.touching
        if touching is not None and touching.tally["calmed"]:
            text = "derivatives ignore that restitution was disabled in some steps, and may be off "
            found.append(f"{text}by some per cent; use less friction or no restitution")
        for one, d in zip(self.variables, each):
            lost = np.flatnonzero(~np.isfinite(d[:, :-2]).all(axis=1))  # impulses take energy
            if not ended and len(lost):
                t = float(self._record.plan.times[lost[0]])
                text = f"derivatives by {one.path} end before t = {t:.6g} s: a slope is infinite, "
                text += "or the equations of a step determine none"
                found.append(text)
        return found

    @cached_property
    def order(self) -> Ints:
        """The entries of the state of a run: first the motion, then the controls."""
        mech, (q, v) = self.given.mech, self.given.plan.start
        entries = np.arange(len(q) + len(v) + 2)
        own = np.isin(
            entries, [*range(mech.nq, len(q)), *range(len(q) + mech.nv, len(entries) - 2)]
        )
        last = entries >= len(entries) - 2
        return np.concatenate((entries[~own & ~last], entries[own], entries[last]))

    def _each(self) -> list[Array]:
        """The derivatives by each variable, (frames, nq + nv + 2)."""
        return [group[..., k] for group in self.out for k in range(1, self._most + 1)]

    def finer(self) -> Carried:
        """The same derivatives, for a finer run of the same motion."""
        given, variables, slopes, beside = self._begun
        other = Carried(given, variables)
        other.slopes, other._beside = slopes, beside
        return other

    def unlike(self, finer: Carried, t: Array, rows: Ints, others: Ints) -> list[str]:
        """Warnings about derivatives that differ from those of the finer run.

        The frames `others` of the finer run correspond to the `rows` of this run at the times t.
        """
        t = t[rows]
        known = self._settled(finer, t)
        v, other = self._record.out.v[rows], finer._record.out.v[others]
        jumps = np.abs(v - other).max(axis=1, initial=0.0) > VISIBLE * np.abs(v).max(initial=0.0)
        known = known[~jumps[known]]  # only one of them is beyond an impact
        if self._end is not None and self._end[1].hits:  # the finer run may end before the impact
            known = known[known < len(t) - 1]
        t, rows, others = t[known], rows[known], others[known]
        if not len(t):
            return []
        found, nq = [], len(self.given.plan.start[0])
        nv = len(self.given.plan.start[1])
        out = self._record.out
        values = np.column_stack((out.q[rows], out.v[rows]))
        for one, mine, other in zip(self.variables, self._each(), finer._each()):
            path = one.path
            worst, first = 0.0, t[-1]
            for part in (slice(0, nq), slice(nq, nq + nv)):
                a, b = mine[rows, part], other[others, part]
                # below this, a change of the number by itself is not visible in the state
                least = NOTABLE * np.abs(values[:, part]).max(initial=0.0) / self.scale_of(path)
                sizes = np.nan_to_num(np.abs(b)).max(axis=1, initial=least)
                apart = np.nan_to_num(np.abs(a - b)).max(axis=1, initial=0.0)
                if (size := sizes.max()) > 0.0 and (share := float(apart.max() / size)) > VISIBLE:
                    worst = max(worst, share)
                    until = np.maximum.accumulate(sizes)  # later sizes may have grown from errors
                    first = min(first, t[(apart > VISIBLE * until).argmax()])
            if worst:
                text = f"derivatives by {one.path} are {percent(worst)} apart from those of a "
                text += f"finer run, above 1 % from t = {first:.6g} s on: give "
                do = more_accurate(self._record.plan)
                if first == t[0]:  # both begin there, the finer one in the state of this one
                    do = "an initial state that meets the constraints, mech.assemble(q, v)"
                found.append(text + do)
        return found

    def _settled(self, finer: Carried, t: Array) -> Ints:
        """Return the indices of the times (n,) that are after the same jumps in both runs.

        The times of jumps differ by the errors of the runs.
        """
        a, b, near = np.array(self._jumped), np.array(finer._jumped), 8.0 * EPS * np.abs(t)
        if len(a) != len(b):
            return np.arange(len(t))
        low, high = np.minimum(a, b), np.maximum(a, b)
        same = np.searchsorted(low, t + near) == np.searchsorted(high, t - near)
        return np.flatnonzero(same)

    def of_frames(self, rows: slice | Ints) -> Derivatives:
        """{path: (frames, nq + nv + 2)} of q, v, work and dissipation."""
        each = self._each()
        if self._end is not None:
            frame, late = self._end
            each = [d.copy() for d in each]
            for d, time in zip(each, late.times):
                d[frame] += time * late.rates
        found = {one.path: d[rows][:, self.order] for one, d in zip(self.variables, each)}
        return Derivatives(found, self)

    def scale_of(self, path: str) -> float:
        """Return the size of a number."""
        (variable,) = (one for one in self.variables if one.path == path)
        return abs(variable.present) or 1.0

    def beside(self, run: Result, path: str, change: float) -> Result:
        """Return the run with a changed parameter to first order, at the same frames.

        For models with contacts, accelerations, forces and dissipation are nan.
        """
        number = [one.path for one in self.variables].index(path)
        variable, times = self.variables[number], np.array(run.t)
        if self._end is not None:
            times[-1] += change * self._end[1].times[number]
        own = np.zeros(run.states.shape), run.states
        here = np.column_stack((run.q, run.v, *own, run.work, run.dissipation))
        here += change * run.derivatives[path]
        made = cache(lambda: variable.made(variable.present + change))
        place, nq, nv = variable.place, run.q.shape[1], run.v.shape[1]

        def mechanism() -> Mechanism:
            if place is None:
                return made()[0]
            return Mechanism(place.set(self.given.mech.model, variable.present + change))

        joints, states = run.mechanism.joints, here[:, -2 - own[1].shape[1] : -2]
        lost = here[:, -1] if self.given.plan.contacts is None else np.full(len(here), np.nan)
        arrays = {"t": times, "states": states, "work": here[:, -2], "dissipation": lost}
        arrays["q"] = read_only("q", here[:, :nq], joints)
        arrays["v"] = read_only("v", here[:, nq : nq + nv], joints)
        return Result.later(arrays, mechanism, lambda: self._recorded(times, here, *made()))

    def _recorded(self, times: Array, here: Array, mech: Mechanism, plan: RunPlan) -> Result:
        """Record the states `here` (frames, nq + nv + 2) at these times."""
        from ..engine.stepping.duals import record_states

        stepped = plan.contacts is not None
        plan = replace(plan, times=times, shown=None, changes=(), way=None, contacts=None)
        other = Recording(mech, plan, *plan.start, self.given.tau)
        states = np.zeros((len(times) + 1, other.steps.stages.shape[1]))
        states[1:, self.order] = here
        kernels = address_of(motion.record), other.scene.accelerate
        record_states(other.scene.address, *kernels, plan.times, states, tuple(other.out))
        other.steps.count_frames(len(times))
        if stepped:  # impulses are not among the derivatives
            other.out.vdot[:], other.out.wrenches[:] = np.nan, np.nan
            other.out.energies[:, 3] = np.nan  # they dissipate
        return result_of(other, NO_ESTIMATE, {})


def directions(mech: Mechanism, q: Array) -> Array:
    """∂q'/∂v at q, (nq, nv)."""
    found = np.zeros((mech.nq, mech.nv))
    for joint in mech.joints.values():
        first, own, count = joint.q.start, joint.v.start, joint.v.stop - joint.v.start
        if joint.q.stop - first == count:
            found[joint.q, joint.v] = np.eye(count)
            continue
        if count == 6:  # free: its place comes before its attitude, and turns before shifts
            found[first : first + 3, own + 3 : own + 6] = np.eye(3)
            first += 3
        w, x, y, z = 0.5 * q[first : first + 4]
        turns = [[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]]
        found[first : first + 4, own : own + 3] = turns
    return found


def rates(record: Recording, t: float, scene: Any = None, state: Any = None) -> Array:
    """The rates of the state of a run: q', v', and the power put in and dissipated.

    `state` is another state (q, v) than the present one.
    """
    flow, vdot, scene = np.zeros(3), np.zeros(len(record.v)), scene or record.scene
    q, v = state or (record.q, record.v)
    motion.constrained_dynamics(
        scene.address, record.steps.links.accelerate, t, q, v,
        scene.given, flow, vdot, np.empty_like(record.out.wrenches[0]),
    )  # fmt: skip
    nv = record.mech.nv
    return np.concatenate((directions(record.mech, q) @ v[:nv], v[nv:], vdot, flow[:2]))


def slope_along(function: Any, t: float, y: Array, nq: int, way: Array, dt: float) -> float:
    """Compute the derivative of a function of (t, q, v) along (dt, way), by central differences.

    It is nan if the way is not known, since derivatives have ended.
    """
    if not np.isfinite(way).all():
        return np.nan
    h = SHARE / max(float(np.abs(way).max(initial=0.0)), 1.0)
    total = 0.0
    for k, weight in CENTRAL.items():
        x = y + k * h * way
        total += weight * function(t + k * h * dt, x[:nq].copy(), x[nq:].copy())
    return total / h


def _advance_run() -> Any:
    from ..engine.stepping.run import advance_run

    return advance_run
