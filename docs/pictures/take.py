"""Take the pictures of the documents from the running page.

    python docs/pictures/take.py                    # docs/pictures/page*.png and tab_*.png
    python docs/pictures/take.py --all FOLDER       # each tab, light and dark, in two sizes
    python docs/pictures/take.py --only plots ...   # those alone

Needs what the browser tests need. Pictures are written with 256 colours.
"""

from __future__ import annotations

import argparse
import io
import itertools
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

import pgraph_core as pg
import static_models
from app.server import serve

HERE = Path(__file__).parent
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
Size = tuple[int, int]
SMALL, LARGE = (1280, 800), (1920, 1080)
COLORS = 256
LONG = 120_000  # [ms] compiled code on a busy machine


class Scene(NamedTuple):
    """A picture: the model it is of, and what a person does before it is taken."""

    model: str
    prepare: Callable[[Page], None]


def tab(page: Page, name: str) -> None:
    page.locator(f'[role="tab"][title="{name}"]').click()


def select(page: Page, name: str) -> None:
    page.locator(f'table.bodies tr[data-name="{name}"] td.number').click()


def simulate(page: Page, at: float = 0.6) -> None:
    """The run of the scenario, shown at that part of it."""
    page.get_by_role("button", name="Simulate", exact=True).click()
    page.locator(".summary dd").first.wait_for(timeout=LONG)
    slider = page.locator('.pgraph[data-view="playback"] input[type="range"]')
    slider.evaluate("(e, at) => { e.value = at * e.max; e.dispatchEvent(new Event('input')); }", at)


def overview(page: Page) -> None:
    """The quadruped's stance, a leg selected, in the middle of its push."""
    simulate(page)
    select(page, "right_radius")


def steps(page: Page) -> None:
    """Halfway through the seven steps."""
    page.get_by_role("button", name="Step through").click()
    for _ in range(9):
        page.locator("button.next").first.click()


def constraints(page: Page) -> None:
    tab(page, "Constraints")
    page.locator(".tie .title").first.click()
    page.wait_for_function("() => pgraph.latest.constraints.mobility.state === 'done'")


def operators(page: Page) -> None:
    tab(page, "Operators")
    page.wait_for_function("() => pgraph.latest.operator")


def plots(page: Page) -> None:
    simulate(page)
    select(page, "left_tibia")
    tab(page, "Plots")
    for kind in ("q", "v", "energy"):
        page.locator(f'.chip-button[data-kind="{kind}"]').first.click()
        page.locator(f'.chip-button[data-kind="{kind}"][aria-pressed="true"]').wait_for()


def report(page: Page) -> None:
    tab(page, "Report")
    page.locator("button.precision").click()
    page.locator(".outcome .figure svg").wait_for(timeout=LONG)


def pose(page: Page) -> None:
    tab(page, "Pose")


SCENES = {
    "page": Scene("quadruped", overview),
    "tab_steps": Scene("quadruped", steps),
    "tab_constraints": Scene("slider_crank", constraints),
    "tab_operators": Scene("quadruped", operators),
    "tab_plots": Scene("quadruped", plots),
    "tab_report": Scene("double_pendulum", report),
    "tab_pose": Scene("quadruped", pose),
}


IN_THE_DOCUMENTS = ("page", "tab_constraints", "tab_operators", "tab_plots", "tab_report")


def prepared(page: Page, scene: Scene, *, dark: bool) -> None:
    """The page on the scene's model, everything else as at the start."""
    page.wait_for_selector("table.bodies tr[data-name]")
    page.locator("button.open").click()
    page.locator(f'.item[data-model="{scene.model}"]').click()
    name = pg.Model.load(static_models.path(scene.model)).name
    page.wait_for_function("(name) => pgraph.latest.toolbar.name === name", arg=name)
    if dark:
        page.get_by_title("Dark or light").click()
    scene.prepare(page)


def shot(page: Page, path: Path) -> None:
    """The page as it is, once the notices are gone and the 3D view is drawn."""
    notices = page.locator(".mantine-Notification-closeButton")
    notices.evaluate_all("(found) => found.forEach((e) => e.click())")
    page.mouse.move(640, 5)
    page.wait_for_timeout(1500)  # the picture of software WebGL comes late
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)


def take(browser: Browser, url: str, name: str, path: Path, *, dark: bool, size: Size) -> None:
    """One picture, on a page of its own."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(LONG)
    page.goto(url)
    prepared(page, SCENES[name], dark=dark)
    shot(page, path)
    page.close()
    print(path, f"{path.stat().st_size / 1000:.0f} kB")


def wanted(names: list[str], everything: Path | None) -> Iterator[tuple[str, Path, bool, Size]]:
    """Scene, file, dark, size of each picture."""
    if everything is None:
        yield from ((name, HERE / f"{name}.png", False, SMALL) for name in names)
        if "page" in names:
            yield "page", HERE / "page_dark.png", True, SMALL
        return
    everything.mkdir(parents=True, exist_ok=True)
    for name, dark, size in itertools.product(names, (False, True), (SMALL, LARGE)):
        theme = "dark" if dark else "light"
        yield name, everything / f"{name}_{theme}_{size[0]}.png", dark, size


def main() -> None:
    """What the documents show, or everything for a critical look."""
    parser = argparse.ArgumentParser(description="Pictures of the page, for the documents.")
    parser.add_argument("--all", type=Path, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", choices=SCENES, default=None)
    given = parser.parse_args()
    names: list[str] = list(SCENES) if given.all else list(IN_THE_DOCUMENTS)
    names = given.only or names
    server = serve(pg.Model.load(static_models.path("quadruped")), port=18090, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)  # software GL is slow
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or sys.exit("needs chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for name, file, dark, size in wanted(names, given.all):
            take(browser, server.url, name, file, dark=dark, size=size)
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
