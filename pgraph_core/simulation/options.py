"""Options for stepping and recording a run, as passed to `simulate`."""

from __future__ import annotations

import contextlib
import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from ..dynamics.arguments import whole_number
from ..errors import InputError, ModelError, Problem, needed, one_of, shown
from ..fields import Flag, Number, Text, Whole, field, is_number, listed
from ..forces import Driven, OnJoint
from ..integrators import Method
from ..mechanism import Mechanism
from ..model import Force, Scenario, Table
from ..model.force_checks import force_problems, late_limits
from ..model.settings import (
    ADAPTIVE,
    AUTO,
    LONGEST,
    MOST_FRAMES,
    STEP,
    Settings,
    no_tolerance,
)
from ..packing import Array, Ints
from ..portable import array_of
from ..tolerances import SOLVED

MOST_CHOSEN = 10_000_000  # default limit on the steps of an adaptive run
STEPS_ALLOWED = 1_000_000_000  # a day of computing
FRAMES = 1000  # recorded by default
RTOL = 1e-8  # default tolerance of adaptive runs


class Tolerance(NamedTuple):
    """The tolerances by which an adaptive method chooses its steps."""

    rtol: float  # relative to the mechanism's own scales
    atol: float  # absolute tolerance of every coordinate, in its unit
    widest: float  # largest step [s]
    most: int  # steps


Inputs = tuple[tuple[str, float | Table], ...]


