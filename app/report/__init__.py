"""Reports: error versus run time, and the stability map."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Self

import pgraph_core as pg

from .. import run
from ..core.jobs import Job
from ..core.state import Client as Client
from ..run import Request


@dataclass(frozen=True)
class ReportRequest:
    """The settings of a report."""

    target: float = 1e-6  # target error
    t_end: float | None = None  # [s] duration, None for that of the run
    axis: str = ""  # axis of the stability map, "" for the model's first one


@dataclass(frozen=True)
class Analysis(Job):
    """A report in progress."""

    NAME, FIELD, PROBLEM = "report", "analysis", "analysis_problem"
    kind: str  # precision or stability
    request: Request
    reporting: ReportRequest

    def ended(self, state: State, result: Any) -> State:
        """Show a Study or StabilityMap, and keep the latest one of the other kind."""
        duration = self.reporting.t_end or self.request.t_end
        other = latest(state.report, "stability" if self.kind == "precision" else "precision")
        kept = None if other is None else replace(other, other=None)
        return replace(state, report=Report(self.kind, self.model, result, duration, kept))


@dataclass(frozen=True)
class Report:
    """A report and its model, together with the latest report of the other kind."""

    kind: str
    model: pg.Model
    result: Any  # pgraph_core's Study or StabilityMap
    asked: float = 0.0  # duration of the run [s]
    other: Report | None = None


def latest(report: Report | None, kind: str) -> Report | None:
    """Return the latest report of a kind."""
    if report is None or report.kind == kind:
        return report
    return report.other


def advised(report: Report | None) -> Request | None:
    """Return the method, step or tolerance recommended by a report, or None."""
    row = None if report is None else report.result.advised()
    if row is None:
        return None
    return Request(method=row.method, step=row.step, rtol=getattr(row, "rtol", None))


@dataclass(frozen=True)
class State(run.State):
    reporting: ReportRequest = field(default_factory=ReportRequest)
    analysis: Analysis | None = None
    analysis_problem: str = ""  # why the last one gave no report
    report: Report | None = None

    def opened(self, before: Any) -> Self:
        return replace(super().opened(before), report=None, analysis=None, analysis_problem="")
