"""A scene of the fuzz test: a model with a known motion, and settings of its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pgraph_core.model import Body, Model
from pgraph_core.packing import Array

Rng = np.random.Generator
Known = Callable[[Array], Array]  # q (n, nq) at times (n,)
NO_KNOTS = np.zeros(0)
NONE = np.zeros((3, 3))  # inertia of a point mass
ROUNDED = 1e-11  # rounding of closed forms and runs, relative to the motion
INTEGRATED = 1e-9  # error of SciPy's integration, relative to the motion
SOLVED = 1e-8  # error of the solution of impulses, relative to the motion
SMOOTH: tuple[dict[str, Any], ...] = (
    {"method": "dopri5", "rtol": 1e-6}, {"method": "dop853", "rtol": 1e-10},
    {"method": "dop853", "rtol": 1e-4}, {"method": "radau5", "rtol": 1e-6},
    {"method": "rk4", "parts": 100},
    {"method": "rk4", "parts": 1000}, {"method": "semi_implicit_euler", "parts": 1000},
    {"method": "radau5", "parts": 100}, {"method": "dop853", "parts": 20},
    {"method": "radau5", "parts": 20, "frames": 21},
    {"method": "rk4", "parts": 50, "frames": 51},
)  # fmt: skip
TOUCHING: tuple[dict[str, Any], ...] = ({"rtol": 1e-8}, {"method": "rk4", "parts": 500})


class KnownRun(NamedTuple):
    """A run whose motion is known."""

    family: str
    what: str  # its numbers
    model: Model
    t_end: float
    known: Known | None  # None: a far finer run knows
    others: tuple[dict[str, Any], ...] = SMOOTH  # settings besides the default
    floor: float = ROUNDED  # negligible error relative to the motion
    given: Mapping[str, Any] = {}  # options of every run


def scale(rng: Rng, least: float, most: float) -> float:
    """A number whose logarithm is uniform."""
    return float(10.0 ** rng.uniform(np.log10(least), np.log10(most)))


def numbers(**given: float) -> str:
    """The numbers of a scene, as a reader wants them."""
    return ", ".join(f"{name}={value:.4g}" for name, value in given.items())


def without_gravity(*bodies: Body, **fields: Any) -> Model:
    """A model of these bodies."""
    return Model(bodies=bodies, gravity=(0, 0, 0), **fields)


def integrated(
    rate: Callable[[float, Array], Any], start: Sequence[float], t: Array, knots: Array = NO_KNOTS
) -> Array:
    """Return y of y' = rate(t, y) at times t (n, len(start)) by SciPy to 1e-12, with `knots`."""
    from scipy.integrate import solve_ivp

    stops = np.unique(np.concatenate((t[:1], knots[(knots > t[0]) & (knots < t[-1])], t[-1:])))
    y, found = np.array(start, dtype=float), np.zeros((len(t), len(start)))
    for a, b in pairwise(stops.tolist()):
        now = (t >= a) & (t <= b)
        times = np.union1d(t[now], [a, b])
        part = solve_ivp(rate, (a, b), y, "DOP853", times, rtol=1e-13, atol=1e-14).y.T
        found[now] = part[np.searchsorted(times, t[now])]
        y = part[-1]
    return found
