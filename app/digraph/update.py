"""What the events of the digraph do (pure)."""

from __future__ import annotations

import pgraph_core as pg

from .. import events
from ..core.state import Reply, State, with_client
from ..events import Event
from ..model.update import attempted


def update(state: State, event: Event) -> State | None:
    """The state after an event of the digraph; None for any other event."""
    match event:
        case events.Drop():
            return dropped(state, event)
        case events.StepThrough(client, what):
            return with_client(state, client, walk=what)
        case _:
            return None


def dropped(state: State, event: events.Drop) -> State:
    """The new parent or the loop, as one undo step; or the sentence that refuses it."""
    client, model = event.client, state.model
    try:
        after = _dropped(model, event)
    except pg.PgraphError as error:
        return with_client(state, client, reply=Reply(event.serial, str(error)))
    what = f"loop {event.body}-{event.parent}" if event.loop else f"parent of {event.body}"
    state = attempted(state, client, lambda: after, what)
    return with_client(state, client, reply=Reply(event.serial, ""))


def _dropped(model: pg.Model, event: events.Drop) -> pg.Model:
    if not event.loop:
        return model.edit(event.body, parent=event.parent)
    if model.body(event.body).parent == event.parent:
        text = f"{event.parent} is its parent already; a loop needs another body"
        raise pg.ModelError(pg.Problem(f"body '{event.body}'", "parent", text))
    return model.close_loop(event.body, event.parent)
