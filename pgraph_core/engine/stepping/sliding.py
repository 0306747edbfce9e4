"""Sliding along a threshold: a comparison keeps a share of both results if each leads back."""

from ...tolerances import EPS, ROUNDING
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import sweep
from ..motion import opened
from ..records import CHOSEN
from ..signals import (
    SIDE,
)
from .bracket import ROUNDED, TRIALS, narrowed_by, next_try, secant, whole
from .control.clock import try_width
from .control.ends import leave_margin, slide_along
from .margins import (
    SHORTEST,
    blend,
    has_changed,
    instant,
    jumps,
    margin_of,
    step_to,
)
from .state import acceleration_of, size_of_state
from .widths import size_of


@sweep
def beyond(run, code, i, share, w):
    """Take the step of width w with this share. Returns the distance of the end from the threshold,
    on the true side."""
    blend(code, i, share)
    start_again(run)
    step_to(run, code, w)
    return -margin_of(code, i)


@sweep
def start_again(run):
    """Compute the slope at Y with the results of comparisons as they are."""
    if opened_run(run).method[0].starts == 1:
        acceleration_of(run, opened_run(run).control[0].clock.time, at.Y, at.SLOPE)


@sweep
def begins_to_slide(run, code, h):
    """Check whether a comparison that has changed leads to its other side from both."""
    control = opened_run(run).control[0]
    for i in range(0, code.shape[0], 2):
        if jumps(code, i) and has_changed(code, i):
            side = code[i + 1, SIDE]
            share = kept_on(run, code, i, SHORTEST * h)
            if 0.0 < share < 1.0:
                slide_along(control.ends, i, share)
                return True
            code[i + 1, SIDE] = side
            start_again(run)
    return False


@sweep
def kept_on(run, code, i, w):
    """Compute the weight of the true branch for which the margin is zero at width w, or 0 or 1 if
    one branch leads away from the threshold.

    The step is taken with this weight, and BRANCHES receives the difference between the states of
    both branches.
    """
    stages = opened_run(run).stages
    below = beyond(run, code, i, 0.0, w)
    for j in range(stages.shape[1]):
        stages[at.BRANCHES, j] = stages[at.CANDIDATE, j]
    above = beyond(run, code, i, 1.0, w)
    for j in range(stages.shape[1]):
        stages[at.BRANCHES, j] -= stages[at.CANDIDATE, j]
    if above >= 0.0:
        return 1.0
    if below < 0.0:
        beyond(run, code, i, 0.0, w)
        return 0.0
    bracket, ends, share = whole(0.0, 1.0), (below, above), 0.0
    for _ in range(TRIALS):
        share = next_try(bracket, secant(bracket, ends[0], ends[1]), ROUNDED)
        found = beyond(run, code, i, share, w)
        bracket, ends = narrowed_by(bracket, ends, share, found)
        if abs(found) <= ROUNDING * (below - above) or bracket.end - bracket.begin <= ROUNDED:
            break
    return share


@sweep
def slide(run, code, h):
    """Take the step along the margin, in CANDIDATE, or that which leaves it. Returns its width.

    The weights of both branches are constant within a step, so the deviation from the threshold is
    an eighth of the effect of the change of the weights.
    """
    data = opened_run(run)
    control, stages, i = data.control[0], data.stages, data.control[0].ends.slid
    ends = control.ends
    rows, size = opened(data.scene).rows, size_of_state(run)
    while True:
        share = kept_on(run, code, i, h)
        for j in range(stages.shape[1]):
            stages[at.ERROR, j] = 0.125 * (share - ends.share) * stages[at.BRANCHES, j]
        known = size_of(rows, size, stages, at.ERROR)
        if control.error.widths != CHOSEN or not known > 1.0 or h <= instant(control, h):
            break
        h *= 0.5
        try_width(control.clock, h)
    slide_along(ends, i, share)
    if share == 0.0 or share == 1.0:
        code[i + 1, SIDE] *= 1.0 - EPS  # judged again from the next step on
        leave_margin(ends)
    return h
