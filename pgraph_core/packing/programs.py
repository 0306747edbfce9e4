"""Expressions as programs for kernels, with the instructions of `engine/signals.py`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..curves import Table
from ..engine import signals as kernels
from ..engine.edges import COMPARES, MARK, NEEDED
from ..engine.signals import HELD_FROM, LAW, NEAREST
from ..engine.stepping.measured import (
    BEND,
    BOUND,
    CONSTRAINT,
    CONTACT,
    MEASURE,
    OF_CABLES,
    OF_INPUT,
    OF_LENGTH,
    OF_SPEED,
    TENSION,
    TOUCH,
)
from ..fields import EMPTY
from ..forces import BetweenPoints, Driven, OnJoint, Shift, Strut
from ..forces.strut import bends
from ..functions import corners_of
from ..model import Body, Force, Relation
from ..signals import Node, parsed
from ..signals.grammar import COMPARISONS, walk
from ..signals.meaning import CONSTANTS
from ..stateful import STATE, Stateful
from . import Array, Ints

OPERATIONS = {
    name: getattr(kernels, name.upper())
    for name in (
        "add", "sub", "mul", "div", "min", "max", "less", "at_most", "abs", "sqrt", "sin", "cos",
        "tan", "exp", "log", "asin", "acos", "atan", "pow",
    )
}  # fmt: skip
OPERATIONS["if"] = kernels.CHOOSE
WHOLE = range(1, 9)  # powers that are products
Operand = int  # the number of an instruction


class Program:
    """A list of unique instructions. Equal operations on equal operands share one instruction."""

    def __init__(
        self, parameters: Mapping[str, float], places: Any = None,
        controls: Mapping[str, Stateful] = EMPTY, forces: Sequence[Force] = (),
        holds: bool = False,
    ):  # fmt: skip
        """Create an empty program. `places(group, name, k)` returns the readers of a signal.

        If several `forces` have the same name, the last one is used. A run `holds` the results of
        comparisons of the motion within a step.
        """
        self.rows: list[tuple[float, ...]] = []
        self._numbers: dict[tuple[float, ...], int] = {}
        self._named: dict[str, int] = {}
        self._parameters, self._places = {**CONSTANTS, **parameters}, places
        self._controls, self._values = controls, dict[str, Operand]()
        self._holds = holds
        self._drives = {f.name: f for f in forces if isinstance(f, OnJoint)}
        for control in controls.values():
            self._parameters |= control.numbers

    def put(self, op: int, *operands: float, number: float = 0.0) -> Operand:
        """Return the number of an instruction, adding it if it is new."""
        row = (float(op), *map(float, operands), *(0.0,) * (3 - len(operands)), number)
        key = (*row, np.copysign(1.0, number))  # -0.0 is another number
        if key not in self._numbers:
            self._numbers[key] = len(self.rows)
            self.rows.append(row)
        return self._numbers[key]

    def parameter(self, name: str) -> Operand:
        """Add a named number. Equal numbers are stored separately, so that a sweep can change each
        of them."""
        if name not in self._named:
            self._named[name] = self.apart(self._parameters[name])
        return self._named[name]

    def apart(self, x: float) -> Operand:
        """Add a constant that shares no instruction with an equal one."""
        self.rows.append((float(kernels.NUMBER), 0.0, 0.0, 0.0, float(x)))
        return len(self.rows) - 1

    def sampling(self, control: Stateful) -> Operand:
        """Return the instruction with the time between the samples of a control."""
        return self.parameter(f"{control.name} sample")

    def number(self, x: float) -> Operand:
        """A constant."""
        return self.put(kernels.NUMBER, number=float(x))

    def value(self, x: float | str | Table) -> Operand:
        """Add a number, a table over time, or an expression."""
        if isinstance(x, str):
            return self.of(parsed(x))
        if isinstance(x, Table):
            knots = [self.number(y) for pair in zip(x.t, x.value) for y in pair]
            return self.table(self.put(kernels.TIME), knots)
        return self.number(x)

    def of(self, node: Node) -> Operand:
        """Add the instructions for an expression tree."""
        match node.op:
            case "number":
                return self.number(node.value)
            case "name" if node.signal[1] in self._parameters:
                return self.parameter(node.signal[1])
            case "name":
                return self.put(kernels.TIME)
            case "signal":
                return self.signal(*node.signal)
        a, *rest = (self.of(x) for x in node.args)
        match node.op:
            case "neg":
                return self.put(kernels.SUB, self.number(0.0), a)
            case "not":
                return self.put(kernels.CHOOSE, a, self.number(0.0), self.number(1.0))
            case "and":
                return self.put(kernels.CHOOSE, a, *rest, self.number(0.0))
            case "or":
                return self.put(kernels.CHOOSE, a, self.number(1.0), *rest)
            case "more" | "at_least":
                return self.put(OPERATIONS[{"more": "less"}.get(node.op, "at_most")], *rest, a)
            case "min" | "max":
                for b in rest:
                    a = self.put(OPERATIONS[node.op], a, b)
                return a
            case "pow":
                return self.power(a, rest[0], node.args[1])
            case "smoothstep":
                return self.smoothstep(a, *rest)
            case "table":
                return self.table(a, rest)
        return self.put(OPERATIONS[node.op], a, *rest)

    def signal(self, group: str, name: str, k: int) -> Operand:
        """Add the value of a signal, which can be an expression if it is a control."""
        if group == "x" and k == 0:
            if name not in self._values:
                self._values[name] = self.of(self._controls[name].value)
            return self._values[name]
        if group == "u":
            return self.input(self._drives[name])
        if group == "f":
            return self.pushed(self._drives[name])
        place = (STATE, name, k - 1) if group == "x" else (group, name, k)
        return self.put(*self._places(*place))

    def input(self, f: Driven) -> Operand:
        """Add the value of a drive's input, within its bounds."""
        return self.of(f.given)

    def of_drive(self, f: OnJoint) -> tuple[Operand | None, Operand | None]:
        """Return (target, torque) for a drive in kernel form, with None for constant values.

        The law is torque + gain u - kp length - kd rate. If the input aims, its kernel form is
        torque + kp (target - length) - kd rate with the target gain u / kp. Otherwise, torque +
        gain u takes the place of the torque.
        """
        gain, torque, kp, _ = f.law
        u = self.input(f)
        if f.aims:
            varies = isinstance(getattr(f, f.INPUT), str)
            target = self.times(gain / kp, u) if varies else None
            return target, self.value(torque) if isinstance(torque, str) else None
        u = self.times(gain, u)
        plain = isinstance(torque, float) and torque == 0.0
        return None, u if plain else self.put(kernels.ADD, self.value(torque), u)

    def pushed(self, f: OnJoint) -> Operand:
        """Add the torque that a drive gives, before its gear and within its bounds."""
        gain, torque, kp, kd = f.law
        found = self.put(kernels.ADD, self.value(torque), self.times(gain, self.input(f)))
        for factor, group in ((kp, "q"), (kd, "v")):
            for body, k, by in f.terms if factor else ():
                along = self.times(by * factor, self.put(*self._places(group, body, k)))
                found = self.put(kernels.SUB, found, along)
        return self.held(found, *f.torques)

    def times(self, by: float, x: Operand) -> Operand:
        """Add a product with a constant."""
        return x if by == 1.0 else self.put(kernels.MUL, self.number(by), x)

    def power(self, base: Operand, exponent: Operand, node: Node) -> Operand:
        """Add a power, as repeated products if the exponent is a small integer.

        For a negative base, the exponent must be an integer.
        """
        if node.op == "neg" and node.args[0].op == "number":
            inverse = self.power(base, self.number(node.args[0].value), node.args[0])
            return self.put(kernels.DIV, self.number(1.0), inverse)
        if node.op != "number" or not node.value.is_integer():
            return self.put(kernels.POW, base, exponent)
        if node.value not in WHOLE:
            odd = node.value % 2.0
            size = self.put(kernels.ABS, base)
            found = self.put(kernels.POW, size, self.number(node.value - odd))
            return self.put(kernels.MUL, base, found) if odd else found
        found = base
        for _ in range(int(node.value) - 1):
            found = self.put(kernels.MUL, found, base)
        return found

    def held(self, x: Operand, low: float, high: float) -> Operand:
        """Clamp a value to its finite bounds."""
        x = self.put(kernels.MAX, x, self.number(low)) if np.isfinite(low) else x
        return self.put(kernels.MIN, x, self.number(high)) if np.isfinite(high) else x

    def between(self, x: Operand, low: Operand, high: Operand) -> Operand:
        return self.put(kernels.MIN, self.put(kernels.MAX, x, low), high)

    def smoothstep(self, x: Operand, begin: Operand, end: Operand) -> Operand:
        """Add 3 s^2 - 2 s^3, with s rising from 0 to 1 between two positions."""
        span = self.put(kernels.SUB, end, begin)
        s = self.put(kernels.DIV, self.put(kernels.SUB, x, begin), span)
        s = self.between(s, self.number(0.0), self.number(1.0))
        twice = self.put(kernels.MUL, self.number(2.0), s)
        rest = self.put(kernels.SUB, self.number(3.0), twice)
        return self.put(kernels.MUL, self.put(kernels.MUL, s, s), rest)

    def margin(self, node: Node) -> Operand:
        """Add the margin of the comparisons, positive if true."""
        match node.op:
            case "and" | "or":
                a, b = map(self.margin, node.args)
                return self.put(kernels.MIN if node.op == "and" else kernels.MAX, a, b)
            case "not":
                return self.put(kernels.SUB, self.number(0.0), self.margin(node.args[0]))
        a, b = map(self.of, node.args)
        rises = node.op in ("less", "at_most")
        return self.put(kernels.SUB, b, a) if rises else self.put(kernels.SUB, a, b)

    def watch(self, node: Node) -> None:
        """End steps at the changes of a comparison in a condition, if it depends on the state."""
        nodes = list(walk(node))
        if any(n.signal[0] == "force" for n in nodes):
            return
        for n in nodes:
            if n.op in COMPARISONS:
                self.end_steps(*map(self.of, n.args))

    def end_steps(self, a: Operand, b: Operand, place: Operand = 0) -> None:
        """Let steps end where a - b changes its sign. A force bends at the number `place`."""
        self.put(kernels.ABS, self.put(kernels.SUB, a, b), 0, place)

    def watch_drive(self, f: OnJoint, n: int) -> None:
        """Let steps end where drive n reaches or leaves a bound of its torque.

        The torque is bit-identical to `forces.drive`, so that the next step starts on the correct
        branch.
        """
        (target, torque), (_, _, kp, kd) = self.of_drive(f) if f._varies else (None, None), f.law
        total = self.number(0.0)
        if kd:
            drag = self.put(kernels.MUL, self.apart(kd), self.along(f, "v"))
            total = self.put(kernels.SUB, total, drag)
        if kp:
            target = self.put(kernels.NUMBER, OF_INPUT, n) if target is None else target
            pull = self.put(kernels.SUB, target, self.along(f, "q"))
            total = self.put(kernels.ADD, total, self.put(kernels.MUL, self.apart(kp), pull))
        torque = self.put(kernels.NUMBER, OF_INPUT, n, 1) if torque is None else torque
        total = self.put(kernels.ADD, total, torque)
        for k, bound in enumerate(f.torques):
            if np.isfinite(bound):
                place = self.put(kernels.NUMBER, BOUND, n, k, number=bound)
                self.end_steps(*((place, total) if k else (total, place)), place)

    def along(self, f: OnJoint, group: str) -> Operand:
        """Add the length of a drive ("q"), or its rate ("v"), as `forces.along_terms` does."""
        found: Operand | None = None
        for body, k, by in f.terms:
            signal = self.put(*self._places(group, body, k))
            one = self.put(kernels.MUL, self.apart(by), signal)
            found = one if found is None else self.put(kernels.ADD, found, one)
        assert found is not None, "a drive acts on a coordinate"
        return found

    def watch_strut(self, f: Strut, n: int, knot: int) -> None:
        """Let steps end at the bends of strut n, whose knots begin at this one."""
        length, speed = (
            self.put(kernels.NUMBER, OF_LENGTH, n),
            self.put(kernels.NUMBER, OF_SPEED, n),
        )
        for signal, lines in ((length, f.spring), (speed, f.damper)):
            for x in bends(lines)[1][:, 0].tolist():
                place = self.put(kernels.NUMBER, BEND, knot, number=x)
                self.end_steps(signal, place, place)
                knot += 1
        if f.bump_stiffness:
            place = self.put(kernels.NUMBER, BEND, knot, number=f.bump_length)
            self.end_steps(place, length, place)
            damped = self.put(kernels.MUL, self.apart(f.bump_damping), speed)
            place = self.put(kernels.NUMBER, BEND, knot + 1, number=1.0)
            self.end_steps(place, damped, place)

    def watch_cable(self, n: int, one: Any) -> None:
        """Let steps end where row n of the cables becomes slack or taut."""
        knot, length = int(one["first_knot"]), self.put(kernels.NUMBER, OF_LENGTH, n, OF_CABLES)
        rest = float(one["rest"])
        place = self.put(kernels.NUMBER, BEND, knot, OF_CABLES, number=rest)
        self.end_steps(length, place, place)
        if one["damping"]:
            stretch = self.put(kernels.SUB, length, self.apart(rest))
            elastic = self.put(kernels.MUL, self.apart(float(one["stiffness"])), stretch)
            speed = self.put(kernels.NUMBER, OF_SPEED, n, OF_CABLES)
            damped = self.put(kernels.MUL, self.apart(float(one["damping"])), speed)
            place = self.put(kernels.NUMBER, BEND, knot + 1, OF_CABLES, number=0.0)
            self.end_steps(self.put(kernels.ADD, elastic, damped), place, place)

    def watch_relation(self, c: Relation) -> None:
        """Let steps end where the second derivative of a relation jumps."""
        x = Node("signal", signal=("q", c.other, c.other_coordinate))
        for ends in corners_of(c.curve, x, self._parameters):
            self.end_steps(*map(self.of, ends))

    def watch_track(self, body: Body) -> None:
        """Let steps end where the second derivative of a body's track jumps."""
        assert body.track is not None, "it has one"
        place = [m.track is not None for m in body.sequence].index(True)
        k = sum(len(m.facts.v) for m in body.sequence[:place])
        x = self.of(Node("signal", signal=("q", body.name, k)))
        for end in body.track.corners:
            self.end_steps(x, self.number(end))

    def watch_shifts(self, f: BetweenPoints) -> None:
        """Let steps end where the second derivative of a point's shift jumps."""
        for shift in f._riding:
            if isinstance(shift, Shift):
                x = Node("signal", signal=("q", shift.body, shift.coordinate))
                for end in shift.corners:
                    self.end_steps(self.of(x), self.number(end))

    def within(self, x: Operand, low: float, high: float) -> Operand:
        """Add 1 where a value is in a range, and 0 elsewhere."""
        above = self.put(kernels.AT_MOST, self.apart(low), x)
        below = self.put(kernels.AT_MOST, x, self.apart(high))
        return self.put(kernels.CHOOSE, above, below, self.number(0.0))

    def watch_touches(self) -> None:
        """Let steps end where soft and penalty contacts touch."""
        none = self.number(0.0)
        self.end_steps(self.put(kernels.NUMBER, TOUCH), none)

    def table(self, x: Operand, knots: Sequence[Operand]) -> Operand:
        """Interpolate linearly between knots (position, value, ...), constant outside."""
        found = knots[1]
        for a, y, b, z in zip(knots[0::2], knots[1::2], knots[2::2], knots[3::2]):
            rise, run = self.put(kernels.SUB, z, y), self.put(kernels.SUB, b, a)
            gone = self.put(kernels.SUB, self.between(x, a, b), a)
            slope = self.put(kernels.DIV, rise, run)
            found = self.put(kernels.ADD, found, self.put(kernels.MUL, slope, gone))
        return found

    def code(self) -> Array:
        """Return the instructions and their values, not yet known, as (2 n, COLUMNS).

        The array of a run has OWN_COLUMNS additional columns for bounds of rates.
        """
        more = kernels.OWN_COLUMNS if self._holds else 0
        found = np.zeros((2 * len(self.rows), kernels.COLUMNS + more))
        if self.rows:
            found[::2, : kernels.COLUMNS] = self.rows
            self._mark(found[::2])
        return found

    def _mark(self, rows: Array) -> None:
        """Mark the comparisons of times, and the operations that they need."""
        moves = list[bool]()  # an instruction reads the motion, or the time, or is true or not
        timed, true = list[bool](), list[bool]()
        for op, *operands, number in rows[:, : kernels.COLUMNS].tolist():
            reads = [int(k) for k in operands[: _operands(int(op))]]
            own = op in (kernels.Q, kernels.V) or (op == kernels.NUMBER and operands[0] != 0.0)
            moves.append(own or any(moves[k] for k in reads))
            timed.append(op == kernels.TIME or any(timed[k] for k in reads))
            k = len(timed) - 1
            if op in kernels.COMPARING and timed[k] and not moves[k]:
                rows[k, MARK] = COMPARES
            true.append(op in kernels.JUMPING or (op == kernels.NUMBER and number in (0.0, 1.0)))
            if op == kernels.CHOOSE:
                true[k] = all(true[i] for i in reads)
            if op == kernels.CHOOSE and moves[k] and true[reads[0]] and self._holds:
                rows[k, 0] = kernels.BLEND
            if op in kernels.COMPARING and moves[k] and self._holds:
                rows[k, 0] += HELD_FROM
                rows[k, NEAREST] = np.inf
        for k in range(len(rows) - 1, -1, -1):
            if (op := int(rows[k, 0])) > kernels.V and rows[k, MARK]:
                for i in map(int, rows[k, 1 : 1 + _operands(op)]):
                    if rows[i, 0] > kernels.V:
                        rows[i, MARK] = max(rows[i, MARK], NEEDED)


