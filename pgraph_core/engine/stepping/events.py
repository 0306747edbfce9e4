"""Location of the ends of contact phases and of user events within the last step.

Each step is first taken without considering events. Then monitors, which fall below zero at an
event, are evaluated along the step, on dense output or by repeating a narrower step. The first
event is located by secants and bisection, and the step ends there.
"""

import math

from ...tolerances import NOTABLE, SOLVED
from .. import layout as at
from ..arrays import opened_run
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import f8, u8, void
from ..contact.phases import opened_events
from ..contact.points import accepted, dip_of_gap, start
from ..motion import PROJECTION, call_projection
from ..records import ASLEEP, ONCE, REACHED, WATCHED
from .bracket import (
    BELOW,
    NOTHING,
    ROUNDED,
    TRIALS,
    Margins,
    locating,
    narrowed_by,
    next_try,
    over,
    secant,
    whole,
)
from .control.clock import jump_to, shorten_last_step
from .control.guard import fire, note_looked
from .looks import (
    EVENT,
    keep_values,
    look,
    phases_watched,
    step_again,
    time_within,
    values_of_events,
)
from .margins import instant
from .measured import steps_in_time
from .minima import beside, convex_bound, is_inside, narrowed_least, next_least, turning
from .run import LOOK_BACK
from .state import copied, size_of_state

# of a user's functions: time, and the addresses of q, v and their values
_call_user = caller(void(f8, u8, u8, u8))

PARTS = 4  # parts of a step with dense output that are examined separately
DIPS = 120  # evaluations for the minimum of an event near zero
STEEPER = 2.0  # plausible slope of an event, relative to those between its values in a part
EVENT_HALVINGS = 40  # halvings of a part that starts at an event
# share of a part within which a value that only touches zero moves by 16 SOLVED of its change
STANDSTILL = 4.0 * math.sqrt(SOLVED)
WIDER = 8  # growth of the interval after an instant at which a value is and stays zero


@kernel(PROJECTION, nogil=True, later=True)
def event_projection(scene, t, q, v, rounds):
    """Run `projection` onto the active constraints. Returns the iterations, or -1."""
    links = opened_events(scene).contact.links
    return call_projection(links.project, (links.held, t, q, v, rounds))


@kernel(EVENT, nogil=True, later=True)
def user_events(scene, t, q, v, values):
    """Evaluate the user functions, whose address is the last entry of `values`."""
    address = int(values[values.shape[0] - 1])
    if address != 0:
        _call_user(address, (t, q.ctypes.data, v.ctypes.data, values.ctypes.data))


# -- margins --------------------------------------------------------------------------------------


@part
def no_rounding(margins, n):
    """Return zero: how far a value of a user is rounded is not known, and it may stay zero."""
    return 0.0


@part
def has_counted(run, margins, n):
    """Check whether margin n is that of a user event that has happened and counts."""
    data = opened_run(run)
    i = n - (margins.shape[1] - data.signs.shape[0])
    crosses = margins[WATCHED.now, n] < 0.0 and margins[WATCHED.rest, n] == 0.0
    return i >= 0 and crosses and data.signs[i] * data.wanted[i] <= 0


@part
def note_near(run, margins, n, near, w):
    """Keep how near to zero a user event comes at a time w after the start of the last step."""
    if near < margins[WATCHED.nearest, n]:
        margins[WATCHED.nearest, n] = near
        margins[WATCHED.when, n] = opened_run(run).control[0].clock.old_time + w


EVENTS = Margins(0, 1, WATCHED.low, WATCHED.high, WATCHED.now, look, no_rounding)
located = locating(EVENTS)
turn_beyond = turning(EVENTS, has_counted, note_near)


@sweep
def begin_part(run):
    """Start the next part of the step from the last evaluation."""
    data = opened_run(run)
    signs, values, watched = data.signs, data.values, data.watched
    if phases_watched(run):
        start(opened_events(data.scene).contact, data.control[0].guard.turning)
    first = watched.shape[1] - signs.shape[0]
    for i in range(signs.shape[0]):
        if values[i] != 0.0 and (signs[i] != 0 or left_zero(run, i)):
            signs[i] = sign_of(values[i])
        watched[WATCHED.start, first + i] = abs(values[i])


