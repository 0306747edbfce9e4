"""What the events do to the model: every one that changes it is one undo step (pure)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import pgraph_core as pg
from pgraph_core.model import assets, files

from .. import events
from ..core import cells
from ..core.cells import Refusal
from ..core.state import (
    FREE_RUN,
    Client,
    Kept,
    Notice,
    Reply,
    Request,
    State,
    Step,
    first_request,
    told,
    with_client,
)
from ..events import Event
from ..gait.walking import Walking
from ..run import living
from .archive import mesh_folder
from .derived import derive
from .renames import found, remembered

UNDO_DEPTH = 200
MOST_BODIES = 1000


def update(state: State, event: Event) -> State | None:
    """The state after an event that changes the model; None for any other event."""
    match event:
        case events.Edit():
            return edited(state, event)
        case events.NewModel(client, serial, text):
            return new_model(state, client, serial, text)
        case events.Undo():
            return undone(state)
        case events.Redo():
            return redone(state)
        case events.OpenBuiltIn(client, name) if name in state.gallery:
            return opened(state, client, name, state.gallery[name])
        case events.OpenKept(client, name) if name in state.kept:
            left = {key: kept for key, kept in state.kept.items() if key != name}
            state = opened(state, client, name, state.kept[name].text)
            return replace(state, kept=left)
        case events.OpenText(client, name, content):
            return opened(state, client, name, content)
        case _:
            return None


def edited(state: State, event: events.Edit) -> State:
    """A typed cell: taken as one undo step, or answered with the sentence that refuses it."""
    try:
        body = state.model.body(event.body)
        model = state.model.edit(
            event.body, **cells.change(body, event.field, event.index, event.text)
        )
    except Refusal as refusal:
        sentence = f"body '{event.body}', {event.field}: {refusal}"
        return with_client(state, event.client, reply=Reply(event.serial, sentence))
    except pg.PgraphError as error:
        return with_client(state, event.client, reply=Reply(event.serial, str(error)))
    state = with_model(state, model, f"{event.field} of {event.body}")
    state = with_client(state, event.client, reply=Reply(event.serial, ""))
    notices = "; ".join(model.notices)
    return told(state, event.client, Notice("Also changed", notices)) if notices else state


def attempted(state: State, client: int, make: Callable[[], pg.Model], label: str) -> State:
    """`make()` as the new model, or the reason why not, said to the page."""
    try:
        model = make()
    except pg.PgraphError as error:
        return told(state, client, Notice("Not done", str(error), bad=True))
    state = with_model(state, model, label)
    notices = "; ".join(model.notices)
    return told(state, client, Notice("Also changed", notices)) if notices else state


def new_model(state: State, client: int, serial: int, text: str) -> State:
    """Sec. 4.1's one question answered: the table of so many bodies."""
    try:
        model = pg.Model.serial(cells.whole(text, 1, MOST_BODIES))
    except Refusal as refusal:
        return with_client(state, client, reply=Reply(serial, f"The number of bodies {refusal}"))
    state = _replaced(state, model, f"new model of {len(model.bodies)} bodies")
    return with_client(state, client, reply=Reply(serial, ""))


def opened(state: State, client: int, name: str, content: str) -> State:
    """The model in a file's text, or why it is none."""
    try:
        data = files.parse(content, name)
        bodies = data.get("bodies")
        if isinstance(bodies, list) and len(bodies) > MOST_BODIES:
            return shown_model(state, client, name, None, _too_many(len(bodies)))
        model = pg.Model(**assets.located(data, mesh_folder()))
        return shown_model(state, client, name, model)
    except pg.PgraphError as error:
        return shown_model(state, client, name, None, str(error))


def _too_many(count: int) -> str:
    return f"it has {count} bodies; {MOST_BODIES} at most"


def shown_model(
    state: State, client: int, name: str, model: pg.Model | None, problem: str = ""
) -> State:
    """A model that was read in place of the one that is shown, or why it is not."""
    if model is not None and len(model.bodies) > MOST_BODIES:
        problem = _too_many(len(model.bodies))
    if model is None or problem:
        return told(state, client, Notice(f"{name} was not opened", problem, bad=True))
    state = _replaced(state, model, f"open {name}")
    return told(state, client, Notice(f"Opened {model.name}"))