def _operands(op: int) -> int:
    """Return how many operands an operation has."""
    if op <= kernels.V or op == kernels.CHOOSE:
        return 0 if op <= kernels.V else 3
    return 2 if op <= kernels.AT_MOST or op == kernels.POW else 1


def measured_rows(code: Array) -> Ints:
    """Return the rows of the forces of contacts, constraints and paths in a program."""
    return (
        np.flatnonzero((code[::2, 0] == kernels.NUMBER) & (code[::2, MEASURE.what] >= CONSTRAINT))
        * 2
    )


def contacts_read(code: Array) -> list[int]:
    """Return the numbers of the contacts whose forces are used in a program, beside those of
    cables that do not stretch."""
    rows = code[measured_rows(code)]
    what = rows[:, MEASURE.what]
    return rows[(what >= CONTACT) & (what < TENSION), MEASURE.first].astype(int).tolist()


def with_pairs(targets: Ints, pairs: Sequence[int]) -> Ints:
    """Return the targets with contact pairs given by index, excluding other contacts.

    `pairs` contains the contact index of each pair.
    """
    targets = targets[(targets[:, 1] != LAW) | np.isin(targets[:, 2], pairs)]
    for one in targets:
        if one[1] == LAW:
            one[2:4] = pairs.index(one[2]), pairs.count(one[2])
    return targets


