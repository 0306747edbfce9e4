"""The free parameters of a search: their values, bounds and starts, and runs with other values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .. import words
from ..errors import InputError, ModelError, PgraphError, Problem, choices, shown
from ..model import Model
from ..result import Result
from ..simulation import simulate
from ..simulation.paths import Path, distinct, started, with_numbers
from ..simulation.variables import Wanted
from ..tolerances import EPS

Array = np.ndarray
COST_OF_FAILURE = 1e3  # cost of a failed run, in units of the goal or of the noise
INSIDE = np.cbrt(EPS)  # share of its range by which a number is moved off a bound
NUMBERS_TOLD = 6  # numbers in a sentence
OURS = ("wrt", "events", "progress")  # arguments of `simulate` that a search gives itself


class Values(dict[str, float]):
    """The values of the free parameters by path."""

    def __missing__(self, path: Any) -> float:
        text = f"no free parameter is {path!r}; choose from {choices(self)}, or use x, an array"
        raise KeyError(text)


@dataclass(frozen=True)
class Case:
    """One run of a search: its name, its arguments of `simulate`, and its free initial state."""

    name: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Own:
    """A free parameter of the initial state of one case, such as "q.arm@slow"."""

    case: str
    kind: str  # "q" or "v"
    body: str
    entry: str  # entry of a joint with several coordinates, otherwise ""

    @property
    def given(self) -> str:
        """The path in the form of `wrt`."""
        return ".".join(filter(None, (self.kind, self.body, self.entry)))

    text = given

    def place(self, options: Mapping[str, Any]) -> tuple[list[float], int]:
        """Return the values of the joint in the arguments of the case, and the place of this."""
        state = options.get(self.kind)
        if not isinstance(state, Mapping) or self.body not in state:
            text = f"case {self.case!r} gives no {self.kind}={{{self.body!r}: ...}} to start from"
            raise InputError(Problem("fit", f"{self.given}@{self.case}", text))
        values = np.atleast_1d(np.array(state[self.body], float)).tolist()
        return values, int(self.entry or 0)


class Numbers:
    """The free numbers of a search.

    Values that a search proposes are divided by `size`, the range of each number.
    """

    def __init__(
        self, call: str, model: Model, free: Any, cases: Sequence[Case], bounded: bool = True
    ):
        """`bounded`: whether every number needs two bounds. Raises InputError."""
        self.call, self.model, self.cases = call, model, list(cases)
        self.failed, self.evaluations = "", 0
        for case in self.cases:
            for name in {*OURS} & {*case.options}:
                raise self.refused(name, "is given by the search itself")
        if not isinstance(free, Mapping) or not free:
            text = "must map paths to (low, high), as {'bodies.arm.mass': (0.1, 2)}, got "
            raise self.refused("free", text + shown(free))
        self.places: list[Path | Own] = []
        self.names: list[str] = []
        pairs = []
        for given, pair in free.items():
            found = self._places(given)
            self.places += found
            alone = len(found) == 1 and isinstance(given, str)
            self.names += [given] if alone else [place.text for place in found]
            pairs += [pair] * len(found)
        distinct([place for place in self.places if isinstance(place, Path)], call)
        self.present = np.array([self._present(place) for place in self.places])
        self.bounds = np.array([self._pair(k, pair, bounded) for k, pair in enumerate(pairs)])
        self._wanted = {
            case.name: Wanted(place.given for _, place in self.of(case)) for case in self.cases
        }
        ranges = np.ptp(self.bounds, axis=1)
        ranges[~np.isfinite(ranges)] = 0.0
        self.size = np.where(ranges > 0.0, ranges, np.where(self.present, abs(self.present), 1.0))

    def named(self) -> Iterator[tuple[str, Path | Own]]:
        """Iterate over names and places."""
        return zip(self.names, self.places)

    def __len__(self) -> int:
        return len(self.places)

    # -- places and bounds -------------------------------------------------------------------------

    def _places(self, given: Any) -> Sequence[Path | Own]:
        if not isinstance(given, str) or given in self.model.parameters:
            return Path.each(self.model, given, self.call)
        word, at, case = given.rpartition("@")
        if at and case in [one.name for one in self.cases]:
            kind, _, body = word.partition(".")
            head, _, entry = body.rpartition(".")
            several = head in self.model and entry.isdecimal()
            own = Own(case, kind, *((head, entry) if several else (body, "")))
            if kind not in ("q", "v") or own.body not in self.model:
                raise self.refused(given, "must be q.BODY@CASE or v.BODY@CASE")
            return [own]
        scenario = self.cases[0].options.get("scenario")
        return Path.each(self.model, started(self.model, given, scenario), self.call)

    def _present(self, place: Path | Own) -> float:
        if isinstance(place, Path):
            return place.present
        values, entry = place.place(self._options(place.case))
        return values[entry]

    def _options(self, case: str) -> Mapping[str, Any]:
        return next(one.options for one in self.cases if one.name == case)

    def _pair(self, k: int, pair: Any, bounded: bool) -> tuple[float, float]:
        name, place, present = self.names[k], self.places[k], self.present[k]
        try:
            low, high = (None, None) if pair is None else pair
            if not bounded:
                low, high = -math.inf if low is None else low, math.inf if high is None else high
            low, high = float(low), float(high)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise self.refused(name, f"needs (low, high), got {shown(pair)}") from None
        if not low < high or (bounded and not (math.isfinite(low) and math.isfinite(high))):
            text = f"needs {'finite ' if bounded else ''}numbers low < high, got {shown(pair)}"
            raise self.refused(name, text)
        if not low <= present <= high:
            text = f"is {present:g} in the model, outside of its bounds {low:g} to {high:g}"
            raise self.refused(name, f"{text}: change the model, or the bounds")
        for end in (low, high):
            if not isinstance(place, Path) or not math.isfinite(end):
                continue
            try:
                place.set(self.model, end)
            except ModelError as error:
                text = f"the bound {end:g} makes the model invalid: {error.problems[0]}"
                raise self.refused(name, text) from None
        return low, high

    # -- runs --------------------------------------------------------------------------------------

    def at(self, x: Array) -> Model:
        """Return the model with new parameter values. Raises ModelError if it is not valid."""
        inside = [(p, value) for p, value in zip(self.places, x.tolist()) if isinstance(p, Path)]
        return with_numbers(self.model, [p for p, _ in inside], [value for _, value in inside])

    def _call(self, case: Case, x: Array) -> dict[str, Any]:
        """Return the arguments of `simulate` of a case."""
        options: dict[str, Any] = {"estimate": False, **case.options}
        for place, value in zip(self.places, x.tolist()):
            if isinstance(place, Own) and place.case == case.name:
                values, entry = place.place(options)
                values[entry] = value
                options[place.kind] = {**options[place.kind], place.body: values}
        return options

    def runs(
        self, x: Array, derivatives: bool, more: Sequence[Mapping[str, Any]] = ()
    ) -> list[Result] | None:
        """Run all cases on all cores. Return None if the model or a run fails, see `failed`.

        `more` has further arguments of `simulate` for each case.
        """
        self.evaluations += len(self.cases)

        def one(case: Case) -> Result:
            wrt = self._wanted[case.name] if derivatives else ()
            own = dict(more[self.cases.index(case)]) if more else {}
            return simulate(model, wrt=wrt, **self._call(case, x) | own)

        try:
            model = self.at(x)
            found = self._over_cases(one)
        except InputError as error:
            raise self._of_this_call(error) from None
        except ModelError as error:  # the differences of what is packed leave what is valid, too
            self.failed = f"at {self._said(x)}: {error.problems[0]}"
            return None
        for run in found:
            why = "" if run.status.ok else run.message
            if not all(np.isfinite(d).all() for d in run.derivatives.values()):
                ends = [t for t in run.notices if "derivatives end" in t or "not finite" in t]
                why = why or "; ".join(ends) or "its derivatives are not finite"
            if why:
                self.failed = f"at {self._said(x)}: {why}"
                return None
        return found

    def _of_this_call(self, error: InputError) -> InputError:
        """Name this call and its arguments in an error of `simulate`."""
        names = {"simulate": self.call, "wrt": ""}
        return InputError(
            replace(
                one, where=names.get(one.where, one.where), field=names.get(one.field, one.field)
            )
            for one in error.problems
        )

    def _over_cases(self, one: Callable[[Case], Result]) -> list[Result]:
        if len(self.cases) == 1:
            return [one(self.cases[0])]
        with ThreadPoolExecutor() as pool:
            return [*pool.map(one, self.cases)]

    def _said(self, x: Array) -> str:
        """A text of the first numbers and their values."""
        said = [f"{name} = {value:.6g}" for name, value in zip(self.names[:NUMBERS_TOLD], x)]
        return ", ".join([*said, *["..."] * (len(self) > NUMBERS_TOLD)])

    def of(self, case: Case) -> list[tuple[int, Path | Own]]:
        """Return the parameters on which a case depends, with their indices."""
        return [
            (k, place)
            for k, place in enumerate(self.places)
            if isinstance(place, Path) or place.case == case.name
        ]

    def refused(self, what: str, text: str) -> PgraphError:
        return InputError(Problem(self.call, what, text))

    def inside(self, x: Array) -> Array:
        """Return numbers that are off their bounds by a millionth of the range."""
        return np.clip(x, *(self.bounds + INSIDE * self.size[:, None] * [1.0, -1.0]).T)

    def at_bounds(self, x: Array) -> list[str]:
        """Return the parameters that are at a bound."""
        near = np.abs(self.bounds - x[:, None]) < 1e-9 * self.size[:, None]
        return [
            f"{name} is at its bound {self.bounds[k, int(np.argmax(near[k]))]:g}"
            for k, name in enumerate(self.names)
            if near[k].any()
        ]


def option(call: str, name: str, value: Any, known: Sequence[str]) -> Any:
    """Return a word if it is known. Raises InputError."""
    if value not in known:
        text = f"must be one of {choices(known)}, got {shown(value)}{words.choice(value, known)}"
        raise InputError(Problem(call, name, text))
    return value


def starts_of(
    numbers: Numbers, starts: Any, seed: int, earlier: Mapping[str, float]
) -> list[Array]:
    """The numbers at which searches start: the `earlier` or present ones, then others."""
    first = np.array([earlier.get(name, x) for name, x in zip(numbers.names, numbers.present)])
    if isinstance(starts, int) and starts >= 1:
        if starts > 1 and not np.isfinite(numbers.bounds).all():
            unbounded = [
                x for x, y in zip(numbers.names, numbers.bounds) if not np.isfinite(y).all()
            ]
            text = f"several need two finite bounds of each number, got {starts} starts"
            raise numbers.refused("starts", f"{text}, and {choices(unbounded)} has none")
        rng = np.random.default_rng(seed)
        low, high = numbers.bounds.T
        more = [low + (high - low) * rng.random(len(low)) for _ in range(starts - 1)]
        return [np.clip(first, low, high), *more]
    if not isinstance(starts, Sequence) or isinstance(starts, str) or not starts:
        text = f"must be a number of starts, or a list of values by path, got {shown(starts)}"
        raise numbers.refused("starts", text)
    found = []
    for one in starts:
        unknown = [name for name in one if name not in numbers.names]
        x = np.array([one.get(name, x) for name, x in zip(numbers.names, first)], float)
        if unknown or not ((x >= numbers.bounds[:, 0]) & (x <= numbers.bounds[:, 1])).all():
            text = f"each must hold values of free numbers ({choices(numbers.names)})"
            text += f" within their bounds, got {shown(one)}"
            raise numbers.refused("starts", text)
        found.append(x)
    return found
