"""The running app: a model on a page at an address."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path

import pgraph_core as pg
import pgraph_models

from .constraints.mobility import Reports
from .core.bridge import Bridge, open_server, quiet
from .core.door import token_for
from .core.events import Event, from_page
from .core.state import initial
from .core.store import Store
from .features import update
from .model.update import recovered
from .model.worker import Errands
from .page import Page
from .report.worker import Analyst
from .run.live import LiveRunner
from .run.worker import Compiler, Files, Simulator
from .session.autosave import Autosave, left_behind


class Server:
    """A page on which people edit and simulate one shared model."""

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
        viser = open_server(host, port, secret)
        self.viser = viser
        self.port = viser.get_port()
        query = f"?token={secret}" if secret else ""
        self.url = f"http://{host}:{self.port}/{query}"
        state = initial(model, built_in())
        if keep is not None:
            state = recovered(state, left_behind(keep, host, self.port), given)
        self.store = Store(state, update)
        bridge = Bridge(viser, lambda client, text: self.send(from_page(client, text)))
        page = Page(bridge, self.send)
        self._autosave = Autosave(keep, host, self.port, given, self.send) if keep else None
        workers = (Simulator, LiveRunner, Analyst, Files, Reports, Errands)
        work = [worker(self.send) for worker in workers]
        keeps = filter(None, [self._autosave])  # first: what a page is told to be done is on disk
        self.store.ready, bridge.shown = bridge.ready, self.store.wake
        self.store.start(page.views, (*keeps, *work))
        self._compiler = Compiler(self.send)

    def send(self, event: Event) -> None:
        """Queue an event, from any thread."""
        self.store.send(event)

    def wait(self, until: threading.Event) -> None:
        """Stop once `until` is set."""
        until.wait()
        self.stop()

    def stop(self) -> None:
        """Close every page's connection and end the background work."""
        self._compiler.stop()
        self.store.stop()
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
    """Serve `model` at `http://host:port`, or on the next free port where that one is taken.

    With `token` "on" the address has a secret in it, and other requests are refused; "auto" is "on"
    for hosts other than this machine's own, which any of its users can reach. Edits are kept in
    the folder `keep`; `given` is what the model was asked for by, and what was edited there when
    the last server so started was killed comes back.
    """
    server = Server(model, host, port, given, keep, token)
    if port and server.port != port:
        print(f"Port {port} is taken; using {server.port}.")
    print(f"Pgraph is at {server.url}", flush=True)
    if server.store.state.greeting is not None:
        print(f"Recovered {server.store.state.greeting.text}", flush=True)
    if open_browser and not webbrowser.open(server.url):
        print("No browser could be opened; open the address yourself.")
    return server


def built_in() -> dict[str, str]:
    """The text of every built-in model, by name."""
    return {name: pgraph_models.path(name).read_text("utf-8") for name in pgraph_models.names()}
