"""Expressions in the fields of parts, with checks of their names, units and motions."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

from .. import joints
from ..errors import Problem, choices, nearest_name, shown
from ..fields import Described, OfSums, fields_of
from ..forces import LOADS, Force, OnJoint
from ..pulleys import most_segments
from ..signals import Node, Unreadable, is_expression, parsed, signals_in, with_names, written
from ..signals.grammar import walk
from ..signals.meaning import CONSTANTS, TIME, constant, dim_of, fits, places_of, unit
from ..stateful import Stateful
from ..units import RAD, Dim, M, N, Q, S
from .body import Body
from .constraint import Constraint
from .control import PID, Control
from .joint_constraint import Motion, OfOne, Relation
from .output import OF_JOINT, OF_LOAD, Output
from .rope import Rope

Bodies = Mapping[str, Body | None]
# forces that have a tension along a path
TENSE = tuple(part for kind in LOADS if kind.action.tension is not None for part in kind.parts)
DRIVEN = ("u", "f")  # groups of signals of drives
SIGNALS_OF = {  # parts of a model -> groups of the signals that they have
    "outputs": ("out",), "controls": ("x",), "forces": ("force", *DRIVEN),
    "constraints": ("force",), "contacts": ("force",),
}  # fmt: skip
PASSED = ("x", *DRIVEN)  # groups of signals that may follow from others at once
MOST_NAMED = 8  # signals of a loop that a message lists
PATHS = {  # output -> what it follows from, which an expression in a force would have to wait for
    "accelerometer": "the accelerations", "force": "the joint forces", "torque": "the joint forces",
}  # fmt: skip


def expressions_of(part: Described) -> Iterator[tuple[str, int | None, str]]:
    """Yield (field, entry index or None, text) for each expression in a part."""
    for name, value in fields_of(part).items():
        if name == "name":
            continue
        if is_expression(value):
            yield name, None, value
        elif type(value) is tuple and str in map(type, value):
            yield from ((name, k, x) for k, x in enumerate(value) if is_expression(x))


def renamed_in(part: Described, names: Mapping[str, str], *groups: str) -> dict[str, Any]:
    """Return the fields of a part in which an expression names a renamed body or output."""
    found: dict[str, Any] = {}
    for name, k, text in expressions_of(part):
        new = with_names(text, names, groups)
        if new != text:
            old = found.get(name, getattr(part, name))
            found[name] = new if k is None else (*old[:k], new, *old[k + 1 :])
    return found


def groups_of(key: str, part: Any) -> tuple[str, ...]:
    """Return the groups of signals that a part of a model has, which is in the list `key`."""
    if key == "forces":
        if isinstance(part, OnJoint):
            return DRIVEN
        return ("x",) * isinstance(part, Stateful) + ("force",) * isinstance(part, TENSE)
    return SIGNALS_OF.get(key, ())


class Variable(NamedTuple):
    """The only variable of an expression, and a refusal of all others."""

    name: str
    signal: tuple[str, str, int] | None  # the same by its full name
    refusal: str


def variable_of(part: Described | None) -> Variable | None:
    """Return the only variable of the expressions in a part, or None if they have several."""
    if isinstance(part, Motion):
        return Variable(TIME, None, "a prescribed motion may only depend on t")
    if isinstance(part, Relation):
        signal = "q", part.other, part.other_coordinate
        full = written("q", part.other, part.other_coordinate or None)
        return Variable("q", signal, f"a relation may only depend on {full}, in short q")
    return None


class Known:
    """The names that expressions in a model may use."""

    def __init__(
        self, bodies: Bodies, outputs: Sequence[Output], controls: Sequence[Control],
        parameters: Mapping[str, float], forces: Sequence[Force],
        exerting: tuple[Sequence[str], Sequence[str]] = ((), ()), lost: Collection[str] = (),
        constraints: Sequence[Constraint] = (),
    ):  # fmt: skip
        """Collect the names.

        `exerting` contains the names of all constraints and contacts. `lost` contains the names of
        other, invalid parts, whose signals are always accepted.
        """
        self.bodies, self.parameters, self._exerting = bodies, parameters, exerting
        self._lost = lost
        self.drives = {f.name: f for f in forces if isinstance(f, OnJoint)}
        self._torques = {c.name: c for c in constraints if not c.pulls(bodies)}
        self._cables = {c.name: c for c in constraints if isinstance(c, Rope)}
        self._paths = {f.name: f for f in forces if isinstance(f, TENSE)}
        self._kinds = {f.name: f.own_kind() for f in forces}
        self.outputs = {o.name: o for o in outputs}
        self.controls: dict[str, Stateful] = {c.name: c for c in controls}
        self.controls |= {f.name: f for f in forces if isinstance(f, Stateful)}

    def dim(self, node: Node) -> Dim | None:
        """Return the dimension of a signal, None for a value of a control, which fits everything.

        Raises Unreadable for an unknown signal.
        """
        group, name, k = node.signal
        if name in self._lost and group in ("x", "out", "force", *DRIVEN):
            return None
        if group == "x":
            return self._of_control(node, name, k)
        if group in DRIVEN:
            return self._of_drive(node, group, name, k)
        if group == "out":
            return self._of_output(node, name, k)
        if group == "force":
            return self._of_force(node, name, k)
        return self._of_joint(node, name, k, group == "v")

    def _of_joint(self, node: Node, name: str, k: int, rate: bool) -> Dim:
        if name not in self.bodies:
            text = f"no body is named {shown(name)}; {nearest_name(name, self.bodies)}"
            raise Unreadable(node.column, text)
        body = self.bodies[name]
        if body is None:
            return Q
        if k >= body.dof:
            raise Unreadable(node.column, joints.no_coordinate(name, body.dof, k))
        places = joints.places(body.sequence)
        if not rate and places[k] is None:
            text = f"a {body.joint} joint has no single angle; use its rate, v[{shown(name)}][{k}]"
            along = [f"q[{shown(name)}][{i}]" for i, x in enumerate(places) if x is not None]
            text += f", or its positions, {choices(along)}" if along else ""
            raise Unreadable(node.column, text)
        return kinds_of(body)[k] / (S if rate else S / S)

    def _of_control(self, node: Node, name: str, k: int) -> None:
        control = self.controls.get(name)
        if control is None:
            do = nearest_name(name, self.controls) if self.controls else "the model has none"
            raise Unreadable(node.column, f"no control or muscle is named {shown(name)}; {do}")
        if k > (count := len(control.own)):
            text = f"{shown(name)} has entry 0 (its value) and states 1 to {count}, got {k}"
            raise Unreadable(node.column, f"{control.word()} {text}")

    def of(self, group: str) -> Mapping[str, Any]:
        """Return the parts by name that have signals of a group."""
        if group in DRIVEN:
            return self.drives
        names = dict.fromkeys(itertools.chain(*self._exerting, self._paths))
        of = {"out": self.outputs, "x": self.controls, "force": names}
        return of.get(group, self.bodies)

    def beside(self, forces: Sequence[Force]) -> Known:
        """Return the names including additional drives, for example of a scenario."""
        other = copy(self)
        other.drives = {**self.drives, **{f.name: f for f in forces if isinstance(f, OnJoint)}}
        other._paths = {**self._paths, **{f.name: f for f in forces if isinstance(f, TENSE)}}
        return other

    def _of_drive(self, node: Node, group: str, name: str, k: int) -> Dim | None:
        drive = self.drives.get(name)
        if drive is None:
            do = nearest_name(name, self.drives) if self.drives else "the model has none"
            if name in self.of("force"):
                do = f"write {written('force', name)} for the force of a contact or constraint"
                if name in self._paths:
                    do = f"write {written('force', name)} for the tension of a {self._kinds[name]}"
            text = f"no motor, servo or actuator is named {shown(name)}; {do}"
            raise Unreadable(node.column, text)
        if k:
            raise Unreadable(node.column, f"{group}.{name} is one number, got entry {k}")
        if group == "f" and drive.has_state:
            text = f"{shown(name)} has a lag or an integral of its own, whose torque no expression "
            raise Unreadable(node.column, f"{text}knows; give the lag to a control of kind filter")
        return wanted(drive, drive.INPUT if group == "u" else "torque", self.bodies)

    def _of_force(self, node: Node, name: str, k: int) -> Dim:
        known = self.of("force")
        if name not in known:
            do = nearest_name(name, known) if known else "the model has none"
            if name in self._kinds:
                do = f"it is a {self._kinds[name]}, whose force no expression reads"
            if name in self.drives:
                do = f"write {written('f', name)} for the torque or force of a drive"
            text = f"no contact, constraint, spring, strut or cable is named {shown(name)}; {do}"
            raise Unreadable(node.column, text)
        if len(of := self._named(name)) > 1:
            text = f"a {' and a '.join(of)} are both named {shown(name)}; rename one"
            raise Unreadable(node.column, text)
        if name in self._torques:
            raise Unreadable(node.column, without_force(self._torques[name]))
        strung = self._paths.get(name) or self._cables.get(name)
        if strung is not None:
            if k > (most := most_segments(strung)) or (k and most == 1):
                text = f"the tension of {shown(name)} is one number"
                if most > 1:
                    text = f"{strung.own_kind()} {shown(name)} has at most {most} segments, counted"
                    text += " from 1"
                raise Unreadable(node.column, f"{text}, got entry {k}")
        elif k > 3:
            text = f"the force of {shown(name)} has its size, 0, and entries from 1 to 3 along x, y"
            raise Unreadable(node.column, f"{text} and z, got {k}")
        return N

    def _named(self, name: str) -> list[str]:
        """Return what has a force by this name."""
        words = {"constraint": self._exerting[0], "contact": self._exerting[1]}
        found = [word for word, names in words.items() if name in names]
        return found + [self._kinds.get(name, "force")] * (name in self._paths)

    def _of_output(self, node: Node, name: str, k: int) -> Dim:
        output = self.outputs.get(name)
        if output is None:
            do = nearest_name(name, self.outputs) if self.outputs else "the model has none"
            raise Unreadable(node.column, f"no output is named {shown(name)}; {do}")
        if output.kind in PATHS or output.kind in OF_LOAD:
            text = f"an algebraic loop: out.{name} follows from {PATHS[output.kind]}, these from "
            raise Unreadable(node.column, f"{text}all forces, and they from this expression")
        if output.kind not in OF_JOINT:
            text = f"output {shown(name)} is read off the bodies after a run; name a coordinate, "
            raise Unreadable(node.column, f"{text}q.NAME or v.NAME, or an output of a joint")
        if k:
            raise Unreadable(node.column, f"output {shown(name)} is one number, got entry {k}")
        return self._of_joint(node, output.at, output.coordinate, output.kind == OF_JOINT[1])

    def problem(
        self, text: str, wanted: Dim | None, *, only: Variable | None = None, at_once: str = ""
    ) -> str:
        """Return the reason why an expression is invalid in a field of dimension `wanted`, or "".

        `only` is its only variable. `at_once` is the part that follows from it at the same instant,
        "" if it acts later.
        """
        try:
            tree = parsed(text)
            for node in walk(tree):
                self._check(node, only)
            found = dim_of(tree, self.dim)  # names of signals come first
            for node in walk(tree):
                if at_once and node.op == "signal" and node.signal[0] == "force":
                    force = written("force", node.signal[1])
                    loop = f"an algebraic loop: {force} -> {at_once} -> {force}, which follows"
                    do = "from all forces; read it in a control with samples"
                    if node.signal[1] in self._paths:
                        loop = f"{force} is measured after the forces of its instant, and {at_once}"
                        do = "acts among them; read it in a control with samples"
                    raise Unreadable(node.column, f"{loop} {do}")
        except Unreadable as error:
            return f"{shown(text)}: {error}"
        if found is None or wanted is None or fits(found, wanted):
            return ""
        return f"{shown(text)} gives {unit(found)}, not {unit(wanted)}; give it a factor"

    def _check(self, node: Node, only: Variable | None) -> None:
        variable = only.name if only else TIME
        name, known = node.signal[1], [*self.parameters, variable, *CONSTANTS]
        if node.op == "name" and name not in known:
            if only and name == TIME:
                raise Unreadable(node.column, only.refusal)
            hint = nearest_name(name, known)
            if name in self.bodies:
                hint = f"write q.{name} for its coordinate, v.{name} for its rate"
            raise Unreadable(node.column, f"unknown name {shown(name)}; {hint}")
        if node.op == "signal" and only and node.signal != only.signal:
            raise Unreadable(node.column, only.refusal)
        if node.op == "table":
            try:
                places = [float(constant(x, self.parameters)) for x in places_of(node)]
            except (ValueError, ArithmeticError):
                text = "the places of a table must be numbers or parameters"
                raise Unreadable(node.column, text) from None
            if any(not a < b for a, b in itertools.pairwise(places)):
                raise Unreadable(node.column, f"the places of a table must ascend, got {places}")


def without_force(constraint: Constraint) -> str:
    """Return the reason why nothing reads the force of a constraint that has a torque only."""
    text = f"constraint {shown(constraint.name)} of kind {constraint.kind} has a torque and no "
    text += "force here, and conditions and samples read forces only; read a coordinate, q.NAME or "
    return f"{text}v.NAME, or the torque of a motor or servo, f.NAME"


def kinds_of(body: Body) -> list[Dim]:
    """Return the dimension of each degree of freedom in a joint."""
    of = {"rad": RAD, "m": M}
    return [of[unit] for m in body.sequence for unit in joints.units_of(m)[1]]


def expression_problems(parts: Iterable[Described], known: Known, of: str = "") -> list[Problem]:
    """Return invalid names, units and motions in all expressions of the parts."""
    found = []
    for part in parts:
        for name, _, text in expressions_of(part):
            where = f"{of}{part.word()} {shown(getattr(part, 'name', ''))}"
            dim = wanted(part, name, known.bodies)
            now = at_once(part, name)
            if problem := known.problem(text, dim, only=variable_of(part), at_once=now):
                found.append(Problem(where, name, problem))
        if isinstance(part, PID) and not found and (problem := _error_problem(part, known)):
            found.append(Problem(f"{part.word()} {shown(part.name)}", "setpoint", problem))
    return found


def at_once(part: Described | None, name: str) -> str:
    """Return the quantity that depends on a field at the same time, or "" if it acts later.

    A condition, None, and the inputs of a control with samples act after that instant.
    """
    if part is None or (isinstance(part, Control) and getattr(part, "sample", None)):
        return ""
    return f"{part.word()} {shown(getattr(part, 'name', ''))}"


def _error_problem(part: PID, known: Known) -> str:
    """Return the reason why the units of the setpoint and the signal differ, or ""."""
    texts = [x for x in (part.signal, part.setpoint) if isinstance(x, str)]
    found = [dim for x in texts if (dim := dim_of(parsed(x), known.dim)) is not None]
    if len(found) < 2 or fits(*found):
        return ""
    return f"gives {unit(found[1])}, and the signal {unit(found[0])}; give one a factor"


def wanted(part: Described, name: str, bodies: Bodies) -> Dim | None:
    """Return the dimension of a field, given the coordinates on which the part acts."""
    dim = part._dim_of(name)
    if isinstance(part, Control):
        return None  # its numbers are gains, which have any unit
    if isinstance(part, Force) and name in part.ANY_UNIT:
        return None
    if not dim.coordinate:
        return dim
    terms = [(part.body, part.coordinate)] if isinstance(part, OfOne) else ()
    terms = [(body, k) for body, k, _ in part.terms] if isinstance(part, OfSums) else terms
    found = set[Dim]()
    for body, k in terms:
        own = bodies.get(body)
        found.add(kinds_of(own)[k] if own is not None and k < own.dof else Q)
    if len(found) != 1 or Q in found:
        return None
    return dim._replace(coordinate=0.0) * found.pop() ** dim.coordinate


def read_by(part: Described, outputs: Sequence[Output]) -> set[tuple[str, int]]:
    """Return (body, degree of freedom) for each joint that the expressions in a part read."""
    of = {o.name: (o.at, o.coordinate) for o in outputs}
    named = {signal for _, _, text in expressions_of(part) for signal in signals_in(text)}
    return {
        of.get(name, (name, k)) if group == "out" else (name, k)
        for group, name, k in named if group in ("q", "v", "out")
    }  # fmt: skip


def read_through(part: Described, controls: Sequence[Control]) -> list[Control]:
    """Return the controls that a part reads, also through others."""
    known, found = {c.name: c for c in controls}, dict[str, Control]()
    left = controls_read(part)
    while new := (left & known.keys()) - found.keys():
        name = new.pop()
        found[name] = known[name]
        left |= controls_read(known[name])
    return list(found.values())


def controls_read(part: Described) -> set[str]:
    """Return the controls that the expressions in a part read."""
    return named_in(part, "x")


def drives_read(part: Described) -> set[str]:
    """Return the drives whose input or torque the expressions in a part read."""
    return named_in(part, *DRIVEN)


def texts_of(model: Any) -> list[str]:
    """Return the expressions in the parts of a model, also of scenarios."""
    parts = [*model.forces, *model.constraints, *model.contacts, *model.controls]
    parts += [f for s in model.scenarios for f in s.forces]
    holds = [x.when.holds for s in model.scenarios for x in s.switches if x.when and x.when.holds]
    return [text for part in parts for _, _, text in expressions_of(part)] + holds


def named_in(part: Described, *groups: str) -> set[str]:
    """Return the names in the expressions of a part that belong to these groups of signals."""
    signals = (signal for _, _, text in expressions_of(part) for signal in signals_in(text))
    return {name for group, name, _ in signals if group in groups}


def loop_problems(controls: Sequence[Control], forces: Sequence[Force], of: str) -> list[Problem]:
    """Return the algebraic loops among values that follow from each other without a state."""
    reads: dict[str, tuple[PID | OnJoint, str, list[str]]] = {}
    for c in controls:
        if isinstance(c, PID) and not c.sample:
            reads[written("x", c.name)] = c, "signal", _followed(c.signal, c.setpoint)
    for f in forces:
        if isinstance(f, OnJoint):
            given = getattr(f, f.INPUT)
            reads[written("u", f.name)] = f, f.INPUT, _followed(given)
            reads[written("f", f.name)] = f, f.INPUT, _followed(given, f.torque)
    done = set[str]()
    for first in reads:
        path, left = [first], [iter(reads[first][2])]
        while left:
            name = next(left[-1], None)
            if name is None:
                done.add(path.pop())
                left.pop()
            elif name in path:
                part, field, _ = reads[name]
                round_ = (*path[path.index(name) :], name)
                if len(round_) > MOST_NAMED:
                    round_ = (*round_[: MOST_NAMED - 2], "...", *round_[-2:])
                loop = " -> ".join(round_)
                text = f"an algebraic loop: {loop}; put a filter or a state between them"
                return [Problem(f"{of}{part.word()} {shown(part.name)}", field, text)]
            elif name in reads and name not in done:
                path.append(name)
                left.append(iter(reads[name][2]))
    return []


def _followed(*values: Any) -> list[str]:
    """Return the signals in expressions that may depend on other signals."""
    signals = (signal for text in values if isinstance(text, str) for signal in signals_in(text))
    return sorted({written(group, name) for group, name, k in signals if group in PASSED and not k})
