"""What the events do to the plots: each page has its own (pure)."""

from __future__ import annotations

from .. import events
from ..core.state import State, with_client
from ..events import Event
from .signals import KINDS, Signal

MOST_PLOTS = 12


def update(state: State, event: Event) -> State | None:
    """The state after a plot was asked for or taken away; None for any other event."""
    match event:
        case events.Plot(client, kind, of, on) if kind in KINDS and client in state.clients:
            signal, shown = Signal(kind, of), state.clients[client].plots
            rest = tuple(plot for plot in shown if plot != signal)
            plots = (*rest, signal)[-MOST_PLOTS:] if on else rest
            return with_client(state, client, plots=plots)
        case _:
            return None
