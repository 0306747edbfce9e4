"""The walk: its gait, speed, pushes and ground, as far as the model supports walking."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import viser

from pgraph_core.result.records import PHASES, SWING
from pgraph_core.rotation import frame_of
from pgraph_core.show import shapes

from ..core.bridge import Bridge
from ..core.views import Host, Payload, Place, audience, hue, topic
from ..run.footfalls import Change, prints, since
from . import (
    LAWS,
    Offer,
    State,
    friction,
    has_feet,
    law,
    offered,
    offers,
    step_height,
    turns,
    why_not,
)

PARTS = ("derived", "walking", "run_problem", "job", "request")
FASTEST, TURNING = 1.5, 0.6  # ends of the sliders [m/s, rad/s]


def gait(state: State) -> Payload:
    """Return the contents of the tab, except the motion of the feet."""
    model, found = state.model, offers(state.model)
    offer = offered(model, state.walking)
    if offer is None:
        return {"why": why_not(model), "walks": False, "feet": has_feet(model)}
    now = offer.gait
    said = next((s.description for s in model.scenarios if s.name == state.request.scenario), "")
    untried = f"'{now.name}' was not tried on '{model.name}', which may fall."
    return {
        "why": "" if offer.tried else untried,
        "walks": True,
        "feet": True,
        "gaits": [
            [name, _called(name, one, state.request.scenario)] for name, one in found.items()
        ],
        "gait": now.name,
        "about": "" if now.description == said else now.description,
        "speed": now.speed,
        "strength": state.walking.strength,
        "fastest": max(FASTEST, math.ceil(3 * found[now.name].gait.speed) / 2),
        "turn": now.turn,
        "turning": TURNING,
        "turns": turns(model, now),
        "friction": friction(model),
        "slope": round(math.degrees(model.ground.slope), 9),
        "steps": step_height(model),
        "law": law(model),
        "laws": [[name, text] for name, (text, _, _) in LAWS.items()],
        "live": state.going is not None,
        "busy": state.job is not None,
        "problem": "" if state.run is not None else state.run_problem,  # else the run shows it
    }


def _called(name: str, offer: Offer, scenario: str) -> str:
    if not offer.tried:
        return f"{name} (untried on this model)"
    return "of the scenario" if offer.scenario == scenario else name


MOST = 64  # discs, the last ones
COLOR, OPACITY = (8, 34, 110), 0.9
WIDE, THICK = 0.055, 0.004  # size of footprints relative to the model


class FootprintsView:
    def __init__(self, server: viser.ViserServer):
        self._scene = server.scene
        self._node: Any = None
        self._at = np.zeros((0, 3))

    def render(self, old: State, new: State) -> None:
        falls = new.falls if "footprints" in new.shown else ()
        self.show(new, prints(falls, new.playback.time, MOST))

    def show(self, state: State, at: np.ndarray) -> None:
        """Show a disc at each of these positions and remove all others."""
        if at.shape == self._at.shape and np.array_equal(at, self._at):
            return
        self._at = at
        if self._node is None:
            self._node = draw(self._scene, state, at) if len(at) else None
            return
        self._node.visible = len(at) > 0
        if len(at):
            self._node.batched_positions = at
            self._node.batched_wxyzs, self._node.batched_scales = discs(state, len(at))


def draw(scene: viser.SceneApi, state: State, at: np.ndarray) -> Any:
    """Draw a flat disc on the ground at each position."""
    disc = shapes.unit("cylinder")
    turned, size = discs(state, len(at))
    return scene.add_batched_meshes_simple(
        "/footprints", disc.vertices, disc.faces, batched_positions=at, batched_wxyzs=turned,
        batched_scales=size,
        batched_colors=COLOR, opacity=OPACITY, lod="off", cast_shadow=False, receive_shadow=False,
    )  # fmt: skip


def discs(state: State, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the orientations (n, 4) and sizes (n, 3) [m] of flat discs on the ground."""
    turned = shapes.to_wxyz(frame_of(np.asarray(state.model.ground_normal))[None])
    size = state.derived.size * np.array([WIDE, WIDE, THICK])
    return np.repeat(turned, count, 0), np.tile(size, (count, 1))


OFTEN = 0.15  # [s] between two pictures of a live run
WINDOW = 60.0  # [s] longest motion of a live run that is sent


class PhasesView:
    """A view that sends all phases of a kept or paused run, or the last seconds of a live one."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._sent = 0.0  # when a picture of the live run was sent
        self._told: object = None  # data that all pages have

    def render(self, old: State, new: State) -> None:
        live = new.live
        falls, running = new.falls, live is not None and (live.running or live.over)
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


def phases(falls: tuple[Change, ...], state: State, running: bool = False) -> Payload:
    """Return the feet and all their phase changes as [foot, time, phase], or only the most recent
    ones of a live run."""
    start = max(state.t_start, state.t_end - WINDOW)
    shown = since(falls, start) if running else falls
    feet = list(dict.fromkeys(change.foot for change in shown))
    if not running:  # feet that never touch come last
        touched = {change.foot for change in shown if PHASES[change.phase] != SWING}
        feet.sort(key=lambda foot: foot not in touched)
    number = {foot: k for k, foot in enumerate(feet)}
    body = {contact.name: contact.body for contact in state.model.contacts}
    color = dict(zip(state.derived.names, map(hue, state.derived.branches)))
    return {
        "feet": feet,
        "colors": [color.get(body.get(foot, ""), "var(--ink-3)") for foot in feet],
        "changes": [[number[foot], t, phase] for foot, t, phase, _ in shown],
    }


VIEWS = (
    Place(
        topic("gait", gait, *PARTS, lambda state: state.going is None),
        23,
        Host("gait", "left", "Scenarios"),
    ),
    Place(lambda desk: PhasesView(desk.bridge), 61, Host("phases", "time")),
    Place(lambda desk: FootprintsView(desk.bridge.server), 72),
)
