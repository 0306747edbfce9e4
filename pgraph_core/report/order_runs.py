"""The order of each method on the motion of a study, from its rows or from runs made for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..integrators import METHODS
from .errors import rms
from .ladder import Setting
from .orders import levelled, observed_order, step_counts
from .reference import Reference
from .rows import Row
from .sides import outcome
from .task import Progress, Task

Points = list[tuple[float, float]]  # (steps, error)
ENOUGH = 0.2  # s that the last run of a method may take


def orders_of(
    task: Task,
    names: tuple[str, ...],
    rows: list[Row],
    found: Reference,
    watch: Callable[[], Progress],
) -> dict[str, tuple[float | None, float]]:
    """(observed, nominal) order of each of our methods."""
    orders = {}
    for name in names:
        points = [
            (task.t_end / row.step, row.error)
            for row in rows
            if row.method == name and row.step and row.error and not row.limited
        ]
        points = points or at_given_steps(task, name, found, watch)
        orders[name] = observed_order(points), float(METHODS[name].order)
    return orders


def at_given_steps(
    task: Task, name: str, found: Reference, watch: Callable[[], Progress]
) -> Points:
    """Runs of a method at steps that get shorter, until the reference's limit or time.

    They are compared at quarters of the motion, so that frames do not end steps.
    """
    points: Points = []
    last = len(found.t) - 1
    at = np.arange(0, last + 1, last // 4 if last % 4 == 0 else last)
    quarters = replace(task, t=task.t[at])
    for count in step_counts():
        began = time.perf_counter()
        done = outcome(quarters.run(name, Setting(step=task.t_end / count), watch()))
        if done.ok:
            whole = np.repeat(done.q[-1:], last + 1, axis=0)
            whole[at] = done.q
            points.append((count, rms(found.errors(whole)[at])))
        reached = [error for _, error in points]
        below = bool(reached) and reached[-1] < found.limit
        if below or levelled(reached) or time.perf_counter() - began > ENOUGH:
            break
    return points
