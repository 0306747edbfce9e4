"""Step sizes: error norms on the machine's own scales, and the error controller.

Errors are divided by one radian, the length of the mechanism or its highest speed so far, so all
tolerances are dimensionless.
"""

import math
import sys

from ...tolerances import EPS
from .. import layout as at
from ..arrays import opened_run
from ..compiler.elementary import power
from ..compiler.jit import part, sweep
from ..drives import lag_width
from ..edges import next_edge
from ..motion import opened
from ..motions import is_angle, is_inert, nq_of, numbers_of
from ..records import CHOSEN, GIVEN
from ..rows import kind_of, q_of, v_of
from ..signals import next_sample
from ..vec import finite
from .control.clock import clip_stages, jump_to, set_time, try_width
from .control.ends import (
    add_part,
    begin_interval,
    count_from,
    count_steps,
    note_edge,
    pass_to_corner,
)
from .control.error import note_error, note_scales, reject_step, take_width
from .state import NOT_MET, UNSOLVED, acceleration_of, copied, rate_of, size_of_state

GOLDEN = (3 - math.sqrt(5)) / 2  # fraction of the golden section
FULL_DIGITS = sys.float_info.min / EPS  # smaller numbers have fewer digits


@sweep
def extremes(rows, size, stages, row, spin, speed, length):
    """Find the largest angular speed, speed and way, of `row` and the given values."""
    nq, state = size[0], stages[row]
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = nq + v_of(rows, k)
        kind = kind_of(rows, k)
        if is_inert(kind):
            continue
        first, count = numbers_of(kind)
        turns = first
        if is_angle(kind):
            turns, count = 1, 0
        for n in range(turns):
            spin = max(spin, abs(state[j + n]))
        for n in range(count):
            speed = max(speed, abs(state[j + first + n]))
            length = max(length, abs(state[i + n]))
    return spin, speed, length


@sweep
def weigh(rows, size, stages, control):
    """Write 1 / tolerance for every entry of y, except the ledger, into WEIGHT.

    The scales are one radian, the length of the mechanism, and the largest joint speed so far,
    which is at least one scale per run. Each control state has its own scale, which is its largest
    value so far and in CANDIDATE. The former replaces the weight of its integral, because rejected
    steps may end anywhere.
    """
    error = control.error
    nq, nv = size
    found = extremes(rows, size, stages, at.Y, error.spin, error.speed, error.length)
    note_scales(error, found)
    spin, speed, length = extremes(rows, size, stages, at.CANDIDATE, found[0], found[1], found[2])
    spin = max(spin, 1.0 / control.clock.span)
    speed = max(speed, length / control.clock.span)
    weights = stages[at.WEIGHT]
    rtol = error.rtol
    atol = error.atol
    weights[nq + nv] = 0.0
    weights[nq + nv + 1] = 0.0
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = nq + v_of(rows, k)
        kind = kind_of(rows, k)
        first, count = numbers_of(kind)
        if is_inert(kind):
            weights[i] = max(weights[i], abs(stages[at.Y, j]))
            size = max(weights[i], abs(stages[at.CANDIDATE, j]))
            weights[j] = inverse(rtol * size + atol)
        elif is_angle(kind):
            rounding = 8.0 * EPS * abs(stages[at.CANDIDATE, i])
            weights[i] = 1.0 / (rtol + atol + rounding)
            weights[j] = 1.0 / (rtol * spin + atol)
        else:
            for n in range(count):
                weights[i + n] = inverse(rtol * length + atol)
                weights[j + first + n] = inverse(rtol * speed + atol)
            for n in range(i + count, i + nq_of(kind)):
                weights[n] = 1.0 / (rtol + atol)
            for n in range(first):
                weights[j + n] = 1.0 / (rtol * spin + atol)


@part
def inverse(x):
    """Return 1/x, or 0 for a coordinate without scale, which has not moved by what has digits."""
    return 1.0 / x if x > FULL_DIGITS else 0.0


@sweep
def size_of(rows, size, stages, row):
    """Find the largest |error in `row`| over its tolerance, with quaternions as angles."""
    nq, nv = size
    error, state, weights = stages[row], stages[at.CANDIDATE], stages[at.WEIGHT]
    worst = 0.0
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        kind = kind_of(rows, k)
        if is_inert(kind):
            continue
        first, count = numbers_of(kind)
        for n in range(count):
            worst = larger(worst, error[i + n] * weights[i + n])
        if first == 0:
            continue
        i += count
        along = 0.0
        whole = 0.0
        length = 0.0
        for n in range(4):
            e = error[i + n]
            u = state[i + n]
            along += e * u
            whole += e * e
            length += u * u
        across = max(whole - along * along / length, 0.0) + 0.0 * whole
        worst = larger(worst, 2.0 * math.sqrt(across) * weights[i])
    for j in range(nq, nq + nv):
        worst = larger(worst, error[j] * weights[j])
    return worst


