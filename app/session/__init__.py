"""Open pages: connecting, selecting, saving and autosave."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pgraph_core as pg


@dataclass(frozen=True)
class Kept:
    """The model of a session that no longer runs, read from its file."""

    path: Path
    given: str  # the model that the session was started with
    time: float  # time of the last edit [s since 1970]
    text: str  # JSON
    ended: bool  # the server was stopped, not killed
    name: str  # name of the model


@dataclass(frozen=True)
class Saving:
    """A pending write of a file for one page."""

    client: int
    serial: int
    path: str
    model: pg.Model
    replace: bool  # also a file that this session did not write
    document: int = 0  # `State.document` of the model
