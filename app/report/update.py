"""Report settings and background measurements (pure)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from pgraph_core.study.axes import AXES

from ..core import cells
from ..core.cells import Refusal
from ..core.events import FromPage, Text, on, on_request, on_typed
from ..core.jobs import cancelled, on_result, started
from . import Analysis, Report, ReportRequest, State, advised, latest

LONGEST = 60.0  # [s] limit on the measured motion, which is run some hundred times


@dataclass(frozen=True)
class SetReport(FromPage):
    """Change a setting of the report."""

    serial: int
    field: Literal["target", "axis", "t_end"]
    text: Text


@on_typed(SetReport)
def set_report(state: State, event: SetReport) -> State:
    changed = {event.field: _value(event.field, event.text)}
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


@dataclass(frozen=True)
class Analyse(FromPage):
    """Start measuring in the background."""

    kind: Literal["precision", "stability"]


@on(Analyse)
def analyse(state: State, event: Analyse) -> State:
    if state.analysis is not None:
        return state
    if not state.model.bodies:
        return replace(state, analysis_problem="No bodies yet: add one to the table.")
    return started(state, Analysis, event.kind, state.request, state.reporting)


@dataclass(frozen=True)
class CancelAnalysis(FromPage):
    """Stop measuring and keep the results obtained so far."""


@on(CancelAnalysis)
def cancel(state: State, event: CancelAnalysis) -> State:
    return cancelled(state, Analysis)


@on_result(Analysis)
def measured(state: State, job: Analysis, result: Any) -> State:
    """Show a Study or StabilityMap of pgraph_core, and keep the latest one of the other kind."""
    duration = job.reporting.t_end or job.request.t_end
    other = latest(state.report, "stability" if job.kind == "precision" else "precision")
    kept = None if other is None else replace(other, other=None)
    return replace(state, report=Report(job.kind, job.model, result, duration, kept))


@dataclass(frozen=True)
class UseAdvised(FromPage):
    """Use the method and the step or tolerance recommended by a report for all further runs."""

    kind: Literal["precision", "stability"] = "precision"


@on(UseAdvised)
def use_advised(state: State, event: UseAdvised) -> State:
    found = advised(latest(state.report, event.kind))
    if found is None:
        return state
    asked = replace(state.request, method=found.method, step=found.step, rtol=found.rtol)
    return replace(state, request=asked)


@on_request
@dataclass(frozen=True)
class DownloadReport(FromPage):
    """Download a report as a standalone page."""

    kind: Literal["precision", "stability"] = "precision"
