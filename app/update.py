"""`update(state, event) -> state`: pure, and with the reducers all of the deciding."""

from __future__ import annotations

from .events import Event
from .reducers import (
    analysing,
    editing,
    graph,
    living,
    looking,
    playing,
    plotting,
    posing,
    running,
    session,
    table,
)
from .state import State

REDUCERS = (
    session.update,
    editing.update,
    table.update,
    living.update,
    running.update,
    playing.update,
    graph.update,
    posing.update,
    plotting.update,
    looking.update,
    analysing.update,
)


def update(state: State, event: Event) -> State:
    """The state after `event`. Unfit and stale events leave it as it was, or say why."""
    for reducer in REDUCERS:
        changed = reducer(state, event)
        if changed is not None:
            return changed
    return state
