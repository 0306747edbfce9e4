"""Reports: error versus run time, and the stability map."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import pgraph_core as pg
from pgraph_core.study.axes import AXES

from .. import run
from ..core import cells
from ..core.cells import Refusal
from ..core.events import FromPage, Text, TypedText
from ..core.events import Request as Question
from ..core.jobs import Job, cancelled, started
from ..core.jobs import Report as Progress
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
    partial: Any = None  # the map so far

    def changes(self, *news: Any) -> dict[str, Any]:
        """Return the fraction done, and the map so far."""
        return {"fraction": float(news[0]), "partial": news[1] if len(news) > 1 else self.partial}

    @property
    def duration(self) -> float:
        """The requested duration [s]."""
        return self.reporting.t_end or self.request.t_end

    def work(self, progress: Progress) -> object:
        """Return the requested report."""
        return MEASURES[self.kind](self, progress)

    def ended(self, state: State, result: Any) -> State:
        """Show a Study or StabilityMap, and keep the latest one of the other kind."""
        other = latest(state.report, "stability" if self.kind == "precision" else "precision")
        kept = None if other is None else replace(other, other=None)
        return replace(state, report=Report(self.kind, self.model, result, self.duration, kept))


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


def in_progress(state: State) -> Report | None:
    """Return the map so far, if one is being computed."""
    now = state.analysis
    if now is None or now.partial is None:
        return None
    return Report(now.kind, now.model, now.partial, now.duration)


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


# -- report settings and background measurements (pure) --------------------------------------------


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
        raise Refusal(f"{name} must be above 0 and at most {most:g}, got {value:g}.")
    return value


class Analyse(FromPage):
    """Start measuring in the background."""

    kind: Literal["precision", "stability"]

    def applied(self, state: State) -> State:
        if state.analysis is not None:
            return state
        if not state.model.rows:
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
        how = {name: getattr(found, name) for name in ("method", "step", "rtol")}
        asked = state.request.unchecked_copy(how)
        return replace(state, request=asked)


class DownloadReport(Question):
    """Download a report as a standalone page."""

    kind: Literal["precision", "stability"] = "precision"


# -- measurements for reports ----------------------------------------------------------------------


ROUNDS = 3  # rounds of timing, few because a page waits
LONGEST_RUN = 0.5  # [s] limit on the computing time of a run
HORIZON = 1.0  # [s] limit on the motion of a map, which makes hundreds of runs


def settings(now: Analysis) -> dict[str, Any]:
    """Scenario and duration."""
    scenario = now.request.options(now.model)["scenario"]
    duration = now.reporting.t_end or now.request.t_end
    return {"scenario": scenario, "t_end": duration, "target": now.reporting.target}


def precision(now: Analysis, progress: Progress) -> object:
    """Measure error versus run time for all suitable methods."""
    mech = pg.Mechanism(now.model)
    return pg.work_precision(
        mech, rounds=ROUNDS, longest=LONGEST_RUN, progress=progress, **settings(now)
    )


def stability(now: Analysis, progress: Progress) -> object:
    """Test the stability of the methods over the first part of the run."""
    given = settings(now)
    given["t_end"] = now.reporting.t_end or min(given["t_end"], HORIZON)
    so_far: list[Any] = [None]  # the newest map

    def advanced(fraction: float) -> bool:
        return progress(fraction, so_far[0])

    def kept(found: pg.StabilityMap) -> None:
        so_far[0] = found

    axis = now.reporting.axis or None
    return pg.stability_map(now.model, axis=axis, progress=advanced, partial=kept, **given)


MEASURES = {"precision": precision, "stability": stability}
