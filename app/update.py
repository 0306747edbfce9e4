"""`update(state, event) -> state`: pure, and with the reducers all of the deciding."""

from __future__ import annotations

from .events import Event
from .reducers import (
    analysing,
    constraining,
    describing,
    editing,
    errands,
    graph,
    living,
    looking,
    parameters,
    playing,
    plotting,
    posing,
    running,
    session,
    table,
    walking,
)
from .renames import as_now
from .state import State

REDUCERS = (
    constraining.update,  # first: while a body is picked, a click selects nothing
    walking.update,
    session.update,
    editing.update,
    table.update,
    living.update,
    describing.update,
    parameters.update,
    errands.update,
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
    event = as_now(state.renames, event)
    for reducer in REDUCERS:
        changed = reducer(state, event)
        if changed is not None:
            return changed
    return state
