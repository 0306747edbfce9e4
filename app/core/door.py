"""Access control for connections and page messages, by the threat model in docs/page.md.

viser accepts any of its own messages from any page: it would open a public tunnel, keep uploads and
set any attribute of a handle. Only message types of the page are accepted, and only with short
values of basic types.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import functools
import gzip
import http
import logging
import math
import secrets
import time
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import parse_qs, urlsplit

import msgspec
import viser._messages
import websockets.asyncio.server
from websockets.frames import Opcode
from websockets.http11 import Response

LARGEST_MESSAGE = 16 * 1024 * 1024  # [bytes] limit on a page's message (viser's is 50 MB)
LOOPBACK = ("127.0.0.1", "localhost", "::1")
COOKIE = "pgraph_token"  # and the port: a browser keeps one jar for all ports of a host
PASS = (  # kinds of messages that pages send. All others are dropped
    "GuiUpdateMessage",
    "ViewerCameraMessage",
    "ScenePointerMessage",
    "SceneNodeClickMessage",
    "SceneNodeDragMessage",
    "TransformControlsUpdateMessage",
    "TransformControlsDragStartMessage",
    "TransformControlsDragEndMessage",
)
MESSAGES = (300.0, 600.0)  # a second for one page, and at once
BYTES = (32e6, 64e6)  # the same in bytes
EXTRA = (100.0, 1000.0)  # pings and parts of messages: a browser makes 130 parts of 16 MB
READ_AT_ONCE = 16 * 1024  # [bytes] read from a connection before others have their turn
MOST_CONNECTIONS = 256  # limit on connections (a page needs one, and more while it loads)
CONTROL = (Opcode.PING, Opcode.PONG, Opcode.CLOSE)
LONGEST_TEXT = 500  # limit on the length of values that no person types
MOST_NUMBERS = 64  # limit on the numbers in a list of a message
LARGEST_LISTS = 9 * MOST_NUMBERS**2  # size of nested lists of numbers in a message [bytes]
HEADERS = {
    "Content-Security-Policy": (  # viser's page runs its own inline scripts and ours by Function
        "default-src 'self' data: blob:; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: "
        "data:; style-src 'self' 'unsafe-inline'; connect-src 'self' ws: wss: data: blob:; "
        "worker-src 'self' blob: data:; object-src 'none'; base-uri 'self'; frame-ancestors 'none'"
    ),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}
# over viser's own panel until ours are there (bridge.js); where they never come, it goes by itself
LOADING = b"""<title>Pgraph</title>
<style>
#pgraph-loading { position: fixed; inset: 0; z-index: 9999; pointer-events: none;
  display: grid; place-content: center; justify-items: center; gap: 16px;
  background: #eef1f5; color: #2f5be7; font: 500 13px system-ui, sans-serif;
  transition: opacity .2s; animation: pgraph-gone 0s 30s forwards; }
#pgraph-loading span { color: #48515f; }
#pgraph-loading.dark { background: #0e1116; color: #7fa3ff; }
#pgraph-loading.dark span { color: #b3bcc9; }
#pgraph-loading.over { opacity: 0; }
#pgraph-loading i { width: 96px; height: 3px; border-radius: 4px; background: #7f9bd940; }
#pgraph-loading i::after { content: ""; display: block; width: 40%; height: 100%;
  border-radius: 4px; background: currentColor;
  animation: pgraph-wait 1.1s ease-in-out infinite alternate; }
