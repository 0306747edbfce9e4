"""The scenario tab: settings, initial state, forces, switches and events of the chosen scenario."""

from __future__ import annotations

from functools import partial

import pgraph_core as pg

from ..constraints import KINDS, parts
from ..constraints.view import between, form
from ..core.cells import Display, Quantity, button, cell, field, group, shown
from ..core.views import Host, Payload, Place, topic
from ..properties.body_cells import quantity_of
from ..run import FREE_RUN
from . import (
    OFF,
    ON,
    State,
    acting,
    as_forces,
    conditions,
)

PER = {"q": "", "v": "/s"}
MOST_EVENTS = 1000  # limit on shown events of the log
NEEDS = (
    "derived", "request",
    lambda state: None if state.live else state.plotted, lambda state: state.live is None,
)  # fmt: skip
PARTS = ("form", "start", "held", "active", "drives", "switches")  # parts of a scenario


def scenario(state: State, display: Display) -> Payload:
    """Return the content of the tab, which is short for a free run."""
    model, name = state.model, state.request.scenario
    number = state.rows.named(model, "scenarios")
    listed = [
        {"id": number[s.name], "number": number[s.name], "name": s.name, "value": s.name,
         "length": f"{s.t_end:g} s"}
        for s in model.scenarios
    ]  # fmt: skip
    free = {"id": "free", "number": None, "name": "free run", "value": FREE_RUN, "length": ""}
    found: Payload = {
        "scenarios": [*listed, free],
        "name": name,
        "kinds": list(KINDS["forces"].items()),
        "switchable": [c.name for c in model.constraints],
    }
    s = next((s for s in model.scenarios if s.name == name), None)
    if s is None:
        return found | {"none": True, "id": None} | {part: [] for part in PARTS}
    switch = partial(conditions.form, model, display=display)
    return found | {
        "none": False,
        "id": number[name],
        "form": [_settings(s)],
        "start": _initial(model, s, display),
        "held": [b.name for b in model.bodies if b.name in s.q or b.name in s.v],
        "active": _acting(model, s),
        "drives": _drives(state, s, display),
        "switches": [
            {"id": k, "name": "", "form": [group("", switch(x))]} for k, x in enumerate(s.switches)
        ],
    }


def _settings(s: pg.Scenario) -> Payload:
    return group("", [field("description", "About", [cell((), s.description)], kind="text")])


def _initial(model: pg.Model, s: pg.Scenario, display: Display) -> list[Payload]:
    """Return the bodies whose initial values differ from the model's, with fields for q and v."""
    found = []
    for row, body in enumerate(model.bodies):
        if body.name not in s.q and body.name not in s.v:
            continue
        out = button("×", "", "starts as in the model", field="bodies", index=[], text=body.name)
        for name, label in (("q", body.name), ("v", "velocity")):
            values = getattr(s, name).get(body.name, getattr(body, name))
            of: list[Quantity] = [quantity_of(body, name, (k,)) for k in range(len(values))]
            row_cells = [cell((row, k), shown(x, of[k], display)) for k, x in enumerate(values)]
            unit = ", ".join(dict.fromkeys(u + PER[name] for q in of if (u := display.unit(q))))
            found.append(
                field(name, label, row_cells, unit=unit, buttons=[out] if name == "q" else [])
            )
    if not found:
        return []
    back = button("all as in the model", "TakePose", "Every body starts as the model says",
                  shown=False)  # fmt: skip
    return [group("Initial state", [*found, field("as_model", "", [], buttons=[back])])]


def _acting(model: pg.Model, s: pg.Scenario) -> list[Payload]:
    """Return the parts active at the start, or [] if there are no constraints and contacts."""
    found = []
    for name in ("constraints", "contacts"):
        own = getattr(s, name) is None
        found += [
            field(name, part, [cell((i,), ON if on else OFF, implied=own)], kind="choice",
                  options=[(ON, ON), (OFF, OFF)], help=f"whether {part} acts at the start")
            for i, (part, on) in enumerate(acting(model, s, name))
        ]  # fmt: skip
    return [group("Active at the start", found, False)] if found else []


def _drives(state: State, s: pg.Scenario, display: Display) -> list[Payload]:
    draft = as_forces(state.model, s) if s.forces else state.model
    of = State(draft, request=state.request)
    return [
        {
            "id": k,
            "name": f.name,
            "kind": parts.kind_of("forces", f),
            "between": between(f),
            "form": _without_picking(form(of, display, "forces", f)),
        }
        for k, f in enumerate(s.forces)
    ]


def _without_picking(groups: list[Payload]) -> list[Payload]:
    """Return a form without picking and feedback, which only work on the model."""
    for g in groups:
        g["fields"] = [f for f in g["fields"] if f["field"] != "feedback"]
        for f in g["fields"]:
            f["buttons"] = [b for b in f["buttons"] if b["event"] != "Pick"]
    return groups


def events(state: State) -> list[Payload]:
    """Return the event log of the shown run, with switches and contacts."""
    if state.live is not None or state.plotted is None:
        return []
    return [
        {"t": e.t, "part": e.contact, "before": e.before, "after": e.after, "cause": str(e.cause)}
        for e in state.plotted.result.contacts.events[:MOST_EVENTS]
    ]


VIEWS = (
    Place(
        topic("scenario", lambda state, page: scenario(state, page.display), *NEEDS,
              page=lambda state, page: (page.display,), seen="scenario"),
        22, Host("scenario", "left", "Scenarios"), Host("events", "drawer", "Events", 52),
    ),
    Place(topic("events", events, *NEEDS, seen="events"), 22),
)  # fmt: skip
