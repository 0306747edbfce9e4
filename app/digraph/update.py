"""The digraph: dropping a node on another, and stepping through the figures (pure)."""

from __future__ import annotations

from typing import Literal

import pgraph_core as pg

from ..core.events import FromPage, ModelEdit, Text
from ..core.state import with_client
from . import State


class Drop(ModelEdit):
    """A body was dropped on its new parent, or on a second one, which closes a `loop`."""

    serial: int
    body: Text
    parent: Text
    loop: bool

    def edit(self, state: State) -> tuple[pg.Model, str]:
        body, parent = self.body, self.parent
        if not self.loop:
            return state.model.edit(body, parent=parent), f"parent of {body}"
        if state.model.body(body).parent == parent:
            text = f"{parent} is its parent already; a loop needs another body"
            raise pg.ModelError(pg.Problem(f"body '{body}'", "parent", text))
        return state.model.close_loop(body, parent), f"loop {body}-{parent}"


class StepThrough(FromPage):
    """Show step by step how Pgraph is built (Fig. 4), or frames are updated along it (Fig. 8)."""

    what: Literal["", "pgraph", "frames"]

    def applied(self, state: State) -> State:
        return with_client(state, self.client, walk=self.what)
