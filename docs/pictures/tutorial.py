"""Pictures of docs/tutorial.md, taken as its test does it: `python -m docs.pictures.tutorial`."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

import pgraph_core as pg
from docs.pictures.take import FLAGS, LONG, shot
from pgraph_app.server import serve

HERE = Path(__file__).parent
WIDTH, HEIGHT = 1200, 720
ROW_OF_FOCUS = "(name) => document.activeElement.closest('tr')?.dataset.name === name"


def create(page: Any) -> None:
    """New, three bodies."""
    page.locator("button.new").click()
    page.keyboard.type("3")
    page.keyboard.press("Enter")
    page.wait_for_function("() => pgraph.latest.table.rows.length === 3")


def rename(page: Any) -> None:
    """Names, one below the other."""
    page.locator('table.bodies tr[data-name="1"]').locator("input.name").click()
    page.keyboard.press("F2")
    page.keyboard.press("Control+a")
    for name, below in (("crank", "2"), ("coupler", "3"), ("rocker", "rocker")):
        page.keyboard.type(name)
        page.keyboard.press("Enter")
        page.locator(f'table.bodies tr[data-name="{name}"]').wait_for()
        page.wait_for_function(ROW_OF_FOCUS, arg=below)


def bend(page: Any) -> None:
    """The three joints, and that pose as the initial state."""
    page.get_by_role("tab", name="Pose").click()
    page.locator('.pgraph[data-view="joints"] .joint .cell').first.click()
    for angle, key in (("-1", "Tab"), ("0.7", "Tab"), ("1.3", "Enter")):
        page.keyboard.type(angle)
        page.keyboard.press(key)
    page.wait_for_function("() => Math.abs(pgraph.latest.joints.rows[2].value - 1.3) < 1e-9")
    page.locator('.pgraph[data-view="joints"] button.use').click()


def close(page: Any) -> None:
    """A hinge between the rocker, selected, and the ground closes the loop: the cut joint."""
    page.get_by_role("tab", name="Constraints").click()
    page.locator("button.add-tie").click()
    page.locator('[data-kind="loops revolute"]').click()
    page.locator('.pgraph-banner button:text-is("ground")').click()
    page.locator('.pgraph[data-view="constraints"] .tie.open').wait_for()


def simulate(page: Any) -> None:
    """A free run, and play."""
    page.locator("button.simulate").click()
    page.locator(".summary dd").first.wait_for()
    page.locator("button.play").click()


STEPS: tuple[Callable[[Any], None], ...] = (create, rename, bend, close, simulate)


def main() -> None:
    """Take one picture per step."""
    server = serve(pg.Model.serial(1), port=18091, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)  # software GL is slow
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or sys.exit("needs chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(LONG)
        page.goto(server.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        for k, step in enumerate(STEPS, 1):
            step(page)
            shot(page, HERE / f"tutorial_{k}.png")
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
