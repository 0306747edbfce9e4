"""Optimal designs and inputs: numbers of a model that make a goal of its runs least."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from ..dynamics import model_of
from ..errors import InputError, ModelError, explained, needed, shown
from ..fields import whole
from ..markup import reason_of
from ..mechanism import Mechanism
from ..model import Model
from ..result import Result
from ..sweeps.sweep import known_options
from ..tolerances import NEARBY, NOTABLE, VISIBLE
from .found import Ending, Numbered, Stopped
from .free import COST_OF_FAILURE, Case, Numbers, Values, option, starts_of
from .goals import Goals
from .integration import finer_options
from .telling import Teller, reason_of_end

Array = np.ndarray
SOLVERS = ("SLSQP", "trust-constr", "L-BFGS-B", "least_squares")


class Trial(NamedTuple):
    """One evaluation of a search."""

    values: dict[str, float]
    objective: float  # nan if the run failed
    constraints: dict[str, float]
    failed: str = ""  # why, or ""


@explained
@dataclass(frozen=True, eq=False)
class Optimum(Numbered):
    """The result of `optimise`.

    Standard errors are those of least squares with the noise that the objective leaves. They are
    nan if the objective is not an array, or if there are constraints.
    """

    model: Model  # the model with them
    values: Mapping[str, float]
    errors: Mapping[str, float]  # standard errors
    covariance: Array  # (k, k)
    freedom: float  # residuals minus values
    objective: float
    constraints: Mapping[str, float]
    integration: Mapping[str, float]
    """What a finer run changes: {"objective": change, constraint: change}, nan if it fails."""
    active: tuple[str, ...]  # a sentence for each bound and each constraint that limits the goal
    notices: tuple[str, ...]  # sentences on the integration error
    converged: bool
    message: str
    evaluations: int  # runs
    history: tuple[Trial, ...]  # all evaluations
    endings: tuple[Ending, ...]  # one for each start
    run: Result

    _TOLD = ("objective", "constraints", "integration", "active", "notices", "converged", "message",
             "evaluations", "endings")  # fmt: skip

    def __repr__(self) -> str:
        values = [f"  {path} = {value:.6g}" for path, value in self.values.items()]
        lines = [f"<Optimum {self.objective:.6g}: {self.message}", *values]
        lines += [f"  {name}: {value:.6g}" for name, value in self.constraints.items()]
        lines += [f"  {text}" for text in self.active]
        return "\n".join([*lines, *(f"  notice: {text}" for text in self.notices)]) + ">"

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
    options = known_options(optimise, options)
    given = options if scenario is None else {"scenario": scenario, **options}
    base = model_of("optimise", model)
    numbers = Numbers("optimise", base, free, [Case("", given)], bounded=False)
    _check(numbers, solver, differences, tol, most, seed)
    goals = Goals(numbers, objective, subject_to or {})
    search = Search(numbers, goals, differences, progress, history)
    return search.over(starts_of(numbers, starts, seed, search.earlier), solver, tol, most)


def _check(
    numbers: Numbers, solver: Any, differences: Any, tol: float, most: int, seed: int
) -> None:
    """Raise InputError for settings of a search out of their range."""
    if solver is not None:
        option("optimise", "solver", solver, SOLVERS)
    for name, value, good, wanted in (
        ("differences", differences, differences is None or 0.0 < differences < 1.0,
         "a relative step above 0 and below 1, or None for exact derivatives"),
        ("tol", tol, 0.0 < tol < math.inf, "a finite number > 0"),
        ("most", most, (whole(most) or 0) >= 1, "a whole number >= 1"),
        ("seed", seed, (-1 if (n := whole(seed)) is None else n) >= 0, "a whole number >= 0"),
    ):  # fmt: skip
        if not good:
            raise numbers.refused(name, f"must be {wanted}, got {shown(value)}")


class _Kept(Exception):
    """All limits are kept."""


class _Point(NamedTuple):
    u: Array
    run: Result | None
    values: Array


class Search:
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
        self._since = 0  # evaluations before the best point
        self._slopes: tuple[Array, Array] | None = None
        self.iterations = 0  # derivatives
        self.idle: set[str] = set()  # numbers without influence on the motion

    def _read(self, history: Any) -> dict[str, float]:
        """The best values of an earlier search, {} if there is none."""
        if isinstance(history, Optimum):
            return dict(history.values)
        if self.file is None:
            if history is not None:
                text = f"must be an Optimum or the name of a file, got {shown(history)}"
                raise self.numbers.refused("history", text)
            return {}
        try:
            with self.file.open("a+", encoding="utf-8") as file:
                file.seek(0)
                trials = [Trial(**json.loads(line)) for line in file.read().splitlines()]
        except OSError as error:
            text = f"{self.file} cannot be written: {reason_of(error)}; give a file in a folder "
            raise self.numbers.refused("history", f"{text}that is there") from None
        except (ValueError, TypeError) as error:
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
                self.best, self._since = point, len(self.history)
        else:
            good = self.good
            if good is None:
                raise numbers.refused("model", f"its run fails at the start: {failed}")
            found = good.values.copy()
            own = found[: goals.count]
            own += COST_OF_FAILURE * (1.0 + np.abs(own).max())
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
        before = numbers.failed
        for at in (x, numbers.inside(x)):
            try:
                runs = numbers.runs(at, True)
                if runs is not None:
                    moved, by = runs[0].derivatives, self.goals.slopes(runs[0])
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
        raise Stopped(f"not converged: no derivatives {numbers.failed}")

    def _order(self, point: _Point) -> tuple[float, float]:
        missed = self.goals.missed(point.values)
        return (missed if missed > NOTABLE else 0.0, self.goals.total(point.values))

    def _note(self, trial: Trial, run: Result | None) -> None:
        self.history.append(trial)
        if self.file is not None:
            with self.file.open("a", encoding="utf-8") as file:
                file.write(json.dumps(trial._asdict()) + "\n")
        if callable(self.progress) and self.progress(trial, run) is False:
            raise Stopped

    def slopes(self, u: Array) -> Array:
        """(goals, free) the derivatives of the goals by u."""
        if self._slopes is not None and np.array_equal(self._slopes[0], u):
            return self._slopes[1]
        point, numbers = self.at(u), self.numbers
        self.iterations += 1
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
        if self.progress in (None, True):
            self.progress = Teller(self, most * len(starts))
        for k, x in enumerate(starts):
            self.best = self.good = self._last = None
            u, converged = x / self.numbers.size, False
            try:
                self.at(u)
                if k == 0:
                    self._has_influence()
                converged, text = self._solve(u, solver, tol, most)
            except (Stopped, KeyboardInterrupt) as stop:
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
        if self.history[-1].failed or self._surrounded():
            return False, f"not converged: limited by {numbers.failed}"
        return bool(good), "converged" if good else reason_of_end(found, most)

    def _surrounded(self) -> bool:
        """Check whether all runs after that of the best point, and beside it, failed."""
        best, *after = self.history[self._since :]
        failed = [trial.failed for trial in after if trial.values != best.values]
        return bool(failed) and all(failed)

    def _least_squares(self, u: Array, bounds: Array, tol: float, most: int) -> Any:
        from scipy.optimize import least_squares

        least: Any = least_squares  # typed too narrowly
        return least(
            lambda u: self.at(u).values, u, jac=self.slopes, bounds=bounds, x_scale="jac",
            ftol=tol, xtol=tol, gtol=tol, max_nfev=most,
        )  # fmt: skip

    def _minimised(self, u: Array, chosen: str, bounds: Array, tol: float, most: int) -> Any:
        """Minimise the objective subject to the limits, from numbers that keep them."""
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        goals, n = self.goals, self.goals.count
        u = self._kept(u, bounds, most)
        scale, per = self._scale(u, bounds), self._per(u)
        limits = ()
        if goals.names:
            limit: Any = NonlinearConstraint  # typed too narrowly
            limits = limit(
                lambda u: per * self.at(u).values[n:], *(goals.limits * per[:, None]).T,
                jac=lambda u: per[:, None] * self.slopes(u)[n:],
            )  # fmt: skip
        tols = {"trust-constr": ("gtol", "xtol"), "SLSQP": ("ftol",), "L-BFGS-B": ("ftol", "gtol")}
        if chosen == "SLSQP":  # takes the change itself
            tol *= min(abs(scale * goals.total(self.at(u).values)) or 1.0, 1.0)
        return minimize(
            lambda u: scale * goals.total(self.at(u).values), u,
            jac=lambda u: scale * self._one(self.slopes(u), self.at(u)),
            method=chosen, constraints=limits, bounds=Bounds(*bounds, keep_feasible=True),
            options={"maxiter": most, **dict.fromkeys(tols[chosen], tol)},
        )  # fmt: skip

    def _per(self, u: Array) -> Array:
        """(constraints,) one over the steepest derivative of each."""
        steepest = np.abs(self.slopes(u)[self.goals.count :]).max(axis=1, initial=0.0)
        return 1.0 / np.where(steepest > 0.0, steepest, 1.0)

    def _kept(self, u: Array, bounds: Array, most: int) -> Array:
        """Return numbers near u that keep the limits, by the method of Gauss and Newton.

        A quasi-Newton method that begins far from its limits learns the curvature of places that it
        leaves at once.
        """
        from scipy.optimize import least_squares

        goals, n = self.goals, self.goals.count
        if goals.missed(self.at(u).values) <= VISIBLE:
            return u
        per = self._per(u)

        def over(u: Array) -> Array:
            point = self.at(u)
            if point.run is None:
                return np.full(len(per), COST_OF_FAILURE)
            if goals.missed(point.values) <= VISIBLE:
                raise _Kept
            return per * goals.over(point.values)

        def slopes(u: Array) -> Array:
            outside = goals.over(self.at(u).values) != 0.0
            return (per * outside)[:, None] * self.slopes(u)[n:]

        least: Any = least_squares  # typed too narrowly
        with suppress(_Kept):
            least(over, u, jac=slopes, bounds=bounds, max_nfev=most)
        return self.best.u if self.best is not None else u

    def _scale(self, u: Array, bounds: Array) -> float:
        """Return the scale of the objective for which its curvature is one down its slope.

        Quasi-Newton methods assume that curvature at first.
        """
        first = self._one(self.slopes(u), self.at(u))
        steepest = float(np.abs(first).max())
        if steepest == 0.0:
            first, steepest = np.ones(len(u)), 1.0
        way = np.clip(u - NEARBY * first / steepest, *bounds) - u
        beside = self._one(self.slopes(u + way), self.at(u + way))
        curve = float(way @ (beside - self._one(self.slopes(u), self.at(u))))
        size = float(way @ way)
        return size / curve if curve > NOTABLE * steepest * math.sqrt(size) else 1.0 / steepest

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
        covariance, freedom = self._covariance(best)
        change, told = self._finer(best)
        return Optimum(
            model=numbers.at(x), values=self._values(best.u), covariance=covariance,
            errors=dict(zip(numbers.names, np.sqrt(np.diag(covariance)).tolist())),
            freedom=freedom, integration=change, notices=told, objective=goals.total(best.values),
            constraints=dict(zip(goals.names, own.tolist())), active=tuple(active),
            converged=converged, message="; ".join(notes), evaluations=numbers.evaluations,
            history=tuple(self.history), endings=tuple(endings), run=best.run,
        )  # fmt: skip

    def _covariance(self, best: _Point) -> tuple[Array, float]:
        """Return the covariance of least squares without limits, otherwise nan."""
        goals, n = self.goals, len(best.u)
        freedom = float(goals.count - n)
        if not goals.squares or goals.names or freedom <= 0.0 or self._slopes is None:
            return np.full((n, n), np.nan), max(freedom, 0.0)
        u, slopes = self._slopes  # near the best point
        if not np.allclose(u, best.u, NOTABLE, NOTABLE):
            return np.full((n, n), np.nan), freedom
        inverse = np.linalg.pinv(slopes.T @ slopes)
        scale = goals.total(best.values) / freedom
        return scale * inverse * np.outer(self.numbers.size, self.numbers.size), freedom

    def _finer(self, best: _Point) -> tuple[dict[str, float], tuple[str, ...]]:
        """Return how a finer run changes the goals, and sentences on large changes."""
        goals, numbers, failed = self.goals, self.numbers, self.numbers.failed
        assert best.run is not None
        more = finer_options(best.run, 1)
        names = ("objective", *goals.names)
        try:
            runs = numbers.runs(self._x(best.u), False, [more])
            finer = np.full(len(best.values), np.nan) if runs is None else goals(runs[0])
        except InputError:
            finer = np.full(len(best.values), np.nan)
        numbers.failed = failed
        ends = [np.array([goals.total(x), *x[goals.count :]]) for x in (best.values, finer)]
        change = ends[1] - ends[0]
        sizes = np.array([max(abs(ends[0][0]), NOTABLE), *goals.sizes])
        (of_steps, value), *_ = more.items()
        said = f"{of_steps}={value:.3g}"
        told = [
            f"a finer run, with {said}, changes {name} by {by:.2g}: give a smaller {of_steps}"
            for name, by, size in zip(names, change, sizes)
            if abs(by) > VISIBLE * size
        ]
        return dict(zip(names, change.tolist())), tuple(told)

    def _values(self, u: Array) -> dict[str, float]:
        return Values(zip(self.numbers.names, self._x(u).tolist()))
