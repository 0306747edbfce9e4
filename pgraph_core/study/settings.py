"""What a study runs: methods, steps and tolerances, checked where the caller gives them."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np

from ..errors import choices, refusal
from ..integrators import METHODS, Method, method_of
from ..simulation.options import LEAST_RTOL

HALVINGS = 8
TOLERANCES = tuple(10.0**-k for k in range(2, 13))
MOST_SETTINGS = 64  # of one method


class Setting(NamedTuple):
    """A step or a tolerance of one run."""

    step: float | None = None  # [s]
    rtol: float | None = None
    max_steps: int | None = None

    def __str__(self) -> str:
        if self.step is not None:
            return f"step {self.step:.4g} s"
        return f"rtol {self.rtol:.0e}"

    @property
    def options(self) -> dict[str, Any]:
        """As `simulate` takes them."""
        return {k: v for k, v in self._asdict().items() if v is not None}


class Ladder(NamedTuple):
    """The settings of all methods, coarsest first."""

    steps: tuple[float, ...]  # [s]
    tolerances: tuple[float, ...]
    fixed: bool  # steps for adaptive methods too

    @classmethod
    def of(cls, task: Any, steps: Any, tolerances: Any, fixed: bool, rate: float) -> Ladder:
        """The given settings, or the usual ones of a `Task`: h0 2^-k and 10^-k.

        h0 is a whole fraction of a frame, short enough for the fastest `rate` [1/s] of the motion.
        A stiff scene stays stiff: h0 is at least a hundredth of a frame. Raises InputError.
        """
        parts = min(max(1.0, np.ceil(task.spacing * rate)), 100.0)
        rungs = tuple(task.spacing / float(parts) * 0.5**k for k in range(HALVINGS + 1))
        if steps is not None:
            rungs = _rungs("steps", steps, task.t_end / 1e8, task.t_end)
        usual = TOLERANCES
        if tolerances is not None:
            usual = _rungs("tolerances", tolerances, LEAST_RTOL, 0.1)
        return cls(rungs, usual, fixed)

    def settings(self, method: Method) -> tuple[Setting, ...]:
        """The settings that `method` is run at."""
        if method.adaptive and not self.fixed:
            return tuple(Setting(rtol=rtol) for rtol in self.tolerances)
        return tuple(Setting(step=step) for step in self.steps)


def _rungs(field: str, given: Any, least: float, most: float) -> tuple[float, ...]:
    """Steps or tolerances of `work_precision`, largest first."""
    values = (
        tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
    )
    if len(values) > MOST_SETTINGS:
        text = f"are {len(values)} settings of each method; give {MOST_SETTINGS} at most"
        raise refusal("work_precision", field, text)
    if not values or not all(is_number(x) and least <= float(x) <= most for x in values):
        text = f"must be one number or more, each within {least:g} and {most:g}; given {given!r}"
        raise refusal("work_precision", field, text)
    return tuple(sorted({float(x) for x in values}, reverse=True))


def usual_methods(*, impulses: bool) -> tuple[str, ...]:
    """The methods that suit a scene with or without impulses."""
    return tuple(
        name
        for name, method in METHODS.items()
        if (impulses and method.eventful) or (name == "moreau_jean") == impulses
    )


def methods_of(call: str, given: Any, *, impulses: bool, suited: bool) -> tuple[str, ...]:
    """The methods asked for, or the usual ones. Raises InputError naming the choices.

    `suited`: also refuses methods that cannot take the scene.
    """
    if given is None:
        return usual_methods(impulses=impulses)
    names = (given,) if isinstance(given, str) else tuple(given)
    if not names:
        raise refusal(call, "methods", f"give at least one of {choices(METHODS)}")
    for name in names:
        if name == "auto" or name not in METHODS:
            text = f"no method is called {name!r}; choose from {choices(METHODS)}"
            raise refusal(call, "methods", text)
        method_of(name, impulses=impulses and suited)
    return tuple(dict.fromkeys(names))


# -- checks ----------------------------------------------------------------------------------------


def is_number(value: Any) -> bool:
    """A real number, True and False excepted."""
    return isinstance(value, Real) and not isinstance(value, bool)


def positive(call: str, field: str, value: Any, wanted: str = "a finite number > 0") -> float:
    """The number. Raises InputError unless it is finite and > 0."""
    number = float(value) if is_number(value) else np.nan
    if not 0 < number < np.inf:
        raise refusal(call, field, f"must be {wanted}; given {value!r}")
    return number


def whole(call: str, field: str, value: Any, least: int) -> int:
    """The whole number. Raises InputError if it is less than `least`."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise refusal(call, field, f"must be a whole number >= {least}; given {value!r}")
    return int(value)


def finite_numbers(call: str, field: str, given: Any) -> tuple[float, ...]:
    """Finite numbers, each once, in the given order. Raises InputError if there is none."""
    try:
        found = tuple(float(x) for x in given)
    except (TypeError, ValueError):
        found = ()
    if not found or not all(map(np.isfinite, found)):
        text = f"must be finite numbers, at least one; given {given!r:.60}"
        raise refusal(call, field, text)
    return tuple(dict.fromkeys(found))
