"""Switches for what is drawn in 3D, as far as the scene has it; and what the gizmo moves."""

from __future__ import annotations

from ..core.bridge import Bridge
from ..core.state import Client, State
from ..core.views import Payload, audience
from . import marks


class ShowView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("show")

    def render(self, old: State, new: State) -> None:
        changed = new.derived is not old.derived or new.shown != old.shown
        clients = set(audience(old, new, changed))
        for client, page in new.clients.items():
            before = old.clients.get(client, Client())
            moved = (before.gizmo, before.selection, before.follow) != (
                page.gizmo, page.selection, page.follow,
            )  # fmt: skip
            if client in clients or moved:
                self._bridge.send(client, "show", show(new, page))


def show(state: State, page: Client) -> Payload:
    """The switches there are, which are on, and what this page's gizmo moves."""
    switches = [
        {
            "what": what,
            "label": label,
            "on": page.follow if what == "follow" else what in state.shown,
        }
        for what, label in marks.showable(state)
    ]
    return {"switches": switches, "gizmo": page.gizmo, "selected": page.selection}
