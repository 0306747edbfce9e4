"""Further runs with step ends offset from those of a run, and the differences between these runs.

A force that jumps within a step makes an error that depends on how long before that the step began.
A run of half the step makes the same error wherever the jump follows an end that both runs share,
so it ends its steps a quarter of a step off. There still is a time within the step for which both
errors are the same. No jump has three runs agree if the third has the same step, half of it off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..dynamics.states import differences
from ..packing import Array, Ints
from .options import steps_between
from .plan import RunPlan
from .recording import Recording

FIRST = 0.125 ** np.arange(3.0)  # ends of steps after a shared one, relative to a first step
STRETCH = 4  # steps between times shared with the run of half the step: the last bounces' length


def may_jump(record: Recording, plan: RunPlan) -> bool:
    """Return whether forces may have jumped within steps.

    Those of joint friction and of functions may. Those of contacts and limits of time stepping do
    if one has pushed.
    """
    touching = record.scene.touching
    pushed = touching is not None and touching.tally["force"] > 0.0
    return pushed or record.user is not None or bool((plan.drives.table["friction"] > 0.0).any())


def offset_plan(finer: RunPlan, plan: RunPlan, parts: int) -> RunPlan:
    """Return the finer plan with steps a `parts`-th the size of those in `plan`, offset by half a
    step.

    It records the times at which steps of both runs end: after STRETCH steps or a frame, or for
    equal steps, whose differences at a jump do not pass, after √n of n steps.
    """
    frames, half = np.append(0.0, np.cumsum(plan.substeps)), 0.5 / parts  # [steps of the plan]
    shared = frames[_shared(plan, STRETCH if parts > 1 else int(np.sqrt(frames[-1])))]
    near = (shared[:-1, None] + half * FIRST).ravel()
    ends = np.unique(np.concatenate((shared, near, shared[1:] - half)))
    substeps = np.maximum(np.rint(parts * np.diff(ends)), 1.0).astype(np.int64)
    times = np.interp(ends, frames, plan.times)
    width = np.diff(times) / substeps
    offset = replace(plan, times=times, substeps=substeps, width=width, parts=2, shown=None)
    if finer.way is None:
        return offset
    finer = replace(finer, times=times, way=offset, shown=None)
    if finer.tolerance is not None:
        return finer
    substeps, width = steps_between(times, float(finer.width.max(initial=0.0)))
    return replace(finer, substeps=substeps, width=width)


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
