"""Conditions of the switches of a scenario, as form cells and as edits (pure).

A condition that compares expressions is displayed as text. If all comparisons are combined by
`and`, or all by `or`, each comparison also has its own row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import pgraph_core as pg
from pgraph_core.model.scenario import coordinates, known_names
from pgraph_core.signals import Node, parsed, written
from pgraph_core.signals.meaning import TIME

from ..constraints.parts import unit_of_signal
from ..core import cells
from ..core.cells import (
    Display,
    Payload,
    Quantity,
    Refusal,
    button,
    cell,
    field,
    quantity_in,
    shown,
)
from ..core.events import Entries
from ..properties.body_cells import quantity_of
from ..signals import all_signals, known_of
from . import OFF, ON, acting, put

HOLDS = "holds"
WAITS = {  # labels of triggers of switches
    TIME: "at a time",
    "coordinate": "a coordinate",
    "gap": "a gap",
    "force": "a force",
    "constraint": "a constraint",
    HOLDS: "comparisons",
}
OF_VALUE = {TIME: "s", "gap": "length", "force": "N"}  # units; those of coordinates differ
SIDES = {"above": ">", "below": "<"}
OF_OPERATION = {"more": "above", "at_least": "above", "less": "below", "at_most": "below"}
TIMES = {"": "each time", "once": "the first time only"}  # labels of how often a switch acts
DELAY = 0.1  # part of the run after which a constraint that went on goes off again
BACK = 0.2  # part of its value by which a switch back lies on the other side


def names_of(model: pg.Model, what: str) -> list[str]:
    """Return the names that a condition of this kind may use."""
    if what in (TIME, HOLDS):
        return []
    known = known_names(
        {body.name: body for body in model.bodies},
        [c.name for c in model.constraints],
        [c.name for c in model.contacts],
        model.forces,
    )
    if what not in known:
        raise Refusal(f"A switch cannot wait for that kind: choose one of {', '.join(known)}.")
    return list(known[what])


def waits_of(switch: pg.Switch) -> tuple[str, str]:
    """Return (the kind of event a switch waits for, its name)."""
    return (TIME, "") if switch.when is None else switch.when.subject


def unit_of(model: pg.Model, switch: pg.Switch) -> str:
    """Return the unit of a condition's value. "angle" and "length" follow the units of the page."""
    what, name = waits_of(switch)
    if what != "coordinate":
        return OF_VALUE.get(what, "")
    body, k = coordinates({body.name: body for body in model.bodies}).get(name, ("", 0))
    of = quantity_of(model.body(body), "q", (k,)) if body else "number"
    return of if of != "number" else ""


def value_of(switch: pg.Switch) -> float | None:
    """Return the threshold of a switch, or None."""
    if switch.when is None:
        return switch.t
    return switch.when.above if switch.when.above is not None else switch.when.below


def side_of(switch: pg.Switch) -> str:
    """Return "above" or "below" for a value, "on" or "off" for a constraint, or "" for others."""
    when = switch.when
    if when is None or when.holds is not None:
        return ""
    if when.active is not None:
        return ON if when.active else OFF
    return "above" if when.above is not None else "below"


# -- comparisons -----------------------------------------------------------------------------------


class Clause(NamedTuple):
    """A comparison of a signal with a number."""

    signal: str
    side: str  # "above" or "below"
    value: float
    negated: bool = False

    def __str__(self) -> str:
        text = f"{self.signal} {SIDES[self.side]} {self.value!r}"
        return f"not {text}" if self.negated else text


def clauses(model: pg.Model, text: str) -> tuple[str, list[Clause]]:
    """Return ("and" or "or", its comparisons), or no comparisons if there are others too."""
    tree = parsed(text)
    joiner = tree.op if tree.op in ("and", "or") else "and"
    found = [_clause(model, node) for node in _joined(tree, joiner)]
    return joiner, [] if None in found else [one for one in found if one is not None]


def _joined(node: Node, joiner: str) -> list[Node]:
    if node.op != joiner:
        return [node]
    return [one for part in node.args for one in _joined(part, joiner)]


def _clause(model: pg.Model, node: Node) -> Clause | None:
    if node.op == "not":
        inner = _clause(model, node.args[0])
        return None if inner is None or inner.negated else inner._replace(negated=True)
    if node.op not in OF_OPERATION:
        return None
    left, right = node.args
    sign, number = (-1, right.args[0]) if right.op == "neg" else (1, right)
    group, name, k = left.signal
    if number.op != "number" or (left.op != "signal" and (left.op, name) != ("name", TIME)):
        return None
    several = group in ("q", "v") and name in model.row and model.body(name).dof > 1
    signal = written(group, name, k if several else None) if group else name
    return Clause(signal, OF_OPERATION[node.op], sign * number.value)


