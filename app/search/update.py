"""Requests, progress and results of searches (pure)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import pgraph_core as pg
from pgraph_core.search.data import columns_in, measured
from pgraph_core.simulation.paths import Path, with_numbers
from pgraph_core.sweeps.metrics import WAYS

from ..core import cells
from ..core.cells import Refusal
from ..core.events import FromPage, Text, on, on_edit, on_typed
from ..core.jobs import cancelled, on_result, started
from . import Found, Free, Search, State
from .known import numbers_of, signals_of

MOST_FREE = 60


def _asked(state: State, **changes: Any) -> State:
    return replace(state, searching=replace(state.searching, **changes), search_problem="")


@dataclass(frozen=True)
class AskSearch(FromPage):
    """Choose what is searched for."""

    kind: Literal["fit", "optimise", "matters"]


@on(AskSearch)
def ask(state: State, event: AskSearch) -> State:
    return _asked(state, kind=event.kind)


@dataclass(frozen=True)
class OpenData(FromPage):
    """Open a .csv file with measured curves."""

    name: Text
    content: str


@on(OpenData)
def open_data(state: State, event: OpenData) -> State:
    try:
        data, _ = measured(columns_in(event.content))
    except pg.PgraphError as error:
        return replace(state, search_problem=f"{event.name}: {error.problems[0].text}")
    columns = {name: tuple(x.tolist()) for name, x in data.items()}
    known = signals_of(state.model)
    match = {name: name if name in known else "" for name in columns if name != "t"}
    return _asked(state, file=event.name, data=columns, match=match, kind="fit")


@dataclass(frozen=True)
class MatchColumn(FromPage):
    """Say which signal a column of the data measures."""

    serial: int
    column: Text
    text: Text


@on_typed(MatchColumn)
def match_column(state: State, event: MatchColumn) -> State:
    if event.text and event.text not in signals_of(state.model):
        raise Refusal(f"The model has no signal {event.text!r}.")
    if event.column not in state.searching.match:
        return state
    return _asked(state, match={**state.searching.match, event.column: event.text})


@dataclass(frozen=True)
class FreeNumber(FromPage):
    """Let a search change a number, or no longer."""

    path: Text
    on: bool


@on(FreeNumber)
def free_number(state: State, event: FreeNumber) -> State:
    others = tuple(one for one in state.searching.free if one.path != event.path)
    if event.on:
        present = numbers_of(state.model).get(event.path)
        if present is None or len(others) >= MOST_FREE:
            return state
        low, high = _bounds(event.path, present)
        if not low < high or math.isinf(high - low):
            return state
        others = (*others, Free(event.path, low, high))
    return _asked(state, free=others)


def _bounds(path: str, present: float) -> tuple[float, float]:
    """Return a tenth and ten times of a number, or one to each side of an initial coordinate."""
    if path.startswith("q."):
        return present - 1.0, present + 1.0
    return min(present / 10.0, 10.0 * present), max(present / 10.0, 10.0 * present)


@dataclass(frozen=True)
class BoundNumber(FromPage):
    """Change a bound of a free number."""

    serial: int
    path: Text
    end: Literal["low", "high"]
    text: Text


@on_typed(BoundNumber)
def bound_number(state: State, event: BoundNumber) -> State:
    value = cells.named_number("The bound", event.text)
    free = [
        replace(one, **{event.end: value}) if one.path == event.path else one
        for one in state.searching.free
    ]
    if any(one.low >= one.high for one in free):
        raise Refusal("The lower bound must be less than the upper one.")
    return _asked(state, free=tuple(free))


@dataclass(frozen=True)
class SetGoal(FromPage):
    """Change the goal."""

    serial: int
    field: Literal["way", "signal"]
    text: Text


@on_typed(SetGoal)
def set_goal(state: State, event: SetGoal) -> State:
    known = WAYS if event.field == "way" else signals_of(state.model)
    if event.text not in known:
        raise Refusal(f"{event.text!r} is not among the choices.")
    return _asked(state, **{event.field: event.text})


@dataclass(frozen=True)
class SetLimit(FromPage):
    """Change a limit, or add one in the row after the last. An empty signal removes it."""

    serial: int
    row: int
    field: Literal["way", "signal", "low", "high"]
    text: Text


@on_typed(SetLimit)
def set_limit(state: State, event: SetLimit) -> State:
    limits = [list(one) for one in state.searching.limits]
    if event.row == len(limits):
        limits.append(["peak", "", None, None])
    if not 0 <= event.row < len(limits):
        return state
    place = ("way", "signal", "low", "high").index(event.field)
    value: Any = event.text
    if event.field in ("low", "high"):
        value = cells.named_number("The limit", event.text) if event.text.strip() else None
    limits[event.row][place] = value
    kept: Any = tuple(tuple(one) for one in limits if one[1])
    return _asked(state, limits=kept)


@dataclass(frozen=True)
class StartSearch(FromPage):
    """Start the search in the background."""


@on(StartSearch)
def start(state: State, event: StartSearch) -> State:
    if state.search is not None:
        return state
    known = numbers_of(state.model)
    free = tuple(one for one in state.searching.free if one.path in known)
    asked, problem = replace(state.searching, free=free), ""
    if not asked.free:
        problem = "Nothing is free: tick the numbers that may change."
    elif asked.kind == "fit" and not any(asked.match.values()):
        problem = "Choose a file with measured curves, and what its columns measure."
    elif asked.kind != "fit" and not asked.signal:
        problem = "Choose the curve."
    if problem:
        return replace(state, search_problem=problem)
    return started(state, Search, asked, state.request)


@dataclass(frozen=True)
class CancelSearch(FromPage):
    """Stop the search and keep its best numbers."""


@on(CancelSearch)
def cancel(state: State, event: CancelSearch) -> State:
    return cancelled(state, Search)


@on_result(Search)
def found(state: State, job: Search, result: Found) -> State:
    return replace(state, found=result)


@dataclass(frozen=True)
class UseFound(FromPage):
    """Put the numbers that were found into the model, as one undo step."""


@on_edit(UseFound)
def use(state: State, event: UseFound) -> tuple[pg.Model, str]:
    found = state.found
    if found is None or found.asked.kind == "matters":
        raise Refusal("nothing was found yet")
    return changed(state.model, [(path, x) for path, _, x, _ in found.rows]), "numbers of a search"


def changed(model: pg.Model, numbers: list[tuple[str, float]]) -> pg.Model:
    """Return a model with other numbers at these paths."""
    paths = [Path(model, full(path)) for path, _ in numbers]
    return with_numbers(model, paths, [x for _, x in numbers if math.isfinite(x)])


def full(path: str) -> Any:
    """Return a path as the model takes it: "q.arm" is a number of the body."""
    group, _, body = path.partition(".")
    return ("bodies", body, group) if group in ("q", "v") else path
