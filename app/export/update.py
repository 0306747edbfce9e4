"""Requested files of a run (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from ..core.events import FromPage
from . import Exporting, State


class Export(FromPage):
    """Export the run as a file."""

    what: Literal["csv", "npz", "html", "live", "png", "mp4", "gif"]

    def applied(self, state: State) -> State:
        if state.plotted is None or state.live is not None:
            return state
        asked = Exporting(self.client, self.what, state.plotted, state.shown, state.playback.time)
        return replace(state, exporting=asked)


class CancelExport(FromPage):
    """Cancel the latest requested export."""

    def applied(self, state: State) -> State:
        asked = state.exporting
        mine = asked is not None and asked.client == self.client
        return replace(state, exporting=None) if mine else state
