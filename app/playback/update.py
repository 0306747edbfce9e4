"""Playback of a run (pure). A live run pauses to show earlier times, and resumes at its end."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from ..core.events import Finite, FromPage, Tick, on
from ..run.update import at_its_end
from . import SPEEDS, State


@dataclass(frozen=True)
class Play(FromPage):
    pass


@on(Play)
def play(state: State, event: Play) -> State:
    if state.going is not None:
        return at_its_end(state, replace(state.going, running=True))
    if state.t_end <= state.t_start:
        return state
    again = state.playback.time >= state.t_end
    return _at(state, state.t_start if again else state.playback.time, True)


@dataclass(frozen=True)
class Pause(FromPage):
    pass


@on(Pause)
def pause(state: State, event: Pause) -> State:
    if state.going is not None:
        return replace(state, live=replace(state.going, running=False))
    return _at(state, state.playback.time, False) if state.playback.moves else state


@dataclass(frozen=True)
class Scrub(FromPage):
    """Jump to this time [s]."""

    collapses = True
    time: Finite


@on(Scrub)
def scrub(state: State, event: Scrub) -> State:
    if state.going is None and state.t_end <= state.t_start:
        return state
    state = _held(state)
    time = min(max(event.time, state.t_start), state.t_end)
    return _at(state, time, state.playback.playing)


@dataclass(frozen=True)
class StepFrames(FromPage):
    """Move by this number of saved frames, forwards or backwards."""

    frames: Annotated[int, Field(ge=-1000, le=1000)]


@on(StepFrames)
def step_frames(state: State, event: StepFrames) -> State:
    if state.live is not None:
        times = sorted({float(t) for part in state.live.parts for t in part.t})
    elif state.run is not None and state.t_end > state.t_start:
        times = [float(t) for t in state.run.result.t]
    else:
        return state
    time = state.playback.time
    if times:
        now = min(range(len(times)), key=lambda k: abs(times[k] - time))
        time = times[min(max(now + event.frames, 0), len(times) - 1)]
    return _at(_held(state), time, False)


@dataclass(frozen=True)
class Speed(FromPage):
    speed: Annotated[float, Field(ge=SPEEDS[0], le=SPEEDS[-1])]


@on(Speed)
def speed(state: State, event: Speed) -> State:
    if state.t_end <= state.t_start:
        return state
    return replace(state, playback=replace(state.playback, speed=event.speed))


@dataclass(frozen=True)
class Loop(FromPage):
    loop: bool


@on(Loop)
def loop(state: State, event: Loop) -> State:
    if state.t_end <= state.t_start:
        return state
    shown = state.playback  # once, until now
    again = replace(shown, loop=event.loop, playing=shown.playing or shown.preview, preview=False)
    return replace(state, playback=again)


@on(Tick)
def tick(state: State, event: Tick) -> State:
    playback, end = state.playback, state.t_end
    if not playback.moves or end <= state.t_start:
        return state
    time = playback.time + event.dt * playback.speed
    if playback.preview:
        shown = replace(playback, time=min(time, end), preview=time < end)
        return replace(state, playback=shown)
    if time < end:
        return _at(state, time, True)
    span = end - state.t_start
    return _at(state, state.t_start + (time - end) % span if playback.loop else end, playback.loop)


def _at(state: State, time: float, playing: bool) -> State:
    playback = replace(state.playback, time=time, playing=playing, preview=False)
    return replace(state, playback=playback)


def _held(state: State) -> State:
    """Pause a live run while an earlier time is shown."""
    live = state.going
    return state if live is None else replace(state, live=replace(live, running=False))
