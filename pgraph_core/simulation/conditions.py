"""Conditions of switches: functions of the state that rise through zero when they become true."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ..dynamics.scene import NO_CONSTRAINTS, Scene, empty_frames, forces_of
from ..engine import motion
from ..engine.arrays import Frames
from ..engine.compiler.address import address_of
from ..engine.records import LIMIT, rows_of
from ..engine.signals import values
from ..engine.stepping.measured import CONSTRAINT, CONTACT, MEASURE, TENSION
from ..errors import choices, refusal, shown
from ..mechanism import Mechanism
from ..model import Force, Switch, When
from ..model.expressions import TENSE, Known
from ..model.scenario import forceless
from ..packing import Array
from ..packing.forces import exerts
from ..packing.programs import Program, measured_rows
from ..packing.signals import known_forces
from ..pulleys import without_segment
from ..signals import parsed
from ..tolerances import SOLVED

if TYPE_CHECKING:
    from ..contact.tables import Tables


class ConditionOf(NamedTuple):
    """A switch that waits for a condition, in numeric form."""

    constraint: int
    active: bool
    when: When
    place: Any  # index of the monitored quantity, or what is measured
    contacts: Tables | None  # contacts of the run

    @property
    def of_contact(self) -> bool:
        """Return True if it monitors a contact."""
        return self.when.gap is not None or self.contact_force

    @property
    def contact_force(self) -> bool:
        """Return True if it monitors a contact force, or that of a cable that does not stretch."""
        return self.when.force is not None and CONTACT <= self.place.what < TENSION

    @property
    def reads_force(self) -> bool:
        """Return True if it monitors the force of a contact, constraint or path."""
        of_force = self.when.holds is not None and len(measured_rows(self.place.code)) > 0
        return self.when.force is not None or of_force

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
    def called(self) -> bool:
        """Return True if steps must call a Python function for its value."""
        return not (self.compiled or self.of_contact)

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
    bodies, found = {b.name: b for b in mech.model.bodies}, []
    exerted = tuple(filter(exerts, forces))
    for s in switches:
        if s.when is None:
            continue
        what, name = s.when.subject
        number = names.index(s.constraint)
        if what == "holds":
            place = _comparison(mech, name, forces)
            found.append(ConditionOf(number, s.active, s.when, place, contacts))
            continue
        known = _known(mech, contacts, forces)[what]
        name, k = without_segment(name, known) if what == "force" else (name, 0)
        if name not in known:
            text = f"of '{s.constraint}': no {what} is named {name!r}; "
            text += f"choose one of {choices(tuple(known))}" if known else f"there is no {what}"
            raise refusal("simulate", "switches", text)
        if text := forceless(s, mech.model.constraints, bodies):
            raise refusal("simulate", "switches", text)
        place = known[name]
        if what == "force":
            signal = mech.packed.places(exerted)("force", name, k)[1:]
            place = Measured(*signal)
        found.append(ConditionOf(number, s.active, s.when, place, contacts))
    return tuple(found)


class Measured(NamedTuple):
    """A force that is measured, with the operands of its instruction."""

    what: int = 0
    number: int = 0  # number of the constraint, contact or cable, or row of the path
    segment: int = 0  # from 1, 0: the whole part


class Comparison(NamedTuple):
    """A comparison of signals, in numeric form."""

    text: str
    code: Array
    last: int  # row of its margin, positive if it is true

    def __call__(self, t: float, q: Array, v: Array) -> float:
        """Evaluate the margin. Raises InputError if it is not finite."""
        values(self.code, t, q, v)
        found = float(self.code[self.last, 0])
        if not np.isfinite(found):
            reason = f"{shown(self.text)} has no value at t = {t:.6g} s"
            raise refusal("simulate", "switches", reason)
        return found


def _comparison(mech: Mechanism, text: str, forces: Sequence[Force]) -> Comparison:
    """Create a comparison of signals. Raises InputError."""
    model, packed = mech.model, mech.packed
    bodies = {b.name: b for b in model.bodies}
    names = [c.name for c in model.constraints], [c.name for c in model.contacts]
    parts = model.outputs, model.controls, model.parameters, forces
    known = Known(bodies, *parts, names, constraints=model.constraints)
    exerted = tuple(filter(exerts, forces))
    if problem := known.problem(text, None):  # problem of a switch given in the call
        raise refusal("simulate", "switches", problem)
    places, controls = packed.places(exerted), known.controls
    acting = (*known_forces(model), *forces)  # controls may name what does not act
    program = Program(model.parameters, places, controls, acting)
    last = 2 * program.margin(parsed(text)) + 1
    return Comparison(text, program.code(), last)


def limits_of(mech: Mechanism, conditions: Sequence[ConditionOf]) -> Any:
    """Return LIMIT records for the conditions on coordinates."""
    found = []
    for event, given in enumerate(conditions):
        if given.when.coordinate is not None:
            joint = next(x for x in mech.joints.values() if x.q.start <= given.place < x.q.stop)
            velocity = joint.v.start + given.place - joint.q.start
            found.append((given.place, velocity, *given.limit, event))
    return rows_of(LIMIT, found)


def _known(
    mech: Mechanism, contacts: Tables | None, forces: Sequence[Force]
) -> dict[str, dict[str, Any]]:
    """Compute the names available to conditions: entries of q, contact pairs, constraints, and
    what has a force."""
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
    pulled = [f.name for f in (*mech.model.forces, *forces) if isinstance(f, TENSE)]
    return {
        "coordinate": places,
        "gap": pairs,
        "force": dict.fromkeys((*pairs, *numbers, *pulled)),
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
    switching: Any
    start: float  # [s]


class Condition:
    """A monitor that rises through zero when its condition becomes true."""

    direction, terminal = 1, 0

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
        """Compute the distance beyond the bound, positive if the condition is true."""
        when, place = self.given.when, self.given.place
        if when.coordinate is not None:
            value = q.item(place)
        elif when.holds is not None:
            self._measure(t, q, v)
            return place(t, q, v)
        elif when.constraint is not None:
            holds = (place in self.record.held) == when.active
            if holds and when.after:
                since = self.record.switching.since.get(place, self.record.start)
                return t - since - when.after
            return 1.0 if holds else -1.0
        else:
            value = self._value(t, q, v)
        if when.above is not None:
            return value - when.above
        return (when.below or 0.0) - value

    def _value(self, t: float, q: Array, v: Array) -> float:
        when, place = self.given.when, self.given.place
        if when.gap is not None:
            return self._gap(t, q, v)
        return self._measured(place, t, q, v)

    def _measure(self, t: float, q: Array, v: Array) -> None:
        """Write the forces that a comparison names into its program."""
        code = self.given.place.code
        for i in measured_rows(code).tolist():
            place = Measured._make(map(int, code[i, MEASURE.what : MEASURE.value]))
            code[i, MEASURE.value] = self._measured(place, t, q, v)

    def _measured(self, place: Measured, t: float, q: Array, v: Array) -> float:
        """Return the size or an entry of a force, or a tension [N]."""
        what, number, segment = place
        if what >= TENSION:
            return self._tension(number, t, q, v)
        if what < CONSTRAINT:
            return 0.0  # an inactive force has no tension
        if what < CONTACT:
            force = self._held(number, segment, t, q, v)
        else:
            force = self._pushed(number, segment, t, q, v)
        entry = what % CONSTRAINT
        return float(force[entry - 1] if entry else np.linalg.norm(force))

    def _tension(self, row: int, t: float, q: Array, v: Array) -> float:
        """Return the tension in a row of the forces along paths [N]."""
        scene = self.record.scene
        found = np.zeros((sum(len(table) for table, *_ in scene.loads.kinds), 3))
        motion.load_tensions(scene.address, t, q, v, found)
        return float(found[row, 0])

    def _pushed(self, number: int, segment: int, t: float, q: Array, v: Array) -> Array:
        """Return the force of a contact or of a cable that does not stretch [N]."""
        model, tables = self.record.mech.model, self.given.contacts
        numbers = tables.measured(model) if tables is not None else []
        pairs = [k for k, own in enumerate(numbers) if own == number]
        pairs = pairs[segment - 1 : segment] if segment else pairs
        name = model.contacts[number].name if number < len(model.contacts) else ""
        return self._push(name, pairs, t, q, v) if pairs else np.zeros(3)

    def _held(self, number: int, segment: int, t: float, q: Array, v: Array) -> Array:
        """Return the force of a constraint [N], zero for one that this run never switches on."""
        blocks = self.record.scene.blocks
        if number >= len(blocks.names):
            return np.zeros(3)
        frame = self._evaluated(self.record.scene.address, t, q, v)
        one = np.array([number], dtype=np.int64)
        wrench = list(forces_of(blocks, one, frame.wrenches).values())[max(segment, 1) - 1]
        return wrench[0, 3:]

    def _gap(self, t: float, q: Array, v: Array) -> float:
        """Find the smallest gap of a contact at any distance [m]."""
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

    def _push(self, name: str, pairs: Sequence[int], t: float, q: Array, v: Array) -> Array:
        """Compute the force of a contact [N], computed from the state if possible, and otherwise
        from the last step."""
        record, tables = self.record, self.given.contacts
        assert tables is not None
        if record.events is not None:
            points = record.events.scene.points
            some = [
                i for i, p in enumerate(record.plan.contact_points)
                if p.pair == name or p.pair.startswith(f"{name}[")
            ]  # fmt: skip
            if some:
                return points["force"][some].sum(axis=0)
        if record.scene.touching is None:
            return np.zeros(3)  # nothing has come near
        touch = tables.touches[pairs[0]] if pairs[0] < len(tables.touches) else None
        if touch is not None and touch.contact.law == "soft":
            frame = self._evaluated(self._alone().address, t, q, v)
            return frame.pairs["force"][0, pairs].sum(axis=0)
        assert record.scene.touching is not None
        return record.scene.touching.pairs["force"][pairs].sum(axis=0)

    def _alone(self) -> Scene:
        """Return the contacts without memory of steps: evaluating them has no side effects."""
        if self._scene is None:
            plan, tables = self.record.plan, self.given.contacts
            given = self.record.mech.packed, plan.drives, plan.loads, NO_CONSTRAINTS
            self._scene = Scene(*given, contacts=tables)
        return self._scene

    def _evaluated(self, scene: int, t: float, q: Array, v: Array) -> Frames:
        """Evaluate the forces at a state into a separate frame."""
        mech, tables = self.record.mech, self.given.contacts
        touches = len(tables.touches) + len(tables.limits) if tables is not None else 0
        blocks = len(self.record.scene.active) + touches
        if self._frame is not None and len(self._frame.wrenches[0]) != blocks:
            self._frame = None  # another scene
        size = len(q), len(v)
        frame = self._frame = self._frame or empty_frames(1, size, blocks, mech.nb, touches)
        frame.wrenches[:] = 0.0  # none is recorded while no constraint is active
        accelerate = address_of(motion.acceleration)
        if scene == self.record.scene.address:
            accelerate = self.record.steps.links.accelerate
        flow, ledger = np.zeros(3), np.zeros(2)
        motion.record(scene, accelerate, t, q, v, flow, ledger, 0, tuple(frame))
        return frame
