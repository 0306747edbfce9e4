"""The table of bodies: rows in the model's order."""

from __future__ import annotations

from ..core.bridge import Bridge
from ..core.state import State
from ..core.views import Host, Payload, Place, audience, count, css
from .paste import COPIED, copied


class TableView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        clients = audience(old, new, new.derived is not old.derived)
        payload = table(new) if clients else {}
        for client in audience(old, new, new.framed != old.framed):
            self._bridge.send(client, "opened", new.framed)  # first: what is half typed goes
        for client in clients:
            self._bridge.send(client, "table", payload)
        for client, page in new.clients.items():
            before = old.clients.get(client)
            chosen = page.selected
            same = before is not None and before.selected == chosen and new.model is old.model
            if not same and 0 < len(chosen) <= COPIED:
                text = copied(new.model, chosen)  # a browser asks for it at once
                self._bridge.send(client, "copied", {"bodies": chosen, "text": text})


def table(state: State) -> Payload:
    """The rows: number, name, parent, joint, constraints and colour of each body."""
    d, colors = state.derived, state.colors
    ids = state.rows.of(("bodies",), len(state.model.bodies))
    rows = [
        {
            "id": number,
            "name": body.name,
            "number": d.number[body.name],
            "parent": body.parent,
            "dof": body.dof,
            "joint": body.joint,
            "constraints": d.constraints[body.name],
            "color": css(colors[d.number[body.name] - 1]),
        }
        for number, body in zip(ids, state.model.bodies)
    ]
    return {"rows": rows, "count": count(state)}


VIEWS = (Place(lambda desk: TableView(desk.bridge), 10, Host("table", "left", "Bodies")),)
