"""The digraph: dropping a node on another, and stepping through the figures (pure)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pgraph_core as pg

from ..core.events import FromPage, Text, on_edit, on_page
from . import State


@dataclass(frozen=True)
class Drop(FromPage):
    """A body was dropped on its new parent, or on a second one, which closes a `loop`."""

    serial: int
    body: Text
    parent: Text
    loop: bool


@on_edit(Drop)
def drop(state: State, event: Drop) -> tuple[pg.Model, str]:
    body, parent = event.body, event.parent
    if not event.loop:
        return state.model.edit(body, parent=parent), f"parent of {body}"
    if state.model.body(body).parent == parent:
        text = f"{parent} is its parent already; a loop needs another body"
        raise pg.ModelError(pg.Problem(f"body '{body}'", "parent", text))
    return state.model.close_loop(body, parent), f"loop {body}-{parent}"


@on_page(walk="what")
@dataclass(frozen=True)
class StepThrough(FromPage):
    """Show step by step how Pgraph is built (Fig. 4), or frames are updated along it (Fig. 8)."""

    what: Literal["", "pgraph", "frames"]
