"""Widths of steps: the first one, steps that end early, and the controller of the error."""

import math

from .. import layout as at
from ..compiler.elementary import power
from ..compiler.jit import part, sweep
from ..motion import opened
from ..vec import finite
from .attempt import EPS, NOT_SOLVED, copied, slope
from .scales import size_of, weigh


@sweep
def first_width(scene, accelerate, size, order, stages, control, flow):
    """A width for the first step, from how fast y and y' change, without a unit."""
    settings, counters = control
    rows = opened(scene).rows
    n = stages.shape[1]
    copied(stages, at.Y, at.CANDIDATE, n)
    weigh(rows, size, stages, settings)
    rtol = settings.rtol
    shrink = power(0.01 * rtol, 1.0 / (order + 1))
    fastest = max(size_of(rows, size, stages, at.SLOPE) * rtol, 1.0 / settings.span)
    h = 0.01 / fastest
    for i in range(n):
        stages[at.CANDIDATE, i] = stages[at.Y, i] + h * stages[at.SLOPE, i]
    t = settings.time
    slope(scene, accelerate, t + h, size, stages, at.CANDIDATE, at.ERROR, flow, counters)
    if not finite(stages[at.ERROR]):
        return 0.1 * shrink * h
    weigh(rows, size, stages, settings)
    for i in range(n):
        stages[at.ERROR, i] = (stages[at.ERROR, i] - stages[at.SLOPE, i]) / h
    bend = math.sqrt(size_of(rows, size, stages, at.ERROR) * rtol)
    return shrink / max(fastest, bend)


@sweep
def next_width(settings, corners, stop):
    """(width of the next step, whether it ends at `stop` or a corner of a table, at a corner)."""
    t = settings.time
    k = settings.corner
    while k < corners.shape[0] and corners[k] <= t:
        k += 1
    settings.corner = k
    corner = k < corners.shape[0] and corners[k] <= stop
    end = corners[k] if corner else stop
    left = end - t
    h = settings.widest if settings.fixed == 1 else min(settings.width, settings.widest)
    settings.clip = math.inf
    if h * (1.0 + 1e-9) >= left:
        if corner:
            settings.clip = end - 2.0 * EPS * abs(end)
        return left, True, corner
    if settings.fixed == 0 and 2.0 * h > left:
        h = 0.5 * left  # no sliver before the end
    return h, False, False


@part
def widen(settings, controller, error, h):
    """The width to try after a step of width h with this error: PI control."""
    safety, by_error, by_last, least, most = controller
    error = max(error, 1e-10)
    if error > 1.0:
        settings.width = h * max(least, safety * power(error, -by_error))
        return
    factor = safety * power(error, -by_error) * power(settings.last_error, by_last)
    most = max(most, settings.width / h)  # where the step was cut short
    factor = max(least, min(factor, most))
    if settings.rejected == 1:
        factor = min(factor, 1.0)
    settings.width = h * factor
    settings.last_error = max(error, 1e-4)


@sweep
def refuse(settings, counters, controller, error, h):
    """A step that is too wide: a narrower one, or why there is none; a status code."""
    counters.rejected_steps += 1
    settings.rejected = 1
    if error >= 0.0 and error < math.inf:
        settings.broken = 0
        widen(settings, controller, error, h)
    else:
        settings.broken = 2 if error == NOT_SOLVED else 1
        settings.width = 0.25 * h
    floor = max(16.0 * EPS * settings.time, 1e-18 * settings.span)
    if settings.fixed == 0 and settings.width > floor:
        return at.DONE
    if settings.broken == 1:
        return at.NOT_FINITE
    return at.NOT_SOLVED if settings.broken == 2 else at.TOO_SMALL