class Options(Settings):
    """The arguments of `simulate` that do not depend on the state, with None for defaults."""

    scenario: Text | None = field("the name of a scenario", default=None)
    t_start: Any = 0.0
    atol: Number = field("a finite number >= 0", default=0.0, ge=0)
    max_steps: Whole = field("a whole number >= 1", default=MOST_CHOSEN, ge=1)
    t_eval: Any = None
    stabilise: Literal["project", "baumgarte"] | None = field(
        "'project', 'baumgarte' or None", default="project"
    )
    forces: Any = ()
    switches: Any = None
    estimate: Flag | None = field("True, False or None", default=None)
    inputs: Any = ()  # Inputs
    memory: Any = None  # the Memory of the run that goes on
    sample: Number | None = field("a time > 0 [s]", default=None, gt=0)
    usual: Any = None  # the step of the scenario [s], for methods that do not choose their steps

    @classmethod
    def unchecked(cls, **given: Any) -> Self:
        """Return options that `over` checks, once for all runs with the same plan."""
        made, put = cls.__new__(cls), object.__setattr__
        put(made, "__dict__", {**_USUAL, **given})
        put(
            made, "__pydantic_fields_set__", {*given}
        )  # `model_construct` does this too, in twice the time
        put(made, "__pydantic_extra__", None)
        put(made, "__pydantic_private__", None)
        return made

    def changed(self, **changes: Any) -> Self:
        """Return other options, which are not checked."""
        return self.unchecked(**{**vars(self), **changes})

    def over(self, given: Scenario | None) -> Self:
        """Return the checked options, with a scenario's settings where the call has none.

        Settings of the scenario that do not fit an argument of the call do not count. Its step is
        `usual`. Raises InputError.
        """
        try:
            own = type(self)(**{**vars(self), "t_end": None})  # `span` checks t_end
        except ModelError as error:
            raise InputError([replace(p, where="simulate") for p in error.problems]) from None
        if own.frames is not None and own.t_eval is not None:
            raise InputError(Problem("simulate", "frames", "give frames or t_eval, not both"))
        taken = {name: getattr(given, name) for name in SETTINGS} if given is not None else {}
        for name, others in REPLACED.items():
            if getattr(own, name) is not None:
                taken |= dict.fromkeys(others)
        if own.rtol is not None and taken.get("method") not in ADAPTIVE:
            taken["method"] = None
        if own.method not in (None, AUTO, *ADAPTIVE):
            taken["rtol"] = None
        now = {name: x for name, x in taken.items() if getattr(own, name) is None}
        if given is not None and now.get("rtol") is not None:
            now["step"] = given.step  # the largest one
        return own.changed(**now, t_end=self.t_end, usual=given and given.step)

    @property
    def width(self) -> float:
        """The size of fixed steps [s]."""
        return self.step or self.usual or STEP

    def span(self, given: Scenario | None) -> tuple[float, float]:
        """Return the start and end times of the run [s]. Raises InputError."""
        start = _time(self.t_start)
        duration = given.t_end if given else 1.0
        if self.t_end is None and self.t_eval is not None and start < last(self.t_eval) < np.inf:
            duration = last(self.t_eval) - start
        if start == 0.0:
            end = positive("t_end", duration if self.t_end is None else self.t_end)
            if end > LONGEST:
                text = f"must be at most {LONGEST:g} s, got {end:g}"
                raise InputError(Problem("simulate", "t_end", text))
            return start, end
        end = start + duration if self.t_end is None else _time(self.t_end)
        if not end > start:
            text = f"must be a finite number > t_start = {start:g} [s], got {self.t_end!r}"
            raise InputError(Problem("simulate", "t_end", text))
        return start, end

    def tolerance(self, method: Method, length: float) -> Tolerance | None:
        """Return the tolerances of `method`, or None for fixed steps. Raises InputError.

        A step without a tolerance is the size of every step, and with one the largest size.
        """
        rtol, step, most = self.rtol, self.step, self.max_steps
        if not method.adaptive:
            if given := "rtol" if rtol is not None else "atol" if self.atol else "":
                raise InputError(Problem("simulate", given, no_tolerance(method.name)))
            return None
        if step is None:
            return Tolerance(rtol or RTOL, self.atol, length, most)
        if rtol is None and self.atol == 0.0:
            return None
        return Tolerance(rtol or RTOL, self.atol, step, most)

    def checked_forces(self, mech: Mechanism) -> tuple[Force, ...]:
        """Return the forces of a call, checked to fit the model. Raises InputError."""
        forces = self.forces
        if not isinstance(forces, (tuple, list)) or not all(isinstance(f, Force) for f in forces):
            do = "; a function of torques f(t, q, v) is given as tau" if callable(forces) else ""
            text = f"must be a list of pg.Force, got {shown(forces)}{do}"
            raise InputError(Problem("simulate", "forces", text))
        bodies = {b.name: b for b in mech.model.bodies} if forces else {}
        found = [problem for f in forces for problem in force_problems((f,), bodies)]
        found += self._names_taken(mech)
        if found := found + late_limits(forces):
            raise InputError(found)
        return tuple(forces)

    def _names_taken(self, mech: Mechanism) -> list[Problem]:
        """Return a problem for each force of the call whose name is already taken."""
        taken = {f.name: "the model" for f in mech.model.forces}
        if self.scenario is not None:
            own = mech.model.scenario(self.scenario).forces
            taken |= {f.name: f"scenario '{self.scenario}'" for f in own}
        found = list[Problem]()
        for f in self.forces:
            if f.name in taken:
                text = f"{taken[f.name]} has a force of this name, and both would act; choose "
                text += "another name, or edit that one"
                found.append(Problem(f"force '{f.name}'", "name", text))
            taken[f.name] = "the call"
        return found


# settings of a scenario that replace missing arguments of a call
SETTINGS = tuple(name for name in Settings.model_fields if name not in ("t_end", "step"))
# argument of a call -> settings of a scenario that it replaces: of steps and of recorded times
REPLACED = {"step": ("rtol",), "rtol": ("step",), "t_eval": ("frames",)}
_USUAL = {name: info.default for name, info in Options.model_fields.items()}


def inputs_of(given: Mapping[str, Any] | None, call: str) -> Inputs:
    """Return inputs by name, each a number or a table over time. Raises InputError."""
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        text = f"must be names with numbers or tables: {{'knee': 0.5}}, got {shown(given)}"
        raise InputError(Problem(call, "inputs", text))
    found: list[tuple[str, float | Table]] = []
    for name, value in given.items():
        if isinstance(value, Mapping):
            value = Table(**value)
        if not isinstance(value, Table) and not np.isfinite(value := _number(listed(value))):
            text = "must be a number, or a pg.Table over time"
            raise InputError(Problem(call, f"inputs[{name!r}]", f"{text}, got {given[name]!r}"))
        found.append((name, value))
    return tuple(found)


