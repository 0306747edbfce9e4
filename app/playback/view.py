"""The playback bar. During playback, only the time is sent."""

from __future__ import annotations

from dataclasses import replace

from ..core.bridge import Bridge
from ..core.views import Host, Payload, Place, audience
from . import SPEEDS, State


class PlaybackView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        clients = set(audience(old, new, settings(old) != settings(new)))
        for client in new.clients:
            if client in clients:
                self._bridge.send(client, "playback", playback(new))
            elif moment(old) != moment(new):
                self._bridge.send(client, "time", moment(new))


def settings(state: State) -> tuple[object, ...]:
    """Return the settings, excluding the time and the end of a growing run, which change often."""
    live = state.going
    span = (live.id, live.running, not live.parts) if live else (state.t_start, state.t_end)
    return replace(state.playback, time=0.0), span


def moment(state: State) -> tuple[float, float, float]:
    """Return the displayed time, and the first and last available times [s]."""
    return state.playback.time, state.t_start, state.t_end


def playback(state: State) -> Payload:
    """Return the contents of the playback bar."""
    p, live = state.playback, state.going
    return {
        "moment": moment(state),
        "playing": p.moves if live is None else live.running,
        "speed": p.speed,
        "loop": p.loop and not p.preview,
        "speeds": SPEEDS,
        "live": live is not None,
        "nothing": live is None and state.t_end <= state.t_start,
    }


VIEWS = (Place(lambda desk: PlaybackView(desk.bridge), 60, Host("playback", "time")),)