@part
def larger(x, y):
    """Return the larger magnitude, or nan if either is nan."""
    return x if abs(y) <= x or not x >= 0.0 else abs(y)


# -- widths ----------------------------------------------------------------------------------------


@sweep
def first_width(run):
    """Estimate an initial step size from the rates of change of y and y', independent of units."""
    data = opened_run(run)
    control, stages, order = data.control[0], data.stages, data.method[0].order
    rows, size = opened(data.scene).rows, size_of_state(run)
    n = stages.shape[1]
    rate_of(rows, size, stages, at.Y, at.SLOPE)
    copied(stages, at.Y, at.CANDIDATE, n)
    weigh(rows, size, stages, control)
    rtol = control.error.rtol
    shrink = power(0.01 * rtol, 1.0 / (order + 1))
    fastest = max(size_of(rows, size, stages, at.SLOPE) * rtol, 1.0 / control.clock.span)
    h = 0.01 / fastest
    for i in range(n):
        stages[at.CANDIDATE, i] = stages[at.Y, i] + h * stages[at.SLOPE, i]
    rate_of(rows, size, stages, at.CANDIDATE, at.RATE_CHANGE)
    acceleration_of(run, control.clock.time + h, at.CANDIDATE, at.RATE_CHANGE)
    if not finite(stages[at.RATE_CHANGE]):
        return 0.1 * shrink * h
    weigh(rows, size, stages, control)
    for i in range(n):
        stages[at.RATE_CHANGE, i] = (stages[at.RATE_CHANGE, i] - stages[at.SLOPE, i]) / h
    bend = math.sqrt(size_of(rows, size, stages, at.RATE_CHANGE) * rtol)
    return shrink / max(fastest, bend)


@part
def nearby(t):
    """Compute the maximum difference [s] between two times that are equal up to rounding.

    A step's end is origin + count x width. All of these values are rounded, and so is the time of a
    corner.
    """
    return 4.0 * EPS * abs(t)


@sweep
def pass_corners(run):
    """Find the next corner. A step that starts within rounding before a corner starts there."""
    data = opened_run(run)
    control, corners = data.control[0], data.corners
    clock, ends = control.clock, control.ends
    t, frame = clock.time, data.times[clock.frame]
    k = ends.corner
    while k < corners.shape[0] and corners[k] <= t + nearby(t):
        if corners[k] > t:
            if corners[k] >= frame:
                break
            jump_to(clock, corners[k])
            note_edge(ends, corners[k])
        k += 1
    pass_to_corner(ends, k)


@sweep
def pass_edges(run):
    """Start a step at an edge that is within rounding of its start, or of the run's times."""
    data = opened_run(run)
    control, code = data.control[0], opened(data.scene).loads.signals[0]
    clock = control.clock
    t, frame = clock.time, data.times[clock.frame]
    near = t + nearby(
        abs(t) + (clock.span if control.error.widths == CHOSEN else control.error.widest)
    )
    edge = next_edge(code, t, near)
    while edge < frame:
        jump_to(clock, edge)
        note_edge(control.ends, edge)
        edge = next_edge(code, edge, near)


@sweep
def edge_ahead(run, stop):
    """Return the next edge of the expressions until `stop`, within two steps, or infinity [s]."""
    data = opened_run(run)
    control, t = data.control[0], data.control[0].clock.time
    if control.ends.edges == 0:
        return math.inf
    if control.error.widths == CHOSEN:
        stop = min(stop, t + 2.0 * min(control.clock.width, control.error.widest))
    return next_edge(opened(data.scene).loads.signals[0], t, stop + nearby(stop))


