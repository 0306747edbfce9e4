"""Views, which draw changes in their part of the state, and their positions on the page.

A feature lists its own in `VIEWS` of its `view.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from pgraph_core.show.shapes import hue_of

from .bridge import Bridge
from .cells import Payload as Payload
from .events import Event, FromPage
from .state import State
from .store import View


def audience(old: State, new: State, changed: bool) -> list[int]:
    """Return the pages to update: all pages after a change, or else only newly opened ones."""
    return [client for client in new.clients if changed or client not in old.clients]


def watching(old: State, new: State, view: str, changed: bool) -> list[int]:
    """Return the pages on which a view that is sent only while visible is out of date.

    If another model was opened that is all of them: a hidden tab keeps nothing of the last one.
    """
    opened = new.framed != old.framed
    return [
        client for client, page in new.clients.items()
        if opened or (view in page.sees
        and (changed or client not in old.clients or view not in old.clients[client].sees))
    ]  # fmt: skip


R = TypeVar("R", bound=FromPage)


def requests(old: State, new: State, kind: type[R]) -> list[R]:
    """Return the new requests of this kind, which have not been answered."""
    found = []
    for client, page in new.clients.items():
        before = old.clients.get(client)
        if isinstance(page.asked, kind) and not (before and before.asked is page.asked):
            found.append(page.asked)
    return found


def hue(branch: int) -> str:
    """Return the hue for a branch as a CSS variable, which each theme defines."""
    return f"var(--branch-{hue_of(branch)})"


# -- places ----------------------------------------------------------------------------------------


# parts of the page; "display" is the menu of what is drawn, "drawer" the results below the 3D view
Slot = Literal["top", "left", "view", "display", "drawer", "right", "run", "time", "trust"]


@dataclass(frozen=True)
class Desk:
    """The bridge and the store's `send`, passed to views on construction."""

    bridge: Bridge
    send: Callable[[Event], None]


@dataclass(frozen=True)
class Host:
    """The position of a view on the page: its slot, and the tab within "left" or "drawer".

    Hosts of a slot stand in the order of their places, unless they have their own.
    """

    view: str
    slot: Slot
    tab: str = ""
    order: int | None = None


class Place:
    """A view and its hosts. A view without hosts draws in 3D only, or nothing.

    Views are made, and drawn after each event, by increasing `order`.
    """

    def __init__(self, make: Callable[[Desk], View], order: int, *hosts: Host):
        self.make, self.order = make, order
        self.hosts = [h if h.order is not None else replace(h, order=order) for h in hosts]


def made(places: list[Place], desk: Desk) -> tuple[View, ...]:
    """Create all views, and send the page with their hosts."""
    places = sorted(places, key=lambda place: place.order)
    views = tuple(place.make(desk) for place in places)
    hosts = sorted((host for place in places for host in place.hosts), key=lambda h: h.order or 0)
    desk.bridge.publish([(host.view, host.slot, host.tab) for host in hosts])
    return views
