"""Look of the page: nothing is covered, cut off, too faint or too small.

Ordinary tests take one size and one theme, nightly ones all scenes, sizes, zooms and themes.
"""

from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.plots import Plot
from pgraph_app.server import Server

from .chromium import LEAST, LOOKS, SMALL
from .conftest import LIMIT, SIZE, opened, until
from .on_page import ask, choose_body, frames, name_cell, simulate, typed

TABS = (
    "Bodies", "Connections", "Scenarios", "Plots", "Accuracy", "Fit", "Matrices", "Events",
    "Compare",
)  # fmt: skip
ASKED = ("new", "open", "save")  # of the menu of the model


def faults(page: Any) -> list[str]:
    return page.evaluate(LOOKS, [LEAST, SMALL])["faults"]


def assert_in_order(page: Any, what: str) -> None:
    """Wait until nothing is wrong: colours fade and panels move after a change."""
    frames(page)
    try:
        until(lambda: not faults(page), "in order", seconds=LIMIT / 2)
    except pytest.fail.Exception:
        pytest.fail(f"{what}: {'; '.join(faults(page))}", pytrace=False)


def shows(page: Any, script: str, *given: Any) -> None:
    page.wait_for_function(script, arg=list(given))


def sized(page: Any, width: int, height: int) -> None:
    page.set_viewport_size({"width": width, "height": height})
    frames(page)


@pytest.fixture
def walked(page: Any, served: Server, compiled: Server) -> Any:
    """The page with a short run of a quadruped, a body selected and plots."""
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    short = tuple(s.model_copy(update={"t_end": 0.1}) for s in model.scenarios)
    opened(page, served, model.replace(scenarios=short, name="walked"))
    simulate(page)
    page.locator("[data-view=trust] .verdict .link").wait_for()
    choose_body(page, "shoulder_neck_head")
    plots = (("q", "shoulder_neck_head"), ("energy", ""))
    for client in served.store.state.clients:
        for kind, of in plots:
            served.send(Plot(client, kind, of, True))
    yield page
    for client in served.store.state.clients:
        for kind, of in plots:
            served.send(Plot(client, kind, of, False))
    page.evaluate("pgraph.send('Theme', { dark: false })")


def theme(page: Any, dark: bool) -> None:
    page.evaluate("(dark) => pgraph.send('Theme', { dark })", dark)
    scheme = "dark" if dark else "light"
    page.locator(f"html[data-mantine-color-scheme={scheme}]").wait_for()


def assert_all_tabs_in_order(page: Any) -> None:
    for tab in TABS:
        page.evaluate("(tab) => pgraph.front(tab)", tab)
        assert_in_order(page, tab)
    page.evaluate("pgraph.frame.drawer(false); pgraph.front('Bodies')")
    for which in ASKED:
        ask(page, which)
        assert_in_order(page, which)
        page.keyboard.press("Escape")
    for opens in ("button.keys", "button.search-all", "button.method", "button.exports"):
        page.locator(opens).click()
        assert_in_order(page, opens)
        page.keyboard.press("Escape")
    shows(page, "!pgraph.overlaid()")
    page.evaluate("pgraph.toast('a notice'); pgraph.toast('another', true)")
    cell = name_cell(page, "lumbar")
    typed(cell, "thorax")
    page.locator("table.bodies tr.sentence").wait_for()
    assert_in_order(page, "a refused cell, and notices")
    cell.press("Escape")


def test_every_tab_is_in_order_in_one_size_and_theme(walked):
    sized(walked, 1280, 800)
    assert_all_tabs_in_order(walked)


@pytest.mark.nightly
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080), (1024, 640), (853, 533)])
def test_every_tab_is_in_order_in_all_sizes_and_themes(walked, size, dark):
    sized(walked, *size)
    theme(walked, dark)
    assert_all_tabs_in_order(walked)


