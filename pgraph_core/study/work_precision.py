"""`work_precision`: the error of each method at each setting, and its time in shuffled rounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import choices, explained, refusal
from ..integrators import METHODS
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from . import reference as references
from .engines import engine_participants, engines_of
from .errors import Errors, levelled, observed_order, rms, step_counts
from .reference import Reference
from .settings import Ladder, Setting, methods_of, positive, whole
from .study import USUAL_TARGET, Row, Study
from .task import (
    Outcome,
    Participant,
    Progress,
    Stopped,
    Task,
    own_participant,
    start,
)
from .timing import machine, measured, ratios, spread

FRAMES = 101  # times at which motions are compared, by default
LONGEST = 1.0  # s that a run may take
CLOCKS = ("wall", "processor")
PATIENCE = 10.0  # times longer than others a run of a reference may take
MOST_GROWTH = 4.0  # of the time from one tolerance to the next: more is the machine
ENOUGH = 0.2  # s that the last run of a method may take, of those for its order
SHARE = {"reference": 0.1, "first": 0.4, "rounds": 1.0}  # of the progress, at each part's end


@explained
def work_precision(
    mech: Mechanism | Model,
    q: Any = None,
    v: Any = None,
    *,
    t_end: float | None = None,
    methods: Sequence[str] | str | None = None,
    steps: Any = None,
    tolerances: Any = None,
    fixed: bool = False,
    reference: Any = None,
    rounds: int = 5,
    clock: str = "wall",
    scenario: str | None = None,
    tau: Any = None,
    stabilise: str | None = "project",
    target: float | None = None,
    frames: int = FRAMES,
    peers: Sequence[str] | str = (),
    longest: float = LONGEST,
    progress: Callable[[float], Any] | None = None,
) -> Study:
    """Error against run time of `methods` on the motion that `simulate` computes.

    Adaptive methods run at `tolerances` (1e-2 .. 1e-12), the others at `steps` [s]
    (h0 2^-k, k = 0 .. 8); `fixed` runs all at steps. Errors are dimensionless, over `frames` times
    (docs/report.md), against `reference`: a Result, (t, q), a Case, a Reference, or by default the
    finest run possible, whose own error is estimated and printed. `peers` are names of other
    engines ("mujoco", "pinocchio", "exudyn"). `clock="processor"` excludes time taken by other
    programs. Runs of more than `longest` seconds are left out. If `progress(fraction)` returns
    False, the study ends with the rows so far and `cancelled` set.

    Raises InputError for arguments that do not fit. A run that fails stays in the table.
    """
    call, mech = "work_precision", mechanism_of(mech, "work_precision")
    given = None if scenario is None else mech.model.scenario(scenario)
    duration = t_end if t_end is not None else given.t_end if given else 1.0
    duration = positive(call, "t_end", duration, "a finite number > 0 [s]")
    whole(call, "rounds", rounds, 1)
    whole(call, "frames", frames, 3)
    if target is not None:
        positive(call, "target", target, "a finite number > 0, an error such as 1e-6")
    positive(call, "longest", longest, "a finite number > 0 [s]")
    if clock not in CLOCKS:
        raise refusal(call, "clock", f"must be one of {choices(CLOCKS)}; given {clock!r}")
    q0, v0 = start(mech, scenario, q, v)
    task = Task(mech, q0, v0, np.linspace(0.0, duration, frames), scenario, tau, stabilise)
    known = None
    if reference is not None:
        known = references.given(task, reference)
        task = replace(task, t=known.t)
    rate = task.rate()
    ladder = Ladder.of(task, steps, tolerances, fixed, rate)
    names = methods_of(call, methods, impulses=task.impulses, suited=True)
    work = Work(task, ladder, names, engines_of(peers), progress, longest, rounds, clock)
    return work.study(known, rate, target)


class Work:
    """A study under way, which the caller can stop at any call of its progress function."""

    def __init__(
        self,
        task: Task,
        ladder: Ladder,
        names: tuple[str, ...],
        peers: tuple[str, ...],
        progress: Callable[[float], Any] | None,
        longest: float,
        rounds: int,
        clock: str,
    ):
        self.task, self.ladder, self.names, self.peers = task, ladder, names, peers
        self.progress, self.longest, self.rounds = progress, longest, rounds
        self.clock = CLOCKS.index(clock)
        self.fraction = 0.0
        self.timing: dict[str, float] = {}
        self.notes: list[str] = []
        self.left_out: tuple[str, ...] = ()
        self.orders: dict[str, tuple[float | None, float]] = {}
        self.rows: list[Row] = []

    def study(self, known: Reference | None, rate: float, target: float | None) -> Study:
        """All of it, or the part that was done when it was stopped."""
        baseline, cancelled = None, False
        try:
            self._compile()
            began = time.perf_counter()
            if known is None:
                step = self.ladder.steps[-1]
                known, task = references.finest(self.task, rate, step, lambda: self.watch(PATIENCE))
                self._shorten(task)
            self.timing["reference"] = time.perf_counter() - began
            runs = self._first_runs(self._participants(), known)
            began = time.perf_counter()
            for name in self.names:
                self.orders[name] = self._order(name, known), float(METHODS[name].order)
            self.timing["orders"] = time.perf_counter() - began
            baseline = self._time(runs, target)
        except Stopped:
            cancelled = True
        return self._study(known, baseline, target, cancelled)

    def watch(self, times: float = 1.0) -> Progress:
        """The progress function of a run, which ends with the study or after `longest` seconds."""
        ends = time.perf_counter() + times * self.longest

        def look(_: float) -> bool:
            self.report(self.fraction)
            return time.perf_counter() < ends

        return look

    def report(self, fraction: float) -> None:
        """Call the caller's progress function. Raises Stopped if it returns False."""
        self.fraction = fraction
        if self.progress is not None:
            answer = self.progress(fraction)
            if answer is not None and not answer:
                raise Stopped

    def _compile(self) -> None:
        """One short run of each method, so that no later one compiles anything."""
        began = time.perf_counter()
        for name in self.names:
            self.report(0.0)
            first = self.ladder.settings(METHODS[name])[0]
            self.left_out = self.task.until(2).run(name, first).left_out
        self.timing["compile"] = time.perf_counter() - began

    def _shorten(self, task: Task) -> None:
        """Continue with the motion up to the reference's horizon."""
        whole_time, self.task = self.task.t_end, task
        if task.t_end < whole_time:
            self.notes.append(
                f"chaotic: compared up to t = {task.t_end:.4g} s of {whole_time:.4g} s, where two "
                f"references still agree to {references.AGREE:g}"
            )

    def _participants(self) -> list[Participant]:
        ladder = self.ladder
        ours = [own_participant(self.task, n, ladder.settings(METHODS[n])) for n in self.names]
        theirs, notes = engine_participants(self.task, ladder, self.peers)
        self.notes += notes
        return ours + theirs

    def _first_runs(
        self, participants: list[Participant], known: Reference
    ) -> list[tuple[Callable[[], float], float]]:
        """Fill `rows`; for each (a function that runs it again for its time, seconds it took)."""
        began = time.perf_counter()
        runs: list[tuple[Callable[[], float], float]] = []
        part, total = (
            SHARE["first"] - SHARE["reference"],
            sum(len(p.settings) for p in participants),
        )
        for one in participants:
            took: list[float] = []
            for setting in one.settings:
                done = self._run(one, setting, _expected(one.settings, took))
                took.append(done.seconds[0])
                self.rows.append(self._row(one, setting, done, known))
                runs.append((self._again(one, setting), done.seconds[0]))
                self.report(SHARE["reference"] + part * len(self.rows) / total)
        self.timing["first runs"] = time.perf_counter() - began
        return runs

    def _run(self, one: Participant, setting: Setting, expected: float) -> Outcome:
        """The first run, with its estimate, unless it is expected to take too long."""
        too_long = f"left out: it would take more than {self.longest:g} s"
        if expected > self.longest:
            return Outcome.failed(too_long, expected)
        done = one.run(setting, self.watch(), True)
        if done.cancelled:
            return done._replace(seconds=(np.inf, 0.0), reason=too_long)
        return done

    def _again(self, one: Participant, setting: Setting) -> Callable[[], float]:
        return lambda: one.run(setting, self.watch(np.inf), False).seconds[self.clock]

    def _row(self, one: Participant, setting: Setting, done: Outcome, known: Reference) -> Row:
        if not done.ok or len(done.q) != len(known.t):
            return Row.of(one, setting, done._replace(ok=False), None, 0.0)
        reached = Errors.of(known.errors(done.q))
        if not np.isfinite(reached.rms):
            done = done._replace(ok=False, reason="the motion stopped being finite")
            return Row.of(one, setting, done, None, 0.0)
        return Row.of(one, setting, done, reached, known.limit)

    def _order(self, name: str, known: Reference) -> float | None:
        """Observed order of one of our methods, from its rows or from extra fixed-step runs."""
        points = [
            (self.task.t_end / row.step, row.error)
            for row in self.rows
            if row.method == name and row.step and row.error and not row.limited
        ]
        return observed_order(points or self._order_runs(name, known))

    def _order_runs(self, name: str, known: Reference) -> list[tuple[float, float]]:
        """(steps, error) at steps that get shorter, until the reference's limit or time.

        They are compared at quarters of the motion, so that frames do not end steps.
        """
        points: list[tuple[float, float]] = []
        last = len(known.t) - 1
        at = np.arange(0, last + 1, last // 4 if last % 4 == 0 else last)
        quarters = replace(self.task, t=self.task.t[at])
        for count in step_counts():
            began = time.perf_counter()
            setting = Setting(step=self.task.t_end / count)
            run = quarters.run(name, setting, self.watch())
            if run.status.ok:
                q = np.repeat(run.q[-1:], last + 1, axis=0)
                q[at] = run.q
                points.append((count, rms(known.errors(q)[at])))
            reached = [error for _, error in points]
            below = bool(reached) and reached[-1] < known.limit
            if below or levelled(reached) or time.perf_counter() - began > ENOUGH:
                break
        return points

    def _time(
        self, runs: list[tuple[Callable[[], float], float]], target: float | None
    ) -> int | None:
        """Write the times into `rows`; the index of the baseline."""
        began = time.perf_counter()
        chosen = [i for i, row in enumerate(self.rows) if row.ok]
        if not chosen:
            return None
        first = SHARE["first"]
        seconds = measured(
            [runs[i][0] for i in chosen],
            [runs[i][1] for i in chosen],
            self.rounds,
            progress=lambda part: self.report(first + (1.0 - first) * part),
        )
        self.timing["rounds"] = time.perf_counter() - began
        rows, medians = [self.rows[i] for i in chosen], [spread(s)[1] for s in seconds]
        base = _baseline(rows, medians, USUAL_TARGET if target is None else target)
        for i, each in zip(chosen, seconds):
            relative = ratios(each, seconds[base])
            self.rows[i] = self.rows[i].timed(spread(each), relative, self.task.t_end)
        return chosen[base]

    def _study(
        self, known: Reference | None, baseline: int | None, target: float | None, cancelled: bool
    ) -> Study:
        task = self.task
        reference: dict[str, Any] = {"source": "none", "accuracy": np.nan, "limit": np.nan}
        if known is not None:
            reference = {"source": known.source, "accuracy": known.accuracy, "limit": known.limit}
        return Study(
            task.mech.model.name,
            task.scenario,
            task.t_end,
            len(task.t),
            tuple(self.rows),
            self.orders,
            reference,
            baseline,
            target,
            self.rounds,
            CLOCKS[self.clock],
            self.timing,
            machine(),
            self.left_out,
            tuple(self.notes),
            cancelled,
        )


def _baseline(rows: list[Row], times: list[float], target: float) -> int:
    """The cheapest of our runs that meets the target, else the most accurate one."""
    ours = [i for i, row in enumerate(rows) if not row.peer] or list(range(len(rows)))
    fit = [i for i in ours if (rows[i].error or 0.0) <= target]
    if fit:
        return min(fit, key=lambda i: times[i])
    return min(ours, key=lambda i: rows[i].error or 0.0)


def _expected(settings: tuple[Setting, ...], took: list[float]) -> float:
    """Seconds of the next setting, from the last ones: as its steps, or as tolerances grew."""
    if not took or took[-1] == np.inf:
        return took[-1] if took else 0.0
    last, following = settings[len(took) - 1], settings[len(took)]
    if last.step is not None and following.step is not None:
        return took[-1] * last.step / following.step
    grew = took[-1] / took[-2] if len(took) > 1 and took[-2] > 0 else 1.0
    return took[-1] * min(max(grew, 1.0), MOST_GROWTH)
