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


UPPER = """(edge) => { const region = document.querySelector(`[data-dock-region=${edge}]`);
  const [upper, divider, lower] = region.querySelector('[data-dock-scroll]').children;
  const content = upper.querySelector('.mantine-ScrollArea-content');
  return { height: upper.offsetHeight, lower: lower.offsetHeight, content: content.offsetHeight,
    y: divider.getBoundingClientRect().y + 2, said: Number(divider.ariaValueNow) }; }"""


def test_the_upper_panel_of_a_dock_is_as_high_as_its_content_until_a_person_says(page, served):
    def upper(edge: str = "left") -> dict[str, float]:
        return page.evaluate(UPPER, edge)

    def halved() -> bool:
        return abs(upper()["height"] - upper()["lower"]) < 30

    until(halved, "sixteen rows ask for more than a half", seconds=LONG)
    served.send(OpenText(NOBODY, "one", pg.Model.serial(1).to_json()))
    until(lambda: upper()["height"] < 0.3 * 720, "a short panel of a short table", seconds=LONG)
    short = upper()
    assert short["height"] >= short["content"]
    splitter = page.get_by_role("separator", name="height of the table")
    middle = splitter.bounding_box()["x"] + 100
    page.mouse.move(middle, short["y"])
    page.mouse.down()
    page.mouse.move(middle, short["y"] + 90, steps=3)
    page.mouse.up()
    until(lambda: abs(short["height"] + 90 - upper()["height"]) < 3, "as dragged", seconds=LONG)
    held = upper()
    assert held["said"] == pytest.approx(held["height"], abs=1)
    served.send(OpenText(NOBODY, "ten", pg.Model.serial(10).to_json()))
    until(lambda: page.locator("tr[data-name]").count() == 10, "ten rows")
    assert upper()["height"] == held["height"]  # a person's height stays
    splitter.press("ArrowUp")
    until(lambda: abs(held["height"] - 16 - upper()["height"]) < 2, "a step of a key", seconds=LONG)
    splitter.dblclick()
    until(lambda: upper()["height"] > 300, "as high as ten rows ask for", seconds=LONG)


def test_a_tab_is_enlarged_to_the_right_dock_and_back(page):
    """Twice as wide as in its dock, with the playback over it; the same by its cross and by Esc."""
    playback = page.locator(".transport .play")
    for tab in ("Digraph", "Plots", "Report"):
        page.evaluate("(tab) => pgraph.front(tab)", tab)
        view = {"Digraph": "digraph", "Plots": "plots", "Report": "reports"}[tab]
        host = page.locator(f'.pgraph[data-view="{view}"]')
        docked = host.bounding_box()["width"]
        page.get_by_role("button", name=f"enlarge {tab.lower()}").click()
        large = host.bounding_box()
        right = page.locator("[data-dock-region=right]").bounding_box()["x"]
        assert large["width"] > 1.5 * docked
        assert large["x"] < 10
        assert large["x"] + large["width"] <= right + 1
        playback.click(trial=True)  # not covered
        if tab == "Plots":
            page.keyboard.press("Escape")
        else:
            page.get_by_role("button", name=f"close large {tab.lower()}").click()
        assert host.bounding_box()["width"] == pytest.approx(docked, abs=1)


@pytest.mark.parametrize("size", [(1280, 800), (853, 533), (640, 400)])
def test_in_a_small_window_what_is_needed_first_is_in_sight(seen, size):
    """Simulate without scrolling; one line of buttons above it; the playback one line, centred."""
    page = seen(size, False)
    fits = """() => { const box = (e) => e.getBoundingClientRect();
      const one = (s) => document.querySelector(s), button = one('button.simulate');
      const view = box(one('canvas:not(.pgraph *)')), bar = box(one('[data-floating-window]'));
      const frame = box(button.closest('.mantine-ScrollArea-viewport'));
      const tops = [...document.querySelectorAll('.file.bar button')].map((e) => box(e).y);
      const low = innerHeight < 640, parts = [...document.querySelectorAll('.transport > *')]
        .filter((e) => e.offsetWidth).map((e) => box(e).y + box(e).height / 2);
      return { simulate: box(button).bottom <= frame.bottom && box(button).top >= frame.top,
        line: Math.max(...tops) - Math.min(...tops) < 4,
        centred: Math.abs(bar.x + bar.width / 2 - view.x - view.width / 2) < 2,
        playback: !low || (Math.max(...parts) - Math.min(...parts) < 6 && bar.height < 50) }; }"""
    page.evaluate(FRAMES)
    until(lambda: all(page.evaluate(fits).values()), "all in sight", seconds=LONG)


def test_a_collapsed_dock_has_a_button_back(page):
    page.locator("[data-dock-region-collapse=left]").press("Enter")
    back = page.get_by_role("button", name="Expand panels")
    until(lambda: back.count() == 1, "the way back")
    until(
        lambda: (
            page.evaluate(
                "document.querySelector('canvas:not(.pgraph *)').getBoundingClientRect().left"
            )
            < 60
        ),
        "a wide view",
        seconds=LONG,
    )
    back.press("Enter")
    page.get_by_role("separator", name="height of the table").wait_for()
    assert page.evaluate(UPPER, "left")["height"] > 250


def test_notices_are_of_one_kind_are_closed_and_are_read_whole(page):
    page.evaluate("document.querySelector('.pgraph-toasts')?.replaceChildren()")
    notes = page.locator(".pgraph-toast")
    long = "the loop through the ground is cut at a revolute constraint. " * 12
    tell = "([title, text]) => pgraph.receive('notice', { title, text, bad: false })"
    for _ in range(2):
        page.evaluate("pgraph.toast('a refusal')")
        page.evaluate(tell, ["Also changed", long])
    assert notes.count() == 2  # the same one not twice
    said = notes.nth(1).locator(".said")
    cut = said.bounding_box()["height"]
    notes.nth(1).get_by_role("button", name="more").click()
    assert said.bounding_box()["height"] > 2 * cut
    page.evaluate("pgraph.send('Download')")
    page.get_by_text("Downloaded quadruped.json").wait_for()
    assert not page.locator(".mantine-Notification-root").first.is_visible()
    playback = page.locator("[data-floating-window]").bounding_box()["y"]
    for note in notes.all():
        assert note.bounding_box()["y"] + note.bounding_box()["height"] < playback
    page.evaluate("pgraph.toast('a fourth')")
    assert notes.count() == 3
    for _ in range(3):
        notes.first.get_by_role("button", name="close").click()
    assert notes.count() == 0


@pytest.mark.parametrize("size", [(1280, 800), (640, 400), (390, 844)])
def test_a_new_model_is_asked_for_at_one_place(page, size):
    before = page.viewport_size
    page.set_viewport_size({"width": size[0], "height": size[1]})
    try:
        page.locator("button.new").click()
        dialog = page.get_by_role("dialog", name="New model")
        dialog.get_by_role("heading", name="New model").wait_for()
        dialog.locator('.gallery [data-model="quadruped"]').wait_for()
        inside = dialog.bounding_box()
        assert inside["x"] >= 0
        assert inside["x"] + inside["width"] <= size[0]
        assert inside["y"] + inside["height"] <= size[1]
        page.keyboard.press("Escape")
        until(lambda: dialog.count() == 0, "no question")
    finally:
        page.set_viewport_size(before)
        page.locator("table.bodies tr[data-name]").first.wait_for()
