"""Optimal designs and inputs: numbers of a model that make a goal of its runs least."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from ..dynamics import model_of
from ..errors import InputError, ModelError, Suggests, counted, explained, needed, shown
from ..mechanism import Mechanism
from ..model import Model
from ..result import Result
from ..sweeps.metrics import measured as metric
from ..sweeps.metrics import words
from ..tolerances import EPS, NOTABLE
from .free import FAR, Case, Numbers, Values, option

Array = np.ndarray
SOLVERS = ("SLSQP", "trust-constr", "L-BFGS-B", "least_squares")
SILENCE = 5.0  # seconds after which a person wonders whether anything happens
INSIDE = np.cbrt(EPS)  # share of its range by which a number is moved off a bound


class Trial(NamedTuple):
    """One evaluation of a search."""

    values: dict[str, float]
    objective: float  # nan if the run failed
    constraints: dict[str, float]
    failed: str = ""  # why, or ""


class Ending(NamedTuple):
    """End of a search from one start."""

    values: dict[str, float]
    objective: float
    converged: bool


@explained
@dataclass(frozen=True, eq=False)
class Optimum(Suggests):
    """The result of `optimise`."""

    model: Model  # the model with them
    values: Mapping[str, float]
    objective: float
    constraints: Mapping[str, float]
    active: tuple[str, ...]  # a sentence for each bound and each constraint that limits the goal
    converged: bool
    message: str
    evaluations: int  # runs
    history: tuple[Trial, ...]  # all evaluations
    endings: tuple[Ending, ...]  # one for each start
    run: Result

    @property
    def x(self) -> Array:
        """The values as an array (k,)."""
        return np.array([*self.values.values()])

    def __repr__(self) -> str:
        values = [f"  {path} = {value:.6g}" for path, value in self.values.items()]
        lines = [f"<Optimum {self.objective:.6g}: {self.message}", *values]
        lines += [f"  {name}: {value:.6g}" for name, value in self.constraints.items()]
        return "\n".join([*lines, *(f"  {text}" for text in self.active)]) + ">"

    def plot(self) -> Any:
        """A matplotlib figure of the goal over all evaluations. Raises MissingPackage."""
        figure, axes = needed("matplotlib.pyplot", "plot").subplots()
        axes.plot([trial.objective for trial in self.history], ".-")
        axes.set(xlabel="evaluation", ylabel="objective")
        return figure


@explained
def optimise(
    model: Model | Mechanism,
    objective: str | Callable[[Result], Any],
    free: Mapping[Any, Any],
    *,
    subject_to: Mapping[str, Sequence[Any]] | None = None,
    scenario: str | None = None,
    solver: str | None = None,
    starts: int | Sequence[Mapping[str, float]] = 1,
    history: str | FilePath | Optimum | None = None,
    differences: float | None = None,
    tol: float = 1e-8,
    most: int = 200,
    seed: int = 0,
    progress: Callable[[Trial, Result | None], Any] | bool | None = None,
    **options: Any,
) -> Optimum:
    """Minimise an objective of a run over parameters of a model.

    The optimisation uses the solvers of SciPy with exact derivatives of each run. If a run fails,
    the step of the solver is reduced. Pressing Ctrl-C ends the search and returns the best result
    found so far.

    Parameters
    ----------
    model : Model or Mechanism
        The model to optimise. Its values are the initial guess.
    objective : str or callable
        The objective to minimise. This can be a metric as for `sweep`, such as "peak v.knee", with
        a leading minus sign for maximisation. Alternatively, it can be a function of the run that
        returns a number, or an array whose sum of squares is minimised.
    free : dict
        Bounds (low, high) by path, as for `fit`. Use None for no bound. The path of a list or of a
        table over time selects all of its values, so {"forces.push.torque": (-5, 5)} can be used to
        optimise an input over time.
    subject_to : dict, optional
        Constraints as limits (low, high) by metric, for example {"peak v.knee": (None, 3.0)}. Equal
        limits define an equality constraint. To constrain a function of the run, use {NAME:
        (function, low, high)}.
    scenario : str, optional
        Name of the scenario to run.
    solver : {"SLSQP", "trust-constr", "L-BFGS-B", "least_squares"}, optional
        The default is "least_squares" if the objective is an array and there are no constraints,
        and "SLSQP" otherwise.
    starts : int or sequence of dict
        Number of starting points. All but the first are random, depending on `seed`. Alternatively,
        a sequence of dictionaries with values by path.
    history : path or Optimum, optional
        A previous search whose best result is used as the initial guess. If this is a file, every
        evaluation is appended to it, so that an interrupted search can be continued.
    differences : float, optional
        Relative step size of finite differences, as a fraction of the range of each value. This is
        required for runs without exact derivatives.
    tol, most : float, int
        Tolerance for convergence (relative change of the objective), and maximum number of
        iterations per starting point.
    progress : callable or bool, optional
        Function that is called with each trial and its run. The search stops if it returns False.
        By default, or if True, a search that takes long writes lines to the standard error stream.
    **options
        Additional arguments of `simulate`, such as `t_end`, `method` and `step`.

    Returns
    -------
    Optimum
        The best values found. If the search did not converge, see `message`.

    Raises
    ------
    InputError
        If an argument is invalid, or if the runs have no derivatives and `differences` is not
        given.

    Examples
    --------
    >>> free = {"bodies.2.mass": (0.5, 2.0)}
    >>> pg.optimise(pg.Model.serial(2), "peak v.1", free, t_end=0.5, method="rk4").converged
    True
    """
    given = options if scenario is None else {"scenario": scenario, **options}
    base = model_of("optimise", model)
    numbers = Numbers("optimise", base, free, [Case("", given)], bounded=False)
    _check(numbers, solver, differences, tol, most)
    goals = Goals(numbers, objective, subject_to or {})
    progress = _told_at_times() if progress in (None, True) else progress
    search = _Search(numbers, goals, differences, progress, history)
    return search.over(_starts(numbers, starts, seed, search.earlier), solver, tol, most)


def _told_at_times() -> Callable[[Trial, Result | None], None]:
    """Return a function of each trial that writes a line if the last one is long ago."""
    runs, best, last = 0, math.inf, time.monotonic()

    def tell(trial: Trial, _: Result | None) -> None:
        nonlocal runs, best, last
        runs, best = runs + 1, min(best, math.inf if trial.failed else trial.objective)
        if time.monotonic() - last > SILENCE:
            last = time.monotonic()
            missed = "".join(f", {name}: {value:.4g}" for name, value in trial.constraints.items())
            told = f"optimise: {counted(runs, 'run')}, least objective {best:.6g}{missed}"
            print(told, file=sys.stderr, flush=True)

    return tell


def _check(numbers: Numbers, solver: Any, differences: Any, tol: float, most: int) -> None:
    """Raise InputError for settings of a search out of their range."""
    if solver is not None:
        option("optimise", "solver", solver, SOLVERS)
    for name, value, good in (
        ("differences", differences, differences is None or 0.0 < differences < 1.0),
        ("tol", tol, tol > 0.0),
        ("most", most, most >= 1),
    ):
        if not good:
            raise numbers.refused(name, f"is out of its range, got {shown(value)}")


class _Stopped(Exception):
    """The search was cancelled."""


class _Point(NamedTuple):
    u: Array
    run: Result | None
    values: Array


class _Search:
    """Evaluations of a search. Its numbers u are in units of their sizes."""

    def __init__(
        self,
        numbers: Numbers,
        goals: Goals,
        differences: float | None,
        progress: Any,
        history: Any,
    ):
        self.numbers, self.goals, self.differences = numbers, goals, differences
        self.progress, self.history = progress, list[Trial]()
        self.file = FilePath(history) if isinstance(history, (str, FilePath)) else None
        self.earlier = self._read(history)
        self.good: _Point | None = None  # the last point that has a run
        self.best: _Point | None = None
        self._last: _Point | None = None
        self._slopes: tuple[Array, Array] | None = None
        self.idle: set[str] = set()  # numbers without influence on the motion

    def _read(self, history: Any) -> dict[str, float]:
        """The best values of an earlier search, {} if there is none."""
        trials = []
        if isinstance(history, Optimum):
            return dict(history.values)
        if self.file is None:
            if history is not None:
                text = f"must be an Optimum or the name of a file, got {shown(history)}"
                raise self.numbers.refused("history", text)
            return {}
        if self.file.exists():
            try:
                lines = self.file.read_text("utf-8").splitlines()
                trials = [Trial(**json.loads(line)) for line in lines]
            except (OSError, ValueError, TypeError) as error:
                raise self.numbers.refused("history", f"{self.file}: {error}") from None
        trials = [trial for trial in trials if not trial.failed]
        for trial in trials[:1]:
            if [*trial.values] != self.numbers.names:
                text = f"{self.file} is of a search for other numbers; give another file"
                raise self.numbers.refused("history", text)
        made = [(self._judged(trial), k) for k, trial in enumerate(trials)]
        return trials[min(made)[1]].values if made else {}

    def _judged(self, trial: Trial) -> tuple[float, float]:
        goals = self.goals
        found = np.array([0.0] * goals.count + [trial.constraints[name] for name in goals.names])
        missed = goals.missed(found)
        return (missed if missed > NOTABLE else 0.0, trial.objective)

    # -- evaluations -------------------------------------------------------------------------------

    def at(self, u: Array) -> _Point:
        """The goals at u. If the run fails, large values are returned to reduce the step of the
        solver."""
        if self._last is not None and np.array_equal(self._last.u, u):
            return self._last
        goals, numbers = self.goals, self.numbers
        values, found = self._values(u), np.zeros(0)
        run, failed = self._run(self._x(u))
        if run is not None:
            if self.good is None:
                goals.begin(run)
            found = goals(run)
            if not np.isfinite(found).all():
                failed = numbers.failed = "the goal of a run is not finite"
        if run is not None and not failed:
            point = _Point(u.copy(), run, found)
            self.good = point
            parts = dict(zip(goals.names, found[goals.count :].tolist()))
            trial = Trial(values, goals.total(found), parts)
            if self.best is None or self._order(point) < self._order(self.best):
                self.best = point
        else:
            good = self.good
            if good is None:
                raise numbers.refused("model", f"its run fails at the start: {failed}")
            found = good.values.copy()
            own = found[: goals.count]
            own += FAR * (1.0 + np.abs(own).max())
            point = _Point(u.copy(), None, found)
            trial = Trial(values, math.nan, {}, failed)
        self._last = point
        self._note(trial, run)
        return point

    def _run(self, x: Array) -> tuple[Result | None, str]:
        runs = self.numbers.runs(x, False)
        return (None, self.numbers.failed) if runs is None else (runs[0], "")

    def _exact(self, u: Array) -> Array:
        """Return the exact derivatives of the goals, (goals, free).

        On a bound beyond which no model is valid, they are those a millionth of the range inside.
        """
        numbers, x = self.numbers, self._x(u)
        inside = np.clip(x, *(numbers.bounds + INSIDE * numbers.size[:, None] * [1.0, -1.0]).T)
        before = numbers.failed
        for at in (x, inside):
            try:
                runs = numbers.runs(at, True)
                if runs is not None:
                    moved, by = runs[0].derivatives, runs[0].gradient(self.goals)
                    numbers.failed = before
                    self.idle = {a for a, place in numbers.named() if not moved[place.text].any()}
                    return np.column_stack([by[place.text] for place in numbers.places])
            except ModelError as error:
                numbers.failed = str(error.problems[0])
            except InputError as error:
                if not any("derivative" in problem.text for problem in error.problems):
                    raise
                numbers.failed = error.problems[0].text
        if self._slopes is None:
            text = f"{numbers.failed}; or give differences=1e-4 to do without derivatives"
            raise numbers.refused("model", text)
        raise _Stopped(f"not converged: no derivatives {numbers.failed}")

    def _order(self, point: _Point) -> tuple[float, float]:
        missed = self.goals.missed(point.values)
        return (missed if missed > NOTABLE else 0.0, self.goals.total(point.values))

    def _note(self, trial: Trial, run: Result | None) -> None:
        self.history.append(trial)
        if self.file is not None:
            with self.file.open("a", encoding="utf-8") as file:
                file.write(json.dumps(trial._asdict()) + "\n")
        if callable(self.progress) and self.progress(trial, run) is False:
            raise _Stopped

    def slopes(self, u: Array) -> Array:
        """(goals, free) the derivatives of the goals by u."""
        if self._slopes is not None and np.array_equal(self._slopes[0], u):
            return self._slopes[1]
        point, numbers = self.at(u), self.numbers
        if point.run is None:
            assert self.good is not None
            away = u - self.good.u
            found = np.zeros((len(point.values), len(u)))
            rise = (point.values - self.good.values)[:, None]
            found += 2.0 * rise * away / max(float(away @ away), np.finfo(float).tiny)
        elif self.differences is None:
            found = self._exact(u) * numbers.size
        else:
            found = np.column_stack([self._difference(point, k) for k in range(len(u))])
        self._slopes = u.copy(), found
        return found

    def _difference(self, point: _Point, k: int) -> Array:
        """Compute a central difference, or a one-sided difference if one of the runs fails."""
        low, high = self.numbers.bounds[k] / self.numbers.size[k]
        found, share = [], self.differences or 0.0
        for h in (-share, share):
            u = point.u.copy()
            u[k] = min(max(u[k] + h, low), high)
            run, _ = self._run(u * self.numbers.size)
            if run is not None and u[k] != point.u[k]:
                found.append((u[k], self.goals(run)))
        if not found:
            return np.zeros(len(point.values))
        if len(found) == 1:
            found.append((point.u[k], point.values))
        return (found[1][1] - found[0][1]) / (found[1][0] - found[0][0])

    # -- solvers -----------------------------------------------------------------------------------

    def over(self, starts: Sequence[Array], solver: str | None, tol: float, most: int) -> Optimum:
        """Search from each start, and return the best of all."""
        ended, stopped = list[tuple[_Point, bool, str]](), False
        for k, x in enumerate(starts):
            self.best = self.good = self._last = None
            u, converged = x / self.numbers.size, False
            try:
                self.at(u)
                if k == 0:
                    self._has_influence()
                converged, text = self._solve(u, solver, tol, most)
            except (_Stopped, KeyboardInterrupt) as stop:
                stopped, text = not str(stop), str(stop) or "stopped by the user"
            except InputError:
                if k == 0:
                    raise
                continue  # a random start without a run
            if self.best is not None:
                ended.append((self.best, converged, text))
            if stopped:
                break
        if not ended:
            raise KeyboardInterrupt
        return self._found(ended)

    def _x(self, u: Array) -> Array:
        return np.clip(u * self.numbers.size, *self.numbers.bounds.T)

    def _has_influence(self) -> None:
        """Refuse numbers that change neither the goal nor a constraint at the start."""
        assert self.good is not None
        for name, slope in zip(self.numbers.names, self.slopes(self.good.u).T):
            if name in self.idle and not slope.any():
                text = "has no influence on the motion or the objective; omit it"
                raise self.numbers.refused(name, text)

    def _solve(self, u: Array, solver: str | None, tol: float, most: int) -> tuple[bool, str]:
        """Search from u. Return True if the search converged, and the reason for termination."""
        goals, numbers = self.goals, self.numbers
        chosen = solver or ("least_squares" if goals.squares and not goals.names else "SLSQP")
        if chosen in ("least_squares", "L-BFGS-B") and goals.names:
            raise numbers.refused("solver", f"{chosen!r} takes no constraints")
        if chosen == "least_squares" and not goals.squares:
            text = "'least_squares' needs an objective that returns an array"
            raise numbers.refused("solver", text)
        bounds = (numbers.bounds / numbers.size[:, None]).T
        if chosen == "least_squares":
            found = self._least_squares(u, bounds, tol, most)
            good = found.status > 0
        else:
            found = self._minimised(u, chosen, bounds, tol, most)
            good = found.success or (found.status in (1, 2) and chosen == "trust-constr")
        missed = goals.missed(self.best.values) if self.best is not None else 0.0
        if missed > NOTABLE:
            return False, f"not converged: constraints are missed by {missed:.2g} of their size"
        if self.history[-1].failed:
            return False, f"not converged: limited by {numbers.failed}"
        return bool(good), "converged" if good else _limit(found, most)

    def _least_squares(self, u: Array, bounds: Array, tol: float, most: int) -> Any:
        from scipy.optimize import least_squares

        least: Any = least_squares  # typed too narrowly
        return least(
            lambda u: self.at(u).values, u, jac=self.slopes, bounds=bounds, x_scale="jac",
            ftol=tol, xtol=tol, gtol=tol, max_nfev=most,
        )  # fmt: skip

    def _minimised(self, u: Array, chosen: str, bounds: Array, tol: float, most: int) -> Any:
        """Minimise the objective subject to the limits, all scaled by their initial derivatives."""
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        goals, n, first = self.goals, self.goals.count, self.slopes(u)
        scale = 1.0 / (np.abs(self._one(first, self.at(u))).max() or 1.0)

        def total(u: Array) -> tuple[float, Array]:
            point = self.at(u)
            return scale * goals.total(point.values), scale * self._one(self.slopes(u), point)

        limits = ()
        if goals.names:
            steepest = np.abs(first[n:]).max(axis=1)
            per = 1.0 / np.where(steepest > 0.0, steepest, 1.0)
            limit: Any = NonlinearConstraint  # typed too narrowly
            limits = limit(
                lambda u: per * self.at(u).values[n:], *(goals.limits * per[:, None]).T,
                jac=lambda u: per[:, None] * self.slopes(u)[n:],
            )  # fmt: skip
        tols = {"trust-constr": ("gtol", "xtol"), "SLSQP": ("ftol",), "L-BFGS-B": ("ftol", "gtol")}
        return minimize(
            total, u, jac=True, method=chosen, constraints=limits,
            bounds=Bounds(*bounds, keep_feasible=True),
            options={"maxiter": most, **dict.fromkeys(tols[chosen], tol)},
        )  # fmt: skip

    def _one(self, slopes: Array, point: _Point) -> Array:
        """The derivatives of the objective as one number."""
        own, n = slopes[: self.goals.count], self.goals.count
        return 2.0 * point.values[:n] @ own if self.goals.squares else own[0]

    def _found(self, ended: Sequence[tuple[_Point, bool, str]]) -> Optimum:
        goals, numbers = self.goals, self.numbers
        best, converged, text = min(ended, key=lambda end: self._order(end[0]))
        x, own = self._x(best.u), best.values[goals.count :]
        notes = [text]
        if numbers.failed and numbers.failed not in text:
            notes.append(f"a run of the search failed: {numbers.failed}")
        active = numbers.at_bounds(x)
        for name, value, pair, size in zip(goals.names, own, goals.limits, goals.sizes):
            near = pair[np.abs(pair - value) <= 100.0 * NOTABLE * size]
            active += [
                f"{name} is at its limit {limit:g}" for limit in dict.fromkeys(near.tolist())
            ]
        endings = [
            Ending(self._values(end.u), goals.total(end.values), good) for end, good, _ in ended
        ]
        assert best.run is not None
        return Optimum(
            model=numbers.at(x), values=self._values(best.u), objective=goals.total(best.values),
            constraints=dict(zip(goals.names, own.tolist())), active=tuple(active),
            converged=converged, message="; ".join(notes), evaluations=numbers.evaluations,
            history=tuple(self.history), endings=tuple(endings), run=best.run,
        )  # fmt: skip

    def _values(self, u: Array) -> dict[str, float]:
        return Values(zip(self.numbers.names, self._x(u).tolist()))


def _limit(found: Any, most: int) -> str:
    """The reason why a search did not converge, as a sentence."""
    if (found.nfev if "nit" not in found else found.nit) >= most:
        return f"not converged after {most} iterations: give a larger most="
    return f"not converged: {found.message}"


def _starts(numbers: Numbers, starts: Any, seed: int, earlier: Mapping[str, float]) -> list[Array]:
    """The numbers at which searches start."""
    first = np.array([earlier.get(name, x) for name, x in zip(numbers.names, numbers.present)])
    if isinstance(starts, int) and starts >= 1:
        if starts > 1 and not np.isfinite(numbers.bounds).all():
            raise numbers.refused("starts", "several need two finite bounds of each number")
        rng = np.random.default_rng(seed)
        low, high = numbers.bounds.T
        more = [low + (high - low) * rng.random(len(low)) for _ in range(starts - 1)]
        return [np.clip(first, low, high), *more]
    if not isinstance(starts, Sequence) or isinstance(starts, str) or not starts:
        text = f"must be a number of starts, or a list of values by path, got {shown(starts)}"
        raise numbers.refused("starts", text)
    found = []
    for one in starts:
        unknown = [name for name in one if name not in numbers.names]
        x = np.array([one.get(name, x) for name, x in zip(numbers.names, first)], float)
        if unknown or not ((x >= numbers.bounds[:, 0]) & (x <= numbers.bounds[:, 1])).all():
            text = f"each must hold values of free numbers within their bounds, got {shown(one)}"
            raise numbers.refused("starts", text)
        found.append(x)
    return found


# -- the goal and the limits of a search -----------------------------------------------------------


class Goals:
    """The objective and the constraints as one vector function of a run."""

    def __init__(self, numbers: Numbers, objective: Any, limits: Any):
        self.numbers = numbers
        self.objective = self._function("objective", objective)
        if not isinstance(limits, Mapping):
            text = "must map metrics to (low, high), as {'peak v.knee': (None, 3)}, got "
            raise numbers.refused("subject_to", text + shown(limits))
        self.names = [*limits]
        read = [self._limit(name, pair) for name, pair in limits.items()]
        self.functions = [function for function, _ in read]
        self.limits = np.array([pair for _, pair in read]).reshape(-1, 2)
        self.squares = False  # whether the objective is an array
        self.count = 1  # numbers of the objective

    def _limit(self, name: str, pair: Any) -> tuple[Callable[[Result], Any], tuple[float, float]]:
        """Return the function of a limit, and its ends."""
        what = f"subject_to[{name!r}]"
        try:
            *function, low, high = pair
            low, high = -math.inf if low is None else low, math.inf if high is None else high
            good = float(low) <= float(high) and (math.isfinite(low) or math.isfinite(high))
        except (TypeError, ValueError):
            function, low, high, good = [], 0.0, 0.0, False
        if not good or len(function) > 1:
            text = "needs (low, high) or (function, low, high), of which one may be None, got "
            raise self.numbers.refused(what, text + shown(pair))
        return self._function(what, *(function or [name])), (float(low), float(high))

    def _function(self, what: str, given: Any) -> Callable[[Result], Any]:
        if callable(given):
            return given
        if not isinstance(given, str):
            text = f"must be a metric such as 'peak v.knee', or a function, got {shown(given)}"
            raise self.numbers.refused(what, text)
        text = given.removeprefix("-").strip()
        sign = -1.0 if given.startswith("-") else 1.0
        try:
            words(text)
        except InputError as error:
            raise self.numbers.refused(what, error.problems[0].text) from None
        return lambda run: sign * metric(run, text)

    def begin(self, run: Result) -> None:
        """Check the first run, so that invalid goals are rejected."""
        first = np.asarray(self.objective(run), dtype=object)
        self.squares, self.count = first.ndim > 0, first.size
        for what, function in (
            ("objective", self.objective),
            *((f"subject_to[{name!r}]", f) for name, f in zip(self.names, self.functions)),
        ):
            try:
                found = np.asarray(function(run), float)
            except (TypeError, ValueError):
                raise self.numbers.refused(what, "must return numbers") from None
            if (
                not found.size
                or not np.isfinite(found).all()
                or (what != "objective" and found.size != 1)
            ):
                text = f"must return a finite number; at the start it is {shown(found.tolist())}"
                raise self.numbers.refused(what, text)

    def __call__(self, run: Result) -> Array:
        """(count + constraints,) the goals of a run."""
        found = [np.ravel(np.asarray(self.objective(run), float))]
        return np.concatenate([*found, *(np.ravel(float(f(run))) for f in self.functions)])

    def total(self, values: Array) -> float:
        """Return the objective as one number."""
        own = values[: self.count]
        return float(own @ own) if self.squares else float(own[0])

    def missed(self, values: Array) -> float:
        """Return by how much constraints are missed, relative to their sizes."""
        found = values[self.count :]
        over = np.maximum(self.limits[:, 0] - found, found - self.limits[:, 1]) / self.sizes
        return float(np.maximum(over, 0.0).max(initial=0.0))

    @property
    def sizes(self) -> Array:
        """(constraints,) the largest limit of each, at least 1."""
        finite = np.where(np.isfinite(self.limits), np.abs(self.limits), 0.0)
        return np.maximum(finite.max(axis=1, initial=0.0), 1.0)
