"""Background jobs: work for a model in a thread, which ends with one result or one reason.

A feature declares its kind of `Job`, a field of its `State` that holds the one in progress, a
function (job, progress) -> result that does the work, and `@on_result` for what the result changes.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, TypeVar

import pgraph_core as pg

from .events import Event, on
from .state import S

REPORT = 0.1  # [s] between progress events

Report = Callable[..., bool]  # takes news of the work, and returns False once it is cancelled


@dataclass(frozen=True)
class Job:
    """Work in progress for a model."""

    NAME: ClassVar[str]  # the name that users see
    FIELD: ClassVar[str]  # field of the state that holds it
    PROBLEM: ClassVar[str]  # field of the state with the reason why the last one had no result
    id: int
    model: pg.Model
    fraction: float = field(default=0.0, kw_only=True)
    cancelled: bool = field(default=False, kw_only=True)

    def changes(self, *news: Any) -> Mapping[str, Any]:
        """Return the fields of the job that news of the work change, by default its fraction."""
        return {"fraction": float(news[0])}


J = TypeVar("J", bound=Job)
Ended = TypeVar("Ended", bound=Callable[[Any, Any, Any], Any])
ENDS: dict[type[Job], Callable[[Any, Any, Any], Any]] = {}


def on_result(kind: type[Job]) -> Callable[[Ended], Ended]:
    """Register the function (state, job, result) -> state for the results of a kind of job."""

    def keep(ended: Ended) -> Ended:
        ENDS[kind] = ended
        return ended

    return keep


def started(state: S, kind: type[Job], *fields: Any, **more: Any) -> S:
    """Return the state with a new job for its model."""
    job = kind(state.jobs + 1, state.model, *fields, **more)
    return replace(state, jobs=job.id, **{kind.FIELD: job, kind.PROBLEM: ""})


def cancelled(state: S, kind: type[Job]) -> S:
    """Return the state with the job of a kind told to end with what it has."""
    job = getattr(state, kind.FIELD)
    return state if job is None else replace(state, **{kind.FIELD: replace(job, cancelled=True)})


@dataclass(frozen=True)
class Progress(Event):
    """A job has advanced."""

    collapses = True
    id: int  # id of the job
    changes: Mapping[str, Any]  # changed fields of the job


@dataclass(frozen=True)
class Done(Event):
    """A job has ended with a result."""

    id: int
    result: Any


@dataclass(frozen=True)
class Failed(Event):
    """A job has ended without a result."""

    id: int
    text: str


@on(Progress, Done, Failed)
def heard(state: Any, event: Progress | Done | Failed) -> Any:
    """Handle news of the jobs in progress, and ignore those of jobs that were dropped."""
    kind = next((one for one in ENDS if _id(state, one) == event.id), None)
    if kind is None:
        return state
    job = getattr(state, kind.FIELD)
    match event:
        case Progress(_, changes):
            return replace(state, **{kind.FIELD: replace(job, **changes)})
        case Done(_, result):
            return ENDS[kind](replace(state, **{kind.FIELD: None}), job, result)
        case Failed(_, text):
            return replace(state, **{kind.FIELD: None, kind.PROBLEM: text})


def _id(state: Any, kind: type[Job]) -> int | None:
    job = getattr(state, kind.FIELD)
    return None if job is None else job.id


class Worker:
    """Does the jobs of a kind in a thread once the kernels are ready, until they are dropped."""

    def __init__(
        self, kind: type[J], work: Callable[[J, Report], Any], send: Callable[[Event], None]
    ):
        self._kind, self._work, self._send = kind, work, send
        self._begun = 0  # id of the job that was started last
        self._over = threading.Event()

    def render(self, old: Any, new: Any) -> None:
        job = getattr(new, self._kind.FIELD)
        if job is None or job.id != self._begun:
            self._over.set()
        if job is not None and job.id != self._begun and new.ready:
            self._begun, self._over = job.id, threading.Event()
            args, name = (job, self._over), f"pgraph-{job.NAME}"
            threading.Thread(target=self._run, args=args, name=name, daemon=True).start()
        if job is not None and job.cancelled:
            self._over.set()

    def _run(self, job: Any, over: threading.Event) -> None:
        reported = 0.0

        def progress(*news: Any) -> bool:
            nonlocal reported
            if time.perf_counter() - reported > REPORT:
                reported = time.perf_counter()
                self._send(Progress(job.id, job.changes(*news)))
            return not over.is_set()

        try:
            self._send(Done(job.id, self._work(job, progress)))
        except KeyboardInterrupt:
            self._send(Failed(job.id, f"The {job.NAME} was cancelled before its first run."))
        except pg.PgraphError as error:
            self._send(Failed(job.id, str(error)))
        except Exception as error:  # shown on the page: the session goes on
            text = f"The {job.NAME} stopped: {type(error).__name__}: {error}"
            self._send(Failed(job.id, text))
