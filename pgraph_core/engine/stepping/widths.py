"""Widths of steps: the first one, what ends a step early, and the controller of all errors."""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..motion import opened
from ..vec import finite
from .attempt import EPS, NOT_SOLVED, copied, slope
from .scales import size_of, weigh


@sweep
def first_width(scene, accelerate, size, order, stages, control, flow):
    """A width for the first step, from how fast y and y' change, without a unit."""
    settings, _, counters = control
    rows = opened(scene)[0]
    n = stages.shape[1]
    copied(stages, at.Y, at.CANDIDATE, n)
    weigh(rows, size, stages, settings)
    rtol = settings[at.RTOL]
    shrink = (0.01 * rtol) ** (1.0 / (order + 1))
    fastest = max(size_of(rows, size, stages, at.SLOPE) * rtol, 1.0 / settings[at.SPAN])
    h = 0.01 / fastest
    for i in range(n):
        stages[at.CANDIDATE, i] = stages[at.Y, i] + h * stages[at.SLOPE, i]
    t = settings[at.TIME]
    slope(scene, accelerate, t + h, size, stages, at.CANDIDATE, at.ERROR, flow, counters)
    if not finite(stages[at.ERROR]):
        return 0.1 * shrink * h
    weigh(rows, size, stages, settings)
    for i in range(n):
        stages[at.ERROR, i] = (stages[at.ERROR, i] - stages[at.SLOPE, i]) / h
    bend = math.sqrt(size_of(rows, size, stages, at.ERROR) * rtol)
    return shrink / max(fastest, bend)


@sweep
def next_width(settings, flags, corners, stop):
    """(width of the next step, whether it ends at `stop` or a corner of a table, at a corner)."""
    t = settings[at.TIME]
    k = flags[at.KNOT]
    while k < corners.shape[0] and corners[k] <= t:
        k += 1
    flags[at.KNOT] = k
    corner = k < corners.shape[0] and corners[k] <= stop
    end = corners[k] if corner else stop
    left = end - t
    h = (
        settings[at.WIDEST]
        if flags[at.FIXED] == 1
        else min(settings[at.WIDTH], settings[at.WIDEST])
    )
    settings[at.CLIP] = math.inf
    if h * (1.0 + 1e-9) >= left:
        if corner:
            settings[at.CLIP] = end - 2.0 * EPS * abs(end)
        return left, True, corner
    if flags[at.FIXED] == 0 and 2.0 * h > left:
        h = 0.5 * left  # no sliver before the end
    return h, False, False


@part
def widen(settings, flags, controller, error, h):
    """The width to try after a step of width h with this error: PI control."""
    safety, by_error, by_last, least, most = controller
    error = max(error, 1e-10)
    if error > 1.0:
        settings[at.WIDTH] = h * max(least, safety * error**-by_error)
        return
    factor = safety * error**-by_error * settings[at.LAST_ERROR] ** by_last
    most = max(most, settings[at.WIDTH] / h)  # where the step was cut short
    factor = max(least, min(factor, most))
    if flags[at.REJECTED] == 1:
        factor = min(factor, 1.0)
    settings[at.WIDTH] = h * factor
    settings[at.LAST_ERROR] = max(error, 1e-4)


@sweep
def refuse(settings, flags, counters, controller, error, h):
    """A step that is too wide: a narrower one, or why there is none; a status code."""
    counters[at.N_REJECT] += 1
    flags[at.REJECTED] = 1
    if error >= 0.0 and error < math.inf:
        flags[at.BROKEN] = 0
        widen(settings, flags, controller, error, h)
    else:
        flags[at.BROKEN] = 2 if error == NOT_SOLVED else 1
        settings[at.WIDTH] = 0.25 * h
    floor = max(16.0 * EPS * settings[at.TIME], 1e-18 * settings[at.SPAN])
    if flags[at.FIXED] == 0 and settings[at.WIDTH] > floor:
        return at.DONE
    if flags[at.BROKEN] == 1:
        return at.NOT_FINITE
    return at.NOT_SOLVED if flags[at.BROKEN] == 2 else at.TOO_SMALL
