"""Who takes part in a study: a method of ours or of a peer, and what one run of it leaves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ..integrators import METHODS, Method
from ..result import Result, Status
from ..system import Array
from .ladder import Setting
from .task import Progress, Task


class Outcome(NamedTuple):
    """One run, whoever made it."""

    q: Array  # (n, nq) in our coordinates, as far as it came
    seconds: tuple[float, float]  # of the stepping loop, by the wall's clock and the processor's
    ok: bool = True
    reason: str = ""  # why not
    counters: Mapping[str, int] = {}
    estimate: float = np.nan  # the run's own error estimate [rad, m]
    energy_drift: float = np.nan
    drift: tuple[float, float] = (np.nan, np.nan)  # of constraints, position and velocity
    gap: float = np.nan  # deepest penetration of contacts [m]
    cancelled: bool = False


class Side(NamedTuple):
    """One curve of the diagram."""

    name: str  # "rk4", "MuJoCo rk4"
    order: float | None
    settings: tuple[Setting, ...]
    run: Callable[[Setting, Progress, bool], Outcome]
    peer: str = ""  # "" for ours


def own_side(task: Task, method: Method, settings: tuple[Setting, ...]) -> Side:
    """A method of ours."""

    def run(setting: Setting, progress: Progress, estimate: bool) -> Outcome:
        return outcome(task.run(method.name, setting, progress, estimate=estimate))

    return Side(method.name, float(method.order), settings, run)


def outcome(run: Result) -> Outcome:
    """What a study keeps of one of our runs."""
    ok = run.status.ok
    drift = run.constraint_drift.max(axis=0, initial=0.0) if len(run.t) else np.full(2, np.nan)
    gaps = [float(-gap.min(initial=0.0)) for gap in run.contact_gap.values()]
    return Outcome(
        run.q,
        (run.timing["step"], run.timing["step_processor"]),
        ok,
        "" if ok else run.message,
        run.counters,
        run.error_estimate,
        run.energy_drift if ok else np.nan,
        (float(drift[0]), float(drift[1])),
        max(gaps, default=np.nan),
        run.status is Status.CANCELLED,
    )


def usual(task: Task) -> tuple[str, ...]:
    """The methods that suit a scene, where none are asked for."""
    if task.impulses:
        return ("moreau_jean", "rk4", "semi_implicit_euler")
    return tuple(name for name in METHODS if name != "moreau_jean")
