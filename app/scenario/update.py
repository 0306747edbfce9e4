"""Editing the scenario chosen for the run by clicks (pure)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import Field

import pgraph_core as pg

from ..constraints import KINDS, parts
from ..core.cells import Refusal, scenario, touched
from ..core.edit import attempted, edited
from ..core.events import Entries, FromPage, OfScenario, Text, on
from ..core.state import Notice, display_of, told
from ..pose import solving
from ..run import FREE_RUN, Request
from . import (
    State,
    as_forces,
    changed,
    conditions,
    copied,
    made,
    put,
    with_forces,
)

Number = Annotated[int, Field(ge=0, le=10**9)]
NONE = "No scenario yet: create one first."


def named(state: State, event: Any = None) -> str:
    """Return the name of the event's scenario, by default the chosen one. Raises Refusal."""
    name = state.request.scenario
    if event is not None:
        name = scenario(state.rows, state.model, name, event)
    if name == FREE_RUN:
        raise Refusal(NONE)
    return name


def chosen(state: State, name: str) -> State:
    """Choose a scenario, with its own settings, for the next run."""
    s = next((s for s in state.model.scenarios if s.name == name), None)
    if s is None:
        return state
    return replace(state, request=Request(name, s.t_end, s.step, s.method, state.request.rtol))


Edit = Callable[[State, Any, str], pg.Model]


def on_scenario(kind: type[FromPage], label: str) -> Callable[[Edit], Edit]:
    """Register (state, event, scenario name) -> model as the undoable edit for these events.

    `label` says what was done, with fields of the event and `scenario`. The run follows the
    settings that were typed.
    """

    def keep(edit: Edit) -> Edit:
        def done(state: State, event: Any) -> State:
            serial = getattr(event, "serial", None)

            def make() -> tuple[pg.Model, str]:
                name = named(state, event)
                return edit(state, event, name), label.format(**{**vars(event), "scenario": name})

            after = edited(state, event.client, make, serial, at=touched(event))
            if serial is None or after.model is state.model:
                return after
            for s, new in zip(state.model.scenarios, after.model.scenarios):
                if s.name == state.request.scenario and s is not new:
                    return chosen(after, new.name)
            return after

        on(kind)(done)
        return edit

    return keep


@dataclass(frozen=True)
class NewScenario(FromPage):
    """Create a scenario from the current run settings."""


@on(NewScenario)
def new_scenario(state: State, event: NewScenario) -> State:
    return _added(state, event.client)


def _added(state: State, client: int) -> State:
    model, name = made(state.model, state.request)
    return chosen(attempted(state, client, lambda: model, f"add {name}"), name)


@dataclass(frozen=True)
class KeepSettings(FromPage):
    """Store the current run settings in the chosen scenario."""


@on(KeepSettings)
def keep_settings(state: State, event: KeepSettings) -> State:
    request = state.request
    fields = {"t_end": request.t_end, "step": request.step, "method": request.method}

    def make() -> tuple[pg.Model, str]:
        name = named(state)
        return put(state.model, name, **fields), f"settings of {name}"

    return edited(state, event.client, make)


@dataclass(frozen=True)
class CopyScenario(OfScenario):
    """Copy the scenario."""


@on(CopyScenario)
def copy_scenario(state: State, event: CopyScenario) -> State:
    try:
        model, name = copied(state.model, named(state, event))
    except (Refusal, pg.PgraphError) as problem:
        return told(state, event.client, Notice("Not done", str(problem), bad=True))
    return chosen(attempted(state, event.client, lambda: model, f"duplicate {name}"), name)


@dataclass(frozen=True)
class DeleteScenario(OfScenario):
    """Delete the scenario."""


@on(DeleteScenario)
def delete_scenario(state: State, event: DeleteScenario) -> State:
    def make() -> tuple[pg.Model, str]:
        name = named(state, event)
        return state.model.remove(name, kind="scenario"), f"delete {name}"

    after = edited(state, event.client, make)
    if after.request.scenario == state.request.scenario:
        return after
    left = after.model.scenarios
    return chosen(after, left[0].name) if left else replace(after, request=Request())


@dataclass(frozen=True)
class EditScenario(OfScenario):
    """Text typed into the cells of one scenario field."""

    serial: int
    field: Text
    entries: Entries


