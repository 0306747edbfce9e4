"""The digraph and the vectors Pgraph and jdof above it."""

from __future__ import annotations

from ..client.bridge import Bridge
from ..state import State
from . import Payload, audience, css


class DigraphView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("digraph")

    def render(self, old: State, new: State) -> None:
        clients = audience(old, new, new.derived is not old.derived)
        payload = digraph(new) if clients else {}
        for client in clients:
            self._bridge.send(client, "digraph", payload)


def digraph(state: State) -> Payload:
    """Places, numbers and kinds of the nodes, the two vectors, and the constraints."""
    d = state.derived
    loops = [loop._asdict() for loop in d.loops]
    return {
        "kind": d.layout.kind,
        "x": d.layout.x,
        "y": d.layout.y,
        "width": d.layout.width,
        "height": d.layout.height,
        "names": d.names,
        "parent": d.parent,
        "dof": [state.model.body(name).dof for name in d.names],
        "colors": [css(color) for color in d.colors],
        "tips": sorted(d.tips),
        "separation": sorted(d.separation),
        "pgraph": d.pgraph,
        "jdof": d.jdof,
        "loops": loops,
    }
