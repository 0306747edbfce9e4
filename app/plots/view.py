"""Plots of a run: the available signals, and the curves of the plotted ones."""

from __future__ import annotations

import math
import time

import numpy as np

from pgraph_core.errors import counted

from ..core.bridge import Bridge
from ..core.cells import Display, Quantity
from ..core.views import Host, Payload, Place, same, topic
from . import (
    KINDS,
    OF_BODIES,
    POSES,
    Client,
    Curve,
    Signal,
    State,
    components,
    curves,
    hits,
    idle,
    of_body,
    of_scene,
    of_several,
    strip,
    thinned,
    title,
    unit,
)
from .ready import ready

LIVE_EVERY = 0.3  # [s] between two pictures of a live run
LIVE_SPAN = 15.0  # [s] least plotted span of a live run
CARRIED = (
    "constraint_force", "constraint_torque", "contact_force", "drive_force", "limit", "tension",
)  # fmt: skip
NOTHING = "Nothing to plot yet: press Play."
EMPTY = "No bodies yet: add one to the table."
IDLE = "0 throughout this run: it is off or carries no load"


class PlotsView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._drawn = 0.0  # when a live run was drawn last

    def render(self, old: State, new: State) -> None:
        due = self._due(old, new)
        for client, now in new.clients.items():
            before = old.clients.get(client)
            if (
                before is None
                or due
                or shown(before) != shown(now)
                or not same(recorded(old), recorded(new))
            ):
                self._bridge.send(client, "plots", plots(new, now))
            if (
                before is None
                or before.selected != now.selected
                or not same(recorded(old), recorded(new))
            ):
                self._bridge.send(client, "signals", signals(new, now))

    def _due(self, old: State, new: State) -> bool:
        """Check whether a live run has enough new frames to be redrawn."""
        if new.live is None or old.live is None or new.live.parts is old.live.parts:
            return False
        late = time.perf_counter() - self._drawn > LIVE_EVERY
        if late:
            self._drawn = time.perf_counter()
        return late


def shown(client: Client) -> tuple[object, ...]:
    """Return the choices of a page that its charts show."""
    return client.plots, client.display


def recorded(state: State) -> tuple[object, ...]:
    """Return the current run and the kept runs. For a live run, the result only depends on whether
    it has started."""
    if state.live is not None:
        return state.runs, bool(state.live.parts)
    return state.runs, None, state.plotted, state.derived


def signals(state: State, client: Client) -> Payload:
    """Return the signals available for the selected body and for the run."""
    name, several = client.selection, [n for n in client.selected if n in state.graph.number]
    of = [] if name is None or name not in state.graph.number else of_body(state.whole, name)
    if len(several) > 1:
        name, of = f"{len(several)} bodies", of_several(state.whole, several)
    scene = of_scene(state.plotted.result) if state.plotted is not None else []
    parts = [] if state.plotted is None else [state.plotted.result]
    if state.live is not None:
        parts = list(state.live.parts)
    apart = set[str].intersection(*map(idle, parts)) if parts else set[str]()
    rest = [s for s in scene if s.kind.startswith("contact_") and s.of in apart]
    return {
        "body": name,
        "of_body": [[s.kind, s.of, KINDS[s.quantity].label] for s in of],
        "of_scene": [[s.kind, s.of, title(s)] for s in scene if s not in rest],
        "idle": [[s.kind, s.of, title(s)] for s in rest],
        "ready": [] if state.plotted is None else ready(state.plotted.result, several),
        "idle_title": f"{counted(len(apart), 'contact')} that never touched",
        "hint": "" if state.plotted else NOTHING if state.model.rows else EMPTY,
    }


def plots(state: State, client: Client) -> Payload:
    """Return the charts for one page, including the curves of kept runs."""
    return {"charts": [chart(state, Signal(*plot), client.display) for plot in client.plots]}


def chart(state: State, signal: Signal, display: Display) -> Payload:
    """Return the chart for one signal, including the curves of each kept run."""
    run = state.plotted.result if state.plotted is not None else None
    found, why = of_state(state, signal, display), missing(state, signal)
    impacts = hits(run, signal) if run is not None else []
    carries = impacts or any(np.any(curve.y) for curve in found)
    if signal.quantity in CARRIED and found and not carries:
        found, why = [], IDLE  # an axis of 1e-12 would look like a force
    kept = [(one.name, curves(one.run.result, signal, display)) for one in state.runs]
    moves = {c.label for lines in (found, *(lines for _, lines in kept)) for c in lines if any(c.y)}
    rest = [c.label for c in found if moves and c.label not in moves]  # 0 throughout, not drawn
    drawn = [c for c in found if c.label not in rest]
    model = state.plotted.model if state.plotted else state.model
    own = ", ".join(dict.fromkeys(c.unit for c in drawn))
    shown_in = own or unit(model, signal, display)
    error = math.nan if run is None or state.live else float(run.error_estimate)
    felt: dict[str, Quantity] = {display.angle: "angle", display.length: "length"}
    known = shown_in in felt and math.isfinite(error)
    return {
        "components": components(run, signal) if run is not None else [],
        "poses": []
        if signal.kind != POSES or state.plotted is None or state.live
        else strip(state.plotted.result, state.plotted.travels),
        "kind": signal.kind,
        "of": signal.of,
        "title": title(signal),
        "none": why,
        "unit": shown_in,
        "error": display.shown(error, felt[shown_in]) if known else 0,  # estimated
        "curves": [curve._asdict() for curve in drawn],
        "rest": rest,
        "impacts": impacts,
        "kept": [
            {"name": name, "curves": [c._asdict() for c in lines if c.label not in rest]}
            for name, lines in kept
        ],
    }


def missing(state: State, signal: Signal) -> str:
    """Return the reason why a chart is empty, or "" if it is not."""
    if state.plotted is None:
        return "no run yet"
    known, kind = of_scene(state.plotted.result), signal.quantity
    there = signal in known or any(Signal(kind, name) in known for name in signal.bodies)
    if kind in OF_BODIES or there:
        return ""
    called = [title(s) for s in known if s.kind.split("_")[-1] == signal.kind.split("_")[-1]]
    return "not in this run; it has " + ", ".join(called[:3]) if called else "not in this run"


def of_state(state: State, signal: Signal, display: Display) -> list[Curve]:
    """Return the curves for the played run, or for the last part of a live one."""
    if state.plotted is None:
        return []
    if state.live is None:
        return curves(state.plotted.result, signal, display)
    start = state.t_end - LIVE_SPAN
    parts = [curves(part, signal, display) for part in state.live.parts if part.t[-1] >= start]
    found = []
    for pieces in zip(*parts):
        t, y = (np.concatenate([getattr(c, axis) for c in pieces]) for axis in ("t", "y"))
        found.append(thinned(pieces[0].label, t, y, pieces[0].unit))
    return found


VIEWS = (
    Place(lambda desk: PlotsView(desk.bridge), 44, Host("plots", "drawer", "Plots")),
    Place(topic("signals", signals, recorded, page=lambda _, page: (page.selected,)), 44),
)
