"""`update(state, event) -> state`: pure, and with `edits` and `runs` all of the deciding."""

from __future__ import annotations

from dataclasses import replace

from . import edits, events, runs
from .events import Event
from .state import Client, Kernels, Notice, Reply, Saving, State, told, with_client


def update(state: State, event: Event) -> State:
    """The state after `event`. Unfit and stale events leave it as it was, or say why."""
    match event:
        case events.Connected(client):
            return replace(state, clients={**state.clients, client: Client()})
        case events.Disconnected(client):
            left = {key: value for key, value in state.clients.items() if key != client}
            return replace(state, clients=left)
        case events.Misread(client, text):
            return told(state, client, Notice("The page sent something unknown", text, bad=True))
        case events.Select(client, body):
            known = body is None or body in state.derived.number
            return with_client(state, client, selection=body) if known else state
        case events.Theme(client, dark):
            return with_client(state, client, dark=dark)
        case events.Viewport(client, aspect):
            return with_client(state, client, aspect=aspect)
        case events.Show(_, what, on):
            return replace(state, shown=state.shown | {what} if on else state.shown - {what})
        case events.Download(client) if client in state.clients:
            return with_client(state, client, downloads=state.clients[client].downloads + 1)
        case events.Save(client, serial, path):
            return replace(state, saving=Saving(client, serial, path, state.model))
        case events.Saved(client, serial, path, problem):
            state = with_client(state, client, reply=Reply(serial, problem))
            return state if problem else told(state, client, Notice("Saved", path))
        case _:
            return _update_model(state, event)


def _update_model(state: State, event: Event) -> State:
    match event:
        case events.Edit():
            return edits.edited(state, event)
        case events.NewModel(client, serial, text):
            return edits.new_model(state, client, serial, text)
        case events.AddBody(client, parent):
            return edits.added(state, client, parent)
        case events.DeleteBody():
            return edits.deleted(state, event)
        case events.Undo():
            return edits.undone(state)
        case events.Redo():
            return edits.redone(state)
        case events.OpenBuiltIn(client, name) if name in state.gallery:
            return edits.opened(state, client, name, state.gallery[name])
        case events.OpenText(client, name, content):
            return edits.opened(state, client, name, content)
        case _:
            return _update_run(state, event)


def _update_run(state: State, event: Event) -> State:
    match event:
        case events.SetScenario(client, serial, scenario):
            state = runs.scenario_chosen(state, scenario)
            return with_client(state, client, reply=Reply(serial, ""))
        case events.SetRun():
            return runs.request_edited(state, event)
        case events.Simulate() if state.job is None:
            return runs.asked(state)
        case events.Cancel() if state.job is not None:
            return replace(state, job=None, run_problem="The simulation was cancelled.")
        case events.Progress() | events.Simulated() | events.Failed():
            return runs.heard(state, event)
        case events.Compiling(done, total, name):
            return replace(state, kernels=Kernels(done, total, name))
        case events.Compiled(problem):
            return replace(state, kernels=replace(state.kernels, ready=True, problem=problem))
        case _:
            playback = runs.played(state, event)
            return state if playback is state.playback else replace(state, playback=playback)