FITS = """() => { const box = (s) => document.querySelector(s).getBoundingClientRect();
  const inside = (one) => one.width > 0 && one.left >= -1 && one.top >= -1
    && one.right <= innerWidth + 1 && one.bottom <= innerHeight + 1;
  const needed = ['button.play', 'select.tall', 'input.scrub', '.transport .time', '.verdict',
    'button.undo', 'button.search-all', 'button.model-menu'];
  const view = box('canvas:not(.pgraph *)'), foot = box('.pgraph-foot');
  return needed.every((s) => inside(box(s))) && view.bottom <= foot.top + 1
    && view.width >= 0.3 * innerWidth; }"""


def test_what_is_needed_first_is_in_sight_in_a_small_window(page):
    """Play, time and trust without scrolling, the 3D view above them, questions in the window."""
    for size in ((1280, 800), (900, 700), (853, 533), (640, 480), (390, 844)):
        sized(page, *size)
        shows(page, FITS)
    for size in ((640, 480), (390, 844)):
        sized(page, *size)
        ask(page, "new")
        dialog = page.get_by_role("dialog", name="New model")
        dialog.locator('.gallery [data-model="quadruped"]').wait_for()
        inside = dialog.bounding_box()
        assert inside["x"] >= 0
        assert inside["x"] + inside["width"] <= size[0]
        assert inside["y"] + inside["height"] <= size[1]
        page.keyboard.press("Escape")
        dialog.wait_for(state="detached")
    sized(page, SIZE["width"], SIZE["height"])
    page.locator("table.bodies tr[data-name]").first.wait_for()


def test_every_tab_of_the_results_is_in_sight_at_1280_by_800(page):
    """The last tab was cut by the buttons of the plots."""
    page.set_viewport_size({"width": 1280, "height": 800})
    page.evaluate("pgraph.front('Plots'); pgraph.frame.drawer(true)")
    missing = "(() => { const e = document.querySelector('.pgraph-slot.drawer .tabs');"
    missing += " return e.scrollWidth - e.clientWidth; })()"
    until(lambda: page.evaluate(missing) <= 0, "all tabs")
    assert page.locator(".pgraph-slot.drawer .tabs").bounding_box()["width"] > 300


def test_panels_of_a_narrow_window_open_by_mouse(page):
    """The buttons at both ends of the bar did nothing below 760 px, or at 200 % zoom."""
    sized(page, 700, 900)
    for button, side in (("model panel", "aside.left"), ("selection panel", "aside.right")):
        page.get_by_role("button", name=button).click()
        page.locator(side).wait_for()
        page.get_by_role("button", name=button).click()
        page.locator(side).wait_for(state="hidden")


def test_themes_are_legible(page):
    for scheme in ("dark", "light"):
        page.locator("button.theme").click()
        page.locator(f"html[data-mantine-color-scheme={scheme}]").wait_for()
        assert_in_order(page, scheme)


VIEW = "document.querySelector('canvas:not(.pgraph *)').getBoundingClientRect().toJSON()"


