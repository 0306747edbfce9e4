"""Open pages: connecting, selecting, saving and autosave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from pydantic import Field

import pgraph_core as pg
from pgraph_core.errors import counted

from .. import constraints, plots
from ..constraints.update import picked, picking_of
from ..core.cells import Display
from ..core.edit import selected
from ..core.events import Event, FromPage, Leaving, OfServer, Text
from ..core.state import HOSTED, Notice, replied, told, with_client
from ..plots import KINDS, Signal
from ..run.keeping import kept


@dataclass(frozen=True)
class Saving:
    """A pending write of a file for one page."""

    client: int
    serial: int
    path: str
    model: pg.Model
    replace: bool  # also a file that this session did not write
    document: int = 0  # `State.document` of the model


@dataclass(frozen=True)
class Client(plots.Client, constraints.Client):
    lost: int = 0  # edits that had not begun when it went


@dataclass(frozen=True)
class State(plots.State, constraints.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    left: Mapping[str, Client] = field(default_factory=dict)
    saving: Saving | None = None
    not_kept: str = ""  # why edits are not kept on disk


# -- open pages: connecting, selecting, display settings and saving (pure) -------------------------


MOST_LEFT = 50  # pages that are remembered


class Connected(OfServer):
    """A page was opened."""

    def applied(self, state: State) -> State:
        page = state.CLIENT(notice=unkept(state.not_kept) or state.greeting)
        return replace(state, clients={**state.clients, self.client: page})


class Hello(FromPage):
    """Identify a page and its display. A page that was disconnected regains its state."""

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

    def applied(self, state: State) -> State:
        client = self.client
        if client not in state.clients:
            return state
        fresh = state.clients[client]
        old = state.left.get(self.page) or next(
            (x for key, x in state.clients.items() if x.page == self.page and key != client), fresh
        )
        page = replace(
            old.again(fresh), page=self.page, dark=self.dark, display=Display(*self.display)
        )
        if self.plots is not None and not page.plots:
            known = tuple(plot for plot in self.plots if Signal(*plot).quantity in KINDS)
            page = replace(page, plots=known)
        left = {name: x for name, x in state.left.items() if name != self.page}
        state = replace(state, clients={**state.clients, client: page}, left=left)
        state = told_of_lost(state, client)
        return selected(replied(state, client, self.serial), client, self.body, self.bodies)


class Disconnected(Leaving):
    """A page was closed, or its connection was lost. It is remembered for a while."""

    def applied(self, state: State) -> State:
        here = dict(state.clients)
        page = here.pop(self.client, None)
        if page is None or not page.page:
            return replace(state, clients=here)
        page = replace(page, lost=self.lost)
        if back := [key for key, other in here.items() if other.page == page.page]:
            here[back[0]] = replace(here[back[0]], lost=self.lost)
            return told_of_lost(replace(state, clients=here), back[0])
        others = [(name, old) for name, old in state.left.items() if name != page.page]
        return replace(state, clients=here, left=dict([*others, (page.page, page)][-MOST_LEFT:]))


def told_of_lost(state: State, client: int) -> State:
    """Tell a page that has come back about the edits that had not begun when it went."""
    if not (lost := state.clients[client].lost):
        return state
    text = f"The connection was lost before {counted(lost, 'edit')} of this page began. "
    text += "Only what was typed into cells is sent again."
    return with_client(state, client, lost=0, notice=Notice("Not done", text, bad=True))


class Sees(FromPage):
    """A view that is only updated while visible was shown or hidden on a page."""

    view: Text
    on: bool

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or self.view not in HOSTED:
            return state
        now = page.sees | {self.view} if self.on else page.sees - {self.view}
        return with_client(state, self.client, sees=now)


# -- selecting ---------------------------------------------------------------------------------


class Select(FromPage):
    """A body was clicked, or None for the background or the Escape key.

    If a constraint is waiting for a body, the click chooses that body instead.
    """

    body: Text | None

    def applied(self, state: State) -> State:
        if picking_of(state, self.client) is not None:
            return picked(state, self.client, self.body)
        page = state.clients.get(self.client)
        if self.body is None and page is not None and (without := page.escaped()) is not None:
            return replace(state, clients={**state.clients, self.client: without})
        bodies = () if self.body is None else (self.body,)
        return selected(state, self.client, self.body, bodies)


class SelectBodies(FromPage):
    """Select several rows and show the properties of `body`, the last of them."""

    body: Text
    bodies: tuple[Text, ...]

    def applied(self, state: State) -> State:
        if picking_of(state, self.client) is not None:
            return picked(state, self.client, self.body)
        return selected(state, self.client, self.body, self.bodies)


class ToggleBody(FromPage):
    """Add a body to the selection, or remove it.

    Clicks may be faster than responses, so only this state has the current selection.
    """

    body: Text

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or picking_of(state, self.client) is not None:
            return Select(self.client, self.body).applied(state)
        others = tuple(name for name in page.selected if name != self.body)
        bodies = others if self.body in page.selected else (*others, self.body)
        return selected(state, self.client, bodies[-1] if bodies else None, bodies)


# -- what a page shows -------------------------------------------------------------------------


class Theme(FromPage):
    dark: bool

    def applied(self, state: State) -> State:
        return with_client(state, self.client, dark=self.dark)


class SetDisplay(FromPage):
    """Set the unit or format in which a page displays a quantity."""

    what: Literal["angle", "length", "turn", "about"]
    value: Literal["rad", "deg", "m", "mm", "quaternion", "euler", "axis", "com", "origin"]

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or self.value not in CHOICES[self.what]:
            return state
        display = replace(page.display, **{self.what: self.value})
        return with_client(state, self.client, display=display)


CHOICES = {
    "angle": ("rad", "deg"), "length": ("m", "mm"), "turn": ("quaternion", "euler", "axis"),
    "about": ("com", "origin"),
}  # fmt: skip


# -- saving ------------------------------------------------------------------------------------


class Save(FromPage):
    """Write the model to a path on the server."""

    serial: int
    path: Text
    replace: bool = False  # also a file that this session did not write

    def applied(self, state: State) -> State:
        state = kept(state, self.client)
        saving = Saving(
            self.client, self.serial, self.path, state.model, self.replace, state.document
        )
        return replace(state, saving=saving)


class Saved(Event):
    """The outcome of a Save, without a problem if the file was written."""

    client: int
    serial: int
    path: str
    problem: str
    offer: str = ""

    def applied(self, state: State) -> State:
        state = replied(state, self.client, self.serial, self.problem, self.offer)
        if self.problem:
            return state
        asked = state.saving
        if asked is not None and (asked.client, asked.serial) == (self.client, self.serial):
            state = replace(state, saved=(asked.document, asked.model))
        meshes = any(shape.file for b in state.model.bodies for shape in b.shapes)
        text = f"{self.path}; its mesh files are in the folder 'meshes' next to it"
        return told(state, self.client, Notice("Saved", text if meshes else self.path))


class NotKept(Event):
    """Autosave failed, or works again if there is no problem."""

    problem: str

    def applied(self, state: State) -> State:
        notice = unkept(self.problem) or Notice("Autosave works again")
        pages = {key: replace(page, notice=notice) for key, page in state.clients.items()}
        return replace(state, clients=pages, not_kept=self.problem)


def unkept(problem: str) -> Notice | None:
    """Return the notice for all pages while edits cannot be saved automatically, or None."""
    text = f"{problem} Save the model yourself; saving will be tried again."
    return Notice("Autosave does not work", text, bad=True) if problem else None
