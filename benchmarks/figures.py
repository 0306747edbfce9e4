"""Speed of a step in the browser over that in Python: `python -m benchmarks.figures`.

Both take the same steps from the same state in short blocks, of which the shortest counts: other
programs only add to it. The browser first gets time to compile the kernels well.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models
from pgraph_core.live.export import page, recorded

from .browser import FLAGS, browser_path
from .machine import machine

CASES = {  # model, scenario, steps of a block
    "pendulum": ("pendulum", None, 4000),
    "double pendulum": ("double_pendulum", None, 3000),
    "four-bar": ("four_bar", "turn", 400),
    "stance": ("quadruped", "stance", 120),
    "trot": ("quadruped_hips", "trot", 310),  # half a stride and more
    "bound": ("quadruped", "bound", 310),
}
WARM, BLOCKS, ROUNDS = 1.5, 30, 3  # [s], in a round, rounds by turns
STEP = 1e-3  # [s]
BLOCKS_THERE = """async ({ method, step, block, blocks, warm }) => {
  if (!window.timed) {
    const given = JSON.parse(document.querySelector("#figure").textContent).engine;
    const engine = await pgraphEngine.Engine.made(given);
    window.timed = await engine.world(method);
  }
  const world = window.timed;
  const restart = () => {
    world.reset();
    world.fresh = true;
    world.interval(Number.MAX_SAFE_INTEGER, step, Infinity);
  };
  for (const end = performance.now() + 1000 * warm; performance.now() < end; ) {
    restart();
    world.advance(block);
  }
  restart();
  let best = Infinity;
  for (let i = 0; i < blocks; i++) {
    const began = performance.now();
    world.advance(block);
    best = Math.min(best, performance.now() - began);
  }
  return best / 1000;
}"""


def measured(browser: Any, name: str, scenario: str | None, block: int) -> tuple[float, ...]:
    """(bytes of the page, seconds of a step in Python, in the browser)."""
    model = pg.Model.load(pgraph_models.path(name))
    run = recorded(model, scenario)
    method = run.header["method"] if run.header["step"] else "rk4"  # at fixed steps
    stepper = pg.Stepper(model, step=STEP, method=method, scenario=scenario)
    asked = {"method": method, "step": STEP, "block": block, "blocks": BLOCKS, "warm": WARM}
    here, there = [], []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "page.html")
        file.write_text(page(run), encoding="utf-8")
        shown = browser.new_page()
        shown.goto(file.as_uri())
        shown.wait_for_selector("body[data-ready=live]")
        for _ in range(ROUNDS):
            there.append(shown.evaluate(BLOCKS_THERE, asked))
            stepper.reset()
            for _ in range(BLOCKS):
                began = time.perf_counter()
                stepper.step(n=block)
                here.append(time.perf_counter() - began)
        shown.close()
        return file.stat().st_size, min(here) / block, min(there) / block


def loading(browser: Any, site: Path) -> float:
    """[s] until the first page of a site is loaded with its figure; the least of five."""
    took = []
    for _ in range(5):
        shown = browser.new_context().new_page()
        shown.goto((site / "index.html").absolute().as_uri())
        took.append(shown.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd"))
        shown.context.close()
    return min(took) / 1000


def main() -> None:
    """Print a table, or how fast a built site loads."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--site", type=Path, help="such as build/site, made by `make site`")
    site = parser.parse_args().site
    if site is not None:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=browser_path(), args=FLAGS)
            print(f"first page loaded in {loading(browser, site):.2f} s")
            browser.close()
        return
    print(", ".join(f"{name}: {value}" for name, value in machine().items()))
    print("| scene | page [MB] | Python [us a step] | browser | ratio | times real time |")
    print("|---|---|---|---|---|---|")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=FLAGS)
        for label, (name, scenario, block) in CASES.items():
            size, here, there = measured(browser, name, scenario, block)
            print(
                f"| {label} | {size / 1e6:.2f} | {1e6 * here:.2f} | {1e6 * there:.2f} | "
                f"{here / there:.2f} | {STEP / there:.0f} |",
                flush=True,
            )
        browser.close()


if __name__ == "__main__":
    main()