def text_of(joiner: str, found: Sequence[Clause]) -> str:
    """Return the expression that comparisons make."""
    return "=" + f" {joiner} ".join(map(str, found))


def _signals(model: pg.Model) -> list[str]:
    """Return the names that are allowed in the comparisons of a condition."""
    return [*all_signals(known_of(model)), TIME]


# -- forms -----------------------------------------------------------------------------------------


def form(model: pg.Model, switch: pg.Switch, display: Display) -> list[Payload]:
    """Return the fields of a switch, including its constraint and its condition."""
    what, watched = waits_of(switch)
    names = [c.name for c in model.constraints]
    out = button("×", "DeleteSwitch", "Delete this switch")
    found = [
        _row("constraint", "Switch", [
            cell((0,), switch.constraint, called="constraint that is switched", options=names),
            cell((1,), ON if switch.active else OFF, called="on or off", options=[ON, OFF]),
        ], buttons=[out]),
        _row("what", "when", [cell((), what, options=list(WAITS.items()))]),
    ]  # fmt: skip
    if switch.when is not None:
        often = cell((), "once" if switch.when.once else "", options=list(TIMES.items()))
        found.append(_row("once", "acts", [often]))
    if what == HOLDS:
        return [*found, *_comparisons(model, watched, display)]
    if what != TIME:
        found.append(_row("watched", "of", [cell((), watched, options=names_of(model, what))]))
    if what == "constraint":
        assert switch.when is not None
        since = "" if switch.when.after is None else switch.when.after
        found += [
            _row("side", "is", [cell((), side_of(switch), options=[ON, OFF])]),
            field("after", "for", [cell((), since)], unit="s", help="empty: at once"),
        ]
        return found
    unit, value = unit_of(model, switch), value_of(switch)
    amount = cell((1,), shown(value, quantity_in(unit), display), called="value", kind="number")
    unit = display.unit(quantity_in(unit)) or unit
    if what == TIME:
        return [*found, field("value", "at", [amount | {"index": []}], unit=unit)]
    side = cell((0,), side_of(switch), called="above or below", options=list(SIDES))
    more = [_press("Back …", "back", "Add a switch back beyond a second value")]
    if what == "coordinate":
        more.insert(0, _press("And …", "and", "Waits for another comparison too"))
    value = _row("value", "is", [side, amount], unit=unit)
    return [*found, value, field("more", "", [], buttons=more)]


def _row(name: str, label: str, each: list[Payload], **more: Any) -> Payload:
    return field(name, label, each, kind="choice", columns=len(each), **more)


def _press(text: str, name: str, title: str, *index: int) -> Payload:
    return button(text, "", title, field=name, index=list(index), text="")


def _comparisons(model: pg.Model, text: str, display: Display) -> list[Payload]:
    """Return the text of a condition, and a row for each of its comparisons."""
    whole = field(HOLDS, "", [cell((), text)], kind="text", expression=True, columns=1,
                  help="comparisons of q.arm, v.arm, t, joined by and, or, not")  # fmt: skip
    joiner, known = clauses(model, text)
    options, rows = _signals(model) if known else [], []
    for k, one in enumerate(known):
        unit = OF_VALUE.get(one.signal) or unit_of_signal(model, one.signal)
        value = shown(one.value, quantity_in(unit), display)
        row = [
            cell((k, 0), one.signal, called="signal", options=options, span=2),
            cell((k, 1), one.side, called="above or below", options=list(SIDES), span=2),
            cell((k, 2), value, called="value", kind="number", span=2),
        ]
        label = (joiner if k else "if") + (" not" if one.negated else "")
        unit = display.unit(quantity_in(unit)) or unit
        out = [_press("×", "less", "Take this comparison out", k)] if len(known) > 1 else []
        turn = _press("not", "not", "The opposite of this comparison", k)
        rows.append(_row("clause", label, row, unit=unit, buttons=[turn, *out]))
    joins = [joiner] if len(known) > 1 else ["and", "or"] if known else []
    more = [_press(f"{word.capitalize()} …", word, "One more comparison") for word in joins]
    return [whole, *rows, field("more", "", [], buttons=more)] if known else [whole]


# -- edits -----------------------------------------------------------------------------------------


def switch_edited(
    model: pg.Model, name: str, number: int, what: str, entries: Entries, display: Display
) -> pg.Model:
    """Return the model with cells of a switch changed. Raises Refusal, PgraphError."""
    s = model.scenario(name)
    if number >= len(s.switches):
        raise Refusal("This switch no longer exists.")
    old = new = s.switches[number]
    for index, text in entries:
        new = _edited(model, s, new, what, index, text, display)
    if new.t is not None and new.t >= s.t_end:
        raise Refusal(
            f"The run ends at {s.t_end:g} s: give a time before that, or a longer duration."
        )
    more = [_back(old)] if what == "back" else []
    switches = (*s.switches[:number], new, *more, *s.switches[number + 1 :])
    return put(model, name, switches=switches)


