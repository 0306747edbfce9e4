"""Open pages: connecting, selecting, display settings and saving (pure)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pydantic import Field

from ..constraints import update as constraints
from ..core.cells import Display
from ..core.edit import selected
from ..core.events import Event, FromPage, OfServer, Text, on, on_page
from ..core.state import Notice, replied, told, with_client
from ..plots import KINDS, Signal
from . import Saving, State

MOST_LEFT = 50  # pages that are remembered


@dataclass(frozen=True)
class Connected(OfServer):
    """A page was opened."""


@on(Connected)
def connected(state: State, event: Connected) -> State:
    page = state.CLIENT(notice=unkept(state.not_kept) or state.greeting)
    return replace(state, clients={**state.clients, event.client: page})


@dataclass(frozen=True)
class Hello(FromPage):
    """A page identifies itself and its display. It may be a reconnection."""

    serial: int
    page: Annotated[str, Field(max_length=100)]  # its own name, the same as long as it is open
    body: Text | None
    bodies: tuple[Text, ...]
    dark: bool
    display: tuple[
        Literal["rad", "deg"],
        Literal["m", "mm"],
        Literal["quaternion", "euler", "axis"],
        Literal["com", "origin"],
    ]
    plots: Annotated[tuple[tuple[Text, Text], ...], Field(max_length=40)] | None = None


@on(Hello)
def greeted(state: State, event: Hello) -> State:
    """Restore a page to its state before the connection was lost, as far as that is known."""
    client = event.client
    if client not in state.clients:
        return state
    fresh = state.clients[client]
    old = state.left.get(event.page) or next(
        (x for key, x in state.clients.items() if x.page == event.page and key != client), fresh
    )
    page = replace(
        old.again(fresh), page=event.page, dark=event.dark, display=Display(*event.display)
    )
    if event.plots is not None and not page.plots:
        known = tuple(plot for plot in event.plots if Signal(*plot).quantity in KINDS)
        page = replace(page, plots=known)
    left = {name: x for name, x in state.left.items() if name != event.page}
    state = replace(state, clients={**state.clients, client: page}, left=left)
    return selected(replied(state, client, event.serial), client, event.body, event.bodies)


@dataclass(frozen=True)
class Disconnected(OfServer):
    """A page was closed, or its connection was lost."""


@on(Disconnected)
def disconnected(state: State, event: Disconnected) -> State:
    """Remove a page, keeping its state for a reconnection."""
    here = dict(state.clients)
    page = here.pop(event.client, None)
    if page is None or not page.page:
        return replace(state, clients=here)
    others = [(name, old) for name, old in state.left.items() if name != page.page]
    return replace(state, clients=here, left=dict([*others, (page.page, page)][-MOST_LEFT:]))


@dataclass(frozen=True)
class Sees(FromPage):
    """A view that works only while visible came into sight on a page, or went out of sight."""

    view: Literal["joints", "constraints", "reports", "scenario", "events", "search"]
    on: bool


@on(Sees)
def sees(state: State, event: Sees) -> State:
    page = state.clients.get(event.client)
    if page is None:
        return state
    now = page.sees | {event.view} if event.on else page.sees - {event.view}
    return with_client(state, event.client, sees=now)


# -- selecting ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Select(FromPage):
    """A body was clicked, or None for the background or the Escape key."""

    body: Text | None


@on(Select)
def select(state: State, event: Select) -> State:
    """Select a body, or use it as the picked body of a constraint."""
    if constraints.picking_of(state, event.client) is not None:
        return constraints.picked(state, event.client, event.body)
    page = state.clients.get(event.client)
    if event.body is None and page is not None and (without := page.escaped()) is not None:
        return replace(state, clients={**state.clients, event.client: without})
    bodies = () if event.body is None else (event.body,)
    return selected(state, event.client, event.body, bodies)


@dataclass(frozen=True)
class SelectBodies(FromPage):
    """Select several rows and show the properties of `body`, the last of them."""

    body: Text
    bodies: tuple[Text, ...]


@on(SelectBodies)
def select_bodies(state: State, event: SelectBodies) -> State:
    if constraints.picking_of(state, event.client) is not None:
        return constraints.picked(state, event.client, event.body)
    return selected(state, event.client, event.body, event.bodies)


@dataclass(frozen=True)
class ToggleBody(FromPage):
    """Add a body to the selection, or remove it.

    Clicks may be quicker than answers: what is selected by then is known here alone.
    """

    body: Text


@on(ToggleBody)
def toggle_body(state: State, event: ToggleBody) -> State:
    page = state.clients.get(event.client)
    if page is None or constraints.picking_of(state, event.client) is not None:
        return select(state, Select(event.client, event.body))
    others = tuple(name for name in page.selected if name != event.body)
    bodies = others if event.body in page.selected else (*others, event.body)
    return selected(state, event.client, bodies[-1] if bodies else None, bodies)


# -- what a page shows -------------------------------------------------------------------------


@on_page(dark="dark")
@dataclass(frozen=True)
class Theme(FromPage):
    dark: bool


@dataclass(frozen=True)
class SetDisplay(FromPage):
    """Set the unit or format in which a page displays a quantity."""

    what: Literal["angle", "length", "turn", "about"]
    value: Literal["rad", "deg", "m", "mm", "quaternion", "euler", "axis", "com", "origin"]


CHOICES = {
    "angle": ("rad", "deg"), "length": ("m", "mm"), "turn": ("quaternion", "euler", "axis"),
    "about": ("com", "origin"),
}  # fmt: skip


@on(SetDisplay)
def displayed(state: State, event: SetDisplay) -> State:
    page = state.clients.get(event.client)
    if page is None or event.value not in CHOICES[event.what]:
        return state
    display = replace(page.display, **{event.what: event.value})
    return with_client(state, event.client, display=display)


# -- saving ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Save(FromPage):
    """Write the model to a path on the server."""

    serial: int
    path: Text
    replace: bool = False  # also a file that this session did not write


@on(Save)
def save(state: State, event: Save) -> State:
    saving = Saving(
        event.client, event.serial, event.path, state.model, event.replace, state.document
    )
    return replace(state, saving=saving)


@dataclass(frozen=True)
class Saved(Event):
    """The outcome of a Save, without a problem if the file was written."""

    client: int
    serial: int
    path: str
    problem: str
    offer: str = ""


@on(Saved)
def saved(state: State, event: Saved) -> State:
    state = replied(state, event.client, event.serial, event.problem, event.offer)
    if event.problem:
        return state
    asked = state.saving
    if asked is not None and (asked.client, asked.serial) == (event.client, event.serial):
        state = replace(state, saved=(asked.document, asked.model))
    meshes = any(shape.file for b in state.model.bodies for shape in b.shapes)
    text = f"{event.path}; its mesh files are in the folder 'meshes' next to it"
    return told(state, event.client, Notice("Saved", text if meshes else event.path))


@dataclass(frozen=True)
class NotKept(Event):
    """Autosave failed, or works again if there is no problem."""

    problem: str


@on(NotKept)
def not_kept(state: State, event: NotKept) -> State:
    notice = unkept(event.problem) or Notice("Autosave works again")
    pages = {key: replace(page, notice=notice) for key, page in state.clients.items()}
    return replace(state, clients=pages, not_kept=event.problem)


def unkept(problem: str) -> Notice | None:
    """Return the notice for all pages while edits cannot be saved automatically, or None."""
    text = f"{problem} Save the model yourself; it is tried again."
    return Notice("Autosave does not work", text, bad=True) if problem else None
