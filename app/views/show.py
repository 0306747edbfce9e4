"""What is drawn over the bodies, as switches."""

from __future__ import annotations

from ..client.bridge import Bridge
from ..state import State
from . import audience


class ShowView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("show")

    def render(self, old: State, new: State) -> None:
        for client in audience(old, new, new.shown != old.shown):
            self._bridge.send(client, "show", sorted(new.shown))
