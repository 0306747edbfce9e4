"""What a run is asked for, checked."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, Problem, choices
from ..integrators import METHODS, Method
from ..mechanism import Mechanism
from ..model import Force, Scenario
from ..model.checks import force_problems
from .run_plan import FIXED_RTOL, Tolerance

LEAST_RTOL = 1e-15  # below it errors of a step are rounding
MOST_CHOSEN = 10_000_000  # steps of a method that chooses them, where nothing else is said
STABILISE = ("project", "baumgarte", None)
ADAPTIVE = tuple(method.name for method in METHODS.values() if method.adaptive)


class Asked(NamedTuple):
    """How a run is to be stepped and recorded; None where that is left open."""

    given: Scenario | None
    span: tuple[float, float]  # start and end [s]
    method: str
    step: Any
    rtol: Any
    atol: Any
    max_steps: Any
    frames: Any
    t_eval: Any
    stabilise: str | None

    @property
    def usual(self) -> float:
        """The step where none is asked for [s]."""
        return self.given.step if self.given else 1e-3


def span_of(given: Scenario | None, t_start: Any, t_end: Any) -> tuple[float, float]:
    """When a run starts and ends [s]. Raises InputError."""
    start = start_time(t_start)
    return start, end_time(start, t_end, given.t_end if given else 1.0)


def method_name(given: Scenario | None, method: str | None, rtol: Any) -> str:
    """The method asked for, else the scenario's, else "auto"."""
    if method is not None:
        return method
    name = given.method if given else "auto"
    # a tolerance replaces the scenario's method where that takes none
    return "auto" if rtol is not None and name not in ADAPTIVE else name


def check_choices(frames: Any, t_eval: Any, stabilise: Any, rtol: Any, progress: Any) -> None:
    """Raise InputError where arguments exclude each other or are none of their choices."""
    if frames is not None and t_eval is not None:
        raise InputError(Problem("simulate", "frames", "give frames or t_eval, not both"))
    if stabilise not in STABILISE:
        text = f"must be 'project', 'baumgarte' or None; given {stabilise!r}"
        raise InputError(Problem("simulate", "stabilise", text))
    if rtol is not None:
        positive("rtol", rtol, unit="")
    if progress is not None and not callable(progress):
        text = f"must be a function of the fraction that is done; given {progress!r}"
        raise InputError(Problem("simulate", "progress", text))


def forces_of(mech: Mechanism, forces: Any) -> tuple[Force, ...]:
    """The forces of a call, which fit the model. Raises InputError."""
    known = isinstance(forces, (tuple, list)) and all(isinstance(f, Force) for f in forces)
    if not known:
        text = f"must be a list of pg.Force; given {forces!r:.60}"
        raise InputError(Problem("simulate", "forces", text))
    bodies = {b.name: b for b in mech.model.bodies} if forces else {}
    if found := [problem for f in forces for problem in force_problems((f,), bodies)]:
        raise InputError(found)
    return tuple(forces)


def start_time(value: Any) -> float:
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    if not np.isfinite(number):
        text = f"must be a finite number [s]; given {value!r}"
        raise InputError(Problem("simulate", "t_start", text))
    return number


def end_time(t_start: float, value: Any, duration: float) -> float:
    """The end of a run: as given, else `duration` after the start. Raises InputError."""
    if t_start == 0.0:
        return positive("t_end", duration if value is None else value)
    number = t_start + duration if value is None else start_time(value)
    if not number > t_start:
        text = f"must be a finite number > t_start = {t_start:g} [s]; given {value!r}"
        raise InputError(Problem("simulate", "t_end", text))
    return number


def positive(field: str, value: Any, *, unit: str = " [s]") -> float:
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    if not 0 < number < np.inf:
        text = f"must be a finite number > 0{unit}; given {value!r}"
        raise InputError(Problem("simulate", field, text))
    return number


def tolerance_of(chosen: Method, length: float, asked: Asked) -> Tolerance | None:
    """How `chosen` chooses its steps; None where they are given. Raises InputError."""
    rtol, step = asked.rtol, asked.step
    if rtol is not None and not chosen.adaptive:
        text = f"{chosen.name} takes a step, not a tolerance; for one choose {choices(ADAPTIVE)}"
        raise InputError(Problem("simulate", "rtol", text))
    if rtol is not None:
        rtol = positive("rtol", rtol, unit="")
        if not LEAST_RTOL <= rtol <= 0.1:
            text = f"must lie within {LEAST_RTOL:g}, rounding, and 0.1; given {rtol:g}"
            raise InputError(Problem("simulate", "rtol", text))
    atol = asked.atol if asked.atol == 0.0 else positive("atol", asked.atol, unit="")
    most = _most(asked.max_steps)
    if not chosen.adaptive:
        return None
    widest = length if step is None else positive("step", step)
    fixed = step is not None and rtol is None
    usual = FIXED_RTOL if fixed else 1e-8
    return Tolerance(usual if rtol is None else rtol, float(atol), widest, most, np.zeros(0), fixed)


def _most(steps: Any) -> int:
    if not isinstance(steps, Integral) or isinstance(steps, bool) or steps < 1:
        text = f"must be a whole number >= 1; given {steps!r}"
        raise InputError(Problem("simulate", "max_steps", text))
    return int(steps)
