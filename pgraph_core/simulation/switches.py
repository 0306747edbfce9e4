"""Monitors and switches for a run: user events, conditions, and constraints switched on and off.

Events and conditions are functions of the state whose zeros are located within steps.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ..analysis.assembly import ASSEMBLY_ROUNDS
from ..dynamics.scene import Scene
from ..dynamics.states import differences
from ..engine import motion
from ..engine.arrays import RHS, Frames
from ..engine.compiler.address import address_of, address_of_function
from ..engine.records import LIMIT, PAIR, rows_of, table
from ..engine.signals import values
from ..errors import InputError, ModelError, Problem, choices, refusal, shown
from ..mechanism import Mechanism
from ..model import Force, Scenario, Switch, When
from ..model.checks import switch_problems
from ..model.expressions import Known
from ..packing import Array, Ints
from ..packing.constraints import values_of
from ..packing.signals import Places, Program, known_forces
from ..result.records import UserEvent
from ..signals import parsed
from ..tolerances import NEARBY, ROUNDING, SOLVED

if TYPE_CHECKING:
    from ..contact.tables import Tables


_Address = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_uint64] * 3)
MOST_EVENTS = 100_000  # events of a run: more are a mistake


class Monitor(Protocol):
    """A function of the state monitored during a run. Its zero crossings are events."""

    @property
    def name(self) -> str:
        """The name used in its events."""
        ...

    direction: int  # counted direction: 1 rising, -1 falling, 0 both
    terminal: bool

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
            text = f"must be a function of (t, q, v); given {shown(function)}"
            raise refusal("simulate", where, text)
        self.function, self.where, self.size = function, where, size
        self.name = str(getattr(function, "__name__", where))
        direction = getattr(function, "direction", 0)
        terminal = getattr(function, "terminal", False)
        if np.ndim(direction) or direction not in (-1, 0, 1):
            text = "direction must be 1 (rising), -1 (falling) or 0 (both); "
            raise refusal("simulate", where, f"{text}given {shown(direction)}")
        if terminal not in (True, False):
            raise refusal(
                "simulate", where, f"terminal must be True or False; given {shown(terminal)}"
            )
        self.direction, self.terminal = int(direction), bool(terminal)

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Evaluate the function. Raises InputError if it fails or is not a finite number."""
        try:
            value = self.function(t, q[: self.size[0]].copy(), v[: self.size[1]].copy())
        except Exception as error:
            text = f"the function {self.name} raised {type(error).__name__}: {error}"
            raise refusal("simulate", self.where, f"{text} (at t = {t:.6g} s)") from error
        if isinstance(value, (bool, np.bool_)):
            text = f"must return a number that crosses zero, as q[0] - 1.0; {self.name} gave "
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
        raise refusal(
            "simulate", "events", f"must be a list of functions f(t, q, v); given {shown(events)}"
        )
    return tuple(FunctionMonitor(function, i, size) for i, function in enumerate(given))


def room_for(monitors: int, others: int = 0) -> Array:
    """Allocate the (ROWS, others + monitors) array for event kernels, with user events last."""
    from ..engine.contact.points import NEAREST, ROWS

    found = np.zeros((ROWS, others + monitors))
    found[NEAREST] = np.inf
    return found


