"""Pictures of docs/tutorial.md, taken as its test does it: `python -m docs.pictures.tutorial`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

import pgraph_core as pg
from benchmarks.tutorial import STEPS, Person
from docs.pictures.take import FLAGS, LONG, shot
from pgraph_app.server import serve

HERE = Path(__file__).parent
WIDTH, HEIGHT = 1200, 720


def main() -> None:
    """One picture a step, and the seconds that a person would have taken until then."""
    server = serve(pg.Model.serial(1), port=18091, open_browser=False)
    server.viser.scene.configure_default_lights(cast_shadow=False)  # software GL is slow
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or sys.exit("needs chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(LONG)
        page.goto(server.url)
        page.wait_for_selector("table.bodies tr[data-name]")
        person = Person(page)
        for k, step in enumerate(STEPS, 1):
            person.think()
            step(person)
            print(f"{step.__name__}: {person.seconds:.0f} s")
            shot(page, HERE / f"tutorial_{k}.png")
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
