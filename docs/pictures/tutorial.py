"""Take the pictures of docs/page.md by the steps of its test.

Run it with `python -m docs.pictures.tutorial`.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

import pgraph_core as pg
from docs.pictures.take import FLAGS, LONG, shot
from pgraph_app.server import serve
from tests.app.test_tutorial import STEPS

HERE = Path(__file__).parent
WIDTH, HEIGHT = 1200, 720
PICTURED = (4, 5)  # steps: the closed loop and its motion


def main() -> None:
    """Take the pictures of the steps PICTURED."""
    server = serve(pg.Model.serial(1), port=0, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)  # software GL is slow
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or sys.exit("needs chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(LONG)
        page.goto(server.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        page.evaluate("pgraph.send('SetDisplay', { what: 'angle', value: 'rad' })")
        page.wait_for_function("() => pgraph.latest.properties.display.angle === 'rad'")
        for k, step in enumerate(STEPS, 1):
            step(page)
            if k in PICTURED:
                shot(page, HERE / f"tutorial_{k}.png")
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
