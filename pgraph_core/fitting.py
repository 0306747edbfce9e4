"""Fits: numbers of a model that make its runs follow measured curves, with exact derivatives."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from .dynamics.arguments import wrong_type
from .errors import (
    InputError,
    ModelError,
    PgraphError,
    Problem,
    choices,
    explained,
    needed,
    shown,
)
from .markup import ordinary
from .mechanism import Mechanism
from .model import Model
from .result import Result
from .result.columns import columns_of, coordinates, meant, no_column
from .simulation import simulate
from .simulation.paths import Path, distinct, with_numbers
from .tolerances import step_of_differences

Array = np.ndarray
ROUNDS = 3  # fits, each weighted by the noise that the last one left: more change nothing visible
LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")
SMALL = step_of_differences(2)  # rad, m, or of a number
FAR = 1e3  # residual of a run that failed, in units of the data


@explained
@dataclass(frozen=True, eq=False)
class Fit:
    """The result of `fit`: numbers at the best agreement, and how well the data determine them.

    Arrays over the free numbers are in the order of `values`.
    """

    model: Model  # the model with the fitted numbers
    values: Mapping[str, float]
    errors: Mapping[str, float]  # standard errors, nan where the data do not determine a number
    covariance: Array  # (k, k)
    correlation: Array  # (k, k)
    residuals: Mapping[str, Array]  # {column: (n,)} run - data
    noise: Mapping[str, float]  # {column: standard deviation}, as given or as left by the fit
    undetermined: tuple[str, ...]  # a sentence for each direction that the data do not determine
    converged: bool
    message: str
    evaluations: int  # runs
    run: Result  # the run of the fitted model at the times of the data
    data: Mapping[str, Array]

    def __repr__(self) -> str:
        lines = [f"<Fit: {self.message}"]
        for path, value in self.values.items():
            lines.append(f"  {path} = {value:.6g} ± {self.errors[path]:.2g}")
        return "\n".join([*lines, *(f"  {text}" for text in self.undetermined)]) + ">"

    def plot(self) -> Any:
        """A matplotlib figure of data, run and residuals. Raises MissingPackage."""
        figure, panels = needed("matplotlib.pyplot", "plot").subplots(
            len(self.residuals), 2, squeeze=False, sharex=True
        )
        t = self.run.t
        for (name, missed), (left, right) in zip(self.residuals.items(), panels):
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
    scenario: str | None = None,
    sigma: Mapping[str, float] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: str = "linear",
    **options: Any,
) -> Fit:
    """Fit numbers of a model to measured curves.

    Residuals are minimised by `scipy.optimize.least_squares` with exact derivatives of each run.
    The search starts at the numbers of the model. Each column is weighted by its noise: that of
    `sigma`, or what the fit before left of it.

    Parameters
    ----------
    model : Model or Mechanism
        The model to fit.
    data : DataFrame, dict or path of a .csv file
        Times "t" [s] and columns that are named as those of `Result.columns`, units in brackets
        permitted.
    free : dict
        Bounds (low, high) by path, as in `sweep`: {"bodies.arm.mass": (0.1, 2.0)}. "q.arm" and
        "v.arm" stand for the initial state of a body.
    scenario : str, optional
        Name of the scenario to run.
    sigma : dict, optional
        Standard deviation of the noise by column, in its unit.
    priors : dict, optional
        Expected value and its standard deviation by path.
    loss : {"linear", "soft_l1", "huber", "cauchy", "arctan"}
        Growth of what a residual costs, of which the last four bear outliers.
    **options
        Arguments of `simulate`, such as `method` and `step`.

    Returns
    -------
    Fit
        The best numbers found, also where the search did not converge: `message` says why.

    Raises
    ------
    InputError
        If arguments do not fit, or a number of `free` has no influence on the data.
    """
    base = model.model if isinstance(model, Mechanism) else model
    if not isinstance(base, Model):
        raise wrong_type("fit", "model", "a pg.Model", model)
    task = _Task(base, data, free, scenario, options)
    return task.fitted(_noise(task, sigma), _priors(task, priors), _loss(loss))


class _Task:
    """The data and the free numbers of a fit, and its last run."""

    def __init__(self, model: Model, data: Any, free: Any, scenario: str | None, options: Any):
        self.model, self.scenario, self.options = model, scenario, dict(options)
        self.options.setdefault("estimate", False)
        for name in ("wrt", "t_eval", "frames", "t_start", "t_end"):
            if name in options:
                raise _refused(name, "is not given: times come from the data")
        self.paths, self.bounds = self._free(free)
        self.names = [
            given if isinstance(given, str) else path.text for given, path in zip(free, self.paths)
        ]
        self.data, self._units = _columns(data)
        self.t = self.data.pop("t")
        self._named: dict[str, str] = {}  # columns of runs by those of the data
        self._last: tuple[Array, Result | None] | None = None
        self.evaluations, self.failed = 0, ""

    def _free(self, free: Any) -> tuple[list[Path], Array]:
        if not isinstance(free, Mapping) or not free:
            text = "must map paths to (low, high), as {'bodies.arm.mass': (0.1, 2)}; given "
            raise _refused("free", text + shown(free))
        paths, bounds = [], []
        for given, pair in free.items():
            path = Path(self.model, self._spelt(given), "fit")
            try:
                low, high = map(float, pair)
            except (TypeError, ValueError):
                raise _refused(path.text, f"needs (low, high); given {shown(pair)}") from None
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                text = f"needs finite numbers low < high; given {shown(pair)}"
                raise _refused(path.text, text)
            if not low <= path.present <= high:
                text = f"is {path.present:g} in the model, outside of its bounds {low:g} to "
                raise _refused(path.text, f"{text}{high:g}: change the model, or the bounds")
            for end in (low, high):
                try:
                    path.set(self.model, end)
                except ModelError as error:
                    text = f"the bound {end:g} makes the model invalid: {error.problems[0]}"
                    raise _refused(path.text, text) from None
            paths.append(path)
            bounds.append((low, high))
        distinct(paths, "fit")
        return paths, np.array(bounds)

    def _spelt(self, given: Any) -> Any:
        """A path as `Path` takes it: "q.arm" is "bodies.arm.q", or a number of the scenario."""
        if not isinstance(given, str) or given in self.model.parameters:
            return given
        group, _, name = given.partition(".")
        if group not in ("q", "v"):
            return given
        own = self.model.scenario(self.scenario) if self.scenario is not None else None
        body, _, entry = name.rpartition(".")
        rest = [entry] if body and entry.isdecimal() and body in self.model else []
        body = body if rest else name
        if own is not None and body in getattr(own, group):
            return ("scenarios", self.scenario, group, body, *rest)
        return ("bodies", body, group, *rest)

    # -- runs --------------------------------------------------------------------------------------

    def run(self, x: Array) -> Result | None:
        """The run at x, with derivatives by all free numbers, or None where it fails."""
        if self._last is not None and np.array_equal(self._last[0], x):
            return self._last[1]
        self.evaluations += 1
        changed = self.with_values(x)
        times, span = self.t, {"t_start": 0.0, "t_end": float(self.t[-1])}
        wrt = [path.given for path in self.paths]
        run = simulate(
            changed, scenario=self.scenario, t_eval=times, wrt=wrt, **span, **self.options
        )
        good = run.status.ok and len(run.t) == len(times)
        if not good:
            self.failed = run.message
        elif not all(np.isfinite(d).all() for d in run.derivatives.values()):
            ended = [text for text in run.notices if "derivatives end" in text]
            raise _refused("model", "; ".join(ended) or "its runs have no derivatives")
        self._last = x.copy(), run if good else None
        return self._last[1]

    def with_values(self, x: Array) -> Model:
        """The model with other free numbers. Raises InputError where it is none."""
        try:
            return with_numbers(self.model, self.paths, x.tolist())
        except ModelError as error:
            at = ", ".join(f"{name} = {value:g}" for name, value in zip(self.names, x))
            text = f"{at} makes the model invalid: {error.problems[0]}; give narrower bounds"
            raise _refused("free", text) from None

    def columns(self, run: Result) -> Array:
        """(columns, n) what the run has for the data."""
        found = columns_of(run)
        if not self._named:
            for name in self.data:
                known = [c for c in meant(found, name) if c != "t" and found[c].unit]
                if len(known) != 1:
                    several = f"may be any of {choices(known, 6)}" if known else ""
                    raise _refused(f"data['{name}']", several or no_column(found, name))
                unit, given = found[known[0]].unit, self._units.get(name, "")
                if given and given != unit:
                    raise _refused(f"data['{name}']", f"is in {given}: convert it to {unit}")
                self._named[name] = known[0]
        return np.array([found[column].values for column in self._named.values()])

    def slopes(self, run: Result) -> Array:
        """(columns, n, free) their derivatives."""
        names = [[name for name, _ in of] for of in coordinates(run.mechanism)]
        places = {**dict(zip(names[0], range(len(names[0]))))}
        places |= {f"v.{name}": len(names[0]) + k for k, name in enumerate(names[1])}
        out = np.zeros((len(self.data), len(self.t), len(self.paths)))
        for k, path in enumerate(run.derivatives):
            exact = run.derivatives[path]
            width = 2.0 * SMALL / max(float(np.abs(exact).max()), 1.0 / self._size(k))
            beside: list[Any] = []
            for i, column in enumerate(self._named.values()):
                if column in places and column not in run.mechanism.model.parameters:
                    out[i, :, k] = exact[:, places[column]]
                    continue
                if not beside:
                    source = run.derivatives.source
                    beside = [
                        columns_of(source.beside(run, path, share * width)) for share in (-0.5, 0.5)
                    ]
                out[i, :, k] = (beside[1][column].values - beside[0][column].values) / width
        return out

    def _size(self, k: int) -> float:
        return abs(self.paths[k].present) or 1.0

    # -- the fit -----------------------------------------------------------------------------------

    def fitted(self, sigma: Array | None, priors: Array, loss: str) -> Fit:
        """Minimise, with noise as given or as it is left."""
        from scipy.optimize import least_squares

        x = np.array([path.present for path in self.paths])
        first = self.run(x)
        if first is None:
            raise _refused("model", f"its run fails: {self.failed}")
        measured = np.array([*self.data.values()])
        self.columns(first)
        scale = np.ptp(measured, axis=1)
        scale[scale == 0.0] = 1.0
        noise = scale if sigma is None else sigma
        self._influence(first, scale)
        held = np.isfinite(priors[:, 1])

        def missed(x: Array) -> Array:
            run = self.run(x)
            if run is None:
                return np.full(measured.size + held.sum(), FAR)
            found = ((self.columns(run) - measured) / noise[:, None]).ravel()
            return np.concatenate((found, ((x - priors[:, 0]) / priors[:, 1])[held]))

        def slopes(x: Array) -> Array:
            run = self.run(x)
            assert run is not None  # a failed run costs too much to be a step's end
            found = (self.slopes(run) / noise[:, None, None]).reshape(measured.size, -1)
            return np.concatenate((found, np.diag(1.0 / priors[:, 1])[held]))

        rounds = ROUNDS if sigma is None and (len(measured) > 1 or loss != "linear") else 1
        least: Any = least_squares  # typed too narrowly
        while True:
            found = least(missed, x, jac=slopes, bounds=self.bounds.T, x_scale="jac", loss=loss)
            x, rounds = found.x, rounds - 1
            run = self.run(x)
            assert run is not None
            left = self.columns(run) - measured
            spread = np.sqrt((left**2).sum(axis=1) / max(1.0, left.shape[1] - len(x) / len(left)))
            if sigma is None:
                noise = np.maximum(spread, np.finfo(float).eps * scale)
            if rounds == 0:
                break
        return self._report(x, run, slopes(x), left, noise, found)

    def _influence(self, run: Result, scale: Array) -> None:
        """Refuse numbers that change nothing."""
        slopes = self.slopes(run) / scale[:, None, None]
        for k, path in enumerate(self.paths):
            if not slopes[:, :, k].any():
                text = "has no influence on the data: leave it out, or add a column that it changes"
                raise _refused(path.text, text)

    def _report(
        self, x: Array, run: Result, jacobian: Array, left: Array, noise: Array, found: Any
    ) -> Fit:
        ranges = np.ptp(self.bounds, axis=1)
        names = self.names
        _, values, directions = np.linalg.svd(jacobian * ranges, full_matrices=False)
        # a direction whose standard deviation is more than the bounds allow is not determined
        open_ = values < 1.0
        told = tuple(_direction(names, direction) for direction in directions[open_])
        kept = directions[~open_] / values[~open_, None]
        covariance = (kept.T @ kept) * np.outer(ranges, ranges)
        weak = (np.abs(directions[open_]) > 0.1).any(axis=0)
        errors = np.where(weak, np.nan, np.sqrt(np.diag(covariance)))
        size = np.sqrt(np.diag(covariance))
        size[size == 0.0] = np.nan
        converged = found.status > 0
        message = "converged" if converged else f"not converged: {found.message}"
        at_bound = [
            f"{name} is at its bound {value:g}"
            for name, value, pair in zip(names, x, self.bounds)
            if np.abs(pair - value).min() < 1e-9 * np.ptp(pair)
        ]
        if self.failed:
            at_bound.append(f"a run on the way failed: {self.failed}")
        return Fit(
            model=self.with_values(x), values=dict(zip(names, x.tolist())),
            errors=dict(zip(names, errors.tolist())), covariance=covariance,
            correlation=covariance / np.outer(size, size),
            residuals=dict(zip(self.data, left)), noise=dict(zip(self.data, noise.tolist())),
            undetermined=told, converged=converged, message="; ".join([message, *at_bound]),
            evaluations=self.evaluations, run=run, data=self.data,
        )  # fmt: skip


def _direction(names: Sequence[str], direction: Array) -> str:
    """A sentence on a direction of free numbers, each in its range."""
    large = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > 0.1]
    if len(large) == 1:
        return f"the data do not determine {names[large[0]]}"
    parts = [f"{direction[i] / direction[large[0]]:+.2g} {names[i]}" for i in large]
    return f"the data do not determine {' '.join(parts).lstrip('+')}, each over its range"


def _noise(task: _Task, sigma: Any) -> Array | None:
    if sigma is None:
        return None
    if not isinstance(sigma, Mapping) or {*sigma} != {*task.data}:
        text = f"needs a number for each column, {choices(task.data)}; given {shown(sigma)}"
        raise _refused("sigma", text)
    found = np.array([float(sigma[name]) for name in task.data])
    if not (np.isfinite(found) & (found > 0.0)).all():
        raise _refused("sigma", f"must be numbers > 0; given {shown(sigma)}")
    return found


def _priors(task: _Task, priors: Any) -> Array:
    """(free, 2) expected values and standard deviations, infinite without a prior."""
    found = np.tile([0.0, np.inf], (len(task.paths), 1))
    names = task.names
    for name, pair in (priors or {}).items():
        if name not in names:
            raise _refused("priors", f"{name!r} is not free; choose from {choices(names)}")
        mean, spread = map(float, pair)
        if not (math.isfinite(mean) and 0.0 < spread < math.inf):
            raise _refused("priors", f"{name!r} needs (value, spread > 0); given {shown(pair)}")
        found[names.index(name)] = mean, spread
    return found


def _loss(loss: str) -> str:
    if loss not in LOSSES:
        raise _refused("loss", f"must be one of {choices(LOSSES)}; given {shown(loss)}")
    return loss


def _columns(data: Any) -> tuple[dict[str, Array], dict[str, str]]:
    """{name: (n,)} of the data, with "t". Raises InputError, FileError."""
    if isinstance(data, (str, FilePath)):
        data = _read(data)
    if hasattr(data, "to_dict") and hasattr(data, "columns"):  # a DataFrame
        table = data if "t" in [*data.columns] else data.reset_index()
        data = {str(name): table[name].to_numpy() for name in table.columns}
    if not isinstance(data, Mapping):
        raise _refused("data", f"must be a DataFrame, a dict or a .csv file; given {shown(data)}")
    found, units = dict[str, Array](), dict[str, str]()
    for name, values in data.items():
        word, _, unit = str(name).partition(" [")
        units[word] = unit.removesuffix("]")
        if word in ("t", "time") and units[word] not in ("", "s"):
            raise _refused(f"data['{name}']", f"is in {units[word]}: convert it to s")
        try:
            found["t" if word in ("t", "time") else word] = np.array(values, dtype=float)
        except (TypeError, ValueError):
            raise _refused(f"data['{name}']", "must be numbers") from None
    if "t" not in found or len(found) < 2:
        text = f"needs a column t of times [s] and others; given {choices(found) or 'none'}"
        raise _refused("data", text)
    n = len(found["t"])
    for name, values in found.items():
        if values.shape != (n,):
            text = f"has shape {values.shape}, and t has {n} numbers"
            raise _refused(f"data['{name}']", text)
        if len(bad := np.flatnonzero(~np.isfinite(values))):
            text = f"row {bad[0]} is {values[bad[0]]}: leave out rows without a number"
            raise _refused(f"data['{name}']", text)
    t = found["t"]
    if n < 2 or t[0] < 0.0 or not (np.diff(t) > 0.0).all():
        raise _refused("data['t']", "must be two times or more, ascending from 0 s on")
    return found, units


def _read(path: str | FilePath) -> dict[str, list[str]]:
    try:
        with ordinary(path) as file:
            rows = [*csv.reader(file.read().decode("utf-8-sig").splitlines())]
    except (OSError, ValueError) as error:
        raise _refused(str(path), f"cannot be read: {error}") from None
    if len(rows) < 2:
        raise _refused(str(path), "needs a line of names and lines of numbers")
    return {name.strip("'\" "): [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}


def _refused(what: str, text: str) -> PgraphError:
    return InputError(Problem("fit", what, text))