@keyframes pgraph-wait { from { margin-left: 0; } to { margin-left: 60%; } }
@keyframes pgraph-gone { to { visibility: hidden; } }
</style>"""
LOADING_BODY = b"""<body><div id="pgraph-loading" role="status"><span>Pgraph</span><i></i></div>
<script>{
  let dark = matchMedia("(prefers-color-scheme: dark)").matches;
  try { dark = JSON.parse(localStorage.getItem("pgraph choices"))?.dark ?? dark; } catch { }
  document.getElementById("pgraph-loading").classList.toggle("dark", dark);
}</script>"""
log = logging.getLogger(__name__)


def token_for(host: str, wanted: str = "auto") -> str | None:
    """Return the token for the address. "auto" omits it if only this machine can connect."""
    on = wanted == "on" or (wanted == "auto" and host not in LOOPBACK)
    return secrets.token_urlsafe(16) if on else None


@contextlib.contextmanager
def guarded(host: str, token: str | None) -> Iterator[None]:
    """Make a viser server created in this context check requests and messages in its `serve`."""
    module = websockets.asyncio.server
    plain = module.serve
    pages: dict[bytes, bytes] = {}  # viser's pages and our versions of them
    connected: set[_Bounded] = set()

    def serve(handler: Callable[[Any], Any], at: str, port: int, **options: Any) -> Any:
        page = options.pop("process_request")

        def process_request(connection: Any, request: Any) -> Response | None:
            refused = refusal(request.headers, request.path, host, token)
            if refused is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, refused + "\n")
            try:
                response = page(connection, request)
            except (OSError, ValueError):  # a path that no file has: too long, or with a NUL
                response = connection.respond(http.HTTPStatus.NOT_FOUND, "Page not found.\n")
            if response is not None:
                ours(response, pages)
                for name, value in HEADERS.items():
                    response.headers[name] = value
                if token is not None:
                    name = cookie_for(request.headers["Host"])
                    response.headers["Set-Cookie"] = f"{name}={token}; HttpOnly; SameSite=Strict"
            return response

        options["max_size"] = LARGEST_MESSAGE
        inside = lambda connection: handler(_Filtered(connection))  # noqa: E731
        options["create_connection"] = functools.partial(_Bounded, connected)
        return plain(inside, at, port, process_request=process_request, **options)

    module.serve = serve  # type: ignore[assignment]
    try:
        yield
    finally:
        module.serve = plain


def ours(response: Response, known: dict[bytes, bytes]) -> None:
    """Turn viser's page into ours with a loading screen, cached in `known`."""
    if not response.headers.get("Content-Type", "").startswith("text/html"):
        return
    body = bytes(response.body)
    if body not in known:
        packed = response.headers["Content-Encoding"] == "gzip"
        page = gzip.decompress(body) if packed else body
        page = page.replace(b"<title>Viser</title>", LOADING, 1)
        page = page.replace(b"<body>", LOADING_BODY, 1)
        known[body] = gzip.compress(page) if packed else page
    response.body = known[body]
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))


def cookie_for(named: str) -> str:
    """Return the name of the cookie for the requested `Host`. Raises ValueError."""
    return f"{COOKIE}_{urlsplit(f'//{named}').port or 80}"


def refusal(headers: Any, path: str, host: str, token: str | None) -> str | None:
    """Return why a request is rejected: another site's page, a foreign host, no token."""
    try:
        named, origin = headers.get("Host", ""), headers.get("Origin")
        if host in LOOPBACK and urlsplit(f"//{named}").hostname not in LOOPBACK:
            return f"This server answers on 127.0.0.1 and localhost, not as {named!r}."
        if origin is not None and urlsplit(origin).netloc != named:
            return f"Pages of {origin} may not connect."
        mine = cookie_for(named)
    except (ValueError, LookupError):  # LookupError: two Host headers
        return "The host of the request is not valid."
    if token is None:
        return None
    cookies = (cookie.partition("=") for cookie in headers.get("Cookie", "").split("; "))
    given = [value for name, _, value in cookies if name == mine]
    given += parse_qs(urlsplit(path).query).get("token", [])
    if any(secrets.compare_digest(one.encode(errors="replace"), token.encode()) for one in given):
        return None
    return "Open the address that the server printed: it carries a token."


class _Bounded(websockets.asyncio.server.ServerConnection):
    """A connection that is closed if it exceeds the rate limit or if there are too many
    connections.

    The library counts whole messages only: a flood of pings or of empty parts of a message would
    take the time of all others, and memory.
    """

    def __init__(self, connected: set[_Bounded], *args: Any, **options: Any):
        super().__init__(*args, **options)
        self._connected, self._extra = connected, Budget(*EXTRA)

    def connection_made(self, transport: Any) -> None:
        transport.max_size = READ_AT_ONCE  # asyncio's attribute, 256 kB by default
        super().connection_made(transport)
        self._connected.add(self)
        if len(self._connected) > MOST_CONNECTIONS:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._connected.discard(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if not self.transport.is_closing():  # nothing is answered on a connection that is cut
            super().data_received(data)

    def process_event(self, event: Any) -> None:
        whole = getattr(event, "fin", True) and getattr(event, "opcode", None) not in CONTROL
        if whole or self._extra.spend(1.0) == 0:
            super().process_event(event)
        elif not self.transport.is_closing():
            if CUT.spend(1.0) == 0:
                log.warning("a connection sent too many pings or parts of messages: cut")
            self.transport.abort()


class _Filtered:
    """A connection whose `recv` returns only allowed messages, rate-limited by its budget."""

    def __init__(self, connection: Any):
        self._connection = connection
        self._budgets = Budget(*MESSAGES), Budget(*BYTES)
        self._dropped = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self) -> bytes:
        messages, size = self._budgets
        while True:
            raw = await self._connection.recv()
            wait = max(messages.spend(1.0), size.spend(float(len(raw))))
            if wait > 0:  # not read meanwhile: TCP slows the page down, others feel nothing
                await asyncio.sleep(wait)
            reason = faults(raw)
            if reason is None:
                return raw
            self._dropped += 1
            if self._dropped == 1:  # one line a connection: a flood must not fill the log
                log.warning("ignored an invalid message from a page (%s)", reason)


