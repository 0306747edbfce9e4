"""The Gait tab in a real browser: a walk that plays while it is steered, is looked at and kept."""

from __future__ import annotations

import csv
import time
from collections.abc import Iterator
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.state import initial
from pgraph_app.gait.view import gait
from pgraph_app.model.update import OpenText, Undo
from pgraph_app.run.update import StopLive
from pgraph_app.scene.update import Show
from pgraph_app.server import Server
from pgraph_app.session.update import Select

from .conftest import NOBODY, caught_up, until

RATE = 30  # pictures a second, in the best second: other work on the machine is let pass


@pytest.fixture
def walker(page: Any, served: Server) -> Iterator[Any]:
    """The page with the Gait tab of the quadruped with spreading hips in front."""
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    opened = served.store.state.framed
    served.send(OpenText(NOBODY, "quadruped_hips", model.to_json()))
    until(lambda: served.store.state.framed > opened, "the model on the server")
    until(lambda: caught_up(page, served), "a page that shows it: what is typed before is dropped")
    for client in served.store.state.clients:
        served.send(Select(client, None))
    page.wait_for_function("pgraph.latest.selection === null")
    page.get_by_role("tab", name="Gait").click()
    until(lambda: page.locator(".walk-on").is_visible(), "a gait to walk")
    yield page
    served.send(StopLive(NOBODY))
    for what in ("cones", "footprints"):
        served.send(Show(NOBODY, what, False))
    for client in served.store.state.clients:
        served.send(Show(client, "follow", False))
    page.get_by_role("tab", name="Properties").click()


def slide(page: Any, speed: float) -> None:
    """The speed slider to a place, as a hand does it."""
    page.locator('[aria-label="speed slider"]').evaluate(
        "(range, value) => { range.value = value; range.dispatchEvent(new Event('input')); }", speed
    )


def parts(served: Server) -> int:
    live = served.store.state.live
    return 0 if live is None else live.taken


def best_rate(served: Server, page: Any, seconds: float) -> float:
    """The most parts of a live run in a second, while its speed is changed."""
    began, counts, turn = time.monotonic(), [], 0
    while time.monotonic() < began + seconds:
        counts.append((time.monotonic(), parts(served)))
        if time.monotonic() - began > turn:
            slide(page, 0.5 + 0.1 * (turn % 4))
            turn += 1
        time.sleep(0.02)
    rates = [
        (n - m) / (b - a)
        for k, (a, m) in enumerate(counts)
        for b, n in counts[k:]
        if 1.0 <= b - a < 1.2
    ]
    return max(rates, default=0.0)


def at_rest(served, page) -> bool:
    """Whether no part came for longer than one takes on a busy machine."""
    before = parts(served)
    page.wait_for_timeout(1500)
    return parts(served) == before


@pytest.mark.nightly  # needs a machine at rest
def test_the_trot_plays_at_a_rate_that_looks_like_motion(walker, served):
    walker.locator(".walk-on").click()
    until(lambda: parts(served) > 10, "a walk")
    until(lambda: best_rate(served, walker, 2.5) >= RATE, f"{RATE} pictures in a second", 40.0)


