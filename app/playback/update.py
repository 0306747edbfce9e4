"""What the events do to the playback: its bar and the clock (pure)."""

from __future__ import annotations

from dataclasses import replace

from .. import events
from ..core.state import Playback, State
from ..events import Event


def update(state: State, event: Event) -> State | None:
    """The state after an event of the playback; None where it changes nothing there."""
    playback = played(state, event)
    return None if playback is state.playback else replace(state, playback=playback)


def played(state: State, event: Event) -> Playback:
    """The playback after an event of its bar or of the clock; as it was without a run."""
    playback, end = state.playback, state.t_end
    if end <= state.t_start:
        return playback
    match event:
        case events.Play():
            start = state.t_start if playback.time >= end else playback.time
            return replace(playback, playing=True, time=start)
        case events.Pause():
            return replace(playback, playing=False)
        case events.Scrub(_, time):
            return replace(playback, time=min(max(time, state.t_start), end))
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
            span = end - state.t_start
            again = state.t_start + (time - end) % span if playback.loop else end
            return replace(playback, time=again, playing=playback.loop)
        case _:
            return playback


def _frame_time(state: State, frames: int) -> float:
    """The time of the saved frame `frames` away from the one shown."""
    times = state.run.result.t if state.run is not None else [0.0]
    now = min(range(len(times)), key=lambda k: abs(float(times[k]) - state.playback.time))
    return float(times[min(max(now + frames, 0), len(times) - 1)])
