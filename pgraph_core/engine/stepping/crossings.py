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
from ..signals import (
    HELD_FROM,
    NEAREST,
    SIDE,
    WHEN,
)
from .control.ends import end_pieces, pass_piece, release_sides, set_clear, set_least
from .margins import (
    BEGIN_MARGIN,
    CHANGED,
    CLEAR,
    END_MARGIN,
    MARGIN_CHANGE,
    RESTS,
    ROUNDED,
    SHORTEST,
    TRIALS,
    UNDECIDED,
    any_changed,
    has_changed,
    instant,
    jumps,
    keep,
    margin_of,
    release,
    rests,
    see,
    sides,
    step_to,
    take_sides,
)
from .measured import (
    hold,
)
from .ranges import SPAN, bend, judged, look_ahead
from .sliding import begins_to_slide, slide
from .state import STEP

MOST_INTERVALS = 256  # parts of a step: for a margin that is at its bound all the way
RATELESS = math.sqrt(ROUNDED)  # fraction of a step below which a start at zero rate is rounding
GROWTH = 16  # factor for the smallest width while branches alternate


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
    return ended(run, h, located(run, code, h, begin, end))


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


# -- bounds ---------------------------------------------------------------------------------------


# -- location -------------------------------------------------------------------------------------


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
            if found == CHANGED or (found == UNDECIDED and any_changed(code)):
                return begin, end
            keep(code)
            begin = end
            share = 1.0 if looks >= MOST_INTERVALS else min(2.0 * share, 1.0)
        if begin < h:
            end = min(begin + share * h, h)
            step_to(run, code, end)
    return 0.0, 0.0


@sweep
def located(run, code, h, begin, end):
    """Compute the width at which the first comparison has changed, between begin and end.

    Secants [Illinois, Dowell and Jarratt 1971] and bisection end where margins that have changed
    are zero up to rounding.
    """
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM:
            code[i + 1, END_MARGIN] = margin_of(code, i)
            code[i + 1, MARGIN_CHANGE] = abs(code[i + 1, END_MARGIN] - code[i + 1, BEGIN_MARGIN])
    low, high, last = begin, end, end
    left, right, apart = 1.0, 1.0, instant(opened_run(run).control[0], h)
    for n in range(TRIALS):
        if high - low <= apart or (last == high and reached(code)):
            break
        w = high
        for i in range(0, code.shape[0], 2):
            if code[i, 0] >= HELD_FROM and code[i + 1, SIDE] * code[i + 1, END_MARGIN] >= 0.0:
                a, b = left * abs(code[i + 1, BEGIN_MARGIN]), right * abs(code[i + 1, END_MARGIN])
                w = min(w, low + (high - low) * (a / (a + b) if a + b > 0.0 else 0.0))
        w += 0.5 * apart
        if n % 4 == 3 or not low < w < high:
            w = 0.5 * (low + high)
        step_to(run, code, w)
        last = w
        if any_changed(code):
            for i in range(0, code.shape[0], 2):
                if code[i, 0] >= HELD_FROM:
                    code[i + 1, END_MARGIN] = margin_of(code, i)
            left, right = (0.5 * left if high < end else 1.0), 1.0
            high = w
        else:
            keep(code)
            left, right = 1.0, (0.5 * right if low > begin else 1.0)
            low = w
    return high


@sweep
def reached(code):
    """Check whether every margin that has changed its sign is zero up to rounding."""
    found = True
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM and has_changed(code, i):
            least = ROUNDED * max(code[i + 1, MARGIN_CHANGE], sides(code, i))
            found = found and abs(margin_of(code, i)) <= least
    return found


# -- steps ----------------------------------------------------------------------------------------


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
        turn_beyond(run, code, h, w)
    step_to(run, code, w)
    release_sides(ends)
    return w


@sweep
def turn_beyond(run, code, h, w):
    """Keep how far beyond zero a jump that occurs at width w would turn back if nothing changed.

    It is the minimum of a parabola through three values of the margin close to w.
    """
    begin, end = beside(w, h)
    jump = False
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM:
            now = jumps(code, i) and has_changed(code, i)
            code[i + 1, MARGIN_CHANGE] = -code[i + 1, SIDE] if now else 0.0
            jump = jump or now
    if not jump:
        return
    if begin < w:
        step_to(run, code, begin)
    keep(code)
    step_to(run, code, 0.5 * (begin + end))
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM:
            code[i + 1, END_MARGIN] = margin_of(code, i)
    step_to(run, code, end)
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM and code[i + 1, MARGIN_CHANGE] != 0.0:
            side = code[i + 1, MARGIN_CHANGE]
            y = (
                side * code[i + 1, BEGIN_MARGIN],
                side * code[i + 1, END_MARGIN],
                side * margin_of(code, i),
            )
            _, least = vertex((0.0, 0.5, 1.0), y)
            if -least < code[i, NEAREST] and least < 0.0:
                code[i, NEAREST], code[i, WHEN] = -least, opened_run(run).control[0].clock.time + w


@part
def beside(w, h):
    """Compute (begin, end) of a part of a step that ends or begins at w, for second differences."""
    return (w - SPAN * h, w) if 2.0 * w > h else (w, w + SPAN * h)


@part
def vertex(x, y):
    """Return the minimum (x, y) of a parabola through three points, or (-1, inf) if it has none."""
    slope = (y[1] - y[0]) / (x[1] - x[0])
    curve = ((y[2] - y[1]) / (x[2] - x[1]) - slope) / (x[2] - x[0])
    if not curve > 0.0:
        return -1.0, math.inf
    least = 0.5 * (x[0] + x[1] - slope / curve)
    return least, y[0] + (least - x[0]) * (slope + curve * (least - x[1]))


@part
def calm(control):
    """Make steps narrower again after one that was not the least."""
    set_least(control.ends, control.ends.shut / GROWTH)


# -- sliding --------------------------------------------------------------------------------------
