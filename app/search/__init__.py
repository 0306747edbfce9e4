"""Searches on the page: fits to measured curves, optimal designs, and which number matters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field

import pgraph_core as pg
from pgraph_core.errors import percent
from pgraph_core.result.columns import columns_of
from pgraph_core.result.functions import WAYS
from pgraph_core.search.measured import columns_in, factor_of, measured
from pgraph_core.simulation.paths import Path, with_numbers

from .. import model as model_
from ..core import cells
from ..core.cells import Refusal
from ..core.events import FromPage, ModelEdit, Text, TypedText
from ..core.jobs import Finding, Job, Report, cancelled, started
from ..core.state import Client as Client
from ..core.state import Names as Names
from ..run import Request

DRAWN = 300  # points of a drawn curve

# {name: (times, values, factor of the data to the unit of the values)}
Curves = Mapping[str, tuple[tuple[float, ...], tuple[float, ...], float]]


@dataclass(frozen=True)
class Free:
    """A free parameter of the model with its bounds."""

    path: str
    low: float
    high: float


@dataclass(frozen=True)
class Asked:
    """Request of a search."""

    kind: str = "fit"  # or "optimise" or "matters"
    file: str = ""  # name of the file with measured curves
    data: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # its columns, with "t"
    match: Mapping[str, str | None] = field(default_factory=dict)  # column: signal, "", or its own
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

    def work(self, progress: Report) -> Found:
        choices = choices_of(self.model)
        asked, trials = settled(self.asked, choices), count(1)
        if problem := missing(asked) or unknown(asked, choices.signals):
            raise Refusal(problem)
        return SEARCHES[asked.kind](
            replace(self, asked=asked), {path: one.value for path, one in choices.numbers.items()},
            lambda said, run: progress(next(trials), said, run),
        )  # fmt: skip

    def ended(self, state: State, result: Found) -> State:
        return replace(state, found=result)


def drawn(asked: Asked, run: Any) -> Curves:
    """Return the curves of a run that are used by a search, reduced for drawing."""
    found = columns_of(run)
    given = {signal: unit_in(column) for column, signal in matches(asked, found).items() if signal}
    names = given if asked.kind == "fit" else {asked.signal: ""}
    step = -(-len(run.t) // DRAWN)
    return {
        name: (
            tuple(run.t[::step].tolist()),
            tuple(found[name].values[::step].tolist()),
            factor_of(names[name] or found[name].unit, found[name].unit) or 1.0,
        )
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
class State(model_.State):
    searching: Asked = field(default_factory=Asked)
    search: Search | None = None
    search_problem: str = ""  # why the last one found nothing
    found: Found | None = None
    choices: Choices | None = None

    def opened(self, before: Any) -> Self:
        state = super().opened(before)
        return replace(
            state, searching=Asked(), search=None, search_problem="", found=None, choices=None
        )


# -- the numbers of a model that a search may change, and the curves that its runs have ------------


PLACES = [(field, axis) for field in ("com", "link") for axis in range(3)]
UNKNOWN = {"damping", "stiffness", "friction"}  # are asked for where they are zero
Words = str | tuple[str | int, ...]
OF_BODY: list[tuple[str | int, ...]] = [("mass",), ("damping",), ("stiffness",), *PLACES]


class Number(NamedTuple):
    """A number of a model, and its SI unit."""

    value: float
    unit: str


class Offer(NamedTuple):
    """All numbers of a model by path, and the names of the columns of its runs."""

    numbers: Mapping[str, Number]
    signals: tuple[str, ...]


class Choices(Finding):
    """The numbers that a search of a model can change and the signals it can read, an `Offer`."""

    FIELD = "choices"

    @staticmethod
    def wanted(state: State) -> bool:
        """Check whether a page shows the tab, once the kernels are compiled."""
        return state.ready and any("search" in page.sees for page in state.clients.values())

    @staticmethod
    def find(model: pg.Model) -> Offer:
        return choices_of(model)


def choices_of(model: pg.Model) -> Offer:
    """Return the numbers and signals of a model."""
    return Offer(numbers_of(model), signals_of(model))


def numbers_of(model: pg.Model) -> dict[str, Number]:
    """Return numbers by path: parameters, bodies' and forces' fields, and initial coordinates."""
    found = dict[str, Number]()
    for text, words in _paths(model).items():
        if (path := _with_effect(model, text, words)) is not None:
            found[text] = Number(path.present, path.unit(model))
    return found


def _with_effect(model: pg.Model, text: str, words: Words) -> Path | None:
    """Return the path to a number, or None if there is none or it is zero, without effect.

    Of a damping, stiffness or friction of zero, a search asks how large it is.
    """
    try:
        path = Path(model, words)
        value = path.present
    except pg.PgraphError:
        return None
    unknown = text.startswith("q.") or not UNKNOWN.isdisjoint(text.split("."))
    return path if value == value and (value or unknown) else None


def _paths(model: pg.Model) -> dict[str, Words]:
    paths: dict[str, Words] = {name: name for name in model.parameters}
    for body in model.bodies:
        paths[f"q.{body.name}"] = ("bodies", body.name, "q")
        for name, *entry in OF_BODY:
            words = ("bodies", body.name, name, *entry)
            paths[".".join(map(str, words))] = words
    for kind in ("forces", "beams"):
        for part in getattr(model, kind):
            for name, facts in type(part).model_fields.items():
                if "float" in str(facts.annotation):
                    paths[f"{kind}.{part.name}.{name}"] = (kind, part.name, name)
    return paths


def signals_of(model: pg.Model) -> tuple[str, ...]:
    """Return the names of the columns of the model's runs."""
    if not model.rows:
        return ()
    try:
        run = pg.simulate(model, t_end=1e-6, frames=2, estimate=False)
    except pg.PgraphError:
        return ()
    return tuple(name for name, column in columns_of(run).items() if name != "t" and column.unit)


