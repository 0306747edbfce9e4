"""What pages look at (pure)."""

from __future__ import annotations

from .. import events
from ..core.state import Inspected, Notice, State, told, with_client
from ..events import Event


def update(state: State, event: Event) -> State | None:
    """The state after an event of looking; None for any other event."""
    match event:
        case events.Inspect(client, what, rows, columns):
            inspected = Inspected(what, rows, columns) if what else None
            return with_client(state, client, inspected=inspected)
        case events.ExportOperator(client, what, suffix) if what and client in state.clients:
            asked = (state.clients[client].exported[0] + 1, what, suffix)
            return with_client(state, client, exported=asked)
        case events.Unreadable(sentences):
            notice = Notice("Drawn as a box", " ".join(sentences), bad=True)
            for client in state.clients:
                state = told(state, client, notice)
            return state
        case _:
            return None
