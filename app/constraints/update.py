"""What the events do to constraints, contacts, forces, loops and limits, and to picking (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from .. import events
from ..core.cells import Refusal
from ..core.intents import Assemble, MobilityReport, Part, Picking
from ..core.state import Notice, State, told, with_client
from ..events import Event
from ..model.answering import answered, attempted
from ..model.errands import sent
from . import events as asked
from . import parts
from .kinds import FIELDS, KINDS, WORD


def update(state: State, event: Event) -> State | None:
    """The state after an event of the constraints tab, or a click while picking; else None."""
    match event:
        case events.Select(client=client, body=body) if _picking(state, client) is not None:
            return picked(state, client, body)
        case events.SelectBodies(client=client, body=body) if _picking(state, client) is not None:
            return picked(state, client, body)
        case asked.PickName(client, name) if _picking(state, client) is not None:
            return picked(state, client, name)
        case asked.Unpick(client):
            return with_client(state, client, picking=None)
        case asked.Pick(client, part, name, slot):
            return _pick_of(state, client, part, name, slot)
        case asked.AddPart():
            return add(state, event)
        case asked.EditPart():
            return edited(state, event)
        case asked.AssembleState(client):
            return sent(state, client, Assemble())
        case asked.MobilityFound(model, found, problem):
            report = MobilityReport(model, found, problem)
            return replace(state, mobility=report) if model is state.model else state
        case asked.AskMobility():
            return replace(state, mobility_asked=state.model)
    return _listed(state, event) or _of_one(state, event)


def _listed(state: State, event: Event) -> State | None:
    """What is in sight of one page's tab."""
    match event:
        case asked.OpenPart(client, part, name):
            opened = None if name is None else (part, name)
            return with_client(state, client, opened=opened)
        case asked.OpenConstraints(client, body) if client in state.clients:
            known = body if body in state.derived.number else None
            called = state.clients[client].called + 1
            return with_client(state, client, listed=known, called=called)
        case asked.WatchConstraints(client, on):
            return with_client(state, client, watching=on)
    return None


def _of_one(state: State, event: Event) -> State | None:
    """A part switched, deleted or duplicated."""
    match event:
        case asked.SwitchPart(client, part, name, on):
            label = f"{'activate' if on else 'deactivate'} {name}"
            return attempted(
                state, client, lambda: parts.switched(state.model, part, name, on), label
            )
        case asked.DeletePart(client, part, name):
            label = f"delete {name}"
            return attempted(state, client, lambda: parts.removed(state.model, part, name), label)
        case asked.DuplicatePart(client, part, name):
            try:
                model, copy = parts.duplicated(state.model, part, name)
            except Refusal as refusal:
                return told(state, client, Notice("Not done", f"{refusal}.", bad=True))
            after = attempted(state, client, lambda: model, f"duplicate {name}")
            return with_client(after, client, opened=(part, copy))
    return None


def edited(state: State, event: asked.EditPart) -> State:
    """Typed cells of a part: one undo step, or the sentence that refuses them."""
    page = state.clients.get(event.client)
    if page is None:
        return state
    places = parts.places(state.derived.names, state.derived.positions, state.derived.wxyz)

    def make():
        try:
            return parts.changed(
                state.model, event.part, event.name, event.field, event.entries,
                page.display, places,
            )  # fmt: skip
        except Refusal as refusal:
            about = FIELDS.get(event.field)
            raise Refusal(f"{about.label if about else event.field}: {refusal}") from None

    after = answered(state, event.client, event.serial, make, f"{event.field} of {event.name}")
    if event.field == "name" and after.model is not state.model:
        opened = (event.part, event.entries[0][1].strip())
        return with_client(after, event.client, opened=opened)
    return after


# -- adding and picking ------------------------------------------------------------------------


def add(state: State, event: asked.AddPart) -> State:
    """A new part: its bodies are picked by clicks, the first may be known."""
    if event.kind not in KINDS[event.part]:
        return state
    picking = Picking(event.part, event.kind)
    if event.body is None or event.body not in state.derived.number:
        return with_client(state, event.client, picking=picking)
    return _next(with_client(state, event.client, picking=picking), event.client, event.body)


def _picking(state: State, client: int) -> Picking | None:
    page = state.clients.get(client)
    return page.picking if page is not None else None


def _pick_of(state: State, client: int, part: Part, name: str, slot: str) -> State:
    """The next click says a body of a part that is there."""
    try:
        kind = parts.kind_of(part, parts.item_of(state.model, part, name))
    except Refusal as refusal:
        return told(state, client, Notice("Not done", f"{refusal}.", bad=True))
    return with_client(
        state, client, picking=Picking(part, kind, "other" if slot == "other" else "body", name)
    )


def picked(state: State, client: int, body: str | None) -> State:
    """A body clicked while picking, or the ground; None (Escape) ends it."""
    picking = _picking(state, client)
    if picking is None or body is None:
        return with_client(state, client, picking=None)
    if body == picking.body:  # clicked again, or selected before: the other is still asked for
        return state
    known = body in state.derived.number or body in allowed(picking)
    return _next(state, client, body) if known else state


def allowed(picking: Picking) -> tuple[str, ...]:
    """What may be picked beside a body."""
    if picking.part == "contacts":
        return (parts.EVERY,) if picking.slot == "body" else (parts.GROUND, parts.EVERY)
    return (parts.GROUND,) if picking.slot == "other" else ()


def _next(state: State, client: int, body: str) -> State:
    picking = _picking(state, client)
    assert picking is not None
    if picking.name is not None:
        part, name = cast(Part, picking.part), picking.name
        after = attempted(
            state, client, lambda: _with_body(state, part, name, picking.slot, body),
            f"{picking.slot} of {name}",
        )  # fmt: skip
        return _to_tab(with_client(after, client, picking=None), client, part, name)
    if picking.slot == "body" and parts.takes_other(picking.part, picking.kind):
        return with_client(state, client, picking=replace(picking, slot="other", body=body))
    first = picking.body if picking.slot == "other" else body
    assert first is not None
    return _made(with_client(state, client, picking=None), client, picking, first, body)


def _with_body(state: State, part: Part, name: str, slot: str, body: str):
    item = parts.item_of(state.model, part, name)
    data = {**state.model.cells(item, part), slot: body}
    if data.get("coefficients") and slot == "body":
        data["coefficients"] = {body: (1.0,) * state.model.body(body).dof}
    items = tuple(data if x.name == name else x for x in getattr(state.model, part))
    return state.model.replace(**{part: items})


def _made(state: State, client: int, picking: Picking, body: str, other: str) -> State:
    """The new part between the bodies picked, shown whole in the tab."""
    made = ""

    def make():
        nonlocal made
        model, made = parts.added(state.model, picking.part, picking.kind, body, other)
        return model

    after = attempted(state, client, make, f"add {WORD.get(picking.part, 'limits')}")
    if after.model is state.model:
        return after
    if picking.part == "limits":
        return _called(after, client)
    part = "constraints" if picking.part == "loops" else picking.part
    return _to_tab(after, client, part, made)


def _to_tab(state: State, client: int, part: str, name: str) -> State:
    return _called(with_client(state, client, opened=(part, name)), client)


def _called(state: State, client: int) -> State:
    page = state.clients.get(client)
    return state if page is None else with_client(state, client, called=page.called + 1)
