"""What the events do to a live run: it plays while it is computed, of the model as it is (pure)."""

from __future__ import annotations

from dataclasses import replace

import pgraph_core as pg

from .. import events
from ..core.state import Live, Run, State
from ..events import Event
from ..gait.footfalls import changes

MOST_PARTS = 36_000  # ten minutes of pictures: older ones are let go
MOST_FALLS = 36_000  # and of the changes of feet


def update(state: State, event: Event) -> State | None:
    """The state after an event of the live run; None for any other event."""
    live = state.live
    match event:
        case events.GoLive() if live is None and state.job is None:
            return begun(state)
        case events.Advanced(id, part, pace) if live is not None and live.id == id:
            return advanced(state, live, part, pace)
        case events.Stuck(id, text) if live is not None and live.id == id:
            return replace(kept(state, live), run_problem=text)
        case events.StopLive() if live is not None:
            return kept(state, live)
        case events.Pause() if live is not None:
            return replace(state, live=replace(live, running=False))
        case events.Play() if live is not None:
            return at_its_end(state, replace(live, running=True))
        case events.Scrub() | events.StepFrames() if live is not None:
            return paused_at(state, live, event)
        case _:
            return None


def begun(state: State) -> State:
    """A live run from the initial state."""
    live = Live(state.jobs + 1, state.request)
    playback = replace(state.playback, time=0.0, playing=False)
    return replace(state, live=live, jobs=live.id, playback=playback, run_problem="")


def advanced(state: State, live: Live, part: pg.Result, pace: float) -> State:
    """Further by a part; of a model with other bodies, which is gone by now, nothing."""
    if tuple(part.mechanism.names) != state.derived.names:
        return state
    live = replace(
        live,
        parts=(*live.parts, part)[-MOST_PARTS:],
        pace=pace,
        falls=(*live.falls, *changes(part, live.falls))[-MOST_FALLS:],
    )
    return at_its_end(state, live) if live.running else replace(state, live=live)


def at_its_end(state: State, live: Live) -> State:
    """The live run, shown at its newest time."""
    time = float(live.parts[-1].t[-1]) if live.parts else 0.0
    return replace(state, live=live, playback=replace(state.playback, time=time))


def paused_at(state: State, live: Live, event: events.Scrub | events.StepFrames) -> State:
    """Looking back at what was: the computation waits."""
    state = replace(state, live=replace(live, running=False))
    match event:
        case events.Scrub(_, time):
            time = min(max(time, state.t_start), state.t_end)
        case events.StepFrames(_, frames):
            time = frame_time(live, state.playback.time, frames)
    return replace(state, playback=replace(state.playback, time=time))


def frame_time(live: Live, time: float, frames: int) -> float:
    """The end of the part `frames` away from the one that holds `time`."""
    if not live.parts:
        return time
    now = min(range(len(live.parts)), key=lambda k: abs(float(live.parts[k].t[-1]) - time))
    return float(live.parts[min(max(now + frames, 0), len(live.parts) - 1)].t[-1])


def kept(state: State, live: Live) -> State:
    """The live run over: what it computed is a run like any other."""
    if not live.parts:
        return replace(state, live=None)
    run = Run(state.model, live.request, pg.joined(live.parts))
    playback = replace(state.playback, time=float(run.result.t[0]))
    return replace(state, live=None, last_run=run, playback=playback)


def followed(live: Live | None, old: pg.Model, new: pg.Model) -> Live | None:
    """The live run of an edited model: from the same joints it goes on, else it starts a record."""
    if live is None:
        return None
    same = joints(old) == joints(new)
    return live if same else replace(live, parts=(), falls=())


def joints(model: pg.Model) -> list[tuple[str, str, int]]:
    """Who hangs on whom by how many coordinates: what two states must share to be joined."""
    return [(body.name, body.parent, len(body.q)) for body in model.bodies]