def driven(forces: Sequence[Force], inputs: Inputs, call: str, t_start: float) -> tuple[Force, ...]:
    """Return the forces with these inputs for their own from t_start on. Raises InputError."""
    new = dict(inputs)
    known = {f.name: f for f in forces if isinstance(f, Driven)}
    for name, value in inputs:
        if name not in known:
            do = one_of(known) if known else "the model has no motors or servos"
            text = f"no motor, servo or actuator is named {shown(name)}; {do}"
            raise InputError(Problem(call, "inputs", text))
        if text := known[name].input_problem(value):
            raise InputError(Problem(call, f"inputs[{name!r}]", text))
    return tuple(
        _given(f, new[f.name], t_start) if isinstance(f, Driven) and f.name in new else f
        for f in forces
    )


def _given(f: Driven, value: float | Table, t_start: float) -> Driven:
    """Return a drive with this input. If the drive has a lag, its original input still acts
    initially."""
    update: dict[str, Any] = {f.INPUT: value}
    if isinstance(f, OnJoint) and f.lag and f.start is None:
        update["start"] = _at(getattr(f, f.INPUT), t_start)
    return f.unchecked_copy(update)


def begun(forces: Sequence[Force], t_start: float) -> tuple[Force, ...]:
    """Return the forces, with the initial values of their lags and integrals set for t_start."""

    def from_start(f: Force) -> Force:
        if not (isinstance(f, OnJoint) and f.has_state):
            return f
        u = getattr(f, f.INPUT)
        later = (
            [(t, x) for t, x in zip(u.t, u.value) if t > t_start] if isinstance(u, Table) else []
        )
        t, x = zip((t_start, _at(u, t_start)), *later)
        return f.unchecked_copy({f.INPUT: Table(t=t, value=x)})

    if not any(isinstance(f, OnJoint) and f.has_state for f in forces):
        return tuple(forces)
    return tuple(map(from_start, forces))


def _at(u: float | Table, t: float) -> float:
    """Evaluate an input at a given time."""
    return float(np.interp(t, u.t, u.value)) if isinstance(u, Table) else u


def first_of(u: float | Table) -> float:
    """Return the value of a constant input, which a lag turns into a one-row table."""
    return u.value[0] if isinstance(u, Table) else u


def positive(field: str, value: Any, *, unit: str = " [s]", call: str = "simulate") -> float:
    """Return a finite number > 0. Raises InputError, which names the call."""
    number = _number(value)
    if not 0 < number < np.inf:
        text = f"must be a finite number > 0{unit}, got {value!r}"
        raise InputError(Problem(call, field, text))
    return number


def _time(value: Any) -> float:
    number = _number(value)
    if not np.isfinite(number):
        text = f"must be a finite number [s], got {value!r}"
        raise InputError(Problem("simulate", "t_start", text))
    return number


def _number(value: Any) -> float:
    if type(value) is float:
        return value
    return float(value) if is_number(value) else np.nan


# -- recorded times ------------------------------------------------------------------------------


