"""Report settings and background measurements (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from pgraph_core.study.axes import AXES

from ..core import cells
from ..core.cells import Refusal
from ..core.events import FromPage, Request, Text, TypedText
from ..core.jobs import cancelled, started
from . import Analysis, ReportRequest, State, advised, latest

LONGEST = 60.0  # [s] limit on the measured motion, which is run some hundred times


class SetReport(TypedText):
    """Change a setting of the report."""

    field: Literal["target", "axis", "t_end"]
    text: Text

    def taken(self, state: State) -> State:
        changed = {self.field: _value(self.field, self.text)}
        return replace(state, reporting=replace(state.reporting, **changed))


def _value(field: str, text: str) -> float | str | None:
    if field == "axis":
        if text not in AXES:
            raise Refusal(f"The axis must be one of {', '.join(AXES)}.")
        return text
    if field == "t_end" and not text.strip():
        return ReportRequest().t_end
    name = {"target": "The error that is wanted", "t_end": "The duration"}[field]
    most = 1.0 if field == "target" else LONGEST
    value = cells.named_number(name, text)
    if not 0 < value <= most:
        raise Refusal(f"{name} must be above 0 and at most {most:g}; given {value:g}.")
    return value


class Analyse(FromPage):
    """Start measuring in the background."""

    kind: Literal["precision", "stability"]

    def applied(self, state: State) -> State:
        if state.analysis is not None:
            return state
        if not state.model.bodies:
            return replace(state, analysis_problem="No bodies yet: add one to the table.")
        return started(state, Analysis, self.kind, state.request, state.reporting)


class CancelAnalysis(FromPage):
    """Stop measuring and keep the results obtained so far."""

    def applied(self, state: State) -> State:
        return cancelled(state, Analysis)


class UseAdvised(FromPage):
    """Use the method and the step or tolerance recommended by a report for all further runs."""

    kind: Literal["precision", "stability"] = "precision"

    def applied(self, state: State) -> State:
        found = advised(latest(state.report, self.kind))
        if found is None:
            return state
        asked = replace(state.request, method=found.method, step=found.step, rtol=found.rtol)
        return replace(state, request=asked)


class DownloadReport(Request):
    """Download a report as a standalone page."""

    kind: Literal["precision", "stability"] = "precision"
