"""One server, one browser and one page for all browser tests of a process."""

import contextlib
import os
import random
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.model import OpenText
from pgraph_app.report import CancelAnalysis
from pgraph_app.run import Cancel, StopLive
from pgraph_app.scene import Show
from pgraph_app.server import Server, serve
from pgraph_app.session import SetDisplay

from .chromium import FLAGS, browser_path
from .store import LIMIT, until

SIZE = {"width": 1150, "height": 660}
UNCOVERED = """setInterval(() => { // viser's own panel seen before ours
  if (document.body && !document.querySelector("#pgraph-loading, table.bodies tr[data-name]"))
    window.uncovered = true;
}, 10)"""
# No test looks at the picture of the 3D view. Its scene is made and its shaders are compiled, but
# nothing is drawn: in software that takes more time than all else on the page.
UNDRAWN = """for (const name of ["clear", "drawArrays", "drawElements", "drawElementsInstanced"])
  WebGL2RenderingContext.prototype[name] = () => {};"""
ON_PURPOSE = "thrown by a test"
# A slow machine on purpose, "8 0.3": a page at an eighth of its speed, and events that wait for up
# to 0.3 s before they are handled. Tests must not depend on either.
SLOWER, DELAY = map(float, os.environ.get("PGRAPH_SLOW_PAGE", "1 0").split())
# Fading colours and a camera on its way make many pictures. On slow pages they are tested too.
MOTION = {"reduced_motion": "reduce" if SLOWER == 1 else "no-preference"}
NOBODY = -1  # a page that is not there: events of the tests themselves


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
def leg() -> pg.Model:
    """Four hinged bodies: a trunk with a thigh and a shank, and an arm."""
    model = pg.Model.serial(4).edit("4", parent="1", q=1.2)
    for old, new in zip("1234", ("trunk", "thigh", "shank", "arm")):
        model = model.edit(old, name=new)
    return model.replace(name="leg")


@pytest.fixture(scope="session")
def served(leg: pg.Model) -> Iterator[Server]:
    server = serve(leg, port=0, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)  # software GL is slow
    if DELAY:
        plain = server.store._update

        def late(state: Any, event: Any) -> Any:
            time.sleep(random.uniform(0, DELAY))
            return plain(state, event)

        server.store._update = late
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
        page = browser.new_page(viewport=SIZE, **MOTION)
        page.set_default_timeout(1000 * LIMIT)
        if SLOWER > 1:
            slow = {"rate": SLOWER}
            page.context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", slow)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.add_init_script(UNCOVERED)
        page.add_init_script(UNDRAWN)
        page.goto(served.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        page.wait_for_selector("#pgraph-loading", state="detached")
        return page

    yield opened
    # our script raised nothing in all the tests, but where one of them made it
    assert [fault for fault in faults if ON_PURPOSE not in fault] == []


@pytest.fixture(scope="session")
def the_page(open_page: Callable[[], Any]) -> Any:
    return open_page()


def settled(page: Any, served: Server) -> None:
    """All that the server has sent is on the page, where nothing is selected afterwards.

    Messages come in order. A selection that the page itself asks for comes after what the page
    asked for before, and its answer after all that the server had sent.
    """
    names = [body.name for body in served.store.state.model.bodies]
    for name in (names[0], None):
        page.evaluate("(body) => pgraph.send('Select', { body })", name)
        page.wait_for_function(
            "(name) => pgraph.latest.selection === name && pgraph.latest.selected.length ==="
            " Number(Boolean(name)) && document.querySelectorAll('tr.selected').length ==="
            " Number(Boolean(name))",
            arg=name,
        )


def opened(page: Any, served: Server, model: pg.Model) -> Any:
    """The page, once it shows that model and nothing is selected."""
    before = served.store.state.framed
    served.send(OpenText(NOBODY, model.name or "model", model.to_json()))
    until(lambda: served.store.state.framed > before, "the model on the server")
    names = [body.name for body in served.store.state.model.bodies]
    page.wait_for_function(
        "(names) => pgraph.latest.table.rows.map((row) => row.name).join() === names.join()",
        arg=names,
    )
    settled(page, served)
    return page


@pytest.fixture
def page(the_page: Any, served: Server, leg: pg.Model) -> Iterator[Any]:
    """The page on four bodies, nothing selected, the first tabs in front."""
    the_page.keyboard.press("Escape")  # what is half typed or asked goes away
    the_page.evaluate("document.activeElement?.blur()")
    the_page.evaluate("document.querySelectorAll('dialog[open]').forEach((one) => one.close())")
    the_page.evaluate("pgraph.digraph.toggle(true)")
    the_page.evaluate("document.querySelector('.pgraph-toasts')?.replaceChildren()")
    the_page.evaluate("pgraph.front('Bodies'); pgraph.frame.drawer(false)")
    if the_page.viewport_size != SIZE:
        the_page.set_viewport_size(SIZE)
    for client in served.store.state.clients:
        served.send(SetDisplay(client, "angle", "rad"))
        served.send(SetDisplay(client, "length", "m"))
    for what in ("names", "links", "coms", "forces", "cones", "footprints", "follow"):
        for client in (NOBODY, *served.store.state.clients):
            served.send(Show(client, what, False))
    opened(the_page, served, leg)
    # again, as an answer to the test before may have put another tab to the front until then
    the_page.evaluate("pgraph.front('Bodies'); pgraph.frame.drawer(false)")
    the_page.wait_for_function("!document.querySelector('.refused')")
    yield the_page
    for event in (StopLive(NOBODY), Cancel(NOBODY), CancelAnalysis(NOBODY)):
        served.send(event)


@pytest.fixture(scope="session")
def compiled(served: Server) -> Server:
    """The server once its kernels are compiled."""
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=600)
    return served