def fixed_step_times(t_start: float, t_end: float, step: float, frames: Any, t_eval: Any) -> Array:
    """Return the recorded times of a fixed-step run, by default with equally many steps in between.

    The first is `t_start`. By default there are about FRAMES + 1 at most. Raises InputError.
    """
    span = t_end - t_start
    if span / step > STEPS_ALLOWED:
        text = f"{step:g} s makes {span / step:.3g} steps; give {span / STEPS_ALLOWED:g} s or more"
        raise InputError(Problem("simulate", "step", text))
    if frames is not None or t_eval is not None:
        return frame_times(t_start, t_end, frames, t_eval)
    steps = max(int(np.ceil(span / step - 1e-9)), 1)
    least = -(-steps // FRAMES)  # steps between recorded states, a divisor of all if possible
    apart = next((n for n in range(least, 4 * least) if steps % n == 0), least)
    width = step if abs(steps * step - span) <= SOLVED * step else span / steps
    times: Array = t_start + width * np.arange(0.0, steps + apart, apart)
    times = times[: -(-steps // apart) + 1]
    times[-1] = t_end
    return times


def steps_between(times: Array, step: float) -> tuple[Ints, Array]:
    """Compute (substeps, step size [s]) for the fixed steps between recorded times.

    If all recorded times are multiples of the step, every step has the requested size.
    """
    apart = times[1:] - times[:-1]
    substeps = np.maximum(np.ceil(apart / step - 1e-9), 1.0)
    off = np.abs(times[1:] - times[0] - step * np.cumsum(substeps)).max(initial=0.0)
    whole = off <= SOLVED * step + 4 * np.finfo(float).eps * np.abs(times).max()
    width = np.full(len(apart), step) if whole else apart / substeps
    return substeps.astype(np.int64), width


def frame_times(t_start: float, t_end: float, frames: Any, t_eval: Any) -> Array:
    """Return the times: `frames` evenly from `t_start` to `t_end`, or `t_start` and `t_eval`."""
    if t_eval is not None:
        return _grid(t_eval, t_start, t_end)
    count = whole_number("simulate", "frames", frames, 2, MOST_FRAMES)
    return np.linspace(t_start, t_end, count)


def last(t_eval: Any) -> float:
    """Return the last of the times to record, or nan if there is none."""
    try:
        return float(array_of(t_eval)[-1])
    except (TypeError, ValueError, IndexError):
        return np.nan


def _grid(t_eval: Any, t_start: float, t_end: float) -> Array:
    try:
        given = array_of(t_eval)
        if np.size(given) > MOST_FRAMES:
            text = f"must be at most {MOST_FRAMES} times, which already take gigabytes, got "
            raise InputError(Problem("simulate", "t_eval", f"{text}{np.size(given)}"))
        times = np.array(given, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        text = f"must be a list of finite times [s], got {shown(t_eval)}"
        raise InputError(Problem("simulate", "t_eval", text))
    if np.any(np.diff(times) <= 0) or times[0] < t_start or times[-1] > t_end + 1e-12 * abs(t_end):
        text = f"must ascend within {t_start:g} to t_end = {t_end:g} s, got {shown(t_eval)}"
        raise InputError(Problem("simulate", "t_eval", text))
    return times if times[0] == t_start else np.concatenate(([t_start], times))


# -- progress --------------------------------------------------------------------------------------


Progress = Callable[[float], Any] | None


@contextlib.contextmanager
def shown_progress(given: Any, where: str) -> Iterator[Progress]:
    """Yield a progress function: the given one, a progress bar for True, or None for False.

    `where` names the calling function. Raises InputError for other arguments.
    """
    if given is None or given is False:
        yield None
    elif given is True:
        with warnings.catch_warnings(action="ignore"):  # a notebook without widgets has text bars
            tqdm = needed("tqdm.auto", "notebook").tqdm
        form = "{l_bar}{bar}| {elapsed}<{remaining}"
        with tqdm(total=1.0, desc=where, bar_format=form) as bar:

            def tell(fraction: float) -> None:
                bar.update(max(fraction - bar.n, 0.0))

            yield tell
            tell(1.0)
    elif callable(given):
        with contextlib.suppress(ValueError):  # a function of C may have no signature
            try:
                inspect.signature(given).bind(0.5)
            except TypeError:
                text = "must take one argument, the completed fraction, got a function that"
                text = f"{text} takes {inspect.signature(given)}"
                raise InputError(Problem(where, "progress", text)) from None
        yield given
    else:
        text = f"must be a function of the completed fraction, got {shown(given)}"
        raise InputError(Problem(where, "progress", text))
