"""The error of a run, from a second, coarser one."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..packing.system import Array, Ints
from .plan import Plan
from .recording import Progress, Recording

LOOSER = 32.0  # tolerance of the run that the error estimate compares with
EQUAL = 1e-9  # relative difference of widths of steps that are the same
UNKNOWN = (
    "its error is not estimated, because a function gives its torques; compare it with a second "
    "run at half the step, or at a tighter rtol"
)
COMPARED = 65  # frames at most, where frames cost time of their own


def error_estimate(record: Recording, q: Array, v: Array, progress: Progress) -> float:
    """Largest error of q over the run [rad, m], from a second, coarser one.

    The difference of the two runs over the factor by which their errors differ: twice the step,
    or LOOSER times the tolerance. (Adding up the errors of steps would miss how unstable motion
    makes them grow.) nan if torques come from a function, which is not called a second time, or
    if the second run fails. Where tables bend inside fixed steps, the error depends on where in
    the step they do: the estimate adds the difference to a run whose steps end there.
    """
    if record.user is not None:
        return float("nan")
    if len(record.plan.kinks) == 0:
        return _by_coarser(record, q, v, progress)
    bent = _again(record, _onto_corners(record.plan), q, v, progress)
    if not bent.ended.ok:
        return float("nan")
    theirs = bent.out.q[np.searchsorted(bent.plan.times, record.plan.times)]
    return float(np.max(np.abs(record.out.q - theirs))) + _by_coarser(bent, q, v, progress)


def _by_coarser(record: Recording, q: Array, v: Array, progress: Progress) -> float:
    """Largest error of q, from the same run at wider steps."""
    found = _coarser(record.plan)
    if found is None:
        return float("nan")
    coarser, ratio = found
    coarse = _again(record, coarser, q, v, progress)
    if not coarse.ended.ok:
        return float("nan")
    mine = record.out.q[np.searchsorted(record.plan.times, coarser.times)]
    return float(np.max(np.abs(coarse.out.q - mine), initial=0.0)) / (ratio - 1.0)


def _again(record: Recording, plan: Plan, q: Array, v: Array, progress: Progress) -> Recording:
    """The run of another plan."""
    again = type(record)(record.mech, plan, q, v, record.tau)
    again.run(progress and (lambda _: progress(1.0)))
    return again


@lru_cache(maxsize=16)
def _coarser(plan: Plan) -> tuple[Plan, float] | None:
    """The same run, cheaper, and how many times larger its error is; None for a single step."""
    if plan.tolerance is None and int(plan.substeps.sum()) < 2:
        return None
    power = plan.method.order
    cuts = np.searchsorted(plan.times, [*(change.t for change in plan.changes), *plan.kinks])
    few = np.linspace(0, len(plan.times) - 1, COMPARED).astype(int)
    some = plan.times[np.union1d(few, cuts)]
    if plan.tolerance is not None:
        given = plan.tolerance
        if given.fixed:
            twice = given._replace(widest=2 * given.widest)
            return replace(plan, times=some, tolerance=twice), 2.0**power
        loose = given._replace(rtol=LOOSER * given.rtol, atol=LOOSER * given.atol)
        return replace(plan, times=some, tolerance=loose), LOOSER
    if int(plan.substeps.max()) == 1:  # every second frame, so that kinks of tables stay steps
        keep = np.union1d(np.arange(0, len(plan.times), 2), [*cuts, len(plan.times) - 1])
        times, count = plan.times[keep], np.ones(len(keep) - 1, dtype=np.int64)
    else:
        times, count = plan.times, -(-plan.substeps // 2)
    width = np.diff(times) / count
    ratio = float(width.max() / plan.width.max())
    times, count, width = _thinned(times, count, width, plan.times[cuts])
    return replace(plan, times=times, substeps=count, width=width), ratio**power


def _thinned(times: Array, count: Ints, width: Array, kept: Array) -> tuple[Array, Ints, Array]:
    """The same steps with about COMPARED frames, those at the times `kept` among them.

    Frames are joined only where the steps between them are equally wide.
    """
    group = len(count) // (COMPARED - 1)
    if group < 2 or np.ptp(width) > EQUAL * width[0]:
        return times, count, width
    firsts = np.union1d(np.arange(0, len(count), group), np.searchsorted(times[:-1], kept))
    firsts = firsts[firsts < len(count)]
    some = times[np.append(firsts, len(count))]
    steps = np.add.reduceat(count, firsts)
    return some, steps, np.diff(some) / steps


def _onto_corners(plan: Plan) -> Plan:
    """The same run at fixed steps that end at corners of tables too."""
    times = np.union1d(plan.times, plan.kinks)
    apart = np.diff(times)
    usual = plan.width[np.searchsorted(plan.times, times[:-1], side="right") - 1]
    substeps = np.maximum(np.ceil(apart / usual - 1e-9), 1).astype(np.int64)
    return replace(plan, times=times, substeps=substeps, width=apart / substeps)
