"""Requests, progress and results of searches (pure)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import pgraph_core as pg
from pgraph_core.search.data import columns_in, measured
from pgraph_core.simulation.paths import Path, with_numbers
from pgraph_core.sweeps.metrics import WAYS

from ..core import cells
from ..core.cells import Refusal
from ..core.events import FromPage, ModelEdit, Text, TypedText
from ..core.jobs import cancelled, started
from . import Free, Search, State
from .known import numbers_of, signals_of

MOST_FREE = 60


def _asked(state: State, **changes: Any) -> State:
    return replace(state, searching=replace(state.searching, **changes), search_problem="")


class AskSearch(FromPage):
    """Choose what is searched for."""

    kind: Literal["fit", "optimise", "matters"]

    def applied(self, state: State) -> State:
        return _asked(state, kind=self.kind)


class OpenData(FromPage):
    """Open a .csv file with measured curves."""

    name: Text
    content: str

    def applied(self, state: State) -> State:
        try:
            data, _ = measured(columns_in(self.content))
        except pg.PgraphError as error:
            return replace(state, search_problem=f"{self.name}: {error.problems[0].text}")
        columns = {name: tuple(x.tolist()) for name, x in data.items()}
        known = signals_of(state.model)
        match = {name: name if name in known else "" for name in columns if name != "t"}
        return _asked(state, file=self.name, data=columns, match=match, kind="fit")


class MatchColumn(TypedText):
    """Say which signal a column of the data measures."""

    column: Text
    text: Text

    def taken(self, state: State) -> State:
        if self.text and self.text not in signals_of(state.model):
            raise Refusal(f"The model has no signal {self.text!r}.")
        if self.column not in state.searching.match:
            return state
        return _asked(state, match={**state.searching.match, self.column: self.text})


class FreeNumber(FromPage):
    """Let a search change a number, or no longer."""

    path: Text
    on: bool

    def applied(self, state: State) -> State:
        others = tuple(one for one in state.searching.free if one.path != self.path)
        if self.on:
            present = numbers_of(state.model).get(self.path)
            if present is None or len(others) >= MOST_FREE:
                return state
            low, high = _bounds(self.path, present)
            if not low < high or math.isinf(high - low):
                return state
            others = (*others, Free(self.path, low, high))
        return _asked(state, free=others)


def _bounds(path: str, present: float) -> tuple[float, float]:
    """Return a tenth and ten times of a number, or one to each side of an initial coordinate."""
    if path.startswith("q."):
        return present - 1.0, present + 1.0
    return min(present / 10.0, 10.0 * present), max(present / 10.0, 10.0 * present)


class BoundNumber(TypedText):
    """Change a bound of a free number."""

    path: Text
    end: Literal["low", "high"]
    text: Text

    def taken(self, state: State) -> State:
        value = cells.named_number("The bound", self.text)
        free = [
            replace(one, **{self.end: value}) if one.path == self.path else one
            for one in state.searching.free
        ]
        if any(one.low >= one.high for one in free):
            raise Refusal("The lower bound must be less than the upper one.")
        return _asked(state, free=tuple(free))


class SetGoal(TypedText):
    """Change the goal."""

    field: Literal["way", "signal"]
    text: Text

    def taken(self, state: State) -> State:
        known = WAYS if self.field == "way" else signals_of(state.model)
        if self.text not in known:
            raise Refusal(f"{self.text!r} is not among the choices.")
        return _asked(state, **{self.field: self.text})


class SetLimit(TypedText):
    """Change a limit, or add one in the row after the last. An empty signal removes it."""

    row: int
    field: Literal["way", "signal", "low", "high"]
    text: Text

    def taken(self, state: State) -> State:
        limits = [list(one) for one in state.searching.limits]
        if self.row == len(limits):
            limits.append(["peak", "", None, None])
        if not 0 <= self.row < len(limits):
            return state
        place = ("way", "signal", "low", "high").index(self.field)
        value: Any = self.text
        if self.field in ("low", "high"):
            value = cells.named_number("The limit", self.text) if self.text.strip() else None
        limits[self.row][place] = value
        kept: Any = tuple(tuple(one) for one in limits if one[1])
        return _asked(state, limits=kept)


class StartSearch(FromPage):
    """Start the search in the background."""

    def applied(self, state: State) -> State:
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


class CancelSearch(FromPage):
    """Stop the search and keep its best numbers."""

    def applied(self, state: State) -> State:
        return cancelled(state, Search)


class UseFound(ModelEdit):
    """Put the numbers that were found into the model, as one undo step."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        found = state.found
        if found is None or found.asked.kind == "matters":
            raise Refusal("nothing was found yet")
        return changed(
            state.model, [(path, x) for path, _, x, _ in found.rows]
        ), "numbers of a search"


def changed(model: pg.Model, numbers: list[tuple[str, float]]) -> pg.Model:
    """Return a model with other numbers at these paths."""
    paths = [Path(model, full(path)) for path, _ in numbers]
    return with_numbers(model, paths, [x for _, x in numbers if math.isfinite(x)])


def full(path: str) -> Any:
    """Return a path as the model takes it: "q.arm" is a number of the body."""
    group, _, body = path.partition(".")
    return ("bodies", body, group) if group in ("q", "v") else path
