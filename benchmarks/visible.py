"""From Enter in a cell to the new value on two pages, in a real browser: `editing --page`.

Times are taken in the pages (performance.now, one clock for all pages of a browser) and at the
server's own functions (time.time, the same clock): nothing waits for a poll. The 3D view counts as
drawn when the picture after its last message has been handed to the screen.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from viser._messages import RunJavascriptMessage

import pgraph_core as pg
from pgraph_app.core.state import State
from pgraph_app.model.update import Edit, Undo
from pgraph_app.properties.update import EditBodies
from pgraph_app.server import Server, serve
from pgraph_app.table.update import Duplicate

from .browser import FLAGS, browser_path
from .timing import spread

VIEWPORT = {"width": 1280, "height": 800}
DRAWN = ("drawn table", "drawn digraph", "drawn properties")

PROBE = """() => {
  const now = () => performance.timeOrigin + performance.now();
  const receive = pgraph.receive, send = pgraph.send;
  const probe = window.probe = { log: [], done: null };
  probe.begin = () => { probe.log = []; return new Promise((done) => { probe.done = done; }); };
  const note = (what, at = now()) => probe.log.push([what, at]);
  for (const type of ["keydown", "change"])
    window.addEventListener(type, ({ timeStamp }) => note(type, performance.timeOrigin + timeStamp),
      true);
  pgraph.send = (event, fields) => { note(`sent ${event}`); send(event, fields); };
  pgraph.receive = (topic, data) => {
    note(`arrived ${topic}`);
    receive(topic, data);
    note(`drawn ${topic}`);
  };
  // after the last message of an edit: until the frame that shows it has been made
  window.probeMark = () => {
    note("scene");
    requestAnimationFrame(() => {
      const channel = new MessageChannel();
      channel.port1.onmessage = () => {
        note("painted");
        probe.done?.(probe.log);
        probe.done = null;
      };
      channel.port2.postMessage(0);
    });
  };
}"""
WHEN = """new MutationObserver((_, watch) => {
  const shown = document.querySelectorAll("table.bodies tr[data-name]").length;
  if (!shown || shown !== window.pgraph?.latest.table?.rows.length) return;
  window.tableAt = performance.now();
  watch.disconnect();
}).observe(document, { childList: true, subtree: true });"""
CHOOSE = """(selector) =>
  document.querySelector(selector).dispatchEvent(new Event("change", { bubbles: true }))"""
START = """([selector, value]) => {
  const cell = document.querySelector(selector);
  cell.closest("tr")?.scrollIntoView({ block: "center" });
  cell.focus();
  if (cell.tagName === "TR") return;
  if (cell.tagName === "SELECT") { cell.value = value; return; }
  cell.value = value;
  cell.dispatchEvent(new InputEvent("input", { bubbles: true }));
}"""


class Typed(NamedTuple):
    """One edit on the page: a cell, the text typed there, and the key that ends it."""

    selector: str
    texts: tuple[str, str]  # in turn, so that every edit changes something
    key: str = "Enter"
    select: str = ""  # the body that is selected before


class Marker:
    """The last view: tells when the server is done, and every page where an edit's messages end."""

    def __init__(self, server: Server):
        self._server = server
        self.ended = 0.0

    def render(self, old: State, new: State) -> None:
        if new.derived is not old.derived:
            self.ended = 1e3 * time.time()
            message = RunJavascriptMessage(source="window.probeMark?.();")
            self._server.viser._websock_server.queue_message(message)


@contextmanager
def marked(model: pg.Model) -> Iterator[tuple[Server, Marker, list[float]]]:
    """A server whose times are taken: when an event came, and when all views were done."""
    server = serve(model, port=18090, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)
    marker, came = Marker(server), []
    server.store._views = (*server.store._views, marker)
    plain = server.send

    def timed(event: Any) -> None:
        if isinstance(event, Edit | EditBodies | Duplicate):
            came.append(1e3 * time.time())
        plain(event)

    server.send = timed  # type: ignore[method-assign]
    try:
        yield server, marker, came
    finally:
        server.stop()


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser of the tests."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=list(FLAGS))
        yield browser
        browser.close()


