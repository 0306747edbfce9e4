"""What the events do to the run: what to simulate, its job, its outcome (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from .. import events
from ..core import cells
from ..core.cells import Refusal
from ..core.state import (
    FREE_RUN,
    METHODS,
    Exporting,
    Job,
    Kernels,
    Reply,
    Request,
    Run,
    State,
    with_client,
)
from ..events import Event, Failed, Progress, Simulated

LONGEST_RUN = 3600.0  # [s]
LEAST_RTOL, LARGEST_RTOL = 1e-15, 0.1


def update(state: State, event: Event) -> State | None:
    """The state after an event of the run or the compiler; None for any other event."""
    match event:
        case events.SetScenario(client, serial, scenario):
            state = scenario_chosen(state, scenario)
            return with_client(state, client, reply=Reply(serial, ""))
        case events.SetRun():
            return request_edited(state, event)
        case events.Simulate() if idle(state):
            return asked(state)
        case events.Continue() if idle(state) and state.run is not None:
            return asked(state, state.run.result)
        case events.Compare() if state.live is None:
            return replace(state, ghost=state.run if state.ghost is None else None)
        case events.Export(client, what) if state.run is not None and state.live is None:
            return replace(state, exporting=Exporting(client, what, state.run, state.shown))
        case events.Cancel() if state.job is not None:
            return replace(state, job=None, run_problem="The simulation was cancelled.")
        case events.Progress() | events.Simulated() | events.Failed():
            return heard(state, event)
        case events.Compiling(done, total, name):
            return replace(state, kernels=Kernels(done, total, name))
        case events.Compiled(problem):
            return replace(state, kernels=replace(state.kernels, ready=True, problem=problem))
        case _:
            return None


def scenario_chosen(state: State, name: str) -> State:
    """A scenario with its own settings, or a free run with ours."""
    scenario = next((s for s in state.model.scenarios if s.name == name), None)
    if scenario is None:
        return replace(state, request=Request()) if name == FREE_RUN else state
    method = scenario.method if scenario.method in METHODS else "auto"
    request = Request(name, scenario.t_end, scenario.step, method)
    return replace(state, request=request)


def request_edited(state: State, event: events.SetRun) -> State:
    """Another duration, step or method, or the sentence that refuses it."""
    try:
        request = replace(state.request, **{event.field: _request_value(event)})
    except Refusal as refusal:
        return with_client(state, event.client, reply=Reply(event.serial, str(refusal)))
    state = replace(state, request=request)
    return with_client(state, event.client, reply=Reply(event.serial, ""))


def _request_value(event: events.SetRun) -> float | str | None:
    if event.field == "method":
        if event.text not in METHODS:
            raise Refusal(f"The method must be one of {', '.join(METHODS)}.")
        return event.text
    if event.field != "t_end" and not event.text.strip():
        return None
    said = {"t_end": "The duration", "step": "The step", "rtol": "The tolerance"}[event.field]
    try:
        value = cells.number(event.text)
    except Refusal as refusal:
        raise Refusal(f"{said} {refusal}") from None
    if event.field == "rtol":
        if not LEAST_RTOL <= value <= LARGEST_RTOL:
            between = f"between {LEAST_RTOL:g} and {LARGEST_RTOL:g}"
            raise Refusal(f"{said} must lie {between}; given {value:g}.")
        return value
    if not 0 < value <= LONGEST_RUN:
        raise Refusal(f"{said} must be above 0 and at most {LONGEST_RUN:g} s; given {value:g}.")
    return value


def idle(state: State) -> bool:
    """Whether nothing is being simulated."""
    return state.job is None and state.live is None


def asked(state: State, before: Any = None) -> State:
    """A simulation of the model as it stands, under way; from the end of `before` where given."""
    job = Job(state.jobs + 1, state.model, state.request, before=before)
    paused = replace(state.playback, playing=False)
    return replace(state, job=job, jobs=job.id, run_problem="", playback=paused)


def heard(state: State, event: Progress | Simulated | Failed) -> State:
    """News of the job under way; of any other, which was cancelled, nothing."""
    job = state.job
    if job is None or job.id != event.job:
        return state
    match event:
        case Progress(_, fraction):
            return replace(state, job=replace(job, fraction=fraction))
        case Failed(_, text):
            return replace(state, job=None, run_problem=text)
        case Simulated(_, result):
            return _finished(state, Run(job.model, job.request, result))


def _finished(state: State, run: Run) -> State:
    start = 0.0 if state.job is None or state.job.before is None else state.job.before.t[-1]
    playback = replace(state.playback, time=float(start), playing=False)
    stale = "The model was changed while it was simulated: undo shows that run."
    problem = "" if run.model is state.model else stale
    return replace(state, job=None, last_run=run, playback=playback, run_problem=problem)
