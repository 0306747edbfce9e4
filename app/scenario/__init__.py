"""The scenario chosen for the run: its initial state, forces, switches and edits (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pgraph_core as pg
from pgraph_core.joints import KINDS
from pgraph_core.model.editing import free_name
from pgraph_core.model.scenario import coordinates, known_names

from ..constraints import Client as Client
from ..constraints import State as State
from ..core import cells
from ..core.cells import Display, Quantity, Refusal
from ..run import Request

TIME = "t"  # trigger of a switch without a condition
WAITS = {  # labels of triggers of switches
    TIME: "at a time",
    "coordinate": "a coordinate is",
    "gap": "a gap is",
    "force": "a force is",
    "constraint": "a constraint is",
}
UNITS = {TIME: "s", "gap": "length", "force": "N"}
ON, OFF = "on", "off"


def first_name(model: pg.Model) -> str:
    """Return a scenario name that is not yet in use."""
    return free_name("scenario", [s.name for s in model.scenarios])


def made(model: pg.Model, request: Request) -> tuple[pg.Model, str]:
    """Return a model with a new scenario equivalent to the free run, and the scenario's name."""
    name = first_name(model)
    new = pg.Scenario(name=name, t_end=request.t_end, step=request.step, method=request.method)
    return model.add(new), name


def copied(model: pg.Model, name: str) -> tuple[pg.Model, str]:
    """Return a model with a copy of a scenario, and the name of the copy. Raises PgraphError."""
    new = free_name(name, [s.name for s in model.scenarios])
    return model.add(model.scenario(name).unchecked_copy({"name": new})), new


def put(model: pg.Model, name: str, /, **fields: Any) -> pg.Model:
    """Return the model with changed fields of a scenario. Raises PgraphError."""
    model.scenario(name)
    return model.edit(name, kind="scenario", **fields)


# -- the run and the initial state -----------------------------------------------------------------


def quantities(body: pg.Body, field: str) -> list[Quantity]:
    """Return the quantity of each number of a joint's q. Rates are in SI units."""
    shown: dict[str, Quantity] = {"rad": "angle", "m": "length"}
    kinds = [KINDS[motion.kind] for motion in body.sequence]
    if field == "v":
        return ["number" for kind in kinds for _ in kind.v]
    single = [(unit, len(kind.q) == 1) for kind in kinds for unit in kind.q]
    return [shown[unit] if alone else "number" for unit, alone in single]


def changed(
    model: pg.Model, name: str, field: str, index: Sequence[int], text: str, display: Display
) -> pg.Model:
    """Return the model with text typed into a scenario cell. Raises Refusal, PgraphError."""
    s = model.scenario(name)
    match field:
        case "name":
            return put(model, name, name=text.strip())
        case "description":
            return put(model, name, description=text.strip())
        case "q" | "v":
            return put(model, name, **{field: _states(model, s, field, index, text, display)})
        case "bodies":
            return _with_body(model, s, text)
        case "constraints" | "contacts":
            return put(model, name, **{field: _acting(model, s, field, index, text == ON)})
    raise Refusal("has no such field any more")


def _states(
    model: pg.Model, s: pg.Scenario, field: str, index: Sequence[int], text: str, display: Display
) -> dict[str, Any]:
    if len(index) != 2 or index[0] >= len(model.bodies):
        raise Refusal("has no such row any more")
    row, k = index
    body, given = model.bodies[row], getattr(s, field)
    old = given.get(body.name, getattr(body, field))
    of = quantities(body, field)[k] if k < len(old) else "number"
    return {**given, body.name: cells.replaced(old, (k,), cells.quantity(text, of, display))}


def _with_body(model: pg.Model, s: pg.Scenario, name: str) -> pg.Model:
    """Give a body its own initial values in the scenario, or remove them if it has some."""
    body = model.body(name)
    q, v = dict(s.q), dict(s.v)
    if name in q or name in v:
        q.pop(name, None)
        v.pop(name, None)
    elif not body.q:
        raise Refusal(f"the joint of '{name}' does not move")
    else:
        q[name], v[name] = body.q, body.v
    return put(model, s.name, q=q, v=v)


def acting(model: pg.Model, s: pg.Scenario, field: str) -> list[tuple[str, bool]]:
    """Return the constraints or contacts, each with its activity at the start."""
    listed = getattr(s, field)
    return [
        (part.name, part.active if listed is None else part.name in listed)
        for part in getattr(model, field)
    ]


def _acting(
    model: pg.Model, s: pg.Scenario, field: str, index: Sequence[int], on: bool
) -> tuple[str, ...] | None:
    """Return the active parts with one switched on or off, or None for the model's default."""
    parts = [name for name, _ in acting(model, s, field)]
    if not index or index[0] >= len(parts):
        raise Refusal("has no such row any more")
    now = {**dict(acting(model, s, field)), parts[index[0]]: on}
    if now == {part.name: part.active for part in getattr(model, field)}:
        return None
    return tuple(key for key, on in now.items() if on)


# -- forces ----------------------------------------------------------------------------------------


def as_forces(model: pg.Model, s: pg.Scenario) -> pg.Model:
    """Return the model with its forces replaced by a scenario's, for editing them alike."""
    formulas = tuple(f for f in model.formulas if f.part != "forces")
    return model.replace(forces=s.forces, scenarios=(), formulas=formulas)


def with_forces(model: pg.Model, name: str, drafted: pg.Model) -> pg.Model:
    """Return the model with the edited forces of the scenario. Raises Refusal."""
    if any(f.part == "forces" for f in drafted.formulas):
        raise Refusal("must be a number: forces of a scenario hold no formulas")
    return put(model, name, forces=drafted.forces)