def opened(browser: Any, server: Server, viewport: dict[str, int]) -> tuple[Any, float]:
    """A page with a probe, and seconds from going there to a table whose rows all stand."""
    page = browser.new_page(viewport=viewport)
    page.set_default_timeout(120_000)
    page.add_init_script(WHEN)
    page.goto(server.url)
    page.wait_for_function("window.tableAt")
    page.wait_for_function("pgraph.latest.digraph")
    page.evaluate(PROBE)
    page.wait_for_timeout(3000)  # the first pictures of software GL
    return page, page.evaluate("window.tableAt") / 1e3


def edits(model: pg.Model) -> dict[str, Typed]:
    """A kind of edit each."""
    names = [body.name for body in model.bodies]
    middle, last = names[len(names) // 2], names[-1]
    row = f'table.bodies tr[data-name="{last}"]'
    return {
        "name": Typed("table.bodies tr.last input.name", ("renamed", last), select=last),
        "parent": Typed(f'{row} select[aria-label="parent"]', (names[0], names[1]), "", last),
        "DoF": Typed(f'{row} select[aria-label="DoF"]', ("2", "3"), "", last),
        "mass": Typed('.properties input[aria-label="Mass"]', ("1.25", "1.5"), "Enter", middle),
        "duplicate": Typed("table.bodies tr.last", ("", ""), "Control+d", last),
    }


Log = list[tuple[str, float]]


def once(pages: list[Any], edit: Typed, k: int) -> list[Log]:
    """Do it on the first page; the notes of every page until its picture is made."""
    first = pages[0]
    for page in pages:
        page.evaluate("() => { window.probing = probe.begin(); }")
    first.evaluate(START, [edit.selector, edit.texts[k % 2]])
    if edit.key:
        first.keyboard.press(edit.key)
    else:
        first.evaluate(CHOOSE, edit.selector)
    return [page.evaluate("() => window.probing") for page in pages]


def parts(logs: list[Log], came: float, ended: float) -> dict[str, float]:
    """Milliseconds of one edit, from the key or choice on."""
    begun = next(at for what, at in logs[0] if what in ("keydown", "change"))
    shown = [max(at for what, at in log if what in DRAWN) for log in logs]
    arrived = [at for what, at in logs[0] if what.startswith("arrived")]
    drawn = [at for what, at in logs[0] if what.startswith("drawn")]
    painted = [dict(log)["painted"] for log in logs]
    return {
        "at the server": came - begun,
        "server, 3D included": ended - came,
        "our scripts": sum(drawn) - sum(arrived),
        "table, digraph, properties": shown[0] - begun,
        "on the other page": shown[1] - begun,
        "3D picture, both pages": max(painted) - begun,
    }


def measured(n: int, model: pg.Model, viewport: dict[str, int], rounds: int) -> Iterator[str]:
    """Lines of medians with quartiles, a kind of edit each."""
    with marked(model) as (server, marker, came), chromium() as browser:
        both = [opened(browser, server, viewport) for _ in range(2)]
        pages = [page for page, _ in both]
        size = f"{viewport['width']}x{viewport['height']}"
        yield f"{n} bodies, two pages of {size}: table in {both[0][1]:.2f}, {both[1][1]:.2f} s"
        for name, edit in edits(model).items():
            found: list[dict[str, float]] = []
            for k in range(rounds + 1 + (rounds + 1) % 2):  # an even number: names are as before
                pages[0].wait_for_timeout(300)
                if k == 0 or name == "duplicate":  # whose undo leaves nothing selected
                    pages[0].evaluate("(name) => pgraph.table.pick(name)", edit.select)
                pages[0].wait_for_selector(edit.selector, state="attached")
                logs = once(pages, edit, k)
                found.append(parts(logs, came[-1], marker.ended))
                if name == "duplicate":
                    server.send(Undo(next(iter(server.store.state.clients))))
                    for page in pages:
                        page.wait_for_function(
                            "(n) => pgraph.latest.table.rows.length === n", arg=n
                        )
            said: list[str] = []
            for part in found[0]:
                low, middle, high = spread([each[part] for each in found[1:]])
                said.append(f"{part} {middle:.0f} [{low:.0f}, {high:.0f}]")
            yield f"  {name:9s} {'; '.join(said)}"
