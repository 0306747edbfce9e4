"""A relation in the browser: two clicks, its points, its picture, and the mark of now."""

from typing import Any

import pgraph_core as pg
from pgraph_app.server import Server

from .conftest import opened
from .on_page import part_field, row, typed

YOKE = pg.Model(
    name="yoke",
    bodies=(
        pg.Body(name="wheel", q=(0.5,)),
        pg.Body(name="slider", joint="prismatic", axes=[(0, 0, 1)], link=(0.3, 0, 0)),
    ),
)
CHARTS = """() => [...document.querySelectorAll("[data-view=part] .curve svg")].map((one) => ({
  label: one.getAttribute("aria-label"), marks: one.querySelectorAll(".now").length,
  dot: one.querySelector(".now.dots")?.getAttribute("d") ?? "" }))"""


def test_a_slider_follows_a_wheel_by_two_clicks_and_typed_points(page: Any, compiled: Server):
    served = compiled
    opened(page, served, YOKE)
    page.evaluate("pgraph.send('SetDisplay', {what: 'angle', value: 'deg'})")
    page.evaluate("pgraph.front('Connections')")
    page.locator("button.add-tie").click()
    page.keyboard.type("relation")
    page.keyboard.press("Enter")
    for name in ("slider", "wheel"):
        asked = "it follows" if name == "wheel" else "follows"
        page.locator(f".pgraph-banner:has-text('{asked}')").wait_for()
        row(page, name).locator("td.number").click()
    typed(part_field(page, "curve"), "0 0; 90deg 12mm; 180deg 20mm")
    page.wait_for_function(
        """() => document.querySelector('[data-view=part] .curve .last')?.textContent === '180 deg'
           && document.querySelector('[data-view=part] .now.dots')"""
    )
    (relation,) = served.store.state.model.constraints
    assert isinstance(relation, pg.Relation)
    assert (relation.body, relation.other) == ("slider", "wheel")
    value, slope = page.evaluate(CHARTS)
    assert (value["marks"], slope["marks"]) == (2, 1)
    assert slope["label"] == "curve slope [m/rad]"
    typed(part_field(page, "curve"), "=0.02*(1-cos(q.wheel))")
    page.wait_for_function(
        "(old) => (document.querySelector('[data-view=part] .now.dots')?.getAttribute('d') ?? old)"
        " !== old",
        arg=value["dot"],
    )
    page.evaluate("pgraph.send('MoveJoint', {serial: 0, body: 'wheel', index: 0, text: '1.5 rad'})")
    page.wait_for_function(  # 0.02 (1 - cos 1.5): the slider follows by hand too
        "document.querySelector('[data-view=part] .muted.now').textContent.endsWith(' 0.01859 m')"
    )
    found = served.store.state.model.constraints[0]
    assert isinstance(found, pg.Relation)
    assert found.curve == "=0.02*(1-cos(q.wheel))"