class Watch:
    """The monitors of one run, in the form called by its steps."""

    def __init__(
        self, conditions: Sequence[Condition], events: Sequence[Monitor], nq: int, nv: int
    ):
        """Set up the monitors without calling any. Conditions of switches come first."""
        self.monitors: tuple[Monitor, ...] = (*conditions, *events)
        self.waiting, self.size = len(conditions), (nq, nv)
        self.error: Exception | None = None
        self.log: list[UserEvent] = []
        self.called: list[int] = []
        self._function, self.address = None, 0
        own = [i for i, c in enumerate(conditions) if not (c.given.compiled or c.given.of_contact)]
        self._call_too([*own, *range(self.waiting, len(self.monitors))])

    def _call_too(self, numbers: Sequence[int]) -> None:
        """Make the steps call these monitors from now on."""
        self.called += numbers
        if self.called and self._function is None:
            self._function = _Address(self._call)
            self.address = address_of_function(self._function)

    def wake(self, conditions: Sequence[ConditionOf]) -> list[int]:
        """Activate the conditions on contacts and return their numbers."""
        woken = [i for i, c in enumerate(conditions) if c.of_contact and i not in self.called]
        self._call_too(woken)
        return woken

    @property
    def wanted(self) -> Ints:
        """The crossing direction that each monitor reports."""
        return np.array([m.direction for m in self.monitors], dtype=np.int64)

    def begin(self, t: float, q: Array, v: Array) -> list[float]:
        """Evaluate the monitors at the start.

        Raises InputError if a monitor fails, or would end the run before it begins.
        """
        values = [monitor(t, q, v) for monitor in self.monitors]
        for monitor, value in zip(self.monitors, values):
            if value == 0.0 and monitor.terminal:
                text = f"{monitor.name} is zero at the start already, so that the run would end "
                text += "there; start next to it, or leave out terminal"
                raise refusal("simulate", "events", text)
        return values

    def _call(self, t: float, q: int, v: int, values: int) -> None:
        nq, nv = self.size
        state = _array(q, nq), _array(v, nv)
        found = _array(values, len(self.monitors))
        try:
            for i in self.called:
                found[i] = self.monitors[i](t, *state)
        except Exception as error:  # none may pass through compiled steps
            self.error = self.error or error
            found[self.called] = 1.0

    def fired(self, watched: Array) -> list[int]:
        """Return the numbers of the monitors that have crossed zero."""
        from ..engine.contact.points import NOW

        count = len(self.monitors)
        return np.flatnonzero(watched[NOW, watched.shape[1] - count :] < 0.0).tolist()

    def note(self, t: float, numbers: Sequence[int], q: Array, v: Array) -> str:
        """Log events of the given monitors. Returns the name of a terminal one, or ""."""
        ends = ""
        for i in numbers:
            if i < self.waiting:
                continue
            monitor, number = self.monitors[i], i - self.waiting
            self.log.append(UserEvent(t, monitor.name, number, q.copy(), v.copy()))
            ends = monitor.name if monitor.terminal else ends
        if len(self.log) > MOST_EVENTS:
            raise refusal(
                "simulate",
                "events",
                f"{MOST_EVENTS} of them by t = {t:.6g} s: a function may be noisy",
            )
        return ends


def _array(address: int, count: int) -> Array:
    if count == 0:
        return np.zeros(0)
    if isinstance(address, int):
        return np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))
    return address


class ConditionOf(NamedTuple):
    """A switch that waits for a condition, in numeric form."""

    constraint: int
    active: bool
    when: When
    place: Any  # index of the monitored quantity
    contacts: Tables | None  # contacts of the run

    @property
    def of_contact(self) -> bool:
        """Return True if it monitors a contact."""
        return self.when.gap is not None or self.contact_force

    @property
    def contact_force(self) -> bool:
        """Return True if it monitors a contact force."""
        return self.when.force is not None and self.place[0] == "contact"

    @property
    def margin(self) -> float:
        """The gap below which the watched contact must be active [m]."""
        return max(self.limit[0] * self.limit[1], 0.0) if self.when.gap is not None else 0.0

    @property
    def compiled(self) -> bool:
        """Return True if compiled steps know its value, a coordinate or a stored value."""
        of_constraint = self.when.constraint is not None and not self.when.after
        return self.when.coordinate is not None or of_constraint

    @property
    def limit(self) -> tuple[float, float]:
        """Return (sign, value) such that the condition is true if sign x - value < 0."""
        when = self.when
        return (-1.0, -when.above) if when.above is not None else (1.0, when.below or 0.0)


def conditions_of(
    mech: Mechanism, switches: Sequence[Switch], contacts: Tables | None, forces: Sequence[Force]
) -> tuple[ConditionOf, ...]:
    """Return the switches that wait for conditions, by watched numbers. Raises InputError."""
    names = [c.name for c in mech.model.constraints]
    found = []
    for s in switches:
        if s.when is None:
            continue
        what, name = s.when.subject
        number = names.index(s.constraint)
        if what == "holds":
            place = _reading(mech, name, forces)
            found.append(ConditionOf(number, s.active, s.when, place, contacts))
            continue
        known = _known(mech, contacts)[what]
        if name not in known:
            text = f"of '{s.constraint}': no {what} is named {name!r}; "
            text += f"choose one of {choices(tuple(known))}" if known else f"there is no {what}"
            raise refusal("simulate", "switches", text)
        found.append(ConditionOf(number, s.active, s.when, known[name], contacts))
    return tuple(found)


