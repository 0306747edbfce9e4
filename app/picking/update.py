"""Picking in the 3D view: the active pick, the pointer, and the effect of clicks (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

import pgraph_core as pg
from pgraph_core.show import shapes

from ..constraints import Part, parts, places
from ..constraints.update import is_way, picked
from ..core.cells import Display, Refusal
from ..core.edit import attempted, selected
from ..core.events import Finite, FromPage, Index, OfServer, Request, Text
from ..core.rows import refuse_moved
from ..core.state import Notice, told, with_client
from ..pose import poses
from ..properties.update import row_edit, row_named, rows_edited
from ..scene import View, ties
from ..signals import clicked as signal_of
from . import GROUND, Aim, Spot, State
from .spots import Ray, spot

Vector = tuple[Finite, Finite, Finite]
OF_PARENT = "link"  # a body's field in the axes of its parent


class StartAim(FromPage):
    """Start picking in the 3D view, for a row of a field or for a measurement."""

    wants: Literal["point", "axis", "measure", "signal"]
    field: Text = ""
    index: Index = ()
    bodies: Annotated[tuple[Text, ...], Field(max_length=1)] = ()
    part: Part | None = None
    name: Text = ""

    def applied(self, state: State) -> State:
        about = self.wants, self.field, self.index, self.bodies, self.part, self.name
        aim = Aim(*about, seen=state.version)
        return with_client(state, self.client, aim=aim, picking=None)


class EndAim(FromPage):
    """End picking and discard the measurements."""

    def applied(self, state: State) -> State:
        return with_client(state, self.client, aim=None)


class Pointed(FromPage):
    """A ray through the pointer position in the 3D view, in world axes [m]."""

    origin: Vector
    direction: Vector
    slack: Annotated[float, Field(ge=0, le=1)]  # tangent of the angle within which points snap


class Hover(Pointed):
    """The pointer moves."""

    collapses = True

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or page.aim is None:
            return state
        return with_client(
            state, self.client, aim=replace(page.aim, under=spot_of(state, self, page.aim))
        )


class ClickSpot(Pointed):
    """A click while picking is active. `rate` asks for the speed of a body in an expression."""

    rate: bool = False

    def applied(self, state: State) -> State:
        page, client = state.clients.get(self.client), self.client
        if page is None or page.aim is None or (found := spot_of(state, self, page.aim)) is None:
            return state
        if page.aim.wants == "signal":
            hint = signal_of(state.model, 0, "bodies", found.body, self.rate, None, "")
            return with_client(state, client, hint=hint)
        if page.aim.wants == "measure":
            kept = page.aim.spots if len(page.aim.spots) == 1 else ()
            return with_client(
                state, client, aim=replace(page.aim, spots=(*kept, found), under=found)
            )
        if page.aim.wants == "axis" and found.direction is None:
            return told(state, client, Notice("No axis there", "Click a face or a round side."))
        return taken(state, client, page.aim, found)


class AskBody(Pointed):
    """Request the menu of the body under the pointer."""

    at: tuple[Finite, Finite]  # position on the page [px]

    def applied(self, state: State) -> State:
        found = spot_of(state, self)
        name = None if found is None or found.body == GROUND else found.body
        return with_client(state, self.client, asked=MenuOf(self.client, name, self.at))


class ClickView(Pointed):
    """A click in the view. If it hits neither a body nor a connection, the selection is cleared."""

    def applied(self, state: State) -> State:
        page, found = state.clients.get(self.client), spot_of(state, self)
        if page is not None and is_way(page.picking):
            return _led_to(state, self)
        if page is None or page.picking is not None or (found and found.body != GROUND):
            return state
        if joined_at(state, self):
            return state
        return selected(state, self.client, None, ())


def _led_to(state: State, event: ClickView) -> State:
    """Lead a new cable to a joint, a tip, a corner or a centre under the pointer, if one is near.

    The click on a solid names its body alone.
    """
    found = spot_of(state, event, Aim("point"))
    if found is None or found.body == GROUND or not found.snapped:
        return state
    return picked(state, event.client, found.body, found.point)


class MenuOf(OfServer, Request):
    """The menu of a body, or of the view, is wanted at a place on the page [px]."""

    body: str | None
    at: tuple[float, float]


class FrameSpot(Pointed):
    """A double click, which selects and frames the body under the pointer, or frames all bodies."""

    def applied(self, state: State) -> State:
        page, found = state.clients.get(self.client), spot_of(state, self)
        if page is None or page.aim is not None or page.picking is not None:
            return state
        name = None if found is None or found.body == GROUND else found.body
        if name is None and joined_at(state, self):
            return state
        chosen = selected(state, self.client, name, () if name is None else (name,))
        return with_client(chosen, self.client, asked=View(self.client, "fit"))


def spot_of(state: State, event: Pointed, aim: Aim | None = None) -> Spot | None:
    """Return the spot hit by a ray, preferring joints for points, or None without a direction."""
    direction = np.asarray(event.direction)
    length = float(np.linalg.norm(direction))
    if not 1e-9 < length < 1e9:
        return None
    ray = Ray(np.asarray(event.origin), direction / length, event.slack)
    return spot(state, ray, aim is not None and aim.wants == "point")


def joined_at(state: State, event: Pointed) -> bool:
    """Check whether a ray hits a spring, rod or other connection, which opens itself."""
    direction = np.asarray(event.direction)
    length = float(np.linalg.norm(direction))
    if "joining" not in state.shown or not 1e-9 < length < 1e9:
        return False
    positions, wxyz = poses(state)
    joined = ties.joinings(state, positions, shapes.to_matrix(np.asarray(wxyz)))
    origin = np.asarray(event.origin)
    return any(joined[kind].hit(origin, direction / length) for kind in ties.OPENS)


def taken(state: State, client: int, aim: Aim, found: Spot) -> State:
    """Fill the cells of the selected field with a picked position, as one undo step."""
    vector = in_axes_of(state, aim, found)
    of = aim.name if aim.part else aim.bodies[0] if aim.bodies else ""
    after = with_client(state, client, aim=None)
    if vector is None:
        text = f"{of!r} no longer exists"
        return told(after, client, Notice("Not done", text, bad=True))

    def made() -> pg.Model:
        refuse_moved(aim, state.moved)
        model = state.model
        entries = tuple(((*aim.index, k), repr(x)) for k, x in enumerate(vector))
        if aim.part is None:
            row = row_named(model, of)
            change = row_edit(model, row, aim.field, entries, Display())
            return rows_edited(model, {of: change})
        d = state.derived
        at = places.at_home(d.names, d.positions, d.wxyz)
        return parts.changed(model, aim.part, of, aim.field, entries, Display(), at)

    return attempted(after, client, made, f"{aim.field} of {of} picked in 3D")


def in_axes_of(state: State, aim: Aim, found: Spot) -> tuple[float, ...] | None:
    """Convert a spot to the axes used by its field: the body, the other body or the parent."""
    owner = _owner(state, aim)
    if owner is None:
        return None
    if owner == found.body:
        return found.direction if aim.wants == "axis" else found.point
    (p, R), (q, S) = place(state, found.body), place(state, owner)
    if aim.wants == "axis":
        vector = S.T @ R @ np.asarray(found.direction)
    else:
        vector = S.T @ (p + R @ np.asarray(found.point) - q)
    x, y, z = (round(float(c), 12) + 0.0 for c in vector)
    return x, y, z


def _owner(state: State, aim: Aim) -> str | None:
    """Return the body that defines the axes of a field, or None if it no longer exists."""
    if aim.part is not None:
        try:
            item = parts.item_of(state.model, aim.part, aim.name)
        except Refusal:
            return None
        if aim.field in getattr(item, "PLACES", ()):
            places = getattr(item, aim.field)
            return places[aim.index[0]].body if aim.index[0] < len(places) else None
        return getattr(item, "other" if aim.field.startswith("other_") else "body", None)
    body = aim.bodies[0] if aim.bodies else ""
    if body not in state.graph.number:
        return None
    row = row_named(state.model, body)
    return row.parent if isinstance(row, pg.Beam) or aim.field == OF_PARENT else body


def place(state: State, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the displayed position (3,) and rotation (3, 3) of a body, or of the ground."""
    k = state.derived.number.get(name)
    if k is None:
        return np.zeros(3), np.eye(3)
    positions, wxyz = poses(state)
    return np.asarray(positions[k - 1]), shapes.to_matrix(np.asarray(wxyz[k - 1]))
