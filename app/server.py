"""The running app: a page that serves a model at an address, and the layout of the page."""

from __future__ import annotations

import gc
import threading
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path

import viser

import pgraph_core as pg
import pgraph_models

from .core.bridge import Bridge, open_server, quiet
from .core.door import token_for
from .core.events import Event, from_page
from .core.jobs import Finder, Finding, Job, Worker
from .core.store import Store, View
from .core.views import Desk, made
from .features import initial, places, update
from .gait.live import LiveRunner
from .model import recovered
from .model.apart import Errands
from .run.worker import Compiler
from .session import Connected, Disconnected
from .session.autosave import Autosave, Files, left_behind
from .session.view import ACCENT

AGAIN = 0.2  # s, how often a server that waits asks whether it is to stop


class Server:
    """A server whose page lets people edit and simulate one shared model."""

    def __init__(
        self,
        model: pg.Model,
        host: str,
        port: int,
        given: str = "",
        keep: Path | None = None,
        token: str = "auto",
    ):
        secret = token_for(host, token)
        self.viser = open_server(host, port, secret)
        self.port = self.viser.get_port()
        query = f"?token={secret}" if secret else ""
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{self.port}/{query}"
        state = initial(model, built_in())
        left = left_behind(keep) if keep is not None else ()
        state = recovered(state, left, given)
        again = {kept.path for kept in left} - {kept.path for kept in state.kept.values()}
        self.store = Store(state, update)
        bridge = Bridge(self.viser, lambda client, text: self.send(from_page(client, text)))
        page = Page(bridge, self.send)
        self._autosave = Autosave(keep, given, self.send, again) if keep else None
        self._jobs = [Worker(kind, kind.work, self.send) for kind in Job.__subclasses__()]
        work: list[View] = [*self._jobs]
        finders = [Finder(kind, self.send) for kind in Finding.__subclasses__()]
        work += [worker(self.send) for worker in (LiveRunner, Files, Errands)]
        keeps = filter(None, [self._autosave])  # first, so confirmed edits are on disk
        self.store.ready, bridge.shown = bridge.ready, self.store.wake
        self.store.together = bridge.together
        # finders last, as they would take processor time from what the pages show
        self.store.start((*page.views, *finders), (*keeps, *work))
        self._compiler = Compiler(self.send)

    def send(self, event: Event) -> None:
        """Queue an event. May be called from any thread."""
        self.store.send(event)

    def wait(self, until: Callable[[], bool]) -> None:
        """Stop once `until` is true.

        This function polls, because a signal received by another thread does not wake a main thread
        that waits for a lock, and handlers only run in the main thread.
        """
        while not until():
            time.sleep(AGAIN)
        self.stop()

    def stop(self) -> None:
        """Close every page's connection and end the background work."""
        self._compiler.stop()
        self.store.stop()
        for worker in self._jobs:
            worker.stop()
        if self._autosave is not None:
            self._autosave.stop()
        with quiet():
            self.viser.stop()


def serve(
    model: pg.Model,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = True,
    given: str = "",
    keep: Path | None = None,
    token: str = "auto",
) -> Server:
    """Serve `model` at `http://host:port`, or on the next free port if that one is in use.

    If `token` is "on", the address contains a secret, and requests without it are rejected. "auto"
    is equivalent to "on" unless `host` is an address of this machine only, which all its users can
    reach. Edits are stored in the folder `keep`. `given` identifies the model: if a server that was
    started with the same `given` was killed, the model as edited there is restored.
    """
    server = Server(model, host, port, given, keep, token)
    if port and server.port != port:
        print(f"Port {port} is taken; using {server.port}.")
    print(f"Pgraph is at {server.url}", flush=True)
    if server.store.state.greeting is not None:
        greeting = server.store.state.greeting
        print(f"{greeting.title}: {greeting.text}", flush=True)
    if open_browser:  # some browsers return when they are closed
        threading.Thread(target=_open, args=(server.url,), daemon=True).start()
    return server


def _open(url: str) -> None:
    """Open an address in the browser."""
    if not webbrowser.open(url):
        print("No browser could be opened; open the address yourself.", flush=True)


def built_in() -> dict[str, str]:
    """Return the text of every built-in model by name."""
    return {name: pgraph_models.path(name).read_text("utf-8") for name in pgraph_models.names()}


# -- the page --------------------------------------------------------------------------------------


GONE = 20  # pages that leave between two collections of garbage


class Page:
    """All views on a viser server, and the handling of pages that connect and disconnect."""

    def __init__(self, bridge: Bridge, send: Callable[[Event], None]):
        server = bridge.server
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=ACCENT)
        self.views = made(places(), Desk(bridge, send))

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            bridge.connect(client)
            send(Connected(client.client_id))

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            send(Disconnected(client.client_id))
            # A closed connection is a cycle of few but large objects: Python, which counts objects,
            # would let hundreds of them lie.
            if client.client_id % GONE == GONE - 1:
                gc.collect()