def locate_forces(code: Array, first: Sequence[int], pairs: Sequence[int]) -> None:
    """Write the blocks of constraints and the pairs of contacts into a program of their numbers.

    The program has the number of a segment of a rope or cable as the count, or 0 for the whole.
    `first` contains the first block of each constraint and the end, or [0] if there are none.
    `pairs` contains the number of the contact or the cable of each pair.
    """
    for i in measured_rows(code).tolist():
        n, k = int(code[i, MEASURE.first]), int(code[i, MEASURE.count])
        if code[i, MEASURE.what] >= TENSION:
            continue
        if code[i, MEASURE.what] < CONTACT:
            own = range(*first[n : n + 2]) if n + 1 < len(first) else range(0)
        else:
            own = [pair for pair, number in enumerate(pairs) if number == n]
        own = own[k - 1 : k] if k else own
        code[i, MEASURE.first], code[i, MEASURE.count] = min(own, default=0), len(own)


def count_of_edges(code: Array) -> int:
    """Return how many comparisons of times a program has."""
    rows = code[::2]
    return int(np.count_nonzero((rows[:, 0] > kernels.V) & (rows[:, MARK] == COMPARES)))


def count_of_held(code: Array) -> int:
    """Return how many comparisons of the motion a program has."""
    return int(np.count_nonzero(code[::2, 0] >= HELD_FROM))


