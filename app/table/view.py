"""The table of bodies, with rows in the order of the model."""

from __future__ import annotations

from functools import lru_cache

from pgraph_core.show.digraph import gutter

from ..core.bridge import Bridge
from ..core.derived import CONTACT
from ..core.views import Host, Payload, Place, audience, hue
from . import State
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
    """Return the rows: number, name, parent, joint, constraints, hue and part of the digraph."""
    d, bodies = state.derived, state.model.bodies
    ids = state.rows.of(("bodies",), len(bodies))
    order = {body.name: row for row, body in enumerate(bodies)}
    ends = tuple((loop.body, loop.other) for loop in d.loops)
    lanes = _lanes(d.parent, tuple(order[name] for name in d.names), ends)
    constraints, looped = {c.name for c in state.model.constraints}, {loop.name for loop in d.loops}
    kinds = {
        "closes a loop": constraints & looped,
        "has constraints": constraints - looped,
        "has contacts": {CONTACT, *(contact.name for contact in state.model.contacts)},
        "has limits": {"limits"},
    }
    rows = []
    for row, (id_, body) in enumerate(zip(ids, bodies)):
        k = d.number[body.name]
        kind = "tip" if k in d.tips else "separation" if k in d.separation else ""
        rows.append({
            "id": id_,
            "name": body.name,
            "number": k,
            "parent": body.parent,
            "dof": body.dof,
            "joint": body.joint,
            "constraints": d.constraints[body.name],
            "held": held(d.constraints[body.name], kinds),
            "color": hue(d.branches[k - 1]),
            "kind": kind,
            "lane": lanes.lane[k - 1],
            "marks": lanes.marks[row],
        })  # fmt: skip
    return {
        "rows": rows,
        "count": state.counts,
        "lanes": max(lanes.lane, default=0) + 1,
        "loops": [loop.name for loop in d.loops],
        "beside": lanes.loops,
    }


def held(names: tuple[str, ...], kinds: dict[str, set[str]]) -> str:
    """Return the kinds that occur among the names, such as 'closes a loop, has contacts'."""
    return ", ".join(text for text, of in kinds.items() if not of.isdisjoint(names))


_lanes = lru_cache(maxsize=16)(gutter)


VIEWS = (Place(lambda desk: TableView(desk.bridge), 10, Host("table", "left", "Bodies")),)
