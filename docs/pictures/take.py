"""Take the pictures of the documents from the running page.

    python -m docs.pictures.take                    # docs/pictures/page*.png and tab_*.png
    python -m docs.pictures.take --all FOLDER       # each scene, light and dark, in two sizes,
                                                    # with what is wrong with it
    python -m docs.pictures.take --only plots ...   # those alone

Needs what the browser tests need. Pictures are written with 256 colours.
"""

from __future__ import annotations

import argparse
import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

import pgraph_core as pg
import pgraph_models
from pgraph_app.server import serve

from .scenes import LONG, SCENES, Scene, menu

HERE = Path(__file__).parent
LOOKS = (HERE.parent.parent / "tests" / "app" / "looks.js").read_text(encoding="utf-8")
LEAST, SMALL = 4.5, 8.0  # contrast of text (WCAG 2.2, AA); height of letters [px]
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
Size = tuple[int, int]
LAPTOP, DESK = (1280, 800), (1920, 1080)
COLORS = 256
IN_THE_DOCUMENTS = (
    "page",
    "tab_constraints",
    "tab_operators",
    "tab_plots",
    "tab_report",
    "tab_gait",
)
Look = tuple[Path, bool, Size]  # a picture's file, whether dark, its size


def prepared(page: Page, scene: Scene) -> None:
    """The page on the scene's model, everything else as at the start."""
    page.wait_for_selector("table.bodies tr[data-name]")
    menu(page, "open")
    page.locator(f'.item[data-model="{scene.model}"]').click()
    name = pg.Model.load(pgraph_models.path(scene.model)).name
    page.wait_for_function("(name) => pgraph.latest.toolbar.name === name", arg=name)
    page.wait_for_function("() => pgraph.latest.run.kernels === null", timeout=LONG)
    notices = page.locator(".mantine-Notification-root button")
    notices.evaluate_all("(found) => found.forEach((e) => e.click())")
    scene.prepare(page)


def shot(page: Page, path: Path, *, size: Size | None = None) -> None:
    """The page as it is, once the 3D view is drawn."""
    page.mouse.move(640, 5)
    if size is not None:
        page.set_viewport_size({"width": size[0], "height": size[1]})
    warning = page.locator(".mantine-Notification-root", has_text="WebGL")
    warning.locator("button").evaluate_all("(found) => found.forEach((e) => e.click())")
    page.wait_for_timeout(1500)  # the picture of software WebGL comes late
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(path, f"{path.stat().st_size / 1000:.0f} kB", flush=True)


def take(browser: Browser, url: str, scene: Scene, looks: list[Look]) -> None:
    """All pictures of a scene, from a page of its own."""
    width, height = looks[0][2]
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(LONG)
    page.goto(url)
    prepared(page, scene)
    for path, dark, size in looks:
        page.evaluate("(dark) => pgraph.send('Theme', { dark })", dark)
        shot(page, path, size=size)
        seen = page.evaluate(LOOKS, [LEAST, SMALL])
        print(
            f"  {seen['texts']} texts, contrast {seen['contrast']:.2f} or more",
            *seen["faults"],
            sep="\n  ",
        )
    page.close()


def wanted(name: str, everything: Path | None) -> list[Look]:
    """The pictures of a scene."""
    if everything is None:
        dark = [(HERE / "page_dark.png", True, LAPTOP)] if name == "page" else []
        return [(HERE / f"{name}.png", False, LAPTOP), *dark]
    everything.mkdir(parents=True, exist_ok=True)
    return [
        (everything / f"{name}_{theme}_{size[0]}.png", theme == "dark", size)
        for size in (LAPTOP, DESK)
        for theme in ("light", "dark")
    ]


def main() -> None:
    """What the documents show, or everything for a critical look."""
    parser = argparse.ArgumentParser(description="Pictures of the page, for the documents.")
    parser.add_argument("--all", type=Path, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", choices=SCENES, default=None)
    given = parser.parse_args()
    names = given.only or (list(SCENES) if given.all else list(IN_THE_DOCUMENTS))
    server = serve(pg.Model.load(pgraph_models.path("quadruped")), port=18090, open_browser=False)
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or sys.exit("needs chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for name in names:
            take(browser, server.url, SCENES[name], wanted(name, given.all))
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