@part
def left_zero(run, i):
    """Check whether the value of event i is not zero, or again far enough from its last zero."""
    data = opened_run(run)
    n = data.watched.shape[1] - data.signs.shape[0] + i
    return abs(data.values[i]) > data.watched[WATCHED.zero, n]


@part
def sign_of(x):
    """Return the sign of a number, 0 for zero."""
    return 0 if x == 0.0 else (1 if x > 0.0 else -1)


@sweep
def begin_events(run):
    """Store the signs and values of user events at the start of the last step."""
    data = opened_run(run)
    stages, signs, watched, values = data.stages, data.signs, data.watched, data.values
    nq, nv = size_of_state(run)
    q, v = stages[at.Y_OLD, :nq], stages[at.Y_OLD, nq : nq + nv]
    values_of_events(run, data.control[0].clock.old_time, q, v)
    first = watched.shape[1] - signs.shape[0]
    for i in range(signs.shape[0]):
        if signs[i] == 0 and left_zero(run, i):
            signs[i] = sign_of(values[i])
        watched[WATCHED.start, first + i] = abs(values[i])


@part
def undecided(signs):
    """Check whether the sign of an event is unknown."""
    found = False
    for i in range(signs.shape[0]):
        found = found or signs[i] == 0
    return found


@sweep
def any_leaves(run):
    """Check whether an event that was zero is not zero at the last look."""
    signs, found = opened_run(run).signs, False
    for i in range(signs.shape[0]):
        found = found or (signs[i] == 0 and left_zero(run, i))
    return found


@sweep
def leave_zeros(run, low, width):
    """Set the signs of events that are zero at `low` to those with which they leave zero."""
    data = opened_run(run)
    signs, values, watched = data.signs, data.values, data.watched
    first = watched.shape[1] - signs.shape[0]
    for i in range(signs.shape[0]):
        watched[WATCHED.since, first + i] = -1.0
    if not undecided(signs):
        return
    look(run, low, width)
    if not any_leaves(run):
        look(run, low, 0.5 * width)
        if not any_leaves(run):
            look(run, low, 0.0)
            return
    w = SOLVED * width
    while w < width and undecided(signs):
        look(run, low, w)
        for i in range(signs.shape[0]):
            if signs[i] == 0 and left_zero(run, i):
                signs[i] = sign_of(values[i])
                watched[WATCHED.start, first + i] = abs(values[i])
                watched[WATCHED.since, first + i] = low + w
        w *= WIDER
    look(run, low, 0.0)


# -- location -------------------------------------------------------------------------------------


@sweep
def rests(run, low, width):
    """Check whether events come to rest at zero within the part from `low` of a time step, and keep
    up to which size they are zero in row `rest`.

    The sign of such a value is rounding, or that of the tolerance of a contact's gap, and its zero
    is where it has come to rest. The values at the end of the part are known, and are known again
    afterwards.
    """
    data = opened_run(run)
    signs, values, wanted, watched = data.signs, data.values, data.wanted, data.watched
    first, near, found = watched.shape[1] - signs.shape[0], False, False
    for i in range(signs.shape[0]):
        n, awake = first + i, wanted[i] != ASLEEP and signs[i] != 0
        close = awake and abs(values[i]) <= NOTABLE * watched[WATCHED.start, n]
        watched[WATCHED.rest, n] = values[i] if close else math.inf
        near = near or close
    if near:
        look(run, low, width - STANDSTILL * width)
    for i in range(signs.shape[0]):
        n, tiny = first + i, NOTABLE * watched[WATCHED.start, first + i]
        still = abs(values[i] - watched[WATCHED.rest, n]) <= SOLVED * watched[WATCHED.start, n]
        watched[WATCHED.rest, n] = tiny if still else 0.0
        found = found or (still and tiny > 0.0)
    if near:
        look(run, low, width)
    return found


@sweep
def happened(run, low, width):
    """Return the width at which an event has occurred in the interval from `low`, or else 0."""
    data = opened_run(run)
    if look(run, low, width):
        return width
    first = width
    if phases_watched(run):
        contact = opened_events(data.scene).contact
        for s in range(contact.points.shape[0]):
            w = dip_of_gap(contact, s, width)
            if w < first:
                first = least_gap(run, low, s, w, (width, first))
                look(run, low, width)
        if first < width:
            look(run, low, first)
    return first if first < width else 0.0


