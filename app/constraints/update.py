"""Events of the constraints tab: adding, picking, editing, the report (pure)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar, cast

import pgraph_core as pg

from ..core.cells import Refusal
from ..core.edit import attempted
from ..core.events import Entries, Event, FromPage, Text, on, on_edit
from ..core.state import Notice, display_of, told, with_client
from ..model import Found
from ..model.update import sent
from . import KINDS, WORD, MobilityReport, Part, Picking, Slot, State, about, parts, takes_other

S = TypeVar("S", bound=State)

# -- editing -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class EditPart(FromPage):
    """Text was typed into cells of one field."""

    serial: int
    part: Part
    name: Text
    field: Text
    entries: Entries


@on_edit(EditPart)
def part_edited(state: State, event: EditPart) -> tuple[pg.Model, str]:
    d, display = state.derived, display_of(state, event.client)
    places = parts.places(d.names, d.positions, d.wxyz)
    try:
        model = parts.changed(
            state.model, event.part, event.name, event.field, event.entries, display, places
        )
    except Refusal as refusal:
        item = parts.item_of(state.model, event.part, event.name)
        raise Refusal(f"{about(item, event.field).label}: {refusal}") from None
    return model, f"{event.field} of {event.name}"


@dataclass(frozen=True)
class SwitchPart(FromPage):
    """Activate or deactivate a part."""

    part: Literal["constraints", "contacts"]
    name: Text
    on: bool


@on_edit(SwitchPart)
def switch(state: State, event: SwitchPart) -> tuple[pg.Model, str]:
    word = "activate" if event.on else "deactivate"
    return parts.switched(state.model, event.part, event.name, event.on), f"{word} {event.name}"


@dataclass(frozen=True)
class DeletePart(FromPage):
    part: Part
    name: Text


@on_edit(DeletePart)
def delete(state: State, event: DeletePart) -> tuple[pg.Model, str]:
    return parts.removed(state.model, event.part, event.name), f"delete {event.name}"


@dataclass(frozen=True)
class DuplicatePart(FromPage):
    part: Part
    name: Text


@on(DuplicatePart)
def duplicate(state: State, event: DuplicatePart) -> State:
    try:
        model, copy = parts.duplicated(state.model, event.part, event.name)
    except Refusal as refusal:
        return told(state, event.client, Notice("Not done", f"{refusal}.", bad=True))
    after = attempted(state, event.client, lambda: model, f"duplicate {event.name}")
    return with_client(after, event.client, opened=(event.part, copy))


# -- adding and picking ------------------------------------------------------------------------


@dataclass(frozen=True)
class AddPart(FromPage):
    """Add a part of that kind. Its bodies are picked next, and the first may be given."""

    part: Part | Literal["loops", "limits"]
    kind: Text
    body: Text | None


@on(AddPart)
def add(state: State, event: AddPart) -> State:
    if event.kind not in KINDS[event.part]:
        return state
    if event.part == "controls":
        return _made(state, event.client, Picking("controls", event.kind), event.body or "", "")
    picking, page = Picking(event.part, event.kind), state.clients.get(event.client)
    if event.body is None or event.body not in state.derived.number:
        return with_client(state, event.client, picking=picking)
    chosen = page.selected if page is not None and event.body in page.selected else ()
    picking = replace(picking, more=tuple(name for name in chosen if name != event.body))
    return _next(with_client(state, event.client, picking=picking), event.client, event.body)


@dataclass(frozen=True)
class Pick(FromPage):
    """Start picking: the next body clicked is assigned to this field of a part."""

    part: Part
    name: Text
    slot: Slot


@on(Pick)
def pick(state: State, event: Pick) -> State:
    try:
        kind = parts.kind_of(event.part, parts.item_of(state.model, event.part, event.name))
    except Refusal as refusal:
        return told(state, event.client, Notice("Not done", f"{refusal}.", bad=True))
    picking = Picking(event.part, kind, event.slot, event.name)
    return with_client(state, event.client, picking=picking)


@dataclass(frozen=True)
class PickName(FromPage):
    """Pick by name without clicking: the ground, or "*" for every body in a contact."""

    name: Text


@on(PickName)
def pick_name(state: State, event: PickName) -> State:
    if picking_of(state, event.client) is None:
        return state
    return picked(state, event.client, event.name)


@dataclass(frozen=True)
class Unpick(FromPage):
    """Pick nothing."""


@on(Unpick)
def unpick(state: State, event: Unpick) -> State:
    return with_client(state, event.client, picking=None)


def picking_of(state: State, client: int) -> Picking | None:
    page = state.clients.get(client)
    return page.picking if page is not None else None


def picked(state: S, client: int, body: str | None) -> S:
    """Assign a body clicked while picking, or the ground. None (Escape) ends picking."""
    picking = picking_of(state, client)
    if picking is None or body is None:
        return with_client(state, client, picking=None)
    if body in (
        picking.body,
        *picking.more,
    ):  # clicked again, or selected before: the other is still asked for
        return state
    known = body in state.derived.number or body in allowed(picking)
    return _next(state, client, body) if known else state


def allowed(picking: Picking) -> tuple[str, ...]:
    """Return the other targets that can be picked."""
    if picking.part == "contacts":
        named = (parts.EVERY,) if picking.slot == "body" else (parts.GROUND, parts.EVERY)
        return named if picking.name is not None else (*named, parts.ALL_ON_GROUND)
    return (parts.GROUND,) if picking.slot == "other" or picking.part == "sites" else ()


def _next(state: S, client: int, body: str) -> S:
    picking = picking_of(state, client)
    assert picking is not None
    if picking.name is not None:
        part, name = cast(Part, picking.part), picking.name
        after = attempted(
            state, client, lambda: _with_body(state, part, name, picking.slot, body),
            f"{picking.slot} of {name}",
        )  # fmt: skip
        return _to_tab(with_client(after, client, picking=None), client, part, name)
    if body == parts.ALL_ON_GROUND:
        one = replace(picking, more=())
        freed = with_client(state, client, picking=None)
        return _made(freed, client, one, parts.EVERY, parts.GROUND)
    if picking.slot == "body" and takes_other(picking.part, picking.kind):
        return with_client(state, client, picking=replace(picking, slot="other", body=body))
    first = picking.body if picking.slot == "other" else body
    assert first is not None
    return _made(with_client(state, client, picking=None), client, picking, first, body)


def _with_body(state: State, part: Part, name: str, slot: str, body: str):
    item = parts.item_of(state.model, part, name)
    data = parts.on_joint(state.model, item, state.model.cells(item, part), {slot: body})
    items = tuple(data if x.name == name else x for x in getattr(state.model, part))
    return state.model.replace(**{part: items})


def _made(state: S, client: int, picking: Picking, body: str, other: str) -> S:
    """Create the new part between the picked bodies and open it, one part for each of `more`."""
    made = ""

    def make():
        nonlocal made
        model = state.model
        for one in (*picking.more, body):
            model, made = parts.added(model, picking.part, picking.kind, one, other)
        return model

    after = attempted(state, client, make, f"add {WORD.get(picking.part, 'limits')}")
    if after.model is state.model:
        return after
    if picking.part == "limits":
        return _called(after, client)
    part = "constraints" if picking.part == "loops" else picking.part
    return _to_tab(after, client, part, made)


def _to_tab(state: S, client: int, part: str, name: str) -> S:
    return _called(with_client(state, client, opened=(part, name)), client)


def _called(state: S, client: int) -> S:
    page = state.clients.get(client)
    return state if page is None else with_client(state, client, called=page.called + 1)


# -- the tab -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class OpenPart(FromPage):
    """Open one part in the tab, or none if None."""

    part: Part
    name: Text | None


@on(OpenPart)
def open_part(state: State, event: OpenPart) -> State:
    opened = None if event.name is None else (event.part, event.name)
    return with_client(state, event.client, opened=opened)


@dataclass(frozen=True)
class OpenConstraints(FromPage):
    """Show the tab with the parts on one body, or all parts if None."""

    body: Text | None


@on(OpenConstraints)
def open_constraints(state: State, event: OpenConstraints) -> State:
    known = event.body if event.body in state.derived.number else None
    return with_client(_called(state, event.client), event.client, listed=known)


# -- the report and assembling -----------------------------------------------------------------


@dataclass(frozen=True)
class AskMobility(FromPage):
    """Request the report for a model that is too large for an automatic one."""


@on(AskMobility)
def ask_mobility(state: State, event: AskMobility) -> State:
    return replace(state, mobility_asked=state.model)


@dataclass(frozen=True)
class MobilityFound(Event):
    """The report about a model's constraints, or the reason for its absence."""

    model: pg.Model
    found: Any  # pg.Mobility | None
    problem: str = ""


@on(MobilityFound)
def mobility_found(state: State, event: MobilityFound) -> State:
    if event.model is not state.model:
        return state
    return replace(state, mobility=MobilityReport(event.model, event.found, event.problem))


@dataclass(frozen=True)
class AssembleState(FromPage):
    """Project the initial state onto the constraints."""


@on(AssembleState)
def assemble(state: State, event: AssembleState) -> State:
    return sent(state, event.client, "assemble", assembled, compiled=True)


def assembled(model: pg.Model) -> Found:
    """Project the initial state onto the constraints. Return the distance. Raises PgraphError."""
    mech = pg.Mechanism(model)
    q, v, found = mech.assemble()
    if not found.notable:
        return Found(f"{str(found).capitalize()} already: nothing moved.")
    changes, at, speed = {}, 0, 0
    for name in mech.names:
        body = model.body(name)
        new = {"q": tuple(q[at : at + len(body.q)].tolist()),
               "v": tuple(v[speed : speed + len(body.v)].tolist())}  # fmt: skip
        at, speed = at + len(body.q), speed + len(body.v)
        if new != {"q": body.q, "v": body.v}:
            changes[name] = new
    return Found(f"{str(found).capitalize()}. Undo takes it back.", changes)
