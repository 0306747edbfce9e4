"""Background work for a model in a thread: jobs that a person starts, and findings.

A feature declares its kind of `Job`, with its work, and a field of its `State` that holds one. A
`Finding` is declared in the same way, and needs no start: it is computed for each new model.
"""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from queue import SimpleQueue
from typing import Any, ClassVar, Self, TypeVar

import pgraph_core as pg

from .cells import Refusal
from .events import Event
from .state import S

REPORT = 0.1  # [s] between progress events

Report = Callable[..., bool]  # takes news of the work, and returns False once it is cancelled


@dataclass(frozen=True)
class Work:
    """Work in progress, whose news are events until it is dropped."""

    FIELD: ClassVar[str]  # field of the state that holds it
    id: int


@dataclass(frozen=True)
class Job(Work, ABC):
    """Work in progress for a model."""

    NAME: ClassVar[str]  # the name that users see
    PROBLEM: ClassVar[str]  # field of the state with the reason why the last one had no result
    model: pg.Model
    fraction: float = field(default=0.0, kw_only=True)
    cancelled: bool = field(default=False, kw_only=True)

    def changes(self, *news: Any) -> Mapping[str, Any]:
        """Return the fields of the job that news of the work change, by default its fraction."""
        return {"fraction": float(news[0])}

    @abstractmethod
    def work(self, progress: Report) -> Any:
        """Return the result. Tell `progress` news, and end early if it returns False."""

    @abstractmethod
    def ended(self, state: Any, result: Any) -> Any:
        """Return the state with the result of the job, without the job."""


J = TypeVar("J", bound=Job)


def started(state: S, kind: type[Job], *fields: Any, **more: Any) -> S:
    """Return the state with a new job for its model."""
    job = kind(state.jobs + 1, state.model, *fields, **more)
    return replace(state, jobs=job.id, **{kind.FIELD: job, kind.PROBLEM: ""})


def cancelled(state: S, kind: type[Job]) -> S:
    """Request that the job of this kind stops and returns its partial result."""
    job = getattr(state, kind.FIELD)
    return state if job is None else replace(state, **{kind.FIELD: replace(job, cancelled=True)})


class News(Event):
    """News of work in progress. Messages from cancelled jobs are ignored."""

    id: int  # id of the work

    def applied(self, state: Any) -> Any:
        fields = (
            kind.FIELD
            for kind in (*Work.__subclasses__(), *Job.__subclasses__())
            if kind is not Job
        )
        known = (getattr(state, field) for field in fields)
        work = next((work for work in known if work is not None and work.id == self.id), None)
        return state if work is None else self.heard(state, work)

    @abstractmethod
    def heard(self, state: Any, work: Any) -> Any:
        """Return the state after the news of this work."""


class Progress(News):
    """A job has advanced."""

    collapses = True
    changes: Mapping[str, Any]  # changed fields of the job

    def heard(self, state: S, work: Job) -> S:
        return replace(state, **{work.FIELD: replace(work, **self.changes)})


class Done(News):
    """A job has ended with a result."""

    result: Any

    def heard(self, state: Any, work: Job) -> Any:
        return work.ended(replace(state, **{work.FIELD: None}), self.result)


class Failed(News):
    """A job has ended without a result."""

    text: str

    def heard(self, state: S, work: Job) -> S:
        return replace(state, **{work.FIELD: None, work.PROBLEM: self.text})


class Worker:
    """Runs the jobs of one kind in a thread once the kernels are ready."""

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
            self.stop()

    def stop(self) -> None:
        """Ask the job in progress to end. A process waits for its threads before it exits."""
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
        except (pg.PgraphError, Refusal) as error:
            self._send(Failed(job.id, str(error)))
        except Exception as error:  # shown on the page: the session goes on
            text = f"The {job.NAME} stopped: {type(error).__name__}: {error}"
            self._send(Failed(job.id, text))


# -- what is found about each new model without a request ------------------------------------------


@dataclass(frozen=True)
class Finding(ABC):
    """Something that takes long to find about a `model`, or the reason why it was not found.

    It is in the field FIELD of the state, where it is absent or of an earlier model until the one
    of the present model is found.
    """

    FIELD: ClassVar[str]
    model: pg.Model
    found: Any = None
    problem: str = ""

    @staticmethod
    @abstractmethod
    def wanted(state: Any) -> bool:
        """Check whether a page shows it."""

    @staticmethod
    @abstractmethod
    def find(model: pg.Model) -> Any:
        """Find it. Raises PgraphError."""

    @classmethod
    def about(cls, model: pg.Model) -> Self:
        """Return the finding about a model."""
        try:
            return cls(model, cls.find(model))
        except pg.PgraphError as error:
            return cls(model, None, str(error))
        except Exception as error:  # shown on the page: the session goes on
            return cls(model, None, f"Nothing was found: {type(error).__name__}: {error}")

    @classmethod
    def known(cls, state: Any) -> Self | None:
        """Return the finding about the present model, or None until it is found."""
        finding = getattr(state, cls.FIELD)
        return finding if finding is not None and finding.model is state.model else None


class Learned(Event):
    """A finding has been made."""

    finding: Finding

    def applied(self, state: S) -> S:
        if self.finding.model is not state.model:
            return state
        return replace(state, **{self.finding.FIELD: self.finding})


class Finder:
    """Makes the findings of one kind about the newest model in a thread, while they are wanted."""

    def __init__(self, kind: type[Finding], send: Callable[[Event], None]):
        self._kind, self._send = kind, send
        self._asked: pg.Model | None = None
        self._queue: SimpleQueue[pg.Model] = SimpleQueue()
        name = f"pgraph-{kind.FIELD}"
        threading.Thread(target=self._work, name=name, daemon=True).start()

    def render(self, old: Any, new: Any) -> None:
        if self._kind.known(new) is not None or not self._kind.wanted(new):
            self._asked = None
        elif new.model is not self._asked:
            self._asked = new.model
            self._queue.put(new.model)

    def _work(self) -> None:
        while True:
            model = self._queue.get()
            while not self._queue.empty():  # only the newest is of interest
                model = self._queue.get()
            self._send(Learned(self._kind.about(model)))
