"""How soon a live run obeys a person: `python -m benchmarks.live [--seconds 60] [--busy 2]`.

A page in headless Chromium with software GL walks the quadruped, while `busy` processes that only
count keep the processor at its limit: once long, then in `stops` short walks. Push and Stop are
pressed with the mouse; each is timed from the browser's own time of the press to the moment when
the server has obeyed, and to what the page shows of it: the first picture of a motion after a push,
the button that offers another walk after a stop.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import pgraph_core as pg
import pgraph_models
from benchmarks.browser import FLAGS, browser_path
from benchmarks.machine import machine
from pgraph_app.core.events import Event
from pgraph_app.core.state import State
from pgraph_app.gait.update import Push, Walk
from pgraph_app.run.update import StopLive
from pgraph_app.server import Server, serve

SHORT = 3.0  # [s] of the walks after the first
LISTEN = """() => {
    const now = () => performance.timeOrigin + performance.now();
    window.pressed = []; window.handled = []; window.shown = []; window.ended = [];
    document.addEventListener("click", (event) => {
        pressed.push(performance.timeOrigin + event.timeStamp);
        handled.push(now());
    }, true);
    pgraph.on("time", (moment) => shown.push([now(), moment[0]]));
    let going = true;
    pgraph.on("gait", (data) => { if (going && !data.live) ended.push(now()); going = data.live; });
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


class Moment(NamedTuple):
    """When the server obeyed a press [ms since 1970], and the time of the motion by then [s]."""

    at: float
    motion: float
    push: bool


class Obeyed:
    """When the server obeyed each press."""

    def __init__(self, server: Server):
        self.at: list[Moment] = []
        self._update = server.store._update
        server.store._update = self

    def __call__(self, state: State, event: Event) -> State:
        after = self._update(state, event)
        if isinstance(event, (Push, StopLive)):
            self.at.append(Moment(1e3 * time.time(), state.t_end, isinstance(event, Push)))
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


def walk(server: Server, page: Any, seconds: float, obeyed: Obeyed, apart: list[float]) -> float:
    """A walk, pushed every half second, then stopped: its pace."""
    store, begun = server.store, len(obeyed.at)
    (client,) = store.state.clients
    until(lambda: store.state.live is None)
    store.send(Walk(client))
    until(lambda: store.state.going is not None and store.state.t_end > 1.0)
    page.wait_for_function("pgraph.latest.gait.live")
    end, k, pace = time.monotonic() + seconds, 0, 0.0
    while time.monotonic() < end and (live := store.state.going) is not None:
        press(page, f"button.push >> nth={k % 2}")
        until(lambda k=k: len(obeyed.at) > begun + k)
        apart.append(page.evaluate(DISTANCE))
        time.sleep(0.5)
        k, pace = k + 1, live.pace
    press(page, "button.walk-on")
    until(lambda: store.state.going is None and len(obeyed.at) > begun + k)
    page.wait_for_function("!pgraph.latest.gait.live")
    return pace


def measured(server: Server, page: Any, seconds: float, stops: int) -> Iterator[str]:
    """A long walk, then short ones; a line for each figure."""
    store, obeyed, most, apart = server.store, Obeyed(server), [0], list[float]()

    def look() -> None:
        while True:
            most[0] = max(most[0], store.waiting)
            time.sleep(0.005)

    page.evaluate("pgraph.front('Gait')")
    page.wait_for_selector("button.push")
    page.evaluate(LISTEN)
    threading.Thread(target=look, daemon=True).start()
    pace = walk(server, page, seconds, obeyed, apart)
    walked, load = obeyed.at[-1].motion, os.getloadavg()[0]
    for _ in range(stops):
        walk(server, page, SHORT, obeyed, apart)
    names = ("pressed", "handled", "shown", "ended")
    pressed, handled, shown, ended = (page.evaluate(name) for name in names)
    every = list(zip(pressed, handled, obeyed.at))
    pushes = [one for one in every if one[2].push]
    halts = [one for one in every if not one[2].push]
    seen = [
        next((at - start for at, t in shown if at > start and t > how.motion), None)
        for start, _, how in pushes
    ]
    yield (
        f"{len(pushes)} pushes, the first walk {walked:.0f} s long, pace {pace:.2f}, "
        f"load {load:.1f}; events waiting at most {most[0]}"
    )
    for what, some in (("push", pushes), ("stop", halts)):
        yield said(f"{what}, from the press to obeyed", [how.at - start for start, _, how in some])
        served = [how.at - start for _, start, how in some]
        yield said(f"{what}, from the page's script to obeyed", served)
    yield said("push, from the press to its picture", [s for s in seen if s is not None])
    told = [min(at for at in ended if at > start) - start for start, _, _ in halts]
    yield said("stop, from the press to the page that says so", told)
    yield f"  of the long walk: obeyed {halts[0][2].at - halts[0][0]:.0f}, said {told[0]:.0f} ms"
    yield f"camera: distance kept to {(max(apart) - min(apart)) / statistics.median(apart):.1e}"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=60.0)
    options.add_argument("--stops", type=int, default=10, help="short walks after the long one")
    options.add_argument("--busy", type=int, default=2, help="processes that only count")
    given = options.parse_args()
    from playwright.sync_api import sync_playwright

    server = serve(pg.Model.load(pgraph_models.path("quadruped_hips")), port=0, open_browser=False)
    about = ", ".join(f"{key} {value}" for key, value in machine().items())
    print(f"{about}; {given.busy} processes that only count\n")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(300_000)
        page.goto(server.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        until(lambda: server.store.state.kernels.ready)
        with busy(given.busy):
            for line in measured(server, page, given.seconds, given.stops):
                print(line, flush=True)
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
