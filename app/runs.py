"""What the events do to the run: what to simulate, its job, its outcome, its playback (pure)."""

from __future__ import annotations

from dataclasses import replace

from . import cells, events
from .cells import Refusal
from .events import Event, Failed, Progress, Simulated
from .state import FREE_RUN, METHODS, Job, Playback, Reply, Request, Run, State, with_client

LONGEST_RUN = 3600.0  # [s]


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


def _request_value(event: events.SetRun) -> float | str:
    if event.field == "method":
        if event.text not in METHODS:
            raise Refusal(f"The method must be one of {', '.join(METHODS)}.")
        return event.text
    said = {"t_end": "The duration", "step": "The step"}[event.field]
    try:
        value = cells.number(event.text)
    except Refusal as refusal:
        raise Refusal(f"{said} {refusal}") from None
    if not 0 < value <= LONGEST_RUN:
        raise Refusal(f"{said} must be above 0 and at most {LONGEST_RUN:g} s; given {value:g}.")
    return value


def asked(state: State) -> State:
    """A simulation of the model as it stands, under way."""
    job = Job(state.jobs + 1, state.model, state.request)
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
    playback = replace(state.playback, time=0.0, playing=False)
    stale = "The model was changed while it was simulated: undo shows that run."
    problem = "" if run.model is state.model else stale
    return replace(state, job=None, last_run=run, playback=playback, run_problem=problem)


def played(state: State, event: Event) -> Playback:
    """The playback after an event of its bar or of the clock; as it was without a run."""
    playback, end = state.playback, state.t_end
    if end <= 0:
        return playback
    match event:
        case events.Play():
            start = 0.0 if playback.time >= end else playback.time
            return replace(playback, playing=True, time=start)
        case events.Pause():
            return replace(playback, playing=False)
        case events.Scrub(_, time):
            return replace(playback, time=min(max(time, 0.0), end))
        case events.StepFrames(_, frames):
            return replace(playback, playing=False, time=_frame_time(state, frames))
        case events.Speed(_, speed):
            return replace(playback, speed=speed)
        case events.Loop(_, loop):
            return replace(playback, loop=loop)
        case events.Tick(dt) if playback.playing:
            time = playback.time + dt * playback.speed
            if time < end:
                return replace(playback, time=time)
            again = time % end if playback.loop else end
            return replace(playback, time=again, playing=playback.loop)
        case _:
            return playback


def _frame_time(state: State, frames: int) -> float:
    """The time of the saved frame `frames` away from the one shown."""
    times = state.run.result.t if state.run is not None else [0.0]
    now = min(range(len(times)), key=lambda k: abs(float(times[k]) - state.playback.time))
    return float(times[min(max(now + frames, 0), len(times) - 1)])
