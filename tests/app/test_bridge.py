"""One test for each name of viser's that it does not document, and for who may connect."""

from __future__ import annotations

import http.client
import json
from typing import Any

import pytest
import viser
import websockets.asyncio.server
import websockets.exceptions
from websockets.sync.client import connect

from pgraph_app.core import bridge
from pgraph_app.model.update import Edit
from pgraph_app.server import Server
from pgraph_app.session.update import Select

from .conftest import NOBODY, ON_PURPOSE, until


def answer(server: Server, **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request("GET", "/", headers=headers)
    response = connection.getresponse()
    return response.status, response.read(300).decode("utf-8", "replace")


def test_viser_is_the_version_whose_names_these_are():
    assert viser.__version__ == "1.1.1"


def test_run_javascript_message_runs_on_the_client_s_own_connection(page, served):
    client = max(served.viser.get_clients())
    handle = served.viser.get_clients()[client]
    message = bridge.RunJavascriptMessage(source="window.ranByTest = 41 + 1")
    handle._websock_connection.queue_message(message)
    until(lambda: page.evaluate("window.ranByTest") == 42, "the script to run")


def test_the_static_script_is_replayed_to_pages_that_come_late(open_page):
    late = open_page()
    assert late.evaluate("typeof window.pgraph.receive") == "function"
    late.close()


def test_viser_mutable_sends_and_a_burst_arrives_complete_and_in_order(page, served):
    arrived: list[Any] = []
    plain, served.store._update = served.store._update, lambda s, e: (arrived.append(e), s)[1]
    try:
        page.evaluate("for (let k = 0; k < 100; k++) pgraph.send('Scrub', { time: k })")
        until(lambda: len(arrived) >= 100, "100 events")
    finally:
        served.store._update = plain
    times = [event.time for event in arrived if hasattr(event, "time")]
    assert times == [float(k) for k in range(100)]


def test_the_image_s_error_handler_mounts_a_host_that_viser_draws_again(page):
    page.evaluate("""() => {
      const host = document.querySelector('.pgraph[data-view="table"]');
      const parent = host.parentElement, html = parent.innerHTML;
      parent.innerHTML = '<div class="pgraph" data-view="table"></div>'
        + '<img hidden src="data:," onerror="window.pgraph && pgraph.mount()">';
    }""")
    page.wait_for_selector("table.bodies tr[data-name=pelvis]")


def test_topics_that_come_before_the_script_wait_in_the_inbox(page):
    page.evaluate("""() => {
      const known = window.pgraph; window.pgraph = undefined;
      (window.pgraphInbox ??= []).push(['early', 7]); window.pgraph?.drain();
      window.pgraph = known; known.drain();
    }""")
    assert page.evaluate("pgraph.latest.early") == 7


def test_our_own_pages_may_connect(served):
    own = f"127.0.0.1:{served.port}"
    assert answer(served, Host=own)[0] == 200
    assert answer(served, Host=f"localhost:{served.port}")[0] == 200
    assert answer(served, Host=own, Origin=f"http://{own}")[0] == 200


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
    headers = {"Host": "192.0.2.1:8080"}
    assert bridge.token_for("127.0.0.1") is None
    token = bridge.token_for("0.0.0.0")
    assert token is not None
    assert bridge._refusal(headers, "/", token) is not None
    assert bridge._refusal(headers, "/?token=wrong", token) is not None
    assert bridge._refusal(headers, f"/?token={token}", token) is None
    assert bridge._refusal({**headers, "Cookie": f"pgraph_token={token}"}, "/", token) is None
    foreign = {**headers, "Origin": "http://evil.example", "Cookie": f"pgraph_token={token}"}
    assert bridge._refusal(foreign, "/", token) is not None


def test_serve_is_wrapped_only_while_a_server_is_made():
    plain = websockets.asyncio.server.serve
    with bridge._guarded(None):
        assert websockets.asyncio.server.serve is not plain
    assert websockets.asyncio.server.serve is plain


def test_a_message_above_the_limit_closes_the_connection(served):
    with connect(f"ws://127.0.0.1:{served.port}", subprotocols=["viser-v1.1.1"]) as socket:  # type: ignore[list-item]
        socket.send(b"x" * (bridge.LARGEST_MESSAGE + 1))
        with pytest.raises(websockets.exceptions.ConnectionClosedError):
            list(iter(socket.recv, None))


def test_messages_are_ascii_so_that_names_cannot_leave_their_string():
    assert "</script>" in json.dumps("</script>")  # run by new Function, not written into HTML
    assert "\u2028" not in json.dumps("a\u2028b")


def test_a_taken_port_gives_the_next_one(served, quadruped, capsys):
    from pgraph_app.server import serve

    second = serve(quadruped, port=served.port, open_browser=False)
    try:
        assert second.port > served.port
        assert f"Port {served.port} is taken; using {second.port}." in capsys.readouterr().out
    finally:
        second.stop()


def test_a_fault_in_one_view_takes_nothing_from_the_others(page, served):
    page.evaluate(
        """(text) => {
      const host = document.body.appendChild(document.createElement('div'));
      Object.assign(host, { className: 'pgraph', hidden: true });
      Object.assign(host.dataset, { view: 'faulty', ready: '1' });
      pgraph.view('faulty', { table() { throw new Error(text); } });
    }""",
        ON_PURPOSE,
    )
    try:
        served.send(Edit(NOBODY, 1, "pelvis", "name", (), "hips"))
        page.locator('tr[data-name="hips"]').wait_for()
        for client in served.store.state.clients:
            served.send(Select(client, "hips"))
        page.wait_for_function("() => pgraph.latest.properties.title === 'hips'")
    finally:
        page.evaluate("pgraph.view('faulty', {})")
