"""Fits of five numbers of seven bodies to 2000 noisy samples: time, and how often errors hold.

Errors hold where the true value is within two standard errors: 95.4 % of the time for a normal
distribution. The ellipsoid around all five values holds 95 %.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.simulation.paths import Path, with_numbers

from .measure import Effort, Row, compared
from .scenes import built_in

MINUTES = 4.0
PATHS = (
    "bodies.K1.mass", "bodies.K3.mass", "bodies.K5.mass", "forces.spring.stiffness",
    "bodies.K7.mass",
)  # fmt: skip
FIRST = np.array([1.2, 0.8, 1.2, 1.1, 0.9])  # where a fit starts, over the true values
NOISE = 1e-3  # of the range of a curve
ELLIPSOID = 11.0705  # 95 % of a χ² distribution with five degrees of freedom
OPTIONS: dict[str, Any] = {"method": "dop853", "rtol": 1e-8, "estimate": False}


class Task:
    """Measured curves of all bodies, and a model with other numbers."""

    def __init__(self, samples: int):
        model = built_in("andrews")
        self.t = np.linspace(0.0, 0.03, samples)
        places = [Path(model, path, "bench") for path in PATHS]
        self.true = np.array([place.present for place in places])
        self.model = with_numbers(model, places, list(self.true * FIRST))
        self.curves = self.curves_of(model)
        self.sigma = {name: NOISE * float(np.ptp(x)) for name, x in self.curves.items()}

    def curves_of(self, model: pg.Model) -> dict[str, np.ndarray]:
        """The coordinates of a run."""
        run = pg.simulate(model, t_eval=self.t, t_end=float(self.t[-1]), **OPTIONS)
        names = [body.name for body in model.bodies]
        return {name: run[name] for name in names}

    def noisy(self, seed: int) -> dict[str, np.ndarray]:
        """The curves with noise."""
        rng = np.random.default_rng(seed)
        return {
            name: x + self.sigma[name] * rng.normal(size=len(x)) for name, x in self.curves.items()
        }

    def fit(self, data: dict[str, np.ndarray]) -> pg.Fit:
        """Fit by exact derivatives."""
        free = {path: (0.3 * x, 3.0 * x) for path, x in zip(PATHS, self.true)}
        return pg.fit(self.model, {"t": self.t} | data, free, sigma=self.sigma, **OPTIONS)

    def by_differences(self, data: dict[str, np.ndarray], jac: str) -> np.ndarray:
        """Fit by SciPy's differences."""
        from scipy.optimize import least_squares

        places = [Path(self.model, path, "bench") for path in PATHS]

        def missed(x: np.ndarray) -> np.ndarray:
            found = self.curves_of(with_numbers(self.model, places, list(x)))
            return np.concatenate([(found[n] - data[n]) / self.sigma[n] for n in data])

        bounds: Any = (0.3 * self.true, 3.0 * self.true)
        given: Any = {"jac": jac, "bounds": bounds, "x_scale": "jac"}
        return least_squares(missed, self.true * FIRST, **given).x


def rows(effort: Effort) -> Iterator[Row]:
    task = Task(effort.pick(2000, 20))
    data = task.noisy(0)
    found = np.array([*task.fit(data).values.values()])
    off = np.abs(found / task.by_differences(data, "3-point") - 1.0).max()
    sides = {
        "pgraph.fit": lambda: task.fit(data),
        "two-point differences": lambda: task.by_differences(data, "2-point"),
        "three-point differences": lambda: task.by_differences(data, "3-point"),
    }
    case, rounds = f"Andrews' mechanism, {len(task.t)} samples", effort.pick(5, 1)
    yield from compared(effort, case, sides, agrees=f"values {off:.0e}", rounds=rounds)
    yield from coverage(task, effort.pick(100, 2))


def coverage(task: Task, seeds: int) -> Iterator[Row]:
    """A row for each number, and one for all of them."""
    fits = [task.fit(task.noisy(seed)) for seed in range(1, seeds + 1)]
    off = np.array([[*fit.values.values()] for fit in fits]) - task.true
    errors = np.array([[*fit.errors.values()] for fit in fits])
    held = (np.abs(off) <= 2.0 * errors).sum(axis=0).tolist()
    inside = [
        bool(x @ np.linalg.solve(fit.covariance, x) <= ELLIPSOID) for x, fit in zip(off, fits)
    ]
    for name, count in (*zip(PATHS, held), ("all in the ellipsoid", sum(inside))):
        yield {"number": name, "noise seeds": seeds, "held": count}