def _edited(
    model: pg.Model, s: pg.Scenario, old: pg.Switch, what: str, index: tuple[int, ...], text: str,
    display: Display,
) -> pg.Switch:  # fmt: skip
    waits, watched = waits_of(old)
    match what:
        case "constraint" if index == (1,):
            return _with(old, active=text == ON)
        case "constraint":
            return _with(old, constraint=text)
        case "what" if text == TIME:
            return _with(old, t=s.t_end / 2, when=None)
        case "what":
            return _with(old, t=None, when=_usual(model, s, old, text))
        case "back":
            return old
        case "value" if waits == TIME:
            return _with(old, t=_number("time", text, "number", display))
    if old.when is None:
        raise Refusal("The switch waits for a time and has no condition: choose a condition first.")
    match what:
        case "once":
            return _with(old, when={**_when(old), "once": bool(text) or None})
        case "watched":
            return _with(old, when={**_when(old), waits: text})
        case "side":
            return _with(old, when={**_when(old), "active": text == ON})
        case "after":
            since = _number("time", text, "number", display) if text.strip() else None
            return _with(old, when={**_when(old), "after": since})
        case "value" if index == (0,):
            return _with(old, when={waits: watched, text: value_of(old)})
        case "value":
            value = _number("value", text, quantity_in(unit_of(model, old)), display)
            return _with(old, when={waits: watched, side_of(old): value})
        case "holds":
            return _with(old, when={HOLDS: text.strip()})
        case "clause" | "not" | "less" | "and" | "or":
            return _with(old, when={HOLDS: _compared(model, old, what, index, text, display)})
    raise Refusal("The switch no longer has this field.")


def _compared(
    model: pg.Model, old: pg.Switch, what: str, index: tuple[int, ...], text: str, display: Display
) -> str:
    """Return the expression of a condition after an edit of one of its comparisons."""
    waits, watched = waits_of(old)
    if waits == "coordinate":
        body, k = coordinates({body.name: body for body in model.bodies})[watched]
        signal = written("q", body, k if model.body(body).dof > 1 else None)
        joiner, found = what, [Clause(signal, side_of(old), value_of(old) or 0.0)]
    elif waits == HOLDS:
        joiner, found = clauses(model, watched)
    else:
        raise Refusal("A switch compares positions, speeds and time: choose them first.")
    if what in ("and", "or"):
        joiner = what if len(found) == 1 else joiner
        return text_of(joiner, [*found, _next(model, found)])
    if not index or index[0] >= len(found):
        raise Refusal("This comparison no longer exists.")
    k = index[0]
    one = found[k]
    match what, index[1:]:
        case "not", _:
            changed = [one._replace(negated=not one.negated)]
        case "less", _:
            changed = []
        case _, (0,):
            changed = [one._replace(signal=text)]
        case _, (1,) if text in SIDES:
            changed = [one._replace(side=text)]
        case _:
            of = quantity_in(OF_VALUE.get(one.signal) or unit_of_signal(model, one.signal))
            changed = [one._replace(value=_number("value", text, of, display))]
    return text_of(joiner, [*found[:k], *changed, *found[k + 1 :]])


def _next(model: pg.Model, found: Sequence[Clause]) -> Clause:
    """Return another comparison, for the speed of the previous signal or the first signal."""
    last = found[-1].signal if found else ""
    known = _signals(model)
    speed = "v" + last[1:] if last.startswith("q") else last
    return Clause(speed if speed in known else known[0], "above", 0.0)


def _number(what: str, text: str, of: Quantity, display: Display) -> float:
    try:
        return cells.quantity(text, of, display)
    except Refusal as refusal:
        raise Refusal(f"The {what} {refusal}") from None


def _with(old: pg.Switch, **fields: Any) -> pg.Switch:
    kept = {"t": old.t, "constraint": old.constraint, "active": old.active, "when": old.when}
    if "when" in fields:
        kept["t"] = None
        if old.when is not None and old.when.once and fields["when"]:
            fields["when"] = {"once": True, **fields["when"]}
    return pg.Switch(**{**kept, **fields})


def _when(switch: pg.Switch) -> dict[str, Any]:
    """Return the fields of the condition that are set."""
    assert switch.when is not None
    return {key: x for key, x in switch.when.model_dump().items() if x is not None}


