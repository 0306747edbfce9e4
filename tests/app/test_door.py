"""Access to the page, and the filter for messages to viser and the model."""

import contextlib
import gc
import gzip
import http.client
import multiprocessing
import socket
import tracemalloc
import types
from typing import Any

import msgspec
import pytest
import viser._messages
import websockets.asyncio.server
import websockets.exceptions
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

import pgraph_core as pg
from pgraph_app.core import door
from pgraph_app.core.store import MOST_AHEAD, MOST_WAITING, Closed, Queue
from pgraph_app.server import GONE, serve

from .store import LIMIT, do, until

VISER: Any = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def server():
    made = serve(pg.Model.serial(3), port=0, open_browser=False)
    yield made
    made.stop()


def answer(server, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=LIMIT)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    return response.status, response.headers, response.read()


def status(server, **headers):
    return answer(server, **headers)[0]


def socket_of(server):
    return connect(f"ws://127.0.0.1:{server.port}", subprotocols=[VISER])


def test_our_own_pages_may_connect(server):
    own = f"127.0.0.1:{server.port}"
    assert status(server, Host=own) == 200
    assert status(server, Host=f"localhost:{server.port}") == 200
    assert status(server, Host=own, Origin=f"http://{own}") == 200


@pytest.mark.parametrize("coding", ["identity", "gzip"])
def test_the_page_says_that_it_is_loading_however_it_is_sent(server, coding):
    for _ in range(2):  # made, and as it was kept
        _, headers, body = answer(server, **{"Accept-Encoding": coding})
        assert int(headers["Content-Length"]) == len(body)
        page = (gzip.decompress(body) if coding == "gzip" else body).decode()
        assert page.count('id="pgraph-loading"') == 1
        assert "<title>Viser" not in page
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert headers["X-Frame-Options"] == "DENY"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"


@pytest.mark.parametrize(
    ("headers", "named"),
    [
        ({"Host": "evil.example:80"}, "evil.example"),
        ({"Origin": "http://evil.example"}, "http://evil.example"),
        ({"Origin": "null"}, "null"),
        ({"Host": "["}, ""),
        ({"Host": "127.0.0.1", "Origin": "http://["}, ""),
    ],
)
def test_another_site_s_page_may_not_connect(server, headers, named):
    code, _, text = answer(server, **headers)
    assert code == 403
    assert named in text.decode()
    with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{server.port}", origin="http://evil.example")
    assert refused.value.response.status_code == 403


def test_on_other_hosts_the_address_carries_a_token():
    def refused(headers, path, token):
        return door.refusal(headers, path, "0.0.0.0", token)

    headers = {"Host": "192.0.2.1:8080"}
    assert door.token_for("127.0.0.1") is None
    token = door.token_for("0.0.0.0")
    assert refused(headers, "/", token) is not None
    assert refused(headers, "/?token=wrong", token) is not None
    assert refused(headers, f"/?token={token}", token) is None
    assert refused({**headers, "Cookie": f"pgraph_token_8080={token}"}, "/", token) is None
    foreign = {**headers, "Origin": "http://evil.example", "Cookie": f"pgraph_token_8080={token}"}
    assert refused(foreign, "/", token) is not None


def test_a_message_above_the_limit_closes_the_connection(server):
    with socket_of(server) as page:
        page.send(b"x" * (door.LARGEST_MESSAGE + 1))
        with pytest.raises(websockets.exceptions.ConnectionClosedError):
            list(iter(page.recv, None))


def raw_socket(server):
    """Return a websocket that sends given frames."""
    made = socket.create_connection(("127.0.0.1", server.port), timeout=LIMIT)
    heads = {
        "Host": f"127.0.0.1:{server.port}", "Upgrade": "websocket", "Connection": "Upgrade",
        "Sec-WebSocket-Key": "x" * 22 + "==", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Protocol": VISER,
    }  # fmt: skip
    lines = ["GET / HTTP/1.1", *(f"{name}: {value}" for name, value in heads.items())]
    made.sendall("\r\n".join([*lines, "", ""]).encode())
    assert made.recv(12).endswith(b"101")
    return made


