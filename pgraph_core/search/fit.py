"""Fits of model parameters to measured curves, with exact derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Real
from statistics import NormalDist
from typing import Any

import numpy as np

from ..dynamics import model_of
from ..errors import InputError, choices, explained, needed
from ..mechanism import Mechanism
from ..model import Model
from ..result import Result
from ..result.columns import columns_of, meant, no_column, states_of_columns
from ..sweeps.sweep import known_options
from ..tolerances import NOTABLE
from .curves import slopes_of
from .found import Ending, Numbered, Stopped
from .free import COST_OF_FAILURE, NUMBERS_TOLD, Case, Numbers, Values, option, starts_of
from .given import cases_of, noise_of, priors_of
from .integration import Finer, finer_runs, gives_steps
from .losses import LOSSES, widening
from .measured import factor_of, measured
from .quality import SIGMAS, Linear, beyond_noise, not_noise, other_start

Array = np.ndarray
SMALL_PART = 4  # an error that moves a number by less than this part of its standard error is small
RANDOM_POINTS = 10  # random points for each start
MOST_FITS = 10  # fits at most, each weighted by the noise that the last one left
MEDIAN = NormalDist().inv_cdf(0.75)  # median absolute value of a standard normal variable


@explained
@dataclass(frozen=True, eq=False)
class Fit(Numbered):
    """The result of `fit`, with the fitted values and their uncertainty.

    Arrays with one entry per free parameter are in the order of `values`. With several
    measurements, columns are named COLUMN@CASE. Standard errors include the noise of the data and
    the integration error of the runs.
    """

    model: Model  # the model with the fitted numbers
    values: Mapping[str, float]
    errors: Mapping[str, float]  # standard errors, nan if the data do not determine a number
    covariance: Array  # (k, k)
    correlation: Array  # (k, k)
    residuals: Mapping[str, Array]  # {column: (n,)} run - data
    units: Mapping[str, str]  # {column: unit} of residuals and data
    noise: Mapping[str, float]  # {column: standard deviation}, as given or as left by the fit
    integration: Mapping[str, float]  # {column: rms integration error}, nan if not known
    undetermined: tuple[str, ...]  # a sentence for each direction that the data do not determine
    combinations: Mapping[str, tuple[float, float]]
    """{text: (value, standard error)} of what the data determine of these numbers."""
    notices: tuple[str, ...]  # sentences on steps, and on residuals that are not noise
    converged: bool
    message: str
    evaluations: int  # runs
    freedom: float  # residuals minus values, inf if the noise is given
    endings: tuple[Ending, ...]  # one for each start
    runs: Mapping[str, Result]  # the run of each case at the times of its data
    data: Mapping[str, Array]  # {column: (n,)}

    _TOLD = ("noise", "integration", "undetermined", "combinations", "notices", "converged",
             "message", "evaluations", "endings")  # fmt: skip

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
        lines += [
            f"the data determine {text} = {value:.6g} ± {error:.2g}"
            for text, (value, error) in self.combinations.items()
        ]
        misses = sorted(self._misses(), key=lambda miss: miss[1] / (miss[2] or miss[1] or 1.0))
        worst = misses[: -NUMBERS_TOLD - 1 : -1]
        cells = [(f"{name} [{self.units[name]}]", f"{rms:.3g}", f"{spread:.3g}",
                  f"{self.integration[name]:.1g}") for name, rms, spread in worst]  # fmt: skip
        head = "column", "rms of residuals", "standard deviation of data", "integration error"
        cells.insert(0, head)
        wide = [max(map(len, column)) for column in zip(*cells)]
        lines += ["  ".join(x.ljust(n) for x, n in zip(row, wide)).rstrip() for row in cells]
        if more := len(misses) - len(worst):
            lines.append(f"and {more} columns whose residuals are smaller parts of the data")
        for name, rms, spread in worst:
            if rms > spread:
                lines.append(f"the mean of the data is closer to {name} than the run is")
        lines += [f"notice: {text}" for text in self.notices]
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
    starts: int | Sequence[Mapping[str, float]] = 1,
    seed: int = 0,
    progress: Callable[[dict[str, float], Result], Any] | None = None,
    **options: Any,
) -> Fit:
    """Fit model parameters to measured data.

    The residuals are minimised by `scipy.optimize.least_squares` with exact derivatives of each
    run. The values of the model are used as the initial guess. Each column is weighted by its noise
    level, which is given by `sigma` or estimated from the residuals of a first fit. Pressing Ctrl-C
    ends the search and returns the best result found so far.

    At the optimum, finer runs give the integration error. If it moves a parameter by more than a
    quarter of its standard error, the curves are corrected by it and the search goes on, unless the
    data agree better without. If `step` or `rtol` is given, nothing is corrected: the standard
    errors then include the integration error, and a notice tells which step is fine enough.

    Parameters
    ----------
    model : Model or Mechanism
        The model to fit.
    data : DataFrame, dict, Result or path of a .csv file
        Measured data with the times "t" [s] and columns named as in `Result.columns`, optionally
        with units in brackets, such as "arm [deg]" and "t [ms]". Of a Result, the coordinates are
        the data. To fit several measurements, use a dictionary {NAME: data} or {NAME:
        (data, options)}, where the options are arguments of `simulate` such as {"q": {"arm": 0.3}}.
        They are evaluated on all cores.
    free : dict
        Bounds (low, high) by path, as for `sweep`, for example {"bodies.arm.mass": (0.1, 2.0)}. Use
        "q.arm" and "v.arm" for the initial state of a body, and "q.arm@NAME" for its initial state
        in a single measurement.
    t : (n,) array, optional
        Times of the data [s], for a dictionary without a column "t".
    t_start : float, optional
        Time of the initial state [s], at most the first time of the data. The default is the time
        of the first row of each measurement. The state itself is not taken from the data: it is
        that of the model or scenario, unless `q` and `v` are given or free.
    scenario : str, optional
        Name of the scenario to run.
    sigma : dict, optional
        Standard deviation of the noise by column.
    priors : dict, optional
        Expected value and standard deviation by path.
    loss : {"linear", "soft_l1", "huber", "cauchy", "arctan"}
        Loss function. All except "linear" reduce the influence of outliers, with a scale given by
        `sigma` or by the median residual.
    starts : int or sequence of dict
        Number of starting points: the values of the model, and those of random points within the
        bounds whose runs are nearest to the data. Ten are tried for each, depending on `seed`.
        Alternatively, a sequence of dictionaries with values by path.
    progress : callable, optional
        Function that is called with the parameter values and the run of the first measurement. The
        search stops if it returns False.
    **options
        Additional arguments of `simulate`, such as `method` and `step`.

    Returns
    -------
    Fit
        The best values found. If the search did not converge, see `message`. If the residuals are
        not noise, see `notices`.

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
    given = {"t_start": t_start, "scenario": scenario, **known_options(fit, options)}
    given = {name: value for name, value in given.items() if value is not None}
    task = _Task(base, data, free, given, progress)
    sigmas, known = noise_of(task.numbers, task.labels, sigma), priors_of(task.numbers, priors)
    count = starts if isinstance(starts, int) else 0  # the best of many
    several = starts if count <= 1 else 1 + RANDOM_POINTS * (count - 1)
    begins = starts_of(task.numbers, several, seed, {})
    return task.fitted(begins, count, sigmas, known, option("fit", "loss", loss, [*LOSSES]))


