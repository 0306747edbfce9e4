"""Take the pictures of the documents from the running page: `python docs/pictures/take.py`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

import pgraph_core as pg
import static_models
from app.server import serve

HERE = Path(__file__).parent
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 1440, "height": 900}


def take(page: Page, url: str, name: str, *, dark: bool) -> None:
    """The quadruped's stance, run, a leg selected, in the middle of its push."""
    page.goto(url)
    page.wait_for_selector("table.bodies tr[data-name]")
    if dark:
        page.get_by_title("Dark or light").click()
    page.get_by_role("button", name="Simulate").click()
    page.locator(".summary dd").first.wait_for(timeout=120_000)
    page.locator('tr[data-name="right_radius"] td').first.click()
    slider = page.locator('input[type="range"]').first
    slider.evaluate(
        "e => { e.value = 0.6 * e.max; e.dispatchEvent(new Event('input', {bubbles: true})); }"
    )
    close = page.locator(".mantine-Notification-closeButton").first
    if close.is_visible():
        close.click()
    page.wait_for_timeout(1500)  # the picture of software WebGL comes late
    page.screenshot(path=str(HERE / name))


def main() -> None:
    """Both pictures, light and dark."""
    server = serve(pg.Model.load(static_models.path("quadruped")), port=18090, open_browser=False)
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or sys.exit("needs chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for name, dark in (("page.png", False), ("page_dark.png", True)):
            take(browser.new_page(viewport=SIZE), server.url, name, dark=dark)
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
