"""Remedies for steps that are too large, which the method of the run takes."""

from __future__ import annotations

from ..integrators import DOP853, RADAU5
from .run_plan import RunPlan


def more_accurate(plan: RunPlan) -> str:
    """Return what to give a run to make it more accurate."""
    if plan.tolerance is not None:
        return "a smaller rtol"
    return f"a smaller step{or_by_error(plan)}"


def by_error(plan: RunPlan) -> str:
    """Return what lets a run with fixed steps choose them by their error, "" in time stepping.

    Steps of time stepping have no error that is known.
    """
    if plan.method.time_stepping:
        return ""
    if plan.method.adaptive:
        return "rtol= for adaptive steps"
    other = RADAU5 if plan.method.implicit else DOP853
    return f"method='{other.name}' with rtol= for adaptive steps"


def or_by_error(plan: RunPlan) -> str:
    """Return the end of a sentence, which begins with a comma or is empty."""
    other = by_error(plan)
    return f", or {other}" if other else ""
