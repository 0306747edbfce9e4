"""`work_precision`: the runs of a report, within a limited time."""

from __future__ import annotations

import math
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
from .measures import Errors, least, machine, measured
from .reference import Reference
from .report import LEFT_OUT, Row, Study
from .task import (
    MAP_WITHIN,
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
    time_limit,
)

REPEATED = 4  # longest runs within the part of a report for its reference, which shortens it then
USUAL_FRAMES = 101  # default number of times at which motions are compared
SHARE = {"reference": 0.3, "first": 0.65, "rounds": 1.0}  # time and progress at the end of parts


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
    within: float = MAP_WITHIN,
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
    within : float
        Time for the whole study [s]. Coarse settings come first. Runs that do not end in this time
        are skipped. It can be infinite.
    progress : callable, optional
        Function that is called with the completed fraction, of the work or of the time. If it
        returns False, the study is cancelled and contains the completed rows.

    Returns
    -------
    Study
        The table of measurements.

    Raises
    ------
    InputError
        If an argument is invalid.
    """
    began = time.perf_counter()  # checks and loading are part of what the caller waits for
    call, mech = "work_precision", mechanism_of(mech, "work_precision")
    given = None if scenario is None else mech.model.scenario(scenario)
    duration = t_end if t_end is not None else given.t_end if given else 1.0
    duration = positive("t_end", duration, call=call)
    whole_number(call, "rounds", rounds, 1)
    whole_number(call, "frames", frames, 3)
    if target is not None:
        positive("target", target, unit=", an error such as 1e-6", call=call)
    positive("longest", longest, call=call)
    time_limit(call, within)
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
    work = Work(task, ladder, names, engines_of(peers), progress, longest, rounds, within, began)
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
    within: float  # [s]
    began: float  # start of the call, a value of `time.perf_counter`
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
                    self.task, rate, step,
                    lambda sure: self.watch(math.inf if sure else self._for_reference()),
                )  # fmt: skip
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

    def left(self, part: str) -> float:
        """Return the time left for a part of the study [s]."""
        return self.began + SHARE[part] * self.within - time.perf_counter()

    def watch(self, most: float = math.inf) -> Progress:
        """Return a progress function that stops a run after `most` seconds or with the study."""
        ends = time.perf_counter() + most

        def look(_: float) -> bool:
            self.report(self.fraction)
            return time.perf_counter() < ends

        return look

    def report(self, fraction: float) -> None:
        """Call the caller's progress function. Raises Stopped if it returns False."""
        self.fraction = fraction
        if self.progress is not None:
            gone = (time.perf_counter() - self.began) / self.within
            answer = self.progress(min(max(fraction, gone), 1.0))
            if answer is not None and not answer:
                raise Stopped

    def _for_reference(self) -> float:
        """Return how long a run for the reference may take [s]."""
        whole = references.REFERENCE_BUDGET * self.longest
        return min(whole, self.left("reference") / REPEATED)

    def _compile(self, asked: bool) -> None:
        """Run each method briefly, so that later runs need no compilation.

        Methods that do not support the scene are omitted, with a note.
        """
        kept = []
        for name in self.names:
            self.report(0.0)
            try:
                first = self.ladder.settings(METHODS[name])[0]
                self.task.until(2).run(name, first, self.watch(self.longest))
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
        """Fill `rows`. Return functions that repeat each row's timing, and the seconds taken.

        The coarsest settings of all participants come first.
        """
        part = SHARE["first"] - SHARE["reference"]
        grid = [
            (p, k) for p in range(len(participants)) for k in range(len(participants[p].settings))
        ]
        found: dict[tuple[int, int], tuple[Row, float]] = {}
        took: list[list[float]] = [[] for _ in participants]
        for p, k in sorted(grid, key=lambda place: place[1]):
            one, setting = participants[p], participants[p].settings[k]
            done = self._run(one, setting, _expected(one.settings, took[p]))
            took[p].append(done.seconds)
            found[p, k] = self._row(one, setting, done, known), done.seconds
            self.report(SHARE["reference"] + part * len(found) / len(grid))
        self.rows = [found[place][0] for place in grid]
        return [
            (self._again(participants[p], participants[p].settings[k]), found[p, k][1])
            for p, k in grid
        ]

    def _run(self, one: Participant, setting: Setting, expected: float) -> Outcome:
        """Run a setting once with an error estimate, unless it is expected to take too long."""
        too_long = f"{LEFT_OUT} {self.longest:g} s"
        if expected > self.longest:
            return Outcome.failed(too_long, expected)
        left = self.left("first")
        if left <= 0.0:
            return Outcome.failed(self._over, np.inf)
        done = one.run(setting, self.watch(min(self.longest, left)), True)
        if done.cancelled:
            why = too_long if left >= self.longest else self._over
            return done._replace(seconds=np.inf, reason=why)
        return done

    @property
    def _over(self) -> str:
        return f"{LEFT_OUT} the {self.within:g} s of the report"

    def _again(self, one: Participant, setting: Setting) -> Callable[[], float]:
        return lambda: one.run(setting, self.watch(), False).seconds

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
            [runs[i][0] for i in chosen], [runs[i][1] for i in chosen], self.rounds,
            progress=lambda part: self.report(first + (1.0 - first) * part),
            late=lambda: self.left("rounds") <= 0.0,
        )  # fmt: skip
        for i, each in zip(chosen, seconds):
            row = self.rows[i]
            self.rows[i] = (
                replace(row, seconds=least(each)) if each else replace(row, reason=self._over)
            )

    def _study(self, known: Reference | None, target: float | None, cancelled: bool) -> Study:
        task = self.task
        reference: dict[str, Any] = {"source": "none", "accuracy": np.nan, "limit": np.nan}
        if known is not None:
            reference = {"source": known.source, "accuracy": known.accuracy, "limit": known.limit}
        return Study(
            task.mech.model.name, task.scenario, task.t_end, len(task.t), tuple(self.rows),
            reference, target, self.rounds, machine(), tuple(self.notes), cancelled, task.asked,
        )  # fmt: skip


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
