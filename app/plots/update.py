"""The selection of plotted signals on each page (pure)."""

from __future__ import annotations

from ..core.events import FromPage, Text
from ..core.state import with_client
from . import KINDS, Signal, State

MOST_PLOTS = 12


class Plot(FromPage):
    """Toggle the plot of a signal: the quantity `kind` of the body or constraint `of`."""

    kind: Text
    of: Text
    on: bool

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or Signal(self.kind, self.of).quantity not in KINDS:
            return state
        signal = Signal(self.kind, self.of)
        rest = tuple(plot for plot in page.plots if plot != signal)
        plots = (*rest, signal)[-MOST_PLOTS:] if self.on else rest
        return with_client(state, self.client, plots=plots)


class PlotComponent(FromPage):
    """Select another component in a chart of several bodies."""

    kind: Text
    of: Text
    component: Text

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        old = Signal(self.kind, self.of)
        if page is None or old not in page.plots or not old.component:
            return state
        new = Signal(f"{old.quantity}.{self.component}", old.of)
        plots = [new if plot == old else plot for plot in page.plots if plot != new or plot == old]
        return with_client(state, self.client, plots=tuple(plots))