def test_the_trot_plays_while_its_speed_is_moved_then_pauses_scrubs_and_is_kept(walker, served):
    page = walker
    page.evaluate(
        "() => { const receive = pgraph.receive; window.times = new Set();"
        " pgraph.receive = (topic, data) => { if (topic === 'time') window.times.add(data[0]);"
        " receive(topic, data); }; }"
    )
    page.locator(".walk-on").click()
    until(lambda: parts(served) > 10, "a walk")
    before = parts(served)
    for k in range(5):  # it goes on while it is steered
        slide(page, 0.5 + 0.1 * (k % 4))
        until(lambda k=k: parts(served) > before + 20 * (k + 1), "more of the walk")
    slide(page, 0.8)
    until(lambda: served.store.state.walking.changes.get("speed") == 0.8, "the speed that is slid")
    pages = served.viser.get_clients().values()
    until(lambda: any(p.camera.look_at[0] > 0.5 for p in pages), "the camera beside it")

    page.locator("button.play").click()
    until(lambda: not served.store.state.live.running, "a pause")
    until(lambda: at_rest(served, page), "the part under way at the pause")
    end, sent = served.store.state.t_end, parts(served)
    until(lambda: page.evaluate("pgraph.latest.time[2]") == end, "all of it on the page")
    assert sent > before + 100
    assert page.evaluate("window.times.size") > 5  # the newest ones: as many as it can draw
    assert page.evaluate(
        "pgraph.pen(document.querySelector('canvas.bars')).getContextAttributes()"
    )["willReadFrequently"]  # else each picture of it waits for the 3D view
    box = page.locator("canvas.bars").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 3, box["y"] + 5)
    until(lambda: served.store.state.playback.time < end - 0.5, "an earlier time")
    assert parts(served) == sent

    page.locator(".walk-on").click()
    until(lambda: served.store.state.live is None, "the walk over")
    until(
        lambda: page.get_by_role("button", name="Export …", exact=True).is_visible(),
        "the run to keep",
    )
    with page.expect_download() as download:
        page.get_by_role("button", name="Export …", exact=True).click()
        page.locator("button.export.csv").click()
    with download.value.path().open(newline="") as file:
        head, *rows = csv.reader(file)
    assert float(rows[-1][0]) == pytest.approx(end)
    agree(page.evaluate("pgraph.latest.phases"), head, rows)
    with page.expect_download(timeout=60_000) as download:
        page.get_by_role("button", name="Export …", exact=True).click()
        page.locator("button.export.html").click()
    assert download.value.path().read_text("utf-8").lstrip().lower().startswith("<!doctype html")
    page.locator("button.ghost").click()
    until(lambda: served.store.state.ghost is not None, "the run as a ghost")
    page.locator("button.ghost").click()


def agree(shown: dict[str, Any], head: list[str], rows: list[list[str]]) -> None:
    """The phases that the page draws are those of the table."""
    assert shown["feet"]
    for number, foot in enumerate(shown["feet"]):
        own = [(t, code) for k, t, code in shown["changes"] if k == number]
        column = head.index(f"phases.{foot}")
        for row in rows:
            now = [code for t, code in own if t <= float(row[0]) + 1e-9]
            assert shown["phases"][now[-1]] == row[column]


def test_a_speed_out_of_reach_is_refused_beside_the_control(walker, served):
    cell = walker.locator('[aria-label="walking speed"]')
    cell.fill("9")
    cell.press("Enter")
    said = walker.locator(".gait .field.slid + .sentence")
    said.wait_for()
    assert "9 m/s is more than 'left_front_foot' can follow" in said.inner_text()
    assert served.store.state.walking.changes == {}
    cell.press("Escape")


def test_the_tab_goes_with_the_feet_and_comes_with_them(walker, served):
    page = walker
    tabs = page.get_by_role("tab", name="Gait")
    served.send(OpenText(NOBODY, "rods", pg.Model.serial(2).to_json()))
    until(lambda: tabs.count() == 0, "no tab where nothing has feet")
    until(lambda: page.locator(".properties").is_visible(), "another tab of the panel in front")
    served.send(Undo(NOBODY))
    until(lambda: tabs.count() == 1, "the tab again with the feet")
    tabs.click()
    until(lambda: page.locator(".walk-on").is_visible(), "the gait in it")
    footless = served.store.state.model.replace(scenarios=(), contacts=())
    served.send(OpenText(NOBODY, "footless", footless.to_json()))
    until(lambda: tabs.count() == 0, "no tab without feet")


def test_feet_without_a_gait_say_what_to_give_and_offer_a_model_that_walks(walker, served):
    bare = served.store.state.model.replace(scenarios=())
    served.send(OpenText(NOBODY, "bare", bare.to_json()))
    why = gait(initial(bare))["why"]
    until(lambda: walker.locator(".no-gait .why").inner_text() == why, "why it cannot walk")
    walker.locator(".open-walker").click()
    until(lambda: walker.locator(".walk-on").is_visible(), "the built-in model that walks")
