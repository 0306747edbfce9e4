"""`work_precision`: the error of each method at each setting, and its run time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..dynamics.arguments import whole_number
from ..errors import InputError, explained, refusal
from ..integrators import METHODS
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..simulation.options import positive
from ..tolerances import SOLVED
from . import reference as references
from .measures import (
    Errors,
    least,
    machine,
    measured,
)
from .reference import Reference
from .report import LEFT_OUT, Row, Study
from .task import (
    Ladder,
    Outcome,
    Participant,
    Progress,
    Setting,
    Stopped,
    Task,
    engine_participants,
    engines_of,
    methods_of,
    own_participant,
    start,
)

USUAL_FRAMES = 101  # default number of times at which motions are compared
SHARE = {"reference": 0.1, "first": 0.4, "rounds": 1.0}  # progress at the end of each part


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
    reference: Any = None,
    rounds: int = 3,
    scenario: str | None = None,
    tau: Any = None,
    stabilise: str | None = "project",
    target: float | None = None,
    frames: int = USUAL_FRAMES,
    peers: Sequence[str] | str = (),
    longest: float = 1.0,
    progress: Callable[[float], Any] | None = None,
) -> Study:
    """Measure the error and run time of several methods for the same motion.

    The arguments define the motion as for `simulate`. Errors are dimensionless, as explained in
    docs/accuracy.md. Failed runs are included in the table.

    Parameters
    ----------
    mech : Mechanism or Model
        The system to run.
    q, v : array or dict, optional
        Initial state, by default the one of the scenario or of the model.
    t_end : float, optional
        Duration [s], by default that of the scenario, else 1.
    methods : sequence of str, optional
        Names of the methods to compare.
    steps : sequence of float, optional
        Step sizes of fixed-step methods [s]. The default is h0 2^-k for k = 0 .. 8.
    tolerances : sequence of float, optional
        Tolerances of adaptive methods, by default 1e-2 .. 1e-12.
    reference : Result, tuple, Case or Reference, optional
        Reference motion, for example a tuple of times and configurations. By default, it is
        computed with the highest possible accuracy, including an error estimate.
    rounds : int
        Number of repetitions. The minimum processor time is used.
    scenario, tau, stabilise :
        As in `simulate`.
    target : float, optional
        Error for which the methods are ranked.
    frames : int
        Number of frames at which motions are compared.
    peers : sequence of str
        Other programs to include: "mujoco", "pinocchio", "exudyn", "sundials" and "scipy".
    longest : float
        Maximum duration of a run [s]. Runs that would take longer are skipped.
    progress : callable, optional
        Function that is called with the completed fraction. If it returns False, the study is
        cancelled and contains the completed rows.

    Returns
    -------
    Study
        The table of measurements.

    Raises
    ------
    InputError
        If an argument is invalid.
    """
    call, mech = "work_precision", mechanism_of(mech, "work_precision")
    given = None if scenario is None else mech.model.scenario(scenario)
    duration = t_end if t_end is not None else given.t_end if given else 1.0
    duration = positive("t_end", duration, call=call)
    whole_number(call, "rounds", rounds, 1)
    whole_number(call, "frames", frames, 3)
    if target is not None:
        positive("target", target, unit=", an error such as 1e-6", call=call)
    positive("longest", longest, call=call)
    q0, v0 = start(mech, scenario, q, v)
    times = np.linspace(0.0, duration, frames)
    task = Task(mech, q0, v0, times, scenario, tau, stabilise, duration)
    known = None
    if reference is not None:
        known = references.given(task, reference)
        task = replace(task, t=known.t)
    rate = task.rate()
    ladder = Ladder.of(task, steps, tolerances, rate)
    names = methods_of(call, methods, impulses=task.impulses, suited=True)
    work = Work(task, ladder, names, engines_of(peers), progress, longest, rounds)
    return work.study(known, rate, target, asked=methods is not None)


@dataclass
class Work:
    """A study in progress, which the caller's progress function can stop at any call."""

    task: Task
    ladder: Ladder
    names: tuple[str, ...]
    peers: tuple[str, ...]
    progress: Callable[[float], Any] | None
    longest: float
    rounds: int
    fraction: float = 0.0
    notes: list[str] = field(default_factory=list[str])
    rows: list[Row] = field(default_factory=list[Row])

    def study(
        self, known: Reference | None, rate: float, target: float | None, *, asked: bool
    ) -> Study:
        """Run the study and return it. If the study is stopped, return the completed part.

        Raises InputError for a requested method (`asked`) that does not support the scene.
        """
        cancelled = False
        try:
            self._compile(asked)
            if known is None:
                step = self.ladder.steps[-1]
                known, task = references.finest(
                    self.task, rate, step, lambda: self.watch(references.REFERENCE_BUDGET)
                )
                whole_time, self.task = self.task.t_end, task
                if task.t_end < whole_time:
                    why = "a reference for the whole run would take too long"
                    if known.parted:
                        why = f"where two references still agree to {SOLVED:g}"
                    text = f"compared up to t = {task.t_end:.4g} s of {whole_time:.4g} s, {why}"
                    self.notes.insert(0, text)
            runs = self._first_runs(self._participants(), known)
            self._time(runs)
        except Stopped:
            cancelled = True
        return self._study(known, target, cancelled)

    def watch(self, times: float = 1.0) -> Progress:
        """Return a progress function that stops a run after `longest` seconds or with the study."""
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

    def _compile(self, asked: bool) -> None:
        """Run each method briefly, so that later runs need no compilation.

        Methods that do not support the scene are omitted, with a note.
        """
        kept = []
        for name in self.names:
            self.report(0.0)
            try:
                self.task.until(2).run(name, self.ladder.settings(METHODS[name])[0])
                kept.append(name)
            except InputError as problem:
                if asked:
                    raise
                self.notes.append(f"{name} is omitted: {problem.problems[0].text}")
        if not kept:
            raise refusal("work_precision", "methods", self.notes[0])
        self.names = tuple(kept)

    def _participants(self) -> list[Participant]:
        ladder = self.ladder
        ours = [own_participant(self.task, n, ladder.settings(METHODS[n])) for n in self.names]
        theirs, notes = engine_participants(self.task, ladder, self.peers)
        self.notes += notes
        return ours + theirs

    def _first_runs(
        self, participants: list[Participant], known: Reference
    ) -> list[tuple[Callable[[], float], float]]:
        """Fill `rows`. Return functions that repeat each row's timing, and the seconds taken."""
        runs: list[tuple[Callable[[], float], float]] = []
        part, total = (
            SHARE["first"] - SHARE["reference"],
            sum(len(p.settings) for p in participants),
        )
        for one in participants:
            took: list[float] = []
            for setting in one.settings:
                done = self._run(one, setting, _expected(one.settings, took))
                took.append(done.seconds)
                self.rows.append(self._row(one, setting, done, known))
                runs.append((self._again(one, setting), done.seconds))
                self.report(SHARE["reference"] + part * len(self.rows) / total)
        return runs

    def _run(self, one: Participant, setting: Setting, expected: float) -> Outcome:
        """Run a setting once with an error estimate, unless it is expected to take too long."""
        too_long = f"{LEFT_OUT} {self.longest:g} s"
        if expected > self.longest:
            return Outcome.failed(too_long, expected)
        done = one.run(setting, self.watch(), True)
        if done.cancelled:
            return done._replace(seconds=np.inf, reason=too_long)
        return done

    def _again(self, one: Participant, setting: Setting) -> Callable[[], float]:
        return lambda: one.run(setting, self.watch(np.inf), False).seconds

    def _row(self, one: Participant, setting: Setting, done: Outcome, known: Reference) -> Row:
        if not done.ok or len(done.q) != len(known.t):
            return Row.of(one, setting, done._replace(ok=False), None, 0.0)
        reached = Errors.of(known.errors(done.q))
        if not np.isfinite(reached.rms):
            done = done._replace(ok=False, reason="the motion stopped being finite")
            return Row.of(one, setting, done, None, 0.0)
        return Row.of(one, setting, done, reached, known.limit)

    def _time(self, runs: list[tuple[Callable[[], float], float]]) -> None:
        """Store the measured times in `rows`."""
        chosen = [i for i, row in enumerate(self.rows) if row.ok]
        first = SHARE["first"]
        seconds = measured(
            [runs[i][0] for i in chosen],
            [runs[i][1] for i in chosen],
            self.rounds,
            progress=lambda part: self.report(first + (1.0 - first) * part),
        )
        for i, each in zip(chosen, seconds):
            self.rows[i] = replace(self.rows[i], seconds=least(each))

    def _study(self, known: Reference | None, target: float | None, cancelled: bool) -> Study:
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
            reference,
            target,
            self.rounds,
            machine(),
            tuple(self.notes),
            cancelled,
            task.asked,
        )


def _expected(settings: tuple[Setting, ...], took: list[float]) -> float:
    """Estimate the seconds for the next setting: scaled by step size, or as long as the last
    tolerance.

    The first run is ignored, because it may include the compilation of kernels.
    """
    if took and took[-1] == np.inf:
        return np.inf
    if len(took) < 2:
        return 0.0
    last, following = settings[len(took) - 1], settings[len(took)]
    if last.step is not None and following.step is not None:
        return took[-1] * last.step / following.step
    return took[-1]
