"""How the page looks, as far as a test can say: nothing covered, cut off, too faint or too small.

One size and one theme here; all scenes, sizes, zooms and themes at night.
"""

from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.plots.update import Plot
from pgraph_app.server import Server

from .chromium import LEAST, LOOKS, SMALL
from .conftest import LIMIT, SIZE, opened, until
from .on_page import choose_body, frames, row, typed

TABS = (  # what is in front below the table, and below the model
    ("Digraph", "Properties"), ("Constraints", "Pose"), ("Operators", "Show"), ("Plots", "Gait"),
    ("Report", "Properties"),
)  # fmt: skip
ASKED = ("new", "open", "save", "keys")  # buttons that ask or tell something


def faults(page: Any) -> list[str]:
    return page.evaluate(LOOKS, [LEAST, SMALL])["faults"]


def in_order(page: Any, what: str) -> None:
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
    page.locator("button.simulate").click()
    page.locator(".summary dd").first.wait_for()
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


def all_tabs_in_order(page: Any) -> None:
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
    shows(page, "!document.querySelector('.asked:not(:empty), dialog.pgraph-keys')")
    page.evaluate("pgraph.toast('a notice'); pgraph.toast('another', true)")
    cell = row(page, "lumbar").locator("input.name")
    typed(cell, "thorax")
    page.locator("table.bodies tr.sentence").wait_for()
    in_order(page, "a refused cell, and notices")
    cell.press("Escape")


def test_every_tab_is_in_order_in_one_size_and_theme(walked):
    sized(walked, 1280, 800)
    all_tabs_in_order(walked)
    shows(  # the outcome is read without scrolling
        walked,
        """() => {
      const lines = [...document.querySelectorAll('.summary > dd')];
      const panel = lines[0].closest('.mantine-ScrollArea-viewport').getBoundingClientRect();
      const ends = lines.map((one) => one.getBoundingClientRect().bottom);
      return lines.length >= 2 && Math.max(...ends) <= panel.bottom;
    }""",
    )
    alone = walked.locator("[data-dock-strip]:has(> [role=tab]:only-of-type)")
    assert alone.count() == 2  # a panel of one tab has no tabs
    assert not any(one.is_visible() for one in alone.all())


@pytest.mark.nightly
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080), (1024, 640), (853, 533)])
def test_every_tab_is_in_order_in_all_sizes_and_themes(walked, size, dark):
    sized(walked, *size)
    theme(walked, dark)
    all_tabs_in_order(walked)


FITS = """() => { const box = (e) => e.getBoundingClientRect();
  const one = (s) => document.querySelector(s), button = one('button.simulate');
  const view = box(one('canvas:not(.pgraph *)')), bar = box(one('[data-floating-window]'));
  const frame = box(button.closest('.mantine-ScrollArea-viewport'));
  const tops = [...document.querySelectorAll('.file.bar button')].map((e) => box(e).y);
  const shown = [...document.querySelectorAll('.transport > *')].filter((e) => e.offsetWidth);
  const low = innerHeight < 640, mids = shown.map((e) => box(e).y + box(e).height / 2);
  return bar.left >= view.left - 1 && bar.right <= view.right + 1
    && shown.every((e) => box(e).left >= bar.left && box(e).right <= bar.right)
    && box(button).bottom <= frame.bottom && box(button).top >= frame.top
    && Math.max(...tops) - Math.min(...tops) < 4
    && Math.abs(bar.x + bar.width / 2 - view.x - view.width / 2) < 2
    && (!low || (Math.max(...mids) - Math.min(...mids) < 6 && bar.height < 50)); }"""


def test_what_is_needed_first_is_in_sight_in_a_small_window(page):
    """Simulate without scrolling; the playback within the 3D view; a question within the window."""
    for size in ((1280, 800), (853, 533), (640, 400)):
        sized(page, *size)
        shows(page, FITS)
    for size in ((640, 400), (390, 844)):
        sized(page, *size)
        page.locator("button.new").click()
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


def test_themes_are_legible(page):
    for scheme in ("dark", "light"):
        page.locator("button.theme").click()
        page.locator(f"html[data-mantine-color-scheme={scheme}]").wait_for()
        in_order(page, scheme)


UPPER = """(edge) => { const region = document.querySelector(`[data-dock-region=${edge}]`);
  const [upper, divider, lower] = region?.querySelector('[data-dock-scroll]')?.children ?? [];
  if (!lower) return { height: NaN };  // while it is drawn anew
  const content = upper.querySelector('.mantine-ScrollArea-content');
  return { height: upper.offsetHeight, lower: lower.offsetHeight, content: content.offsetHeight,
    y: divider.getBoundingClientRect().y + 2, said: Number(divider.ariaValueNow) }; }"""


