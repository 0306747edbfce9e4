"""Playback of a run: play, scrub, step, speed, loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, TypeVar

from pydantic import Field

from ..core.events import Finite, FromPage
from ..run import Client as Client
from ..run import State as State

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # playback speeds


# -- playback of a run (pure). A live run pauses to show earlier times, and resumes at its end -----


S = TypeVar("S", bound=State)


class Pause(FromPage):
    def applied(self, state: State) -> State:
        if state.going is not None:
            return replace(state, live=replace(state.going, running=False))
        return at(state, state.playback.time, False) if state.playback.moves else state


class Scrub(FromPage):
    """Jump to this time [s]."""

    collapses = True
    time: Finite
    held: bool = False  # the slider is not let go

    def applied(self, state: State) -> State:
        if state.going is None and state.t_end <= state.t_start:
            return state
        state = _held(state)
        time = min(max(self.time, state.t_start), state.t_end)
        state = at(state, time, state.playback.playing)
        return replace(state, playback=replace(state.playback, held=self.held))


class StepFrames(FromPage):
    """Move by this number of saved frames, forwards or backwards."""

    frames: Annotated[int, Field(ge=-1000, le=1000)]

    def applied(self, state: State) -> State:
        times, time = state.instants, state.playback.time
        if state.going is None and len(times) < 2:
            return state
        if times:
            now = min(range(len(times)), key=lambda k: abs(times[k] - time))
            time = times[min(max(now + self.frames, 0), len(times) - 1)]
        return at(_held(state), time, False)


class Speed(FromPage):
    speed: Annotated[float, Field(ge=SPEEDS[0], le=SPEEDS[-1])]

    def applied(self, state: State) -> State:
        if state.t_end <= state.t_start:
            return state
        return replace(state, playback=replace(state.playback, speed=self.speed))


class Loop(FromPage):
    loop: bool

    def applied(self, state: State) -> State:
        if state.t_end <= state.t_start:
            return state
        shown = state.playback  # once, until now
        again = replace(
            shown, loop=self.loop, playing=shown.playing or shown.preview, preview=False
        )
        return replace(state, playback=again)


def at(state: S, time: float, playing: bool) -> S:
    """Return the state that shows the run at a time."""
    playback = replace(state.playback, time=time, playing=playing, preview=False, held=False)
    return replace(state, playback=playback)


def _held(state: State) -> State:
    """Pause a live run while an earlier time is shown."""
    live = state.going
    return state if live is None else replace(state, live=replace(live, running=False))
