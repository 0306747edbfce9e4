"""`stability_map`: the methods that remain stable as one parameter makes a scene extreme."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.states import with_initial
from ..errors import PgraphError, choices, explained, refusal
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..packing import Array
from ..result import Result, Status
from ..simulation import simulate
from ..simulation.options import positive
from ..simulation.start import with_state
from ..tolerances import NOTABLE
from .axes import AXES, Axis, changed, first_axis
from .map import Cell, StabilityMap, Verdict, judged, step_limit
from .reference import KnownMotion, known_motion, merged, per_step, weight_of
from .task import Setting, Task, finite_numbers, methods_of

STEPS = (1e-1, 1e-2, 1e-3, 1e-4)  # [s]
BUDGET = 20_000_000  # evaluations of a run, times `weight_of`: a second or two
MAP_TIMES = 41  # evenly over a run
EARLY = 10  # first steps, all recorded: an unstable run grows there
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
        return f"{self.known.source}: known to {self.known.accuracy:.0e}"


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
    threads: int | None = None,
    progress: Callable[[float], Any] | None = None,
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
        As in `simulate`.
    budget : int
        Maximum number of dynamics evaluations of a run, multiplied by the number of elementary
        motions.
    threads : int, optional
        Number of threads. By default, one per core is used.
    progress : callable, optional
        Function that is called with the completed fraction. If it returns False, the map only
        contains the completed cells.

    Returns
    -------
    StabilityMap
        The map, which can be printed as a table. Its `advice` recommends a method and step size.

    Raises
    ------
    InputError
        If an argument is invalid.
    """
    given = mech if isinstance(mech, Model) else mechanism_of(mech, CALL).model
    model, duration = in_scenario(given, scenario)
    model = started(model, q, v)
    sweep = _checked(
        model, axis or first_axis(model), values, methods, steps, t_end or duration, target, budget,
        stabilise,
    )  # fmt: skip
    lines, cells, complete = _computed(sweep, progress, threads)
    names = sweep.methods
    if sweep.sorted:
        names = tuple(sorted(names, key=lambda name: _rank(cells, name)))
    return StabilityMap(
        model.name, sweep.axis.name, sweep.axis.what, sweep.axis.unit, sweep.values,
        names, sweep.steps, sweep.t_end, sweep.target,
        tuple(line.reference for line in lines), _advised(cells), complete, sweep.own,
    )  # fmt: skip


def _rank(cells: Sequence[Cell], method: str) -> tuple[int, int]:
    """Return a key that sorts methods by accurate results, and at equal numbers by their cost."""
    right = [c.evaluations for c in cells if c.method == method and c.status is Verdict.OK]
    return -len(right), sum(right)