# -- requests, progress and results of searches (pure) ---------------------------------------------


MOST_FREE = 60


def _asked(state: State, **changes: Any) -> State:
    return replace(state, searching=replace(state.searching, **changes), search_problem="")


class AskSearch(FromPage):
    """Select the kind of search."""

    kind: Literal["fit", "optimise", "matters"]

    def applied(self, state: State) -> State:
        return _asked(state, kind=self.kind)


class OpenData(FromPage):
    """Open a .csv file with measured curves. Long ones are read in an errand."""

    name: Text
    content: Annotated[str, Field(max_length=20_000_000)]

    def applied(self, state: State) -> Any:
        name, work = self.name, partial(_curves_in, self.content)
        if len(self.content) <= model_.LONG:
            try:
                return _with_data(state, name, work(None).value)
            except pg.PgraphError as error:
                return replace(state, search_problem=f"{name}: {error.problems[0].text}")

        def then(now: State, done: model_.ErrandDone) -> State:
            if done.problem:
                return replace(now, search_problem=f"{name}: {done.problem}")
            return _with_data(now, name, done.found.value)

        return model_.sent(state, self.client, f"open {name}", work, apart=True, then=then)


def _curves_in(content: str, _: Any) -> model_.Found:
    """Parse columns of numbers, by name with unit as in "angle [deg]". Raises PgraphError."""
    data, units = measured(columns_in(content))
    titles = {name: f"{name} [{units[name]}]" if units.get(name) else name for name in data}
    return model_.Found(value={titles[name]: tuple(x.tolist()) for name, x in data.items()})


def unit_in(column: str) -> str:
    """Return the unit in the name of a column such as "angle [deg]", or ""."""
    return column.partition(" [")[2].removesuffix("]")


def _with_data(state: State, file: str, columns: Mapping[str, tuple[float, ...]]) -> State:
    match = {name: None for name in columns if name != "t"}
    return _asked(state, file=file, data=columns, match=match, kind="fit")


class MatchColumn(TypedText):
    """Assign a signal to a column of the data."""

    column: Text
    text: Text

    def taken(self, state: State) -> State:
        if self.column not in state.searching.match:
            return state
        return _asked(state, match={**state.searching.match, self.column: self.text})


class FreeNumber(FromPage):
    """Select or deselect a parameter of the search."""

    path: Text
    on: bool

    def applied(self, state: State) -> State:
        others = tuple(one for one in state.searching.free if one.path != self.path)
        if self.on:
            words = _paths(state.model).get(self.path)
            path = _with_effect(state.model, self.path, words) if words else None
            if path is None or len(others) >= MOST_FREE:
                return state
            low, high = _bounds(self.path, path.present)
            if not low < high or math.isinf(high - low):
                return state
            others = (*others, Free(self.path, low, high))
        return _asked(state, free=others)


def _bounds(path: str, present: float) -> tuple[float, float]:
    """Return a tenth and ten times of a number, or one to each side of an initial coordinate.

    A number that is zero may become one.
    """
    if path.startswith("q."):
        return present - 1.0, present + 1.0
    if present == 0.0:
        return 0.0, 1.0
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
        if self.field == "way" and self.text not in WAYS:
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
        if problem := missing(state.searching):
            return replace(state, search_problem=problem)
        return started(state, Search, state.searching, state.request)


def matches(asked: Asked, signals: Iterable[str]) -> dict[str, str]:
    """Return the signal of each column, by default that of the same name, or ""."""
    known = set(signals)
    return {
        column: signal if signal is not None else name if name in known else ""
        for column, signal in asked.match.items()
        for name in [column.partition(" [")[0]]
    }


def settled(asked: Asked, choices: Offer) -> Asked:
    """Return a request with the signal of each column, and without numbers that do not exist."""
    free = tuple(one for one in asked.free if one.path in choices.numbers)
    return replace(asked, free=free, match=matches(asked, choices.signals))


def missing(asked: Asked) -> str:
    """Return what a search needs before it can start, or ""."""
    if asked.kind == "fit" and all(signal == "" for signal in asked.match.values()):
        return "Choose a file with measured curves and assign its columns."
    if asked.kind != "fit" and not asked.signal:
        return "Choose the curve."
    return "" if asked.free else "Nothing is free: tick the numbers that may change."


