"""Speed of a step in the browser over that in Python: `python -m benchmarks.figures`.

Both take the same runs in turn, as whole calls; of each the shortest time counts, since other
programs only add to it. The browser first gets time to compile the kernels well.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models
from pgraph_core.live.export import page, recorded

from .browser import FLAGS, browser_path
from .machine import machine

CASES = {  # model, scenario, duration of a run [s]
    "pendulum": ("pendulum", None, 20.0),
    "double pendulum": ("double_pendulum", None, 20.0),
    "four-bar": ("four_bar", "turn", 10.0),
    "stance": ("quadruped", "stance", 2.0),
    "trot": ("quadruped_hips", "trot", 2.0),
    "bound": ("quadruped", "bound", 2.0),
}
WARM, ROUNDS = 6, 12
STEP = 1e-3  # [s]
TIMED = """async (options) => {
  const began = performance.now();
  await pgraph_live.simulate(options);
  return (performance.now() - began) / 1000;
}"""


def measured(browser: Any, name: str, scenario: str | None, t_end: float) -> tuple[float, ...]:
    """(bytes of the page, seconds in Python, in the browser)."""
    model = pg.Model.load(pgraph_models.path(name))
    mech, run = pg.Mechanism(model), recorded(model, scenario)
    method = run.header["method"]
    options: dict[str, Any] = {"t_end": t_end, "step": STEP, "method": method}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "page.html")
        file.write_text(page(run), encoding="utf-8")
        shown = browser.new_page()
        shown.goto(file.as_uri())
        shown.wait_for_selector("body[data-ready=live]")
        here, there = [], []
        for _ in range(WARM + ROUNDS):
            began = time.perf_counter()
            pg.simulate(mech, scenario=scenario, estimate=False, **options)
            here.append(time.perf_counter() - began)
            there.append(shown.evaluate(TIMED, options))
        shown.close()
        return file.stat().st_size, min(here[WARM:]), min(there[WARM:])


def main() -> None:
    """Print a table."""
    from playwright.sync_api import sync_playwright

    print(", ".join(f"{name}: {value}" for name, value in machine().items()))
    print("| scene | page [MB] | Python [us a step] | browser | ratio | times real time |")
    print("|---|---|---|---|---|---|")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=FLAGS)
        for label, (name, scenario, t_end) in CASES.items():
            size, here, there = measured(browser, name, scenario, t_end)
            a, b = (1e6 * seconds * STEP / t_end for seconds in (here, there))
            print(
                f"| {label} | {size / 1e6:.2f} | {a:.2f} | {b:.2f} | {a / b:.2f} | "
                f"{t_end / there:.0f} |"
            )
        browser.close()


if __name__ == "__main__":
    main()
