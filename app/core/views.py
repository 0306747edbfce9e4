"""Views: each draws its part of the state, and only what changed; where each is on the page.

A feature lists its own in `VIEWS` of its `view.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import viser

from pgraph_core.errors import counted
from pgraph_core.show.shapes import Color

from .bridge import Bridge
from .cells import Payload as Payload
from .events import Event
from .state import State
from .store import View


def audience(old: State, new: State, changed: bool) -> list[int]:
    """The pages to send to: all where something changed, else those that have just come."""
    return [client for client in new.clients if changed or client not in old.clients]


def watching(old: State, new: State, view: str, changed: bool) -> list[int]:
    """Pages whose picture of a view that is sent only where it is in sight is out of date.

    Where another model was opened that is all of them: a hidden tab keeps nothing of the last one.
    """
    opened = new.framed != old.framed
    return [
        client for client, page in new.clients.items()
        if opened or (view in page.sees
        and (changed or client not in old.clients or view not in old.clients[client].sees))
    ]  # fmt: skip


def css(color: Color) -> str:
    """A colour as the page writes it."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def count(state: State) -> str:
    """'16 bodies, 21 DoF'."""
    return f"{counted(len(state.derived.names), 'body', 'bodies')}, {state.derived.dof} DoF"


# -- places ----------------------------------------------------------------------------------------


PanelName = Literal["bodies", "graph", "properties", "playback"]


@dataclass(frozen=True)
class Desk:
    """What views are made with: the bridge, the store's `send`, the panels by name."""

    bridge: Bridge
    send: Callable[[Event], None]
    panels: dict[PanelName, viser.PanelHandle]


@dataclass(frozen=True)
class Place:
    """A view and its tab. Without a panel it is in viser's own, or only in the 3D view.

    Views are made, and drawn after each event, by increasing `order`; so are the tabs of a panel.
    Views with the same panel and tab share it.
    """

    make: Callable[[Desk], View]
    order: int
    panel: PanelName | None = None
    tab: str = ""
    icon: viser.IconName | None = None


def made(places: list[Place], desk: Desk) -> tuple[View, ...]:
    """All views, each in its tab."""
    tabs: dict[tuple[PanelName, str], viser.GuiTabHandle] = {}
    views: list[View] = []
    for place in sorted(places, key=lambda place: place.order):
        if place.panel is None:
            views.append(place.make(desk))
            continue
        key = (place.panel, place.tab)
        if key not in tabs:
            tabs[key] = desk.panels[place.panel].add_tab(place.tab, place.icon)
        with tabs[key]:
            views.append(place.make(desk))
    return tuple(views)