NO_MASK = bytes(4)
FLOODS = {
    "empty parts of a message": (b"\x02\x80" + NO_MASK, b"\x00\x80" + NO_MASK),
    "parts of one byte": (b"\x02\x80" + NO_MASK, b"\x00\x81" + NO_MASK + b"a"),
    "pings": (b"", b"\x89\x80" + NO_MASK),
    "pings with content": (b"", b"\x89\xfd" + NO_MASK + b"x" * 125),
    "pongs": (b"", b"\x8a\x80" + NO_MASK),
}


@pytest.mark.parametrize("flood", FLOODS)
def test_a_connection_that_sends_what_no_browser_sends_is_cut(server, flood):
    """An edit of another is answered meanwhile."""
    first, again = FLOODS[flood]
    with raw_socket(server) as hostile:
        hostile.sendall(first)
        with contextlib.suppress(OSError):  # reset, or a broken pipe
            for _ in range(10_000):
                hostile.sendall(again * 100)
            pytest.fail("it is still read")
    mass = server.store.state.model.body("2").mass + 1
    server.send(do.EditBodies(-1, 1, ("2",), "mass", (((), str(mass)),)))
    until(lambda: server.store.state.model.body("2").mass == mass, "an edit of another")
    assert status(server) == 200


def _request(port):
    made = http.client.HTTPConnection("127.0.0.1", port, timeout=LIMIT)
    made.request("GET", "/")
    made.getresponse().read()
    made.close()


def _connection(port):
    socket.create_connection(("127.0.0.1", port)).close()


def _half_a_request(port):
    with socket.create_connection(("127.0.0.1", port)) as made:
        made.sendall(b"GET / HTTP/1.1\r\nX: " + b"a" * 8000)


def _page(port, *messages):
    with connect(f"ws://127.0.0.1:{port}", subprotocols=[VISER], max_size=None) as page:
        for message in messages:
            page.send(message)


def change(value):
    return msgspec.msgpack.encode(
        {"type": "GuiUpdateMessage", "uuid": "none", "updates": {"value": value}}
    )


CROWD = [[[[1] * 64] * 64] * 64] * 50  # 13 MB
FULL_SPEED: Any = {
    "requests": _request,
    "connections": _connection,
    "halves of requests": _half_a_request,
    "pages that open": _page,
    "messages that are none": lambda port: _page(port, *[b"\xc1" * 20] * 1_000),
    "messages of 15 MB": lambda port: _page(port, *[b"\x81" * 15_000_000] * 10),
    "changes of no cell": lambda port: _page(port, *[change(1)] * 1_000),
    "lists of many numbers": lambda port: _page(port, *[change(CROWD)] * 10),
}


def _flood(port, wanted, made):
    floods = list(FULL_SPEED.values())
    while True:
        made.value = wanted.value
        with contextlib.suppress(OSError, http.client.HTTPException, WebSocketException):
            floods[made.value](port)


def test_an_edit_is_answered_while_a_client_in_another_process_floods(server):
    """All edits and requests of others are answered while any flood goes on."""
    processes = multiprocessing.get_context("spawn")
    wanted, made = processes.Value("i", 0), processes.Value("i", -1)
    hostile = processes.Process(target=_flood, args=(server.port, wanted, made), daemon=True)
    hostile.start()
    try:
        for number, kind in enumerate(FULL_SPEED):
            wanted.value = number
            until(lambda number=number: made.value == number, f"a flood of {kind}")
            for _ in range(3):
                mass = server.store.state.model.body("2").mass + 1
                server.send(do.EditBodies(-1, 1, ("2",), "mass", (((), str(mass)),)))
                until(lambda m=mass: server.store.state.model.body("2").mass == m, f"edit: {kind}")
                assert status(server) == 200, kind
        assert hostile.is_alive()
    finally:
        hostile.kill()
        hostile.join()


