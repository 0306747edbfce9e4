"""Fits of model parameters to measured curves, with exact derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path as FilePath
from statistics import NormalDist
from typing import Any

import numpy as np

from ..dynamics import model_of
from ..errors import Suggests, choices, explained, needed, shown
from ..mechanism import Mechanism
from ..model import Model
from ..result import Result
from ..result.columns import columns_of, coordinates, meant, no_column
from ..tolerances import ROUNDING
from .free import FAR, TOLD, Case, Numbers, Values, measured, option

Array = np.ndarray
ROUNDS = 10  # fits at most, each weighted by the noise that the last one left
MEDIAN = NormalDist().inv_cdf(0.75)  # median absolute value of a standard normal variable
# loss -> ρ' and ρ'' over the squared residual z in units of its noise, as in SciPy
LOSSES: dict[str, Callable[[Array], tuple[Array, Array]]] = {
    "linear": lambda z: (np.ones_like(z), np.zeros_like(z)),
    "soft_l1": lambda z: ((1 + z) ** -0.5, -0.5 * (1 + z) ** -1.5),
    "huber": lambda z: (
        np.where(z <= 1, 1.0, np.maximum(z, 1) ** -0.5),
        np.where(z <= 1, 0.0, -0.5 * np.maximum(z, 1) ** -1.5),
    ),
    "cauchy": lambda z: (1 / (1 + z), -1 / (1 + z) ** 2),
    "arctan": lambda z: (1 / (1 + z**2), -2 * z / (1 + z**2) ** 2),
}


@explained
@dataclass(frozen=True, eq=False)
class Fit(Suggests):
    """The result of `fit`, with the fitted values and their uncertainty.

    Arrays with one entry per free parameter are in the order of `values`. With several
    measurements, columns are named COLUMN@CASE.
    """

    model: Model  # the model with the fitted numbers
    values: Mapping[str, float]
    errors: Mapping[str, float]  # standard errors, nan if the data do not determine a number
    covariance: Array  # (k, k)
    correlation: Array  # (k, k)
    residuals: Mapping[str, Array]  # {column: (n,)} run - data
    units: Mapping[str, str]  # {column: unit} of residuals and data
    noise: Mapping[str, float]  # {column: standard deviation}, as given or as left by the fit
    undetermined: tuple[str, ...]  # a sentence for each direction that the data do not determine
    converged: bool
    message: str
    evaluations: int  # runs
    runs: Mapping[str, Result]  # the run of each case at the times of its data
    data: Mapping[str, Array]  # {column: (n,)}

    @property
    def x(self) -> Array:
        """The values as an array (k,)."""
        return np.array([*self.values.values()])

    @property
    def run(self) -> Result:
        """The run of the fitted model at the times of the data, of the first case."""
        return next(iter(self.runs.values()))

    def __repr__(self) -> str:
        lines = [self.message]
        for path, value in self.values.items():
            error = self.errors[path]
            known = f"± {error:.2g}" if math.isfinite(error) else "(not determined)"
            lines.append(f"{path} = {value:.6g} {known}")
        lines += self.undetermined
        misses = sorted(self._misses(), key=lambda miss: miss[1] / (miss[2] or miss[1] or 1.0))
        worst = misses[: -TOLD - 1 : -1]
        cells = [(f"{name} [{self.units[name]}]", f"{rms:.3g}", f"{spread:.3g}")
                 for name, rms, spread in worst]  # fmt: skip
        cells.insert(0, ("column", "rms of residuals", "standard deviation of data"))
        wide = [max(map(len, column)) for column in zip(*cells)]
        lines += ["  ".join(x.ljust(n) for x, n in zip(row, wide)).rstrip() for row in cells]
        if more := len(misses) - len(worst):
            lines.append(f"and {more} columns whose residuals are smaller parts of the data")
        for name, rms, spread in worst:
            if rms > spread:
                lines.append(f"the mean of the data is closer to {name} than the run is")
        return "<Fit: " + "\n  ".join(lines) + ">"

    def _misses(self) -> list[tuple[str, float, float]]:
        """Return the rms residual and the standard deviation of the data of each column."""
        return [
            (name, math.sqrt(float(np.mean(left**2))), float(np.std(self.data[name])))
            for name, left in self.residuals.items()
        ]

    def plot(self) -> Any:
        """A matplotlib figure of data, run and residuals. Raises MissingPackage."""
        figure, panels = needed("matplotlib.pyplot", "plot").subplots(
            len(self.residuals), 2, squeeze=False
        )
        for (name, missed), (left, right) in zip(self.residuals.items(), panels):
            case = name.rpartition("@")[2]
            t = self.runs[case if case in self.runs else ""].t
            left.plot(t, self.data[name], ".", ms=2, label="data")
            left.plot(t, self.data[name] + missed, label="run")
            left.set(ylabel=name)
            right.plot(t, missed, ".", ms=2)
            right.set(ylabel=f"run - data, {name}")
        panels[0][0].legend()
        return figure


@explained
def fit(
    model: Model | Mechanism,
    data: Any,
    free: Mapping[Any, Sequence[float]],
    *,
    t: Any = None,
    t_start: float | None = None,
    scenario: str | None = None,
    sigma: Mapping[str, float] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: str = "linear",
    progress: Callable[[dict[str, float], Result], Any] | None = None,
    **options: Any,
) -> Fit:
    """Fit model parameters to measured data.

    The residuals are minimised by `scipy.optimize.least_squares` with exact derivatives of each
    run. The values of the model are used as the initial guess. Each column is weighted by its noise
    level, which is given by `sigma` or estimated from the residuals of a first fit. Pressing Ctrl-C
    ends the search and returns the best result found so far.

    Parameters
    ----------
    model : Model or Mechanism
        The model to fit.
    data : DataFrame, dict or path of a .csv file
        Measured data with the times "t" [s] and columns named as in `Result.columns`, optionally
        with units in brackets. To fit several measurements, use a dictionary {NAME: data} or {NAME:
        (data, options)}, where the options are arguments of `simulate` such as {"q": {"arm": 0.3}}.
        They are evaluated on all cores.
    free : dict
        Bounds (low, high) by path, as for `sweep`, for example {"bodies.arm.mass": (0.1, 2.0)}. Use
        "q.arm" and "v.arm" for the initial state of a body, and "q.arm@NAME" for its initial state
        in a single measurement.
    t : (n,) array, optional
        Times of the data [s], for a dictionary without a column "t".
    t_start : float, optional
        Time of the initial state [s], at most the first time of the data. By default, the initial
        state is that of the first row of each measurement.
    scenario : str, optional
        Name of the scenario to run.
    sigma : dict, optional
        Standard deviation of the noise by column.
    priors : dict, optional
        Expected value and standard deviation by path.
    loss : {"linear", "soft_l1", "huber", "cauchy", "arctan"}
        Loss function. All except "linear" reduce the influence of outliers, with a scale given by
        `sigma` or by the median residual.
    progress : callable, optional
        Function that is called with the parameter values and the run of the first measurement. The
        search stops if it returns False.
    **options
        Additional arguments of `simulate`, such as `method` and `step`.

    Returns
    -------
    Fit
        The best values found. If the search did not converge, see `message`.

    Raises
    ------
    InputError
        If an argument is invalid, or if a parameter in `free` has no influence on the data.

    Examples
    --------
        best = pg.fit(model, {"t": t, "arm": q}, {"bodies.arm.mass": (0.1, 2.0)})
    """
    base = model_of("fit", model)
    data = data if t is None or not isinstance(data, Mapping) else {**data, "t": t}
    given = {"t_start": t_start, "scenario": scenario, **options}
    given = {name: value for name, value in given.items() if value is not None}
    task = _Task(base, data, free, given, progress)
    sigmas, known = _noise(task, sigma), _priors(task.numbers, priors)
    return task.fitted(sigmas, known, option("fit", "loss", loss, [*LOSSES]))


class _Stopped(Exception):
    """The search was cancelled."""


class _Task:
    """The data and the free numbers of a fit, and its last runs."""

    def __init__(self, model: Model, data: Any, free: Any, options: Any, progress: Any):
        cases, self.data, self._units, self._named = [], [], [], {}
        self.progress = progress
        for name, (table, own) in _cases(data).items():
            columns, units = measured(table)
            t = columns.pop("t")
            times = {"t_eval": t, "t_end": float(t[-1])}
            cases.append(Case(name, {"t_start": float(t[0]), **options, **own, **times}))
            self.data.append(columns)
            self._units.append(units)
        self.numbers = Numbers("fit", model, free, cases)
        for own in (options, *(own for _, own in _cases(data).values())):
            for name in ("t_eval", "frames", "t_end"):
                if name in own:
                    raise self.numbers.refused(name, "must not be given: times come from the data")
        for case in cases:
            start, first = case.options["t_start"], case.options["t_eval"][0]
            if isinstance(start, Real) and start > first:
                text = f"must be at most the first time of the data, {first:g} s, got {start:g} s"
                raise self.numbers.refused("t_start", text)
        self.labels = [
            f"{column}@{case.name}" if case.name else column
            for case, columns in zip(cases, self.data) for column in columns
        ]  # fmt: skip
        self.measured = [x for columns in self.data for x in columns.values()]
        self.lengths = [len(x) for x in self.measured]
        self.units: list[str] = []  # of the measured columns
        self._last: tuple[Array, list[Result] | None] | None = None
        self._cancelled = False
        self.best: tuple[float, Array] | None = None

    def runs(self, x: Array) -> list[Result] | None:
        """The runs at x, with derivatives by all free numbers, or None if one fails."""
        if self._last is not None and np.array_equal(self._last[0], x):
            return self._last[1]
        found = self.numbers.runs(x, True)
        self._last = x.copy(), found
        if found is not None and self.progress is not None:
            values = dict(zip(self.numbers.names, x.tolist()))
            self._cancelled = self.progress(values, found[0]) is False
        if self._cancelled:
            raise _Stopped
        return found

    def columns(self, runs: Sequence[Result]) -> list[Array]:
        """Values of the runs for each column of the data, (n,) each."""
        out = []
        for i, run in enumerate(runs):
            found = columns_of(run)
            out += [found[self._name(found, i, name)] for name in self.data[i]]
        self.units = [column.unit for column in out]
        return [column.values for column in out]

    def _name(self, found: Mapping[str, Any], i: int, name: str) -> str:
        """The column of a run for one of the data. Raises InputError."""
        if (i, name) not in self._named:
            known = [c for c in meant(found, name) if c != "t" and found[c].unit]
            what = f"data['{name}']"
            if len(known) != 1:
                several = f"may be any of {choices(known, 6)}" if known else ""
                raise self.numbers.refused(what, several or no_column(found, name))
            unit, given = found[known[0]].unit, self._units[i].get(name, "")
            if given and given != unit:
                raise self.numbers.refused(what, f"is given in {given}: convert it to {unit}")
            self._named[i, name] = known[0]
        return self._named[i, name]

    def slopes(self, runs: Sequence[Result]) -> list[Array]:
        """The derivatives of each column, (n, free) each."""
        return [x for i, run in enumerate(runs) for x in self._slopes_of(i, run)]

    def _slopes_of(self, i: int, run: Result) -> list[Array]:
        places = {}
        for n, (kind, listed) in enumerate(zip(("", "v."), coordinates(run.mechanism))):
            places |= {
                f"{kind}{name}": n * run.q.shape[1] + k for k, (name, _) in enumerate(listed)
            }
        wanted = [self._named[i, name] for name in self.data[i]]
        ours = [c for c in wanted if c not in places or c in run.mechanism.model.parameters]
        others = {}
        if ours:

            def read(run: Result) -> Array:
                found = columns_of(run)
                return np.array([found[column].values for column in ours])

            others = run.gradient(read)
        out = [np.zeros((len(run.t), len(self.numbers))) for _ in wanted]
        for k, place in self.numbers.of(self.numbers.cases[i]):
            for column, slope in zip(wanted, out):
                if column in ours:
                    slope[:, k] = others[place.text][ours.index(column)]
                else:
                    slope[:, k] = run.derivatives[place.text][:, places[column]]
        return out

    # -- the fit -----------------------------------------------------------------------------------

    def fitted(self, sigma: Array | None, priors: Array, loss: str) -> Fit:
        """Minimise the residuals, with the given or estimated noise."""
        x = self.numbers.present.copy()
        try:
            first = self.runs(x)
        except _Stopped:
            raise KeyboardInterrupt from None
        if first is None:
            raise self.numbers.refused("model", f"its run fails: {self.numbers.failed}")
        self.columns(first)
        scale = np.array([np.ptp(column) or 1.0 for column in self.measured])
        self._influence(first, scale)
        noise = scale if sigma is None else sigma
        found, text = None, "stopped by the user"
        known = 1.0 / math.sqrt(2.0 * sum(self.lengths))  # relative error of a noise
        held, none = np.isfinite(priors[:, 1]).any(), np.full_like(priors, np.inf)
        again = sigma is None and (len(self.measured) > 1 or loss != "linear" or held)
        try:
            for n in range(ROUNDS if again else 1):
                # before the noise is known, priors cannot be weighed against the data
                found = self._search(x, noise, none if again and n == 0 else priors, loss)
                x, before, text = found.x, noise, ""
                left = self._left(x)
                if sigma is None:
                    noise = np.maximum(self._spread(left, loss), np.finfo(float).eps * scale)
                if np.abs(noise / before - 1.0).max() < known and not (held and n == 0):
                    break
        except (_Stopped, KeyboardInterrupt):
            found, text = None, "stopped by the user"
            x = x if self.best is None else self.best[1]
        self.progress, self._cancelled = None, False
        if not text and found is not None and found.status <= 0:
            text = f"not converged: {found.message}"
        if sigma is None:
            noise = np.maximum(self._spread(self._left(x), loss), np.finfo(float).eps * scale)
        return self._report(x, noise, priors, loss, text)

    def _search(self, x: Array, noise: Array, priors: Array, loss: str) -> Any:
        from scipy.optimize import least_squares

        self.best = None  # costs of another noise do not compare

        def missed(x: Array) -> Array:
            runs = self.runs(x)
            found = self._weighted(runs, x, noise, priors)
            cost = float(found @ found)
            if runs is not None and (self.best is None or cost < self.best[0]):
                self.best = cost, x.copy()
            return found

        least: Any = least_squares  # typed too narrowly
        return least(
            missed, x, jac=lambda x: self._jacobian(x, noise, priors), loss=loss,
            bounds=self.numbers.bounds.T, x_scale="jac",
        )  # fmt: skip

    def _weighted(self, runs: Any, x: Array, noise: Array, priors: Array) -> Array:
        """All residuals divided by their noise. Residuals of priors are last."""
        held = np.isfinite(priors[:, 1])
        if runs is None:
            return np.full(sum(self.lengths) + held.sum(), FAR)
        parts = [
            (run - data) / size for run, data, size in zip(self.columns(runs), self.measured, noise)
        ]
        return np.concatenate([*parts, (x - priors[:, 0])[held] / priors[held, 1]])

    def _jacobian(self, x: Array, noise: Array, priors: Array) -> Array:
        runs = self.runs(x)
        assert runs is not None  # a failed run costs too much to be a step's end
        parts = [slope / size for slope, size in zip(self.slopes(runs), noise)]
        return np.concatenate([*parts, np.diag(1.0 / priors[:, 1])[np.isfinite(priors[:, 1])]])

    def _left(self, x: Array) -> list[Array]:
        """The residuals of each column, in its unit."""
        runs = self.runs(x)
        assert runs is not None
        return [run - data for run, data in zip(self.columns(runs), self.measured)]

    def _spread(self, left: Sequence[Array], loss: str) -> Array:
        """The standard deviation of each column: if outliers are borne, from the median."""
        share = max(1.0 - len(self.numbers) / sum(self.lengths), 1.0 / sum(self.lengths))
        if loss == "linear":
            return np.array([math.sqrt(float(x @ x) / (share * len(x))) for x in left])
        return np.array([float(np.median(np.abs(x))) / (MEDIAN * math.sqrt(share)) for x in left])

    def _influence(self, runs: Sequence[Result], scale: Array) -> None:
        """Raise an error for parameters without influence."""
        slopes = np.concatenate([x / size for x, size in zip(self.slopes(runs), scale)])
        for name, slope in zip(self.numbers.names, slopes.T):
            if not slope.any():
                text = "has no influence on the data; omit it, or add a column that depends on it"
                raise self.numbers.refused(name, text)

    def _report(self, x: Array, noise: Array, priors: Array, loss: str, text: str) -> Fit:
        numbers, names, left = self.numbers, self.numbers.names, self._left(x)
        runs = self.runs(x)
        assert runs is not None
        jacobian = self._jacobian(x, noise, priors)
        widening = _widening(np.concatenate([a / b for a, b in zip(left, noise)]), loss)
        _, values, directions = np.linalg.svd(jacobian * numbers.size, full_matrices=False)
        # a direction with a standard deviation beyond the bounds, or only rounding as its slope
        open_ = values < max(1.0, ROUNDING * values[0])
        told = tuple(_direction(names, direction) for direction in directions[open_])
        kept = directions[~open_] / values[~open_, None]
        covariance = widening * (kept.T @ kept) * np.outer(numbers.size, numbers.size)
        weak = (np.abs(directions[open_]) > 0.1).any(axis=0)
        size = np.sqrt(np.diag(covariance))
        errors = np.where(weak, np.nan, size)
        size = np.where(size > 0.0, size, np.nan)
        notes = [text or "converged", *numbers.at_bounds(x)]
        if numbers.failed:
            notes.append(f"a run of the search failed: {numbers.failed}")
        return Fit(
            model=numbers.at(x), values=Values(zip(names, x.tolist())),
            errors=dict(zip(names, errors.tolist())), covariance=covariance,
            correlation=covariance / np.outer(size, size),
            residuals=dict(zip(self.labels, left)), units=dict(zip(self.labels, self.units)),
            noise=dict(zip(self.labels, noise.tolist())),
            undetermined=told, converged=not text, message="; ".join(notes),
            evaluations=numbers.evaluations,
            runs={case.name: run for case, run in zip(numbers.cases, runs)},
            data=dict(zip(self.labels, self.measured)),
        )  # fmt: skip


def _widening(missed: Array, loss: str) -> float:
    """Covariance of a robust fit relative to least squares with the same noise.

    It is mean(ψ²) / mean(ψ')² [Huber, Robust Statistics, 1981, 7.6].
    """
    z = missed**2
    first, second = LOSSES[loss](z)
    slope = float(np.mean(first + 2.0 * z * second))
    return float(np.mean(z * first**2)) / slope**2 if loss != "linear" and slope > 0.0 else 1.0


def _direction(names: Sequence[str], direction: Array) -> str:
    """A sentence on a direction of free numbers, each in its range."""
    large = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > 0.1]
    if len(large) == 1:
        return f"the data do not determine {names[large[0]]}"
    parts = [f"{direction[i] / direction[large[0]]:.2g} {names[i]}" for i in large]
    text = "the data do not determine these, which may change together by parts of their ranges"
    return f"{text}: {', '.join(parts)}"


def _cases(data: Any) -> dict[str, tuple[Any, Mapping[str, Any]]]:
    """Return the data and the arguments of `simulate` for each case. A single case has the name
    ""."""
    tables = (Mapping, str, FilePath, tuple)
    several = (
        isinstance(data, Mapping)
        and data
        and all(isinstance(one, tables) or hasattr(one, "columns") for one in data.values())
    )
    if not several:
        return {"": (data, {})}
    pairs = {
        str(name): one if isinstance(one, tuple) and len(one) == 2 else (one, {})
        for name, one in data.items()
    }
    return {name: (one, dict(own)) for name, (one, own) in pairs.items()}


def _noise(task: _Task, sigma: Any) -> Array | None:
    """(columns,) standard deviations, None if they are not given. Raises InputError."""
    if sigma is None:
        return None
    names = [label.rpartition("@")[0] or label for label in task.labels]
    known = {*names, *task.labels}
    if not isinstance(sigma, Mapping) or {*sigma} - known:
        text = f"needs a number for each column, {choices(known)}, got {shown(sigma)}"
        raise task.numbers.refused("sigma", text)
    given = [sigma.get(label, sigma.get(name)) for label, name in zip(task.labels, names)]
    found = np.array([math.nan if x is None else float(x) for x in given])
    if not (np.isfinite(found) & (found > 0.0)).all():
        text = f"needs a number > 0 for each column, {choices(known)}, got {shown(sigma)}"
        raise task.numbers.refused("sigma", text)
    return found


def _priors(numbers: Numbers, priors: Any) -> Array:
    """(free, 2) expected values and standard deviations, infinite without a prior."""
    found, names = np.tile([0.0, np.inf], (len(numbers), 1)), numbers.names
    for name, pair in (priors or {}).items():
        if name not in names:
            raise numbers.refused("priors", f"{name!r} is not free; choose from {choices(names)}")
        try:
            mean, spread = map(float, pair)
        except (TypeError, ValueError):
            mean = spread = math.nan
        if not (math.isfinite(mean) and 0.0 < spread < math.inf):
            raise numbers.refused(
                "priors", f"{name!r} needs (value, spread > 0), got {shown(pair)}"
            )
        found[names.index(name)] = mean, spread
    return found
