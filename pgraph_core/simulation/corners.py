"""Corners: times at which tables of forces or of followed motions bend."""

from __future__ import annotations

import numpy as np

from ..engine import layout as at
from ..mechanism import Mechanism
from ..system import Array, Drives, Ints, Loads
from .run_plan import RunPlan

AT_END = 1e-6  # of a step: a corner this near its end is there


def corners(
    mech: Mechanism, drives: Drives, loads: Loads, active: Ints, t_start: float, t_end: float
) -> Array:
    """Times within the run at which a table of forces or of a followed motion bends [s]."""
    found = [mech.bends(drives), loads.knots[:, 0]]
    blocks = mech.blocks
    for i in active.tolist() if len(blocks.curves) else ():
        for block in range(blocks.first[i], blocks.first[i + 1]):
            first, count = blocks.blocks_i[block, [at.B_CURVE, at.B_KNOTS]].tolist()
            if count > 0:
                found.append(blocks.curves[first : first + count, 0])
    others = any(len(x) for x in found[1:])
    times = np.unique(np.concatenate(found)) if others else found[0]
    return times[(times > t_start) & (times < t_end)]


def corners_inside(bends: Array, times: Array, width: Array) -> Array:
    """The corners that lie inside steps of given width, and not at their ends."""
    interval = np.searchsorted(times, bends, side="right") - 1
    among = (interval >= 0) & (interval < len(width))
    bends, interval = bends[among], interval[among]
    share = (bends - times[interval]) / width[interval]
    return bends[np.abs(share - np.round(share)) > AT_END]


def onto_corners(plan: RunPlan) -> RunPlan:
    """The same run at steps of given width that end at corners of tables too."""
    times = np.union1d(plan.times, plan.kinks)
    apart = np.diff(times)
    usual = plan.width[np.searchsorted(plan.times, times[:-1], side="right") - 1]
    substeps = np.maximum(np.ceil(apart / usual - 1e-9), 1).astype(np.int64)
    return plan._replace(times=times, substeps=substeps, width=apart / substeps)
