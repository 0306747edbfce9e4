"""How the page looks, as far as a test can say it, in a real browser: at two sizes, light and dark,
no panel over another, no text cut off without a title, none too faint or too small to read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from benchmarks.browser import LEAST, LOOKS, SMALL
from pgraph_app.model.update import OpenText
from pgraph_app.plots.update import Plot
from pgraph_app.server import Server

from .conftest import NOBODY, until

LONG = 90.0  # [s] for what comes with a frame of software GL on a busy machine
FRAMES = """new Promise((done) => { let k = 2;
  (function next() { k-- ? requestAnimationFrame(next) : done(true); })(); })"""
SIZES = ((1280, 800), (1920, 1080))
TABS = (  # what is in front below the table, and below the model
    ("Digraph", "Properties"), ("Constraints", "Pose"), ("Operators", "Show"), ("Plots", "Gait"),
    ("Report", "Properties"),
)  # fmt: skip
ASKED = ("new", "open", "save", "keys")  # buttons that ask or tell something


def faults(page: Any) -> list[str]:
    return page.evaluate(LOOKS, [LEAST, SMALL])["faults"]


def in_order(page: Any, what: str) -> None:
    """Fails with what is wrong; colours fade and panels move for a moment after a change."""
    page.evaluate(FRAMES)
    try:
        until(lambda: not faults(page), "in order", seconds=LONG)
    except pytest.fail.Exception:
        pytest.fail(f"{what}: {'; '.join(faults(page))}")


@pytest.fixture(scope="module")
def walked(quadruped_hips: pg.Model) -> pg.Model:
    """A quadruped with a short walk, and a part each that names what there is in the tabs."""
    short = tuple(s.model_copy(update={"t_end": 0.3}) for s in quadruped_hips.scenarios)
    return quadruped_hips.replace(scenarios=short)


@pytest.fixture(scope="module")
def quadruped_hips() -> pg.Model:
    return pg.Model.load(pgraph_models.path("quadruped_hips"))


@pytest.fixture
def seen(page: Any, served: Server, walked: pg.Model) -> Iterator[Callable[..., Any]]:
    """The page in a size and a theme, with a run, a body selected and plots."""
    before = page.viewport_size
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    served.send(OpenText(NOBODY, "walked", walked.to_json()))

    def show(size: tuple[int, int], dark: bool) -> Any:
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.evaluate("(dark) => pgraph.send('Theme', { dark })", dark)
        scheme = "dark" if dark else "light"
        until(lambda: page.locator(f"html[data-mantine-color-scheme={scheme}]").count(), scheme)
        return page

    page.locator("button.simulate").click()
    page.locator(".summary dd").first.wait_for(timeout=60_000)
    page.locator('tr[data-name="shoulder_neck_head"] td.number').click()
    for client in served.store.state.clients:
        for kind, of in (("q", "shoulder_neck_head"), ("energy", "")):
            served.send(Plot(client, kind, of, True))
    yield show
    for client in served.store.state.clients:
        for kind, of in (("q", "shoulder_neck_head"), ("energy", "")):
            served.send(Plot(client, kind, of, False))
    page.keyboard.press("Escape")
    show((before["width"], before["height"]), False)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", SIZES, ids=["1280x800", "1920x1080"])
def test_every_tab_is_in_order(seen, served, size, dark):
    page = seen(size, dark)
    for below_table, below_model in TABS:
        page.evaluate("(tabs) => tabs.forEach(pgraph.front)", [below_table, below_model])
        in_order(page, f"{below_table}, {below_model}")
    page.evaluate("pgraph.front('Digraph')")
    page.get_by_role("button", name="Step through").click()
    page.locator(".steps button.next").first.click()
    in_order(page, "the seven steps")
    page.locator(".steps").get_by_role("button", name="Close").click()
    for which in ASKED:
        page.locator(f"button.{which}").click()
        in_order(page, which)
        page.keyboard.press("Escape")
    until(
        lambda: page.locator(".asked:not(:empty), dialog.pgraph-keys").count() == 0, "no question"
    )
    page.evaluate("pgraph.toast('a notice'); pgraph.toast('another', true)")
    cell = page.locator('tr[data-name="lumbar"] input.name')
    cell.fill("thorax")
    cell.press("Enter")
    page.locator("table.bodies tr.sentence").wait_for()
    in_order(page, "a refused cell, and notices")
    cell.press("Escape")


@pytest.mark.parametrize("width", [853, 900, 1100, 1280, 1920])
def test_what_floats_stays_within_the_3d_view(seen, width):
    page = seen((width, 800), False)
    inside = """() => { const box = (e) => e.getBoundingClientRect();
      const view = box(document.querySelector('canvas:not(.pgraph *)'));
      const bar = box(document.querySelector('[data-floating-window]'));
      const controls = [...document.querySelectorAll('.transport > *')].map(box);
      return bar.left >= view.left - 1 && bar.right <= view.right + 1
        && controls.every((one) => one.left >= bar.left && one.right <= bar.right); }"""
    page.evaluate(FRAMES)
    until(lambda: page.evaluate(inside), "the playback within the 3D view", seconds=LONG)


def test_a_zoomed_page_is_in_order(page):
    """1280x800 at 125 and 150 %: nothing is cut off or covered before any run."""
    before = page.viewport_size
    page.set_viewport_size({"width": 1024, "height": 640})
    page.locator('tr[data-name="thorax"] td.number').click()
    try:
        for below_table, below_model in TABS[:3]:
            page.evaluate("(tabs) => tabs.forEach(pgraph.front)", [below_table, below_model])
            in_order(page, f"{below_table}, {below_model}")
        page.set_viewport_size({"width": 853, "height": 533})
        page.evaluate("(tabs) => tabs.forEach(pgraph.front)", TABS[0])
        in_order(page, f"{TABS[0]} at 150 %")
        views = page.locator(".pgraph-views").bounding_box()
        assert views["y"] + views["height"] < 0.1 * 533  # above the model's head
    finally:
        page.keyboard.press("Escape")
        page.set_viewport_size(before)


def test_what_viser_says_of_software_gl_is_said_once_and_goes(open_page, page):
    """Its own notice lay over the 3D view until it was closed."""
    fresh = page.context.browser.new_context().new_page()  # nothing was said there yet
    theirs = ".mantine-Notification-root:has-text('Software WebGL')"
    try:
        fresh.add_init_script(
            "new MutationObserver(() => { window.said ||= [...document.querySelectorAll("
            "'.pgraph-toast')].some((one) => one.textContent.includes('graphics card')); })"
            ".observe(document, { childList: true, subtree: true })"
        )
        fresh.goto(page.url)
        fresh.wait_for_selector("table.bodies tr[data-name]")
        until(lambda: fresh.evaluate("window.said === true"), "our words", seconds=LONG)
        until(lambda: fresh.locator(theirs).count() == 0, "viser's notice gone", seconds=LONG)
        fresh.reload()
        fresh.wait_for_selector("table.bodies tr[data-name]")
        until(
            lambda: (
                fresh.evaluate("pgraph.latest.toolbar !== undefined")
                and not fresh.locator("#pgraph-loading").count()
            ),
            "the page again",
        )
        fresh.wait_for_timeout(3000)
        until(lambda: fresh.locator(theirs).count() == 0, "no notice again", seconds=LONG)
        assert not fresh.evaluate("window.said")
    finally:
        fresh.context.close()


def test_the_outcome_is_read_without_scrolling_and_a_panel_of_one_tab_has_no_tabs(seen):
    page = seen((1280, 800), False)
    page.evaluate(FRAMES)
    above = """() => {
      const lines = [...document.querySelectorAll('.summary > dd')];
      const panel = lines[0].closest('.mantine-ScrollArea-viewport').getBoundingClientRect();
      const ends = lines.map((one) => one.getBoundingClientRect().bottom);
      return lines.length >= 2 && Math.max(...ends) <= panel.bottom;
    }"""
    until(lambda: page.evaluate(above), "the outcome in sight", seconds=LONG)
    alone = page.locator("[data-dock-strip]:has(> [role=tab]:only-of-type)")
    assert alone.count() == 2
    assert not any(one.is_visible() for one in alone.all())
    said = page.locator(".phase-legend .all")
    until(lambda: said.inner_text() == "", "four feet, and nothing to scroll to", seconds=LONG)