def _reading(
    mech: Mechanism, text: str, forces: Sequence[Force]
) -> Callable[[float, Array, Array], float]:
    """Return the margin of a signal comparison as a function of (t, q, v). Raises InputError."""
    model, packed = mech.model, mech.packed
    bodies = {b.name: b for b in model.bodies}
    known = Known(bodies, model.outputs, model.controls, model.parameters, forces)
    if problem := known.problem(text, None):  # problem of a switch given in the call
        raise refusal("simulate", "switches", problem)
    places, controls = Places(model, packed.topology, packed.system), known.controls
    acting = (*known_forces(model), *forces)  # controls may name what does not act
    program = Program(model.parameters, places, controls, acting)
    last = 2 * program.margin(parsed(text)) + 1
    code = program.code()

    def value(t: float, q: Array, v: Array) -> float:
        values(code, t, q, v)
        found = float(code[last, 0])
        if not np.isfinite(found):
            reason = f"{shown(text)} has no value at t = {t:.6g} s"
            raise refusal("simulate", "switches", reason)
        return found

    return value


def limits_of(mech: Mechanism, conditions: Sequence[ConditionOf]) -> Any:
    """Return LIMIT records for the conditions on coordinates."""
    found = []
    for event, given in enumerate(conditions):
        if given.when.coordinate is not None:
            joint = next(x for x in mech.joints.values() if x.q.start <= given.place < x.q.stop)
            velocity = joint.v.start + given.place - joint.q.start
            found.append((given.place, velocity, *given.limit, event))
    return rows_of(LIMIT, found)


def _known(mech: Mechanism, contacts: Tables | None) -> dict[str, dict[str, Any]]:
    """Return the names available to conditions: entries of q, contact pairs and constraints."""
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
    """The interface to a run that evaluates a condition, such as a `Recording`."""

    mech: Mechanism
    plan: Any
    scene: Any
    steps: Any
    events: Any
    held: set[int]  # constraints that are active now
    since: dict[int, float]  # when constraints were switched last [s]
    start: float  # [s]


