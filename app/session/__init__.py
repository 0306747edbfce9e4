"""Open pages: connecting, selecting, saving and autosave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pgraph_core as pg

from .. import constraints, plots


@dataclass(frozen=True)
class Saving:
    """A pending write of a file for one page."""

    client: int
    serial: int
    path: str
    model: pg.Model
    replace: bool  # also a file that this session did not write
    document: int = 0  # `State.document` of the model


@dataclass(frozen=True)
class Client(plots.Client, constraints.Client):
    pass


@dataclass(frozen=True)
class State(plots.State, constraints.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    left: Mapping[str, Client] = field(default_factory=dict)
    saving: Saving | None = None
    not_kept: str = ""  # why edits are not kept on disk
