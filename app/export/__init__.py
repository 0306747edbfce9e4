"""Files of a run: tables, arrays, pages, pictures and films."""

from __future__ import annotations

from dataclasses import dataclass

from .. import gait
from ..gait import Client as Client
from ..run import Run
from ..scene import SHOWN_AT_FIRST


@dataclass(frozen=True)
class Exporting:
    """A pending export of a run to one page as a file."""

    client: int
    what: str
    run: Run
    shown: frozenset[str] = SHOWN_AT_FIRST  # on the page that asks
    time: float = 0.0  # time that the page shows [s]


@dataclass(frozen=True)
class State(gait.State):
    exporting: Exporting | None = None
