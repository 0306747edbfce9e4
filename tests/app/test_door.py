"""Who may connect to the page, and what of a page's messages reaches viser and the model."""

from __future__ import annotations

import gc
import gzip
import http.client
import time
from typing import Any

import msgspec
import pytest
import viser._messages
import websockets.asyncio.server
import websockets.exceptions
from websockets.sync.client import connect

from pgraph_app.core import door
from pgraph_app.core.events import FromPage
from pgraph_app.core.store import MOST_AHEAD, MOST_WAITING, Closed, Queue
from pgraph_app.model.update import Edit
from pgraph_app.playback.update import Tick
from pgraph_app.server import GONE, Server, serve

from .conftest import NOBODY, until

VISER: Any = f"viser-v{viser.__version__}"


def answer(server: Server, **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request("GET", "/", headers=headers)
    response = connection.getresponse()
    return response.status, response.read(300).decode("utf-8", "replace")


def test_our_own_pages_may_connect(served):
    own = f"127.0.0.1:{served.port}"
    assert answer(served, Host=own)[0] == 200
    assert answer(served, Host=f"localhost:{served.port}")[0] == 200
    assert answer(served, Host=own, Origin=f"http://{own}")[0] == 200


@pytest.mark.parametrize("coding", ["identity", "gzip"])
def test_the_page_says_that_it_is_loading_however_it_is_sent(served, coding):
    for _ in range(2):  # made, and as it was kept
        connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=10)
        connection.request("GET", "/", headers={"Accept-Encoding": coding})
        response = connection.getresponse()
        body = response.read()
        assert int(response.headers["Content-Length"]) == len(body)
        page = (gzip.decompress(body) if coding == "gzip" else body).decode()
        assert page.count('id="pgraph-loading"') == 1
        assert "<title>Viser" not in page


@pytest.mark.parametrize(
    ("headers", "said"),
    [
        ({"Host": "evil.example:80"}, "evil.example"),
        ({"Origin": "http://evil.example"}, "http://evil.example may not connect"),
        ({"Origin": "null"}, "may not connect"),
    ],
)
def test_another_site_s_page_may_not(served, headers, said):
    status, text = answer(served, **headers)
    assert status == 403
    assert said in text


def test_nor_open_a_websocket(served):
    with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{served.port}", origin="http://evil.example")  # type: ignore[arg-type]
    assert refused.value.response.status_code == 403


def test_on_other_hosts_the_address_carries_a_token():
    def refused(headers, path, token):
        return door.refusal(headers, path, "0.0.0.0", token)

    headers = {"Host": "192.0.2.1:8080"}
    assert door.token_for("127.0.0.1") is None
    token = door.token_for("0.0.0.0")
    assert token is not None
    assert refused(headers, "/", token) is not None
    assert refused(headers, "/?token=wrong", token) is not None
    assert refused(headers, f"/?token={token}", token) is None
    assert refused({**headers, "Cookie": f"pgraph_token_8080={token}"}, "/", token) is None
    foreign = {**headers, "Origin": "http://evil.example", "Cookie": f"pgraph_token_8080={token}"}
    assert refused(foreign, "/", token) is not None


def test_serve_is_wrapped_only_while_a_server_is_made():
    plain = websockets.asyncio.server.serve
    with door.guarded("127.0.0.1", None):
        assert websockets.asyncio.server.serve is not plain
    assert websockets.asyncio.server.serve is plain


def test_a_message_above_the_limit_closes_the_connection(served):
    with connect(f"ws://127.0.0.1:{served.port}", subprotocols=["viser-v1.1.1"]) as socket:  # type: ignore[list-item]
        socket.send(b"x" * (door.LARGEST_MESSAGE + 1))
        with pytest.raises(websockets.exceptions.ConnectionClosedError):
            list(iter(socket.recv, None))


@pytest.mark.parametrize("headers", [{"Host": "["}, {"Host": "127.0.0.1", "Origin": "http://["}])
def test_a_host_that_cannot_be_read_is_refused(served, headers):
    assert answer(served, **headers)[0] == 403


