"""A readable report about degrees of freedom and redundant constraint rows."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue

import pgraph_core as pg
from pgraph_core.analysis.mobility import Remark
from pgraph_core.errors import counted

from ..core.events import Event
from ..core.views import Payload
from . import State
from .update import MobilityFound


def mobility_report(state: State, by_itself: int) -> Payload:
    """Return a headline, lines that each name a constraint, and whether the report is current."""
    active = [c for c in state.model.constraints if c.active]
    if not active:
        text = f"{counted(state.derived.dof, 'degree')} of freedom, none taken by constraints."
        return {"state": "done", "text": text, "lines": []}
    report = state.mobility
    if report is None or report.model is not state.model:
        if state.derived.dof > by_itself and state.mobility_asked is not state.model:
            text = f"{counted(state.derived.dof, 'degree')} of freedom of the tree."
            return {"state": "large", "text": text, "lines": []}
        return {"state": "waiting", "text": "Counting degrees of freedom ...", "lines": []}
    if report.found is None:
        blamed = [Remark(c.name, "", True) for c in active if f"'{c.name}'" in report.problem]
        text = f"{report.problem[:1].upper()}{report.problem[1:].rstrip('.')}."
        return {"state": "failed", "text": text, "lines": [line._asdict() for line in blamed]}
    lines = [line._asdict() for line in report.found.remarks]
    return {"state": "done", "text": report.found.headline, "lines": lines}


BY_ITSELF = 300  # degrees of freedom up to which the report comes unasked: it costs O(n³)


class Reports:
    """Mobility reports for the latest model."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._asked: pg.Model | None = None  # model of the last request
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
    """Check whether constraints are on a page, whose bar shows what they leave, without report."""
    if not state.model.constraints or not state.clients:
        return False
    if state.mobility is not None and state.mobility.model is state.model:
        return False
    return state.derived.dof <= BY_ITSELF or state.mobility_asked is state.model


def report(model: pg.Model) -> MobilityFound:
    """Return the degrees of freedom and redundant rows at first, or why they are unknown."""
    try:
        return MobilityFound(model, pg.Mechanism(model).mobility())
    except pg.PgraphError as error:
        return MobilityFound(model, None, str(error))
    except Exception as error:  # said on the page: the session goes on
        return MobilityFound(model, None, f"No report: {type(error).__name__}: {error}")
