"""One test for each name of viser's that it does not document."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import viser

import pgraph_core as pg
from pgraph_app.core import bridge
from pgraph_app.core.views import OUTDATED, Desk
from pgraph_app.features import State, initial, update
from pgraph_app.model import OpenText
from pgraph_app.properties.update import EditBodies
from pgraph_app.scenario.view import VIEWS
from pgraph_app.server import serve
from pgraph_app.session import Connected, Sees, Select

from .conftest import LIMIT, NOBODY, ON_PURPOSE, UNDRAWN, settled, until
from .on_page import choose_body, field


def test_viser_is_the_version_whose_names_these_are():
    assert viser.__version__ == "1.1.1"


def test_run_javascript_message_runs_on_the_client_s_own_connection(page, served):
    client = max(served.viser.get_clients())
    handle = served.viser.get_clients()[client]
    message = bridge.RunJavascriptMessage(source="window.ranByTest = 41 + 1")
    handle._websock_connection.queue_message(message)
    until(lambda: page.evaluate("window.ranByTest") == 42, "the script to run")


def test_what_is_sent_together_to_a_page_wakes_its_loop_once(page, served, monkeypatch):
    client = max(served.viser.get_clients())
    loop = served.viser.get_clients()[client]._websock_connection.get_message_buffer().event_loop
    woken, plain = [0], type(loop).call_soon_threadsafe

    def counted(of: Any, *given: Any, **more: Any) -> Any:
        woken[0] += threading.current_thread() is threading.main_thread() and of is loop
        return plain(of, *given, **more)

    monkeypatch.setattr(type(loop), "call_soon_threadsafe", counted)
    over = bridge.Bridge(served.viser, lambda *_: None)
    with over.together():
        for k in range(5):
            over.send(client, "byTest", k)
    assert woken[0] == 1 + len(served.viser.get_clients())
    until(lambda: page.evaluate("pgraph.latest.byTest") == 4, "the last")
    with pytest.raises(ZeroDivisionError), over.together():
        over.send(client, "byTest", 5 // len(""))
    over.send(client, "byTest", 6)
    until(lambda: page.evaluate("pgraph.latest.byTest") == 6, "the first after a failure")


def test_a_form_and_the_version_of_its_rows_reach_a_page_in_one_task(page, served, monkeypatch):
    sent: list[str] = []
    plain = bridge.RunJavascriptMessage

    def kept(source: str) -> Any:
        sent.append(source)
        return plain(source=source)

    choose_body(page, "trunk")
    monkeypatch.setattr(bridge, "RunJavascriptMessage", kept)
    wanted = served.store.state.version + 1
    served.send(EditBodies(NOBODY, 1, ("trunk",), "shape_kind", (((0,), "box"),)))
    page.wait_for_function("(wanted) => pgraph.latest.version === wanted", arg=wanted)
    monkeypatch.undo()
    forms = [source for source in sent if '["properties", ' in source]
    assert len(forms) == len(served.viser.get_clients())
    assert all(f'["version", {wanted}]' in form for form in forms)
    assert field(page, "shape_size", 2).count() == 1


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


def test_topics_that_come_before_the_script_wait_in_the_inbox(page):
    page.evaluate("""() => {
      const known = window.pgraph; window.pgraph = undefined;
      (window.pgraphInbox ??= []).push(['early', 7]); window.pgraph?.drain();
      window.pgraph = known; known.drain();
    }""")
    assert page.evaluate("pgraph.latest.early") == 7


def test_a_taken_port_gives_the_next_one(served, leg, capsys):
    second = serve(leg, port=served.port, open_browser=False)
    try:
        assert second.port > served.port
        said = capsys.readouterr().out
        assert str(served.port) in said
        assert str(second.port) in said
    finally:
        second.stop()


def test_a_page_says_that_its_connection_is_lost(browser, leg):
    own = serve(leg, port=0, open_browser=False)
    page = browser.new_page()
    page.add_init_script(UNDRAWN)
    try:
        page.goto(own.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        assert page.locator(".pgraph-lost").count() == 0
        own.stop()
        page.locator(".pgraph-lost").wait_for()
    finally:
        page.close()
        own.stop()


def test_a_fault_in_one_view_takes_nothing_from_the_others(page, served):
    page.evaluate(
        """(text) => {
      pgraph.view('export', { table() { throw new Error(text); } });
    }""",
        ON_PURPOSE,
    )
    try:
        served.send(EditBodies(NOBODY, 1, ("trunk",), "name", (((), "hips"),)))
        page.locator('tr[data-name="hips"]').wait_for()
        for client in served.store.state.clients:
            served.send(Select(client, "hips"))
        page.wait_for_function("() => pgraph.latest.properties.title === 'hips'")
    finally:
        page.evaluate("pgraph.view('export', {})")


def test_solids_are_drawn_where_they_belong_in_the_frame_that_moves_their_body(page, served):
    """viser moves nodes in the frame that reads the messages, batches one frame later."""
    scene = served.viser.scene
    frame = scene.add_frame("/told/frame")
    corners, faces = np.eye(3), np.array([[0, 1, 2]])
    ones = np.array([[1.0, 0, 0, 0]])
    batch = scene.add_batched_meshes_simple(
        "/told/batch", corners, faces, batched_wxyzs=ones, batched_positions=np.zeros((1, 3))
    )
    page.evaluate("""() => {
      window.seenTogether = [];
      const viser = window.__viserMutable, { scene } = viser;
      scene.onBeforeRender = () => {
        const { "/told/frame": frame, "/told/batch": batch } = viser.nodeRefFromName;
        let solid = null;
        batch?.traverse((x) => { if (x.getPositionAt) solid = x; });
        if (frame && solid?.instancesCount) {
          seenTogether.push([frame.position.x, solid.getPositionAt(0).x]);
        }
      };
    }""")
    until(lambda: page.evaluate("seenTogether.length"), "both to be drawn")
    for k in range(1, 9):
        with served.viser.atomic():
            frame.position, batch.batched_positions = (k, 0, 0), np.array([[float(k), 0, 0]])
        until(lambda k=k: page.evaluate("seenTogether.at(-1)[0]") == k, "the frame to move")
    pairs = page.evaluate("delete __viserMutable.scene.onBeforeRender, seenTogether")
    frame.remove()
    batch.remove()
    assert all(one == other for one, other in pairs)


def test_messages_may_be_sent_by_any_thread():
    """asyncio's events may not be set outside their loop, where viser sets them too."""

    async def in_the_loop() -> bool:
        event = bridge.WokenInItsLoop()
        waits = asyncio.create_task(event.wait())
        await asyncio.to_thread(event.set)
        alone = event.is_set()
        event.set()
        return await waits and not alone

    with ThreadPoolExecutor() as other:  # Playwright has a loop in this thread
        assert other.submit(lambda: asyncio.run(in_the_loop())).result(LIMIT)


