"""The digraph and the vectors Pgraph and jdof above it, and stepping through both."""

from __future__ import annotations

import numpy as np

import pgraph_core as pg

from ..core.bridge import Bridge
from ..core.state import State
from ..core.views import Payload, audience, css
from ..pose.solving import home, shown_q
from .steps import seven_steps

SAMPLE = 0.3  # [rad, m] that joints move in a frame update where nothing has moved yet


class DigraphView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("digraph")

    def render(self, old: State, new: State) -> None:
        changed = new.derived is not old.derived
        clients = audience(old, new, changed)
        payload = digraph(new) if clients else {}
        for client in clients:
            self._bridge.send(client, "digraph", payload)
        posed = new.pose is not old.pose
        for client, now in new.clients.items():
            before = old.clients.get(client)
            another = before is None or before.walk != now.walk
            if another or (now.walk and changed) or (now.walk == "frames" and posed):
                self._bridge.send(client, "steps", walk(new, now.walk))


def digraph(state: State) -> Payload:
    """Places, numbers and kinds of the nodes, the two vectors, and the constraints."""
    d = state.derived
    bodies = [state.model.body(name) for name in d.names]
    return {
        "kind": d.layout.kind,
        "x": d.layout.x,
        "y": d.layout.y,
        "width": d.layout.width,
        "height": d.layout.height,
        "routes": d.layout.routes,
        "names": d.names,
        "parent": d.parent,
        "dof": [body.dof for body in bodies],
        "joints": [body.joint for body in bodies],
        "masses": [body.mass for body in bodies],
        "colors": [css(color) for color in d.colors],
        "tips": sorted(d.tips),
        "separation": sorted(d.separation),
        "pgraph": d.pgraph,
        "jdof": d.jdof,
        "loops": [loop._asdict() for loop in d.loops],
    }


def walk(state: State, what: str) -> Payload:
    """What a page steps through, step by step: Fig. 4, Fig. 8, or nothing."""
    if what == "pgraph":
        d = state.derived
        dof = [state.model.body(name).dof for name in d.names]
        return {"kind": what, "steps": [step._asdict() for step in seven_steps(d.parent, dof)]}
    return frame_update(state) if what == "frames" else {"kind": ""}


def frame_update(state: State) -> Payload:
    """The trace of Fig. 8 from the initial state to what is shown, or by a sample step."""
    start, end = home(state.model), shown_q(state)
    said = "from the initial pose to the one shown"
    if np.array_equal(start, end):
        end = sampled(state.model)
        said = f"from the initial pose, joints moved by {SAMPLE}"
    trace = pg.frame_update_trace(state.model, start, end)
    steps = [{**visit._asdict(), "does": does} for visit, does in trace.steps]
    return {"kind": "frames", "from": said, "steps": steps}


def sampled(model: pg.Model) -> np.ndarray:
    """(nq,) the initial state with every joint of one coordinate moved by SAMPLE."""
    bodies = (model.body(name) for name in pg.Topology.of(model).names)
    step = [SAMPLE if len(body.q) == 1 else 0.0 for body in bodies for _ in body.q]
    return home(model) + np.array(step)