class Condition:
    """A monitor that rises through zero when its condition becomes true."""

    direction, terminal = 1, False

    def __init__(self, given: ConditionOf, record: UnderWay):
        """Set up the condition without computing anything yet."""
        self.given, self.record = given, record
        self._frame: Frames | None = None
        self._scene: Scene | None = None

    @property
    def name(self) -> str:
        """The condition as text."""
        return str(self.given.when)

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Return the distance beyond the bound, positive if the condition is true."""
        when = self.given.when
        if when.holds is not None:
            return self.given.place(t, q, v)
        if when.constraint is not None:
            holds = (self.given.place in self.record.held) == when.active
            if holds and when.after:
                return t - self.record.since.get(self.given.place, self.record.start) - when.after
            return 1.0 if holds else -1.0
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
        which = place[1]
        if self.given.contact_force:
            return float(np.linalg.norm(self._push(t, q, v)))
        frame = self._evaluated(self.record.scene.address, t, q, v)
        one = np.array([which], dtype=np.int64)
        (wrench,) = self.record.scene.forces(frame.wrenches[0], one).values()
        return float(np.linalg.norm(wrench[3:]))

    def _gap(self, t: float, q: Array, v: Array) -> float:
        """Return the smallest gap of a contact at any distance [m]."""
        record, tables = self.record, self.given.contacts
        if record.plan.way is not None and tables is not None:  # contacts are not in force
            guard = record.steps.clearance
            gap = guard.gaps(record.scene, q[None], len(tables.touches))[0, self.given.place].min()
            if np.isfinite(gap):
                return float(gap)
        from ..engine.contact.contacts import find

        scene = self._alone()
        self._evaluated(scene.address, t, q, v)
        assert scene.touching is not None
        far = self.record.plan.length / SOLVED  # from there the mechanism is a point
        found = scene.touching.found[: find(scene.address, far, 0)]
        gaps = found["gap"][np.isin(found["pair"], self.given.place)]
        return float(gaps.min(initial=far))

    def _push(self, t: float, q: Array, v: Array) -> Array:
        """Return the force of a contact, from the state if it tells it, or the last step [N]."""
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
        if record.scene.touching is None:
            return np.zeros(3)  # nothing has come near
        if tables.touches[pairs[0]].contact.law == "soft":
            frame = self._evaluated(self._alone().address, t, q, v)
            return frame.pairs["force"][0, pairs].sum(axis=0)
        assert record.scene.touching is not None
        return record.scene.touching.pairs["force"][pairs].sum(axis=0)

    def _alone(self) -> Scene:
        """Return the contacts without memory of steps: evaluating them has no side effects."""
        if self._scene is None:
            plan, tables = self.record.plan, self.given.contacts
            none = np.zeros(0, dtype=np.int64)
            packed = self.record.mech.packed
            self._scene = Scene(packed, plan.drives, plan.loads, none, contacts=tables)
        return self._scene

    def _evaluated(self, scene: int, t: float, q: Array, v: Array) -> Frames:
        """Evaluate the forces at a state into a separate frame."""
        mech, tables = self.record.mech, self.given.contacts
        touches = len(tables.touches) + len(tables.limits) if tables is not None else 0
        blocks = len(self.record.scene.active) + touches
        if self._frame is not None and len(self._frame.wrenches[0]) != blocks:
            self._frame = None  # another scene
        frame = self._frame = self._frame or Frames(
            q=np.zeros((1, len(q))), v=np.zeros((1, len(v))), vdot=np.zeros((1, len(v))),
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


class Change(NamedTuple):
    """The constraints switched at one instant."""

    t: float  # [s]
    active: Ints  # constraints from then on
    on: Ints  # those of them that were off
    off: Ints  # those that are off now and were on


def switch_changes(
    mech: Mechanism, given: Scenario | None, asked: Any, active: Ints, span: tuple[float, float]
) -> tuple[Ints, tuple[Change, ...]]:
    """Return (constraints active at the start, later changes) for a run over `span`.

    If `asked` is given, it replaces the switches of the scenario. Raises InputError.
    """
    every = switches_of(mech, given, asked, span)
    switches = [s for s in every if s.t is not None]
    if not switches:
        return active, ()
    waits = len(switches) < len(every)  # others wait for conditions: what is active is not known
    numbers = {c.name: i for i, c in enumerate(mech.model.constraints)}
    now, found = set(active.tolist()), []
    for t, together in groupby(sorted(switches, key=_time), key=_time):
        before, group = set(now), list(together)
        for s in group:
            (now.add if s.active else now.discard)(numbers[s.constraint])
        if t <= span[0]:
            active = _ints(now)
        elif t < span[1] and (waits or now != before):
            on, off = now - before, before - now
            if waits:
                on = {numbers[s.constraint] for s in group if s.active}
                off = {numbers[s.constraint] for s in group if not s.active}
            found.append(Change(t, _ints(now), _ints(on), _ints(off)))
    return active, tuple(found)


def switches_of(
    mech: Mechanism, given: Scenario | None, asked: Any, span: tuple[float, float]
) -> Sequence[Switch]:
    """Return the switches of a run: the requested ones or the scenario's. Raises InputError."""
    return _read(mech, asked, span) if asked is not None else given.switches if given else ()


def _time(s: Switch) -> float:
    return float(s.t or 0.0)


def switched_by(active: set[int], on: Sequence[int], off: Sequence[int], t: float) -> Change:
    """Return the change at t relative to the currently active constraints."""
    after = (active | set(on)) - set(off)
    return Change(t, _ints(after), _ints(after - active), _ints(active - after))


def _ints(numbers: set[int]) -> Ints:
    return np.array(sorted(numbers), dtype=np.int64)


