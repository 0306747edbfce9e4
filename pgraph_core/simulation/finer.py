"""Finer runs that tell the error of a run, and the differences between such runs.

A force that jumps within a step makes an error that depends on how long before that the step began.
A run of half the step makes the same error wherever the jump follows an end that both runs share,
so it ends its steps elsewhere. There still is a time within the step for which both errors are the
same. No jump has three runs agree if the third has the same step, a third of it off: what a step
finds acts from its start, its middle or its end on, and no two of these meet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..dynamics.states import differences
from ..packing import Array, Ints
from ..tolerances import EPS, SOLVED
from .options import FINER
from .plan import RunPlan
from .recording import Recording

FIRST = 0.125 ** np.arange(3.0)  # ends of steps after a shared one, relative to a first step
STRETCH = 4  # steps between times shared with the run of half the step: the last bounces' length


def finer_plan(plan: RunPlan, steps: int, divided: bool) -> RunPlan:
    """Return the plan with each fixed step in two or with a tighter tolerance, given the number of
    steps taken.

    If frames or corners of tables end steps of its own choice, the finer ones end half way from one
    to the next. Given steps that were `divided` followed a tolerance inside.
    """
    given = plan.tolerance
    way = None if plan.way is None else finer_plan(plan.onward(), steps, divided)
    plan = replace(plan, parts=2 * plan.parts, way=way)
    if given is None:
        return plan
    finer = given._replace(most=int(FINER) * (steps + len(plan.times)))
    if given.fixed and not divided:
        return replace(plan, tolerance=finer)
    ends_run = plan.times[[0, -1]][: 2 * len(plan.corners)]
    frames = ends_run if len(plan.method.tableau.dense) else plan.times  # frames that end steps
    ends = np.union1d(plan.corners, frames)
    wide = np.diff(ends) > SOLVED * float(np.ptp(plan.times)) / steps
    halves = ends[:-1][wide] + 0.5 * np.diff(ends)[wide]
    ahead, after = ends[:-1][~wide], ends[1:][~wide]  # one time, but for rounding
    same = np.append(ahead[np.isin(after, frames)], after[np.isin(ahead, frames)])
    widest = given.widest * (0.5 if given.fixed else 1.0)
    rtol = min(max(given.rtol / FINER, 100.0 * EPS), given.rtol)
    atol = given.atol * rtol / given.rtol
    finer = finer._replace(widest=widest, fixed=False, rtol=rtol, atol=atol)
    corners = np.union1d(np.setdiff1d(plan.corners, same), halves)
    return replace(plan, tolerance=finer, corners=corners)


def no_wider(plan: RunPlan, widest: float) -> RunPlan:
    """Return the plan with this maximum step size [s]."""
    given = plan.tolerance
    assert given is not None
    return replace(plan, tolerance=given._replace(widest=min(given.widest, widest)))


def may_jump(record: Recording, plan: RunPlan) -> bool:
    """Return whether forces may have jumped within steps.

    Those of joint friction and of functions may. Those of contacts and limits of time stepping do
    if one has pushed.
    """
    touching = record.scene.touching
    pushed = touching is not None and touching.tally["force"] > 0.0
    return pushed or record.user is not None or bool((plan.drives.table["friction"] > 0.0).any())


def offset_plan(finer: RunPlan, plan: RunPlan, parts: int) -> RunPlan:
    """Return the finer plan with each step of `plan` in `parts`, offset by a third of a part.

    It records the times at which steps of both runs end: after STRETCH steps or a frame, or for
    equal steps, whose differences at a jump do not pass, after √n of n steps.
    """
    frames = np.append(0.0, np.cumsum(plan.substeps))  # [steps of the plan]
    shared = frames[_shared(plan, STRETCH if parts > 1 else int(np.sqrt(frames[-1])))]
    near = shared[:-1, None] + FIRST / (3.0 * parts)
    ends = np.unique(np.concatenate((shared, *near.T, near[:, 0] + (np.diff(shared) - 1.0))))
    substeps = np.maximum(np.rint(np.diff(ends)), 1.0).astype(np.int64)
    times = np.interp(ends, frames, plan.times)
    width = np.diff(times) / substeps
    offset = replace(plan, times=times, substeps=substeps, width=width, parts=parts, shown=None)
    if finer.way is None:
        return offset
    if finer.tolerance is None:
        finer = replace(finer, substeps=substeps, width=width, parts=parts)
    return replace(finer, times=times, way=offset, shown=None)


def _shared(plan: RunPlan, stretch: int) -> Ints:
    """Return the indices of times in `plan` that divide it into stretches with at least so many
    steps.

    Those at which constraints are switched, the first and the last are among them. An error that
    comes and goes within a stretch, as that of the last bounces before rest, leaves no difference.
    """
    steps = np.append(0, np.cumsum(plan.substeps))
    keep = np.searchsorted(steps, np.arange(0, steps[-1], stretch))
    switched = np.searchsorted(plan.times, [change.t for change in plan.changes])
    return np.union1d(np.append(keep, len(steps) - 1), switched)


def apart(record: Recording, finer: Recording, n: int) -> tuple[Array, Array, Array]:
    """Return the angles (n,) [rad], the distances (n,) [m] and the differences (n, nx) of states of
    controls between two runs, at n times of the first.

    If only the first records a time, it is the difference at the next one that both record.
    """
    t, theirs = record.steps.times[:n], finer.steps.times[: finer.done]
    _, i, j = np.intersect1d(t, theirs, assume_unique=True, return_indices=True)
    turned, moved = differences(record.mech.packed.rows, record.out.q[i], finer.out.q[j])
    states = np.abs(record.out.v[i, record.mech.nv :] - finer.out.v[j, record.mech.nv :])
    after = np.minimum(np.searchsorted(i, np.arange(n)), len(i) - 1)
    return turned[after], moved[after], states[after]
