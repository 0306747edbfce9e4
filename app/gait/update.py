"""What the events do to a walk: its gait, its speed, pushes, the ground, who follows it (pure)."""

from __future__ import annotations

from dataclasses import replace

import pgraph_core as pg

from .. import events
from ..core import cells
from ..core.cells import Refusal
from ..core.state import Reply, Request, State, with_client
from ..events import Event
from ..model.update import with_model
from ..run import living
from .walking import LAWS, Offer, Walking, checked, chosen, grounded, law, offered, offers

SHOWN = frozenset({"forces", "cones", "footprints"})  # once somebody walks
NAMES = {"speed": "The speed", "turn": "The turning", "friction": "The friction",
         "slope": "The slope", "steps": "The height of the steps"}  # fmt: skip


def update(state: State, event: Event) -> State | None:
    """The state after an event of the walk; None for any other event."""
    match event:
        case events.Walk(client) if state.live is None and state.job is None:
            return begun(state, client)
        case events.GoLive(client) if state.live is None and state.job is None:
            return begun_as_asked(state, client)
        case events.SetGait(client, serial, gait) if gait in offers(state.model):
            return settled(state, client, serial, chosen(state.walking, gait))
        case events.SetWalk():
            return changed(state, event)
        case events.SetGround():
            return on_ground(state, event)
        case events.Push(_, side) if state.live is not None:
            pushes = state.walking.pushes + 1
            return replace(state, walking=replace(state.walking, pushes=pushes, push=side))
        case events.Show(client, "follow", on):
            return with_client(state, client, follow=on)
        case _:
            return None


def begun(state: State, client: int) -> State | None:
    """A live run of the gait, with the ground's forces in view and the camera beside it."""
    offer = offered(state.model, state.walking)
    if offer is None:
        return None
    state = replace(state, request=requested(state.model, offer), shown=state.shown | SHOWN)
    return living.begun(with_client(state, client, follow=True))


def begun_as_asked(state: State, client: int) -> State | None:
    """The live run of a scenario: a walk where it has a gait."""
    asked = state.request.scenario
    scenario = next((s for s in state.model.scenarios if s.name == asked), None)
    if scenario is None or scenario.gait is None:
        return None
    offer = offered(state.model, state.walking)
    if offer is None or offer.scenario != scenario.name:
        state = replace(state, walking=chosen(state.walking, scenario.gait.name))
    return begun(state, client)


def requested(model: pg.Model, offer: Offer) -> Request:
    """How it is simulated: as its scenario is, by a method for the law of its feet."""
    scenario = model.scenario(offer.scenario)
    _, method, step = LAWS[law(model)]
    return Request(offer.scenario, scenario.t_end, step, method)


def changed(state: State, event: events.SetWalk) -> State:
    """Another speed or turning, or the sentence that refuses it."""
    try:
        value = number(event.field, event.text)
    except Refusal as refusal:
        return with_client(state, event.client, reply=Reply(event.serial, str(refusal)))
    changes = {**state.walking.changes, event.field: value}
    walking = replace(state.walking, changes=changes)
    return settled(state, event.client, event.serial, walking)


def number(name: str, text: str) -> float:
    """A typed number. Raises Refusal with the name of what it is for."""
    try:
        return cells.number(text)
    except Refusal as refusal:
        raise Refusal(f"{NAMES[name]} {refusal}") from None


def settled(state: State, client: int, serial: int, walking: Walking) -> State:
    """`walking`, where the model's legs can do it; else the sentence that says why not."""
    try:
        offer = offered(state.model, walking)
        if offer is not None and state.kernels.ready:
            checked(state.model, offer)
    except pg.PgraphError as error:
        return with_client(state, client, reply=Reply(serial, str(error)))
    state = replace(state, walking=walking)
    if state.live is not None and offer is not None:
        request = requested(state.model, offer)
        if request != state.live.request:
            state = replace(state, live=replace(state.live, request=request))
    return with_client(state, client, reply=Reply(serial, ""))


def on_ground(state: State, event: events.SetGround) -> State:
    """The model on other ground, which a live run goes on over."""
    if state.live is not None and event.field in ("slope", "steps"):
        text = f"{NAMES[event.field]} is set before a walk: stop this one first."
        return with_client(state, event.client, reply=Reply(event.serial, text))
    try:
        value = event.text if event.field == "law" else number(event.field, event.text)
        model = grounded(state.model, event.field, value)
    except (Refusal, pg.PgraphError) as refusal:
        return with_client(state, event.client, reply=Reply(event.serial, str(refusal)))
    state = with_model(state, model, f"{event.field} of the ground")
    live, offer = state.live, offered(model, state.walking)
    if live is not None and offer is not None and event.field == "law":
        state = replace(state, live=replace(live, request=requested(model, offer)))
    return with_client(state, event.client, reply=Reply(event.serial, ""))
