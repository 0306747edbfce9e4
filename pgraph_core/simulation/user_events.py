"""A user's events: zeros of functions of the state, located within steps, which may end a run."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from ..engine.compiler.address import address_of_function
from ..errors import InputError, Problem
from ..packing.system import Array, Ints
from ..result.records import UserEvent

_Address = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_uint64] * 3)
MOST = 100_000  # events of a run: more are a mistake


class Monitor(Protocol):
    """What a run watches: a function of the state, which is an event where it crosses zero."""

    name: str
    direction: int  # in which it counts: 1 rising, -1 falling, 0 both
    terminal: bool

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Its value."""
        ...


class FunctionMonitor:
    """f(t, q, v) -> number, with attributes `direction` and `terminal` as SciPy has them."""

    def __init__(self, function: Callable[[float, Array, Array], Any], number: int):
        """Raises InputError where it is no function, or its attributes do not fit."""
        where = f"events[{number}]"
        if not callable(function):
            text = f"must be a function of (t, q, v); given {function!r:.60}"
            raise _refused(where, text)
        self.function, self.where = function, where
        self.name = str(getattr(function, "__name__", where))
        direction = getattr(function, "direction", 0)
        terminal = getattr(function, "terminal", False)
        if isinstance(direction, (str, bytes)) or np.ndim(direction) or direction != direction:
            text = "direction must be 1 (rising), -1 (falling) or 0 (both); "
            raise _refused(where, f"{text}given {direction!r:.40}")
        if terminal not in (True, False):
            raise _refused(where, f"terminal must be True or False; given {terminal!r:.40}")
        self.direction, self.terminal = int(np.sign(direction)), bool(terminal)

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Raises InputError where the function raises, or returns no finite number."""
        try:
            value = self.function(t, q.copy(), v.copy())
        except Exception as error:
            text = f"the function {self.name} raised {type(error).__name__}: {error}"
            raise _refused(self.where, f"{text} (at t = {t:.6g} s)") from error
        if isinstance(value, (bool, np.bool_)):
            text = f"must return a number that crosses zero, as q[0] - 1.0; {self.name} gave "
            raise _refused(self.where, f"{text}{bool(value)}")
        try:
            number = float(value) if np.ndim(value) == 0 else np.nan
        except (TypeError, ValueError):
            number = np.nan
        if not np.isfinite(number):
            text = f"must return a finite number; {self.name} gave {value!r:.60} at t = {t:.6g} s"
            raise _refused(self.where, text)
        return number


def monitors_of(events: Any) -> tuple[FunctionMonitor, ...]:
    """The events given to `simulate`: a function, or a list of them. Raises InputError."""
    given = (events,) if callable(events) else events
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise _refused("events", f"must be a list of functions f(t, q, v); given {events!r:.60}")
    return tuple(FunctionMonitor(function, i) for i, function in enumerate(given))


class Watch:
    """The monitors of one run, as its steps call them."""

    def __init__(self, monitors: Sequence[Monitor], waiting: int, nq: int, nv: int):
        """Nothing is called yet. The first `waiting` monitors are conditions of switches."""
        self.monitors, self.waiting, self.size = tuple(monitors), waiting, (nq, nv)
        self.error: Exception | None = None
        self.log: list[UserEvent] = []
        self._called = _Address(self._call)
        self.address = address_of_function(self._called)
        self.wanted: Ints = np.array([m.direction for m in self.monitors], dtype=np.int64)

    def begin(self, t: float, q: Array, v: Array) -> list[float]:
        """The values at the start.

        Raises InputError where a monitor fails, or would end the run before it begins.
        """
        values = [monitor(t, q, v) for monitor in self.monitors]
        for monitor, value in zip(self.monitors, values):
            if value == 0.0 and monitor.terminal:
                text = f"{monitor.name} is zero at the start already, so that the run would end "
                text += "there; start next to it, or leave out terminal"
                raise _refused("events", text)
        return values

    def _call(self, t: float, q: int, v: int, values: int) -> None:
        nq, nv = self.size
        state = _array(q, nq), _array(v, nv)
        found = _array(values, len(self.monitors))
        try:
            for i, monitor in enumerate(self.monitors):
                found[i] = monitor(t, *state)
        except Exception as error:  # none may pass through compiled steps
            self.error = self.error or error
            found[:] = 1.0

    def fired(self, watched: Array) -> list[int]:
        """The monitors that have crossed zero, by number."""
        from ..engine.contact.points import NOW

        count = len(self.monitors)
        return np.flatnonzero(watched[NOW, watched.shape[1] - count :] < 0.0).tolist()

    def note(self, t: float, numbers: Sequence[int], q: Array, v: Array) -> str:
        """Log events of the given monitors; the name of one that ends the run, or ""."""
        ends = ""
        for i in numbers:
            if i < self.waiting:
                continue
            monitor, number = self.monitors[i], i - self.waiting
            self.log.append(UserEvent(t, monitor.name, number, q.copy(), v.copy()))
            ends = monitor.name if monitor.terminal else ends
        if len(self.log) > MOST:
            raise _refused("events", f"{MOST} of them by t = {t:.6g} s: a function may be noise")
        return ends


def _array(address: int, count: int) -> Array:
    if count == 0:
        return np.zeros(0)
    if isinstance(address, int):
        return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))
    return address


def _refused(where: str, text: str) -> InputError:
    return InputError(Problem("simulate", where, text))
