"""The layout of the page: its panels, with the views of all features."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from .core.bridge import Bridge
from .core.events import Event
from .core.state import State
from .core.views import Desk, PanelName, made
from .features import places
from .session.update import Connected, Disconnected
from .session.view import ACCENT

LEFT, RIGHT = 450, 330  # widths of the docks [px]
PLAYBACK = 470  # width [px] of the playback; its style widens it where there is room


class Page:
    """Docks left and right of the 3D view, playback floating at its bottom."""

    def __init__(self, bridge: Bridge, send: Callable[[Event], None]):
        server = bridge.server
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=ACCENT)
        names: tuple[PanelName, ...] = ("bodies", "graph", "properties", "playback")
        panels: dict[PanelName, viser.PanelHandle] = {name: gui.add_panel() for name in names}
        docks = Docks(bridge, panels["bodies"], gui.main_panel)
        self.views = (*made(places(), Desk(bridge, send, panels)), docks)
        panels["bodies"].dock_left()
        panels["bodies"].set_width(LEFT)
        panels["graph"].dock_below(panels["bodies"])
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT)
        panels["properties"].dock_below(gui.main_panel)
        panels["playback"].float(x=15, y=-15, width=PLAYBACK)

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            bridge.connect(client)
            send(Connected(client.client_id))

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            send(Disconnected(client.client_id))


class Docks:
    """Docks that leave the 3D view its share of a small window."""

    def __init__(self, bridge: Bridge, left: viser.PanelHandle, right: Any):
        self._bridge, self._left, self._right = bridge, left, right
        self._widths: dict[int, tuple[float, float]] = {}

    def render(self, old: State, new: State) -> None:
        for client, page in new.clients.items():
            if page.window is None:
                continue
            wanted = widths(page.window)
            if wanted != self._widths.get(client, (LEFT, RIGHT)):
                self._widths[client] = wanted
                for panel, width in zip((self._left, self._right), wanted):
                    self._bridge.set_width(client, panel, width)
        for gone in self._widths.keys() - new.clients.keys():
            del self._widths[gone]


def widths(window: float) -> tuple[float, float]:
    """Of the left and the right dock in a window as wide as this [px]."""
    left, right = min(LEFT, max(0.4 * window, 200)), min(RIGHT, max(0.28 * window, 180))
    return round(left), round(right)
