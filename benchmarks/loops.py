"""Implicit methods at given steps on loops: error and processor time, methods in turn.

`python -m benchmarks.loops` prints the table of docs/methods.md.
"""

from __future__ import annotations

import time

import numpy as np

import pgraph_core as pg
import pgraph_models

METHODS = ("generalised_alpha", "ros2", "radau5")
ROUNDS = 7
SCENES = {  # duration [s] and numbers of steps
    "andrews": (0.03, (600, 2400)),
    "four_bar": (1.0, (200, 800)),
    "slider_crank": (0.5, (200, 800)),
}


def main() -> None:
    """Print the table."""
    print("| motion | steps | method | error | evaluations | processor time |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, (t_end, counts) in SCENES.items():
        model = pg.Model.load(pgraph_models.path(name))
        mech, scenario = pg.Mechanism(model), next((s.name for s in model.scenarios), None)
        options = {"t_end": t_end, "scenario": scenario, "frames": 2, "estimate": False}
        known = pg.simulate(mech, method="dop853", rtol=1e-12, **options).q[-1]
        for count in counts:
            given = {"step": t_end / count, **options}
            runs = {m: pg.simulate(mech, method=m, **given) for m in METHODS}
            least = dict.fromkeys(METHODS, np.inf)
            for _ in range(ROUNDS):
                for method in METHODS:
                    began = time.thread_time()
                    pg.simulate(mech, method=method, **given)
                    least[method] = min(least[method], time.thread_time() - began)
            for method, run in runs.items():
                error = np.abs(run.q[-1] - known).max()
                print(
                    f"| {name} | {count} | {method} | {error:.1e} | "
                    f"{run.counters['evaluations']} | {1e3 * least[method]:.1f} ms |"
                )


if __name__ == "__main__":
    main()
