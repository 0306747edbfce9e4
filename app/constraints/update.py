"""Events of the constraints tab: adding, picking, editing, the report (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, TypeVar, cast

import pgraph_core as pg

from ..core.cells import Refusal
from ..core.edit import attempted
from ..core.events import Entries, FromPage, ModelEdit, Text
from ..core.state import Notice, display_of, told, with_client
from ..model import Found, sent
from . import KINDS, WORD, Part, Picking, Slot, State, about, cables, parts, places, takes_other
from .gains import EVERY, GROUND

S = TypeVar("S", bound=State)

# -- editing -----------------------------------------------------------------------------------


class EditPart(ModelEdit):
    """Text was typed into cells of one field."""

    serial: int
    part: Part
    name: Text
    field: Text
    entries: Entries

    def edit(self, state: State) -> tuple[pg.Model, str]:
        d, display = state.derived, display_of(state, self.client)
        at = places.at_home(d.names, d.positions, d.wxyz)
        try:
            model = parts.changed(
                state.model, self.part, self.name, self.field, self.entries, display, at
            )
        except Refusal as refusal:
            item = parts.item_of(state.model, self.part, self.name)
            raise Refusal(f"{about(item, self.field).label}: {refusal}") from None
        return model, f"{self.field} of {self.name}"


class SwitchPart(ModelEdit):
    """Activate or deactivate a part, in the scenario if it lists its active parts."""

    part: Literal["constraints", "contacts"]
    name: Text
    on: bool

    def edit(self, state: State) -> tuple[pg.Model, str]:
        word, of = "activate" if self.on else "deactivate", state.request.scenario
        model = parts.switched(state.model, self.part, self.name, self.on, of)
        return model, f"{word} {self.name}"


class DeletePart(ModelEdit):
    part: Part
    name: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        return parts.removed(state.model, self.part, self.name), f"delete {self.name}"


class DuplicatePart(ModelEdit):
    part: Part
    name: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        return parts.duplicated(state.model, self.part, self.name), f"duplicate {self.name}"

    def then(self, before: State, after: State) -> State:
        known = {x.name for x in getattr(before.model, self.part)}
        copy = next(x.name for x in getattr(after.model, self.part) if x.name not in known)
        return with_client(after, self.client, opened=(self.part, copy))


# -- adding and picking ------------------------------------------------------------------------


class AddPart(FromPage):
    """Add a part of that kind. Its bodies are picked next, and the first may be given."""

    part: Part | Literal["loops", "limits"]
    kind: Text
    body: Text | None

    def applied(self, state: State) -> State:
        if self.kind not in KINDS[self.part]:
            return state
        if self.part == "controls":
            return _made(state, self.client, Picking("controls", self.kind), self.body or "", "")
        picking, page = Picking(self.part, self.kind), state.clients.get(self.client)
        if self.body is None or self.body not in state.derived.number:
            return with_client(state, self.client, picking=picking)
        if is_way(picking):
            return _onward(state, self.client, picking, self.body, None)
        chosen = page.selected if page is not None and self.body in page.selected else ()
        picking = replace(picking, more=tuple(name for name in chosen if name != self.body))
        return _next(with_client(state, self.client, picking=picking), self.client, self.body)


class Pick(FromPage):
    """Start picking: the next body clicked is assigned to this field of a part."""

    part: Part
    name: Text
    slot: Slot

    def applied(self, state: State) -> State:
        try:
            kind = parts.kind_of(self.part, parts.item_of(state.model, self.part, self.name))
        except Refusal as refusal:
            return told(state, self.client, Notice("Not done", f"{refusal}.", bad=True))
        picking = Picking(self.part, kind, self.slot, self.name)
        return with_client(state, self.client, picking=picking)


class PickName(FromPage):
    """Pick by name without clicking: the ground, or "*" for every body in a contact."""

    name: Text

    def applied(self, state: State) -> State:
        if picking_of(state, self.client) is None:
            return state
        return picked(state, self.client, self.name)


class EndWay(FromPage):
    """The last body of a new cable or rope is picked. `closed` makes it a belt."""

    closed: bool = False

    def applied(self, state: State) -> State:
        picking = picking_of(state, self.client)
        if picking is None or len(picking.way) < 2:
            return state
        freed = with_client(state, self.client, picking=None)
        made = ""

        def make() -> pg.Model:
            nonlocal made
            model, made = parts.led(
                state.model, picking.part, picking.kind, picking.way, self.closed
            )
            return model

        after = attempted(freed, self.client, make, f"add {picking.kind}")
        if after.model is state.model:
            return after
        return _to_tab(after, self.client, picking.part, made)


class BackWay(FromPage):
    """Take back the last body of a new cable or rope."""

    def applied(self, state: State) -> State:
        picking = picking_of(state, self.client)
        if picking is None or not picking.way:
            return state
        shorter = replace(picking, way=picking.way[:-1])
        return with_client(state, self.client, picking=shorter)


class Unpick(FromPage):
    """Pick nothing."""

    def applied(self, state: State) -> State:
        return with_client(state, self.client, picking=None)


def picking_of(state: State, client: int) -> Picking | None:
    page = state.clients.get(client)
    return page.picking if page is not None else None


def picked(
    state: S, client: int, body: str | None, point: tuple[float, float, float] | None = None
) -> S:
    """Assign a body clicked while picking, or the ground. None (Escape) ends picking.

    A cable takes the point that was clicked too.
    """
    picking = picking_of(state, client)
    if picking is None or body is None:
        return with_client(state, client, picking=None)
    if is_way(picking):
        return _onward(state, client, picking, body, point)
    if body in (
        picking.body,
        *picking.more,
    ):  # clicked again, or selected before: the other is still asked for
        return state
    known = body in state.derived.number or body in allowed(picking)
    return _next(state, client, body) if known else state


def is_way(picking: Picking | None) -> bool:
    """Check whether bodies are picked one after the other, for a new cable or rope."""
    return picking is not None and picking.name is None and cables.leads(picking.kind)


def _onward(
    state: S, client: int, picking: Picking, body: str, point: tuple[float, float, float] | None
) -> S:
    """Lead a new cable on to a body. Another click on the last body may only move its point."""
    if body not in state.derived.number and body != GROUND:
        return state
    again = bool(picking.way) and picking.way[-1][0] == body != GROUND
    if again and point is None:
        return state
    before = picking.way[:-1] if again else picking.way
    way = (*before, (body, point))
    return with_client(state, client, picking=replace(picking, way=way))


def allowed(picking: Picking) -> tuple[str, ...]:
    """Return the other targets that can be picked."""
    if is_way(picking):
        return (GROUND,)
    if picking.part == "contacts":
        named = (EVERY,) if picking.slot == "body" else (GROUND, EVERY)
        return named if picking.name is not None else (*named, parts.ALL_ON_GROUND)
    return (GROUND,) if picking.slot == "other" or picking.part == "sites" else ()


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
        return _made(freed, client, one, EVERY, GROUND)
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


class OpenPart(FromPage):
    """Open one part in the tab, or none if None."""

    part: Part
    name: Text | None

    def applied(self, state: State) -> State:
        opened = None if self.name is None else (self.part, self.name)
        return with_client(state, self.client, opened=opened)


class OpenConstraints(FromPage):
    """Show the tab with the parts on one body, or all parts if None."""

    body: Text | None

    def applied(self, state: State) -> State:
        known = self.body if self.body in state.derived.number else None
        return with_client(_called(state, self.client), self.client, listed=known)


# -- the report and assembling -----------------------------------------------------------------


class AskMobility(FromPage):
    """Request the report for a model that is too large for an automatic one."""

    def applied(self, state: State) -> State:
        return replace(state, mobility_asked=state.model)


class AssembleState(FromPage):
    """Project the initial state onto the constraints."""

    def applied(self, state: State) -> State:
        return sent(state, self.client, "assemble", assembled, compiled=True)


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
    return Found(f"{str(found).capitalize()}. Use Undo to revert this change.", changes)