class _Task:
    """The data and the free numbers of a fit, and its last runs."""

    def __init__(self, model: Model, data: Any, free: Any, options: Any, progress: Any):
        cases, self.data, self._units, self._named = [], [], [], {}
        self.progress = progress
        for name, (table, own) in cases_of(data).items():
            columns, units = measured(table)
            t = columns.pop("t")
            times = {"t_eval": t, "t_end": float(t[-1])}
            cases.append(Case(name, {"t_start": float(t[0]), **options, **own, **times}))
            self.data.append(columns)
            self._units.append(units)
        self.numbers = Numbers("fit", model, free, cases)
        for own in (options, *(own for _, own in cases_of(data).values())):
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
        self.shift = [
            np.zeros(len(x)) for x in self.measured
        ]  # differences of finer runs from runs
        self.factors = np.ones(len(self.measured))  # from the units of the data
        self.lengths = [len(x) for x in self.measured]
        self.units: list[str] = []  # units of the measured columns
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
            raise Stopped
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
            factor = factor_of(given, unit) if given else 1.0
            if factor is None:
                text = f"is given in {given}, and the column is in {unit}"
                raise self.numbers.refused(what, text)
            self.data[i][name] *= factor
            before = sum(len(columns) for columns in self.data[:i])
            self.factors[before + [*self.data[i]].index(name)] = factor
            self._named[i, name] = known[0]
        return self._named[i, name]

    def slopes(self, runs: Sequence[Result]) -> list[Array]:
        """The derivatives of each column, (n, free) each."""
        return [x for i, run in enumerate(runs) for x in self._slopes_of(i, run)]

    def _slopes_of(self, i: int, run: Result) -> list[Array]:
        wanted = [self._named[i, name] for name in self.data[i]]
        by = slopes_of(run, wanted)
        out = [np.zeros((len(run.t), len(self.numbers))) for _ in wanted]
        for k, place in self.numbers.of(self.numbers.cases[i]):
            for n, slope in enumerate(out):
                slope[:, k] = by[place.text][n]
        return out

    # -- the fit -----------------------------------------------------------------------------------

    def fitted(
        self, starts: Sequence[Array], count: int, sigma: Array | None, priors: Array, loss: str
    ) -> Fit:
        """Minimise the residuals, with the given or estimated noise, from `count` of the starts."""
        x = self._begun(starts[0])
        sigma = None if sigma is None else sigma * self.factors
        self.given, self.loss, self.priors = sigma, loss, priors
        self.scale = np.array([np.ptp(column) or 1.0 for column in self.measured])
        noise = self.scale if sigma is None else sigma
        endings, fine, notices, text = [], None, list[str](), "stopped by the user"
        try:
            if len(starts) > 1:
                others = self._nearest(starts[1:], count, noise)
                endings, x = self._over([x, *others], noise)
            x, noise, text = self._weighed(x, noise)
            x, noise, text, fine, notices = self._corrected(x, noise, text)
        except (Stopped, KeyboardInterrupt):
            x, text = x if self.best is None else self.best[1], "stopped by the user"
        self.progress, self._cancelled = None, False
        if sigma is None:
            noise = self._noise_of(self._left(x))
        return self._report(x, noise, text, fine, notices, endings)

    def _begun(self, x: Array) -> Array:
        """Return the start, moved off bounds, at which parts may not act. Raises InputError."""
        x = self.numbers.inside(x)
        try:
            first = self.runs(x)
        except Stopped:
            raise KeyboardInterrupt from None
        if first is None:
            raise self.numbers.refused("model", f"its run fails: {self.numbers.failed}")
        self.columns(first)
        self._influence(first, np.array([np.ptp(column) or 1.0 for column in self.measured]))
        return x

    def _nearest(self, starts: Sequence[Array], count: int, noise: Array) -> list[Array]:
        """Return the starts whose runs are nearest to the data, all of them if they are given."""
        starts = [self.numbers.inside(x) for x in starts]
        if not count:
            return starts
        failed, costs = self.numbers.failed, []
        for x in starts:
            runs = self.numbers.runs(x, False)
            left = math.inf if runs is None else sum(
                float(np.sum((a / size) ** 2)) for a, size in zip(self._missed(runs), noise)
            )  # fmt: skip
            costs.append(left)
        self.numbers.failed = failed
        return [starts[k] for k in np.argsort(costs)[: count - 1]]

    def _over(self, starts: Sequence[Array], noise: Array) -> tuple[list[Ending], Array]:
        """Search from each start. Return the ends, and the best."""
        none, names = np.full_like(self.priors, np.inf), self.numbers.names
        ends = list[tuple[float, Array, bool]]()
        for begin in starts:
            try:
                if self.runs(begin) is None:
                    continue
            except InputError:  # this model has no derivatives there
                continue
            found = self._search(begin, noise, none if self.given is None else self.priors)
            ends.append((2.0 * found.cost, found.x, bool(found.status > 0)))
        best = min(ends, key=lambda end: end[0])
        listed = [Ending(Values(zip(names, x.tolist())), cost, good) for cost, x, good in ends]
        return listed, best[1]

    def _weighed(self, x: Array, noise: Array) -> tuple[Array, Array, str]:
        """Search from x, again with the noise that each search leaves. Return why it ended."""
        sigma, priors = self.given, self.priors
        known = 1.0 / math.sqrt(2.0 * sum(self.lengths))  # relative error of a noise
        held, none = np.isfinite(priors[:, 1]).any(), np.full_like(priors, np.inf)
        again = sigma is None and (len(self.measured) > 1 or self.loss != "linear" or held)
        found, fresh = None, noise is self.scale
        for n in range(MOST_FITS if again else 1):
            # before the noise is known, priors cannot be weighed against the data
            found = self._search(x, noise, none if again and fresh and n == 0 else priors)
            x, before = found.x, noise
            if sigma is None:
                noise = self._noise_of(self._left(x))
            if np.abs(noise / before - 1.0).max() < known and not (held and fresh and n == 0):
                break
        assert found is not None
        return x, noise, "" if found.status > 0 else f"not converged: {found.message}"

    def _corrected(
        self, x: Array, noise: Array, text: str
    ) -> tuple[Array, Array, str, Finer | None, list[str]]:
        """Search again with curves that are corrected by finer runs, until this changes nothing."""
        first, cost, given = (x, noise, text), self._cost(x, noise), gives_steps(self.numbers)
        before: Finer | None = None
        for _ in range(MOST_FITS):
            linear = self._linear(x, noise)
            fine = self._finer(x, partial(self._small, linear, noise), before)
            if isinstance(fine, str):
                return x, noise, text, None, [f"the integration error is not known: {fine}"]
            missed = [a - b for a, b in zip(fine.shift, self.shift)]
            small, before = self._small(linear, noise, missed), fine
            if given and not small:
                return x, noise, text, fine, [self._too_coarse(linear, missed, noise, fine)]
            if small:
                break
            self.shift = fine.shift
            x, noise, text = self._weighed(x, noise)
        else:
            return x, noise, text, before, ["the curves of finer runs do not settle"]
        if not any(map(np.any, self.shift)):
            return x, noise, text, fine, []
        if self._cost(x, first[1]) > cost + SIGMAS**2:  # the data come from a run like these
            self.shift = [0.0 * shift for shift in self.shift]
            again = self._finer(first[0], lambda _: False, fine)
            told = "the data agree better with the default steps than with finer ones, "
            told += "so that nothing is corrected"
            return *first, (fine if isinstance(again, str) else again), [told]
        told = f"curves are corrected by those of a run with {fine.said}, because the integration "
        return x, noise, text, fine, [told + "error of the default steps exceeds the noise"]

    def _finer(self, x: Array, enough: Any, before: Finer | None) -> Finer | str:
        """Return finer runs at x, of the level and with the error of those `before`."""
        runs, level = self.runs(x), 1 if before is None else before.level
        assert runs is not None
        found = finer_runs(self.numbers, x, runs, self.columns, enough, level)
        if before is None or isinstance(found, str):
            return found
        return found._replace(left=before.left)

    def _small(self, linear: Linear, noise: Array, missed: Sequence[Array]) -> bool:
        """Check whether changes of the columns move no number by a part of its error."""
        return bool((SMALL_PART * np.abs(linear.moved(missed, noise)) <= linear.errors).all())

    def _too_coarse(self, linear: Linear, missed: Any, noise: Array, fine: Finer) -> str:
        moved = np.abs(linear.moved(missed, noise)) / linear.errors
        k = int(np.nanargmax(moved))
        text = f"the integration error moves {self.numbers.names[k]} by {moved[k]:.2g} of the "
        text += "standard errors that the noise makes, and is in its ±: give no step and no rtol, "
        return text + f"so that curves are corrected, or give {fine.said}"

    def _cost(self, x: Array, noise: Array) -> float:
        """The sum of squares over the square of the noise."""
        return sum(float(np.sum((a / size) ** 2)) for a, size in zip(self._left(x), noise))

    def _noise_of(self, left: Sequence[Array]) -> Array:
        return np.maximum(self._spread(left, self.loss), np.finfo(float).eps * self.scale)

    def _search(self, x: Array, noise: Array, priors: Array) -> Any:
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
            missed, x, jac=lambda x: self._jacobian(x, noise, priors), loss=self.loss,
            bounds=self.numbers.bounds.T, x_scale="jac",
        )  # fmt: skip

    def _weighted(self, runs: Any, x: Array, noise: Array, priors: Array) -> Array:
        """All residuals divided by their noise. Residuals of priors are last."""
        held = np.isfinite(priors[:, 1])
        if runs is None:
            return np.full(sum(self.lengths) + held.sum(), COST_OF_FAILURE)
        parts = [left / size for left, size in zip(self._missed(runs), noise)]
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
        return self._missed(runs)

    def _missed(self, runs: Sequence[Result]) -> list[Array]:
        found = zip(self.columns(runs), self.shift, self.measured)
        return [run + shift - data for run, shift, data in found]

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
                raise self.numbers.refused(name, "; ".join([text, *self._other_starts(runs)]))

    def _other_starts(self, runs: Sequence[Result]) -> list[str]:
        """Return sentences about coordinates that start elsewhere than their first datum.

        Starts that depend on free numbers are not looked at.
        """
        found, curves = [], iter(zip(self.columns(runs), self.slopes(runs), self.measured))
        for i, (case, run) in enumerate(zip(self.numbers.cases, runs)):
            begins = bool(case.options["t_start"] == case.options["t_eval"][0])
            known = states_of_columns(run)
            for name in self.data[i]:
                own, slope, data = next(curves)
                state = known.get(self._named[i, name])
                if begins and state and not slope[0].any() and other_start(own, data):
                    of = f" of measurement {case.name!r}" if case.name else ""
                    found.append(f"{name}{of} starts at {own[0]:.4g}, and its first datum is "
                                 f"{data[0]:.4g}: {state.given(data[0])}")  # fmt: skip
        return found[:NUMBERS_TOLD]

    def _linear(self, x: Array, noise: Array) -> Linear:
        left = [a / b for a, b in zip(self._left(x), noise)]
        jacobian = self._jacobian(x, noise, self.priors)
        return Linear(jacobian, self.numbers.size, widening(np.concatenate(left), self.loss))

    def _report(
        self, x: Array, noise: Array, text: str, fine: Finer | None, notices: list[str],
        endings: list[Ending],
    ) -> Fit:  # fmt: skip
        numbers, names, left = self.numbers, self.numbers.names, self._left(x)
        runs, linear, corrected = self.runs(x), self._linear(x, noise), any(map(np.any, self.shift))
        assert runs is not None
        covariance, off = linear.covariance, np.full(len(left), np.nan)
        if fine is not None:
            missed = [a - b for a, b in zip(fine.shift, self.shift)]
            off = np.array([_rms(a) + _rms(b) for a, b in zip(missed, fine.left)])
            moved = sum(np.abs(linear.moved(part, noise)) for part in (missed, fine.left))
            covariance = covariance + np.outer(moved, moved)
        size = np.sqrt(np.diag(covariance))
        errors = np.where(linear.weak, np.nan, size)
        size = np.where(size > 0.0, size, np.nan)
        residuals, spread = dict(zip(self.labels, left)), dict(zip(self.labels, noise.tolist()))
        floor = np.fmax(off, NOTABLE * self.scale)
        notices = notices + not_noise(residuals, dict(zip(self.labels, floor.tolist())))
        notices += self._other_starts(runs)
        if self.given is not None:
            notices += beyond_noise(residuals, spread)
        bounds = numbers.at_bounds(x)
        if numbers.failed and not (text or bounds or self._small(linear, noise, left)):
            text = f"not converged: limited by a run that fails {numbers.failed}"
        notes = [text or "converged", *bounds]
        if numbers.failed and numbers.failed not in text:
            notes.append(f"a run of the search failed: {numbers.failed}")
        shown = fine.runs if fine is not None and corrected else runs
        return Fit(
            model=numbers.at(x), values=Values(zip(names, x.tolist())),
            errors=dict(zip(names, errors.tolist())), covariance=covariance,
            correlation=covariance / np.outer(size, size), residuals=residuals,
            units=dict(zip(self.labels, self.units)), noise=spread,
            integration=dict(zip(self.labels, off.tolist())),
            undetermined=tuple(linear.undetermined(names)),
            combinations=linear.combinations(names, x), notices=tuple(notices),
            converged=not text, message="; ".join(notes), evaluations=numbers.evaluations,
            freedom=sum(self.lengths) - len(names) if self.given is None else math.inf,
            endings=tuple(endings),
            runs={case.name: run for case, run in zip(numbers.cases, shown)},
            data=dict(zip(self.labels, self.measured)),
        )  # fmt: skip


def _rms(x: Array) -> float:
    return math.sqrt(float(np.mean(x**2)))