class Budget:
    """A rate limit per second, with bursts up to `most`."""

    def __init__(self, rate: float, most: float):
        self._rate, self._most = rate, most
        self._left, self._at = most, time.monotonic()

    def spend(self, amount: float) -> float:
        """Return the time to wait [s] until `amount` more fits into the budget."""
        now = time.monotonic()
        self._left = min(self._most, self._left + (now - self._at) * self._rate) - amount
        self._at = now
        return max(-self._left / self._rate, 0.0)


CUT = Budget(0.1, 5.0)  # lines of the log on connections that are cut


def faults(raw: bytes | str) -> str | None:
    """Return the reason why a message is rejected, or None if it is allowed."""
    if isinstance(raw, str):
        return "text"
    try:
        if _crowded(raw):
            return "too many values"
        message = msgspec.msgpack.decode(raw)
    except (msgspec.DecodeError, ValueError, RecursionError):
        return "no message"
    if not isinstance(message, dict) or message.get("type") not in PASS:
        kind = message.get("type") if isinstance(message, dict) else type(message)
        return f"a {str(kind)[:60]}"
    kind, fields = _kinds()[message.pop("type")]
    try:
        if not message.keys() <= fields:
            return f"a {kind.__name__} with fields that it does not have"
        msgspec.convert(message, kind)
    except msgspec.ValidationError as error:
        return f"a {kind.__name__} of other types: {str(error)[:100]}"
    if kind.__name__ == "GuiUpdateMessage":
        updates = message.get("updates")
        if not isinstance(updates, dict) or list(updates) != ["value"]:
            return "a change of what is no value"
        message["updates"] = None if isinstance(updates["value"], str) else updates["value"]
    plain = all(_plain(value, 3) for value in message.values())
    return None if plain else f"a {kind.__name__} with values that are not plain"


def _crowded(raw: bytes | msgspec.Raw, levels: int = 2) -> bool:
    """Return True for a large message, unless its size is due to text or bytes in its fields.

    The message is not decoded, since decoding 16 MB of small numbers would block all other
    connections for seconds.
    """
    first = memoryview(raw)[0] if raw else 0
    text = 0xC4 <= first <= 0xC6 or 0xD9 <= first <= 0xDB
    if len(raw) <= LARGEST_LISTS or text:
        return False
    if levels == 0 or first >> 4 != 0x8:  # no dictionary of at most 15 fields
        return True
    fields = msgspec.msgpack.decode(raw, type=dict[str, msgspec.Raw])
    return any(_crowded(value, levels - 1) for value in fields.values())


@functools.cache
def _kinds() -> dict[str, tuple[Any, set[str]]]:
    """Return viser's allowed message classes, with the fields that a page may set."""
    classes = [getattr(viser._messages, name) for name in PASS]
    ours = {"excluded_self_client"}  # the server says whom a message does not go to
    return {c.__name__: (c, {f.name for f in dataclasses.fields(c)} - ours) for c in classes}


def _plain(value: Any, depth: int) -> bool:
    """Return True for a finite number, a short text, or a short list of these."""
    if isinstance(value, (list, tuple)):
        return (
            depth > 0
            and len(value) <= MOST_NUMBERS
            and all(_plain(one, depth - 1) for one in value)
        )
    if isinstance(value, str):
        return len(value) <= LONGEST_TEXT
    if isinstance(value, (int, float)):
        return math.isfinite(value)
    return value is None
