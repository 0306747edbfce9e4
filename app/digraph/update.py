"""The digraph: a node dropped on another, and stepping through the figures (pure)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pgraph_core as pg

from ..core.edit import answered
from ..core.events import FromPage, Text, on
from ..core.state import State, with_client


@dataclass(frozen=True)
class Drop(FromPage):
    """A body was dropped on its new parent, or on a second one: that closes a `loop`."""

    serial: int
    body: Text
    parent: Text
    loop: bool


@on(Drop)
def drop(state: State, event: Drop) -> State:
    def make() -> pg.Model:
        if not event.loop:
            return state.model.edit(event.body, parent=event.parent)
        if state.model.body(event.body).parent == event.parent:
            text = f"{event.parent} is its parent already; a loop needs another body"
            raise pg.ModelError(pg.Problem(f"body '{event.body}'", "parent", text))
        return state.model.close_loop(event.body, event.parent)

    label = f"loop {event.body}-{event.parent}" if event.loop else f"parent of {event.body}"
    return answered(state, event.client, event.serial, make, label)


@dataclass(frozen=True)
class StepThrough(FromPage):
    """Show how Pgraph is made (Fig. 4), or how frames are updated along it (Fig. 8)."""

    what: Literal["", "pgraph", "frames"]


@on(StepThrough)
def step_through(state: State, event: StepThrough) -> State:
    return with_client(state, event.client, walk=event.what)
