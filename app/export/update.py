"""Requested files of a run (pure)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from ..core.events import FromPage, on
from . import Exporting, State


@dataclass(frozen=True)
class Export(FromPage):
    """Export the run as a file."""

    what: Literal["csv", "npz", "html", "live", "png", "mp4", "gif"]


@on(Export)
def export(state: State, event: Export) -> State:
    if state.plotted is None or state.live is not None:
        return state
    asked = Exporting(event.client, event.what, state.plotted, state.shown, state.playback.time)
    return replace(state, exporting=asked)


@dataclass(frozen=True)
class CancelExport(FromPage):
    """Cancel the latest requested export."""


@on(CancelExport)
def export_cancelled(state: State, event: CancelExport) -> State:
    asked = state.exporting
    mine = asked is not None and asked.client == event.client
    return replace(state, exporting=None) if mine else state
