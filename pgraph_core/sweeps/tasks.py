"""Execution of sweep points in this process, in local processes, or by Dask workers."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import cached_property
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext
from pathlib import Path as FilePath
from typing import Any

from ..errors import InputError, PgraphError, Problem, shown
from ..interrupts import starting
from ..mechanism import Mechanism
from ..model import Model
from ..portable import installed
from ..result import Result
from ..result.dense import TOO_WIDE
from ..simulation import simulate
from ..simulation.paths import Path, with_numbers
from .metrics import Metric, measured

CHUNK = 1.0  # [s] work sent to a process at once. Shorter sweeps start no processes
MOST_NUMBERS = 10_000_000  # limit on the frames of a run that is repeated with a frame per step
MOST_LOST = (
    2  # number of times in a row that processes are stopped before any of their points is done
)
ANSWER = 10  # [s] for a scheduler to answer


@dataclass(frozen=True)
class Row:
    """The result at one point: its values, or the reason for its failure."""

    point: int
    values: tuple[float, ...]
    status: str
    reason: str = ""


@dataclass(frozen=True)
class Task:
    """The data that a worker needs, sent to each worker once."""

    model: Model
    paths: tuple[Any, ...]
    metrics: Mapping[str, Metric | str]
    options: Mapping[str, Any]
    version: str

    @cached_property
    def located(self) -> tuple[Path, ...]:
        """The locations of the paths in the model."""
        return tuple(Path(self.model, path) for path in self.paths)


def run_points(task: Task, points: Sequence[tuple[int, tuple[float, ...]]]) -> list[Row]:
    """Run some points and return their rows. Raises InputError if the worker's version differs."""
    if task.version != installed():
        text = f"runs version {installed()}; the sweep is of {task.version}: install the same"
        raise InputError(Problem("sweep", "worker", text))
    paths = task.located
    return [_row(task, paths, number, values) for number, values in points]


def _row(task: Task, paths: Sequence[Path], number: int, values: Sequence[float]) -> Row:
    try:
        model = with_numbers(task.model, paths, values)
        options = {"estimate": False, **task.options}
        run = simulate(Mechanism(model), **options)
        steps = run.counters["steps"]
        few = steps * (run.q.shape[1] + 2 * run.v.shape[1]) < MOST_NUMBERS
        if few and _unseen(run) and not {"frames", "t_eval"} & options.keys():
            run = simulate(Mechanism(model), **options, frames=steps + 1)
        if not run.status.ok:
            return Row(number, (), run.status.name, run.message)
    except PgraphError as error:
        return Row(number, (), "REFUSED", str(error))
    found, reasons = list[float](), list[str]()
    for name, metric in task.metrics.items():
        value, reason = _measured(run, name, metric)
        found.append(value)
        reasons += [reason] if reason else []
    status = "FAILED" if reasons else run.status.name
    return Row(number, tuple(found), status, "; ".join(reasons) or _unseen(run))


def _unseen(run: Result) -> str:
    """Return a warning if the frames miss an oscillation, or ""."""
    return next((text for text in run.notices if text.startswith(TOO_WIDE)), "")


def _measured(run: Result, name: str, metric: Metric | str) -> tuple[float, str]:
    """Return (value, ""), or nan and the reason, so that an error in one metric does not affect the
    others."""
    try:
        value = measured(run, metric)
    except PgraphError as error:
        return math.nan, str(error)
    except Exception as error:  # a user's metric: one point must not end a night of others
        return math.nan, f"{type(error).__name__}: {error}"
    return value, "" if value == value else f"the metric {name!r} is not a number"


def rows_of(
    task: Task, points: Sequence[tuple[int, tuple[float, ...]]], workers: int | None, scheduler: Any
) -> Iterator[list[Row]]:
    """Yield rows as they finish, in any order. The rows do not depend on the worker."""
    if scheduler is not None:
        yield from _by_dask(task, points, scheduler)
        return
    began = time.perf_counter()
    for done in range(1, len(points) + 1):  # alone, until it is known to take longer
        yield run_points(task, points[done - 1 : done])
        spent = time.perf_counter() - began
        left = spent / done * (len(points) - done)
        if workers != 1 and done >= 2 and spent > CHUNK / 10 and left > CHUNK:
            if workers is None and not _guarded():
                warnings.warn(f"sweep: computed in one process; {GUARD}", stacklevel=4)
                workers = 1
                continue
            yield from _by_processes(task, points[done:], spent / done, workers)
            return


GUARD = 'to use all cores call it in your script below `if __name__ == "__main__":`'


def _guarded() -> bool:
    """Check whether the main script can be re-imported safely by spawned processes."""
    path = getattr(sys.modules.get("__main__"), "__file__", None)
    try:
        return path is None or "__name__" in FilePath(path).read_text(errors="replace")
    except OSError:
        return True  # not a script