def unknown(asked: Asked, signals: Iterable[str]) -> str:
    """Return a sentence about the first signal that the runs do not have, or ""."""
    limits = [signal for _, signal, *_ in asked.limits] if asked.kind == "optimise" else []
    wanted = asked.match.values() if asked.kind == "fit" else [asked.signal, *limits]
    found = next((name for name in wanted if name and name not in set(signals)), "")
    return f"The runs of this model have no curve {found!r}: choose another one." if found else ""


class CancelSearch(FromPage):
    """Stop the search and keep its best numbers."""

    def applied(self, state: State) -> State:
        return cancelled(state, Search)


class UseFound(ModelEdit):
    """Apply the result to the model as one undo step."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        found = state.found
        if found is None or found.asked.kind == "matters":
            raise Refusal("nothing was found yet")
        return changed(
            state.model, [(path, x) for path, _, x, _ in found.rows]
        ), "numbers of a search"


def changed(model: pg.Model, numbers: list[tuple[str, float]]) -> pg.Model:
    """Return a model with new values at these paths."""
    paths = [Path(model, full(path)) for path, _ in numbers]
    return with_numbers(model, paths, [x for _, x in numbers if math.isfinite(x)])


def full(path: str) -> Any:
    """Return a path as the model takes it: "q.arm" is a number of the body."""
    group, _, body = path.partition(".")
    return ("bodies", body, group) if group in ("q", "v") else path


# -- the work of searches --------------------------------------------------------------------------


Present = Mapping[str, float]  # the model's numbers by path
Progress = Callable[[str, Any], bool]  # takes what a trial reached, and its run


def bounds(now: Search) -> dict[str, tuple[float, float]]:
    return {one.path: (one.low, one.high) for one in now.asked.free}


def fit(now: Search, present: Present, progress: Progress) -> Found:
    """Fit the free numbers to the data."""
    asked = now.asked
    data = {
        f"{signal} [{unit}]" if (unit := unit_in(column)) else signal: np.asarray(
            asked.data[column]
        )
        for column, signal in (("t", "t"), *asked.match.items())
        if signal
    }
    found = pg.fit(
        now.model, data, bounds(now),
        progress=lambda values, run: progress("", run),
        **now.request.options(now.model),
    )  # fmt: skip
    rows = [(path, present[path], x, found.errors[path]) for path, x in found.values.items()]
    missed = {name: float(np.mean(np.square(x))) for name, x in found.residuals.items()}
    spread = {name: float(np.var(found.data[name])) for name in missed}
    noise = [
        f"{name}: residuals of {math.sqrt(x):.2g} {found.units[name]}, "
        f"data that vary by {math.sqrt(spread[name]):.2g} {found.units[name]}"
        for name, x in missed.items()
    ]
    share = min((1.0 - x / spread[name] for name, x in missed.items() if spread[name]), default=1.0)
    title = f"Fit, explains {percent(share)} of the data, {found.message}"
    if share < 1.0 - share:
        title = "Bad fit: the residuals are larger than what the run explains; check units, bounds"
    notes = (*found.undetermined, *noise)
    return Found(asked, now.model, title, tuple(rows), notes, drawn(asked, found.run))


def optimise(now: Search, present: Present, progress: Progress) -> Found:
    """Make the goal least within the limits."""
    asked = now.asked
    limits = {f"{way} {signal}": (low, high) for way, signal, low, high in asked.limits}
    goal = f"{asked.way} {asked.signal}"
    free = {full(path): pair for path, pair in bounds(now).items()}
    found = pg.optimise(
        now.model, goal, free, subject_to=limits,
        progress=lambda trial, run: progress(f"{goal} = {trial.objective:.4g}", run),
        t_end=now.request.t_end, **now.request.options(now.model),
    )  # fmt: skip
    rows = [
        (one.path, present[one.path], x, np.nan)
        for one, x in zip(asked.free, found.values.values(), strict=True)
    ]
    title = f"Least {goal}: {found.objective:.4g}, {found.message}"
    return Found(asked, now.model, title, tuple(rows), found.active, drawn(asked, found.run))


def matters(now: Search, present: Present, progress: Progress) -> Found:
    """Find how far each number moves a curve, per relative change of the number."""
    asked = now.asked
    paths = [full(one.path) for one in asked.free]
    request = now.request
    run = pg.simulate(
        now.model, wrt=paths, t_end=request.t_end, estimate=False, **request.options(now.model)
    )
    progress("", run)
    by = run.gradient(lambda run: columns_of(run)[asked.signal].values)
    rows = []
    for one, slope in zip(asked.free, by.values(), strict=True):
        size = abs(present[one.path]) or 1.0
        moved = size * float(np.sqrt(np.nanmean(np.square(slope))))
        rows.append((one.path, present[one.path], present[one.path], moved))
    rows.sort(key=lambda row: -row[3])
    text = "Root mean square change of the curve when the number doubles."
    title = f"What moves {asked.signal}"
    return Found(asked, now.model, title, tuple(rows), (text,), drawn(asked, run))


SEARCHES: dict[str, Callable[[Search, Present, Progress], Found]] = {
    "fit": fit, "optimise": optimise, "matters": matters,
}  # fmt: skip