def test_panels_are_resized_closed_and_enlarged_and_the_view_has_the_rest(page, served, leg):
    view = lambda: page.evaluate(VIEW)  # noqa: E731
    left, right = page.locator("aside.left"), page.locator("aside.right")
    drawer = page.locator("section.drawer")
    before = view()
    assert before["x"] == pytest.approx(left.bounding_box()["width"], abs=1)
    assert before["right"] == pytest.approx(right.bounding_box()["x"], abs=1)
    edge = left.locator(".resizer").bounding_box()
    page.mouse.move(edge["x"] + 2, edge["y"] + 90)
    page.mouse.down()
    page.mouse.move(edge["x"] + 42, edge["y"] + 90, steps=3)
    page.mouse.up()
    until(lambda: abs(view()["x"] - before["x"] - 40) < 4, "a wider left panel")
    left.locator(".resizer").dblclick(position={"x": 2, "y": 90})
    until(lambda: view()["x"] == before["x"], "as at first")
    for key, name, side in (("b", "x", left), ("i", "right", right)):
        page.keyboard.press(f"Control+{key}")
        side.wait_for(state="hidden")
        assert view()["width"] > before["width"]
        page.keyboard.press(f"Control+{key}")
        side.wait_for()
        assert view()[name] == before[name]
    page.locator("button.plots").click()
    drawer.wait_for()
    until(lambda: view()["bottom"] <= drawer.bounding_box()["y"] + 1, "the results below the view")
    drawer.get_by_role("button", name="Larger").click()
    until(lambda: drawer.bounding_box()["x"] == 0, "over the model, too")
    page.locator("button.play").click(trial=True)  # not covered
    drawer.get_by_role("button", name="Larger").click()  # nor is this, by the view's own buttons
    until(lambda: drawer.bounding_box()["x"] > 0, "in its place")
    drawer.get_by_role("button", name="Larger").click()
    page.keyboard.press("Escape")
    until(lambda: drawer.bounding_box()["x"] > 0, "in its place again")
    drawer.get_by_role("button", name="Larger").click()
    opened(page, served, leg.replace(name="another"))
    until(lambda: drawer.bounding_box()["x"] > 0, "the other model in sight")
    drawer.get_by_role("button", name="Close the results").click()
    drawer.wait_for(state="hidden")
    until(lambda: view()["height"] == before["height"], "the whole view")


VECTORS = "document.querySelector('.vectors').checkVisibility()"


def test_pgraph_stays_beside_the_results_where_there_is_room(page):
    """It was hidden when the results opened, above all beside the matrices that it numbers."""
    page.evaluate("pgraph.digraph.toggle(false)")
    page.evaluate("pgraph.front('Matrices')")
    for (width, height), seen in (
        ((1280, 800), True), ((1440, 900), True), ((1920, 1080), True), ((1024, 640), True),
        ((853, 320), False),
    ):  # fmt: skip
        sized(page, width, height)
        shows(page, f"() => {VECTORS} === {str(seen).lower()}")
        assert page.evaluate(VECTORS) is seen


HIDDEN_OF_MATRIX = """() => {
  const host = pgraph.host("operators"), canvas = host.querySelector("canvas");
  const pane = host.closest(".pane"), faded = parseFloat(getComputedStyle(pane).paddingBottom);
  const [, left] = host.edge, cells = host.operator.shape[1] * host.size;
  const pen = canvas.getContext("2d");
  return {
    below: canvas.getBoundingClientRect().bottom - (pane.getBoundingClientRect().bottom - faded),
    beside: left + cells + pen.measureText("4").width / 2 - canvas.clientWidth,
  }; }"""


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080)])
def test_the_last_row_and_the_last_number_of_a_matrix_are_seen(page, size):
    """The end of the pane fades, and numbers of columns are wider than small cells."""
    page.evaluate("pgraph.front('Matrices')")
    sized(page, *size)
    page.wait_for_function("() => pgraph.host('operators').operator?.shape.join() === '4,4'")
    until(lambda: max(page.evaluate(HIDDEN_OF_MATRIX).values()) <= 0.5, "all of the matrix")


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080)])
def test_a_search_is_started_beside_the_list_of_numbers(page, size):
    """Its three steps are in sight while the list of the second one is open."""
    page.evaluate("pgraph.front('Fit')")
    sized(page, *size)
    page.get_by_label("numbers to find").click()
    page.locator("[data-view=search] .number").nth(3).wait_for()
    below = """() => {
      const pane = document.querySelector("[data-tab=Fit]"), style = getComputedStyle(pane);
      return document.querySelector("button.start-search").getBoundingClientRect().bottom
        - (pane.getBoundingClientRect().bottom - parseFloat(style.paddingBottom)); }"""
    until(lambda: page.evaluate(below) <= 0, "the button that starts")


