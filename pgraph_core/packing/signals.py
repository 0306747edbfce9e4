"""The expressions of a model and of a run as programs, and their values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from .. import joints
from ..engine import signals as kernels
from ..engine.riders import COLUMN
from ..engine.signals import DRIVE, GATE, LAW, STATES, TARGETS
from ..engine.stepping.measured import (
    BOUND,
    CONSTRAINT,
    CONTACT,
    MEASURE,
    TENSION,
)
from ..errors import ModelError, Problem, choices
from ..forces import LOADS, STRUTS, BetweenPoints, Cable, OnBody, OnJoint, Strut
from ..model import Contact, Force, Model, Rope
from ..model.expressions import TENSE
from ..pulleys import segment_names
from ..signals import parsed, written
from ..stateful import STATE, Stateful
from ..topology import Topology
from . import Array, Drives, Ints, Loads, System, joint_coordinates
from .programs import Program

NO_STATES = np.zeros((0, STATES), np.int64)
NO_SIGNALS = np.zeros((0, kernels.COLUMNS)), np.zeros((0, TARGETS), np.int64), NO_STATES
KNOTS = ("first_target", "targets"), ("first_torque", "torques")  # fields of a drive
SPAN = ("first_knot", "knots")  # fields of a load


class Places:
    """The locations of a model's signals in the kernel states."""

    def __init__(
        self,
        model: Model,
        topology: Topology,
        packed: System,
        placed: Callable[[], Any],
        forces: Sequence[Force] = (),
    ):
        """Store the model. `placed` returns a `Placed`, and `forces` act in the run."""
        self._topology, self._packed = topology, packed
        self._placed, self._forces = placed, forces
        self._model, self._outputs = model, {o.name: o for o in model.outputs}
        self._states = {(c.name, k): i for i, (c, k, _) in enumerate(model.states)}

    def __call__(self, group: str, name: str, k: int) -> tuple[int, ...]:
        """Return the operation that reads a signal and its operands."""
        if group == "force":
            return self._of_force(name, k)
        if group == STATE:
            return kernels.V, int(self._topology.dof.sum()) + self._states[name, k]
        if group == "out":
            o = self._outputs[name]
            group = "v" if o.kind == "joint_velocity" else "q"
            name, k = o.at, o.coordinate
        number = self._topology.number(name)
        at_v = joint_coordinates(self._packed, number)
        if group == "v":
            return kernels.V, at_v[k][0]
        place = joints.places(self._model.body(name).sequence)[k]
        assert place is not None
        rows = np.searchsorted(self._packed.body_of_row, number)
        return kernels.Q, int(self._packed.rows[rows, 2]) + place, at_v[k][0]

    def _of_force(self, name: str, k: int) -> tuple[int, ...]:
        """Return the operation that reads the force of a constraint, contact or path."""
        model = self._model
        for number, c in enumerate(model.constraints):
            if c.name == name and isinstance(c, Rope):
                return kernels.NUMBER, CONSTRAINT, number, self.segment(c, k)
            if c.name == name:
                return kernels.NUMBER, CONSTRAINT + k, number
        contacts = [c.name for c in model.contacts]
        if name in contacts:
            return kernels.NUMBER, CONTACT + k, contacts.index(name)
        known = (*known_forces(model), *self._forces)
        f = next(f for f in reversed(known) if f.name == name and isinstance(f, TENSE))
        k = self.segment(f, k) if isinstance(f, Cable) else 0
        if isinstance(f, Cable) and f.stiffness is None:
            return kernels.NUMBER, CONTACT, number_of_cable(model, f), k
        rows = self._rows.get(name)
        if rows is None:
            return (kernels.NUMBER,)  # an inactive force has no tension
        return kernels.NUMBER, TENSION, rows[max(k - 1, 0)]

    @cached_property
    def _rows(self) -> Mapping[str, range]:
        """The rows of the forces along paths, by name."""
        return dict(self._placed().path_rows(self._forces))

    def segment(self, part: Cable | Rope, k: int) -> int:
        """Return the number of a segment, or 0 for the only one. Raises ModelError."""
        count = len(self._placed().segments(part))
        if (count == 1 and not k) or (count > 1 and 1 <= k <= count):
            return k
        name = part.name
        if count > 1:
            all_of = choices(segment_names(name, count))
            text = f"has {count} segments, each with its own tension: {all_of}; name one of them, "
            text += f"in expressions as {written('force', name, 1)}"
        else:
            text = f"has one segment; name '{name}' without a number, got {k}, or "
            text += f"{written('force', name)} in expressions"
        raise ModelError(Problem(f"{part.word()} '{name}'", "through", text))

    def of_load(self, program: Program, f: OnBody, row: Any) -> Iterator[tuple[int, ...]]:
        """Yield (value, first knot, how many, column) for each number that varies in a load."""
        first, count = row[[*SPAN]].tolist()
        for one in f._varying(self._placed()):
            yield program.of(one.value), first, count if one.everywhere else 1, one.column


