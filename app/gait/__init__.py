"""Walking: gaits and their settings, and live runs, which may walk."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Literal, NamedTuple, Self

import pgraph_core as pg
from pgraph_core.model import Step

from .. import scene
from ..core import cells
from ..core.cells import Refusal
from ..core.edit import with_model
from ..core.events import FromPage, Text, TypedText
from ..playback import at
from ..run import Request, asked, at_its_end, go_live, idle
from ..scene import Client as Client

LAWS = {  # contact laws of the feet: label, method, step [s]
    "complementarity": ("rigid", "auto", 1e-3),
    "penalty": ("penalty", "rk4", 2.5e-4),
    "soft": ("soft (Hunt and Crossley)", "rk4", 1e-4),
}
FIRST, LONG, APART, WIDE, MANY = 1.0, 0.8, 1.6, 5.0, 12  # platforms to walk over [m]
FEET = 4  # number of feet of a gait
PUSH, LASTS = 0.25, 0.15  # force of a push relative to the weight, duration [s]
SIDES = {"left": (0, -1), "right": (0, 1), "back": (-1, 0), "ahead": (1, 0)}  # trunk's x and z


@dataclass(frozen=True)
class Walking:
    """Walking settings made on the page. Other settings are taken from the model."""

    gait: str = ""  # name, "" for the model's first gait
    changes: Mapping[str, float] = field(default_factory=dict)  # fields of the gait
    pushes: int = 0  # number of pushes so far
    push: str = ""  # direction of the last one, a key of SIDES
    strength: float = 0.25  # force of a push relative to the weight
    pushed: str = ""  # pushed body, "" for the trunk


class Offer(NamedTuple):
    """A gait, and the scenario that provides its contacts and drives."""

    gait: pg.Gait
    scenario: str
    tried: bool  # True for a gait of the model, False for a preset on its feet


def offers(model: pg.Model) -> dict[str, Offer]:
    """Return gaits by name, from scenarios and then presets, or {} for a model without a gait."""
    own = {s.gait.name: Offer(s.gait, s.name, True) for s in model.scenarios if s.gait is not None}
    if not own:
        return {}
    first = next(iter(own.values()))
    presets = {
        name: Offer(gait, first.scenario, False)
        for name, gait in _presets(tuple(fall.foot for fall in first.gait.feet)).items()
        if name not in own
    }
    return own | presets


@lru_cache(maxsize=8)
def _presets(feet: tuple[str, ...]) -> Mapping[str, pg.Gait]:
    """Return the preset gaits, cached because each part of a live run needs them."""
    return pg.gaits(feet)


def offered(model: pg.Model, walking: Walking) -> Offer | None:
    """Return the gait for the walk with its changes, or None if the model has none."""
    found = offers(model)
    if not found:
        return None
    offer = found.get(walking.gait) or next(iter(found.values()))
    if not walking.changes:
        return offer
    return offer._replace(gait=offer.gait.edit(**walking.changes))


def has_feet(model: pg.Model) -> bool:
    """Check whether the model has a gait, or four single-point contacts with the ground."""
    feet = [c for c in model.contacts if c.other == "ground" and len(c.points) == 1]
    return len(feet) >= FEET or bool(offers(model))


def why_not(model: pg.Model) -> str:
    """Return the reason why a model with feet has no gait, or ""."""
    if offers(model):
        return ""
    return f"No scenario of '{model.name}' has a gait: give one a 'gait' (docs/gaits.md)."


def turns(model: pg.Model, gait: pg.Gait) -> bool:
    """Check whether the hips can abduct, so that feet can push sideways."""
    contacts = {contact.name: contact for contact in model.contacts}
    for fall in gait.feet:
        if fall.foot not in contacts:
            return False
        paw = model.body(contacts[fall.foot].body)
        if paw.parent == "ground" or (shank := model.body(paw.parent)).parent == "ground":
            return False
        if model.body(shank.parent).dof != 2:
            return False
    return True


def feet_of(model: pg.Model) -> list[pg.Contact]:
    """Return the contacts with the ground."""
    return [contact for contact in model.contacts if contact.other == "ground"]


def friction(model: pg.Model) -> float:
    """Return the friction coefficient of the feet."""
    given = [c for c in feet_of(model) if c.friction is not None]
    return given[0].frictions(model.ground).kinetic if given else model.ground.friction


def law(model: pg.Model) -> str:
    """Return the contact law of the feet."""
    return next((contact.law for contact in feet_of(model)), "complementarity")


def platforms(height: float) -> tuple[Step, ...]:
    """Return platforms to walk over, starting 1 m ahead, or () if the height is 0."""
    if height == 0.0:
        return ()
    starts = [FIRST + k * APART for k in range(MANY)]
    return tuple(Step(low=(x, -WIDE), high=(x + LONG, WIDE), height=height) for x in starts)


def step_height(model: pg.Model) -> float:
    """Return the height of the highest ground step [m]."""
    return max((step.height for step in model.ground.steps), key=abs, default=0.0)


def grounded(model: pg.Model, what: str, value: float | str) -> pg.Model:
    """Return the model on modified ground. Raises ModelError."""
    match what:
        case "law":
            return pg.underfoot(model, law=str(value))
        case "friction":
            return pg.underfoot(model, friction=float(value))
        case "slope":
            return pg.underfoot(model, slope=math.radians(float(value)))
        case _:
            return pg.underfoot(model, steps=platforms(float(value)))


def chosen(walking: Walking, name: str) -> Walking:
    """Return the settings for another gait, without changes."""
    return replace(walking, gait=name, changes={})


def checked(model: pg.Model, offer: Offer) -> None:
    """Check that the model can walk like this. Raises InputError, for example if the gait is too
    fast."""
    pg.Controller(pg.Mechanism(model), offer.gait)


@dataclass(frozen=True)
class State(scene.State):
    walking: Walking = field(default_factory=Walking)

    def opened(self, before: Any) -> Self:
        return replace(super().opened(before), walking=Walking())

    @property
    def set_gait(self) -> pg.Gait | None:
        offer = offered(self.model, self.walking)
        if offer is None or offer.scenario != self.request.scenario:
            return None
        own = self.model.scenario(offer.scenario).gait
        return None if offer.gait == own else offer.gait


# -- walking: the gait, its speed, pushes, and the ground (pure) -----------------------------------


STRONGEST = 20.0  # push over the weight
SHOWN = frozenset({"forces", "cones", "footprints"})  # once somebody walks
NAMES = {"speed": "The speed", "turn": "The turning", "friction": "The friction",
         "slope": "The slope", "steps": "The height of the steps"}  # fmt: skip


class Walk(FromPage):
    """Start a live run with the chosen gait."""

    def applied(self, state: State) -> State:
        return (idle(state) and begun(state)) or state


class GoLive(FromPage):
    """Start simulating and playing immediately, without an end time. A model with a gait walks."""

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
        if state.t_end <= state.t_start:
            known = state.run is not None or not state.model.rows
            return state if known else Simulate(self.client).applied(state)
        again = state.playback.time >= state.t_end
        return at(state, state.t_start if again else state.playback.time, True)


class Simulate(FromPage):
    """Simulate the current model. A walk uses the speed and turning rate set here."""

    def applied(self, state: State) -> State:
        return asked(state, None) if idle(state) else state


class Continue(FromPage):
    """Continue from the end of the run for the same duration."""

    def applied(self, state: State) -> State:
        if not idle(state) or state.live is not None or state.run is None:
            return state
        return asked(state, state.run.result)


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
    return Request(scenario=offer.scenario, t_end=scenario.t_end, step=step, method=method)


class SetGait(TypedText):
    gait: Text

    def taken(self, state: State) -> State:
        if self.gait not in offers(state.model):
            return state
        return settled(state, chosen(state.walking, self.gait))


class SetWalk(TypedText):
    """Set one field of the gait, with immediate effect.

    The gait of a scenario is edited in the model. That of a preset is changed until it is kept.
    """

    field: Literal["speed", "turn"]
    text: Text

    def taken(self, state: State) -> State:
        value = cells.named_number(NAMES[self.field], self.text)
        offer = offered(state.model, state.walking)
        if offer is None or not offer.tried:
            changes = {**state.walking.changes, self.field: value}
            return settled(state, replace(state.walking, changes=changes))
        offer = offer._replace(gait=offer.gait.edit(**{self.field: value}))
        if state.kernels.ready:
            checked(state.model, offer)
        label = f"{self.field} of {offer.gait.name}"
        model = state.model.edit(offer.scenario, kind="scenario", gait=offer.gait)
        after = with_model(state, model, label)
        slid = after is not state and state.undo[-1:] and state.undo[-1].label == label
        return replace(after, undo=state.undo) if slid else after  # a slider moves in one step


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
            text = f"The strength is above 0 and at most {STRONGEST:g} weights, got {strength:g}"
            raise Refusal(text)
        return replace(state, walking=replace(state.walking, strength=strength))
