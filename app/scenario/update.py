"""Editing the scenario chosen for the run by clicks (pure)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

import pgraph_core as pg
from pgraph_core.dynamics.states import with_initial
from pgraph_core.model.settings import settings_of

from ..constraints import KINDS, parts, places
from ..constraints.gains import GROUND
from ..core.cells import Refusal
from ..core.edit import attempted
from ..core.events import Entries, FromPage, ModelEdit, OfScenario, Text
from ..core.rows import scenario
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
    return replace(state, request=Request.of(s))


class EditOfScenario(OfScenario, ModelEdit):
    """An edit of a scenario. The settings of the run are updated accordingly."""

    LABEL: ClassVar[str]  # says what was done, with fields of the event and `scenario`

    def edit(self, state: State) -> tuple[pg.Model, str]:
        name = named(state, self)
        return self.changed(state, name), self.LABEL.format(**{**vars(self), "scenario": name})

    @abstractmethod
    def changed(self, state: State, name: str) -> pg.Model:
        """Return the model with another scenario of this name. Raises Refusal, PgraphError."""

    def then(self, before: State, after: State) -> State:
        for s, new in zip(before.model.scenarios, after.model.scenarios):
            if hasattr(self, "serial") and s.name == before.request.scenario and s is not new:
                return chosen(after, new.name)
        return after


class NewScenario(ModelEdit):
    """Create a scenario from the current run settings."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        model, name = made(state.model, state.request)
        return model, f"add {name}"

    def then(self, before: State, after: State) -> State:
        return chosen(after, after.model.scenarios[-1].name)


class KeepSettings(ModelEdit):
    """Store the current run settings in the chosen scenario."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        name = named(state)
        gait = {} if state.set_gait is None else {"gait": state.set_gait}
        return put(state.model, name, **settings_of(state.request), **gait), f"settings of {name}"


class CopyScenario(OfScenario, NewScenario):
    """Copy the scenario."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        model, name = copied(state.model, named(state, self))
        return model, f"duplicate {name}"


class DeleteScenario(OfScenario, ModelEdit):
    """Delete the scenario."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        name = named(state, self)
        return state.model.remove(name, kind="scenario"), f"delete {name}"

    def then(self, before: State, after: State) -> State:
        if after.request.scenario == before.request.scenario:
            return after
        left = after.model.scenarios
        return chosen(after, left[0].name) if left else replace(after, request=Request())


class EditScenario(EditOfScenario):
    """Text typed into the cells of one scenario field."""

    serial: int
    field: Text
    entries: Entries
    LABEL = "{field} of {scenario}"

    def changed(self, state: State, name: str) -> pg.Model:
        model, display = state.model, display_of(state, self.client)
        for index, text in self.entries:
            try:
                model = changed(model, name, self.field, index, text, display)
            except Refusal as refusal:
                raise Refusal(f"The {self.field.replace('t_end', 'duration')} {refusal}") from None
        return model


class TakePose(EditOfScenario):
    """Use the displayed pose as the initial state of the scenario, or restore the initial state of
    the model."""

    shown: bool
    LABEL = "initial state of {scenario}"

    def changed(self, state: State, name: str) -> pg.Model:
        if not self.shown:
            return put(state.model, name, q={}, v={})
        q, v = solving.shown_q(state), solving.shown_v(state)
        posed = with_initial(state.model, q, v)
        moves = [body for body in posed.bodies if body.q]
        return put(
            state.model, name, q={b.name: b.q for b in moves}, v={b.name: b.v for b in moves}
        )


# -- forces --------------------------------------------------------------------------------------


class AddDrive(EditOfScenario):
    """Add a force on a body that acts in this scenario only."""

    kind: Text
    body: Text
    LABEL = "add {kind}"

    def changed(self, state: State, name: str) -> pg.Model:
        if self.kind not in KINDS["forces"] or self.body not in state.model.row:
            return state.model
        draft = as_forces(state.model, state.model.scenario(name))
        added, _ = parts.added(draft, "forces", self.kind, self.body, GROUND)
        return with_forces(state.model, name, added)


class EditDrive(EditOfScenario):
    """Text typed into the cells of a scenario force."""

    serial: int
    name: Text
    field: Text
    entries: Entries
    LABEL = "{field} of {name}"

    def changed(self, state: State, name: str) -> pg.Model:
        display, d = display_of(state, self.client), state.derived
        at = places.at_home(d.names, d.positions, d.wxyz)
        draft = as_forces(state.model, state.model.scenario(name))
        new = parts.changed(draft, "forces", self.name, self.field, self.entries, display, at)
        return with_forces(state.model, name, new)


class DeleteDrive(EditOfScenario):
    name: Text
    LABEL = "delete {name}"

    def changed(self, state: State, name: str) -> pg.Model:
        draft = as_forces(state.model, state.model.scenario(name))
        return with_forces(state.model, name, parts.removed(draft, "forces", self.name))


# -- switches ------------------------------------------------------------------------------------


class AddSwitch(FromPage):
    """Add a switch for a constraint, by default the first. Creates a scenario if there is none.

    The switch triggers at a given time or on a motion of `body`.
    """

    constraint: Text | None
    body: Text = ""
    when: Literal["touches", "leaves", "passes", "exceeds"] | None = None

    def applied(self, state: State) -> State:
        if state.request.scenario == FREE_RUN:
            known = state.model.scenarios
            if not state.model.constraints:
                text = "No constraint to switch: add one in the tab Constraints."
                return told(state, self.client, Notice("Not done", text, bad=True))
            state = (
                chosen(state, known[0].name) if known else NewScenario(self.client).applied(state)
            )

        def make() -> pg.Model:
            when = (self.body, self.when) if self.when else None
            return conditions.with_switch(state.model, named(state), self.constraint, when)

        return attempted(state, self.client, make, "add a switch")


class EditSwitch(EditOfScenario):
    """Text typed into the cells of one field of a switch, or a click on one of its buttons."""

    serial: int
    number: Number
    field: Text
    entries: Entries
    LABEL = "a switch"

    def changed(self, state: State, name: str) -> pg.Model:
        display = display_of(state, self.client)
        return conditions.switch_edited(
            state.model, name, self.number, self.field, self.entries, display
        )


class DeleteSwitch(EditOfScenario):
    number: Number
    LABEL = "delete a switch"

    def changed(self, state: State, name: str) -> pg.Model:
        return conditions.without_switch(state.model, name, self.number)