@sweep
def least_gap(run, low, s, w, widths):
    """Compute the width near w of the minimum gap at point s if a phase ends there, or else
    widths[1].

    widths[0] is the width of the sub-step. The rates of the gap at the two ends have different
    signs, so the gap has a minimum where its rate is zero.
    """
    data = opened_run(run)
    points = opened_events(data.scene).contact.points
    width, otherwise = widths
    falls, rises = -points[s].start_rate, points[s].gap_rate
    bracket, ends = whole(0.0, width), (falls, -rises)
    for _ in range(TRIALS):
        if look(run, low, w):
            return w
        rate = points[s].gap_rate
        falls, rises = (falls, rate) if rate > 0.0 else (-rate, rises)
        bracket, ends = narrowed_by(bracket, ends, w, -rate)
        left = bracket.end - bracket.begin
        if points[s].gap > max(falls, rises) * left or left <= ROUNDED * width:
            break
        w = next_try(bracket, secant(bracket, ends[0], ends[1]), ROUNDED * width)
    return otherwise


@part
def three_values(run, i):
    """Return the values of event i at the start of a part, in its middle and at its end, which are
    in rows WATCHED.low and WATCHED.high and were looked at last, positive on its side of zero."""
    data = opened_run(run)
    watched = data.watched
    sign = data.signs[i] if data.wanted[i] != ASLEEP else 0
    n = watched.shape[1] - data.signs.shape[0] + i
    return sign * watched[WATCHED.low, n], sign * watched[WATCHED.high, n], sign * data.values[i]


@sweep
def may_dip(run, i):
    """Check whether `three_values` of event i let it touch zero between them without crossing it.

    How near it came at the end is kept then: a value that is zero up to SOLVED at an end has its
    minimum there. It comes near zero at the end of one part, which row WATCHED.nears keeps, and
    rises in the next one.
    """
    data = opened_run(run)
    watched = data.watched
    n = watched.shape[1] - data.signs.shape[0] + i
    nears = watched[WATCHED.nears, n] > 0.0
    watched[WATCHED.nears, n] = 0.0
    y = three_values(run, i)
    if not (y[0] > 0.0 and y[1] > 0.0 and y[2] > 0.0):
        return False
    tiny = SOLVED * max(y[0], max(y[1], y[2]))
    if y[2] <= tiny:
        watched[WATCHED.nears, n] = 1.0
    if y[0] <= tiny and not nears:  # the zero of the event before
        return False
    return min(y[0], min(y[1], y[2])) <= STEEPER * max(abs(y[1] - y[0]), abs(y[2] - y[1]))


@sweep
def dip(run, low, width, i):
    """Find the point after `low` at which event i touches zero without crossing it.

    Return the widths that bracket the event. Both widths are equal if zero is only touched, and -1
    if there is no event. How near it came is kept then. A value has a minimum inside if it falls at
    the start and rises at the end.
    """
    data = opened_run(run)
    values, sign = data.values, data.signs[i]
    y = three_values(run, i)
    tiny = SOLVED * max(y[0], max(y[1], y[2]))
    look(run, low, SOLVED * width)
    falls = sign * values[i] < y[0]
    if y[0] <= tiny and not falls:
        return touched(run, low, SOLVED * width, i)
    look(run, low, width - SOLVED * width)
    if not (falls and sign * values[i] < y[2]):
        return -1.0, -1.0
    return least_value(run, low, width, i, y)


@sweep
def touched(run, low, w, i):
    """Return the widths of an event that touches zero at w, unless only crossings are wanted."""
    data = opened_run(run)
    if data.wanted[i] != 0:
        return -1.0, -1.0
    look(run, low, w)
    n = data.watched.shape[1] - data.signs.shape[0] + i
    data.watched[WATCHED.now, n] = -BELOW
    data.watched[WATCHED.nears, n] = 0.0
    return w, w


