"""The coordinates of the joints as sliders, on the pages that have them in view."""

from __future__ import annotations

from ..core.bridge import Bridge
from ..core.state import Client, State
from ..core.views import Payload, css
from .solving import coordinates

MOST = 100  # sliders; of more joints only those on the way to the selected body


class JointsView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("joints")

    def render(self, old: State, new: State) -> None:
        moved = new.run is not old.run or new.playback != old.playback
        changed = any((
            new.derived is not old.derived,
            new.posed is not old.posed,
            new.pose_problem != old.pose_problem,
            moved and not new.playback.playing,
        ))  # fmt: skip
        for client, page in new.clients.items():
            before = old.clients.get(client, Client())
            another = before.selection != page.selection or not before.posing
            if page.posing and (changed or another):
                self._bridge.send(client, "joints", joints(new, page.selection))


def joints(state: State, selection: str | None) -> Payload:
    """Sliders in number order, and what there is to say."""
    d, names = state.derived, None
    if d.dof > MOST:
        names = path(state, selection)
    rows = [
        {
            "body": c.body,
            "index": c.index,
            "label": c.label,
            "value": c.value,
            "low": c.low,
            "high": c.high,
            "unit": c.unit,
            "color": css(d.colors[d.number[c.body] - 1]),
        }
        for c in coordinates(state, names)
    ]
    return {
        "rows": rows,
        "selected": selection,
        "problem": state.pose_problem,
        "posed": state.pose is not None,
        "hint": hint(state, rows),
    }


def hint(state: State, rows: list[Payload]) -> str:
    """What to say where there are no sliders, or not all."""
    if state.derived.dof > MOST:
        more = f"{state.derived.dof} degrees of freedom are too many to list: "
        return more + ("shown is the way from the ground to the selection." if rows
                       else "select a body.")  # fmt: skip
    return "" if rows else "Nothing here moves."


def path(state: State, selection: str | None) -> frozenset[str]:
    """Names from the selected body down to the ground."""
    names, parent = state.derived.names, state.derived.parent
    k, found = state.derived.number.get(selection or "", 0), []
    while k > 0:
        found.append(names[k - 1])
        k = parent[k - 1]
    return frozenset(found)
