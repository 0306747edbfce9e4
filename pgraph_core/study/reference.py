"""Reference motions for studies, with estimates of their accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..errors import InputError, PgraphError, Suggests, explained, refusal
from ..integrators import METHODS
from ..mechanism import Mechanism
from ..packing import Array
from ..result import Result, Status
from ..simulation.choice import MANY_RADIANS
from ..tolerances import NOTABLE, ROUNDING, SOLVED
from ..verification import Case, States
from .measures import TRUST, Measure, joint_errors, measure_of, rms
from .task import Progress, Setting, Task

GIVEN, MADE = 3.0, TRUST  # errors below so many times the reference's own are not resolved
GOOD = SOLVED / TRUST  # accuracy at which the search for a better reference ends
OF_STATES = ("q", "point", "direction", "rotation")  # observables that follow from q alone
FINEST = {"dop853": (1e-14, 1e-13), "radau5": (1e-13, 1e-12)}

ROW_COST = 3  # a row of a constraint costs as much as so many elementary motions
REFERENCE_BUDGET = 10  # budget of a reference relative to that of another run
STATES = 5  # at which the fastest rate is evaluated
NEWTON_COST = 12  # evaluations of an implicit step in addition to its Jacobian, about

Candidate = tuple[str, Setting]  # a method and a setting
SHORTER = 4  # a motion too long for its runs is cut to what the best of them reached, over this


@explained
@dataclass(frozen=True)
class Reference(Suggests):
    """A reference motion at given times, with an estimate of its own error."""

    t: Array  # (n,) [s]
    errors: Measure
    accuracy: float  # error of the reference itself
    source: str  # origin of the reference, in words
    margin: float = GIVEN
    parted: bool = False  # True if it ends where two references diverge

    @property
    def limit(self) -> float:
        """The smallest error that the reference can resolve."""
        return self.margin * self.accuracy

    @classmethod
    def of_motion(cls, task: Task, t: Array, q: Array, accuracy: float, source: str) -> Reference:
        """Use a motion of the mechanism as the reference."""
        return cls(t, measure_of(task.mech, q), accuracy, source)


def of_case(case: Case) -> Reference:
    """Build a reference from those observables of a case that are functions of q over time.

    Raises InputError if it has none.
    """
    mech = Mechanism(case.model)
    kept = [each for each in case.observables if each.kind in OF_STATES and each.frames is None]
    if case.t is None or len(case.t) < 2 or not kept:
        text = "has no motion over time to compare with; choose another case"
        raise refusal(f"case '{case.name}'", "", text)

    def measured(q: Array) -> Array:
        states = States(mech, q, np.zeros((len(q), mech.nv)))
        return np.column_stack([each.errors(states) for each in kept])

    return Reference(case.t, measured, case.accuracy, f"case {case.name}, {case.how_obtained}")


def given(task: Task, reference: Any) -> Reference:
    """Build a reference from the caller's argument: a Case, a Reference, a Result, or (t, q).

    Raises InputError.
    """
    if isinstance(reference, Case):
        return of_case(reference)
    if isinstance(reference, Reference):
        return reference
    if isinstance(reference, Result):
        method = reference.header.get("method", "unknown method")
        accuracy = float(np.nan_to_num(reference.error_estimate, nan=0.0, posinf=np.inf))
        source = f"given run, {method}"
        return Reference.of_motion(task, reference.t, reference.q, accuracy, source)
    try:
        t, q = (np.array(part, dtype=float) for part in reference)
    except (TypeError, ValueError):
        t, q = np.zeros(0), np.zeros(0)
    if t.ndim != 1 or len(t) < 2 or q.shape != (len(t), task.mech.nq):
        text = "must be a Result, a Case, a Reference, or (t, q) with at least two times and q of "
        text += f"shape (len(t), {task.mech.nq}), got {type(reference).__name__}"
        raise refusal("work_precision", "reference", text)
    return Reference.of_motion(task, t, q, 0.0, "given states, taken as exact")


# -- made: the best of some fine runs, checked by another ------------------------------------------


@dataclass
class Shortfall:
    """Record of runs that fell short of the end."""

    texts: list[str] = field(default_factory=list[str])  # messages of runs that failed
    late: str = ""  # the method that came farthest of those that took too long
    reached: float = 0.0  # and how far [s]

    def note_late(self, method: str, reached: float) -> None:
        """Note a run that took too long."""
        if not self.late or reached > self.reached:
            self.late, self.reached = method, reached


def _completed(
    task: Task,
    candidates: Iterable[Candidate],
    watch: Callable[[str], Progress],
    estimate: bool,
    short: Shortfall,
) -> Iterator[Result]:
    """Yield the runs that reach the end time, stopping as soon as one takes too long.

    The others are noted in `short`, and `watch` gives the progress of a method. Raises the last
    error if every run was refused.
    """
    refused: PgraphError | None = None
    ran = False
    exhausted: set[bool] = set()  # explicit or implicit methods, where one took too many steps
    for method, setting in candidates:
        if METHODS[method].implicit in exhausted:
            continue
        far = [0.0]
        try:
            run = task.run(method, setting, _seen(watch(method), far), estimate=estimate)
        except PgraphError as error:
            refused = error
            continue
        ran = True
        if run.status.ok:
            yield run
        elif run.status is Status.CANCELLED:
            short.note_late(method, far[-1] * task.t_end)
            return
        else:
            short.texts.append(f"{method}: {run.message}")
            if run.status is Status.TOO_MANY_STEPS:
                exhausted.add(METHODS[method].implicit)
    if refused is not None and not ran:
        raise refused


def _seen(progress: Progress, far: list[float]) -> Progress:
    """Return a progress function that also keeps the fractions it is called with."""

    def look(fraction: float) -> Any:
        far.append(fraction)
        return progress(fraction)

    return look


def finest(
    task: Task, rate: float, step: float, watch: Callable[[bool], Progress], sure: str = ""
) -> tuple[Reference, Task]:
    """Return the most accurate fine run, its distance to the second finest run, and its task.

    Chaotic motions are shortened to the time up to which both agree, and long ones to what a run
    reaches in time. `rate` is the fastest rate of the motion [1/s], `step` the finest of the ladder
    [s]. `watch(False)` limits the time of a run, and `watch(True)` does not: method `sure` has come
    beyond the end before, in the time that it has, so that it only needs a part of that time again.
    Raises InputError, with the cause, if no method reaches the end.
    """
    best: tuple[float, Array, Array, str] | None = None
    short = Shortfall()
    for pair in _pairs(task, rate, step):
        try:
            runs = list(_completed(task, pair, lambda m: watch(m == sure), False, short))
        except InputError as error:
            short.texts.append(error.problems[0].text)
            continue
        if len(runs) < 2:
            continue
        (method, fine), (_, coarse) = pair
        source = f"{method} at {fine} against {coarse}"
        apart = measure_of(task.mech, runs[0].q)(runs[1].q)
        if best is None or rms(apart) < best[0]:
            best = rms(apart), runs[0].q, apart, source
        if best[0] < GOOD or horizon(best[2]) > 1:
            break
    if best is None:
        return finest(_part(task, short, sure), rate, step, watch, short.late)
    own, motion, apart, source = best
    until = float(task.t[horizon(apart) - 1])
    if own > NOTABLE and 0 < until < task.t_end:
        part = replace(task, t=np.linspace(0.0, until, len(task.t)))
        found, task = finest(part, rate, step, watch, sure)
        return replace(found, parted=True), task
    known = Reference.of_motion(task, task.t, motion, own, source)
    return replace(known, margin=MADE), task


def _part(task: Task, short: Shortfall, sure: str) -> Task:
    """Return the part of the motion for which the best of the late runs has shown to have time.

    Raises InputError if there was none.
    """
    if short.reached > 0.0 and not sure:
        return replace(task, t=np.linspace(0.0, short.reached / SHORTER, len(task.t)))
    text = f"no method reached the end at its finest setting: {next(iter(short.texts), '')}"
    if short.late and not sure:
        text = "no fine run took a step in time, so there is no reference: give a larger `within`, "
        text += "or a `reference` that is known"
    raise refusal("work_precision", "reference", text)


def _pairs(task: Task, rate: float, step: float) -> Iterator[tuple[Candidate, Candidate]]:
    """Yield the finest and second finest settings of each method, the best candidate first."""
    if task.impulses:
        fine, coarse = FINEST["dop853"]
        yield ("dop853", Setting(rtol=10 * fine)), ("dop853", Setting(rtol=10 * coarse))
        for name in ("rk4", "moreau_jean"):
            yield (name, Setting(step=step / 4)), (name, Setting(step=step / 2))
        return
    stiff = rate * task.t_end > MANY_RADIANS
    for name in ("radau5", "dop853") if stiff else ("dop853", "radau5"):
        fine, coarse = FINEST[name]
        yield (name, Setting(rtol=fine)), (name, Setting(rtol=coarse))


def horizon(apart: Array) -> int:
    """Count the leading times at which two runs agree."""
    far = np.flatnonzero(apart.max(axis=1) > SOLVED)
    return int(far[0]) if len(far) else len(apart)


class KnownMotion(NamedTuple):
    """The most accurate known motion for one value in a stability map."""

    run: Result
    accuracy: float  # its largest error, in the units of `joint_errors`
    source: str
    rate: float  # the fastest of the motion [1/s]
    energy: float  # range of its energies [J]

    @property
    def known(self) -> str:
        """Return a clause about the accuracy of the motion."""
        if np.isfinite(self.accuracy):
            return f"known to {self.accuracy:.1e}"
        return "not known, as its error is not"

    def at(self, t: Array) -> Array:
        """Compute the states at times of the run as a (len(t), nq) array."""
        return self.run.q[np.searchsorted(self.run.t, t * (1 - ROUNDING) - 1e-300)]


def merged(times: list[Array], t_end: float) -> Array:
    """Merge lists of times into one sorted array without duplicates."""
    every = np.unique(np.concatenate(times))
    return every[np.diff(every, prepend=-t_end) > ROUNDING * t_end]


def known_motion(
    task: Task, step: float, target: float, budget: int, progress: Progress
) -> KnownMotion | None:
    """Return the better of two runs by different methods, or None if no run reaches the end.

    The accuracy is the difference between both runs, or the estimate of the better run if the other
    run is within its own estimate. `step` is the smallest step of all cells [s], and `budget` the
    budget of one cell. Raises PgraphError if no method accepts the scene.
    """
    mech = task.mech
    rate = task.rate_at([mech.home()])
    rtol = min(SOLVED, max(NOTABLE * target, ROUNDING))
    allowed = REFERENCE_BUDGET * budget // weight_of(mech)
    tries = _opinions(mech.nv, rate * task.t_end, task.impulses, step, rtol, allowed)
    done: list[tuple[Result, float]] = []
    for run in _completed(task, tries, lambda _: progress, True, Shortfall()):
        done.append((run, float(run.error_estimate) * max(1.0, 1.0 / (mech.packed.length or 1.0))))
        if len(done) == 2:
            break
    if not done:
        return None
    run, accuracy = min(done, key=lambda pair: np.nan_to_num(pair[1], nan=np.inf))
    source = f"{_setting(run)}, by its own estimate"
    if len(done) == 2:
        other, theirs = done[0] if done[1][0] is run else done[1]
        apart = float(joint_errors(mech, run.q, other.q).max(initial=0.0))
        accuracy = min(apart, accuracy) if apart <= TRUST * theirs else apart
        source = f"{_setting(run)} and {_setting(other)}"
    some = np.linspace(0, len(run.t) - 1, STATES).astype(int)
    rate = max(rate, task.rate_at([(run.q[i].copy(), run.v[i].copy()) for i in some]))
    accuracy = accuracy if np.isfinite(accuracy) else np.inf
    return KnownMotion(run, accuracy, source, rate, _energy_range(run))


def _opinions(
    nv: int, radians: float, impulses: bool, step: float, rtol: float, budget: int
) -> Iterator[Candidate]:
    """Yield candidate settings to try until two of them reach the end."""
    if impulses:
        yield "rk4", Setting(step=step / 2)
        yield "moreau_jean", Setting(step=step / 2)
        yield "moreau_jean", Setting(step=step / 4)
        return
    explicit, implicit = [("dop853", rtol), ("dopri5", 10 * rtol)], [("radau5", rtol)]
    first = implicit if radians > MANY_RADIANS else explicit
    for name, tolerance in (*first, ("radau5", 10 * rtol)):
        yield name, Setting(rtol=tolerance, max_steps=max(budget // per_step(name, nv), 1))


def weight_of(mech: Mechanism) -> int:
    """Compute the cost of evaluating the dynamics, measured in elementary motions."""
    blocks = mech.packed.blocks
    spans = zip(mech.model.constraints, blocks.first, blocks.first[1:])
    rows = sum(blocks.blocks_i[a:b, at.B_SIZE].sum() for c, a, b in spans if c.active)
    return len(mech.packed.system.rows) + ROW_COST * int(rows)


def per_step(method: str, nv: int) -> int:
    """Compute the approximate number of evaluations per step, including a numerical Jacobian."""
    chosen = METHODS[method]
    if chosen.implicit and not chosen.jacobian:
        return NEWTON_COST * chosen.evaluations
    return NEWTON_COST + 2 * nv if chosen.implicit else chosen.evaluations


def _setting(run: Result) -> str:
    rtol, step = run.header["rtol"], run.header["step"]
    return f"{run.header['method']} {f'step {step:g} s' if rtol is None else f'rtol {rtol:g}'}"


def _energy_range(run: Result) -> float:
    parts = (run.kinetic_energy, run.potential_energy, run.work, run.dissipation)
    return max(max(float(np.ptp(x)) for x in parts), float(run.kinetic_energy.max()))
