"""The playback bar; while playing, only the time is sent."""

from __future__ import annotations

from dataclasses import replace

from ..client.bridge import Bridge
from ..state import SPEEDS, State
from . import Payload, audience


class PlaybackView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("playback")

    def render(self, old: State, new: State) -> None:
        moved = new.playback.time != old.playback.time
        settings = replace(new.playback, time=0.0) != replace(old.playback, time=0.0)
        fresh = settings or new.run is not old.run or new.derived is not old.derived
        clients = set(audience(old, new, fresh))
        for client in new.clients:
            if client in clients:
                self._bridge.send(client, "playback", playback(new))
            elif moved:
                self._bridge.send(client, "time", new.playback.time)


def playback(state: State) -> Payload:
    p = state.playback
    return {
        "time": p.time,
        "t_end": state.t_end,
        "playing": p.playing,
        "speed": p.speed,
        "loop": p.loop,
        "speeds": SPEEDS,
        "hint": "" if state.run else "Nothing to play yet: press Simulate.",
    }
