"""The work of searches."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.result.columns import columns_of
from pgraph_core.search.data import measured

from ..core.jobs import Report
from . import Found, Search, drawn
from .known import numbers_of
from .update import full


def searched(now: Search, report: Report) -> Found:
    """Return what the search finds."""
    trials = count(1)
    return SEARCHES[now.asked.kind](now, lambda said, run: report(next(trials), said, run))


Progress = Callable[[str, Any], bool]  # takes what a trial reached, and its run


def bounds(now: Search) -> dict[str, tuple[float, float]]:
    return {one.path: (one.low, one.high) for one in now.asked.free}


def fit(now: Search, progress: Progress) -> Found:
    """Fit the free numbers to the data."""
    asked, present = now.asked, numbers_of(now.model)
    data = {signal: asked.data[column] for column, signal in asked.match.items() if signal}
    columns, _ = measured({"t": asked.data["t"], **data})
    found = pg.fit(
        now.model, columns, bounds(now), progress=lambda values, run: progress("", run),
        **now.request.options,
    )  # fmt: skip
    rows = [(path, present[path], x, found.errors[path]) for path, x in found.values.items()]
    noise = [f"{name}: residuals of {size:.2g}" for name, size in found.noise.items()]
    title, notes = f"Fit, {found.message}", (*found.undetermined, *noise)
    return Found(asked, now.model, title, tuple(rows), notes, drawn(asked, found.run))


def optimise(now: Search, progress: Progress) -> Found:
    """Make the goal least within the limits."""
    asked, present = now.asked, numbers_of(now.model)
    limits = {f"{way} {signal}": (low, high) for way, signal, low, high in asked.limits}
    goal = f"{asked.way} {asked.signal}"
    free = {full(path): pair for path, pair in bounds(now).items()}
    found = pg.optimise(
        now.model, goal, free, subject_to=limits,
        progress=lambda trial, run: progress(f"{goal} = {trial.objective:.4g}", run),
        t_end=now.request.t_end, **now.request.options,
    )  # fmt: skip
    rows = [
        (one.path, present[one.path], x, np.nan)
        for one, x in zip(asked.free, found.values.values(), strict=True)
    ]
    title = f"Least {goal}: {found.objective:.4g}, {found.message}"
    return Found(asked, now.model, title, tuple(rows), found.active, drawn(asked, found.run))


def matters(now: Search, progress: Progress) -> Found:
    """Find how far each number moves a curve, per relative change of the number."""
    asked, present = now.asked, numbers_of(now.model)
    paths = [full(one.path) for one in asked.free]
    request = now.request
    run = pg.simulate(now.model, wrt=paths, t_end=request.t_end, estimate=False, **request.options)
    progress("", run)
    by = run.gradient(lambda run: columns_of(run)[asked.signal].values)
    rows = []
    for one, slope in zip(asked.free, by.values(), strict=True):
        size = abs(present[one.path]) or 1.0
        moved = size * float(np.sqrt(np.nanmean(np.square(slope))))
        rows.append((one.path, present[one.path], present[one.path], moved))
    rows.sort(key=lambda row: -row[3])
    text = "Root mean square change of the curve when the number doubles."
    title = f"What moves {asked.signal}"
    return Found(asked, now.model, title, tuple(rows), (text,), drawn(asked, run))


SEARCHES: dict[str, Callable[[Search, Progress], Found]] = {
    "fit": fit, "optimise": optimise, "matters": matters,
}  # fmt: skip