def inputs_of_states(model: Model, states: Array) -> dict[str, int]:
    """Return the rows in the program of the constant inputs of parts with states, by name."""
    given = states[:, kernels.INPUT_OF].tolist()
    return {c.name: 2 * row for (c, _, _), row in zip(model.states, given) if row >= 0}


def number_of_cable(model: Model, cable: Cable) -> int:
    """Return the number of a cable that does not stretch, behind those of the contacts."""
    return len(model.contacts) + model.forces.index(cable)


def begun_from(loads: Loads, states: Array) -> Loads:
    """Return the loads with these initial control states (nx,). Entries of nan are ignored."""
    code, targets, own = loads.signals
    known, own = np.flatnonzero(~np.isnan(states)), own.copy()
    own[known, kernels.START] = len(code) // 2 + np.arange(len(known))
    rows = np.zeros((2 * len(known), code.shape[1]))
    rows[::2, 0], rows[::2, 4] = kernels.NUMBER, states[known]
    return loads._replace(signals=(np.vstack((code, rows)), targets, own))


def known_forces(model: Model) -> tuple[Force, ...]:
    """Return all forces that expressions of a model may refer to, including forces of scenarios."""
    return (*(f for s in model.scenarios for f in s.forces), *model.forces)


def signals(
    places: Places,
    model: Model,
    forces: Sequence[Force],
    drives: Drives,
    loads: Loads,
    named: Sequence[Force] = (),
    watched: Sequence[str] = (),
    rubbing: Sequence[Contact] = (),
    bent: bool = False,
    touching: bool = False,
) -> tuple[Array, Ints, Ints]:
    """Return (code, targets, states) for all expressions in these forces, for their drives and
    loads, in the friction of contacts and in the controls. Steps end at changes of the conditions
    in `watched`. If `bent` is set, they also end at bounds and bends of forces and where the second
    derivative of a relation jumps, and if `touching` is set, where soft and penalty contacts touch.
    """
    acting = {f.name: f for f in forces if isinstance(f, Stateful)}  # with the inputs of the run
    controls = {c.name: acting.get(c.name, c) for c in model.stateful}
    known = (*known_forces(model), *named, *forces)
    program = Program(model.parameters, places, controls, known, holds=True)
    rows = rows_of_loads(forces, loads)
    targets = [*_targets(program, places, forces, drives, rows)]
    owner = sum(f._varies for f in forces)
    for k, c in enumerate(rubbing, start=owner):
        targets.append((program.value(str(c.friction)), LAW, model.contacts.index(c), 0, 0, k, 0))
    states = _states(program, model, controls, forces, rows)
    for text in watched:
        program.watch(parsed(text))
    if bent:
        _watch_bends(program, model, forces, drives, loads)
        targets += _gates(program, loads, forces, owner + len(rubbing))
    if touching:
        program.watch_touches()
    owners = np.array(targets, np.int64).reshape(-1, TARGETS)
    return program.code(), owners, np.array(states, np.int64).reshape(-1, STATES)


def rows_of_loads(forces: Sequence[Force], loads: Loads) -> dict[int, tuple[int, Any]]:
    """Return (number of its table, from 1, and its row) for each load of a kind that may vary, by
    its place among the forces. Such kinds have one row for each load."""
    found = dict[int, tuple[int, Any]]()
    for n, kind in enumerate(LOADS):
        if any(other.VARIES for other in kind.parts):
            ours = (i for i, f in enumerate(forces) if type(f) in kind.parts)
            found |= {i: (1 + n, row) for i, row in zip(ours, loads[n][0])}
    return found


def _targets(
    program: Program, places: Places, forces: Sequence[Force], drives: Drives,
    rows: Mapping[int, tuple[int, Any]],
) -> Iterator[tuple[int, ...]]:  # fmt: skip
    """Yield the targets of all numbers that vary in forces."""
    owner, of_drives = 0, iter(drives.table[drives.passive :])
    for i, f in enumerate(forces):
        found = list[tuple[int, ...]]()
        row = next(of_drives) if isinstance(f, OnJoint) else None
        if not f._varies:
            continue
        if isinstance(f, OnBody) and i in rows:
            kind, load = rows[i]
            found = [(x, kind, *where) for x, *where in places.of_load(program, f, load)]
        elif isinstance(f, OnJoint) and row is not None:
            given = zip(program.of_drive(f), KNOTS)
            found = [(x, DRIVE, *row[[*at]].tolist(), 1) for x, at in given if x is not None]
        yield from ((*x, owner, 0) for x in found)
        owner += 1


