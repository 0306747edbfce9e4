"""Walking: the gait, its speed, pushes, and the ground (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import pgraph_core as pg

from ..core import cells
from ..core.cells import Refusal
from ..core.edit import with_model
from ..core.events import FromPage, Text, TypedText
from ..playback.update import at
from ..run import Request
from ..run.update import asked, at_its_end, go_live, idle
from . import LAWS, Offer, State, Walking, checked, chosen, grounded, law, offered, offers

STRONGEST = 20.0  # push over the weight
SHOWN = frozenset({"forces", "cones", "footprints"})  # once somebody walks
NAMES = {"speed": "The speed", "turn": "The turning", "friction": "The friction",
         "slope": "The slope", "steps": "The height of the steps"}  # fmt: skip


class Walk(FromPage):
    """Start a live run with the chosen gait."""

    def applied(self, state: State) -> State:
        return (idle(state) and begun(state)) or state


class GoLive(FromPage):
    """Start simulating and playing at once, without an end time: a walk if it has a gait."""

    def applied(self, state: State) -> State:
        if not idle(state):
            return state
        asked = state.request.scenario
        scenario = next((s for s in state.model.scenarios if s.name == asked), None)
        if scenario is None or scenario.gait is None:
            return go_live(state)
        offer = offered(state.model, state.walking)
        if offer is None or offer.scenario != scenario.name:
            state = replace(state, walking=chosen(state.walking, scenario.gait.name))
        return begun(state) or go_live(state)


class Play(FromPage):
    """Play the run, or compute it: a page may not have heard yet that there is none."""

    def applied(self, state: State) -> State:
        if state.going is not None:
            return at_its_end(state, replace(state.going, running=True))
        if state.run is None and state.model.bodies:
            return Simulate(self.client).applied(state)
        if state.t_end <= state.t_start:
            return state
        again = state.playback.time >= state.t_end
        return at(state, state.t_start if again else state.playback.time, True)


class Simulate(FromPage):
    """Simulate the current model. A walk uses the speed and turning rate set here."""

    def applied(self, state: State) -> State:
        return asked(state, None, set_gait(state)) if idle(state) else state


class Continue(FromPage):
    """Continue from the end of the run for as long again."""

    def applied(self, state: State) -> State:
        if not idle(state) or state.live is not None or state.run is None:
            return state
        return asked(state, state.run.result, set_gait(state))


def set_gait(state: State) -> pg.Gait | None:
    """Return the gait of the scenario to simulate, if its settings were changed here."""
    offer = offered(state.model, state.walking)
    if offer is None or not state.walking.changes or offer.scenario != state.request.scenario:
        return None
    return offer.gait


def begun(state: State) -> State | None:
    """Start a live run with the gait, and show the ground forces."""
    offer = offered(state.model, state.walking)
    if offer is None:
        return None
    state = replace(state, request=requested(state.model, offer), shown=state.shown | SHOWN)
    return go_live(state)


def requested(model: pg.Model, offer: Offer) -> Request:
    """Return the run request for a walk, with a method suited to the contact law of its feet."""
    scenario = model.scenario(offer.scenario)
    _, method, step = LAWS[law(model)]
    return Request(offer.scenario, scenario.t_end, step, method)


class SetGait(TypedText):
    gait: Text

    def taken(self, state: State) -> State:
        if self.gait not in offers(state.model):
            return state
        return settled(state, chosen(state.walking, self.gait))


class SetWalk(TypedText):
    """Set one field of the gait, with immediate effect."""

    field: Literal["speed", "turn"]
    text: Text

    def taken(self, state: State) -> State:
        value = cells.named_number(NAMES[self.field], self.text)
        changes = {**state.walking.changes, self.field: value}
        return settled(state, replace(state.walking, changes=changes))


def settled(state: State, walking: Walking) -> State:
    """Apply `walking` if the model's legs permit it. Raises PgraphError with the reason if not."""
    offer = offered(state.model, walking)
    if offer is not None and state.kernels.ready:
        checked(state.model, offer)
    state = replace(state, walking=walking)
    if state.going is not None and offer is not None:
        request = requested(state.model, offer)
        if request != state.going.request:
            state = replace(state, live=replace(state.going, request=request))
    return state


class SetGround(TypedText):
    """Change the ground as an edit of the model. A live run continues on the new ground."""

    field: Literal["friction", "slope", "steps", "law"]
    text: Text

    def taken(self, state: State) -> State:
        if state.going is not None and self.field in ("slope", "steps"):
            raise Refusal(f"{NAMES[self.field]} is set before a walk: stop this one first.")
        law = self.field == "law"
        value = self.text if law else cells.named_number(NAMES[self.field], self.text)
        model = grounded(state.model, self.field, value)
        state = with_model(state, model, f"{self.field} of the ground")
        live, offer = state.going, offered(model, state.walking)
        if live is not None and offer is not None and self.field == "law":
            state = replace(state, live=replace(live, request=requested(model, offer)))
        return state


class Push(FromPage):
    """Push the trunk or the selected body."""

    side: Literal["left", "right", "back", "ahead"]

    def applied(self, state: State) -> State:
        if state.going is None:
            return state
        page = state.clients.get(self.client)
        body = (page.selection if page is not None else None) or ""
        walking = replace(
            state.walking, pushes=state.walking.pushes + 1, push=self.side, pushed=body
        )
        return replace(state, walking=walking)


class SetPush(TypedText):
    """Set the strength of pushes relative to the weight."""

    text: Text

    def taken(self, state: State) -> State:
        strength = cells.named_number("The strength", self.text)
        if not 0 < strength <= STRONGEST:
            text = f"The strength is above 0 and at most {STRONGEST:g} weights; given {strength:g}"
            raise Refusal(text)
        return replace(state, walking=replace(state.walking, strength=strength))
