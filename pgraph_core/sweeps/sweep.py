"""Sweeps: their points, the measured values, and the file that preserves progress if
interrupted.
"""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from inspect import signature
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from .. import words
from ..dynamics import model_of
from ..dynamics.arguments import numbers_in
from ..errors import (
    FileError,
    InputError,
    ModelError,
    Problem,
    choices,
    example_of,
    explained,
    nearest,
    shown,
)
from ..fields import whole
from ..mechanism import Mechanism
from ..model import Model
from ..model.files import write_atomic
from ..portable import Portable, installed
from ..simulation import simulate
from ..simulation.options import Progress, shown_progress
from ..simulation.paths import Path, counting, distinct, started, with_numbers
from .metrics import measured, metrics_of, said_of
from .tasks import Row, Task, rows_of

Array = np.ndarray
FORMATS = (".csv", ".parquet")
SHOWN = 20  # points that are printed
TRIED = 100  # points of which one must be a model for a look before the first run


class Measured(dict[str, Array]):
    """Values by metric, as an array (n,) if there is one metric and (n, k) if there are k."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        columns = [*self.values()]
        return np.array(columns[0] if len(columns) == 1 else np.transpose(columns), dtype)


@explained
@dataclass(frozen=True, eq=False)
class Sweep(Portable):
    """The results of `sweep`, with one entry per point. Converting the sweep to an array returns
    its values.

    `points` (n, k) contains the values of `paths`, and `values` one array (n,) per metric, which is
    nan if the run failed. In this case, `status` and `reason` (n,) contain the cause.
    """

    paths: tuple[str, ...]
    points: Array
    values: Mapping[str, Array]
    status: tuple[str, ...]
    reason: tuple[str, ...]

    def __post_init__(self) -> None:
        vars(self)["values"] = Measured(self.values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.values, dtype)

    @property
    def failed(self) -> Array:
        """Indices of the points without values."""
        return np.flatnonzero(
            [any(np.isnan(x[i]) for x in self.values.values()) for i in range(len(self))]
        )

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        over = ", ".join(self.paths)
        missing = f", {len(self.failed)} failed" if len(self.failed) else ""
        return f"<Sweep of {len(self)} points over {over}: {', '.join(self.values)}{missing}>"

    def __str__(self) -> str:
        columns = {name: x for name, x in self.columns().items() if name != "reason"}
        rows = zip(*(x[:SHOWN] for x in columns.values()))
        cells = [
            [*columns],
            *([f"{x:.6g}" if isinstance(x, float) else str(x) for x in row] for row in rows),
        ]
        wide = [max(len(row[i]) for row in cells) for i in range(len(columns))]
        lines = ["  ".join(x.rjust(n) for x, n in zip(row, wide)) for row in cells]
        left = len(self) - SHOWN
        return "\n".join([repr(self), *lines, *([f"... {left} more points"] if left > 0 else [])])

    def __getitem__(self, name: str) -> Any:
        """Return a column by name. Raises InputError."""
        columns = self.columns()
        if name not in columns:
            do = "; rows are table.to_pandas().iloc[...]" if not isinstance(name, str) else ""
            text = f"no column is named {shown(name)}; choose one of {choices(columns)}{do}"
            raise InputError(Problem("table", "", text))
        return columns[name]

    def columns(self) -> dict[str, Any]:
        """The table by column: paths, metrics, status and reason, each with one entry per point."""
        points = {path: self.points[:, i] for i, path in enumerate(self.paths)}
        return {**points, **self.values, "status": list(self.status), "reason": list(self.reason)}

    def to_pandas(self) -> Any:
        """Create a pandas DataFrame with one row per point."""
        from ..errors import needed

        return needed("pandas", "pandas").DataFrame(self.columns())

    def to_csv(self) -> str:
        """Return the table as CSV text, with all digits of the values."""
        columns, out = self.columns(), io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*columns.values()):
            writer.writerow([repr(float(x)) if isinstance(x, float) else x for x in row])
        return out.getvalue()

    def save(self, path: str | FilePath, /) -> None:
        """Save the table to a file.

        Parameters
        ----------
        path : path
            A .csv or .parquet file.

        Raises
        ------
        FileError
            If the file cannot be written or has another suffix.
        """
        suffix = _format(path)
        if suffix == ".csv":
            write_atomic(path, self.to_csv())
            return
        buffer = io.BytesIO()
        try:
            self.to_pandas().to_parquet(buffer, index=False)
        except ImportError:
            text = "needs the package pyarrow for .parquet: pip install pyarrow; or give a .csv"
            raise FileError(Problem(str(path), "", text)) from None
        write_atomic(path, buffer.getvalue())


@explained
def sweep(
    model: Model | Mechanism,
    set: Mapping[Any, Any],
    metric: Any,
    scenario: str | None = None,
    *,
    samples: str = "grid",
    n: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    scheduler: Any = None,
    out: str | FilePath | None = None,
    resume: bool = False,
    progress: Callable[[float], Any] | bool | None = None,
    **options: Any,
) -> Sweep:
    """Simulate a model for many values of its fields and compute metrics of each run.

    Sweeps that take longer than a second use several processes. This requires that scripts have an
    `if __name__ == "__main__":` guard and that metrics can be pickled, i.e. are not lambda
    functions. Otherwise, a warning is issued and a single process is used. The results do not
    depend on the number of processes. Failed points are included in the table together with the
    reason.

    Parameters
    ----------
    model : Model or Mechanism
        The model to vary.
    set : dict
        Values by path. A path can be "bodies.shin.mass", ("bodies", "shin", "mass"),
        "bodies.shin.link.0", the start "q.shin" or "v.shin" of a joint, or the name of a parameter,
        for example. No other fields are changed, so a body with a different mass keeps its inertia.
    metric : str, callable, list or dict
        Metrics to compute, given by a name such as "max knee", by a function that computes a number
        from a run, or by several of these. A name consists of an operation and a column of
        `Result.columns`. The operations are final, max, min, mean, rms, peak, range and settle (the
        time after which a curve stays within 2 % of its total change). Other names are
        energy_drift, error_estimate, t_end and steps.
    scenario : str, optional
        Name of the scenario to run.
    samples : {"grid", "latin", "sobol", "random"}
        Sampling method. With "grid", all combinations of values are used. The other methods draw
        `n` points, and each path must be given as (low, high) or as a frozen distribution from
        `scipy.stats`.
    n, seed : int
        Number of points and random seed.
    workers : int, optional
        Number of processes besides this one, which computes the first points, and all points if
        the others would take less than 1 s. By default, one per core is used.
    scheduler : optional
        Address of a Dask cluster to run on.
    out : str or path, optional
        File (.csv or .parquet) to write. Completed points are stored in `out` + ".part" until the
        sweep is finished.
    resume : bool
        Whether to continue from an existing ".part" file. If False, such a file raises an error.
    progress : callable or bool, optional
        Function that is called with the completed fraction. If it returns False, the sweep stops
        and returns the completed points. If True, a progress bar is shown (requires tqdm).
    **options
        Additional arguments of `simulate`. By default, errors are only estimated if a metric
        requires it.

    Returns
    -------
    Sweep
        A table with one row per point.

    Raises
    ------
    InputError
        If an argument is invalid.
    FileError
        If `out` cannot be written or continued.

    Examples
    --------
        table = pg.sweep(model, {"bodies.arm.mass": [1.0, 2.0]}, "max arm", t_end=1.0)
    """
    base = model_of("sweep", model, example_of(sweep))
    if not isinstance(set, Mapping) or not set:
        text = f"must map paths to values, as {{'bodies.shin.mass': [1, 2]}}, got {shown(set)}"
        raise InputError(Problem("sweep", "set", text))
    placed = [started(base, given, scenario) for given in set]
    paths = [Path(base, given) for given in placed]
    texts = (given if isinstance(given, str) else path.text for given, path in zip(set, paths))
    names, metrics = tuple(texts), metrics_of(metric)
    _fitting(paths, metrics, samples, n, workers, out, resume)
    points = points_of(dict(zip(names, set.values())), samples, n, seed)
    settings = {"scenario": scenario, **options}
    if "error_estimate" in metrics.values():
        settings.setdefault("estimate", True)
    counting(paths, base, "sweep", scenario, known_options(sweep, options))
    _tried(base, paths, points, metrics, settings)
    given = tuple(x if isinstance(x, str) else tuple(x) for x in placed)
    task = Task(base, given, metrics, settings, installed())
    kept = Kept(out, resume, _fingerprint(task, points)) if out is not None else None
    try:
        with shown_progress(progress, "sweep") as told:
            rows = _computed(task, points, kept, told, workers, scheduler)
        table = _table(names, points, tuple(metrics), rows)
        if kept and len(rows) == len(points):
            kept.finish(table)
    finally:
        if kept:
            kept.close()
    return table


def _computed(
    task: Task, points: Array, kept: Kept | None, told: Progress, workers: Any, scheduler: Any
) -> dict[int, Row]:
    """Return the rows of all points until `told` ends the sweep, starting with the kept ones."""
    rows = {row.point: row for row in kept.rows} if kept else {}
    todo = [(i, tuple(map(float, p))) for i, p in enumerate(points) if i not in rows]
    for found in rows_of(task, todo, workers, scheduler):
        rows.update({row.point: row for row in found})
        if kept:
            kept.append(found)
        if told is not None and told(len(rows) / len(points)) is False:
            break
    return rows


def known_options(call: Any, options: dict[str, Any]) -> dict[str, Any]:
    """Return options that a function passes on to `simulate`, under their Pgraph names.

    Raises InputError for unknown ones, with the arguments of both.
    """
    own = [*signature(call).parameters][:-1]
    passed = [name for name in signature(simulate).parameters if name not in (*own, "mechanism")]
    options = words.renamed(options, passed) or options
    for name in options:
        if name not in passed:
            text = f"is not an option of {call.__name__} or simulate; "
            text += nearest(name, [*own, *passed])
            raise InputError(Problem(call.__name__, name, text))
    return options


def _fitting(
    paths: list[Path], metrics: Iterable[str], samples: str, n: Any, workers: Any, out: Any,
    resume: bool,
) -> None:  # fmt: skip
    """Reject arguments that contradict each other or have no effect."""
    distinct(paths, "sweep")
    for name in metrics:
        if name in (*(path.text for path in paths), "status", "reason"):
            text = f"{name!r} is a column of the table already; give the metric another name"
            raise InputError(Problem("sweep", "metric", text))
    if n is not None and samples == "grid":
        text = "is for samples of ranges: give samples='latin', 'sobol' or 'random' too, "
        text += f"got n={shown(n)} with samples='grid'"
        raise InputError(Problem("sweep", "n", text))
    if workers is not None and (whole(workers) or 0) < 1:
        text = f"must be the number of processes, >= 1, or None for all cores, got {shown(workers)}"
        raise InputError(Problem("sweep", "workers", text))
    if resume and out is None:
        text = "needs a file to continue from: give out='table.csv' too"
        raise InputError(Problem("sweep", "resume", text))


def _tried(
    model: Model, paths: list[Path], points: Array, metrics: Mapping[str, Any], settings: Any
) -> None:
    """Start and stop one run, to detect problems that every point would have."""
    for point in points[:TRIED].tolist():
        with suppress(ModelError):  # this point alone fails, and its row gives the reason
            model = with_numbers(model, paths, point)
            break
    else:
        return
    try:
        run = simulate(model, **settings, progress=lambda _: False)
    except InputError as error:
        ours = [problem for problem in error.problems if problem.where == "simulate"]
        if ours:
            raise InputError(ours) from None
        return  # this point alone fails, and its row gives the reason
    for metric in metrics.values():
        if isinstance(metric, str):
            measured(run, metric)


def _table(
    names: tuple[str, ...], points: Array, metrics: tuple[str, ...], rows: Mapping[int, Row]
) -> Sweep:
    absent = Row(-1, (), "NOT_RUN", "the sweep was stopped before")
    each = [rows.get(i, absent) for i in range(len(points))]
    values = {
        name: np.array([row.values[k] if row.values else np.nan for row in each])
        for k, name in enumerate(metrics)
    }
    status, reason = tuple(row.status for row in each), tuple(row.reason for row in each)
    return Sweep(names, points, values, status, reason)


# -- what survives an interruption -----------------------------------------------------------------


class Kept:
    """A file of finished points, with a header that identifies the sweep and one line per point.

    Damaged lines are skipped and their points computed again. Raises InputError for the file of
    another sweep, and for points that would be lost.
    """

    def __init__(self, out: str | FilePath, resume: bool, fingerprint: str):
        self.path = FilePath(out)
        _format(out)
        self._part = self.path.with_name(self.path.name + ".part")
        self.rows: list[Row] = []
        try:
            if self._part.exists():
                self.rows = self._read(fingerprint)
            elif resume and self.path.exists():
                text = f"exists without {self._part.name} to continue from: it is a finished "
                text += "table, or none; without resume it is written over, or give another file"
                raise InputError(Problem(str(self.path), "", text))
            if self.rows and not resume:
                text = f"has {len(self.rows)} points of this sweep, which was interrupted: "
                text += "resume=True (--resume) continues from there; remove it to start again"
                raise InputError(Problem(str(self._part), "", text))
            lines = [{"sweep": fingerprint}, *map(asdict, self.rows)]
            write_atomic(self._part, "".join(json.dumps(line) + "\n" for line in lines))
        except OSError as error:
            reason = error.strerror or error
            text = f"cannot be read: {reason}; give a file in a folder of yours"
            raise FileError(Problem(str(self._part), "", text)) from None

    def _read(self, fingerprint: str) -> list[Row]:
        """Return the rows of undamaged lines. Raises InputError for a file of another sweep."""
        header, *lines = map(_line, self._part.read_bytes().splitlines() or [b'{"sweep": ""}'])
        if header.get("sweep") != fingerprint and (lines or "sweep" not in header):
            what = "another model, other values, metrics or options"
            text = f"belongs to another sweep ({what}); remove it, or use another file"
            raise InputError(Problem(str(self._part), "", text))
        names = [field.name for field in fields(Row)]
        whole = (line for line in lines if [*line] == names)
        return [Row(**{**line, "values": tuple(line["values"])}) for line in whole]

    def append(self, rows: list[Row]) -> None:
        """Write finished points in one operation. Raises FileError, as if the disk is full."""
        try:
            with self._part.open("ab") as file:
                file.write("".join(json.dumps(asdict(row)) + "\n" for row in rows).encode())
        except OSError as error:
            text = f"cannot be written: {error.strerror or error}; {len(self.rows)} points are in "
            text += "it: free some space, and continue with resume=True (--resume)"
            raise FileError(Problem(str(self._part), "", text)) from None
        self.rows += rows

    def finish(self, table: Sweep) -> None:
        """Write the table of all points, and delete the file."""
        table.save(self.path)
        self._part.unlink(missing_ok=True)

    def close(self) -> None:
        """Delete the file if it has no points."""
        if not self.rows:
            self._part.unlink(missing_ok=True)


def _line(text: bytes) -> dict[str, Any]:
    """Parse a line. Return {} if it is damaged."""
    try:
        found = json.loads(text)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _fingerprint(task: Task, points: Array) -> str:
    """Return a hash that identifies a sweep: model, paths, points, metrics, options, version."""
    metrics = {name: said_of(x) for name, x in task.metrics.items()}
    options = {name: repr(value) for name, value in task.options.items()}
    said = json.dumps(
        [task.model.to_json(), task.paths, metrics, options, task.version], sort_keys=True
    )
    return hashlib.sha256(said.encode() + np.ascontiguousarray(points).tobytes()).hexdigest()[:24]


def _format(path: str | FilePath) -> str:
    suffix = FilePath(path).suffix.lower()
    if suffix not in FORMATS:
        text = f"must end in {' or '.join(FORMATS)}"
        raise FileError(Problem(str(path), "", text))
    return suffix


# -- designs: the points of a sweep ----------------------------------------------------------------


SAMPLES = ("grid", "latin", "sobol", "random")
MOST_POINTS = 10_000_000


def points_of(values: Mapping[str, Any], samples: str, n: int | None, seed: int) -> Array:
    """Return the points in a design as an array of shape (points, paths).

    "grid": every combination of the values given for each path. "latin", "sobol" and "random": `n`
    points, each path given as (low, high) or as a frozen distribution of `scipy.stats`.
    Raises InputError.
    """
    if samples not in SAMPLES:
        text = f"must be one of {choices(SAMPLES)}, got {shown(samples)}"
        raise _refused("samples", text + words.choice(samples, SAMPLES))
    if samples == "grid":
        lists = [_listed(path, given) for path, given in values.items()]
        count = math.prod(map(len, lists))
        if count > MOST_POINTS:
            raise _refused("set", f"has {count} points; {MOST_POINTS} at most")
        return np.array(list(itertools.product(*lists)), dtype=float)
    if isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= MOST_POINTS:
        raise _refused("n", f"must be the number of points, 1 to {MOST_POINTS}, got {shown(n)}")
    if (start := whole(seed)) is None or start < 0:
        raise _refused("seed", f"must be a whole number >= 0, got {shown(seed)}")
    units = _unit_points(samples, len(values), n, start)
    columns = [_stretched(path, given, u) for (path, given), u in zip(values.items(), units.T)]
    return np.stack(columns, axis=1)


def _unit_points(samples: str, dimensions: int, n: int, seed: int) -> Array:
    """Return sample points within (0, 1) as an (n, dimensions) array."""
    from scipy.stats import qmc

    if samples == "latin":
        points = qmc.LatinHypercube(dimensions, rng=seed).random(n)
    elif samples == "sobol":
        points = qmc.Sobol(dimensions, rng=seed).random_base2(max(n - 1, 0).bit_length())[:n]
    else:
        points = np.random.default_rng(seed).random((n, dimensions))
    return np.clip(points, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)


def _stretched(path: str, given: Any, unit: Array) -> Array:
    if hasattr(given, "ppf"):
        return np.asarray(given.ppf(unit), dtype=float)
    pair = _listed(path, given)
    if len(pair) != 2 or not pair[0] < pair[1]:
        text = f"must be (low, high) or a distribution of scipy.stats, got {shown(given)}"
        raise _refused(path, text)
    return pair[0] + (pair[1] - pair[0]) * unit


def _listed(path: str, given: Any) -> Array:
    values = numbers_in(given)
    if values is not None and values.ndim == 0:
        values = values[None]
    if values is None or values.ndim != 1 or not len(values):
        raise _refused(path, f"must be a list of numbers, not empty, got {shown(given)}")
    if not np.isfinite(values).all():
        raise _refused(path, f"must be finite numbers, got {shown(given)}")
    return values


def _refused(what: str, text: str) -> InputError:
    return InputError(Problem("sweep", what, text))
