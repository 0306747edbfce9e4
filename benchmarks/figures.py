"""A step of a living figure in the browser against the same step in Python.

Both take the same steps from the same state in short blocks, of which the shortest counts: other
programs only add to it. The browser first gets time to compile the kernels well.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pgraph_core as pg
from pgraph_core.live.export import page, recorded

from .measure import Effort, Row
from .scenes import STEP, built_in

MINUTES = 2.0
NEEDS = ("playwright",)
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
CASES = {  # model, scenario, steps of a block
    "pendulum": ("pendulum", None, 4000),
    "double pendulum": ("double_pendulum", None, 3000),
    "four-bar": ("four_bar", "turn", 400),
    "stance": ("quadruped", "stance", 120),
    "trot": ("quadruped_hips", "trot", 310),  # half a stride and more
    "bound": ("quadruped", "bound", 310),
}
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


def rows(effort: Effort) -> Iterator[Row]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        path = next(filter(None, map(shutil.which, BROWSERS)), None)  # None: Playwright's own
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for case in list(CASES)[: effort.pick(None, 1)]:
            yield measured(effort, browser, case, *CASES[case])
        browser.close()


def measured(
    effort: Effort, browser: Any, case: str, name: str, scenario: str | None, block: int
) -> Row:
    """A page, and seconds per step in Python and in the browser, in turns."""
    model = built_in(name)
    run = recorded(model, scenario)
    method = run.header["method"] if run.header["step"] else "rk4"  # at fixed steps
    stepper = pg.Stepper(model, step=STEP, method=method, scenario=scenario)
    blocks = effort.pick(30, 2)
    asked = {"method": method, "step": STEP, "block": block, "blocks": blocks}
    asked["warm"] = effort.pick(1.5, 0.01)
    here, there = [], []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "page.html")
        file.write_text(page(run), encoding="utf-8")
        shown = browser.new_page()
        shown.goto(file.as_uri())
        shown.wait_for_selector("body[data-ready=live]")
        for _ in range(effort.pick(3, 1)):
            there.append(shown.evaluate(BLOCKS_THERE, asked))
            stepper.reset()
            for _ in range(blocks):
                began = time.perf_counter()
                stepper.step(n=block)
                here.append(time.perf_counter() - began)
        shown.close()
        size = file.stat().st_size
    ours, theirs = min(here) / block, min(there) / block
    return {
        "case": case, "page [MB]": size / 1e6, "Python [us]": 1e6 * ours,
        "browser [us]": 1e6 * theirs, "Python / browser": ours / theirs,
        "times real time": STEP / theirs,
    }  # fmt: skip