@pytest.mark.parametrize("inside", [0, 1, 2, 9])
def test_a_message_of_many_numbers_is_refused_before_it_is_decoded(inside):
    """Decoded, 13 million numbers would take ten times the memory of the message."""
    value: Any = [1] * 13_000_000
    for _ in range(inside):
        value = {"updates": value, "type": "GuiUpdateMessage"}
    message = msgspec.msgpack.encode(value)
    tracemalloc.start()
    assert door.faults(message) is not None
    assert tracemalloc.get_traced_memory()[1] < 2 * len(message)
    tracemalloc.stop()
    assert door.faults(change("x" * 1_000_000)) is None


def test_connections_are_limited_and_those_that_go_make_room(server):
    most = door.MOST_CONNECTIONS
    held = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(most + 20)]
    with pytest.raises((OSError, http.client.HTTPException)):
        answer(server)
    for one in held:
        one.close()

    def answers():
        try:
            return status(server) == 200
        except (OSError, http.client.HTTPException):
            return False

    until(answers, "room for a page")


def test_a_large_message_in_parts_as_browsers_send_it_passes(server):
    with raw_socket(server) as page:
        part = b"\xfe" + len(b"x" * 60_000).to_bytes(2, "big") + NO_MASK + b"x" * 60_000
        for k in range(250):  # 15 MB
            page.sendall((b"\x02" if k == 0 else b"\x80" if k == 249 else b"\x00") + part)
        page.sendall(b"\x89\x81" + NO_MASK + b"?")
        page.settimeout(LIMIT)
        until(lambda: b"\x8a\x01?" in page.recv(1 << 20), "the answer to a ping")


@pytest.fixture
def locked():
    """Two servers on one machine that open with a token."""
    servers = [serve(pg.Model.serial(2), port=0, open_browser=False, token="on") for _ in range(2)]
    yield servers
    for server in servers:
        server.stop()


def test_with_a_token_only_the_printed_address_and_its_cookie_open_the_page(locked):
    """A browser sends the cookies of all ports of a host, so each server has its own."""
    jar = []
    for server in locked:
        assert status(server) == 403
        code, headers, _ = answer(server, "/" + server.url.split("/")[-1])
        jar.append(headers["Set-Cookie"].split(";")[0])
        assert code == 200
        assert server.url.partition("?token=")[2] in jar[-1]
    assert len({cookie.partition("=")[0] for cookie in jar}) == 2
    for server in locked:
        assert status(server, Cookie="; ".join(jar)) == 200
    first, cookie = locked[0], jar[0]
    assert status(first, Cookie=f"a=b; {cookie}") == 200
    assert status(first, Cookie=f"{cookie}x") == 403
    assert status(first, Host="evil.example", Cookie=cookie) == 403
    assert status(first, Cookie=f"pgraph_token_{first.port}=\xff") == 403


@pytest.mark.parametrize("path", ["/a" * 4000, "/" + "a" * 300, "/%00", "/none"])
def test_a_page_that_is_not_there_is_not_found(server, path):
    assert answer(server, path)[0] == 404


