"""Simulation settings, background runs, live runs and the compiler (pure)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

import pgraph_core as pg
from pgraph_core.model.scenario import AUTO, METHOD_NAMES
from pgraph_core.simulation.options import ADAPTIVE

from ..core import cells
from ..core.cells import Refusal
from ..core.events import Event, FromPage, Text, on, on_news, on_typed
from ..core.jobs import on_result, started
from . import FREE_RUN, KeptRun, Kernels, Live, Request, Run, Simulation, State, run_on
from .footfalls import changes, since

LONGEST_RUN = 3600.0  # [s]
LEAST_RTOL, LARGEST_RTOL = 1e-15, 0.1
MOST_FRAMES = 36_000  # limit on the frames of a live run (ten minutes), older ones are dropped
TOGETHER, TWICE = 32, 2  # number of parts joined into one, and levels of joining
MOST_FALLS = 36_000  # and of the changes of feet
MOST_KEPT = 5  # runs beside the present one

S = TypeVar("S", bound=State)

# -- settings ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class SetScenario(FromPage):
    serial: int
    scenario: Text


@on_typed(SetScenario)
def scenario_chosen(state: State, event: SetScenario) -> State:
    """Choose a scenario with its own settings, or a free run with the current settings."""
    name = event.scenario
    scenario = next((s for s in state.model.scenarios if s.name == name), None)
    if scenario is not None:
        asked = Request(name, scenario.t_end, scenario.step, scenario.method)
        state = replace(state, request=asked)
    elif name == FREE_RUN:
        state = replace(state, request=Request())
    return state


@dataclass(frozen=True)
class SetRun(FromPage):
    """Change the duration, step, tolerance or method."""

    serial: int
    field: Literal["t_end", "step", "rtol", "method"]
    text: Text


@on_typed(SetRun)
def request_edited(state: State, event: SetRun) -> State:
    changed = {event.field: _value(event.field, event.text)}
    if event.field == "method":  # settings of the other kind of method do not apply
        was, now = (method in ADAPTIVE for method in (state.request.method, event.text))
        changed |= {} if was == now else {"step": None}
        changed |= {} if now or event.text == AUTO else {"rtol": None}
    return replace(state, request=replace(state.request, **changed))


def _value(field: str, text: str) -> float | str | None:
    if field == "method":
        if text not in METHOD_NAMES:
            raise Refusal(f"The method must be one of {', '.join(METHOD_NAMES)}.")
        return text
    if field != "t_end" and not text.strip():
        return None
    name = {"t_end": "The duration", "step": "The step", "rtol": "The tolerance"}[field]
    value = cells.named_number(name, text)
    if field == "rtol":
        if not LEAST_RTOL <= value <= LARGEST_RTOL:
            between = f"between {LEAST_RTOL:g} and {LARGEST_RTOL:g}"
            raise Refusal(f"{name} must lie {between}; given {value:g}.")
    elif not 0 < value <= LONGEST_RUN:
        raise Refusal(f"{name} must be above 0 and at most {LONGEST_RUN:g} s; given {value:g}.")
    return value


# -- runs in the background --------------------------------------------------------------------


def idle(state: State) -> bool:
    """Return True if no simulation is running."""
    return state.job is None and state.going is None


@dataclass(frozen=True)
class Simulate(FromPage):
    """Simulate the current model. `gait/update.py` handles it: the model may walk."""


@dataclass(frozen=True)
class Continue(FromPage):
    """Continue from the end of the run for as long again. `gait/update.py` handles it too."""


def asked(state: S, before: Any, gait: pg.Gait | None = None) -> S:
    """Start a simulation, optionally from the end of `before` or with another gait."""
    paused = replace(state.playback, playing=False, preview=False)
    state = replace(state, playback=paused)
    return started(state, Simulation, state.request, before, gait, state.framed)


@dataclass(frozen=True)
class Cancel(FromPage):
    """Stop the simulation."""


@on(Cancel)
def cancel(state: State, event: Cancel) -> State:
    if state.job is None:
        return state
    return replace(state, job=None, run_problem="The simulation was cancelled.")


@on_result(Simulation)
def simulated(state: State, job: Simulation, result: Any) -> State:
    """Show the run of a simulation."""
    if not len(result.t):  # nothing to play or to keep
        why = result.message or result.status.value
        return replace(state, run_problem=f"There is no run to show: {why}.")
    start = 0.0 if job.before is None else float(job.before.t[-1])
    plays = job.model is state.model and len(result.t) > 1
    unseen = not any(page.aspect for page in state.clients.values())
    stale = "The model was changed during the simulation; undo shows that run."
    return replace(
        state,
        live=None,
        last_run=Run(job.model, job.request, result),
        run_framed=job.framed,
        playback=replace(state.playback, time=start, playing=False, preview=plays, unseen=unseen),
        run_problem="" if job.model is state.model else stale,
    )


@dataclass(frozen=True)
class KeepRun(FromPage):
    """Keep the run under a name to compare it with later ones."""


@on(KeepRun)
def run_kept(state: State, event: KeepRun) -> State:
    if state.live is not None or (run := state.run) is None:
        return state
    count = max((one.id for one in state.runs), default=0) + 1
    kept = KeptRun(count, f"{run.request.scenario or 'free run'} {count}", run)
    return replace(state, runs=(*state.runs, kept)[-MOST_KEPT:])


@dataclass(frozen=True)
class NameRun(FromPage):
    """Rename a kept run."""

    serial: int
    kept: int
    text: Text


@on_typed(NameRun)
def run_named(state: State, event: NameRun) -> State:
    name = event.text.strip()
    if not name or any(one.name == name and one.id != event.kept for one in state.runs):
        raise Refusal("must be a name that no other kept run has")
    named = [replace(one, name=name) if one.id == event.kept else one for one in state.runs]
    return replace(state, runs=tuple(named))


@dataclass(frozen=True)
class DropRun(FromPage):
    """Discard a kept run."""

    kept: int


@on(DropRun)
def run_dropped(state: State, event: DropRun) -> State:
    return replace(state, runs=tuple(one for one in state.runs if one.id != event.kept))


@dataclass(frozen=True)
class Compiling(Event):
    """Progress report: the compiler has finished `done` of `total` kernels."""

    done: int
    total: int
    name: str


@on(Compiling)
def compiling(state: State, event: Compiling) -> State:
    return replace(state, kernels=Kernels(event.done, event.total, event.name))


@dataclass(frozen=True)
class Compiled(Event):
    problem: str = ""


@on(Compiled)
def compiled(state: State, event: Compiled) -> State:
    return replace(state, kernels=replace(state.kernels, ready=True, problem=event.problem))


# -- the live run ------------------------------------------------------------------------------


@dataclass(frozen=True)
class GoLive(FromPage):
    """Start simulating and playing at once, without an end time. `gait/update.py` handles this
    event.

    With `here`, it starts at the state of the run that is shown.
    """

    here: bool = False


def go_live(state: S, here: bool = False) -> S:
    """Start a live run from the initial state, or from the displayed state if `here`."""
    start = None
    if here and (run := state.run) is not None:
        t = np.asarray(run.result.t)
        k = int(np.abs(t - state.playback.time).argmin())
        start = float(t[k]), np.asarray(run.result.q[k]), np.asarray(run.result.v[k])
    live = Live(state.jobs + 1, state.request, start)
    playback = replace(state.playback, time=start[0] if start else 0.0, playing=False)
    return replace(state, live=live, jobs=live.id, playback=playback, run_problem="")


@dataclass(frozen=True)
class Advanced(Event):
    """The live run has advanced by one part, at `pace` relative to the requested speed."""

    collapses = True
    id: int  # id of the live run
    part: Any
    pace: float


@on_news("live", Advanced)
def advanced(state: State, event: Advanced, live: Live) -> State:
    """Append a part to the live run unless that is over or the part does not fit it."""
    part = event.part
    if live.over or tuple(part.mechanism.names) != state.derived.names or not len(part.t):
        return state
    parts, joined = grown(live, part)
    live = replace(
        live,
        parts=parts,
        joined=joined,
        taken=live.taken + 1,
        pace=event.pace,
        falls=(*live.falls, *changes(part, live.falls))[-MOST_FALLS:],
    )
    return at_its_end(state, live) if live.running else replace(state, live=live)


def grown(live: Live, part: Any) -> tuple[tuple[Any, ...], tuple[int, ...]]:
    """Append a part and count how often each was joined. The latest parts are joined in groups."""
    parts, joined = [*live.parts, part], [*live.joined, 0]
    while joined[-1] < TWICE and joined[-TOGETHER:] == [joined[-1]] * TOGETHER:
        parts[-TOGETHER:] = [pg.joined(parts[-TOGETHER:])]
        joined[-TOGETHER:] = [joined[-1] + 1]
    frames = sum(len(one.t) for one in parts)
    while frames - len(parts[0].t) >= MOST_FRAMES:
        frames -= len(parts.pop(0).t)
        joined.pop(0)
    return tuple(parts), tuple(joined)


def at_its_end(state: State, live: Live) -> State:
    """Show the live run at its latest time."""
    time = float(live.parts[-1].t[-1]) if live.parts else 0.0
    return replace(state, live=live, playback=replace(state.playback, time=time))


@dataclass(frozen=True)
class Stuck(Event):
    """The live run cannot continue."""

    id: int  # id of the live run
    text: str
    fell: float | None = None  # [s]


@on_news("live", Stuck)
def stuck(state: State, event: Stuck, live: Live) -> State:
    how = f"it fell at t = {event.fell:.3g} s" if event.fell is not None else "it could not go on"
    return state if live.over else replace(stopped(state, how), run_problem=event.text)


@dataclass(frozen=True)
class StopLive(FromPage):
    """End the live run and keep it."""


@on(StopLive)
def stop_live(state: State, event: StopLive) -> State:
    return stopped(state)


def stopped(state: State, how: str = "stopped by hand") -> State:
    """Stop the live run at once. `joined` follows with the joined parts after a moment."""
    live = state.going
    if live is None:
        return state
    over = replace(live, running=False, over=True, ended=how)
    return replace(state, live=over if live.parts else None)


@dataclass(frozen=True)
class Joined(Event):
    """The parts of a stopped live run have been joined into a run."""

    id: int  # id of the live run
    run: Run | None
    framed: int = 0  # `State.framed` when it was stopped
    problem: str = ""  # why there is no run


def joined(state: State) -> Joined:
    """Store the run that results from a live run that has just been stopped."""
    live = state.live
    assert live is not None
    walked = tuple(since(live.falls, state.t_start))  # seconds of work after a long run
    run = Run(state.model, live.request, pg.joined(live.parts), walked, live.ended)
    return Joined(live.id, run, state.framed)


@on_news("live", Joined)
def kept(state: State, event: Joined, live: Live) -> State:
    if event.run is None:
        return replace(state, live=None, run_problem=event.problem)
    run = run_on(event.run, event.run.model, state.model)
    return replace(state, live=None, last_run=run, run_framed=event.framed)
