"""Monitors of a run: user events and conditions, whose zeros are located within steps."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..dynamics.arguments import of_state
from ..engine.compiler.address import address_of_function
from ..engine.records import ASLEEP, WATCHED
from ..errors import refusal, shown
from ..packing import Array, Ints
from ..result.records import UserEvent

if TYPE_CHECKING:
    from .conditions import Condition, ConditionOf, UnderWay


_Address = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_uint64] * 3)
MOST_EVENTS = 100_000  # events of a run: more are a mistake


class Monitor(Protocol):
    """A function of the state monitored during a run. Its zero crossings are events."""

    @property
    def name(self) -> str:
        """The name used in its events."""
        ...

    direction: int  # counted direction: 1 rising, -1 falling, 0 both
    terminal: int  # number of the event that ends the run, 0 for none

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Its value."""
        ...


class FunctionMonitor:
    """A function f(t, q, v) -> number, with `direction` and `terminal` as in SciPy."""

    def __init__(
        self, function: Callable[[float, Array, Array], Any], number: int, size: tuple[int, int]
    ):
        """Wrap a function. Raises InputError if it is not callable or its attributes do not fit."""
        where = f"events[{number}]"
        if not callable(function):
            text = f"must be a function of (t, q, v), got {shown(function)}"
            raise refusal("simulate", where, text)
        self.function, self.where, self.size = of_state(function), where, size
        self.name = str(getattr(function, "__name__", where))
        direction = getattr(function, "direction", 0)
        terminal = getattr(function, "terminal", False)
        if np.ndim(direction) or direction not in (-1, 0, 1):
            text = "direction must be 1 (rising), -1 (falling) or 0 (both); "
            raise refusal("simulate", where, f"{text}given {shown(direction)}")
        whole = isinstance(terminal, (bool, np.bool_, int, np.integer))
        if not whole or terminal < 0:
            text = "terminal must be True or False, or the number of the event that ends the run: "
            raise refusal("simulate", where, f"{text}1, 2, ...; got {shown(terminal)}")
        self.direction, self.terminal = int(direction), int(terminal)

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Evaluate the function. Raises InputError if it fails or is not a finite number."""
        try:
            value = self.function(t, q[: self.size[0]].copy(), v[: self.size[1]].copy())
        except Exception as error:
            text = f"the function {self.name} raised {type(error).__name__}: {error}"
            raise refusal("simulate", self.where, f"{text} (at t = {t:.6g} s)") from error
        if isinstance(value, (bool, np.bool_)):
            text = f"must return a number that crosses zero, such as q[0] - 1.0; {self.name} gave "
            raise refusal("simulate", self.where, f"{text}{bool(value)}")
        try:
            number = float(value) if np.ndim(value) == 0 else np.nan
        except (TypeError, ValueError):
            number = np.nan
        if not np.isfinite(number):
            text = f"must return a finite number; {self.name} gave {shown(value)} at t = {t:.6g} s"
            raise refusal("simulate", self.where, text)
        return number


def monitors_of(events: Any, size: tuple[int, int]) -> tuple[FunctionMonitor, ...]:
    """Return the events passed to `simulate`, functions of q and v of `size`.

    Raises InputError for values that are neither a function nor a list of functions.
    """
    given = (events,) if callable(events) else events
    if not isinstance(given, Sequence) or isinstance(given, str):
        text = f"must be a list of functions f(t, q, v), got {shown(events)}"
        raise refusal("simulate", "events", text)
    return tuple(FunctionMonitor(function, i, size) for i, function in enumerate(given))


def room_for(monitors: int, others: int = 0) -> Array:
    """Allocate the array `watched` of event kernels, with the columns of user events last."""
    found = np.zeros((WATCHED.total, others + monitors))
    found[WATCHED.nearest] = np.inf
    return found


class Watch:
    """The monitors of one run, in the form called by its steps."""

    def __init__(
        self, conditions: Sequence[Condition], events: Sequence[Monitor], nq: int, nv: int
    ):
        """Set up the monitors without calling any. Conditions of switches come first."""
        self.conditions = conditions
        self.monitors: tuple[Monitor, ...] = (*conditions, *events)
        self.waiting, self.size = len(conditions), (nq, nv)
        # counted directions, ASLEEP for a condition that has nothing to switch
        self.wanted: Ints = np.array([m.direction for m in self.monitors], dtype=np.int64)
        self.error: BaseException | None = None
        self.log: list[UserEvent] = []
        self.counts = [0] * len(self.monitors)  # events so far
        self.called: list[int] = []
        self._function, self.address = None, 0
        own = [i for i, c in enumerate(conditions) if c.given.called]
        self._call_too([*own, *range(self.waiting, len(self.monitors))])

    def _call_too(self, numbers: Sequence[int]) -> None:
        """Make the steps call these monitors from now on."""
        self.called += numbers
        if self.called and self._function is None:
            self._function = _Address(self._call)
            self.address = address_of_function(self._function)

    def follow(self, record: UnderWay) -> None:
        """Let the conditions watch another run with the same plan."""
        for condition in self.conditions:
            condition.record = record

    def wake(self, conditions: Sequence[ConditionOf]) -> list[int]:
        """Activate the conditions on contacts and return their numbers."""
        woken = [i for i, c in enumerate(conditions) if c.of_contact and i not in self.called]
        self._call_too(woken)
        return woken

    def heed(self, number: int, wakes: bool) -> None:
        """Watch a monitor, or let it sleep."""
        self.wanted[number] = self.monitors[number].direction if wakes else ASLEEP

    def begin(self, t: float, q: Array, v: Array) -> list[float]:
        """Evaluate the monitors at the start.

        Raises InputError if a monitor fails, or would end the run before it begins.
        """
        values = [monitor(t, q, v) for monitor in self.monitors]
        if 0.0 in values:
            for monitor, value in zip(self.monitors, values):
                if value == 0.0 and monitor.terminal == 1:
                    text = f"{monitor.name} is already zero at the start, so the run would "
                    text += "end immediately; change the initial state slightly, or remove terminal"
                    raise refusal("simulate", "events", text)
        return values

    def _call(self, t: float, q: int, v: int, values: int) -> None:
        nq, nv = self.size
        state = _array(q, nq), _array(v, nv)
        found = _array(values, len(self.monitors))
        try:
            for i in self.called:
                found[i] = self.monitors[i](t, *state)
        except BaseException as error:  # none may pass through compiled steps
            self.error = self.error or error
            found[self.called] = 1.0

    def fired(self, watched: Array) -> list[int]:
        """Return the indices of the monitors that have crossed zero."""
        count = len(self.monitors)
        return np.flatnonzero(watched[WATCHED.now, watched.shape[1] - count :] < 0.0).tolist()

    def note(self, t: float, numbers: Sequence[int], q: Array, v: Array) -> Monitor | None:
        """Log events of the given monitors. Returns one that ends the run, or None."""
        ends: Monitor | None = None
        for i in numbers:
            if i < self.waiting:
                continue
            monitor, number = self.monitors[i], i - self.waiting
            self.log.append(UserEvent(t, monitor.name, number, q.copy(), v.copy()))
            self.counts[i] += 1
            ends = monitor if self.counts[i] == monitor.terminal else ends
        if len(self.log) > MOST_EVENTS:
            text = f"{MOST_EVENTS} of them by t = {t:.6g} s: the function may be noisy"
            raise refusal("simulate", "events", text)
        return ends


def _array(address: int, count: int) -> Array:
    if count == 0:
        return np.zeros(0)
    if isinstance(address, int):
        return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))
    return address
