"""The table of bodies, with rows in the order of the model."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from pgraph_core.show.digraph import gutter

from ..core.state import CONTACT, freedoms
from ..core.views import NOTHING, Host, Payload, Place, hue, topic
from . import Client, State
from .paste import COPIED, copied


def table(state: State) -> Payload:
    """Return the rows: number, name, parent, joint, constraint types, hue, part of the digraph."""
    d, bodies = state.graph, state.model.rows
    ids, beams = state.ids, {beam.name for beam in state.model.beams}
    order = {body.name: row for row, body in enumerate(bodies)}
    dof = freedoms(state.whole)
    ends = tuple((loop.body, loop.other) for loop in d.loops)
    lanes = _lanes(d.parent, tuple(order[name] for name in d.names), ends)
    kinds = {CONTACT: CONTACT, "limits": "limits"}
    kinds |= {contact.name: CONTACT for contact in state.model.contacts}
    tied = {constraint.name: constraint.kind for constraint in state.model.constraints}
    rows = []
    for row, body in enumerate(bodies):
        k = d.number[body.name]
        kind = "tip" if k in d.tips else "separation" if k in d.separation else ""
        rows.append({
            "id": ids[body.name],
            "name": body.name,
            "number": k,
            "parent": body.parent,
            "dof": dof[body.name],
            "joint": "beam" if body.name in beams else body.joint,
            "constraints": d.constraints[body.name],
            "constraint": types(d.constraints[body.name], kinds | tied),
            "tied": not tied.keys().isdisjoint(d.constraints[body.name]),
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


def lines(state: State, page: Client) -> Payload:
    """Return the selected rows as text. The browser requires the text immediately when rows are
    copied."""
    chosen = tuple(name for name in page.selected if name in state.model.row)
    if not 0 < len(chosen) <= COPIED:
        return NOTHING
    return {"bodies": chosen, "text": copied(state.model, chosen)}


def types(names: tuple[str, ...], kinds: Mapping[str, str]) -> str:
    """Return the kinds of the named constraints, without repetition, or that of a joint alone."""
    return ", ".join(dict.fromkeys(kinds[name] for name in names)) or "holonomic"


_lanes = lru_cache(maxsize=16)(gutter)


VIEWS = (
    Place(topic("opened", lambda state: state.framed, "framed"), 10),  # discards half-typed text
    Place(topic("table", table, "graph"), 10, Host("table", "left", "Bodies")),
    Place(topic("copied", lines, page=lambda state, page: (page.selected, state.model)), 10),
)