def hold(code: Array, q: Array, v: Array) -> None:
    """Hold the comparisons of the motion in a program with their results at a state, at t = 0."""
    rows = 2 * np.flatnonzero(code[::2, 0] >= HELD_FROM)
    if not len(rows):
        return
    kernels.values(code, 0.0, q, v)
    op, (a, b) = (
        code[rows, 0] - HELD_FROM,
        (code[2 * code[rows, k].astype(int) + 1, 0] for k in (1, 2)),
    )
    b[op == kernels.ABS] = 0.0
    code[rows + 1, kernels.SIDE] = np.where(np.where(op == kernels.AT_MOST, a <= b, a < b), 1, -1)


def unlocated(code: Array) -> bool:
    """Check whether a value jumps where no comparison changes: at 0 of a number that chooses."""
    true = list[bool]()  # an instruction is true or not
    for op, *operands, number in code[::2, : kernels.COLUMNS].tolist():
        chooses = op in (kernels.CHOOSE, kernels.BLEND)
        if chooses and not true[int(operands[0])]:
            return True
        plain = op in kernels.JUMPING or (op == kernels.NUMBER and number in (0.0, 1.0))
        true.append(all(true[int(k)] for k in operands) if chooses else plain)
    return False


def edges_moved(code: Array) -> list[int]:
    """Return by which derivatives, counted from 0, a comparison of times changes at another time.

    `code` is a program of duals.
    """
    moved = np.zeros((len(code) // 2, code.shape[2] - 1), bool)
    found = np.zeros(code.shape[2] - 1, bool)
    for k, row in enumerate(code[::2]):
        op, *operands = row[:4, 0].astype(int).tolist()
        moved[k] = row[4, 1:] != 0.0
        for i in operands[: _operands(op)]:
            moved[k] |= moved[i]
        if op in (kernels.LESS, kernels.AT_MOST):
            found |= moved[k]
    return np.flatnonzero(found).tolist()


def of_coordinate(function: str | Sequence[float], parameters: Mapping[str, float]) -> Array:
    """Return the program of a coordinate in place of the time, for an expression or coefficients.

    Its last instruction is the value.
    """
    program = Program(parameters, lambda *signal: (kernels.TIME,))
    if isinstance(function, str):
        return _ending(program, program.of(parsed(function)))
    x = program.put(kernels.TIME)
    found = program.apart(function[-1])
    for c in function[-2::-1]:
        found = program.put(kernels.ADD, program.put(kernels.MUL, found, x), program.apart(c))
    return _ending(program, found)


def of_time(text: str, parameters: Mapping[str, float]) -> Array:
    """Return the program for a prescribed motion. Its last instruction is the value."""
    program = Program(parameters)
    return _ending(program, program.of(parsed(text)))


def _ending(program: Program, last: Operand) -> Array:
    """Return the code of a program whose last instruction is this one."""
    if last != len(program.rows) - 1:  # a constant that stands before others
        program.rows.append((float(kernels.ADD), float(last), float(program.number(0.0)), 0.0, 0.0))
    return program.code()