# -- switches --------------------------------------------------------------------------------------


def names_of(model: pg.Model, what: str) -> list[str]:
    """Return the names that a condition of this kind may use."""
    if what == TIME:
        return []
    known = known_names(
        {body.name: body for body in model.bodies},
        [c.name for c in model.constraints],
        [c.name for c in model.contacts],
    )
    if what not in known:
        raise Refusal(f"A switch waits for none of that kind: choose one of {', '.join(known)}.")
    return list(known[what])


def waits_of(switch: pg.Switch) -> tuple[str, str]:
    """Return (the kind of event a switch waits for, its name)."""
    return (TIME, "") if switch.when is None else switch.when.subject


def unit_of(model: pg.Model, switch: pg.Switch) -> str:
    """Return the unit of a condition's value. "angle" and "length" follow the units of the page."""
    what, name = waits_of(switch)
    if what != "coordinate":
        return UNITS.get(what, "")
    body, k = coordinates({body.name: body for body in model.bodies}).get(name, ("", 0))
    of = quantities(model.body(body), "q")[k] if body else "number"
    return of if of != "number" else ""


def value_of(switch: pg.Switch) -> float | None:
    """Return the threshold a switch waits for, or None if it waits for a constraint."""
    if switch.when is None:
        return switch.t
    return switch.when.above if switch.when.above is not None else switch.when.below


def side_of(switch: pg.Switch) -> str:
    """Return "above" or "below" for a value, "on" or "off" for a constraint, or "" for a time."""
    if switch.when is None:
        return ""
    if switch.when.active is not None:
        return ON if switch.when.active else OFF
    return "above" if switch.when.above is not None else "below"


def with_switch(
    model: pg.Model, name: str, constraint: str | None, when: tuple[str, str] | None = None
) -> pg.Model:
    """Add a switch that toggles the constraint in the middle of the run.

    It does so when a body "touches", "leaves", "passes" or "exceeds", where `when` names them.
    """
    s = model.scenario(name)
    if not model.constraints:
        raise Refusal("There is no constraint to switch: add one in Connections.")
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


def switch_edited(
    model: pg.Model, name: str, number: int, field: str, text: str, display: Display
) -> pg.Model:
    """Return a switch with one of its cells changed. Raises Refusal, PgraphError."""
    s = model.scenario(name)
    if number >= len(s.switches):
        raise Refusal("The switch is gone.")
    old = s.switches[number]
    new = _switch(model, s, old, field, text, display)
    if new.t is not None and new.t >= s.t_end:
        raise Refusal(
            f"The run ends at {s.t_end:g} s: give a time before that, or a longer duration."
        )
    switches = (*s.switches[:number], new, *s.switches[number + 1 :])
    return put(model, name, switches=switches)


def _switch(
    model: pg.Model, s: pg.Scenario, old: pg.Switch, field: str, text: str, display: Display
) -> pg.Switch:
    what, watched = waits_of(old)
    if what == TIME and field in ("watched", "side"):
        raise Refusal("The switch waits for a time and watches nothing: choose a condition first.")
    match field:
        case "constraint":
            return _of(old, text, old.active, old.t, old.when)
        case "active":
            return _of(old, old.constraint, text == ON, old.t, old.when)
        case "what" if text == TIME:
            return _of(old, old.constraint, old.active, s.t_end / 2, None)
        case "what":
            return _of(old, old.constraint, old.active, None, _usual(model, s, old, text))
        case "watched":
            return _of(old, old.constraint, old.active, None, {**_when(old), what: text})
        case "side" if what == "constraint":
            return _of(old, old.constraint, old.active, None, {**_when(old), "active": text == ON})
        case "side":
            bound = {text: value_of(old)}
            return _of(old, old.constraint, old.active, None, {what: watched, **bound})
        case "value":
            unit = unit_of(model, old)
            of: Quantity = unit if unit in ("length", "angle") else "number"  # type: ignore[assignment]
            try:
                value = cells.quantity(text, of, display)
            except Refusal as refusal:
                raise Refusal(f"The {'time' if what == TIME else 'value'} {refusal}") from None
            if what == TIME:
                return _of(old, old.constraint, old.active, value, None)
            bound = {side_of(old): value}
            return _of(old, old.constraint, old.active, None, {what: watched, **bound})
    raise Refusal("The switch has no such field any more.")


def _of(old: pg.Switch, constraint: str, active: bool, t: Any, when: Any) -> pg.Switch:
    return pg.Switch(t=t, constraint=constraint, active=active, when=when)


def _when(switch: pg.Switch) -> dict[str, Any]:
    """Return the fields of the condition that are set."""
    assert switch.when is not None
    return {key: x for key, x in switch.when.model_dump().items() if x is not None}


def _usual(model: pg.Model, s: pg.Scenario, switch: pg.Switch, what: str) -> dict[str, Any]:
    """Return a default condition that can occur. Raises Refusal if there is nothing to watch."""
    names = names_of(model, what)
    if what == "constraint":
        names = [name for name in names if name != switch.constraint]
    if not names:
        there = {"gap": "contact", "force": "contact or constraint"}.get(what, what)
        raise Refusal(f"There is no {'other ' if what == 'constraint' else ''}{there} to wait for.")
    match what:
        case "constraint":
            state = dict(acting(model, s, "constraints"))
            moved = [x for x in s.switches if x.constraint in names]
            if not moved:
                raise Refusal("No other constraint is switched: add a switch of it first.")
            return {what: moved[0].constraint, "active": not state[moved[0].constraint]}
        case "coordinate":
            return {what: names[0], "above": _ahead(model, names[0])}
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
        raise Refusal(f"'{body}' has no {word}: it cannot be waited for.")
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
