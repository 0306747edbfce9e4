"""The digraph with the vectors Pgraph and jdof above it, and stepping through both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import pgraph_core as pg

from ..core.state import freedoms
from ..core.views import Host, Payload, Place, hue, topic
from ..pose.solving import home, shown_q
from . import Client, State

SAMPLE = 0.3  # [rad, m] sample motion of joints in a frame update from the initial state


def digraph(state: State) -> Payload:
    """Return the positions, numbers and kinds of nodes, the two vectors, the constraints."""
    d, dof = state.graph, freedoms(state.whole)
    rows = {body.name: body for body in state.model.rows}
    masses = {b.name: b.mass for b in state.model.bodies}
    masses |= {b.name: b.stiff.rho_a * b.extent for b in state.model.beams}
    bodies, beams = [rows[name] for name in d.names], {beam.name for beam in state.model.beams}
    return {
        **vars(d.layout),
        "names": d.names,
        "parent": d.parent,
        "dof": [dof[name] for name in d.names],
        "joints": ["beam" if body.name in beams else body.joint for body in bodies],
        "sites": [[s.name for s in state.model.sites if s.body == name] for name in d.names],
        "masses": [masses[name] for name in d.names],
        "colors": [hue(k) for k in d.branches],
        "tips": sorted(d.tips),
        "separation": sorted(d.separation),
        "pgraph": d.pgraph,
        "jdof": d.jdof,
        "loops": [loop._asdict() for loop in d.loops],
    }


def _walked(state: State, page: Client) -> tuple[object, ...]:
    return page.walk, page.walk and state.graph, page.walk == "frames" and state.pose


def walk(state: State, page: Client) -> Payload:
    """Return the steps for a page to walk through, from Fig. 4, Fig. 8 or neither."""
    what = page.walk
    if what == "pgraph":
        d = state.graph
        of = freedoms(state.whole)
        dof = [of[name] for name in d.names]
        return {"kind": what, "steps": [step._asdict() for step in seven_steps(d.parent, dof)]}
    return frame_update(state) if what == "frames" else {"kind": ""}


def frame_update(state: State) -> Payload:
    """Return the trace of Fig. 8 from the initial state to the shown one, or a sample step."""
    start, end = home(state.whole), shown_q(state)
    said = "from the initial pose to the one shown"
    if np.array_equal(start, end):
        end = sampled(state.whole)
        said = f"from the initial pose, joints moved by {SAMPLE}"
    trace = pg.frame_update_trace(state.whole, start, end)
    steps = [{**visit._asdict(), "does": does} for visit, does in trace.steps]
    return {"kind": "frames", "from": said, "steps": steps}


def sampled(model: pg.Model) -> np.ndarray:
    """Return the initial state (nq,) with every single-coordinate joint moved by SAMPLE."""
    bodies = (model.body(name) for name in pg.Topology.of(model).names)
    step = [SAMPLE if len(body.q) == 1 else 0.0 for body in bodies for _ in body.q]
    return home(model) + np.array(step)


class Step(NamedTuple):
    """One step and its effect on Pgraph, jdof and the stack of separation bodies SBS."""

    step: str  # its number in Fig. 4, or two consecutive numbers
    text: str
    body: int  # i after it, 0 for the ground
    adds: tuple[int, int] | None = None  # the new entries of Pgraph and jdof
    push: int | None = None  # SBn that goes onto SBS, after the pull
    pull: bool = False
    tip: int = 0  # TBn at a tip body


def seven_steps(parent: Sequence[int], dof: Sequence[int]) -> list[Step]:
    """Return the steps for bodies 1..n, from the ground if there are many roots."""
    left: list[list[int]] = [[] for _ in range(len(parent) + 1)]
    for k in range(len(parent), 0, -1):
        left[parent[k - 1]].append(k)  # the left child last, so that pop() takes it
    if not parent:
        return []
    i = 0 if len(left[0]) > 1 else left[0].pop()
    root = "the ground, which carries several bodies" if i == 0 else "the root"
    steps = [Step("1", f"Pgraph and jdof are empty; i = {i}, {root}", i)]
    stack: list[int] = []
    while True:
        steps.append(_entered(i, dof[i - 1] if i else 0))
        if len(left[i]) > 1:
            stack.append(i)
            steps.append(Step("3", f"{i} is a separation body: SBS gets {i}", i, push=i))
        if not left[i]:
            if not stack:
                steps.append(Step("4, 7", f"{i} is a tip and SBS is empty: the end", i, tip=i))
                return steps
            tip, i = i, stack.pop()
            again = len(left[i]) > 1
            if again:
                stack.append(i)
            steps.append(_back(tip, i, again))
            i = left[i].pop()
            steps.append(Step("6", f"i = {i}, the left one of the untraversed children", i))
        else:
            i = left[i].pop()
            steps.append(Step("4", f"i = {i}, the left one of the untraversed children", i))


def _entered(i: int, dof: int) -> Step:
    return Step("2", f"Pgraph gets {i}, jdof gets {dof}", i, adds=(i, dof))


def _back(tip: int, i: int, again: bool) -> Step:
    pushed = ", pushed back" if again else ""
    text = f"{tip} is a tip: pull {i} from SBS{pushed}; Pgraph gets {i}, jdof 0"
    return Step("4, 5", text, i, (i, 0), i if again else None, pull=True, tip=tip)


VIEWS = (
    Place(topic("digraph", digraph, "graph"), 20, Host("digraph", "left", "Bodies")),
    Place(topic("steps", walk, page=_walked), 20),
)
