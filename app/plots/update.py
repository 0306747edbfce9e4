"""The selection of plotted signals on each page (pure)."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.events import FromPage, Text, on
from ..core.state import with_client
from . import KINDS, Signal, State

MOST_PLOTS = 12


@dataclass(frozen=True)
class Plot(FromPage):
    """Toggle the plot of a signal: the quantity `kind` of the body or constraint `of`."""

    kind: Text
    of: Text
    on: bool


@on(Plot)
def plot(state: State, event: Plot) -> State:
    page = state.clients.get(event.client)
    if page is None or Signal(event.kind, event.of).quantity not in KINDS:
        return state
    signal = Signal(event.kind, event.of)
    rest = tuple(plot for plot in page.plots if plot != signal)
    plots = (*rest, signal)[-MOST_PLOTS:] if event.on else rest
    return with_client(state, event.client, plots=plots)


@dataclass(frozen=True)
class PlotComponent(FromPage):
    """Select another component in a chart of several bodies."""

    kind: Text
    of: Text
    component: Text


@on(PlotComponent)
def plot_component(state: State, event: PlotComponent) -> State:
    page = state.clients.get(event.client)
    old = Signal(event.kind, event.of)
    if page is None or old not in page.plots or not old.component:
        return state
    new = Signal(f"{old.quantity}.{event.component}", old.of)
    plots = [new if plot == old else plot for plot in page.plots if plot != new or plot == old]
    return with_client(state, event.client, plots=tuple(plots))
