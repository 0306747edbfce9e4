"""How soon a live run obeys a person: `python -m benchmarks.live [--seconds 60] [--busy 2]`.

A page in headless Chromium with software GL walks the quadruped, while `busy` processes that only
count keep the processor at its limit. Push and Stop are pressed with the mouse; each is timed from
the browser's own time of the press to the moment when the server has obeyed, and to the first
picture on the page of a motion after it.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pgraph_core as pg
import pgraph_models
from benchmarks.browser import FLAGS, browser_path
from benchmarks.machine import machine
from pgraph_app.core.events import Event
from pgraph_app.core.state import State
from pgraph_app.gait.update import Push, Walk
from pgraph_app.run.update import StopLive
from pgraph_app.server import Server, serve

VIEWPORT = {"width": 1280, "height": 800}
LISTEN = """() => {
    const now = () => performance.timeOrigin + performance.now();
    window.pressed = []; window.handled = []; window.shown = [];
    document.addEventListener("click", (event) => {
        pressed.push(performance.timeOrigin + event.timeStamp);
        handled.push(now());
    }, true);
    pgraph.on("time", (moment) => shown.push([now(), moment[0]]));
}"""
DISTANCE = """() => {
    const camera = pgraph.viser.controls(), at = camera.camera.position.clone(), to = at.clone();
    camera.getPosition(at, true);
    camera.getTarget(to, true);
    return at.distanceTo(to);
}"""


@contextmanager
def busy(n: int) -> Iterator[None]:
    """So many processes that only count."""
    count = [sys.executable, "-c", "while True: pass"]
    started = [subprocess.Popen(count) for _ in range(n)]
    try:
        yield
    finally:
        for one in started:
            one.kill()


class Obeyed:
    """When the server obeyed each press [ms since 1970], and the time of the motion by then [s]."""

    def __init__(self, server: Server):
        self.at: list[tuple[float, float]] = []
        self._update = server.store._update
        server.store._update = self

    def __call__(self, state: State, event: Event) -> State:
        after = self._update(state, event)
        if isinstance(event, (Push, StopLive)):
            self.at.append((1e3 * time.time(), state.t_end))
        return after


def until(true: Callable[[], Any], seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            raise SystemExit("the page did not come that far")
        time.sleep(0.01)


def press(page: Any, selector: str) -> None:
    """With the mouse, at the middle of the button."""
    box = page.locator(selector).bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def said(what: str, times: list[float]) -> str:
    if not times:
        return f"{what}: none"
    return f"{what}: {statistics.median(times):.0f} ms (median), {max(times):.0f} ms (worst)"


def measured(server: Server, page: Any, seconds: float) -> Iterator[str]:
    """Walk, push every half second, stop; a line for each figure."""
    store, obeyed, most, apart = server.store, Obeyed(server), [0], []

    def look() -> None:
        while store.state.live is not None:
            most[0] = max(most[0], store.waiting)
            time.sleep(0.005)

    page.evaluate("pgraph.front('Gait')")
    page.wait_for_selector("button.push")
    (client,) = store.state.clients
    store.send(Walk(client))
    until(lambda: store.state.live is not None and store.state.t_end > 1.0)
    page.evaluate(LISTEN)
    threading.Thread(target=look, daemon=True).start()
    end, k = time.monotonic() + seconds, 0
    while time.monotonic() < end and store.state.live is not None:
        press(page, f"button.push >> nth={k % 2}")
        until(lambda k=k: len(obeyed.at) > k)
        apart.append(page.evaluate(DISTANCE))
        time.sleep(0.5)
        k += 1
    walked, pace = store.state.t_end, store.state.live.pace if store.state.live else 0.0
    press(page, "button.walk-on")
    until(lambda: store.state.live is None)
    pressed, handled, shown = (page.evaluate(name) for name in ("pressed", "handled", "shown"))
    took = [at - start for start, (at, _) in zip(pressed, obeyed.at)]
    served = [at - start for start, (at, _) in zip(handled, obeyed.at)]
    seen = [
        next((at - start for at, t in shown if at > start and t > motion), None)
        for start, (_, motion) in zip(pressed[:k], obeyed.at)
    ]
    yield f"{k} pushes in {walked:.0f} s of walk, pace {pace:.2f}; events waiting at most {most[0]}"
    yield said("push, from the press to obeyed", took[:k])
    yield said("push, from the page's script to obeyed", served[:k])
    yield said("push, from the press to its picture", [s for s in seen if s is not None])
    yield said("stop, from the press to obeyed", took[k : k + 1])
    yield said("stop, from the page's script to obeyed", served[k : k + 1])
    yield f"camera: distance kept to {(max(apart) - min(apart)) / statistics.median(apart):.1e}"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=60.0)
    options.add_argument("--busy", type=int, default=2, help="processes that only count")
    given = options.parse_args()
    from playwright.sync_api import sync_playwright

    server = serve(pg.Model.load(pgraph_models.path("quadruped_hips")), port=0, open_browser=False)
    about = ", ".join(f"{key} {value}" for key, value in machine().items())
    print(f"{about}; {given.busy} processes that only count\n")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=list(FLAGS))
        page = browser.new_page(viewport=VIEWPORT)
        page.set_default_timeout(300_000)
        page.goto(server.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        until(lambda: server.store.state.kernels.ready)
        with busy(given.busy):
            for line in measured(server, page, given.seconds):
                print(line, flush=True)
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
