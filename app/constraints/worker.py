"""The mobility report of the model, computed in a thread while a page looks at its constraints."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue

import pgraph_core as pg

from ..core.events import Event
from ..core.state import State
from .update import MobilityFound

BY_ITSELF = 300  # degrees of freedom up to which the report comes unasked: it costs O(n³)


class Reports:
    """Reports on the newest model."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._asked: pg.Model | None = None  # whose report was asked for last
        self._newest: SimpleQueue[pg.Model] = SimpleQueue()
        threading.Thread(target=self._work, name="pgraph-reports", daemon=True).start()

    def render(self, old: State, new: State) -> None:
        if new.model is not self._asked and wanted(new):
            self._asked = new.model
            self._newest.put(new.model)

    def _work(self) -> None:
        while True:
            model = self._newest.get()
            while not self._newest.empty():  # only the newest is of interest
                model = self._newest.get()
            self._send(report(model))


def wanted(state: State) -> bool:
    """Whether somebody looks at constraints whose report is not there yet."""
    if not state.model.constraints or not any(c.watching for c in state.clients.values()):
        return False
    if state.mobility is not None and state.mobility.model is state.model:
        return False
    return state.derived.dof <= BY_ITSELF or state.mobility_asked is state.model


def report(model: pg.Model) -> MobilityFound:
    """Degrees of freedom and redundant rows in the initial state, or the sentence why not."""
    try:
        return MobilityFound(model, pg.Mechanism(model).mobility())
    except pg.PgraphError as error:
        return MobilityFound(model, None, str(error))
    except Exception as error:  # said on the page: the session goes on
        return MobilityFound(model, None, f"No report: {type(error).__name__}: {error}")