def _back(switch: pg.Switch) -> pg.Switch:
    """Return the reverse switch, which triggers at a second threshold. Together they are a
    hysteresis.

    The second value lies BACK of the first one away from it.
    """
    (what, watched), value, side = waits_of(switch), value_of(switch), side_of(switch)
    if value is None or side not in SIDES:
        raise Refusal("The switch waits for no value at which it could switch back.")
    band = BACK * (abs(value) or 1.0)
    bound = {"below": value - band} if side == "above" else {"above": value + band}
    return _with(switch, active=not switch.active, when={what: watched, **bound})


def with_switch(
    model: pg.Model, name: str, constraint: str | None, when: tuple[str, str] | None = None
) -> pg.Model:
    """Add a switch that toggles the constraint in the middle of the run.

    If `when` is (body, "touches", "leaves", "passes" or "exceeds"), the switch triggers on this
    condition.
    """
    s = model.scenario(name)
    if not model.constraints:
        raise Refusal("No constraint to switch: add one in Connections.")
    state = dict(acting(model, s, "constraints"))
    own = [c.name for c in model.constraints if when and when[0] in c.touches]
    first = constraint if constraint in state else next(iter([*own, *state]))
    active = not state[first]
    for known in s.switches:
        if known.constraint == first:
            active = not known.active
    if when:
        new = pg.Switch(constraint=first, active=active, when=_of_body(model, first, active, *when))
        return put(model, name, switches=(*s.switches, new))
    taken = {x.t for x in s.switches if x.constraint == first}
    t = next(x for x in (s.t_end * k / 64 for k in (32, *range(1, 64))) if x not in taken)
    return put(model, name, switches=(*s.switches, pg.Switch(t=t, constraint=first, active=active)))


def without_switch(model: pg.Model, name: str, number: int) -> pg.Model:
    """Return the scenario without a switch."""
    switches = model.scenario(name).switches
    return put(model, name, switches=(*switches[:number], *switches[number + 1 :]))


def _usual(model: pg.Model, s: pg.Scenario, switch: pg.Switch, what: str) -> Mapping[str, Any]:
    """Return a default condition that can occur. Raises Refusal if there is none."""
    names = names_of(model, "coordinate" if what == HOLDS else what)
    if what == "force" and switch.active:
        names = [name for name in names if name != switch.constraint]  # while off it carries none
    if not names:
        there = {"gap": "contact", "force": "contact, constraint or spring", HOLDS: "coordinate"}
        raise Refusal(f"There is no {there.get(what, what)} to wait for.")
    match what:
        case "constraint":
            own = switch.constraint
            goes = (own, switch.active)
            moved = [x for x in s.switches if (x.constraint, x.active) != goes]
            if not moved:
                raise Refusal("No other switch is there to wait for: add it first.")
            last = moved[-1]
            delay = {"after": DELAY * s.t_end} if last.constraint == own else {}  # not at once
            return {what: last.constraint, "active": last.active, **delay}
        case "coordinate":
            return {what: names[0], "above": _ahead(model, names[0])}
        case "holds":
            body, k = coordinates({body.name: body for body in model.bodies})[names[0]]
            signal = written("q", body, k if model.body(body).dof > 1 else None)
            return {what: text_of("and", [Clause(signal, "above", _ahead(model, names[0]))])}
        case "gap":
            return {what: names[0], "below": 0.0}
    own = switch.constraint if not switch.active else names[0]
    return {"force": own, "above": 50.0}


def _of_body(model: pg.Model, switched: str, active: bool, body: str, what: str) -> dict[str, Any]:
    """Return the condition that a body "touches", "leaves", "passes" or "exceeds" a value."""
    contacts = [c.name for c in model.contacts if body in c.touches]
    places = coordinates({one.name: one for one in model.bodies})
    moves = [name for name, (of, _) in places.items() if of == body]
    held = [c.name for c in model.constraints if body in c.touches]
    carries = [*([switched] if not active and switched in held else []), *contacts, *held]
    needed = {"passes": (moves, "joint with coordinates"), "exceeds": (carries, "constraint")}
    names, word = needed.get(what, (contacts, "contact"))
    if not names:
        raise Refusal(f"'{body}' has no {word}: a switch cannot wait for it.")
    match what:
        case "touches":
            return {"gap": names[0], "below": 0.0}
        case "leaves":
            return {"gap": names[0], "above": 0.0}
        case "passes":
            return {"coordinate": names[0], "above": _ahead(model, names[0])}
    return {"force": names[0], "above": 50.0}


def _ahead(model: pg.Model, name: str) -> float:
    """Return a coordinate value ahead of the initial one and within the limit."""
    body_name, k = coordinates({body.name: body for body in model.bodies})[name]
    body = model.body(body_name)
    limit = body.limits[k] if k < len(body.limits) else None
    high = limit[1] if limit else None
    return body.q[k] + 0.1 if high is None else (body.q[k] + high) / 2