@sweep
def next_width(run):
    """Compute the size of the next step, its end [s], and whether it ends at a corner or an edge.

    Steps end at corners of tables, edges of expressions and transients of lags, and before a body
    could pass through another one.
    """
    data = opened_run(run)
    control, times, corners = data.control[0], data.times, data.corners
    clock, error, ends = control.clock, control.error, control.ends
    t, k = clock.time, ends.corner
    clip_stages(clock, math.inf)
    if error.widths == GIVEN:
        left = error.widest - ends.done
        stop = given_end(run)
    else:
        stop = times[clock.last - 1 if data.tableau.dense.shape[0] > 0 else clock.frame]
        left = stop - t
    edge = edge_ahead(run, stop)
    bend = min(edge, corners[k]) if k < corners.shape[0] else edge
    corner = bend <= stop + nearby(stop)
    if bend < stop - nearby(stop):
        stop = bend
        left = stop - t
    if ends.samples > 0:
        sample = next_sample(opened(data.scene).loads.signals, t, nearby(t))
        if sample < stop - nearby(stop):
            stop = sample
            left = stop - t
            corner = False
    h = control.guard.bound
    if error.widths == GIVEN:
        if ends.lag < 2.0 * error.widest:
            drives, order = opened(data.scene).drives, data.method[0].order
            h = min(h, lag_width(drives, t, order) / ends.parts)
        if ends.parts > 1:
            h = min(h, part_width(run, bend))
    else:
        h = min(min(error.widest, h), clock.width)
        if ends.parts > 1 and edge < math.inf:
            h = min(h, (edge - ends.edge) / ends.parts)
        if ends.parts > 1 and t == ends.change:  # a time shared by the run and its finer run
            h = min(h, GOLDEN * left)
    if h * (1.0 + 1e-9) >= left:
        if corner:
            clip_stages(clock, bend - 2.0 * EPS * abs(bend))
        return left, stop, corner
    if error.widths == CHOSEN and 2.0 * h > left:
        h = 0.5 * left  # no sliver before the end
    end = t + h
    if error.widths == GIVEN:
        return h, end, False
    return (end - t if end > t else h), end, False  # or rounded times would add up


@sweep
def part_width(run, bend):
    """Compute the step size [s] that divides the step of the original run into `parts` equal parts.

    Each step of a finer run is therefore contained in a step of the original run, even near
    corners. `bend` is the time of the next corner or edge.
    """
    control = opened_run(run).control[0]
    ends = control.ends
    begin = ends.origin + ends.taken * control.error.widest
    stop = begin + control.error.widest
    return (min(stop, bend) - max(begin, ends.edge)) / ends.parts


@part
def given_start(control):
    """Compute the start of the next given step, or of its remainder after an event [s]."""
    ends = control.ends
    return ends.origin + ends.taken * control.error.widest + ends.done


@part
def given_end(run):
    """Compute the end of the next given step [s]. The last one before a frame ends at the frame."""
    data = opened_run(run)
    control = data.control[0]
    ends = control.ends
    if ends.left == 1:
        return data.times[control.clock.frame]
    return ends.origin + (ends.taken + 1) * control.error.widest


@sweep
def next_interval(run, i):
    """Begin the given steps after frame i, counted from the last change in step size."""
    data = opened_run(run)
    control, substeps, width = data.control[0], data.substeps, data.width
    ends = control.ends
    if i + 1 < control.clock.last:
        begin_interval(ends, substeps[i])
        if width[i] != control.error.widest:
            take_width(control.error, width[i])
            count_from(ends, data.times[i])


@sweep
def step_taken(run):
    """Count a fixed step, or record the completed part if it was shortened."""
    control = opened_run(run).control[0]
    clock, ends = control.clock, control.ends
    if given_end(run) - clock.time > nearby(clock.time):
        fired = control.guard.fired != 0
        add_part(ends, clock.time - clock.old_time if fired else clock.old_width)
        return
    count_steps(ends, 1)
    if ends.left == 0:
        set_time(clock, opened_run(run).times[clock.frame])


@part
def widen(control, method, error, h):
    """Compute the step size to try after a step of size h with this error, by PI control."""
    clock = control.clock
    error = max(error, 1e-10)
    if error > 1.0:
        factor = max(method.least, method.safety * power(error, -method.by_error))
        try_width(clock, h * factor)
        return
    factor = method.safety * power(error, -method.by_error)
    factor *= power(control.error.last_error, method.by_last)
    most = max(method.most, clock.width / h)  # permits the old width after a shortened step
    factor = max(method.least, min(factor, most))
    if control.error.rejected == 1:
        factor = min(factor, 1.0)
    try_width(clock, h * factor)
    note_error(control.error, error)


@sweep
def refuse(run, error, h):
    """Reject a step and choose a smaller one. Returns a status code."""
    data = opened_run(run)
    control, counters = data.control[0], data.counters[0]
    clock = control.clock
    counters.rejected_steps += 1
    known = error >= 0.0 and error < math.inf
    reject_step(control.error, 0 if known else (2 if error == UNSOLVED else 1))
    if error == NOT_MET:
        return at.NOT_CONVERGED
    if known:
        widen(control, data.method[0], error, h)
    else:
        try_width(clock, 0.25 * h)
    floor = max(16.0 * EPS * clock.time, 1e-18 * clock.span)
    if control.error.widths == CHOSEN and clock.width > floor:
        return at.DONE
    if control.error.broken == 1:
        return at.NOT_FINITE
    return at.NOT_SOLVED if control.error.broken == 2 else at.TOO_SMALL
