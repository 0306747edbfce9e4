"""Settings of the next run, put into the model that is handed over (pure)."""

from __future__ import annotations

from dataclasses import replace

import pgraph_core as pg
from pgraph_core.model.editing import free_name
from pgraph_core.model.settings import settings_of

from ..core.edit import ALSO, with_model
from ..core.state import Notice, told
from . import FREE_RUN, Request, S, State, moved


def unkept(state: State) -> bool:
    """Check whether the next run has other settings than its scenario, or a free run than usual."""
    own = {s.name: Request.of(s) for s in state.model.scenarios}
    usual = own.get(state.request.scenario, Request())
    return bool(state.model.rows) and (state.request != usual or state.set_gait is not None)


def kept(state: S, client: int) -> S:
    """Return the state with the settings of its next run in the model, which is to be written.

    A file then holds what the page runs. A free run becomes a scenario. This is one undo step, and
    a run with these settings remains the present one.
    """
    if not unkept(state):
        return state
    model, name = state.model, state.request.scenario
    fields = settings_of(state.request)
    if name == FREE_RUN:
        name = free_name("scenario", [s.name for s in model.scenarios])
        model = model.add(pg.Scenario(name=name, **fields))
    else:
        gait = {} if state.set_gait is None else {"gait": state.set_gait}
        model = model.edit(name, kind="scenario", **fields, **gait)
    same = state.live is None and state.run is not None and not state.outdated
    after = with_model(state, model, f"settings of {name}")
    after = replace(after, request=Request.of(model.scenario(name)))
    if same and state.last_run is not None:
        run = replace(moved(state.last_run, model), request=after.request, gait=None)
        after = replace(after, last_run=run, playback=state.playback)
    text = f"The scenario '{name}' has the settings of the run, so that the file has them"
    return told(after, client, Notice(ALSO, text))
