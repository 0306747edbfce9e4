"""Thirty scenes in both themes, at four sizes of the window and three zooms: nothing of the page is
cut off, covered, too faint or over something else. A few of them run with the ordinary tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import pgraph_models
from pgraph_app.model.update import OpenBuiltIn
from pgraph_app.plots.update import Plot
from pgraph_app.server import Server

from .conftest import NOBODY, until
from .test_look_page import FRAMES, faults

SIZES, ZOOMS = ((1280, 800), (1440, 900), (1920, 1080), (900, 700)), (1.0, 1.25, 1.5)
PATIENCE = 40.0  # [s] for what fades, moves or comes with a frame of software GL
Scene = tuple[str, Callable[[Any], None]]  # a built-in model, and what a person does with it


def nothing(page: Any) -> None:
    """The model as it opens."""


def first_body(page: Any) -> None:
    page.locator("table.bodies tr[data-name] td.number").first.click()


def tab(*names: str) -> Callable[[Any], None]:
    def show(page: Any) -> None:
        first_body(page)
        page.evaluate("(tabs) => tabs.forEach(pgraph.front)", list(names))

    return show


def pressed(selector: str, then: str = "") -> Callable[[Any], None]:
    def press(page: Any) -> None:
        page.locator(selector).first.click()
        if then:
            page.locator(then).first.wait_for()

    return press


def simulated(page: Any) -> None:
    page.locator("button.simulate").click()
    page.locator(".summary dd").first.wait_for(timeout=120_000)


SCENES: dict[str, Scene] = {
    **{name: (name, nothing) for name in pgraph_models.names()},
    "a body": ("quadruped", first_body),
    "constraints": ("andrews", tab("Constraints", "Pose")),
    "scenario": ("quadruped", tab("Scenario", "Show")),
    "operators": ("quadruped", tab("Operators", "Gait")),
    "plots": ("double_pendulum", tab("Plots", "Properties")),
    "report": ("slider_crank", tab("Report", "Properties")),
    "a run": ("double_pendulum", simulated),
    "new": ("four_bar", pressed("button.new", ".asked .gallery")),
    "open": ("four_bar", pressed("button.open", ".asked .gallery")),
    "save": ("four_bar", pressed("button.save")),
    "keys": ("four_bar", pressed("button.keys")),
    "steps": ("four_bar", pressed("button:text-is('Step through')", ".steps button.next")),
}
assert len(SCENES) >= 30
SAMPLE = {("quadruped", 1.0, 0), ("a run", 1.5, 0), ("constraints", 1.25, 1), ("new", 1.0, 3)}
VIEWS = [
    pytest.param(
        name, SIZES[k], zoom, id=f"{name}-{SIZES[k][0]}x{SIZES[k][1]}-{zoom:.0%}",
        marks=[] if (name, zoom, k) in SAMPLE else pytest.mark.nightly,
    )
    for name in SCENES for zoom in ZOOMS for k in range(len(SIZES))
]  # fmt: skip


@pytest.fixture
def sized(page: Any) -> Any:
    before = page.viewport_size
    yield page
    for _ in range(3):  # a question, a cell, a selection
        page.keyboard.press("Escape")
    page.evaluate("pgraph.send('Theme', { dark: false })")
    page.set_viewport_size(before)


@pytest.mark.parametrize(("name", "size", "zoom"), VIEWS)
def test_a_scene_is_in_order_in_both_themes(sized: Any, served: Server, name, size, zoom):
    page, (model, act) = sized, SCENES[name]
    opened = served.store.state.framed
    page.set_viewport_size({k: round(x / zoom) for k, x in zip(("width", "height"), size)})
    served.send(OpenBuiltIn(NOBODY, model))
    until(lambda: served.store.state.framed > opened, "the model")
    page.wait_for_function("(n) => pgraph.latest.table.rows.length === n",
                           arg=len(served.store.state.model.bodies))  # fmt: skip
    if name == "plots":
        for client in served.store.state.clients:
            served.send(Plot(client, "energy", "", True))
    act(page)
    for dark in (False, True):
        page.evaluate("(dark) => pgraph.send('Theme', { dark })", dark)
        scheme = "dark" if dark else "light"
        until(lambda s=scheme: page.locator(f"html[data-mantine-color-scheme={s}]").count(), scheme)
        page.evaluate(FRAMES)
        try:
            until(lambda: not faults(page), "in order", seconds=PATIENCE)
        except pytest.fail.Exception:
            pytest.fail(f"{name}, {scheme}: {'; '.join(faults(page))}", pytrace=False)
