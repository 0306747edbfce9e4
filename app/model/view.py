"""The model: new, open, save, undo."""

from __future__ import annotations

import json

from ..core.bridge import Bridge
from ..core.places import Place
from ..core.state import State
from ..core.views import Payload, audience, count


class ToolbarView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("toolbar")

    def render(self, old: State, new: State) -> None:
        changed = any(
            getattr(old, part) is not getattr(new, part)
            for part in ("derived", "undo", "redo", "gallery", "kept")
        )
        clients = audience(old, new, changed)
        payload = toolbar(new) if clients else {}
        for client in clients:
            self._bridge.send(client, "toolbar", payload)


def toolbar(state: State) -> Payload:
    """Everything the toolbar shows."""
    return {
        "name": state.model.name,
        "count": count(state),
        "undo": state.undo[-1].label if state.undo else None,
        "redo": state.redo[-1].label if state.redo else None,
        "gallery": gallery(state),
        "kept": list(state.kept),
    }


def gallery(state: State) -> list[tuple[str, str]]:
    """The built-in models, with how many bodies each has."""
    found = []
    for name, text in state.gallery.items():
        data = json.loads(text)
        n = len(data.get("bodies", ()))
        said = data.get("description") or f"{n} {'body' if n == 1 else 'bodies'}"
        found.append((name, said))
    return found


VIEWS = (Place(lambda desk: ToolbarView(desk.bridge), 30),)
