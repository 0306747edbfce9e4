"""Measurements for reports."""

from __future__ import annotations

from typing import Any

import pgraph_core as pg

from ..core.jobs import Report
from . import Analysis

ROUNDS = 3  # rounds of timing, few because a page waits
LONGEST = 0.5  # [s] limit on the computing time of a run
HORIZON = 1.0  # [s] limit on the motion of a map, which makes hundreds of runs


def settings(now: Analysis) -> dict[str, Any]:
    """Scenario and duration."""
    scenario = now.request.options["scenario"]
    duration = now.reporting.t_end or now.request.t_end
    return {"scenario": scenario, "t_end": duration, "target": now.reporting.target}


def measured(job: Analysis, progress: Report) -> object:
    """Return the requested report."""
    return MEASURES[job.kind](job, progress)


def precision(now: Analysis, progress: Report) -> object:
    """Measure error versus run time for all suitable methods."""
    mech = pg.Mechanism(now.model)
    return pg.work_precision(
        mech, rounds=ROUNDS, longest=LONGEST, progress=progress, **settings(now)
    )


def stability(now: Analysis, progress: Report) -> object:
    """Test the stability of the methods over the first part of the run."""
    given = settings(now)
    given["t_end"] = now.reporting.t_end or min(given["t_end"], HORIZON)
    return pg.stability_map(now.model, axis=now.reporting.axis or None, progress=progress, **given)


MEASURES = {"precision": precision, "stability": stability}
