"""What a run watches: a user's events, and conditions that switches wait for.

Each is a function of the state whose zeros are located within steps."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ..dynamics.scene import Scene
from ..engine import motion
from ..engine.arrays import Frames
from ..engine.compiler.address import address_of, address_of_function
from ..engine.records import PAIR, table
from ..errors import InputError, Problem, choices
from ..mechanism import Mechanism
from ..model import Switch, When
from ..packing.system import Array, Ints
from ..result.records import UserEvent

if TYPE_CHECKING:
    from ..contact.tables import Tables


_Address = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_uint64] * 3)
MOST = 100_000  # events of a run: more are a mistake
FAR = 1e9  # m: gaps beyond it count as this


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
        if np.ndim(direction) or direction not in (-1, 0, 1):
            text = "direction must be 1 (rising), -1 (falling) or 0 (both); "
            raise _refused(where, f"{text}given {direction!r:.40}")
        if terminal not in (True, False):
            raise _refused(where, f"terminal must be True or False; given {terminal!r:.40}")
        self.direction, self.terminal = int(direction), bool(terminal)

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


class ConditionOf(NamedTuple):
    """A switch that waits, by numbers."""

    constraint: int
    active: bool
    when: When
    place: Any  # of what it watches
    contacts: Tables | None  # of the run


def conditions_of(
    mech: Mechanism, switches: Sequence[Switch], contacts: Tables | None
) -> tuple[ConditionOf, ...]:
    """The switches that wait for conditions, by numbers of what they watch. Raises InputError."""
    names = [c.name for c in mech.model.constraints]
    found = []
    for s in switches:
        if s.when is None:
            continue
        what, name = s.when.subject
        known = _known(mech, contacts)[what]
        if name not in known:
            text = f"of '{s.constraint}': no {what} is called {name!r}; "
            text += f"choose one of {choices(tuple(known))}" if known else f"there is no {what}"
            raise InputError(Problem("simulate", "switches", text))
        number = names.index(s.constraint)
        found.append(ConditionOf(number, s.active, s.when, known[name], contacts))
    return tuple(found)


def _known(mech: Mechanism, contacts: Tables | None) -> dict[str, dict[str, Any]]:
    """What conditions may name: entries of q, contact pairs, and constraints, by number."""
    places = {}
    for name, joint in mech.joints.items():
        if joint.q.stop == joint.q.start + 1:
            places[name] = joint.q.start
        elif joint.q.stop - joint.q.start == joint.v.stop - joint.v.start:
            places |= {
                f"{name} {k}": joint.q.start + k for k in range(joint.q.stop - joint.q.start)
            }
    numbers = {c.name: i for i, c in enumerate(mech.model.constraints)}
    pairs: dict[str, list[int]] = {}
    for i, pair in enumerate(contacts.touches if contacts is not None else ()):
        pairs.setdefault(pair.contact.name, []).append(i)
    touching = {name: ("contact", found) for name, found in pairs.items()}
    held = {name: ("constraint", i) for name, i in numbers.items()}
    return {
        "coordinate": places,
        "gap": pairs,
        "force": {**touching, **held},
        "constraint": numbers,
    }


class UnderWay(Protocol):
    """What a condition asks of the run that it is watched in: a `Recording`."""

    mech: Mechanism
    plan: Any
    scene: Any
    steps: Any
    events: Any
    held: set[int]  # constraints that are active now


class Condition:
    """A monitor that rises through zero where its condition becomes true."""

    direction, terminal = 1, False

    def __init__(self, given: ConditionOf, record: UnderWay):
        """Nothing is computed yet."""
        self.given, self.record = given, record
        self.name = str(given.when)
        self._frame: Frames | None = None
        self._scene: Scene | None = None

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """How far it is beyond its bound: positive where it is true."""
        when = self.given.when
        if when.constraint is not None:
            return 1.0 if (self.given.place in self.record.held) == when.active else -1.0
        value = self._value(t, q, v)
        if when.above is not None:
            return value - when.above
        return (when.below or 0.0) - value

    def _value(self, t: float, q: Array, v: Array) -> float:
        when, place = self.given.when, self.given.place
        if when.coordinate is not None:
            return float(q[place])
        if when.gap is not None:
            return self._gap(t, q, v)
        kind, which = place
        if kind == "contact":
            return float(np.linalg.norm(self._push(t, q, v)))
        frame = self._evaluated(self.record.scene.address, t, q, v)
        one = np.array([which], dtype=np.int64)
        (wrench,) = self.record.scene.forces(frame.wrenches[0], one).values()
        return float(np.linalg.norm(wrench[3:]))

    def _gap(self, t: float, q: Array, v: Array) -> float:
        """The smallest gap of a contact, however far [m]."""
        from ..engine.contact.contacts import find

        scene = self._alone()
        self._evaluated(scene.address, t, q, v)
        assert scene.touching is not None
        found = scene.touching.found[: find(scene.address, FAR)]
        gaps = found["gap"][np.isin(found["pair"], self.given.place)]
        return float(gaps.min(initial=FAR))

    def _push(self, t: float, q: Array, v: Array) -> Array:
        """The force of a contact: of the state where that gives it, else of the last step [N]."""
        record, when = self.record, self.given.when
        tables, (_, pairs) = self.given.contacts, self.given.place
        assert tables is not None
        if record.events is not None:
            name = when.force or ""
            points = record.events.scene.points
            some = [
                i for i, p in enumerate(record.plan.contact_points)
                if p.pair == name or p.pair.startswith(f"{name}[")
            ]  # fmt: skip
            if some:
                return points["force"][some].sum(axis=0)
        if tables.touches[pairs[0]].contact.law == "soft":
            frame = self._evaluated(self._alone().address, t, q, v)
            return frame.pairs["force"][0, pairs].sum(axis=0)
        assert record.scene.touching is not None
        return record.scene.touching.pairs["force"][pairs].sum(axis=0)

    def _alone(self) -> Scene:
        """The contacts without memory of steps, so that looking at them changes nothing."""
        if self._scene is None:
            plan, tables = self.record.plan, self.given.contacts
            none = np.zeros(0, dtype=np.int64)
            packed = self.record.mech.packed
            self._scene = Scene(packed, plan.drives, plan.loads, none, contacts=tables)
        return self._scene

    def _evaluated(self, scene: int, t: float, q: Array, v: Array) -> Frames:
        """Forces at a state, into a frame of its own."""
        mech, tables = self.record.mech, self.given.contacts
        touches = len(tables.touches) + len(tables.limits) if tables is not None else 0
        blocks = len(self.record.scene.active) + touches
        frame = self._frame = self._frame or Frames(
            q=np.zeros((1, mech.nq)), v=np.zeros((1, mech.nv)), vdot=np.zeros((1, mech.nv)),
            wrenches=np.zeros((1, blocks, 6)), energies=np.zeros((1, 4)),
            drifts=np.zeros((1, 2)), pushes=np.zeros((1, mech.nb, 6)),
            pairs=table(PAIR, 1, touches), missed=np.zeros((1, 3)),
        )  # fmt: skip
        accelerate = address_of(motion.acceleration)
        if scene == self.record.scene.address:
            accelerate = self.record.steps.links.accelerate
        flow, ledger = np.zeros(3), np.zeros(2)
        motion.record(scene, accelerate, t, q, v, flow, ledger, 0, tuple(frame))
        return frame
