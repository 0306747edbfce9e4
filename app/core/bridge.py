"""Communication in both directions between Python and our script in the page.

Only this file and `door.py` use names that viser 1.1.1 does not document. These are
`RunJavascriptMessage`, a client's own connection, the event of a message buffer, a handle's uuid
and `window.__viserMutable`, whose `sendMessage` only complains without a connection and whose
scene's `onBeforeRender` gets three.js's renderer. There are also `__viserSceneTree` (in
bridge.js), `websockets.asyncio.server.serve` and the kinds of messages.
`tests/app/test_bridge.py` and `test_door.py` have a test for each.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import io
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import viser
from viser._messages import RunJavascriptMessage

from .door import guarded

APP = Path(__file__).parent.parent
# of this folder, in order
CORE_SCRIPTS = (
    "bridge", "icons", "lists", "frame", "popups", "palette", "notes", "cells", "forms", "shortcuts"
)  # fmt: skip
CORE_STYLES = ("page", "frame", "popups", "notes", "cells", "forms", "shortcuts")

Receive = Callable[[int, str], None]
PICTURE, SHOWN = "time", '{"event":"Shown"'  # topic of pictures, and a page's acknowledgement
MOST_BEHIND = 2  # pictures that a page has not shown yet
PATIENCE = 1.0  # [s] between pictures for a page that does not answer: it holds up nobody
Node = TypeVar("Node", bound=viser.SceneNodeHandle)


def at_rest(node: Node) -> Node:
    """Return `node` at its default pose, which is also sent to clients.

    viser 1.1.1 sends no pose that is the default, so a node removed and added under the same name
    would keep the pose of the old one.
    """
    for pose in ("wxyz", "position"):
        value = getattr(node, pose).copy()
        setattr(node, pose, value[::-1] + 1.0)
        setattr(node, pose, value)
    return node


def open_server(host: str, port: int, token: str | None) -> viser.ViserServer:
    """Start a viser server on the next free port. It rejects pages from other sites."""
    with guarded(host, token), quiet():
        server = viser.ViserServer(host=host, port=port, label="Pgraph", verbose=False)
        woken_in_its_loop(server._websock_server)
        return server


class WokenInItsLoop(asyncio.Event):
    """An event whose `set` has no effect outside its event loop, where asyncio forbids it.

    viser sets its events in the thread that sends, and then again in the loop. The first of the
    two fails if the loop changes the list of who waits at that moment.
    """

    def set(self) -> None:
        with contextlib.suppress(RuntimeError):  # no loop runs in this thread
            asyncio.get_running_loop()
            super().set()


def woken_in_its_loop(connection: Any) -> None:
    """Allow messages to this connection, or to all, to be sent from any thread."""
    connection.get_message_buffer().message_event.__class__ = WokenInItsLoop


class Bridge:
    """A bridge that sends topics to pages and passes their messages to `receive(client, text)`."""

    def __init__(self, server: viser.ViserServer, receive: Receive):
        self.server = server
        self._receive = receive
        self._behind: dict[int, int] = {}  # by page: pictures sent and not shown
        self._heard: dict[int, float] = {}  # when each showed one, or got one that it waits for
        self._together: dict[int, list[str]] | None = None  # topics by page, while batched
        self.shown: Callable[[], None] = lambda: None  # called when a page has shown one

    def publish(self, hosts: list[tuple[str, str, str]]) -> None:
        """Send the script, style and hosts (view, slot, tab) to every page that opens."""
        source = static_script(hosts)
        self.server._websock_server.queue_message(RunJavascriptMessage(source=source))

    def connect(self, client: viser.ClientHandle) -> None:
        """Set up the return channel from this page, a hidden text whose value our script sets."""
        woken_in_its_loop(client._websock_connection)
        uplink = client.gui.add_text("", initial_value="", visible=False)

        @uplink.on_update
        async def _(event: viser.GuiEvent) -> None:  # async: in order, and the value as sent
            if event.client is None:
                return
            if uplink.value.startswith(SHOWN):
                self._was_shown(event.client.client_id)
            else:
                self._receive(event.client.client_id, uplink.value)

        self._push(client, [written("uplink", uplink._impl.uuid)])

    def send(self, client_id: int, topic: str, data: Any) -> None:
        """Send `data` to one page's views that listen to `topic`. Closed pages are ignored."""
        client = self.server.get_clients().get(client_id)
        if client is None:
            self._behind.pop(client_id, None)
            return
        if topic == PICTURE:
            behind = self._behind.get(client_id, 0)
            if not 0 < behind < MOST_BEHIND:
                self._heard[client_id] = time.monotonic()
            self._behind[client_id] = behind + 1
        if self._together is None:
            self._push(client, [written(topic, data)])
        else:
            self._together.setdefault(client_id, []).append(written(topic, data))

    def download(self, client_id: int, name: str, content: bytes) -> None:
        """Send a file to one page, which saves it. Closed pages are ignored."""
        if (client := self.server.get_clients().get(client_id)) is not None:
            client.send_file_download(name, content, save_immediately=True)

    def _was_shown(self, client_id: int) -> None:
        self._behind[client_id] = max(self._behind.get(client_id, 0) - 1, 0)
        self._heard[client_id] = time.monotonic()
        self.shown()

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """Send all topics of one change as one message to each page.

        The page draws them in one task, so nobody can type in a form before the page has the
        version of the rows that the form shows. The loop of each page is woken once, because each
        wake-up releases the GIL, which is more expensive than the message if many threads compete.
        """
        pages, self._together = self.server.get_clients(), {}
        with contextlib.ExitStack() as stack:
            for connection in (self.server, *pages.values()):
                stack.enter_context(connection.atomic())
            try:
                yield
            finally:
                topics, self._together = self._together, None
                for page in topics.keys() & pages.keys():
                    self._push(pages[page], topics[page])

    def ready(self) -> bool:
        """Check whether every page has shown its images, or has received none for a while."""
        late = [page for page, n in list(self._behind.items()) if n >= MOST_BEHIND]
        if not late:
            return True
        pages, now = self.server.get_clients(), time.monotonic()
        return all(page not in pages or now - self._heard[page] > PATIENCE for page in late)

    def _push(self, client: viser.ClientHandle, topics: list[str]) -> None:
        """Send on the client's own connection, to an inbox: our script may not have arrived."""
        source = f"(window.pgraphInbox ??= []).push({','.join(topics)}); window.pgraph?.drain();"
        client._websock_connection.queue_message(RunJavascriptMessage(source=source))


def written(topic: str, data: Any) -> str:
    """Return a topic and its data as JSON in ASCII, which is safe inside a script."""
    return json.dumps([topic, data], allow_nan=False)


def static_script(hosts: list[tuple[str, str, str]]) -> str:
    """Return the complete script and style sheet, which are loaded once per page."""
    style = "\n".join(_sources(CORE_STYLES, "css"))
    font = base64.b64encode((APP / "core" / "inter.woff2").read_bytes()).decode()
    style = json.dumps(style.replace("inter.woff2", f"data:font/woff2;base64,{font}"))
    scripts = _sources(CORE_SCRIPTS, "js")
    return "\n".join([*scripts, f"pgraph.start({style}, {json.dumps(hosts)});"])


def _sources(core: tuple[str, ...], suffix: str) -> list[str]:
    features = sorted(f for f in APP.glob(f"*/*.{suffix}") if f.parent != APP / "core")
    files = [*(APP / "core" / f"{name}.{suffix}" for name in core), *features]
    return [file.read_text("utf-8") for file in files]


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Suppress viser's own banners, since the app prints its address itself."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