def _states(
    program: Program, model: Model, controls: Mapping[str, Stateful], forces: Sequence[Force],
    rows: Mapping[int, tuple[int, Any]],
) -> list[tuple[int, ...]]:  # fmt: skip
    """Return the rows of all states of controls and muscles, of those that act in a run."""
    numbers = {name: i for i, name in enumerate(controls)}
    knots = {
        forces[i].name: (kind, int(row["first_knot"])) for i, (kind, row) in rows.items()
        if isinstance(forces[i], Stateful)
    }  # fmt: skip
    owns = {c.name: controls[c.name].own for c in model.stateful if controls[c.name] is not c}
    found = list[tuple[int, ...]]()
    for c, k, own in model.states:
        own = owns[c.name][k] if c.name in owns else own
        sample = program.sampling(c) if own.sample else -1
        change = -1 if own.change is None else program.of(own.change)
        place = (0, 0) if own.column is None else knots.get(c.name, (0, 0))
        given = -1 if own.given is None else program.of(own.given)
        start = program.of(own.start)
        found.append((change, sample, start, numbers[c.name], 0, *place, own.column or 0, given))
    return found


def _watch_bends(
    program: Program, model: Model, forces: Sequence[Force], drives: Drives, loads: Loads
) -> None:
    """Let steps end at bounds and bends of forces, and of functions of coordinates."""
    for n, f in enumerate((f for f in forces if isinstance(f, OnJoint)), drives.passive):
        if f._bends:
            program.watch_drive(f, n)
    for n, f in enumerate(f for f in forces if type(f) in STRUTS.parts):
        if isinstance(f, Strut) and f._bends:
            program.watch_strut(f, n, int(loads.strut[0]["first_knot"][n]))
    for n, one in enumerate(loads.cable[0]):
        program.watch_cable(n, one)
    for c in model.bending:
        program.watch_relation(c)
    for body in model.cornered:
        program.watch_track(body)
    for f in forces:
        if isinstance(f, BetweenPoints):
            program.watch_shifts(f)


def gated(forces: Sequence[Force]) -> tuple[BetweenPoints, ...]:
    """Return the forces along paths with points that count in a range."""
    paths = (f for f in forces if isinstance(f, BetweenPoints))
    return tuple(f for f in paths if any(via.when is not None for via in f.via))


def _gates(
    program: Program, loads: Loads, forces: Sequence[Force], first: int
) -> Iterator[tuple[int, ...]]:
    """Yield the targets of points that count in a range: a run holds their side within a step.

    The number of the first one among `gated` forces as an owner is `first`.
    """
    own = gated(forces)
    in_order = (f for kind in LOADS for f in own if type(f) in kind.parts)
    owners = (first + own.index(f) for f in in_order for via in f.via if via.when is not None)
    for n, one in enumerate(loads.riders[0]):
        if one["gate"] >= 0:
            x = program.put(kernels.Q, one["gate"], one["gate_v"])
            number = program.within(x, one["low"], one["high"])
            yield number, GATE, n, 1, COLUMN, next(owners), 0


def values_of(
    model: Model, packed: Any, forces: Sequence[Force], t: Array, q: Array, v: Array
) -> dict[str, Array]:
    """Return the values {control: (n,)} of controls at times (n,), in states of a run with these
    forces.
    """
    controls = {c.name: c for c in model.stateful}
    if not controls:
        return {}
    places = packed.places()
    program = Program(model.parameters, places, controls, (*known_forces(model), *forces))
    last = [2 * program.signal("x", name, 0) + 1 for name in controls]
    return dict(zip(controls, _over(program.code(), last, t, q, v)))


def values_of_targets(signals: Any, kind: int, t: Array, q: Array, v: Array) -> dict[int, Array]:
    """Return the values {first knot: (n,)} of expressions for drives or for one kind of load, at n
    states of a run.
    """
    code, targets, _ = signals
    targets = targets[targets[:, 1] == kind]
    if not len(targets):
        return {}
    code = code.copy()
    code[1::2, kernels.SIDE] = 0.0  # comparisons have their own results at each state
    found = _over(code, 2 * targets[:, 0] + 1, t, q, v)
    return dict(zip(targets[:, 2].tolist(), found))


def _over(code: Array, rows: Any, t: Array, q: Array, v: Array) -> Array:
    """Return the values in these rows of a program at n states, (rows, n)."""
    found = np.empty((len(rows), len(t)))
    for i in range(len(t)):
        kernels.values(code, t[i], q[i], v[i])
        found[:, i] = code[rows, 0]
    return found


def limits_of(table: Any, code: Array) -> Array:
    """Return the least and the largest torque of each drive (n, 2).

    A run moves those of its table while it holds a drive on one side of a limit. Its program keeps
    the limits.
    """
    found = np.column_stack((table["low"], table["high"]))
    rows = code[::2][(code[::2, 0] == kernels.NUMBER) & (code[::2, MEASURE.what] == BOUND)]
    of = rows[:, MEASURE.first].astype(int)
    found[of] = -np.inf, np.inf
    found[of, rows[:, MEASURE.count].astype(int)] = rows[:, MEASURE.value]
    return found
