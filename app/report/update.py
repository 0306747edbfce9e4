"""What the events do to the reports: what is measured, how far it is, what came out (pure)."""

from __future__ import annotations

from dataclasses import replace

from .. import events
from ..core import cells
from ..core.cells import Refusal
from ..core.state import Analysis, Reply, Report, ReportRequest, State, with_client
from ..events import Event

AXES = (
    "stiffness", "damping_ratio", "contact_stiffness", "mass_ratio", "inertia", "chain_length",
    "speed", "friction", "joint_friction", "redundancy", "singularity", "length_scale",
    "mass_scale", "time_scale", "step",
)  # fmt: skip
LONGEST = 60.0  # [s] of the motion that is measured: it is run some hundred times


def update(state: State, event: Event) -> State | None:
    """The state after an event of the reports; None for any other event."""
    now = state.analysis
    match event:
        case events.SetReport():
            return set_(state, event)
        case events.Analyse(_, kind) if now is None:
            analysis = Analysis(state.jobs + 1, kind, state.model, state.request, state.reporting)
            return replace(state, analysis=analysis, jobs=analysis.id, analysis_problem="")
        case events.CancelAnalysis() if now is not None:
            return replace(state, analysis=replace(now, cancelled=True))
        case events.DownloadReport(client) if state.report is not None:
            count = state.clients[client].reports + 1 if client in state.clients else 0
            return with_client(state, client, reports=count)
        case events.Measuring(id, fraction) if now is not None and now.id == id:
            return replace(state, analysis=replace(now, fraction=fraction))
        case events.Measured(id, report) if now is not None and now.id == id:
            return replace(state, analysis=None, report=Report(now.kind, now.model, report))
        case events.NotMeasured(id, text) if now is not None and now.id == id:
            return replace(state, analysis=None, analysis_problem=text)
        case _:
            return None


def set_(state: State, event: events.SetReport) -> State:
    """Another setting, or the sentence that refuses it."""
    try:
        reporting = replace(state.reporting, **{event.field: _value(event)})
    except Refusal as refusal:
        return with_client(state, event.client, reply=Reply(event.serial, str(refusal)))
    state = replace(state, reporting=reporting)
    return with_client(state, event.client, reply=Reply(event.serial, ""))


def _value(event: events.SetReport) -> float | str | None:
    if event.field == "axis":
        if event.text not in AXES:
            raise Refusal(f"The axis must be one of {', '.join(AXES)}.")
        return event.text
    if event.field == "t_end" and not event.text.strip():
        return ReportRequest().t_end
    said = {"target": "The error that is wanted", "t_end": "The duration"}[event.field]
    most = 1.0 if event.field == "target" else LONGEST
    try:
        value = cells.number(event.text)
    except Refusal as refusal:
        raise Refusal(f"{said} {refusal}") from None
    if not 0 < value <= most:
        raise Refusal(f"{said} must be above 0 and at most {most:g}; given {value:g}.")
    return value
