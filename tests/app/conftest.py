"""One server, one browser and one page for all browser tests: starting them takes longest."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from benchmarks.browser import FLAGS, browser_path
from pgraph_app.model.update import OpenText
from pgraph_app.report.update import CancelAnalysis
from pgraph_app.run.update import Cancel, StopLive
from pgraph_app.scene.update import Show
from pgraph_app.server import Server, serve
from pgraph_app.session.update import Select

UNCOVERED = """setInterval(() => { // viser's own panel seen before ours
  if (document.body && !document.querySelector("#pgraph-loading, table.bodies tr[data-name]"))
    window.uncovered = true;
}, 10)"""
MARKER = "pelvis"  # selected to see that a page has caught up
ON_PURPOSE = "thrown by a test"
NOBODY = -1  # a page that is not there: events of the tests themselves


def until(true: Callable[[], Any], what: str, seconds: float = 60.0) -> Any:
    """Wait for a truthy value; fails saying what did not come."""
    end = time.monotonic() + seconds
    while not (value := true()):
        if time.monotonic() > end:
            pytest.fail(f"after {seconds:g} s still not: {what}")
        time.sleep(0.02)
    return value


def steps_after(last: Any, served: Server) -> int:
    """How many undo steps follow `last` (by identity: the list keeps the newest two hundred)."""
    undo = served.store.state.undo
    return next((k for k, step in enumerate(reversed(undo)) if step is last), len(undo))


def last_step(served: Server) -> Any:
    """The newest undo step, None where there is none."""
    return next(iter(reversed(served.store.state.undo)), None)


@contextlib.contextmanager
def held(server: Server) -> Iterator[None]:
    """The server answers nothing meanwhile: what a page does must not hang on how soon it does."""
    gate, plain = threading.Event(), server.store._update
    server.store._update = lambda state, event: (gate.wait(), plain(state, event))[1]
    try:
        yield
    finally:
        server.store._update = plain
        gate.set()


@pytest.fixture(scope="session")
def quadruped() -> pg.Model:
    return pg.Model.load(pgraph_models.path("quadruped"))


@pytest.fixture(scope="session")
def served(quadruped: pg.Model) -> Iterator[Server]:
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
    server = serve(quadruped, port=18080 + worker, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)  # software GL is slow
    yield server
    server.stop()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        pytest.fail("The browser tests need Playwright: pip install -e .[test]")
    with sync_playwright() as playwright:
        try:
            chromium = playwright.chromium.launch(executable_path=browser_path(), args=FLAGS)
        except Error as error:
            pytest.fail(f"The browser tests need a browser (apt install chromium): {error}")
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def open_page(browser: Any, served: Server) -> Iterator[Callable[[], Any]]:
    """Opens a page on the server and waits until its table is there."""
    faults: list[str] = []

    def opened() -> Any:
        page = browser.new_page(viewport={"width": 1150, "height": 720})
        page.set_default_timeout(60_000)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.add_init_script(UNCOVERED)
        page.goto(served.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        return page

    yield opened
    # our script raised nothing in all the tests, but where one of them made it
    assert [fault for fault in faults if ON_PURPOSE not in fault] == []


@pytest.fixture(scope="session")
def the_page(open_page: Callable[[], Any]) -> Any:
    page = open_page()
    page.evaluate(  # software GL draws nothing else until it has drawn the first pictures
        "new Promise((done) => { let k = 5; (function next() { "
        "k-- ? requestAnimationFrame(next) : done(true); })(); })"
    )
    return page


def caught_up(page: Any, served: Server) -> bool:
    """Whether a selection made now is on the page: messages come in order, so all before it is."""
    for client in served.store.state.clients:
        served.send(Select(client, MARKER))
    page.wait_for_timeout(30)
    return page.evaluate("pgraph.latest.selection") == MARKER


@pytest.fixture
def page(the_page: Any, served: Server, quadruped: pg.Model) -> Iterator[Any]:
    """The page on the quadruped as it is in the file, nothing selected."""
    opened = served.store.state.framed
    the_page.keyboard.press("Escape")  # what is half typed or asked goes away
    the_page.evaluate("document.activeElement?.blur()")
    the_page.evaluate("['Digraph', 'Properties'].forEach(pgraph.front)")
    served.send(Cancel(NOBODY))
    served.send(OpenText(NOBODY, "quadruped", quadruped.to_json()))
    for what in ("names", "links", "coms", "forces"):
        served.send(Show(NOBODY, what, False))
    until(lambda: served.store.state.framed > opened, "the quadruped on the server")
    until(lambda: caught_up(the_page, served), "a page that shows it")
    for client in served.store.state.clients:
        served.send(Select(client, None))
    the_page.wait_for_function("pgraph.latest.selection === null")
    until(lambda: the_page.locator("tr.selected, .refused").count() == 0, "a page at rest")
    yield the_page
    for event in (StopLive(NOBODY), Cancel(NOBODY), CancelAnalysis(NOBODY)):
        served.send(event)