@sweep
def least_value(run, low, width, i, y):
    """Return `dip` for a value which falls at the start of a part and rises at its end.

    `y` are its values at the start, in the middle and at the end. Brackets of the minimum become
    narrower until it is known to be above zero, or until they are as narrow as SOLVED. A value that
    is convex cannot be below the lines through the middle of a bracket and its ends.
    """
    data = opened_run(run)
    watched, sign = data.watched, data.signs[i]
    n = watched.shape[1] - data.signs.shape[0] + i
    x, size = (0.0, 0.5, 1.0), max(y[0], y[2])
    for k in range(DIPS):
        if x[2] - x[0] < SOLVED or (is_inside(y) and convex_bound(x, y) > 0.0):
            break
        x, y, w = next_least(x, y, k)
        look(run, low, w * width)
        value = sign * data.values[i]
        if value <= 0.0:
            return x[0] * width, w * width
        x, y = narrowed_least(x, y, w, value)
    if x[2] - x[0] < SOLVED and (2.0 * y[1] <= max(y[0], y[2]) or y[1] <= SOLVED * size):
        return touched(run, low, x[2] * width, i)  # from where on it rises
    note_near(run, watched, n, y[1], low + x[1] * width)
    return -1.0, -1.0


@sweep
def clear_of_zero(run, low, end):
    """Compute (low, end) of a part in which an event happens, starting clearly before the event.

    Right after an event, rounding hides on which side of zero its value is.
    """
    watched, count = opened_run(run).watched, opened_run(run).signs.shape[0]
    for _ in range(EVENT_HALVINGS):
        clear = True
        for n in range(watched.shape[1] - count, watched.shape[1]):
            clear = clear and watched[WATCHED.start, n] >= -SOLVED * watched[WATCHED.now, n]
        if clear:
            break
        end *= 0.5
        if not look(run, low, end):
            for n in range(watched.shape[1] - count, watched.shape[1]):
                watched[WATCHED.start, n] = watched[WATCHED.now, n]
            low += end
            look(run, low, end)
            break
    return low, end


@sweep
def locate(run, low, end):
    """Compute (start, width) of a part at whose end is the first event in the interval from `low`.

    The state of the event is in TRIAL, its number in NOW.
    """
    data = opened_run(run)
    control = data.control[0]
    low, end = clear_of_zero(run, low, end)
    for n in range(data.watched.shape[1]):
        data.watched[WATCHED.low, n] = data.watched[WATCHED.start, n]
    return low, located(run, data.watched, low, end, instant(control, control.clock.old_width))


@sweep
def dipped(run, low, begin, width):
    """Return `locate` for a user event that occurs and is reversed after `low`, before the end of
    the part from `begin`, which was looked at last.

    The width is 0 if zero is only touched, and -1 if there is no event.
    """
    data = opened_run(run)
    watched, count = data.watched, data.signs.shape[0]
    whole_width = begin + width - low
    for i in range(count):
        if may_dip(run, i):
            first, last = dip(run, low, whole_width, i)
            if last >= 0.0 and watched[WATCHED.now, watched.shape[1] - count + i] < 0.0:
                low += first
                return locate(run, low, last - first) if last > first else (low, 0.0)
            look(run, begin, width)
    return low, -1.0


@sweep
def dipped_before(run, low, begin, width):
    """Return `dipped` from `low` to the event that was located at a width from `begin`, or the
    latter if there is no other one."""
    look(run, low, 0.0)
    keep_values(run, WATCHED.low)
    look(run, low, 0.5 * (begin + width - low))
    keep_values(run, WATCHED.high)
    look(run, begin, width)
    first, found = dipped(run, low, begin, width)
    return (first, found) if found >= 0.0 else (begin, width)


@sweep
def keep_rates(run, w):
    """Keep the rates of margins at a time w after the start of the last step, after
    `turn_beyond`."""
    data = opened_run(run)
    watched = data.watched
    begin, end = beside(w, data.control[0].clock.old_width)
    for n in range(watched.shape[1]):
        rise = watched[WATCHED.now, n] - watched[WATCHED.low, n]
        watched[WATCHED.rate, n] = rise / (end - begin)


