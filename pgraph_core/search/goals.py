"""The objective and the constraints of a search, with their derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, shown
from ..result import Result
from ..sweeps.metrics import measured as metric
from ..sweeps.metrics import words
from .curves import slope_of_metric
from .free import Numbers

Array = np.ndarray


class Metric(NamedTuple):
    """A metric of `sweep` as a function of a run, with its derivatives."""

    text: str
    sign: float

    def __call__(self, run: Result) -> float:
        return self.sign * metric(run, self.text)

    def slopes(self, run: Result) -> dict[str, float] | None:
        """Return its derivatives by each path of a run, None if they are not known directly."""
        found = slope_of_metric(run, self.text)
        return found and {path: self.sign * slope for path, slope in found.items()}


def _numbers(function: Callable[[Result], Any], run: Result) -> Array:
    return np.ravel(np.asarray(function(run), float))


class Goals:
    """The objective and the constraints as one vector function of a run."""

    def __init__(self, numbers: Numbers, objective: Any, limits: Any):
        self.numbers = numbers
        self.objective = self._function("objective", objective)
        if not isinstance(limits, Mapping):
            text = "must map metrics to (low, high), as {'peak v.knee': (None, 3)}, got "
            raise numbers.refused("subject_to", text + shown(limits))
        self.names = [*limits]
        read = [self._limit(name, pair) for name, pair in limits.items()]
        self.functions = [function for function, _ in read]
        self.limits = np.array([pair for _, pair in read]).reshape(-1, 2)
        self.squares = False  # whether the objective is an array
        self.count = 1  # numbers of the objective

    def _limit(self, name: str, pair: Any) -> tuple[Callable[[Result], Any], tuple[float, float]]:
        """Return the function of a limit, and its ends."""
        what = f"subject_to[{name!r}]"
        try:
            *function, low, high = pair
            low, high = -math.inf if low is None else low, math.inf if high is None else high
            good = float(low) <= float(high) and (math.isfinite(low) or math.isfinite(high))
        except (TypeError, ValueError):
            function, low, high, good = [], 0.0, 0.0, False
        if not good or len(function) > 1:
            text = "needs (low, high) or (function, low, high), of which one may be None, got "
            raise self.numbers.refused(what, text + shown(pair))
        return self._function(what, *(function or [name])), (float(low), float(high))

    def _function(self, what: str, given: Any) -> Callable[[Result], Any]:
        if callable(given):
            return given
        if not isinstance(given, str):
            text = f"must be a metric such as 'peak v.knee', or a function, got {shown(given)}"
            raise self.numbers.refused(what, text)
        text = given.removeprefix("-").strip()
        sign = -1.0 if given.startswith("-") else 1.0
        try:
            words(text)
        except InputError as error:
            raise self.numbers.refused(what, error.problems[0].text) from None
        return Metric(text, sign)

    def begin(self, run: Result) -> None:
        """Check the first run, so that invalid goals are rejected."""
        for what, function in (
            ("objective", self.objective),
            *((f"subject_to[{name!r}]", f) for name, f in zip(self.names, self.functions)),
        ):
            found = self._first(what, function, run)
            if what == "objective":
                self.squares, self.count = found.ndim > 0, found.size
            if (
                not found.size
                or not np.isfinite(found).all()
                or (what != "objective" and found.size != 1)
            ):
                text = f"must return a finite number; at the start it is {shown(found.tolist())}"
                raise self.numbers.refused(what, text)

    def _first(self, what: str, function: Callable[[Result], Any], run: Result) -> Array:
        """Return the numbers of a goal. Raises InputError for an unknown column and for text."""
        try:
            given = function(run)
        except Exception as error:
            if not isinstance(function, Metric):  # a function of the user
                error.add_note(
                    f"{what} receives the run of each trial, a pg.Result, not the numbers"
                )
                raise
            if not isinstance(error, InputError):
                raise
            raise self.numbers.refused(what, error.problems[0].text) from None
        try:
            return np.asarray(given, float)
        except (TypeError, ValueError):
            text = f"must return numbers, got {shown(given)}"
            raise self.numbers.refused(what, text) from None

    def __call__(self, run: Result) -> Array:
        """(count + constraints,) the goals of a run."""
        return np.concatenate([_numbers(f, run) for f in (self.objective, *self.functions)])

    def slopes(self, run: Result) -> dict[str, Array]:
        """Return the derivatives (count + constraints,) of the goals by each path of a run.

        Those of metrics of one column are taken from its derivatives, and all others together from
        runs beside this one.
        """
        functions = [self.objective, *self.functions]
        exact = [f.slopes(run) if isinstance(f, Metric) else None for f in functions]
        rest = [f for f, known in zip(functions, exact) if known is None]
        lengths = [self.count if f is self.objective else 1 for f in rest]
        by = {}
        if rest:
            by = run.gradient(lambda run: np.concatenate([_numbers(f, run) for f in rest]))
        found = {}
        for path in run.derivatives:
            left = np.split(by[path], np.cumsum(lengths)[:-1]) if rest else []
            parts = [left.pop(0) if known is None else [known[path]] for known in exact]
            found[path] = np.concatenate(parts)
        return found

    def total(self, values: Array) -> float:
        """Return the objective as one number."""
        own = values[: self.count]
        return float(own @ own) if self.squares else float(own[0])

    def over(self, values: Array) -> Array:
        """(constraints,) how far each is beyond its limits, negative below the lower one."""
        found = values[self.count :]
        return found - np.clip(found, *self.limits.T)

    def missed(self, values: Array) -> float:
        """Return by how much constraints are missed, relative to their sizes."""
        return float((np.abs(self.over(values)) / self.sizes).max(initial=0.0))

    @property
    def sizes(self) -> Array:
        """(constraints,) the largest limit of each, at least 1."""
        finite = np.where(np.isfinite(self.limits), np.abs(self.limits), 0.0)
        return np.maximum(finite.max(axis=1, initial=0.0), 1.0)