@on_scenario(EditScenario, "{field} of {scenario}")
def scenario_edited(state: State, event: EditScenario, name: str) -> pg.Model:
    model, display = state.model, display_of(state, event.client)
    for index, text in event.entries:
        try:
            model = changed(model, name, event.field, index, text, display)
        except Refusal as refusal:
            raise Refusal(f"The {event.field.replace('t_end', 'duration')} {refusal}") from None
    return model


@dataclass(frozen=True)
class TakePose(OfScenario):
    """Use the displayed pose as the scenario's initial state, or restore the model's own."""

    shown: bool


@on_scenario(TakePose, "initial state of {scenario}")
def take_pose(state: State, event: TakePose, name: str) -> pg.Model:
    if not event.shown:
        return put(state.model, name, q={}, v={})
    q, v = solving.shown_q(state), solving.shown_v(state)
    posed = solving.with_initial(state.model, q, v)
    moves = [body for body in posed.bodies if body.q]
    return put(state.model, name, q={b.name: b.q for b in moves}, v={b.name: b.v for b in moves})


# -- forces --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AddDrive(OfScenario):
    """Add a force on a body that acts in this scenario only."""

    kind: Text
    body: Text


@on_scenario(AddDrive, "add {kind}")
def add_drive(state: State, event: AddDrive, name: str) -> pg.Model:
    if event.kind not in KINDS["forces"] or event.body not in state.model.row:
        return state.model
    draft = as_forces(state.model, state.model.scenario(name))
    added, _ = parts.added(draft, "forces", event.kind, event.body, parts.GROUND)
    return with_forces(state.model, name, added)


@dataclass(frozen=True)
class EditDrive(OfScenario):
    """Text typed into the cells of a scenario force."""

    serial: int
    name: Text
    field: Text
    entries: Entries


@on_scenario(EditDrive, "{field} of {name}")
def drive_edited(state: State, event: EditDrive, name: str) -> pg.Model:
    display, d = display_of(state, event.client), state.derived
    at = parts.places(d.names, d.positions, d.wxyz)
    draft = as_forces(state.model, state.model.scenario(name))
    new = parts.changed(draft, "forces", event.name, event.field, event.entries, display, at)
    return with_forces(state.model, name, new)


@dataclass(frozen=True)
class DeleteDrive(OfScenario):
    name: Text


@on_scenario(DeleteDrive, "delete {name}")
def delete_drive(state: State, event: DeleteDrive, name: str) -> pg.Model:
    draft = as_forces(state.model, state.model.scenario(name))
    return with_forces(state.model, name, parts.removed(draft, "forces", event.name))


# -- switches ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AddSwitch(FromPage):
    """Add a switch for a constraint, by default the first. Creates a scenario if there is none.

    It waits for a time, or for what `body` does.
    """

    constraint: Text | None
    body: Text = ""
    when: Literal["touches", "leaves", "passes", "exceeds"] | None = None


@on(AddSwitch)
def add_switch(state: State, event: AddSwitch) -> State:
    if state.request.scenario == FREE_RUN:
        known = state.model.scenarios
        if not state.model.constraints:
            text = "No constraint to switch: add one in the tab Constraints."
            return told(state, event.client, Notice("Not done", text, bad=True))
        state = chosen(state, known[0].name) if known else _added(state, event.client)

    def make() -> pg.Model:
        when = (event.body, event.when) if event.when else None
        return conditions.with_switch(state.model, named(state), event.constraint, when)

    return attempted(state, event.client, make, "add a switch")


@dataclass(frozen=True)
class EditSwitch(OfScenario):
    """Text typed into the cells of one field of a switch, or one of its buttons pressed."""

    serial: int
    number: Number
    field: Text
    entries: Entries


@on_scenario(EditSwitch, "a switch")
def switch_set(state: State, event: EditSwitch, name: str) -> pg.Model:
    display = display_of(state, event.client)
    return conditions.switch_edited(
        state.model, name, event.number, event.field, event.entries, display
    )


@dataclass(frozen=True)
class DeleteSwitch(OfScenario):
    number: Number


@on_scenario(DeleteSwitch, "delete a switch")
def delete_switch(state: State, event: DeleteSwitch, name: str) -> pg.Model:
    return conditions.without_switch(state.model, name, event.number)
