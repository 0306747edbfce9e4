"""What the feet do: phases over time, for the bars of the playback and the log of the tab."""

from __future__ import annotations

import time

from pgraph_core.result.contact_record import PHASES

from ..core.bridge import Bridge
from ..core.state import State
from ..core.views import Payload, audience
from .footfalls import Change, since

OFTEN = 0.15  # [s] between two pictures of a live run
WINDOW = 7.0  # [s] of motion that a live run sends


class PhasesView:
    """Sends all of a run that is over or paused, the last seconds of a live one."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("phases")
        self._sent = 0.0  # when a picture of the live run was sent
        self._told: object = None  # what everybody has

    def render(self, old: State, new: State) -> None:
        falls, running = new.falls, new.live is not None and new.live.running
        key = (id(falls), running)
        due = key != self._told
        if due and running and time.monotonic() - self._sent < OFTEN:
            due = False
        clients = audience(old, new, due)
        if not clients:
            return
        if due:
            self._told, self._sent, self._kept = key, time.monotonic(), falls
        payload = phases(falls, new, running)
        for client in clients:
            self._bridge.send(client, "phases", payload)


def phases(falls: tuple[Change, ...], state: State, running: bool) -> Payload:
    """Feet, and the changes of each as [foot, time, phase]."""
    start = max(state.t_start, state.t_end - WINDOW) if running else state.t_start
    feet = list(dict.fromkeys(change.foot for change in falls))
    number = {foot: k for k, foot in enumerate(feet)}
    shown = since(falls, start) if running else falls
    return {
        "feet": feet,
        "phases": list(PHASES),
        "changes": [[number[foot], t, phase] for foot, t, phase, _ in shown],
    }
