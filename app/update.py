"""`update(state, event) -> state`: pure, and with the reducers all of the deciding."""

from __future__ import annotations

from .constraints import update as constraining
from .core.state import State
from .digraph import update as graph
from .events import Event
from .gait import update as walking
from .model import errands
from .model import update as editing
from .model.renames import as_now
from .operators import update as looking
from .playback import update as playing
from .plots import update as plotting
from .pose import update as posing
from .properties import parameters
from .properties import update as describing
from .report import update as analysing
from .run import living
from .run import update as running
from .session import update as session
from .table import update as table

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
