"""Switches that wait for a condition of the state: a coordinate, a gap, a force, a constraint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ..dynamics.scene import Scene
from ..engine import motion
from ..engine.arrays import Frames
from ..engine.compiler.address import address_of
from ..engine.records import PAIR, table
from ..errors import InputError, Problem, choices
from ..mechanism import Mechanism
from ..model import Switch, When
from ..packing.system import Array

if TYPE_CHECKING:
    from ..contact.tables import Tables

FAR = 1e9  # m: gaps beyond it count as this


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
