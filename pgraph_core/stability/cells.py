"""Rows and cells of a map, computed side by side on all cores."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from typing import Any, NamedTuple

from ..errors import PgraphError
from ..integrators import METHODS
from ..mechanism import Mechanism
from ..model import Model
from ..result import Status
from ..simulation import simulate
from .axis import Axis
from .judging import Asked, judged, limit
from .reference import Reference, has_impulses, merged, rate_of, reference
from .runs import evaluations, run_at, times_of
from .verdict import Cell, Verdict


class Sweep(NamedTuple):
    """What a map is made of, checked and complete."""

    model: Model
    axis: Axis
    values: tuple[float, ...]
    methods: tuple[str, ...]
    steps: tuple[float, ...]  # empty: the values are the steps
    t_end: float
    target: float
    budget: int  # evaluations of a run times motions
    stabilise: str | None


class Row(NamedTuple):
    """One value of the axis: its model, its cells, and what they are compared with."""

    value: float
    model: Model | None
    t_end: float
    steps: tuple[float, ...]
    known: Reference | None
    problem: str  # why there is no model, or nothing to compare with


class Cancelled(Exception):
    """The caller's progress function returned False."""


class Work:
    """Threads, and how much of the work they have done."""

    def __init__(self, total: int, progress: Callable[[float], Any] | None):
        self.total, self.done, self.progress = total, 0, progress
        self.stopped = threading.Event()

    def goes_on(self, _: float = 0.0) -> bool:
        """What runs under way ask."""
        return not self.stopped.is_set()

    def finished(self, futures: Sequence[Future[Any]]) -> Iterator[Any]:
        """Results as they come, in the caller's thread; ends early where it cancels."""
        for future in as_completed(futures):
            self.done += 1
            said = None if self.progress is None else self.progress(self.done / self.total)
            if said is not None and not said:
                self.stopped.set()
                for other in futures:
                    other.cancel()
                return
            yield future.result()


def computed(
    sweep: Sweep, progress: Callable[[float], Any] | None, threads: int | None
) -> tuple[list[Row], list[Cell], bool]:
    """(rows, cells in their order, whether all are there)."""
    per_row = len(sweep.methods) * max(len(sweep.steps), 1)
    work = Work(len(sweep.values) * (1 + per_row), progress)
    warmed(sweep)
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        jobs = [pool.submit(_row, sweep, value, work) for value in sweep.values]
        rows = sorted(work.finished(jobs), key=lambda row: sweep.values.index(row.value))
        cells: list[tuple[int, Cell]] = []
        if not work.stopped.is_set():
            asked = [
                (row, name, step) for row in rows for name in sweep.methods for step in row.steps
            ]
            jobs = [pool.submit(_cell, sweep, i, *one, work) for i, one in enumerate(asked)]
            cells = [cell for cell in work.finished(jobs) if cell is not None]
    cells.sort(key=lambda pair: pair[0])
    return rows, [cell for _, cell in cells], not work.stopped.is_set()


def warmed(sweep: Sweep) -> None:
    """Compile here what the threads will need: two of them would do it at once, and in each other's
    way.
    """
    mech = Mechanism(sweep.model)
    own = ("rk4", "moreau_jean") if has_impulses(mech) else ("radau5", "dop853", "dopri5")
    for name in dict.fromkeys((*sweep.methods, *own)):
        try:
            simulate(mech, t_end=1e-9, step=1e-9, method=name, estimate=False)
        except PgraphError:
            continue  # each cell says so


def _row(sweep: Sweep, value: float, work: Work) -> Row:
    """The model at a value, and its motion as well as it is known."""
    pace = sweep.axis.pace(value)
    t_end = sweep.t_end * pace
    steps = (value,) if sweep.axis.of_steps else tuple(step * pace for step in sweep.steps)
    try:
        model = sweep.axis.applied(sweep.model, value)
        mech = Mechanism(model)
        times = merged([times_of(t_end, step) for step in steps], t_end)
        known = reference(mech, times, min(steps), sweep.target, sweep.budget, work.goes_on)
    except PgraphError as refused:
        return Row(value, None, t_end, steps, None, str(refused))
    none = "" if known else "no method reaches the end to compare with; try a shorter t_end"
    return Row(value, model, t_end, steps, known, none)


def _cell(
    sweep: Sweep, index: int, row: Row, method: str, step: float, work: Work
) -> tuple[int, Cell] | None:
    """The cell and its place; None where the map was cancelled meanwhile."""
    if row.model is None:
        return index, Cell(row.value, method, step, Verdict.FAILED, row.problem, time=0.0)
    mech = Mechanism(row.model)  # one a thread: they share nothing
    most = evaluations(METHODS[method], mech.nv, row.t_end, step)
    allowed = sweep.budget // len(mech.system.rows)
    if most > allowed:
        text = f"about {most:.1e} evaluations, of which the budget has {allowed:.1e}"
        return index, Cell(row.value, method, step, Verdict.SLOW, text, evaluations=most)
    options = (row.t_end, sweep.stabilise, work.goes_on)
    try:
        whole, half = (run_at(mech, method, step, halves, *options) for halves in (0, 1))
    except PgraphError as refused:
        return index, Cell(row.value, method, step, Verdict.FAILED, str(refused), time=0.0)
    if Status.CANCELLED in (whole.status, half.status):
        return None
    asked = Asked(row.value, method, step, sweep.target)
    if row.known is None:
        return index, _unjudged(asked, mech, whole, row.problem)
    return index, judged(asked, mech, whole, half, row.known)


def _unjudged(asked: Asked, mech: Mechanism, whole: Any, problem: str) -> Cell:
    """Of a row without a reference: nothing can be called right."""
    status = Verdict.INACCURATE if whole.status.ok else Verdict.FAILED
    text = problem if whole.status.ok else whole.message
    if whole.status is Status.NOT_FINITE:
        status = Verdict.UNSTABLE
    most = limit(asked.method, rate_of(mech, [mech.home()]))
    time = float(whole.t[-1]) if len(whole.t) and not whole.status.ok else float("nan")
    return Cell(*asked[:3], status, text, time=time, step_limit=most)
