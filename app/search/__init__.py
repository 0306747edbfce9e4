"""Searches on the page: fits to measured curves, optimal designs, and which number matters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import pgraph_core as pg
from pgraph_core.result.columns import columns_of

from .. import run
from ..core.jobs import Job
from ..core.state import Client as Client
from ..core.state import Names as Names
from ..run import Request

DRAWN = 300  # points of a drawn curve

Curves = Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]  # {name: (times, values)}


@dataclass(frozen=True)
class Free:
    """A number of the model that a search may change, with its bounds."""

    path: str
    low: float
    high: float


@dataclass(frozen=True)
class Asked:
    """Request of a search."""

    kind: str = "fit"  # or "optimise" or "matters"
    file: str = ""  # name of the file with measured curves
    data: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # its columns, with "t"
    match: Mapping[str, str] = field(default_factory=dict)  # {column: signal, or ""}
    free: tuple[Free, ...] = ()
    way: str = "peak"  # metric of `pg.sweep` that is the goal
    signal: str = ""
    limits: tuple[tuple[str, str, float | None, float | None], ...] = ()  # (way, signal, low, high)


@dataclass(frozen=True)
class Search(Job):
    """A search in progress."""

    NAME, FIELD, PROBLEM = "search", "search", "search_problem"
    asked: Asked
    request: Request
    trials: int = 0
    said: str = ""
    curves: Curves = field(default_factory=dict)  # curves of the run that was tried last

    def changes(self, *news: Any) -> Mapping[str, Any]:
        trials, said, run = news
        shown = self.curves if run is None else drawn(self.asked, run)
        return {"trials": trials, "said": said, "curves": shown}

    def ended(self, state: State, result: Found) -> State:
        return replace(state, found=result)


def drawn(asked: Asked, run: Any) -> Curves:
    """Return the curves of a run that a search looks at, thinned for drawing."""
    found = columns_of(run)
    names = {s for s in asked.match.values() if s} if asked.kind == "fit" else {asked.signal}
    step = -(-len(run.t) // DRAWN)
    return {
        name: (tuple(run.t[::step].tolist()), tuple(found[name].values[::step].tolist()))
        for name in sorted(names) if name in found
    }  # fmt: skip


@dataclass(frozen=True)
class Found:
    """The result of a search of a model."""

    asked: Asked
    model: pg.Model
    title: str
    rows: tuple[tuple[str, float, float, float], ...]  # path, before, found, its error or share
    notes: tuple[str, ...]
    curves: Curves = field(default_factory=dict)


@dataclass(frozen=True)
class State(run.State):
    searching: Asked = field(default_factory=Asked)
    search: Search | None = None
    search_problem: str = ""  # why the last one found nothing
    found: Found | None = None

    def opened(self, before: Any) -> Self:
        state = super().opened(before)
        return replace(state, searching=Asked(), search=None, search_problem="", found=None)