def _chunks(points: Sequence[Any], each: float) -> list[Sequence[Any]]:
    size = max(1, int(CHUNK / max(each, 1e-6)))
    return [points[i : i + size] for i in range(0, len(points), size)]


def _by_processes(
    task: Task, points: Sequence[Any], each: float, workers: int | None
) -> Iterator[list[Row]]:
    import pickle
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    try:
        pickle.dumps(task)
    except Exception:  # a lambda or a nested function: it cannot leave this process
        for part in _chunks(points, each):
            yield run_points(task, part)
        return
    given: Any = {"initializer": _keep, "initargs": (task,)}
    left, lost = _chunks(points, each), 0
    while left:  # again with new processes for the points of one that was stopped
        before, processes = len(left), Processes()
        pool = ProcessPoolExecutor(workers or os.cpu_count(), mp_context=processes, **given)
        try:
            with starting():
                futures = {pool.submit(_run_kept, part): part for part in left}
            for future in as_completed(futures):
                rows = future.result()
                left.remove(futures[future])
                yield rows
        except BrokenProcessPool:
            lost = 0 if len(left) < before else lost + 1
        except BaseException:  # Ctrl+C, or nobody takes more rows
            processes.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        if lost == MOST_LOST:
            raise InputError(Problem("sweep", "workers", _stopped(points, left)))


class Processes(SpawnContext):
    """Starts processes, and can end them. Forks of a process with threads may hang."""

    def __init__(self) -> None:
        super().__init__()
        self._made = list[Any]()

    def Process(self, *args: Any, **fields: Any) -> Any:  # type: ignore[override]
        made = super().Process(*args, **fields)
        self._made.append(made)
        return made

    def terminate(self) -> None:
        """End all processes, whatever they compute."""
        for process in self._made:
            process.terminate()


def _stopped(points: Sequence[Any], left: Sequence[Sequence[Any]]) -> str:
    """Return the reason why the processes of a sweep end before any of the points left is done."""
    count = sum(map(len, left))
    if count == len(points):
        return f"the processes ended before the first point; {GUARD}, or give workers=1"
    return (
        f"the processes are stopped by the system, with {count} points left, as systems do "
        "that run out of memory; give fewer workers, and out= with resume=True to keep what is "
        "done"
    )


_KEPT: list[Task] = []  # the sweep whose points this process computes


def _keep(task: Task) -> None:
    _KEPT[:] = [task]
    threading.Thread(target=_end_with_parent, name="pgraph-parent", daemon=True).start()


def _end_with_parent() -> None:
    """Wait for the end of the process that started this one, which may be killed, and end too."""
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)


def _run_kept(points: Sequence[Any]) -> list[Row]:
    return run_points(_KEPT[0], points)


def _connected(scheduler: Any) -> Any:
    """Connect to a Dask scheduler. Raises InputError, also if it does not respond."""
    from distributed import Client

    found: list[Any] = []

    def connect() -> None:
        try:
            found.append(Client(scheduler, timeout=ANSWER))
        except (OSError, ValueError, TypeError, TimeoutError) as error:
            found.append(error)

    thread = threading.Thread(target=connect, name="pgraph-scheduler", daemon=True)
    thread.start()
    thread.join(2 * ANSWER)  # its own limit does not hold for a greeting that never comes
    if found and isinstance(found[0], Client):
        return found[0]
    why = found[0] if found else f"it did not answer for {2 * ANSWER} s"
    text = f"{shown(scheduler)} does not answer: {why}; start one with `dask scheduler`"
    raise InputError(Problem("sweep", "scheduler", text))


def _by_dask(task: Task, points: Sequence[Any], scheduler: Any) -> Iterator[list[Row]]:
    """Run on the workers of a Dask cluster, given by address, cluster or `distributed.Client`."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        text = "needs the package distributed: pip install pgraph-dynamics[cluster]"
        raise InputError(Problem("sweep", "scheduler", text)) from None
    client = scheduler if isinstance(scheduler, Client) else _connected(scheduler)
    if not client.scheduler_info()["workers"]:
        text = "has no workers: start some with `dask worker ADDRESS`"
        raise InputError(Problem("sweep", "scheduler", text))
    try:
        shared = client.scatter(task, broadcast=True)
        parts = _chunks(points, CHUNK / 50)
        futures = client.map(
            lambda part, task: run_points(task, part), parts, task=shared, pure=False
        )
        for future in as_completed(futures):
            yield future.result()
    except (CancelledError, OSError, TimeoutError) as lost:
        text = (
            f"the scheduler or its workers are gone: {lost or type(lost).__name__}; with out= the "
        )
        text += "points that were computed are kept, and resume=True continues from them"
        raise InputError(Problem("sweep", "scheduler", text)) from None
    finally:
        if client is not scheduler:
            client.close()