def test_with_a_token_only_the_printed_address_and_its_cookie_open_the_page(quadruped):
    server = serve(quadruped, port=0, open_browser=False, token="on")
    try:
        assert answer(server)[0] == 403
        path, query = server.url.split("/")[-1], server.url.partition("?token=")[2]
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
        connection.request("GET", f"/{path}")
        response = connection.getresponse()
        cookie = response.headers["Set-Cookie"].split(";")[0]
        assert (response.status, query in cookie) == (200, True)
        assert answer(server, Cookie=f"a=b; {cookie}")[0] == 200
        assert answer(server, Cookie=f"{cookie}x")[0] == 403
        assert answer(server, Host="evil.example", Cookie=cookie)[0] == 403
    finally:
        server.stop()


def test_two_servers_of_one_machine_keep_two_cookies(quadruped):
    """A browser sends the cookies of all ports of a host."""
    servers = [serve(quadruped, port=0, open_browser=False, token="on") for _ in range(2)]
    try:
        jar = {}
        for server in servers:
            connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
            connection.request("GET", "/" + server.url.split("/")[-1])
            cookie = connection.getresponse().headers["Set-Cookie"].split(";")[0]
            name, _, value = cookie.partition("=")
            jar[name] = value
        assert len(jar) == 2
        sent = "; ".join(f"{name}={value}" for name, value in jar.items())
        assert [answer(server, Cookie=sent)[0] for server in servers] == [200, 200]
        assert answer(servers[0], Cookie="pgraph_token_\xff=\xff")[0] == 403
        mine = f"pgraph_token_{servers[0].port}"
        assert answer(servers[0], Cookie=f"{mine}=\xff")[0] == 403
    finally:
        for server in servers:
            server.stop()


@pytest.mark.parametrize("path", ["/a" * 4000, "/" + "a" * 300, "/%00", "/none"])
def test_a_page_that_is_not_there_is_not_found(served, path):
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=10)
    connection.request("GET", path)
    assert connection.getresponse().status == 404


def test_no_other_site_can_frame_the_page(served):
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=10)
    connection.request("GET", "/")
    headers = connection.getresponse().headers
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"


