"""A study under way: reference, first runs, rounds; it can be stopped between any two looks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..integrators import METHODS
from . import reference as references
from .errors import Errors
from .ladder import Setting, settings
from .machine import machine
from .order_runs import orders_of
from .reference import Reference
from .rows import Row, row
from .sides import Outcome, Side, own_side
from .study import Study
from .task import Progress, Stopped, Task
from .timing import measured, ratios, spread

CLOCKS = ("wall", "processor")
PATIENCE = 10.0  # times longer than others a run of a reference may take
MOST_GROWTH = 4.0  # of the time from one tolerance to the next: more is the machine
USUAL_TARGET = 1e-6  # of the baseline, where no target is given
SHARE = {"reference": 0.1, "first": 0.4, "rounds": 1.0}  # of the progress, at each part's end


class Work:
    """A study under way."""

    def __init__(self, task: Task, progress: Any, longest: float, rounds: int, clock: str):
        self.task, self.progress, self.longest, self.rounds = task, progress, longest, rounds
        self.clock = CLOCKS.index(clock)
        self.fraction = 0.0
        self.timing: dict[str, float] = {}
        self.notes: list[str] = []
        self.left_out: tuple[str, ...] = ()
        self.orders: dict[str, tuple[float | None, float]] = {}

    def study(
        self,
        names: tuple[str, ...],
        rungs: tuple[tuple[float, ...], tuple[float, ...]],
        fixed: bool,
        given: Reference | None,
        rate: float,
        target: float | None,
        peers: Sequence[str],
    ) -> Study:
        """All of it; where it is stopped, what there is of it."""
        rows: list[Row] = []
        found = given
        baseline, cancelled = None, False
        try:
            self._compile(names, rungs, fixed)
            began = time.perf_counter()
            if found is None:
                found, task = references.made(
                    self.task, rate, rungs[0][-1], lambda: self.watch(PATIENCE)
                )
                self._cut(task)
            self.timing["reference"] = time.perf_counter() - began
            sides = self._sides(names, rungs, fixed, peers)
            firsts = self._first_runs(sides, found, rows)
            began = time.perf_counter()
            self.orders = orders_of(self.task, names, rows, found, self.watch)
            self.timing["orders"] = time.perf_counter() - began
            baseline = self._timed(firsts, rows, target)
        except Stopped:
            cancelled = True
        return self._study(rows, found, baseline, target, cancelled)

    def watch(self, times: float = 1.0) -> Progress:
        """What a run looks at: it ends where the study is stopped, or where it takes too long."""
        ends = time.perf_counter() + times * self.longest

        def look(_: float) -> bool:
            self.said(self.fraction)
            return time.perf_counter() < ends

        return look

    def said(self, fraction: float) -> None:
        """Tell the caller. Raises Stopped where it has had enough."""
        self.fraction = fraction
        if self.progress is not None:
            answer = self.progress(fraction)
            if answer is not None and not answer:
                raise Stopped

    def _compile(self, names: tuple[str, ...], rungs: Any, fixed: bool) -> None:
        """One short run of each method, so that no other one compiles anything."""
        began = time.perf_counter()
        for name in names:
            self.said(0.0)
            method = METHODS[name]
            first = settings(method, *rungs, fixed=fixed)[0]
            self.left_out = self.task.until(2).run(name, first).left_out
        self.timing["compile"] = time.perf_counter() - began

    def _cut(self, task: Task) -> None:
        """Go on with the motion up to the reference's horizon."""
        whole, self.task = self.task.t_end, task
        if task.t_end < whole:
            self.notes.append(
                f"chaotic: compared up to t = {task.t_end:.4g} s of {whole:.4g} s, where two "
                f"references still agree to {references.AGREE:g}"
            )

    def _sides(
        self, names: tuple[str, ...], rungs: Any, fixed: bool, peers: Sequence[str]
    ) -> list[Side]:
        ours = [
            own_side(self.task, METHODS[name], settings(METHODS[name], *rungs, fixed=fixed))
            for name in names
        ]
        if not peers:
            return ours
        from .beside import peer_sides

        theirs, said = peer_sides(self.task, rungs, peers)
        self.notes += said
        return ours + theirs

    def _first_runs(
        self, sides: list[Side], found: Reference, rows: list[Row]
    ) -> list[tuple[Callable[[], float], float]]:
        """Fill `rows`; of each (its run for the clock, what it took)."""
        began = time.perf_counter()
        firsts: list[tuple[Callable[[], float], float]] = []
        part, total = SHARE["first"] - SHARE["reference"], sum(len(s.settings) for s in sides)
        for side in sides:
            took: list[float] = []
            for setting in side.settings:
                done = self._run(side, setting, _expected(side.settings, took))
                took.append(done.seconds[0])
                rows.append(self._row(side, setting, done, found))
                firsts.append((self._again(side, setting), done.seconds[0]))
                self.said(SHARE["reference"] + part * len(rows) / total)
        self.timing["first runs"] = time.perf_counter() - began
        return firsts

    def _run(self, side: Side, setting: Setting, expected: float) -> Outcome:
        """The first run, with its estimate, where it is not expected to take too long."""
        if expected > self.longest:
            return Outcome(np.zeros((0, 0)), (expected, 0.0), False, self._too_long())
        done = side.run(setting, self.watch(), True)
        if done.cancelled:
            return done._replace(seconds=(np.inf, 0.0), reason=self._too_long())
        return done

    def _too_long(self) -> str:
        return f"left out: it would take more than {self.longest:g} s"

    def _again(self, side: Side, setting: Setting) -> Callable[[], float]:
        return lambda: side.run(setting, self.watch(np.inf), False).seconds[self.clock]

    def _row(self, side: Side, setting: Setting, done: Outcome, found: Reference) -> Row:
        if not done.ok or len(done.q) != len(found.t):
            return row(side, setting, done._replace(ok=False), None, 0.0)
        reached = Errors.of(found.errors(done.q))
        if not np.isfinite(reached.rms):
            done = done._replace(ok=False, reason="the motion stopped being finite")
            return row(side, setting, done, None, 0.0)
        return row(side, setting, done, reached, found.limit)

    def _timed(
        self, firsts: list[tuple[Callable[[], float], float]], rows: list[Row], target: float | None
    ) -> int | None:
        """Write the times into `rows`; the index of the baseline."""
        began = time.perf_counter()
        chosen = [i for i, row in enumerate(rows) if row.ok]
        if not chosen:
            return None
        runs = [firsts[i][0] for i in chosen]
        took = [firsts[i][1] for i in chosen]
        first = SHARE["first"]
        seconds = measured(
            runs, took, self.rounds, said=lambda part: self.said(first + (1.0 - first) * part)
        )
        self.timing["rounds"] = time.perf_counter() - began
        base = _baseline([rows[i] for i in chosen], [spread(s)[1] for s in seconds], target)
        for i, each in zip(chosen, seconds):
            relative = ratios(each, seconds[base])
            rows[i] = rows[i].timed(spread(each), relative, self.task.t_end)
        return chosen[base]

    def _study(
        self,
        rows: list[Row],
        found: Reference | None,
        baseline: int | None,
        target: float | None,
        cancelled: bool,
    ) -> Study:
        task = self.task
        given: dict[str, Any] = {"source": "none", "accuracy": np.nan, "limit": np.nan}
        if found is not None:
            given = {"source": found.source, "accuracy": found.accuracy, "limit": found.limit}
        return Study(
            task.mech.model.name,
            task.scenario,
            task.t_end,
            len(task.t),
            tuple(rows),
            self.orders,
            given,
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


def _baseline(rows: list[Row], times: list[float], target: float | None) -> int:
    """The cheapest of our runs that meets the target, else the most accurate one."""
    ours = [i for i, row in enumerate(rows) if not row.peer] or list(range(len(rows)))
    wanted = USUAL_TARGET if target is None else target
    fit = [i for i in ours if (rows[i].error or 0.0) <= wanted]
    if fit:
        return min(fit, key=lambda i: times[i])
    return min(ours, key=lambda i: rows[i].error or 0.0)


def _expected(settings: tuple[Setting, ...], took: list[float]) -> float:
    """Seconds of the next rung: in proportion to its steps; as the last two grew to a tolerance."""
    if not took or took[-1] == np.inf:
        return took[-1] if took else 0.0
    last, following = settings[len(took) - 1], settings[len(took)]
    if last.step is not None and following.step is not None:
        return took[-1] * last.step / following.step
    grew = took[-1] / took[-2] if len(took) > 1 and took[-2] > 0 else 1.0
    return took[-1] * min(max(grew, 1.0), MOST_GROWTH)
