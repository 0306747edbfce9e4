"""What moves bodies by hand (pure): sliders and the gizmo; a pose is shown, then an edit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pgraph_core as pg

from .. import events
from ..core import cells
from ..core.cells import Refusal
from ..core.state import Grip, Reply, State, with_client
from ..events import Event
from ..model.update import attempted
from . import solving as posing

FINE = 4  # decimals that a gizmo gives a model of the size of 1 m


def update(state: State, event: Event) -> State | None:
    """The state after bodies were moved by hand; None for any other event."""
    match event:
        case events.Pose():
            return posed(state, event)
        case events.Posing(client, on):
            return with_client(state, client, posing=on)
        case events.HomePose():
            return replace(state, posed=None, pose_problem="")
        case events.UsePose(client):
            q, v = posing.shown_q(state), posing.shown_v(state)
            return attempted(
                state, client, lambda: posing.with_initial(state.model, q, v), "initial pose"
            )
        case events.Gizmo(client, what):
            return with_client(state, client, gizmo=what)
        case events.Grip() if event.body in state.model.row:
            return gripped(state, event)
        case events.Pull(_, body, _, target) if body in state.model.row:
            return replace(state, pull=event if target is not None else None)
        case _:
            return None


def posed(state: State, event: events.Pose) -> State:
    """The pose with one coordinate moved; as it was where a loop does not let it."""
    client, serial, problem = event.client, event.serial, ""
    try:
        state.model.body(event.body)
        value = cells.number(event.text)
        pose = posing.posed(state, event.body, event.index, value)
        state = replace(state, posed=pose, playback=replace(state.playback, playing=False))
    except Refusal as refusal:
        problem = f"body '{event.body}', q: {refusal}"
    except pg.PgraphError as error:
        problem = str(error)
    state = replace(state, pose_problem="" if serial else problem)
    return with_client(state, client, reply=Reply(serial, problem)) if serial else state


def gripped(state: State, event: events.Grip) -> State:
    """The body drawn where the gizmo is; let go, that is the model's new link vector or com."""
    body, client = state.model.body(event.body), event.client
    vector = rounded(getattr(body, event.what), event.vector, state.derived.size)
    if event.done:
        state = with_client(replace(state, posed=None), client, grip=None)
        model, change = state.model, {event.what: vector}
        label = f"{event.what} of {event.body}"
        return attempted(state, client, lambda: model.edit(event.body, **change), label)
    state = with_client(state, client, grip=Grip(event.body, event.what, vector))
    return state if event.what == "com" else _drafted(state, event.body, vector)


def _drafted(state: State, name: str, link: tuple[float, ...]) -> State:
    """The pose that another link vector gives at what is shown."""
    try:
        draft = state.model.edit(name, link=link)
    except pg.PgraphError:
        return state
    q = posing.shown_q(state)
    pose = posing.pose_at(replace(state, model=draft), q)
    return replace(state, posed=replace(pose, model=state.model))


def rounded(old: Sequence[float], new: Sequence[float], size: float) -> tuple[float, ...]:
    """`new` to what a hand can mean in a model of this size; what did not move stays as it was."""
    decimals = FINE - math.ceil(math.log10(size))
    least = 0.5 * 10.0**-decimals
    return tuple(a if abs(b - a) < least else round(b, decimals) for a, b in zip(old, new))
