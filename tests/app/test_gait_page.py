"""A quadruped walks on the page: it is steered while it plays, looked at, and kept."""

import csv
from collections.abc import Iterator
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.features import initial
from pgraph_app.gait.view import gait
from pgraph_app.run import StopLive
from pgraph_app.server import Server
from pgraph_core.result.records import PHASES

from .conftest import NOBODY, opened, until
from .on_page import typed


@pytest.fixture
def walker(page: Any, served: Server, compiled: Server) -> Iterator[Any]:
    """The page with the Gait tab of the quadruped with spreading hips in front."""
    opened(page, served, pg.Model.load(pgraph_models.path("quadruped_hips")))
    page.get_by_role("tab", name="Scenarios").click()
    page.locator(".walk-on").wait_for()
    yield page
    served.send(StopLive(NOBODY))


# whether bodies hide shafts and heads
HIDES = """() => { const found = [];
  window.__viserMutable.nodeRefFromName["/forces"]?.traverse(({ material }) => {
    if (material) found.push(material.depthTest); });
  return found.join(); }"""


def slide(page: Any, speed: float) -> None:
    """The speed slider to a place, as a hand does it."""
    page.locator('[aria-label="speed slider"]').evaluate(
        "(range, value) => { range.value = value; range.dispatchEvent(new Event('input')); }", speed
    )


def speed_of(served: Server) -> float:
    state = served.store.state
    return gait(state)["speed"]


def parts(served: Server) -> int:
    live = served.store.state.live
    return 0 if live is None else live.taken


def test_a_trot_is_steered_while_it_plays_then_looked_at_and_kept(walker, served):
    page = walker
    page.locator(".walk-on").click()
    until(lambda: parts(served) > 10, "a walk")
    for k in range(3):  # it goes on while it is steered
        before = parts(served)
        slide(page, 0.5 + 0.1 * k)
        until(lambda n=before: parts(served) > n + 10, "more of the walk")
    slide(page, 0.8)
    until(lambda: speed_of(served) == 0.8, "the speed that is slid")
    pages = served.viser.get_clients().values()
    until(lambda: any(p.camera.look_at[0] > 0.3 for p in pages), "the camera beside it")

    page.locator("button.play").click()
    until(lambda: not served.store.state.live.running, "a pause")
    page.locator("canvas.bars").wait_for()
    # so that no picture of it waits for the 3D view
    assert page.evaluate(
        "pgraph.pen(document.querySelector('canvas.bars')).getContextAttributes()"
    )["willReadFrequently"]
    wide = page.locator("canvas.bars").bounding_box()["width"]
    end = served.store.state.t_end
    page.locator("canvas.bars").click(position={"x": wide / 3, "y": 5})  # where it stays
    until(lambda: served.store.state.playback.time < 0.8 * end, "an earlier time")

    page.locator(".walk-on").click()
    until(lambda: served.store.state.live is None, "the walk over")
    until(lambda: served.store.state.run, "the walk as a run")
    end = served.store.state.run.result.t[-1]
    page.wait_for_function("pgraph.latest.run.summary")  # what can be exported depends on it
    with page.expect_download() as download:
        page.locator("button.exports").click()
        page.locator("button.export.csv").click()
    with download.value.path().open(newline="") as file:
        head, *rows = csv.reader(file)
    assert float(rows[-1][0]) == pytest.approx(end)
    page.wait_for_function("pgraph.latest.phases.feet.length === 4")
    assert_agreement(page.evaluate("pgraph.latest.phases"), head, rows)
    page.get_by_role("button", name="Display").click()
    page.locator('[data-what="forces"]').check()
    until(lambda: page.evaluate(HIDES) == "false,false", "arrows in front of the bodies")


def assert_agreement(shown: dict[str, Any], head: list[str], rows: list[list[str]]) -> None:
    """The phases that the page draws are those of the table."""
    for number, foot in enumerate(shown["feet"]):
        own = [(t, code) for k, t, code in shown["changes"] if k == number]
        column = head.index(f"phases.{foot}")
        for row in rows:
            now = [code for t, code in own if t <= float(row[0]) + 1e-9]
            assert PHASES[now[-1]] == row[column]


def test_the_gait_tab_goes_with_the_feet_and_says_what_is_out_of_reach(walker, served):
    page, gaits = walker, walker.locator("[data-view=gait]")
    cell = page.locator('[aria-label="walking speed"]')
    typed(cell, "9")
    said = page.locator(".gait .field.slid + .sentence")
    said.wait_for()
    assert "9 m/s" in said.inner_text()
    assert "left_front_foot" in said.inner_text()
    assert speed_of(served) != 9
    cell.press("Escape")

    walking = served.store.state.model
    opened(page, served, pg.Model.serial(2))
    gaits.wait_for(state="hidden")  # where nothing has feet
    bare = walking.replace(scenarios=())
    opened(page, served, bare)
    gaits.wait_for()
    why = gait(initial(bare))["why"]
    until(lambda: page.locator(".no-gait .why").inner_text() == why, "why it cannot walk")
    opened(page, served, walking.replace(scenarios=(), contacts=()))
    gaits.wait_for(state="hidden")
