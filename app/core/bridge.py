"""Both directions between Python and our script in the page, and who may connect.

The one file that knows names viser 1.1.1 does not document: `RunJavascriptMessage`, a client's
own connection, a handle's uuid, `window.__viserMutable.sendMessage` (in bridge.js) and the
`websockets.asyncio.server.serve` it calls. `tests/app/test_bridge.py` has a test for each.
"""

from __future__ import annotations

import contextlib
import http
import io
import json
import secrets
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser
import websockets.asyncio.server
from viser._messages import RunJavascriptMessage
from websockets.http11 import Response

APP = Path(__file__).parent.parent
CORE_SCRIPTS = ("bridge", "lists", "cells", "forms", "shortcuts")  # of this folder, in order
CORE_STYLES = ("page", "cells", "forms", "shortcuts")
LARGEST_MESSAGE = 16 * 1024 * 1024  # [bytes] from a page; viser's own limit is 50 MB
LOOPBACK = ("127.0.0.1", "localhost", "::1")
COOKIE = "pgraph_token"

Receive = Callable[[int, str], None]


def open_server(host: str, port: int, token: str | None) -> viser.ViserServer:
    """A viser server that refuses other sites' pages; on a taken port, the next free one."""
    with _guarded(token), quiet():
        return viser.ViserServer(host=host, port=port, label="Pgraph", verbose=False)


def token_for(host: str) -> str | None:
    """Nothing where only this machine can connect, else a secret the address must carry."""
    return None if host in LOOPBACK else secrets.token_urlsafe(16)


class Bridge:
    """Sends topics to pages and hands their messages to `receive(client, text)`."""

    def __init__(self, server: viser.ViserServer, receive: Receive):
        self.server = server
        self._receive = receive
        server._websock_server.queue_message(RunJavascriptMessage(source=static_script()))

    def host(self, view: str) -> None:
        """A static, empty place for a view of ours in the current viser container.

        The image has no picture: its error handler runs at each (re)mount of the host.
        """
        self.server.gui.add_html(
            f'<div class="pgraph" data-view="{view}"></div>'
            '<img hidden src="data:," onerror="window.pgraph && pgraph.mount()">'
        )

    def connect(self, client: viser.ClientHandle) -> None:
        """The way back from this page: a hidden text whose value our script sets."""
        uplink = client.gui.add_text("", initial_value="", visible=False)

        @uplink.on_update
        async def _(event: viser.GuiEvent) -> None:  # async: in order, and the value as sent
            if event.client is not None:
                self._receive(event.client.client_id, uplink.value)

        self._push(client, "uplink", uplink._impl.uuid)

    def send(self, client_id: int, topic: str, data: Any) -> None:
        """`data` to the views that listen to `topic` on one page; gone pages are ignored."""
        client = self.server.get_clients().get(client_id)
        if client is not None:
            self._push(client, topic, data)

    def _push(self, client: viser.ClientHandle, topic: str, data: Any) -> None:
        """On the client's own connection; it may arrive before our script, hence the inbox."""
        message = json.dumps([topic, data], allow_nan=False)  # ASCII: safe inside a script
        source = f"(window.pgraphInbox ??= []).push({message}); window.pgraph?.drain();"
        client._websock_connection.queue_message(RunJavascriptMessage(source=source))


def static_script() -> str:
    """All of our script and style, to be run once per page: the core's, then every feature's."""
    style = json.dumps("\n".join(_sources(CORE_STYLES, "css")))
    scripts = _sources(CORE_SCRIPTS, "js")
    return "\n".join([f"const PGRAPH_CSS = {style};", *scripts, "pgraph.start(PGRAPH_CSS);"])


def _sources(core: tuple[str, ...], suffix: str) -> list[str]:
    features = sorted(f for f in APP.glob(f"*/*.{suffix}") if f.parent != APP / "core")
    files = [*(APP / "core" / f"{name}.{suffix}" for name in core), *features]
    return [file.read_text("utf-8") for file in files]


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """viser's own banners are not printed: the app says where it is itself."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


@contextlib.contextmanager
def _guarded(token: str | None) -> Iterator[None]:
    """While a viser server is made: its `serve` checks each request and limits messages."""
    module = websockets.asyncio.server
    plain = module.serve

    def serve(handler: Any, host: str, port: int, **options: Any) -> Any:
        page = options.pop("process_request")

        def process_request(connection: Any, request: Any) -> Response | None:
            refusal = _refusal(request.headers, request.path, token)
            if refusal is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, refusal + "\n")
            response = page(connection, request)
            if response is not None and token is not None:
                response.headers["Set-Cookie"] = f"{COOKIE}={token}; HttpOnly; SameSite=Strict"
            return response

        options["max_size"] = LARGEST_MESSAGE
        return plain(handler, host, port, process_request=process_request, **options)

    module.serve = serve  # type: ignore[assignment]
    try:
        yield
    finally:
        module.serve = plain


def _refusal(headers: Any, path: str, token: str | None) -> str | None:
    """Why a request is not for us: another site's page, a foreign name, a missing token."""
    host, origin = headers.get("Host", ""), headers.get("Origin")
    if token is None and urlsplit(f"//{host}").hostname not in LOOPBACK:
        return f"This server answers on 127.0.0.1 and localhost, not as {host!r}."
    if origin is not None and urlsplit(origin).netloc != host:
        return f"Pages of {origin} may not connect."
    if token is None:
        return None
    given = parse_qs(urlsplit(path).query).get("token", [""])[0]
    cookie = f"{COOKIE}={token}" in headers.get("Cookie", "").split("; ")
    if cookie or secrets.compare_digest(given.encode(), token.encode()):
        return None
    return "Open the address that the server printed: it carries a token."