def _read(mech: Mechanism, asked: Any, span: tuple[float, float]) -> list[Switch]:
    """Read the argument of `simulate`, either Switches or (t, constraint, active) tuples."""
    found: list[Switch] = []
    items = asked if isinstance(asked, (list, tuple)) else (asked,)
    for item in items:
        if not isinstance(item, Switch):
            if not isinstance(item, (list, tuple)) or len(item) != 3:
                raise refusal(
                    "simulate",
                    "switches",
                    f"must hold (t, name of a constraint, True or False); given {item}",
                )
            first = "when" if isinstance(item[0], (dict, When)) else "t"
            try:
                item = Switch(**dict(zip((first, "constraint", "active"), item)))
            except ModelError as error:
                p = error.problems[0]
                raise refusal("simulate", "switches", f"of {item}, {p.field} {p.text}") from None
        found.append(item)
    for text in switch_problems(found, [c.name for c in mech.model.constraints]):
        raise refusal("simulate", "switches", text)
    for s in found:
        if s.t is not None and not span[0] <= s.t < span[1]:
            text = f"'{s.constraint}' is switched at t = {s.t:g} s, outside the run: give a time "
            raise refusal(
                "simulate", "switches", f"{text}from {span[0]:g} s to before {span[1]:g} s"
            )
    return found


def with_instants(times: Array, found: Sequence[Change]) -> tuple[Array, tuple[Change, ...]]:
    """Return the times of frames and changes, with changes moved to frames within rounding."""
    moved: list[Change] = []
    near = ROUNDING * max(float(np.abs(times).max()), 1e-300)
    for change in found:
        if change.t < times[-1]:
            at = float(times[np.abs(times - change.t).argmin()])
            moved.append(change._replace(t=at) if abs(at - change.t) <= near else change)
    return np.union1d(times, [change.t for change in moved]), tuple(moved)


def ever(active: Ints, found: Sequence[Change], waiting: Sequence[ConditionOf] = ()) -> Ints:
    """Return all constraints that are active at some time, or may be."""
    if not found and not waiting:
        return active
    later = [c.constraint for c in waiting if c.active]
    parts = [active, *(change.on for change in found), np.array(later, dtype=np.int64)]
    return np.unique(np.concatenate(parts)).astype(np.int64)


# -- in a run ------------------------------------------------------------------------------------


def hold_here(scene: Scene, change: Change, q: Array) -> None:
    """Fill in points and orientations left unspecified by newly active constraints."""
    if not len(change.on):
        return
    packed = scene.packed
    poses = packed.poses(q)
    for i in change.on.tolist():
        c = packed.model.constraints[i]
        try:
            values = values_of(c, packed.model, packed.topology, packed.system, poses)
        except ModelError as error:
            raise InputError(error.problems) from None
        first = int(scene.blocks.first[i])
        scene.blocks.blocks_f[first : first + len(values)] = values


def closed(mech: Mechanism, scene: Scene, change: Change, q: Array, v: Array) -> float:
    """Project q and v onto the active constraints in the mass metric. Returns the change in q.

    The change is the largest of a joint [rad, m]. Raises InputError if the constraints cannot be
    met.
    """
    if scene.active[0] == 0:
        return 0.0
    names = " and ".join(f"'{scene.blocks.names[i]}'" for i in change.on.tolist())
    where = f"constraint {names}"
    old = q.copy()
    fastest = float(np.max(np.abs(v), initial=0.0))
    rounds = motion.projection(scene.held, change.t, q, v, ASSEMBLY_ROUNDS)
    moved = float(np.max(np.abs(q - old), initial=0.0))
    turned, slid = differences(mech.packed.rows, old[None], q[None])
    near = turned[0] <= NEARBY and slid[0] <= NEARBY * (mech.packed.length or 1.0)
    if rounds < 0 or not near:
        text = f"is violated when switched on, at t = {change.t:g} s: a joint would have to jump "
        text += f"by {moved:.3g}; switch it in a position that satisfies it, or omit other_point"
        raise InputError(Problem(where, "", text))
    from ..engine.contact.points import impulse_rows

    m = impulse_rows(scene.held, change.t, q, v)
    left = float(np.max(np.abs(scene.space.vectors[RHS, :m]), initial=0.0))
    if left > SOLVED * max(fastest, float(np.max(np.abs(v), initial=0.0))):
        text = f"requires velocities at t = {change.t:g} s that the others forbid: they miss by "
        raise InputError(Problem(where, "", f"{text}{left:.3g}; switch one of them off"))
    return moved
