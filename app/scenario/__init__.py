"""The current scenario: initial state, forces, switches and edits (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pgraph_core as pg
from pgraph_core.model.editing import free_name
from pgraph_core.model.settings import settings_of

from ..constraints import Client as Client
from ..constraints import Part, parts
from ..constraints import State as State
from ..core import cells
from ..core.cells import Display, Refusal
from ..properties.body_cells import quantity_of
from ..run import Request

ON, OFF = "on", "off"


def first_name(model: pg.Model) -> str:
    """Return a scenario name that is not yet in use."""
    return free_name("scenario", [s.name for s in model.scenarios])


def made(model: pg.Model, request: Request) -> tuple[pg.Model, str]:
    """Return a model with a new scenario equivalent to the free run, and the scenario's name."""
    name = first_name(model)
    new = pg.Scenario(name=name, **settings_of(request))
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
    raise Refusal("no longer has this field")


def _states(
    model: pg.Model, s: pg.Scenario, field: str, index: Sequence[int], text: str, display: Display
) -> dict[str, Any]:
    if len(index) != 2 or index[0] >= len(model.bodies):
        raise Refusal("no longer has this row")
    row, k = index
    body, given = model.bodies[row], getattr(s, field)
    old = given.get(body.name, getattr(body, field))
    new = cells.quantity(text, quantity_of(body, field, (k,)), display, rate=field == "v")
    return {**given, body.name: cells.replaced(old, (k,), new)}


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


def acting(model: pg.Model, s: pg.Scenario, field: Part) -> list[tuple[str, bool]]:
    """Return the constraints or contacts, each with its activity at the start."""
    on, _ = parts.acting(model, field, s.name)
    return [(part.name, part.name in on) for part in getattr(model, field)]


def _acting(
    model: pg.Model, s: pg.Scenario, field: Part, index: Sequence[int], on: bool
) -> tuple[str, ...] | None:
    """Return the active parts with one switched on or off, or None for the model's default."""
    names = [name for name, _ in acting(model, s, field)]
    if not index or index[0] >= len(names):
        raise Refusal("no longer has this row")
    now = {**dict(acting(model, s, field)), names[index[0]]: on}
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
        raise Refusal("must be a number: formulas are not supported in forces of a scenario")
    return put(model, name, forces=drafted.forces)