def recovered(state: State, kept: tuple[Kept, ...], given: str) -> State:
    """The state to start with where earlier sessions left models: the newest again as it was if
    its server was killed and was started as this one; the others are offered."""
    again = kept[:1] if kept and not kept[0].ended and kept[0].given == given else ()
    offered = {_called(old): old for old in kept[len(again) :]}
    state = replace(state, kept=offered)
    for old in again:
        model = pg.Model.from_json(old.text)
        text = f"{model.name} as it was at {_at(old)}, when Pgraph was stopped. Undo gives {given}."
        state = _replaced(state, model, "recover the last session")
        state = replace(state, greeting=Notice("Recovered", text))
    return state


def _called(kept: Kept) -> str:
    name = pg.Model.from_json(kept.text).name
    return f"{name}, {_at(kept)}"


def _at(kept: Kept) -> str:
    return time.strftime("%H:%M:%S on %d %B", time.localtime(kept.time))


def _replaced(state: State, model: pg.Model, label: str) -> State:
    """Another model altogether: its own request, and the camera framed on it."""
    known = state.renames
    state = _with(state, model, label)
    return replace(
        state,
        renames=known,  # what stands in a row now is another thing, not another name
        request=first_request(model),
        framed=state.framed + 1,
        walking=Walking(),
        run_problem="",
    )


def with_model(state: State, model: pg.Model, label: str) -> State:
    """`model` in place of the current one, as one undo step; nothing if it is the same."""
    if model is state.model:
        return state
    return _with(state, model, label)


def _with(state: State, model: pg.Model, label: str) -> State:
    undo = (*state.undo, Step(state.model, label))[-UNDO_DEPTH:]
    return replace(_showing(state, model), undo=undo, redo=(), greeting=None)


def undone(state: State) -> State:
    """The model before the last step; its run is shown again where it has one."""
    if not state.undo:
        return state
    *undo, step = state.undo
    redo = (*state.redo, Step(state.model, step.label))
    return replace(_showing(state, step.model), undo=tuple(undo), redo=redo)


def redone(state: State) -> State:
    """The model that the last undo left."""
    if not state.redo:
        return state
    *redo, step = state.redo
    undo = (*state.undo, Step(state.model, step.label))
    return replace(_showing(state, step.model), undo=undo, redo=tuple(redo))


def _showing(state: State, model: pg.Model) -> State:
    """`model` shown: what follows from it, selections by name or row, playback at its start."""
    derived = derive(model)
    names = {(kind, old): new for kind, old, new in found(state.model, model)}
    clients = {
        key: _named(_follows(client, state.model, model), names)
        for key, client in state.clients.items()
    }
    request = _request_for(model, state.request)
    live = living.followed(state.live, state.model, model)
    playback = state.playback if live else replace(state.playback, time=0.0, playing=False)
    return replace(
        state,
        live=live,
        model=model,
        derived=derived,
        renames=remembered(state.renames, state.model, model),
        clients=clients,
        request=request,
        playback=playback,
    )


def _follows(client: Client, old: pg.Model, new: pg.Model) -> Client:
    """The page with the bodies selected that stay: of the same name, else renamed in their row."""
    if not client.selected:
        return client
    if len(old.bodies) == len(new.bodies):
        names = {a.name: b.name if a.name not in new.row else a.name
                 for a, b in zip(old.bodies, new.bodies)}  # fmt: skip
    else:
        names = {name: name for name in new.row}
    kept = sorted((names[n] for n in client.selected if n in names), key=new.row.__getitem__)
    last = names.get(client.selection or "", kept[-1] if kept else None)
    return replace(client, selection=last, selected=tuple(kept))


def _named(client: Client, names: Mapping[tuple[str, str], str]) -> Client:
    """What the page has opened, listed and plotted, under its new names."""
    if not names:
        return client
    opened = client.opened and (client.opened[0], names.get(client.opened, client.opened[1]))
    listed = client.listed and names.get(("bodies", client.listed), client.listed)
    plots = tuple((kind, names.get(("bodies", of), of)) for kind, of in client.plots)
    return replace(client, opened=opened, listed=listed, plots=plots)


def _request_for(model: pg.Model, request: Request) -> Request:
    known = {s.name for s in model.scenarios}
    kept = request.scenario == FREE_RUN or request.scenario in known
    return request if kept else replace(request, scenario=FREE_RUN)