def _checked(
    model: Model, axis: str, values: Any, methods: Any, steps: Any, t_end: Any, target: Any,
    budget: int, stabilise: str | None,
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
    for field, each in (("steps", widths), ("values", numbers if chosen.of_steps else ())):
        if any(x <= 0 for x in each):
            raise refusal(CALL, field, f"steps must be > 0 [s], got {min(each):g}")
    end = positive("t_end", t_end, call=CALL)
    aim = positive("target", target, unit="", call=CALL)
    limits = model.limited
    touching = any(c.active and c.law != "soft" for c in model.contacts)
    names = methods_of(CALL, methods, impulses=limits or touching, suited=False)
    chosen.applied(model, numbers[0])  # raises if the model lacks what the axis varies
    return Sweep(
        model, chosen, numbers, names, widths, end, aim, int(budget), stabilise, own,
        methods is None,
    )  # fmt: skip


# -- the model that a map starts from --------------------------------------------------------------


def in_scenario(model: Model, name: str | None) -> tuple[Model, float]:
    """Apply a scenario's state, forces and active parts to the model. Return (model, duration [s]).

    Raises ModelError for an unknown scenario, InputError for one with switches.
    """
    if name is None:
        return model, 1.0
    s = model.scenario(name)
    if s.switches:
        text = f"{name} switches constraints on and off, which a map does not support; "
        raise refusal(CALL, "scenario", f"{text}choose another, or none")
    bodies = tuple(
        changed(b, q=s.q.get(b.name, b.q), v=s.v.get(b.name, b.v))
        if b.name in s.q or b.name in s.v
        else b
        for b in model.bodies
    )
    constraints, contacts = (
        parts
        if names is None
        else tuple(p.unchecked_copy({"active": p.name in names}) for p in parts)
        for parts, names in ((model.constraints, s.constraints), (model.contacts, s.contacts))
    )
    parts = {"bodies": bodies, "constraints": constraints, "contacts": contacts, "scenarios": ()}
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
    """Progress of the work done by the threads."""

    def __init__(self, total: int, progress: Callable[[float], Any] | None):
        self.total, self.done, self.progress = total, 0, progress
        self.stopped = threading.Event()

    def goes_on(self, _: float = 0.0) -> bool:
        """The progress function that is passed to each run."""
        return not self.stopped.is_set()

    def finished(self, futures: Sequence[Future[Any]]) -> Iterator[Any]:
        """Yield results as they become available, in the caller's thread, until the caller cancels.

        An exception, including Ctrl-C, also stops the other threads.
        """
        try:
            for future in as_completed(futures):
                self.done += 1
                answer = None if self.progress is None else self.progress(self.done / self.total)
                if answer is not None and not answer:
                    self.stop(futures)
                    return
                yield future.result()
        except BaseException:
            self.stop(futures)
            raise

    def stop(self, futures: Sequence[Future[Any]]) -> None:
        """Cancel pending runs and stop those in progress."""
        self.stopped.set()
        for one in futures:
            one.cancel()


def _computed(
    sweep: Sweep, progress: Callable[[float], Any] | None, threads: int | None
) -> tuple[list[Line], list[Cell], bool]:
    """Compute a map. Return (lines, ordered cells, whether the map is complete)."""
    per_line = len(sweep.methods) * max(len(sweep.steps), 1)
    work = Work(len(sweep.values) * (1 + per_line), progress)
    # compile the kernels once, so that the threads do not all compile them
    mech = mechanism_of(sweep.model, "stability_map")
    impulses = Task(mech, None, None, np.zeros(1)).impulses
    own = ("rk4", "moreau_jean") if impulses else ("radau5", "dop853", "dopri5")
    for name in dict.fromkeys((*sweep.methods, *own)):
        try:
            simulate(mech, t_end=1e-9, step=1e-9, method=name, estimate=False)
        except PgraphError:
            continue  # each cell reports it
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        jobs = [pool.submit(_line, sweep, value, work) for value in sweep.values]
        lines = sorted(work.finished(jobs), key=lambda line: sweep.values.index(line.value))
        cells: list[tuple[int, Cell]] = []
        if not work.stopped.is_set():
            grid = [(line, m, step) for line in lines for m in sweep.methods for step in line.steps]
            jobs = [pool.submit(_cell, sweep, i, *one, work) for i, one in enumerate(grid)]
            cells = [cell for cell in work.finished(jobs) if cell is not None]
    cells.sort(key=lambda pair: pair[0])
    return lines, [cell for _, cell in cells], not work.stopped.is_set()


def _line(sweep: Sweep, value: float, work: Work) -> Line:
    """Return the model at a given axis value with its most accurate known motion."""
    steps = (value,) if sweep.axis.of_steps else sweep.steps
    try:
        model = sweep.axis.applied(sweep.model, value)
        times = merged([times_of(sweep.t_end, step) for step in steps], sweep.t_end)
        task = Task(Mechanism(model), None, None, times)
        known = known_motion(task, min(steps), sweep.target, sweep.budget, work.goes_on)
    except PgraphError as refused:
        return Line(value, None, steps, None, str(refused))
    problem = "" if known else "no method reaches the end to compare with; try a shorter t_end"
    return Line(value, model, steps, known, problem)


def _cell(
    sweep: Sweep, index: int, line: Line, method: str, step: float, work: Work
) -> tuple[int, Cell] | None:
    """Return a cell with its index, or None if the map was cancelled."""
    cell = Cell(line.value, method, step, Verdict.FAILED, line.problem, time=0.0)
    if line.model is None:
        return index, cell
    mech = Mechanism(line.model)  # one per thread, so that threads share nothing
    count = steps_of(sweep.t_end, step)
    each, allowed = per_step(method, mech.nv), sweep.budget // weight_of(mech)
    most = count * each
    if most > allowed:
        text = f"about {most:.1e} evaluations, of which the budget allows {allowed:.1e}"
        return index, Cell(line.value, method, step, Verdict.SLOW, text, evaluations=most)
    task = Task(mech, None, None, times_of(sweep.t_end, step), stabilise=sweep.stabilise)
    try:
        whole, half = (  # implicit steps that cannot be solved are divided, and may become many
            task.run(
                method,
                Setting(step=sweep.t_end / n, max_steps=max(allowed // each, n)),
                work.goes_on,
            )
            for n in (count, 2 * count)
        )
    except PgraphError as refused:
        return index, replace(cell, text=str(refused))
    if Status.CANCELLED in (whole.status, half.status):
        return None
    if line.known is None:
        return index, _unjudged(cell, task, whole)
    cell = Cell(line.value, method, step, Verdict.OK, "")
    return index, judged(cell, sweep.target, mech, whole, half, line.known)


def _unjudged(cell: Cell, task: Task, run: Result) -> Cell:
    """Classify a cell that has no reference motion. Such a cell is never OK."""
    status = Verdict.INACCURATE if run.status.ok else Verdict.FAILED
    if run.status is Status.NOT_FINITE:
        status = Verdict.UNSTABLE
    text = cell.text if run.status.ok else run.message
    most = step_limit(cell.method, task.rate_at([task.mech.home()]))
    time = float(run.t[-1]) if len(run.t) and not run.status.ok else float("nan")
    return replace(cell, status=status, text=text, time=time, step_limit=most)


def steps_of(t_end: float, step: float) -> int:
    """Count the equal steps, each at most `step` long, that end at `t_end`."""
    return max(int(np.ceil(t_end / step - 1e-9)), 1)


def times_of(t_end: float, step: float) -> Array:
    """Compute the times recorded in a cell's runs: some step ends, with all early ones."""
    n = steps_of(t_end, step)
    early = np.arange(min(n, EARLY) + 1)
    chosen = np.unique(np.concatenate((early, np.linspace(0, n, MAP_TIMES).round().astype(int))))
    return np.asarray(chosen * (t_end / n), dtype=np.float64)


def _advised(cells: list[Cell]) -> tuple[Cell, ...]:
    """Add the methods that are OK at the same value and step to each cell that is not OK."""
    good: dict[tuple[float, float], list[str]] = {}
    for cell in cells:
        if cell.status is Verdict.OK:
            good.setdefault((cell.value, cell.step), []).append(cell.method)
    found = []
    for cell in cells:
        others = good.get((cell.value, cell.step), [])
        if cell.status is not Verdict.OK and others:
            cell = replace(cell, text=f"{cell.text}; at this step use {choices(others, 3)}")
        found.append(cell)
    return tuple(found)
