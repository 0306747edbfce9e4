"""The walk: its gait, speed, pushes and ground, as far as the model can walk."""

from __future__ import annotations

import math

import viser

from ..core.bridge import Bridge
from ..core.state import State
from ..core.views import Payload, audience
from .walking import (
    LAWS,
    friction,
    has_feet,
    law,
    offered,
    offers,
    step_height,
    turns,
    why_not,
)

PARTS = ("derived", "walking", "run_problem", "job")
FASTEST, TURNING = 1.5, 0.6  # ends of the sliders [m/s, rad/s]


class GaitView:
    """The last tab of a panel, there as long as the model has feet."""

    def __init__(self, bridge: Bridge, panel: viser.PanelHandle):
        self._bridge, self._panel = bridge, panel
        self._tab: viser.GuiTabHandle | None = None

    def _place(self, wanted: bool) -> None:
        if wanted and self._tab is None:
            self._tab = self._panel.add_tab("Gait", viser.Icon.PAW)
            with self._tab:
                self._bridge.host("gait")
        elif not wanted and self._tab is not None:
            self._tab.remove()
            self._tab = None

    def render(self, old: State, new: State) -> None:
        self._place(has_feet(new.model))
        changed = any(getattr(old, part) is not getattr(new, part) for part in PARTS)
        changed = changed or (old.live is None) != (new.live is None)
        clients = audience(old, new, changed)
        payload = gait(new) if clients else {}
        for client in clients:
            self._bridge.send(client, "gait", payload)


def gait(state: State) -> Payload:
    """Everything the tab shows, but what the feet do."""
    model, found = state.model, offers(state.model)
    offer = offered(model, state.walking)
    if offer is None:
        return {"why": why_not(model)}
    now = offer.gait
    return {
        "why": "",
        "gaits": [
            [name, name if one.tried else f"{name} (untried on this model)"]
            for name, one in found.items()
        ],
        "gait": now.name,
        "about": now.description,
        "speed": now.speed,
        "fastest": max(FASTEST, math.ceil(3 * found[now.name].gait.speed) / 2),
        "turn": now.turn,
        "turning": TURNING,
        "turns": turns(model, now),
        "friction": friction(model),
        "slope": round(math.degrees(model.ground.slope), 9),
        "steps": step_height(model),
        "law": law(model),
        "laws": [[name, text] for name, (text, _, _) in LAWS.items()],
        "live": state.live is not None,
        "busy": state.job is not None,
        "problem": state.run_problem,
    }
