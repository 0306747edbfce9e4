"""A rope in the browser: bodies clicked in their order, Enter, and the rows of its stations."""

from typing import Any

import pgraph_core as pg
from pgraph_app.server import Server

from .conftest import opened
from .on_page import part_field, row, typed
from .store import until
from .test_cable_form import ATWOOD


def test_a_rope_is_led_over_a_sheave_by_three_clicks_and_enter(page: Any, served: Server):
    opened(page, served, ATWOOD)
    page.evaluate("pgraph.front('Connections')")
    page.locator("button.add-tie").click()
    page.keyboard.type("rope")
    page.keyboard.press("Enter")
    for said, name in (("begins", "left"), ("left →", "right"), ("right →", "sheave")):
        page.locator(f".pgraph-banner:has-text('{said}')").wait_for()
        row(page, name).locator("td.number").click()
    page.locator(".pgraph-banner:has-text('sheave (wheel)')").wait_for()
    for _ in range(2):  # a slip: the weight on the other side comes after the sheave
        page.keyboard.press("Backspace")
    page.locator(".pgraph-banner:not(:has-text('right'))").wait_for()
    row(page, "sheave").locator("td.number").click()
    page.locator(".pgraph-banner:has-text('sheave (wheel)')").wait_for()
    row(page, "right").locator("td.number").click()
    page.locator(".pgraph-banner:has-text('right →')").wait_for()
    page.keyboard.press("Enter")
    path = page.locator('[data-view=part] details[data-title="Path"] > summary')
    assert path.inner_text().split() == ["Path", "3", "points"]
    path.click()
    typed(part_field(page, "through", 8), "120 mm")

    def radius() -> float:
        (rope,) = served.store.state.model.constraints
        assert isinstance(rope, pg.Rope)
        return rope.through[1].radius

    until(lambda: radius() == 0.12, "the typed radius")
    (rope,) = served.store.state.model.constraints
    assert [x.body for x in rope.through] == ["left", "sheave", "right"]  # type: ignore[attr-defined]
    typed(part_field(page, "through", 8), "3 m")
    page.locator("[data-view=part] .note.bad:has-text('move them apart')").wait_for()
