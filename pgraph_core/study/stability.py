"""`stability_map`: the methods that remain stable as one parameter makes a scene extreme."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.states import with_initial
from ..errors import InputError, PgraphError, choices, explained, refusal
from ..fields import EMPTY
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..packing import Array
from ..result import Result, Status
from ..simulation.options import positive
from ..simulation.start import with_state
from ..tolerances import NOTABLE
from .axes import AXES, Axis, applicable, first_axis
from .map import Cell, StabilityMap, Verdict, advised, judged, step_limit
from .reference import KnownMotion, known_motion, merged, per_step, weight_of
from .task import MAP_WITHIN, Setting, Task, finite_numbers, methods_of, start, time_limit

STEPS = (1e-1, 1e-2, 1e-3, 1e-4)  # [s]
BUDGET = 20_000_000  # evaluations of a run, times `weight_of`: a second or two
MAP_TIMES = 41  # evenly over a run
EARLY = 10  # first steps, all recorded: an unstable run grows there
REFERENCES = 2  # part of the time of a map for its references
PATIENCE = 4  # a run may take as many times its equal part of the time left
EVERY = 1  # [s] between two reports of progress at least
CALL = "stability_map"


class Sweep(NamedTuple):
    """The validated arguments for a stability map."""

    model: Model
    axis: Axis
    values: tuple[float, ...]
    methods: tuple[str, ...]
    steps: tuple[float, ...]  # empty: the values are the steps
    t_end: float
    target: float
    budget: int  # evaluations of a run times elementary motions
    stabilise: str | None
    own: float | None  # the value of the model as it is
    sorted: bool  # by how often they are right, since nobody named the methods
    freedoms: int
    allowed: int  # evaluations of a run
    scenario: str | None  # scenario of the model whose gait and switches act

    def task(self, mech: Mechanism, times: Array) -> Task:
        """Return the task of a run of this mechanism from its own state, stabilised."""
        q, v = mech.home()
        return Task(mech, q[: mech.nq], v[: mech.nv], times, self.scenario)


class Line(NamedTuple):
    """One value on the axis, with its model and the reference motion for its cells."""

    value: float
    model: Model | None
    steps: tuple[float, ...]
    known: KnownMotion | None
    problem: str  # why there is no model, or no known motion

    @property
    def reference(self) -> str:
        """In words."""
        if self.known is None:
            return self.problem
        return f"{self.known.source}: {self.known.known}"


@explained
def stability_map(
    mech: Mechanism | Model,
    q: Any = None,
    v: Any = None,
    *,
    axis: str | None = None,
    values: Iterable[float] | None = None,
    methods: Iterable[str] | str | None = None,
    steps: Iterable[float] | None = None,
    t_end: float | None = None,
    target: float = 1e-3,
    scenario: str | None = None,
    stabilise: str | None = "project",
    budget: int = BUDGET,
    within: float = MAP_WITHIN,
    threads: int | None = None,
    progress: Callable[[float], Any] | None = None,
    partial: Callable[[StabilityMap], Any] | None = None,
) -> StabilityMap:
    """Compute a stability map for combinations of parameter value, method and step size.

    Each combination is simulated with the given step and with half of it, and compared with two
    much finer runs that use different methods. It is OK if the error is at most `target`.

    Parameters
    ----------
    mech : Mechanism or Model
        The system to run.
    q, v : array or dict, optional
        Initial state, by default the one of the scenario or of the model.
    axis : str, optional
        Parameter to vary, such as "stiffness". The default is the first one that is available for
        the model.
    values : iterable of float, optional
        Values of the parameter. By default, a predefined list including the value of the model is
        used.
    methods, steps : iterable, optional
        Names of methods and step sizes [s]. By default, methods are sorted by the number of
        accurate results, and at equal numbers by their evaluations of the dynamics.
    t_end : float, optional
        Duration of the runs [s].
    target : float
        Largest acceptable error [rad, or relative to the length of the mechanism].
    scenario, stabilise :
        As in `simulate`. Gaits and switches of the scenario act, and the axis varies the model in
        its initial state.
    budget : int
        Maximum number of dynamics evaluations of a run, multiplied by the number of elementary
        motions.
    within : float
        Time for the whole map [s]. Short runs come first. Runs that do not end in this time have
        the verdict NOT_RUN. It can be infinite.
    threads : int, optional
        Number of threads. By default, one per core is used.
    progress : callable, optional
        Function that is called with the completed fraction, of the work or of the time. If it
        returns False, the map only contains the completed cells.
    partial : callable, optional
        Function that is called with the map so far after every completed cell.

    Returns
    -------
    StabilityMap
        The map, which can be printed as a table. Its `advice` recommends a method and step size.

    Raises
    ------
    InputError
        If an argument is invalid.
    """
    began = time.perf_counter()  # checks and loading are part of what the caller waits for
    time_limit(CALL, within)
    given = mech if isinstance(mech, Model) else mechanism_of(mech, CALL).model
    model, duration = in_scenario(given, scenario)
    model = started(model, q, v)
    sweep = _checked(
        model, axis or first_axis(model), values, methods, steps, t_end or duration, target, budget,
        stabilise, scenario,
    )  # fmt: skip
    work = Work(progress, began, began + within)
    return Drawing(sweep, work, partial, within).drawn(threads or os.cpu_count() or 1)


def _rank(cells: Sequence[Cell], method: str) -> tuple[int, int]:
    """Return a key that sorts methods by accurate results, and at equal numbers by their cost."""
    right = [c.evaluations for c in cells if c.method == method and c.status is Verdict.OK]
    return -len(right), sum(right)


def _checked(
    model: Model, axis: str, values: Any, methods: Any, steps: Any, t_end: Any, target: Any,
    budget: int, stabilise: str | None, scenario: str | None,
) -> Sweep:  # fmt: skip
    if axis not in AXES:
        text = f"no axis is named {axis!r}; choose one of {choices(AXES, len(AXES))}"
        raise refusal(CALL, "axis", text)
    chosen = AXES[axis]
    if chosen.of_steps and steps is not None:
        text = "the values of axis 'step' are the steps; leave steps out"
        raise refusal(CALL, "steps", text)
    own, usual = chosen.own(model), chosen.values
    if own is not None and not any(math.isclose(x, own, rel_tol=NOTABLE) for x in usual):
        usual = tuple(sorted((*usual, own)))
    numbers = finite_numbers(CALL, "values", usual if values is None else values)
    if own is not None:
        near = (x for x in numbers if math.isclose(x, own, rel_tol=NOTABLE))
        own = next(near, None)
    widths: tuple[float, ...] = ()
    if not chosen.of_steps:
        widths = finite_numbers(CALL, "steps", STEPS if steps is None else steps)
    for name, each in (("steps", widths), ("values", numbers if chosen.of_steps else ())):
        if any(x <= 0 for x in each):
            raise refusal(CALL, name, f"steps must be > 0 [s], got {min(each):g}")
    end = positive("t_end", t_end, call=CALL)
    aim = positive("target", target, unit="", call=CALL)
    limits = model.limited
    touching = any(c.active and c.law != "soft" for c in model.contacts)
    names = methods_of(CALL, methods, impulses=limits or touching, suited=False)
    try:
        chosen.applied(model, numbers[0])
    except InputError as lacks:
        others = applicable(model)
        text = f"{lacks.problems[0].text}; choose one of {choices(others, len(others))}"
        raise refusal(CALL, "axis", text) from None
    mech = mechanism_of(model, CALL)
    return Sweep(
        model, chosen, numbers, names, widths, end, aim, int(budget), stabilise, own,
        methods is None, mech.nv, int(budget) // weight_of(mech), scenario,
    )  # fmt: skip


# -- the model that a map starts from --------------------------------------------------------------


def in_scenario(model: Model, name: str | None) -> tuple[Model, float]:
    """Apply a scenario's state, forces and active parts to the model. Return (model, duration [s]).

    The returned model keeps the scenario with its gait and switches only. Raises ModelError for an
    unknown scenario.
    """
    if name is None:
        return model, 1.0
    s, mech = model.scenario(name), mechanism_of(model, CALL)
    q, v = start(mech, name, None, None)
    model = with_initial(model, q[: mech.nq], v[: mech.nv])
    constraints, contacts = (
        parts
        if names is None
        else tuple(p.unchecked_copy({"active": p.name in names}) for p in parts)
        for parts, names in ((model.constraints, s.constraints), (model.contacts, s.contacts))
    )
    rest = {"q": EMPTY, "v": EMPTY, "forces": (), "constraints": None, "contacts": None}
    parts = {
        "constraints": constraints,
        "contacts": contacts,
        "scenarios": (s.unchecked_copy(rest),),
    }
    return model.replace(**parts, forces=(*model.forces, *s.forces)), s.t_end


def started(model: Model, q: Any, v: Any) -> Model:
    """Return the model with (q, v) as initial state. Raises InputError."""
    if q is None and v is None:
        return model
    mech = Mechanism(model)
    at, speed = with_state(mech, mech.home(), q, v, 0.0)
    return with_initial(model, at[: mech.nq], speed[: mech.nv])


# -- cells, in parallel on all cores ---------------------------------------------------------------


class Work:
    """Progress of the work done by the threads, until it is cancelled or out of time."""

    def __init__(
        self, progress: Callable[[float], Any] | None, began: float = 0.0, ends: float = math.inf
    ):
        self.progress, self.began, self.ends = progress, began, ends
        self.fraction = 0.0  # completed
        self.stopped = threading.Event()

    @property
    def late(self) -> bool:
        """True if the time is over."""
        return time.perf_counter() >= self.ends

    def goes_on(self, _: float = 0.0) -> bool:
        """The progress function that is passed to each run."""
        return not self.stopped.is_set() and not self.late

    def part(self, share: float, left: float) -> float:
        """Return when a job must end [s], of which `left` have to follow each other within this
        share of the whole time."""
        now = time.perf_counter()
        ends = self.began + share * (self.ends - self.began)
        return now + (ends - now) * min(PATIENCE / left, 1)

    def until(self, ends: float) -> Callable[[float], bool]:
        """Return a progress function for a run that must end then."""
        return lambda _: self.goes_on() and time.perf_counter() < ends

    def finished(
        self, futures: Sequence[Future[Any]], shares: Sequence[float]
    ) -> Iterator[tuple[int, Any]]:
        """Yield the numbers and results of futures as they become available, in the caller's
        thread, until the caller cancels.

        `shares` are the parts of the whole work. An exception, including Ctrl-C, also stops the
        other threads.
        """
        numbers = {future: k for k, future in enumerate(futures)}
        pending = {*futures}
        try:
            while pending:
                done, pending = wait(pending, EVERY, FIRST_COMPLETED)
                for future in sorted(done, key=lambda one: numbers[one]) or [None]:
                    if future is not None:
                        self.fraction += shares[numbers[future]]
                        yield numbers[future], future.result()
                    if not self._told():
                        self.stop(futures)
                        return
        except BaseException:
            self.stop(futures)
            raise

    def _told(self) -> bool:
        """Report the fraction, of the work or of the time. Return False if the caller cancels."""
        if self.progress is None:
            return True
        gone = (time.perf_counter() - self.began) / (self.ends - self.began)
        answer = self.progress(min(max(self.fraction, gone), 1.0))
        return answer is None or bool(answer)

    def stop(self, futures: Sequence[Future[Any]]) -> None:
        """Cancel pending runs and stop those in progress."""
        self.stopped.set()
        for one in futures:
            one.cancel()


@dataclass
class Drawing:
    """A map in progress."""

    sweep: Sweep
    work: Work
    partial: Callable[[StabilityMap], Any] | None
    within: float  # [s]
    lines: list[Line] = field(default_factory=list[Line])
    cells: dict[int, Cell] = field(default_factory=dict[int, Cell])  # by their place in the map

    def drawn(self, threads: int) -> StabilityMap:
        """Compute the references, then the cells, the shortest runs first."""
        sweep, work = self.sweep, self.work
        _load(sweep)
        with ThreadPoolExecutor(threads) as pool:
            jobs = [
                pool.submit(_line, sweep, value, work, (len(sweep.values) - k) / threads)
                for k, value in enumerate(sweep.values)
            ]
            found = dict(work.finished(jobs, [1.0 / REFERENCES / len(jobs)] * len(jobs)))
            self.lines = [found[k] for k in sorted(found)]
            if not work.stopped.is_set():
                self._fill(pool, threads)
        return self._map(not work.stopped.is_set())

    def _fill(self, pool: ThreadPoolExecutor, threads: int) -> None:
        sweep, work = self.sweep, self.work
        grid = [
            (line, m, step) for line in self.lines for m in sweep.methods for step in line.steps
        ]
        costs = [_cost(sweep, *one) for one in grid]
        order = sorted(range(len(grid)), key=lambda i: costs[i])
        jobs = [
            pool.submit(_cell, sweep, *grid[i], work, (len(grid) - k) / threads)
            for k, i in enumerate(order)
        ]
        shares = [(1.0 - 1.0 / REFERENCES) * costs[i] / sum(costs) for i in order]
        for k, cell in work.finished(jobs, shares):
            if cell is not None:
                self.cells[order[k]] = cell
                if self.partial is not None:
                    self.partial(self._map(False))
        if not work.stopped.is_set():
            text = f"its part of the {self.within:g} s of the map was over; give more time (within)"
            for i, (line, method, step) in enumerate(grid):
                left = Cell(line.value, method, step, Verdict.NOT_RUN, text)
                self.cells.setdefault(i, left)

    def _map(self, complete: bool) -> StabilityMap:
        sweep, cells = self.sweep, [self.cells[i] for i in sorted(self.cells)]
        names = sweep.methods
        if sweep.sorted:
            names = tuple(sorted(names, key=lambda name: _rank(cells, name)))
        return StabilityMap(
            sweep.model.name, sweep.axis.name, sweep.axis.what, sweep.axis.unit, sweep.values,
            names, sweep.steps, sweep.t_end, sweep.target,
            tuple(line.reference for line in self.lines), advised(cells), complete, sweep.own,
            sweep.scenario,
        )  # fmt: skip


def _load(sweep: Sweep) -> None:
    """Load the kernels once, so that the threads do not all compile them."""
    mech = mechanism_of(sweep.model, "stability_map")
    impulses = sweep.task(mech, np.zeros(1)).impulses
    own = ("rk4", "moreau_jean") if impulses else ("radau5", "dop853", "dopri5")
    for name in dict.fromkeys((*sweep.methods, *own)):
        try:
            sweep.task(mech, np.linspace(0.0, 1e-9, 2)).run(name, Setting(step=1e-9))
        except PgraphError:
            continue  # each cell reports it


def _line(sweep: Sweep, value: float, work: Work, left: float) -> Line:
    """Return the model at a given axis value with its most accurate known motion."""
    steps = (value,) if sweep.axis.of_steps else sweep.steps
    ends = work.part(1.0 / REFERENCES, left)
    try:
        model = sweep.axis.applied(sweep.model, value)
        times = merged([times_of(sweep.t_end, step) for step in steps], sweep.t_end)
        task = sweep.task(Mechanism(model), times)
        known = known_motion(task, min(steps), sweep.target, sweep.budget, work.until(ends))
    except PgraphError as refused:
        return Line(value, None, steps, None, str(refused))
    why = "no method reaches the end to compare with; try a shorter t_end"
    if time.perf_counter() >= ends:
        why = "no method reaches the end to compare with in the time; try a shorter t_end"
    return Line(value, model, steps, known, "" if known else why)


def _cost(sweep: Sweep, line: Line, method: str, step: float) -> float:
    """Return the expected evaluations of a cell. Cells that are not run cost nothing."""
    most = steps_of(sweep.t_end, step) * per_step(method, sweep.freedoms)
    return 1.0 if line.model is None or most > sweep.allowed else 1.0 + most


def _cell(
    sweep: Sweep, line: Line, method: str, step: float, work: Work, left: float
) -> Cell | None:
    """Return a cell, or None if it was cancelled or out of time.

    A fault in one run never loses the other cells.
    """
    cell = Cell(line.value, method, step, Verdict.FAILED, line.problem, time=0.0)
    try:
        return _measured(sweep, line, cell, work.until(work.part(1.0, left)))
    except PgraphError as refused:
        return replace(cell, text=str(refused))
    except Exception as error:
        return replace(cell, text=f"stopped by {type(error).__name__}: {error}")


def _measured(
    sweep: Sweep, line: Line, cell: Cell, goes_on: Callable[[float], bool]
) -> Cell | None:
    """Return the cell with the verdict on its runs. Raises PgraphError if they are refused."""
    if line.model is None or not goes_on(0.0):
        return cell if line.model is None else None
    mech = Mechanism(line.model)  # one per thread, so that threads share nothing
    count = steps_of(sweep.t_end, cell.step)
    each = per_step(cell.method, mech.nv)
    if (most := count * each) > sweep.allowed:
        text = f"about {most:.1e} evaluations, of which the budget allows {sweep.allowed:.1e}"
        return Cell(cell.value, cell.method, cell.step, Verdict.SLOW, text, evaluations=most)
    task = sweep.task(mech, times_of(sweep.t_end, cell.step))
    task = replace(task, stabilise=sweep.stabilise)
    whole, half = (  # implicit steps that cannot be solved are divided, and may become many
        task.run(
            cell.method,
            Setting(step=sweep.t_end / n, max_steps=max(sweep.allowed // each, n)),
            goes_on,
        )
        for n in (count, 2 * count)
    )
    if Status.CANCELLED in (whole.status, half.status):
        return None
    if line.known is None:
        return _unjudged(cell, task, whole)
    cell = Cell(cell.value, cell.method, cell.step, Verdict.OK, "")
    return judged(cell, sweep.target, mech, whole, half, line.known)


def _unjudged(cell: Cell, task: Task, run: Result) -> Cell:
    """Classify a cell that has no reference motion. Such a cell is never OK."""
    status = Verdict.INACCURATE if run.status.ok else Verdict.FAILED
    if run.status is Status.NOT_FINITE:
        status = Verdict.UNSTABLE
    text = cell.text if run.status.ok else run.message
    most = step_limit(cell.method, task.rate_at([task.mech.home()]))
    until = float(run.t[-1]) if len(run.t) and not run.status.ok else float("nan")
    return replace(cell, status=status, text=text, time=until, step_limit=most)


def steps_of(t_end: float, step: float) -> int:
    """Count the equal steps, each at most `step` long, that end at `t_end`."""
    return max(int(np.ceil(t_end / step - 1e-9)), 1)


def times_of(t_end: float, step: float) -> Array:
    """Compute the times recorded in a cell's runs: some step ends, with all early ones."""
    n = steps_of(t_end, step)
    early = np.arange(min(n, EARLY) + 1)
    chosen = np.unique(np.concatenate((early, np.linspace(0, n, MAP_TIMES).round().astype(int))))
    return np.asarray(chosen * (t_end / n), dtype=np.float64)