def test_buffers_of_all_pages_and_of_one_are_woken_in_their_loop(page, served):
    client = served.viser.get_clients()[max(served.viser.get_clients())]
    for connection in (served.viser._websock_server, client._websock_connection):
        event = connection.get_message_buffer().message_event
        assert isinstance(event, bridge.WokenInItsLoop)


AT_REST = """async () => {
  const viser = window.__viserMutable, { scene } = viser, gl = await new Promise((found) => {
    scene.onBeforeRender = (gl) => { delete scene.onBeforeRender; found(gl); };
    viser.requestRender();
  });
  let now = performance.now();
  const drawn = [];
  const pictures = () => {  // of ten frames at the same time
    const before = gl.info.render.frame;
    for (let k = 0; k < 10; k++) gl.render(scene, viser.camera);
    drawn.push(gl.info.render.frame - before);
  };
  performance.now = () => now;
  try {
    pictures();  // what is left to draw
    now += 2000;
    pictures();
    gl.domElement.width += 1;
    pictures();
    viser.requestRender();
    pictures();
    now += 2000;
    pictures();
    now += 20000;
    pictures();
  } finally { delete performance.now; }
  return drawn;
}"""


def test_a_view_at_rest_is_drawn_rarely_and_whenever_it_is_asked_for(page, served):
    settled(page, served)
    assert page.evaluate(AT_REST)[1:] == [0, 1, 10, 0, 1]


class Sent:
    """A bridge that keeps to whom what was sent."""

    def __init__(self) -> None:
        self.topics: list[tuple[int, str]] = []

    def host(self, view: str) -> None:
        pass

    def send(self, client: int, topic: str, data: object) -> None:
        self.topics.append((client, topic))


def test_a_hidden_tab_is_not_drawn(leg):
    """It is only marked as outdated where it would offer rows that are gone."""
    sent, one, other = Sent(), 1, 2
    view = VIEWS[0].make(Desk(sent, lambda event: None))  # type: ignore[arg-type]

    def told(before: State, now: State) -> list[tuple[int, str]]:
        sent.topics.clear()
        view.render(before, now)
        return sorted(sent.topics)

    alone = update(initial(leg), Connected(one))
    both = update(alone, Connected(other))
    assert told(alone, both) == [(other, OUTDATED)]  # a page that comes back may show other rows
    seen = update(both, Sees(one, "scenario", True))
    assert told(both, seen) == [(one, "scenario")]
    for event in (
        EditBodies(other, 1, ("trunk",), "name", (((), "hips"),)),
        OpenText(other, "another", pg.Model.serial(2).to_json()),
    ):
        assert told(seen, update(seen, event)) == [(one, "scenario"), (other, OUTDATED)]
    edited = update(seen, EditBodies(other, 1, ("trunk",), "mass", (((), "7.25"),)))
    assert told(seen, edited) == [(one, "scenario")]
    gone = update(edited, Sees(one, "scenario", False))
    assert (
        told(edited, update(gone, EditBodies(other, 2, ("trunk",), "mass", (((), "8.5"),)))) == []
    )
    assert update(both, Sees(3, "scenario", True)) is both  # a page that went
