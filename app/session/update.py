"""What the events do to the pages: coming and going, selecting, looking, saving (pure)."""

from __future__ import annotations

from dataclasses import replace

from .. import events
from ..core.intents import Display
from ..core.state import Client, Notice, Reply, Saving, State, told, with_client
from ..events import Event

MOST_LEFT = 50  # pages that are remembered


def update(state: State, event: Event) -> State | None:
    """The state after an event of one page; None for any other event."""
    match event:
        case events.Connected(client):
            page = Client(notice=state.greeting)
            return replace(state, clients={**state.clients, client: page})
        case events.Hello():
            return greeted(state, event)
        case events.Disconnected(client):
            return gone(state, client)
        case events.Misread(client, text):
            return told(state, client, Notice("The page sent something unknown", text, bad=True))
        case events.Select(client, body):
            return selected(state, client, body, () if body is None else (body,))
        case events.SelectBodies(client, body, bodies):
            return selected(state, client, body, bodies)
        case events.Theme(client, dark):
            return with_client(state, client, dark=dark)
        case events.Viewport(client, aspect):
            return with_client(state, client, aspect=aspect)
        case events.Show(_, what, on):
            return replace(state, shown=state.shown | {what} if on else state.shown - {what})
        case events.Download(client) if client in state.clients:
            return with_client(state, client, downloads=state.clients[client].downloads + 1)
        case events.NotKept(problem):
            notice = Notice("Edits are not kept", f"{problem} Save the model yourself.", bad=True)
            pages = {key: replace(page, notice=notice) for key, page in state.clients.items()}
            return replace(state, clients=pages)
        case events.Save(client, serial, path):
            return replace(state, saving=Saving(client, serial, path, state.model))
        case events.Saved(client, serial, path, problem):
            state = with_client(state, client, reply=Reply(serial, problem))
            return state if problem else told(state, client, Notice("Saved", said(path, state)))
        case _:
            return None


def said(path: str, state: State) -> str:
    """Where the model was saved, and its meshes."""
    meshes = any(b.shape is not None and b.shape.file for b in state.model.bodies)
    return f"{path}; its mesh files are in the folder 'meshes' beside it" if meshes else path


def gone(state: State, client: int) -> State:
    """Without that page; what it looked at is kept for when it comes back."""
    here = dict(state.clients)
    page = here.pop(client, None)
    if page is None or not page.page:
        return replace(state, clients=here)
    others = [(name, old) for name, old in state.left.items() if name != page.page]
    return replace(state, clients=here, left=dict([*others, (page.page, page)][-MOST_LEFT:]))


def greeted(state: State, event: events.Hello) -> State:
    """A page as it was before its connection was lost, as far as that is known."""
    client = event.client
    if client not in state.clients:
        return state
    fresh = state.clients[client]
    old = state.left.get(event.page) or next(
        (x for key, x in state.clients.items() if x.page == event.page and key != client), fresh
    )
    page = replace(
        old, page=event.page, dark=event.dark, display=Display(*event.display), grip=None,
        aspect=fresh.aspect, notice=fresh.notice, reply=Reply(event.serial, ""),
        downloads=fresh.downloads, reports=fresh.reports, exported=fresh.exported,
        selection=None, selected=(),
    )  # fmt: skip
    left = {name: x for name, x in state.left.items() if name != event.page}
    state = replace(state, clients={**state.clients, client: page}, left=left)
    return selected(state, client, event.body, event.bodies)


def selected(state: State, client: int, body: str | None, bodies: tuple[str, ...]) -> State:
    """`state` with these bodies selected on one page; as it was where `body` is unknown."""
    if body is not None and body not in state.model.row:
        return state
    wanted = {*bodies, body}
    known = tuple(b.name for b in state.model.bodies if b.name in wanted)
    return with_client(state, client, selection=body, selected=known)
