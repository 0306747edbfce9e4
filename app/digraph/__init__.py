"""The digraph of the paper, and its steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import pgraph_core as pg

from .. import pose
from ..core.events import FromPage, ModelEdit, Text
from ..core.state import with_client
from ..properties.update import row_named, rows_edited


@dataclass(frozen=True)
class Client(pose.Client):
    walk: str = ""  # stepped figure: "pgraph" (Fig. 4), "frames" (Fig. 8) or ""

    def afresh(self) -> Self:
        return replace(super().afresh(), walk="")


@dataclass(frozen=True)
class State(pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)


# -- the digraph: dropping a node on another, and stepping through the figures (pure) --------------


class Drop(ModelEdit):
    """A body was dropped on its new parent, or on a second one, which closes a `loop`."""

    serial: int
    body: Text
    parent: Text
    loop: bool

    def edit(self, state: State) -> tuple[pg.Model, str]:
        body, parent = self.body, self.parent
        if not self.loop:
            return rows_edited(state.model, {body: {"parent": parent}}), f"parent of {body}"
        if row_named(state.model, body).parent == parent:
            text = f"{parent} is its parent already; a loop needs another body"
            raise pg.ModelError(pg.Problem(f"body '{body}'", "parent", text))
        return state.model.close_loop(body, parent), f"loop {body}-{parent}"


class StepThrough(FromPage):
    """Show step by step how Pgraph is built (Fig. 4), or frames are updated along it (Fig. 8)."""

    what: Literal["", "pgraph", "frames"]

    def applied(self, state: State) -> State:
        return with_client(state, self.client, walk=self.what)