@sweep
def reached(run, low, w):
    """Check whether the event that was located at a width w from `low` is accepted, and its time.

    The width is 0 where zero is only touched. An event whose value comes to zero immediately
    afterwards, by its rate, is at the same time. A value that stays zero counts again when it has
    left it.
    """
    data = opened_run(run)
    signs, wanted, watched = data.signs, data.wanted, data.watched
    first = watched.shape[1] - signs.shape[0]
    h = data.control[0].clock.old_width
    if w > 0.0 and data.links.events != 0:
        turn_beyond(run, watched, h, low + w)
        keep_rates(run, low + w)
        look(run, low, w)
    keep_values(run, WATCHED.high)
    for i in range(signs.shape[0]):
        n, value = first + i, watched[WATCHED.high, first + i]
        watched[WATCHED.start, n] = abs(value)
        if wanted[i] == ASLEEP or signs[i] == 0:
            continue
        zero = max(SOLVED * h * abs(watched[WATCHED.rate, n]), watched[WATCHED.rest, n])
        soon = abs(value) <= zero and watched[WATCHED.rate, n] < 0.0
        if w == 0.0 or not (watched[WATCHED.now, n] < 0.0 or soon):
            continue
        watched[WATCHED.nears, n] = 0.0
        watched[WATCHED.now, n] = NOTHING if signs[i] * wanted[i] > 0 else -BELOW
        watched[WATCHED.zero, n] = zero
        signs[i] = 0 if abs(value) <= zero else sign_of(value)
    return over(watched, WATCHED.now), low + w


@part
def next_look(run, low, n, parts):
    """Return the end of the interval from `low`: a frame, or fraction `n` of `parts`."""
    data = opened_run(run)
    control, times = data.control[0], data.times
    clock = control.clock
    h = clock.old_width
    end = h * n / parts
    if data.links.events == 0 or parts == 1:
        return end
    i = clock.frame
    while i < clock.last and times[i] - clock.old_time <= low + SOLVED * h:
        i += 1
    if i < clock.last:
        end = min(end, times[i] - clock.old_time)
    return end


@sweep
def looked_at(run, low, end):
    """Compute (True if a counted event has happened by `end`, its time, the time examined).

    User events are also evaluated at the midpoint. If a value is close to zero, they are also
    evaluated at the minimum of a parabola through three values.
    """
    data = opened_run(run)
    halves, steps = 1, data.links.events != 0 and steps_in_time(data.scene)
    if data.links.events != 0:
        halves = 2
        leave_zeros(run, low, end - low)
    keep_values(run, WATCHED.low)
    begin = low
    for k in range(halves):
        stop = end if k == halves - 1 else 0.5 * (low + end)
        found = happened(run, begin, stop - begin)
        ends = found == 0.0 or found == stop - begin
        if steps and ends and rests(run, begin, stop - begin):
            found = stop - begin
        if found > 0.0:
            begin, width = locate(run, begin, found)
            if data.links.events != 0:
                begin, width = dipped_before(run, low, begin, width)
            return reached(run, begin, width)
        if phases_watched(run):
            accepted(opened_events(data.scene).contact)
        begin_part(run)
        if k < halves - 1:
            keep_values(run, WATCHED.high)
            begin = stop
    if halves == 2:
        first, width = dipped(run, low, begin, end - begin)
        if width >= 0.0:
            return reached(run, first, width)
    return False, end


@kernel(LOOK_BACK, nogil=True, later=True)
def look_back(run):
    """Go back to the first event within the last step, if there is one.

    Time stepping repeats parts of the step to look at them. Its contacts must keep the forces of
    the step that is taken, which is repeated last.
    """
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    clock, guard = control.clock, control.guard
    parts = PARTS if data.tableau.dense.shape[0] > 0 else 1
    if data.links.events != 0 and (data.counters[0].steps == 1 or guard.due == ONCE):
        begin_events(run)
    note_looked(guard)
    n = 1
    low, taken = 0.0, clock.old_width
    while n <= parts and guard.fired == 0:
        end = next_look(run, low, n, parts)
        counts, low = looked_at(run, low, end)
        if counts:
            taken = low
            copied(stages, at.TRIAL, at.Y, stages.shape[1])
            jump_to(clock, time_within(clock, low))
            if parts == 1 and guard.carried != 0:  # duals repeat it, without rounding of time
                shorten_last_step(clock, low)
            fire(guard, REACHED)
        elif low >= clock.old_width * n / parts:
            n += 1
    if clock.repeated == 1 and steps_in_time(data.scene):
        step_again(run, taken)
