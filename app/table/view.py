"""The table of bodies: rows in the model's order."""

from __future__ import annotations

import viser

from ..core.bridge import Bridge
from ..core.state import State
from ..core.views import Payload, Place, audience, count, css


class TableView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("table")

    def render(self, old: State, new: State) -> None:
        clients = audience(old, new, new.derived is not old.derived)
        payload = table(new) if clients else {}
        for client in clients:
            self._bridge.send(client, "table", payload)


def table(state: State) -> Payload:
    """The rows: number, name, parent, joint, constraints and colour of each body."""
    d = state.derived
    rows = [
        {
            "name": body.name,
            "number": d.number[body.name],
            "parent": body.parent,
            "dof": body.dof,
            "joint": body.joint,
            "constraints": d.constraints[body.name],
            "color": css(d.colors[d.number[body.name] - 1]),
        }
        for body in state.model.bodies
    ]
    return {"rows": rows, "count": count(state)}


VIEWS = (Place(lambda desk: TableView(desk.bridge), 10, "bodies", "Bodies", viser.Icon.TABLE),)