def message(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


CAMERA = {
    "wxyz": (1, 0, 0, 0), "position": (0, 0, 0), "fov": 1, "near": 0.01, "far": 1000,
    "look_at": (0, 0, 0), "up_direction": (0, 0, 1), "image_height": 400, "image_width": 600,
}  # fmt: skip
DROPPED = {
    "a public tunnel": message("ShareUrlRequest"),
    "a form's state": message("GuiFormDirtyMessage", uuid="x" * 10_000),
    "an upload": message("FileTransferStartUpload", size_bytes=10**9),
    "a handle's callbacks": message("GuiUpdateMessage", uuid="a", updates={"update_cb": 1}),
    "a value and more": message("GuiUpdateMessage", uuid="a", updates={"value": "", "visible": 1}),
    "a nested value": message("GuiUpdateMessage", uuid="a", updates={"value": {"a": 1}}),
    "a long identifier": message("GuiUpdateMessage", uuid="a" * 10_000, updates={"value": "1"}),
    "no number": message("ViewerCameraMessage", **{**CAMERA, "fov": float("nan")}),
    "a long list": message("ViewerCameraMessage", **{**CAMERA, "position": [0] * 100_000}),
    "a number for a list": message("ViewerCameraMessage", **{**CAMERA, "wxyz": 1.0}),
    "three numbers for four": message("ViewerCameraMessage", **{**CAMERA, "wxyz": (1, 0, 0)}),
    "a field too few": message("TransformControlsDragEndMessage", owner="a"),
    "a field of the server": message("ViewerCameraMessage", **CAMERA, excluded_self_client=1),
    "a list for a name": message("GuiUpdateMessage", uuid=[], updates={"value": "1"}),
    "a message of the server": message("RunJavascriptMessage", source="alert(1)"),
    "no kind": message(""),
    "no map": msgspec.msgpack.encode([1, 2]),
    "junk": b"\xc1\xff\x00",
    "nothing": b"",
    "text": "text",
}


@pytest.mark.parametrize("what", DROPPED)
def test_what_no_page_of_ours_sends_is_dropped(what):
    assert door.faults(DROPPED[what]) is not None


def test_what_the_page_sends_passes():
    assert door.faults(message("ViewerCameraMessage", **CAMERA)) is None
    assert door.faults(message("CommandTriggerMessage", uuid="a")) is None
    typed = "x" * 1_000_000  # a pasted table
    assert door.faults(message("GuiUpdateMessage", uuid="a", updates={"value": typed})) is None


def test_the_kinds_that_pass_are_messages_of_viser():
    kinds = viser._messages.Message._subclass_from_type_string()
    assert set(door.PASS) <= set(kinds)


def test_junk_harms_nobody_and_the_connection_goes_on(served):
    with connect(f"ws://127.0.0.1:{served.port}", subprotocols=[VISER]) as socket:
        for junk in DROPPED.values():
            socket.send(junk)
        assert socket.ping().wait(10)
    served.send(Edit(NOBODY, 1, "pelvis", "mass", (), "7"))
    until(lambda: served.store.state.model.body("pelvis").mass == 7.0, "an edit of another")


def test_a_budget_lets_bursts_pass_and_then_its_rate(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    budget = door.Budget(rate=100.0, most=50.0)
    waits = [budget.spend(1.0) for _ in range(60)]
    assert waits[:50] == [0.0] * 50
    assert waits[50:] == pytest.approx([k / 100 for k in range(1, 11)])
    now[0] = 10.0
    assert budget.spend(50.0) == 0.0


class Told(FromPage):
    pass


def test_events_of_many_senders_are_taken_in_turn_and_each_one_s_in_order():
    queue = Queue()
    for serial in range(3):
        queue.put(Told(1, seen=serial))
    queue.put(Told(2, seen=0))
    queue.put(Tick(0.1))
    queue.put(Told(2, seen=1))
    taken = [queue.get(0.0) for _ in range(6)]
    senders = [getattr(event, "client", None) for event in taken]
    assert senders == [1, 2, 1, 2, 1, None]  # what people do passes what the server sends itself
    assert [e.seen for e in taken if isinstance(e, Told) and e.client == 1] == [0, 1, 2]
    assert queue.get(0.0) is None
    queue.close()
    with pytest.raises(Closed):
        queue.get(0.0)


def test_people_pass_the_server_a_bounded_number_of_times():
    queue = Queue()
    queue.put(Tick(0.1))
    for serial in range(3 * MOST_AHEAD):
        queue.put(Told(1, seen=serial))
    taken = [queue.get(0.0) for _ in range(MOST_AHEAD + 1)]
    assert isinstance(taken[-1], Tick)


def test_what_one_sender_leaves_waiting_is_bounded():
    queue = Queue()
    for serial in range(MOST_WAITING + 100):
        queue.put(Told(1, seen=serial))
    queue.put(Told(2))
    taken = []
    while (event := queue.get(0.0)) is not None:
        taken.append(event)
    assert len(taken) == MOST_WAITING + 1
    assert [getattr(event, "client", 0) for event in taken[:2]] == [1, 2]


def test_what_pages_that_left_held_is_given_back(served):
    """Their connections are cycles of a few large objects, which Python alone would let lie."""
    gc.disable()
    try:
        for _ in range(GONE + 1):
            with connect(f"ws://127.0.0.1:{served.port}", subprotocols=[VISER]) as socket:
                socket.send(message("ViewerCameraMessage", **CAMERA))
                socket.recv()
        until(lambda: _connections() < GONE // 2, "the end of connections that are gone")
    finally:
        gc.enable()


def _connections() -> int:
    return sum(type(one) is websockets.asyncio.server.ServerConnection for one in gc.get_objects())
