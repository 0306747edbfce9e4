"""What the caller of work_precision asked for, checked, in sentences where it does not fit."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any

import numpy as np

from ..errors import InputError, Problem, choices
from ..integrators import METHODS, method_of
from ..mechanism import Mechanism
from ..peers import PEERS
from .sides import usual
from .task import Task
from .work import CLOCKS


def names(methods: Any, task: Task) -> tuple[str, ...]:
    """The methods asked for, or those that suit. Raises InputError with the choices."""
    if methods is None:
        return usual(task)
    names = (methods,) if isinstance(methods, str) else tuple(methods)
    if not names:
        text = f"name one method or more; choose from {choices(METHODS)}"
        raise InputError(Problem("work_precision", "methods", text))
    for name in names:
        if name == "auto" or name not in METHODS:
            text = f"no method is called {name!r}; choose from {choices(METHODS)}"
            raise InputError(Problem("work_precision", "methods", text))
        method_of(name, impulses=task.impulses)
    return tuple(dict.fromkeys(names))


def peers(given: Any) -> tuple[str, ...]:
    """The other engines asked for. Raises InputError with the choices."""
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if name not in PEERS:
            text = f"no peer is called {name!r}; choose from {choices(PEERS)}"
            raise InputError(Problem("work_precision", "peers", text))
    return names


def clock(given: Any) -> str:
    """The clock asked for. Raises InputError with the choices."""
    if given not in CLOCKS:
        text = f"must be one of {choices(CLOCKS)}; given {given!r}"
        raise InputError(Problem("work_precision", "clock", text))
    return given


def duration(mech: Mechanism, t_end: Any, scenario: str | None) -> float:
    given = None if scenario is None else mech.model.scenario(scenario)
    value = t_end if t_end is not None else given.t_end if given else 1.0
    return _positive("t_end", value, "a finite number > 0 [s]")


def check(rounds: Any, frames: Any, target: Any, longest: Any) -> None:
    for field, value, least in (("rounds", rounds, 1), ("frames", frames, 3)):
        if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
            text = f"must be a whole number >= {least}; given {value!r}"
            raise InputError(Problem("work_precision", field, text))
    if target is not None:
        _positive("target", target, "a finite number > 0, an error without unit such as 1e-6")
    _positive("longest", longest, "a finite number > 0 [s]")


def _positive(field: str, value: Any, wanted: str) -> float:
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    if not 0 < number < np.inf:
        raise InputError(Problem("work_precision", field, f"must be {wanted}; given {value!r}"))
    return number
