"""Hints for an expression that is typed: the names it may use, its unit and its present value."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import Field

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.errors import shown
from pgraph_core.model.expressions import (
    SIGNALS_OF,
    Known,
    at_once,
    loop_problems,
    variable_of,
    wanted,
)
from pgraph_core.model.output import OF_JOINT
from pgraph_core.model.parameters import evaluated
from pgraph_core.paper import bodies_of, q_slices, v_slices
from pgraph_core.signals import Node, Unreadable, parsed, written
from pgraph_core.signals.grammar import FUNCTIONS, TAKES
from pgraph_core.signals.meaning import CONSTANTS, TIME, compares, constant, dim_of, unit
from pgraph_core.units import Dim

from .. import constraints
from ..constraints import Part
from ..constraints.parts import known_of as known_of
from ..core.events import FromPage, Text
from ..core.state import with_client
from ..pose.solving import shown_q, shown_v

MOST_WORDS = 8  # completions in a list
WORD = re.compile(r"""(?:\b(?P<group>q|v|x|u|f|out|force)(?:\.|\[["']?))?(?P<name>\w*)$""")
MEASURED = {
    "q": "position of", "v": "speed of", "x": "control", "out": "output", "u": "input of",
    "f": "torque or force of", "force": "force of",
}  # fmt: skip


class Word(NamedTuple):
    """A completion and its meaning."""

    text: str
    about: str


@dataclass(frozen=True)
class Hint:
    """Hint beside an expression while it is typed."""

    serial: int
    problem: str = ""
    unit: str = ""  # unit expected by the cell
    value: str = ""  # at the pose and time shown
    words: tuple[Word, ...] = ()
    start: int = 0  # place in the text at which a word begins
    put: str = ""  # the signal of what was clicked


@dataclass(frozen=True)
class Moment:
    """The time and the coordinates that a page shows."""

    t: float
    q: Mapping[str, Sequence[float]]
    v: Mapping[str, Sequence[float]]


class Vocabulary:
    """The names that an expression in one cell may use, with their present values.

    `item` is the part that the expression belongs to, None for a condition. If `varies` is false,
    only constant formulas of parameters are accepted.
    """

    def __init__(self, model: pg.Model, moment: Moment, item: Any, field: str, varies: bool):
        self._known, self._model, self._field = known_of(model), model, field
        self._moment, self._item, self._varies = moment, item, varies
        self._only = variable_of(item)
        field = "q_of_t" if isinstance(item, pg.Motion) else field
        if item is not None and field in type(item).model_fields:
            self.wanted: Dim | None = wanted(item, field, self._known.bodies)
        else:
            self.wanted = None

    def hint(self, serial: int, text: str, caret: int) -> Hint:
        """Return completions and information for a text with the caret at a given position."""
        start, words = self._completions(text[:caret])
        problem = value = ""
        if text.strip() != "=":
            problem, value = self._judged(text)
        expected = unit(self.wanted) if self.wanted is not None else ""
        return Hint(serial, problem, expected, value, words, start)

    def _judged(self, text: str) -> tuple[str, str]:
        """Return the error of an expression, or its current value."""
        try:
            if not self._varies:
                return "", f"{evaluated(text, self._known.parameters):.6g}"
            tree = parsed(text)
            if self._item is None and not compares(tree):
                return "must compare, as in q.arm > 0.5", ""
            now = at_once(self._item, self._field)
            problem = self._known.problem(text, self.wanted, only=self._only, at_once=now)
            problem = problem or looped(self._model, self._item, self._field, text)
            return problem.removeprefix(f"{shown(text)}: "), "" if problem else self._value(tree)
        except ValueError as error:
            return str(error), ""

    def _value(self, tree: Node) -> str:
        """Return the present value of an expression as text."""
        parameters = {TIME: self._moment.t, **self._known.parameters}
        if self._only and self._only.signal:
            full = Node("signal", signal=self._only.signal)
            parameters = {self._only.name: self._read(full), **parameters}
        try:
            found = constant(tree, parameters, self._read)
        except (ArithmeticError, ValueError) as error:
            return f"none ({error})"
        if isinstance(found, bool):
            return "true" if found else "false"
        if isinstance(found, float) and math.isnan(found):
            return ""
        if isinstance(found, complex) or not math.isfinite(found):
            return "none"
        dim = dim_of(tree, self._known.dim)
        return f"{found:.6g} {_unit_of(self.wanted if dim is None else dim)}".strip()

    def _read(self, node: Node) -> float:
        """Return the present value of a signal."""
        group, name, k = node.signal
        if group == "out":
            output = self._known.outputs[name]
            name, k = output.at, output.coordinate
            group = "q" if output.kind == OF_JOINT[0] else "v"
        if group in ("x", "u", "f", "force"):
            return math.nan  # runs alone know it
        if group == "v":
            return self._moment.v[name][k]
        body = self._known.bodies[name]
        place = joints.places(body.sequence)[k] if body is not None else None
        return math.nan if place is None else self._moment.q[name][place]

    def _completions(self, typed: str) -> tuple[int, tuple[Word, ...]]:
        """Return the start of the word before the cursor and its completions.

        Names that start with the typed text come first, followed by names that contain it.
        """
        found = WORD.search(typed)
        assert found is not None  # possibly empty
        group, name, start = found["group"], found["name"].lower(), found.start()
        before = typed[:start].rstrip()[-1:]
        operand = not found[0] and (before.isalnum() or before in ('"', "]", ")", "_", "."))
        if "=" not in typed or operand or (not group and name[:1].isdigit()):
            return start, ()
        known = [(of, called) for of, called in self._names() if group in (None, of)]
        ranks = [
            0 if called.lower().startswith(name) else 1 if name in called.lower() else 2
            for _, called in known
        ]
        chosen = (known[i] for rank in (0, 1) for i, at in enumerate(ranks) if at == rank)
        words = tuple(islice((word for one in chosen for word in self._words(*one)), MOST_WORDS))
        if words and words[0].text == found[0]:
            return start, ()  # the name is complete
        return start, words

    def _names(self) -> Iterator[tuple[str, str]]:
        """Yield (group, name) for all that an expression in the cell may use."""
        known = self._known
        signal = self._only.signal if self._only else None
        if signal is not None:
            yield signal[:2]
        elif self._varies and self._only is None:
            yield from _measured(known)
        timed = self._varies and signal is None
        named = [*([TIME] if timed else []), *known.parameters, *CONSTANTS]
        yield from (("", name) for name in dict.fromkeys(named))
        yield from (("(", name) for name in FUNCTIONS)

    def _words(self, group: str, name: str) -> Iterator[Word]:
        """Yield the text for a name, one entry per joint coordinate."""
        if group == "(":
            yield Word(f"{name}(", TAKES.get(name, "a function of one number"))
        elif group:
            for text in signals_of(self._known, group, name):
                node = parsed(text)
                now = self._read(node)
                value = f", now {now:.4g} {_unit_of(self._known.dim(node))}" if now == now else ""
                yield Word(text, f"{MEASURED[group]} {name}{value}")
        elif name in self._known.parameters or name != TIME:
            value = self._known.parameters.get(name, CONSTANTS.get(name))
            yield Word(name, f"{value:.6g}")
        else:
            yield Word(name, f"time, now {self._moment.t:.4g} s")


def _measured(known: Known) -> Iterator[tuple[str, str]]:
    """Yield (group, name) of all that is measured."""
    for group in MEASURED:
        names = known.of(group)
        yield from ((group, name) for name in names)


def all_signals(known: Known) -> list[str]:
    """Return all signals, as expressions name them."""
    return [x for group, name in _measured(known) for x in signals_of(known, group, name)]


def spoken(text: str) -> str:
    """Return the description of a signal, such as "speed of arm"."""
    group, name, k = parsed(text).signal
    return f"{MEASURED[group]} {name}" + (f", {k}" if k else "")


def signals_of(known: Known, group: str, name: str) -> list[str]:
    """Return the signals of a body, control, output or drive."""
    count = 1
    if group in ("q", "v"):
        body = known.bodies[name]
        count = 0 if body is None else body.dof
    found = []
    for k in range(count):
        text = written(group, name, k if count > 1 else None)
        try:
            known.dim(parsed(text))
        except Unreadable:
            continue
        found.append(text)
    return found


def _unit_of(dim: Dim | None) -> str:
    return "" if dim is None or dim == Dim() else unit(dim)


def looped(model: pg.Model, item: Any, field: str, text: str) -> str:
    """Return the algebraic loop that an expression in a field of a part would close, or ""."""
    if item is None or field not in type(item).model_fields:
        return ""
    new = item.unchecked_copy({field: text})
    controls = [new if x is item else x for x in model.controls]
    forces = [new if x is item else x for x in model.forces]
    return next((problem.text for problem in loop_problems(controls, forces, "")), "")


def clicked(
    model: pg.Model, serial: int, part: str, name: str, rate: bool, item: Any, field: str
) -> Hint:
    """Return the signal of the clicked object, or why a field of `item` cannot use it."""
    known = known_of(model)
    if part == "bodies" and name in known.bodies:
        found = [x for group in ("vq" if rate else "qv") for x in signals_of(known, group, name)]
        problem = f"the joint of '{name}' does not move"
        return Hint(serial, put=found[0]) if found else Hint(serial, problem)
    groups = (group for group in reversed(SIGNALS_OF.get(part, ())) if name in known.of(group))
    if group := next(groups, ""):
        text = written(group, name)
        problem = known.problem(f"={text}", None, at_once=at_once(item, field))
        problem = problem.partition(": ")[2] or looped(model, item, field, f"={text}")
        return Hint(serial, problem, put="" if problem else text)
    body = next((x.body for x in getattr(model, part, ()) if getattr(x, "name", "") == name), "")
    hint = f"; click body '{body}'" if body in known.bodies else ""
    return Hint(serial, f"'{name}' has no coordinate that an expression can read{hint}")


@dataclass(frozen=True)
class Client(constraints.Client):
    hint: Hint | None = None  # hint for the expression being typed

    def afresh(self) -> Self:
        return replace(super().afresh(), hint=None)

    def again(self, fresh: Any) -> Self:
        return replace(super().again(fresh), hint=fresh.hint)


@dataclass(frozen=True)
class State(constraints.State):
    clients: Mapping[int, Client] = field(default_factory=dict)


# -- questions about an expression that is typed on a page (pure) ----------------------------------


class AskHint(FromPage):
    """An expression was typed into a cell of a part, of a switch, or of any other row ("")."""

    serial: int
    part: Part | Literal["switches", ""]
    name: Text
    cell: Text
    text: Text
    caret: Annotated[int, Field(ge=0)]

    def applied(self, state: State) -> State:
        item = _item(state.model, self.part, self.name)
        varies = item is not None or self.part == "switches"
        words = Vocabulary(state.model, moment(state), item, self.cell, varies)
        found = words.hint(self.serial, self.text, self.caret)
        return with_client(state, self.client, hint=found)


def _item(model: pg.Model, part: str, name: str) -> Any:
    """Return the part that an expression belongs to, also a force of a scenario, or None."""
    parts = [*getattr(model, part)] if part not in ("", "switches") else []
    if part == "forces":
        parts += [f for s in model.scenarios for f in s.forces]
    return next((x for x in parts if x.name == name), None)


def moment(state: State) -> Moment:
    """Return the time and the coordinates of the pose shown."""
    bodies = bodies_of(state.whole, pg.Topology.of(state.whole))
    q, v = shown_q(state).tolist(), shown_v(state)
    rates = [x for body in bodies for x in body.v] if v is None else v.tolist()
    return Moment(
        state.playback.time if state.run is not None else 0.0,
        {body.name: q[place] for body, place in zip(bodies, q_slices(bodies))},
        {body.name: rates[place] for body, place in zip(bodies, v_slices(bodies))},
    )


class PickSignal(FromPage):
    """A part was clicked while an expression is typed in a cell of another part, or of a switch.

    `rate` asks for the speed of a body.
    """

    serial: int
    part: Part | Literal["bodies"]
    name: Text
    rate: bool
    of: Part | Literal["switches", ""]
    owner: Text
    cell: Text

    def applied(self, state: State) -> State:
        item = _item(state.model, self.of, self.owner)
        clicks = self.part, self.name, self.rate
        found = clicked(state.model, self.serial, *clicks, item, self.cell)
        return with_client(state, self.client, hint=found)