def message(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


CAMERA = {
    "wxyz": (1, 0, 0, 0), "position": (0, 0, 0), "fov": 1, "near": 0.01, "far": 1000,
    "look_at": (0, 0, 0), "up_direction": (0, 0, 1), "image_height": 400, "image_width": 600,
}  # fmt: skip
DROPPED = {
    "a public tunnel": message("ShareUrlRequest"),
    "a form's state": message("GuiFormDirtyMessage", uuid="x" * 10_000),
    "a value and more": message("GuiUpdateMessage", uuid="a", updates={"value": "", "visible": 1}),
    "a long identifier": message("GuiUpdateMessage", uuid="a" * 10_000, updates={"value": "1"}),
    "no number": message("ViewerCameraMessage", **{**CAMERA, "fov": float("nan")}),
    "a long list": message("ViewerCameraMessage", **{**CAMERA, "position": [0] * 100_000}),
    "a field too few": message("TransformControlsDragEndMessage", owner="a"),
    "a field of the server": message("ViewerCameraMessage", **CAMERA, excluded_self_client=1),
    "a message of the server": message("RunJavascriptMessage", source="alert(1)"),
    "no kind": message(""),
    "junk": b"\xc1\xff\x00",
    "nothing": b"",
    "text": "text",
}


@pytest.mark.parametrize("what", DROPPED)
def test_foreign_messages_are_dropped(what):
    assert door.faults(DROPPED[what]) is not None


def test_messages_of_the_page_pass():
    assert door.faults(message("ViewerCameraMessage", **CAMERA)) is None
    typed = "x" * 1_000_000  # a pasted table
    assert door.faults(message("GuiUpdateMessage", uuid="a", updates={"value": typed})) is None
    kinds = viser._messages.Message._subclass_from_type_string()
    assert set(door.PASS) <= set(kinds)


def test_junk_harms_nobody_and_the_connection_goes_on(server):
    with socket_of(server) as page:
        for junk in DROPPED.values():
            page.send(junk)
        assert page.ping().wait(LIMIT)
    server.send(do.EditBodies(-1, 1, ("2",), "mass", (((), "7"),)))
    until(lambda: server.store.state.model.body("2").mass == 7.0, "an edit of another")


def event(client, number=0):
    return do.Select(client, str(number))


def taken(queue, n=10**6):
    found = []
    while len(found) < n and (event := queue.get(0.0)) is not None:
        found.append(event)
    return found


def test_a_budget_lets_bursts_pass_and_then_its_rate(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(door, "time", types.SimpleNamespace(monotonic=lambda: now[0]))
    budget = door.Budget(rate=100.0, most=50.0)
    waits = [budget.spend(1.0) for _ in range(60)]
    assert waits[:50] == [0.0] * 50
    assert waits[50:] == pytest.approx([k / 100 for k in range(1, 11)])
    now[0] = 10.0
    assert budget.spend(50.0) == 0.0


def test_events_of_many_senders_are_taken_in_turn_and_each_one_s_in_order():
    queue = Queue()
    mine = [event(1, k) for k in range(3)]
    for one in (*mine, event(2), do.Tick(0.1), event(2)):
        queue.put(one)
    found = taken(queue)
    senders = [getattr(one, "client", None) for one in found]
    assert senders == [1, 2, 1, 2, 1, None]  # what people do passes what the server sends itself
    assert [one for one in found if one in mine] == mine
    queue.close()
    with pytest.raises(Closed):
        queue.get(0.0)


def test_waiting_and_overtaking_events_are_bounded():
    queue = Queue()
    queue.put(do.Tick(0.1))
    for number in range(MOST_WAITING + 100):
        queue.put(event(1, number))
    assert isinstance(taken(queue, MOST_AHEAD + 1)[-1], do.Tick)
    queue.put(event(2))
    found = taken(queue)
    assert len(found) == MOST_WAITING - MOST_AHEAD + 1
    assert {one.client for one in found[:2]} == {1, 2}


def test_what_waits_of_a_page_that_has_gone_is_dropped():
    """Nobody waits for it. What was begun before is done, and its edits are counted."""
    queue = Queue()
    edit = do.EditBodies(1, 1, ("2",), "mass", (((), "7"),))
    for one in (edit, event(1), event(2), edit, edit, do.Tick(0.1), event(2)):
        queue.put(one)
    assert taken(queue, 1) == [edit]
    queue.put(do.Disconnected(1))
    assert taken(queue) == [event(2), do.Disconnected(1, lost=2), event(2), do.Tick(0.1)]


def test_memory_of_closed_pages_is_released(server):
    """Their connections are cycles of a few large objects, which Python alone would let lie."""
    gc.disable()
    try:
        for _ in range(3 * GONE):
            with socket_of(server) as page:
                page.send(message("ViewerCameraMessage", **CAMERA))
                page.recv()
        until(lambda: _connections() < 2 * GONE, "the end of connections that are gone")
    finally:
        gc.enable()


def _connections() -> int:
    return sum(
        isinstance(one, websockets.asyncio.server.ServerConnection) for one in gc.get_objects()
    )
