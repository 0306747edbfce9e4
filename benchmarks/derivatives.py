"""Derivatives of a run, beside differences of runs as SciPy takes them.

Both are compared with derivatives at a tolerance of 1e-12.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.simulation.paths import Path

from .measure import Effort, Row, compared
from .scenes import built_in

MINUTES = 1.0
SHARE = 2.0**-26  # SciPy's step over the number
CASES: dict[str, tuple[str, ...]] = {
    "double_pendulum": (
        "bodies.upper.mass", "bodies.lower.mass", "bodies.upper.com.2", "bodies.lower.com.2",
        "bodies.lower.link.2", "bodies.lower.com.0", "gravity.2",
    ),
    "four_bar": (
        "bodies.left crank.mass", "bodies.coupler.mass", "bodies.right crank.mass",
        "bodies.left crank.com.1", "bodies.coupler.com.0", "bodies.right crank.com.1", "gravity.1",
    ),
}  # fmt: skip
MOVES = {"four_bar": "turn"}  # scenario of a model that stands still without one


def rows(effort: Effort) -> Iterator[Row]:
    for name, paths in CASES.items():
        yield from case(effort, name, built_in(name), paths, effort.pick(5.0, 0.05))


def case(
    effort: Effort, name: str, model: pg.Model, paths: tuple[str, ...], seconds: float
) -> Iterator[Row]:
    """A row for a plain run, for one and for seven derivatives, and for seven differences."""
    given: dict[str, Any] = {"t_end": seconds, "frames": 101, "estimate": False}
    given |= {"method": "dop853", "scenario": MOVES.get(name)}
    places = [Path(model, path, "bench") for path in paths]

    def run(model: pg.Model = model, **more: Any) -> pg.Result:
        return pg.simulate(model, **given | more)

    def differences() -> np.ndarray:
        here, found = run(), []
        for place in places:
            h = SHARE * (abs(place.present) or 1.0)
            there = run(place.set(model, place.present + h))
            found.append(np.hstack((there.q - here.q, there.v - here.v)) / h)
        return np.array(found)

    def derivatives(**more: Any) -> np.ndarray:
        found = run(wrt=paths, **more)
        return np.array([found.sensitivity(path) for path in paths])

    exact = derivatives(rtol=1e-12)
    size = np.abs(exact).max(axis=(1, 2))
    off = [
        f"{(np.abs(found - exact).max(axis=(1, 2)) / np.maximum(size, 1.0)).max():.0e}"
        for found in (derivatives(), differences())
    ]
    sides = {
        "a plain run": run,
        "one derivative": lambda: run(wrt=paths[:1]),
        "seven derivatives": derivatives,
        "seven differences": differences,
    }
    agrees = f"errors: derivatives {off[0]}, differences {off[1]}"
    return compared(effort, f"{name}, {seconds:g} s", sides, agrees=agrees)