def test_docks_are_as_high_as_their_content_until_a_person_says(page, served):
    upper = lambda: page.evaluate(UPPER, "left")  # noqa: E731
    opened(page, served, pg.Model.serial(16))
    halved = lambda at: abs(at["height"] - at.get("lower", 0)) < 30  # noqa: E731
    until(lambda: halved(upper()), "more rows than a half holds")
    opened(page, served, pg.Model.serial(1))
    until(lambda: upper()["height"] < 0.35 * SIZE["height"], "a short panel of a short table")
    short = upper()
    assert short["height"] >= short["content"]
    splitter = page.get_by_role("separator", name="height of the table")
    frames(page, 5)
    short, middle = upper(), splitter.bounding_box()["x"] + 100
    page.mouse.move(middle, short["y"])
    page.mouse.down()
    page.mouse.move(middle, short["y"] + 90, steps=3)
    page.mouse.up()
    until(lambda: abs(short["height"] + 90 - upper()["height"]) < 3, "as dragged")
    held = upper()
    assert held["said"] == pytest.approx(held["height"], abs=1)
    opened(page, served, pg.Model.serial(10))
    assert upper()["height"] == held["height"]  # a person's height stays
    splitter.press("ArrowUp")
    until(lambda: abs(held["height"] - 16 - upper()["height"]) < 2, "a step of a key")
    splitter.dblclick()
    until(lambda: upper()["height"] > 250, "as high as ten rows ask for")

    page.locator("[data-dock-region-collapse=left]").press("Enter")
    back = page.get_by_role("button", name="Expand panels")
    back.wait_for()
    left = "document.querySelector('canvas:not(.pgraph *)').getBoundingClientRect().left < 60"
    shows(page, left)
    back.press("Enter")
    splitter.wait_for()
    until(lambda: upper()["height"] > 200, "the dock as it was")

    playback = page.locator(".transport .play")  # a tab is enlarged to the right dock and back
    for tab, view in (("Digraph", "digraph"), ("Plots", "plots")):
        page.evaluate("(tab) => pgraph.front(tab)", tab)
        host = page.locator(f'.pgraph[data-view="{view}"]')
        docked = host.bounding_box()["width"]
        page.get_by_role("button", name=f"enlarge {tab.lower()}").click()
        large = host.bounding_box()
        right = page.locator("[data-dock-region=right]").bounding_box()["x"]
        assert large["width"] > 1.3 * docked
        assert large["x"] < 10
        assert large["x"] + large["width"] <= right + 1
        playback.click(trial=True)  # not covered
        if tab == "Plots":
            page.keyboard.press("Escape")
        else:
            page.get_by_role("button", name=f"close large {tab.lower()}").click()
        assert host.bounding_box()["width"] == pytest.approx(docked, abs=1)


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
    page.evaluate("pgraph.send('Download')")
    page.locator(".pgraph-toast", has_text="leg.json").wait_for()
    assert not page.locator(".mantine-Notification-root").first.is_visible()
    above = """() => { const y = document.querySelector("[data-floating-window]")
      .getBoundingClientRect().y; return [...document.querySelectorAll(".pgraph-toast")]
      .every((one) => one.getBoundingClientRect().bottom < y); }"""
    shows(page, above)
    page.evaluate("pgraph.toast('a fourth'); pgraph.toast('a fifth')")
    assert notes.count() == 3
    page.evaluate("document.querySelectorAll('.pgraph-toast .close').forEach((x) => x.click())")
    until(lambda: notes.count() == 0, "no notice")


def test_what_viser_says_of_software_gl_is_said_once(browser, served):
    context = browser.new_context(viewport=SIZE)  # nothing was said there yet
    try:
        fresh = context.new_page()
        fresh.set_default_timeout(1000 * LIMIT)
        fresh.add_init_script(
            "new MutationObserver(() => { window.said ||= [...document.querySelectorAll("
            "'.pgraph-toast')].some((one) => one.textContent.includes('graphics card')); })"
            ".observe(document, { childList: true, subtree: true })"
        )
        fresh.goto(served.url)
        fresh.wait_for_function("window.said === true")
        theirs = ".mantine-Notification-root"  # viser's own lay over the 3D view
        shows(fresh, f"!document.querySelector('{theirs}')?.textContent.includes('Software')")
        fresh.reload()
        fresh.wait_for_selector("table.bodies tr[data-name]")
        shows(fresh, "document.querySelector('.mantine-Notifications-root')")
        shows(fresh, "window.__viserTestpoints?.rendererInfo?.render.frame > 3")
        assert not fresh.evaluate("window.said")
    finally:
        context.close()


# -- at night: all built-in models in both themes, at four sizes of the window and three zooms -----


@pytest.mark.nightly
@pytest.mark.parametrize("zoom", [1.0, 1.25, 1.5])
@pytest.mark.parametrize("size", [(1280, 800), (1440, 900), (1920, 1080), (900, 700)])
@pytest.mark.parametrize("name", pgraph_models.names())
def test_a_model_is_in_order_in_both_themes(page: Any, served: Server, name, size, zoom):
    sized(page, *(round(x / zoom) for x in size))
    opened(page, served, pg.Model.load(pgraph_models.path(name)))
    page.locator("table.bodies tr[data-name] td.number").first.click()
    for dark in (True, False):
        theme(page, dark)
        in_order(page, f"{name}, {'dark' if dark else 'light'}")
