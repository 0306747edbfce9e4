"""The model itself: new, open, save, undo, redo, and derived data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import pgraph_core as pg

from .. import run
from ..core import state


@dataclass(frozen=True)
class Found:
    """The result of an errand: changes to bodies, or a whole model, and a message."""

    text: str = ""
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # body -> fields
    opened: pg.Model | None = None
    report: pg.Report | None = None  # report on a file of another format
    members: tuple[str, ...] = ()  # models of an archive, one of which is to be chosen
    value: Any = None  # for `Errand.then`


@dataclass(frozen=True)
class Members:
    """The models in an archive, from which a page chooses one."""

    file: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Errand:
    """Background work with a result that may change bodies of `model`.

    It runs in a thread, or `apart` in a child process, to which `work` is sent without a model.
    """

    id: int
    client: int
    model: pg.Model
    label: str
    work: Callable[[pg.Model], Found]  # raises PgraphError, Refusal, OSError
    compiled: bool = False  # waits until the kernels are compiled
    file: str = ""  # name of the model file that is read
    apart: bool = False
    leaves: Path | None = None  # a folder that `work` makes
    then: Callable[[Any, Any], Any] | None = None  # (state, ErrandDone) -> state, for its result


@dataclass(frozen=True)
class Kept:
    """The model of a session that no longer runs, read from its file."""

    path: Path
    given: str  # the model that the session was started with
    time: float  # time of the last edit [s since 1970]
    text: str  # JSON
    ended: bool  # the server was stopped, not killed
    name: str  # name of the model


@dataclass(frozen=True)
class Client(state.Client):
    conversion: pg.Report | None = None  # report on the last file of another format that it opened
    members: Members | None = None  # models of the last archive, of which it is to choose one

    def again(self, fresh: Any) -> Self:
        again = super().again(fresh)
        return replace(again, conversion=fresh.conversion, members=fresh.members)


@dataclass(frozen=True)
class State(run.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    gallery: Mapping[str, str] = field(default_factory=dict)  # built-in name -> JSON text
    kept: Mapping[str, Kept] = field(default_factory=dict)  # by what it is called in a list
    saved: tuple[int, pg.Model] | None = None  # document and model that were written last by Save
    errands: tuple[Errand, ...] = ()  # under way, in order
    errand_count: int = 0  # number of errands sent, the id of the last one
