"""The two runs of a cell, and when they are recorded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..integrators import Method
from ..mechanism import Mechanism
from ..result import Result
from ..simulation import simulate
from ..system import Array

FRAMES = 41  # evenly over the run
EARLY = 10  # steps at first that are all recorded: there a run blows up
NEWTON = 12  # evaluations of an implicit step beside its Jacobian, about


def steps_of(t_end: float, step: float) -> int:
    """Steps of equal width, at most `step`, that end at `t_end`."""
    return max(int(np.ceil(t_end / step - 1e-9)), 1)


def times_of(t_end: float, step: float) -> Array:
    """When the runs of a cell are recorded: at ends of steps, at first at all."""
    n = steps_of(t_end, step)
    early = np.arange(min(n, EARLY) + 1)
    chosen = np.unique(np.concatenate((early, np.linspace(0, n, FRAMES).round().astype(int))))
    return np.asarray(chosen * (t_end / n), dtype=np.float64)


def evaluations(method: Method, nv: int, t_end: float, step: float) -> int:
    """About how often a run evaluates the dynamics."""
    return steps_of(t_end, step) * per_step(method, nv)


def per_step(method: Method, nv: int) -> int:
    """About how often a step evaluates the dynamics; a Jacobian by differences counts too."""
    return NEWTON + 2 * nv if method.implicit else method.evaluations


def run_at(
    mech: Mechanism,
    method: str,
    step: float,
    halves: int,
    t_end: float,
    stabilise: str | None,
    progress: Callable[[float], Any],
) -> Result:
    """A run at the step over 2^halves, recorded when that at the whole step is."""
    width = t_end / (steps_of(t_end, step) << halves)
    return simulate(
        mech,
        t_end=t_end,
        t_eval=times_of(t_end, step),
        method=method,
        step=width,
        stabilise=stabilise,
        progress=progress,
        estimate=False,
    )
