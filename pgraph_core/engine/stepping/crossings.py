"""Comparisons of the motion end steps, as comparisons of time do.

A step is taken with the results that all comparisons in expressions have at its start, those within
min, max and abs too, and ends where the margin of one, its left side minus its right one, changes
its sign. Each step is therefore smooth, and each branch is only evaluated in its own domain.

If a margin may change its sign and its rate may vanish within an interval (`ranges`), the interval
is shortened.
"""

import math

from ...tolerances import ROUNDING
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, part, sweep
from ..motion import opened
from ..records import CHOSEN
from ..signals import HELD_FROM
from .bracket import ROUNDED, locating
from .control.ends import end_pieces, pass_piece, release_sides, set_clear, set_least
from .margins import (
    BEGIN_MARGIN,
    CHANGED,
    CLEAR,
    RESTS,
    SHORTEST,
    SIDES,
    UNDECIDED,
    has_changed,
    instant,
    is_jump,
    keep,
    note_near_side,
    release,
    rests,
    see,
    sides,
    step_to,
    take_sides,
    watch_sides,
)
from .measured import hold
from .minima import turning
from .ranges import bend, judged, look_ahead
from .sliding import begins_to_slide, slide
from .state import STEP

MOST_INTERVALS = 256  # parts of a step: for a margin that is at its bound all the way
RATELESS = math.sqrt(ROUNDED)  # fraction of a step below which a start at zero rate is rounding
GROWTH = 16  # factor for the smallest width while branches alternate

located = locating(SIDES)
turn_beyond = turning(SIDES, is_jump, note_near_side)


@kernel(STEP, nogil=True, later=True)
def cross(run, h):
    """Return the width of the step in CANDIDATE, which is shortened if a comparison changes before
    its end.

    With h = 0, the results at Y are held from now on. With h < 0, results are not held in this
    step.
    """
    data = opened_run(run)
    control, code = data.control[0], opened(data.scene).loads.signals[0]
    clock, ends = control.clock, control.ends
    if h <= 0.0:
        release_sides(ends)
        release(code)
        if h == 0.0:
            take_sides(run, code)
        hold(data.scene, code)
        return 0.0
    see(run, code, at.Y, clock.time)
    keep(code)
    see(run, code, at.CANDIDATE, clock.time + h)
    set_clear(ends, -math.inf)
    if ends.slid > 0:
        h = slide(run, code, h)
    bend(run, code, h)
    found = judged(code, clock.time, 1.0, h)
    if found == CLEAR or found == RESTS:
        if ends.slid == 0:
            look_ahead(run, code, h)
        return h
    begin, end = first_change(run, code, h)
    if end == 0.0:
        calm(control)
        end_pieces(ends)
        return h
    for i in range(0, code.shape[0], 2):
        code[i + 1, BEGIN_MARGIN] = abs(code[i + 1, BEGIN_MARGIN])
    watch_sides(code)
    return ended(run, h, begin + located(run, code.T, begin, end - begin, instant(control, h)))


@part
def any_jumps(run, code):
    """Check whether a comparison has changed with which a value jumps."""
    found = False
    for i in range(0, code.shape[0], 2):
        found = found or is_jump(run, code.T, i + 1)
    return found


@sweep
def leaves(run, code, begin, end):
    """Check whether a comparison that is at its threshold at both ends of a part leaves it between.

    The program is evaluated at the end of the part before and after.
    """
    step_to(run, code, 0.5 * (begin + end))
    found = False
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM and abs(code[i + 1, BEGIN_MARGIN]) <= ROUNDING * sides(code, i):
            found = found or (has_changed(code, i) and not rests(code, i))
    step_to(run, code, end)
    return found


@sweep
def first_change(run, code, h):
    """Compute (begin, end) of the first part of the step in which a comparison changes, or (0, 0).

    The program is evaluated at its end.
    """
    begin, end, share = 0.0, h, 1.0
    looks, t = 0, opened_run(run).control[0].clock.time
    while begin < h:
        looks += 1
        found = judged(code, t + begin, (end - begin) / h, end - begin)
        if found == RESTS and leaves(run, code, begin, end):
            found = UNDECIDED
        if found == UNDECIDED and share > SHORTEST and looks < MOST_INTERVALS:
            share *= 0.5
        else:
            if found == CHANGED or (found == UNDECIDED and watch_sides(code)):
                return begin, end
            keep(code)
            begin = end
            share = 1.0 if looks >= MOST_INTERVALS else min(2.0 * share, 1.0)
        if begin < h:
            end = min(begin + share * h, h)
            step_to(run, code, end)
    return 0.0, 0.0


@sweep
def ended(run, h, w):
    """End the step at width w, or later if both branches lead back to the threshold immediately.
    Returns its width.

    The width then increases up to the full step, or up to the part within the tolerance. A finer
    run divides the way to w into its parts.
    """
    control, code = opened_run(run).control[0], opened(opened_run(run).scene).loads.signals[0]
    ends = control.ends
    pass_piece(ends)
    if ends.pieces > 0:
        w /= ends.pieces + 1
        step_to(run, code, w)
        return w
    least = max(instant(control, h), ends.shut)
    soon = w <= max(least, RATELESS * h)
    step_to(run, code, w)
    if soon and ends.slid == 0 and begins_to_slide(run, code, h):
        return slide(run, code, SHORTEST * h)
    if soon:
        w = max(w, min(least, h))
        most = control.error.rtol * h if control.error.widths == CHOSEN else h
        set_least(ends, min(GROWTH * least, most))
    else:
        calm(control)
        if any_jumps(run, code):
            turn_beyond(run, code.T, h, w)
    step_to(run, code, w)
    release_sides(ends)
    return w


@part
def calm(control):
    """Make steps narrower again after one that was not the least."""
    set_least(control.ends, control.ends.shut / GROWTH)
