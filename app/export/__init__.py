"""Files of a run: tables, arrays, pages, pictures and films."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from .. import gait
from ..core.events import FromPage
from ..gait import Client as Client
from ..run import Run
from ..scene import SHOWN_AT_FIRST


@dataclass(frozen=True)
class Exporting:
    """A pending export of a run to one page as a file."""

    client: int
    what: str
    run: Run
    time: float = 0.0  # time that the page shows [s]
    shown: frozenset[str] = SHOWN_AT_FIRST  # things that the page draws


@dataclass(frozen=True)
class State(gait.State):
    exporting: Exporting | None = None


# -- requested files of a run (pure) ---------------------------------------------------------------


class Export(FromPage):
    """Export the run as a file."""

    what: Literal["csv", "npz", "live", "fmu", "png", "mp4", "gif"]

    def applied(self, state: State) -> State:
        if state.plotted is None or state.live is not None:
            return state
        run, time = state.plotted, state.playback.time
        asked = Exporting(self.client, self.what, run, time, state.shown)
        return replace(state, exporting=asked)


class CancelExport(FromPage):
    """Cancel the latest requested export."""

    def applied(self, state: State) -> State:
        asked = state.exporting
        mine = asked is not None and asked.client == self.client
        return replace(state, exporting=None) if mine else state