def test_lines_of_a_list_end_where_its_cells_end(page, served, quadruped):
    opened(page, served, quadruped)
    page.evaluate("pgraph.front('Scenarios')")
    ends = """() => [".listed .title .muted", ".tie .kind", ".settings-form .cell"].map((one) =>
      Math.round(document.querySelector(`[data-view=scenario] ${one}`)
        .getBoundingClientRect().right))"""
    page.locator("[data-view=scenario] .tie .kind").first.wait_for()
    assert len(set(page.evaluate(ends))) == 1


def test_the_view_is_not_black_until_its_background_is_loaded(page):
    off = """() => { const { colorMap } = window.__viserMutable.backgroundMaterial.uniforms;
      window.keptMap ??= colorMap.value; colorMap.value = %s;
      window.__viserMutable.requestRender(); }"""
    drawn = "() => window.__viserMutable.backgroundMaterial.uniforms.enabled.value === %s"
    shows(page, "() => window.__viserMutable.backgroundMaterial.uniforms.colorMap.value !== null")
    for picture, seen in (("null", "false"), ("window.keptMap", "true")):
        page.evaluate(off % picture)
        shows(page, drawn % seen)
    same = """() => { const of = (box) => getComputedStyle(document.querySelector(box));
      return of("#root canvas[data-engine]").backgroundColor === of("body").backgroundColor; }"""
    assert page.evaluate(same)
    seen_through = """() => [...document.querySelectorAll("#root canvas:not([data-engine])")]
      .every((one) => getComputedStyle(one).backgroundColor === "rgba(0, 0, 0, 0)")"""
    assert page.evaluate(seen_through)  # the canvas of selections lies over the picture


def test_notices_are_of_one_kind_are_closed_and_are_read_whole(page):
    notes = page.locator(".pgraph-toast")
    long = "the loop through the ground is cut at a revolute constraint. " * 12
    for _ in range(2):
        page.evaluate(
            """(text) => { pgraph.toast('a refusal');
              pgraph.receive('notice', { title: 'Also changed', text, bad: false });
              document.querySelectorAll('.pgraph-toast').forEach((one) => {
                clearTimeout(one.pgraphLasts); one.pgraphLasts = null; }); }""",
            long,
        )
    assert notes.count() == 2  # the same one not twice
    said = notes.nth(1).locator(".said")
    cut = said.bounding_box()["height"]
    notes.nth(1).get_by_role("button", name="more").click()
    assert said.bounding_box()["height"] > 2 * cut
    above = """() => { const y = document.querySelector(".pgraph-foot")
      .getBoundingClientRect().y; return [...document.querySelectorAll(".pgraph-toast")]
      .every((one) => one.getBoundingClientRect().bottom < y); }"""
    shows(page, above)
    page.evaluate("pgraph.receive('notice', { title: 'Also changed', withdrawn: true })")
    until(lambda: not notes.filter(has_text="Also changed").count(), "the edit undone")
    page.evaluate("pgraph.toast('a fourth'); pgraph.toast('a fifth')")
    assert notes.count() == 3
    page.evaluate("document.querySelectorAll('.pgraph-toast .close').forEach((x) => x.click())")
    until(lambda: notes.count() == 0, "no notice")


# -- at night: all built-in models in both themes, at four sizes of the window and three zooms -----


@pytest.mark.nightly
@pytest.mark.parametrize("zoom", [1.0, 1.25, 1.5])
@pytest.mark.parametrize("size", [(1280, 800), (1440, 900), (1920, 1080), (900, 700)])
@pytest.mark.parametrize("name", pgraph_models.names())
def test_a_model_is_in_order_in_both_themes(page: Any, served: Server, name, size, zoom):
    sized(page, *(round(x / zoom) for x in size))
    opened(page, served, pg.Model.load(pgraph_models.path(name)))
    page.evaluate("pgraph.front('Bodies')")  # in a narrow window it is closed at first
    page.locator("table.bodies tr[data-name] td.number").first.click()
    for dark in (True, False):
        theme(page, dark)
        assert_in_order(page, f"{name}, {'dark' if dark else 'light'}")
