"""Motions that are known: how near a run comes, and a case of one's own."""

import json
import tempfile
from pathlib import Path

import pgraph_core as pg
import pgraph_models

print(len(pgraph_models.case_names()), "cases come with Pgraph, such as")
for case in (*pgraph_models.cases("heavy_top"), *pgraph_models.cases("pendulum_scales")):
    verdict = pg.verify(case)
    print(f"{case.name:24} error {verdict.error:.1e} of {verdict.observable.target:.0e} allowed")

# The same case by another method: its run, compared by its observables.
(top,) = pgraph_models.cases("heavy_top")
run = top.motion(method="rk4", step=2e-4, rtol=None)
for observable in top.observables:
    print(f"rk4, {observable.name:16} error {observable.errors(run).max():.1e}")

# A case file is data: a model, how it is run, what is compared with which numbers.
ball = {
    "name": "falling",
    "description": "a body falls for a second",
    "why_hard": "it is not",
    "how_obtained": "g t² / 2",
    "estimated_accuracy": 1e-16,
    "t": [0.0, 0.5, 1.0],
    "reference": {"z": [0.0, -1.22625, -4.905]},
    "cases": [
        {
            "model": {"bodies": [{"name": "ball", "joint": "free", "inertia": [1, 1, 1]}]},
            "run": {"method": "dopri5"},
            "observables": [
                {"kind": "point", "body": "ball", "axes": "z", "reference": "z", "target": 1e-12}
            ],
        }
    ],
}
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "falling.json"
    file.write_text(json.dumps(ball), encoding="utf-8")
    (case,) = pg.load_cases(file)
print("my own case is met:", pg.verify(case).ok)
