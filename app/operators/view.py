"""The Operators tab: pattern and values at what is shown, on the pages that look at it."""

from __future__ import annotations

import time

import viser

import pgraph_core as pg

from ..core.bridge import Bridge
from ..core.state import Client, Inspected, State
from ..core.views import Payload, Place, count, plural
from . import matrices

PACE = 0.2  # [s] between pictures while a run plays


class OperatorsView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._sent = 0.0  # when, while a run plays
        bridge.host("operators")

    def render(self, old: State, new: State) -> None:
        moved = new.playback.time != old.playback.time or new.pose is not old.pose
        late = not new.playback.moves or time.monotonic() - self._sent > PACE
        changed = new.derived is not old.derived or (moved and late)
        for client, page in new.clients.items():
            before = old.clients.get(client, Client())
            if page.inspected is not None and (changed or before.inspected != page.inspected):
                self._sent = time.monotonic()
                self._bridge.send(client, "operator", operator(new, page.inspected))
            if page.exported != before.exported:
                self._download(client, new, *page.exported[1:])

    def _download(self, client: int, state: State, what: str, suffix: str) -> None:
        handle = self._bridge.server.get_clients().get(client)
        if handle is not None and not matrices.available(state, what):
            content = matrices.as_file(state, what, suffix)
            handle.send_file_download(f"{what}.{suffix}", content, save_immediately=True)


def operator(state: State, part: Inspected) -> Payload:
    """The part of an operator in view, or why there is none; and what the model counts."""
    payload = {"what": part.what, "facts": facts(state), "titles": matrices.TITLES}
    problem = matrices.available(state, part.what)
    if not problem:
        try:
            shown = matrices.picture(matrices.matrix(state, part.what), part)
            rows, columns = matrices.labels(state, part.what)
        except pg.PgraphError as error:
            problem = str(error)
        else:
            equation = matrices.EQUATIONS[part.what]
            named = {
                "row_names": rows[slice(*shown.rows)],
                "column_names": columns[slice(*shown.columns)],
            }
            return payload | shown._asdict() | named | {"equation": equation, "problem": ""}
    return payload | {"problem": problem}


def facts(state: State) -> str:
    """'16 bodies, 21 DoF, 2 separation bodies, 4 tip bodies'."""
    d = state.derived
    separation = plural(len(d.separation), "separation body", "separation bodies")
    return f"{count(state)}, {separation}, {plural(len(d.tips), 'tip body', 'tip bodies')}"


VIEWS = (
    Place(lambda desk: OperatorsView(desk.bridge), 23, "graph", "Operators", viser.Icon.GRID_DOTS),
)
