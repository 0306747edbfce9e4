"""Comparisons of the motion end steps, as comparisons of time do.

A step is taken with the results that all comparisons in expressions have at its start, those within
min, max and abs too, and ends where the margin of one, its left side minus its right one, changes
its sign. Each step is therefore smooth, and each branch is only evaluated in its own domain.

Margins and their rates are bounded by interval arithmetic [Moore 1966] over the states within the
step, which are bounded by the states and rates at both ends. If a margin may change its sign and
its rate may vanish within an interval, the interval is shortened.
"""

import math

from ...tolerances import EPS, ROUNDING, step_of_differences
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import kernel, part, sweep
from ..edges import DEEPEST, HIGHEST, LOWEST, compared, hull, range_at, range_of
from ..motion import opened
from ..records import CHOSEN
from ..signals import (
    ABS,
    ADD,
    AT_MOST,
    BLEND,
    CHOOSE,
    COS,
    DIV,
    EXP,
    HELD_FROM,
    LESS,
    MAX,
    MIN,
    MUL,
    NEAREST,
    NUMBER,
    REST,
    SIDE,
    SIN,
    SQRT,
    SUB,
    TIME,
    WHEN,
    Q,
    V,
    evaluate,
)
from .measured import (
    CONSTRAINT,
    GAP_RANGE,
    LENGTH_RATE,
    OF_INPUT,
    OF_LENGTH,
    OF_SPEED,
    TOUCH,
    hold,
    observe,
    width_of_touch,
)
from .state import STEP, acceleration_of, call_step, rate_of, size_of_state
from .widths import size_of

# of a second row: of a coordinate or velocity, what bends its way; the value, or the margin, where
# a part begins; the margin where a part ends, and how much it changes
BENDING, BEGIN_MARGIN, END_MARGIN, MARGIN_CHANGE = 1, 2, 7, 8
LOWEST_RATE, HIGHEST_RATE = 5, 6  # range of the rate
OLD_RATE = 6  # column in the row of a length: rate at the start of an interval
CLEAR, CHANGED, UNDECIDED, RESTS = 0, 1, 2, 3
SHORTEST = 1.0 / (1 << DEEPEST)  # part of a step: what changes twice within it changes nothing
MOST_INTERVALS = 256  # parts of a step: for a margin that is at its bound all the way
TRIALS = 80  # bisections alone need 52
STEPS_AHEAD = 16  # steps of this way within which nothing can change: later ones need no look
ROUNDED = 4 * EPS  # width of an instant, relative to the step or the time
SPAN = 2.0 * step_of_differences(3)  # fraction of a step; three values give a rate and a curvature
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
        ends.sided = 0
        release(code)
        if h == 0.0:
            take_sides(run, code)
        hold(data.scene, code)
        return 0.0
    see(run, code, at.Y, clock.time)
    keep(code)
    see(run, code, at.CANDIDATE, clock.time + h)
    ends.clear = -math.inf
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
        ends.pieces = 0
        return h
    return ended(run, h, located(run, code, h, begin, end))


@sweep
def see(run, code, row, t):
    """Evaluate the program at a state."""
    nq, nv = size_of_state(run)
    y = opened_run(run).stages[row]
    observe(opened_run(run).scene, code, t, y[:nq], y[nq : nq + nv])
    evaluate(code, 0, code.shape[0] // 2, t, y[:nq], y[nq : nq + nv])


@sweep
def release(code):
    """Let comparisons have the results that the state gives."""
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM:
            code[i + 1, SIDE] = 0.0


@sweep
def take_sides(run, code):
    """Set the results of comparisons at Y, and reset the states for which they are valid."""
    control = opened_run(run).control[0]
    ends = control.ends
    see(run, code, at.Y, control.clock.time)
    for i in range(0, code.shape[0], 2):
        if code[i, 0] >= HELD_FROM:
            side = side_of(code, i)
            if code[i + 1, SIDE] == -side:
                code[i, REST] = abs(margin_of(code, i))
            code[i + 1, SIDE] = side
            if opened_run(run).counters[0].steps == 0:
                code[i, NEAREST], code[i, REST] = math.inf, 0.0
    if ends.slid > 0:
        blend(code, ends.slid, ends.share)
    ends.sided = 1
    ends.clear = -math.inf


@part
def operand(code, i, k):
    """Return the value of an operand."""
    return code[2 * int(code[i, k]) + 1, 0]


@part
def side_of(code, i):
    """Return 1 if a held comparison is true, else -1."""
    op = int(code[i, 0]) - HELD_FROM
    return 2.0 * compared(op, operand(code, i, 1), operand(code, i, 2)) - 1.0


@part
def margin_of(code, i):
    """Return the left side of a held comparison minus its right side."""
    a = operand(code, i, 1)
    return a if code[i, 0] == HELD_FROM + ABS else a - operand(code, i, 2)


@part
def sides(code, i):
    """Return the size of both sides of a held comparison, of whose difference an `abs` is."""
    if code[i, 0] != HELD_FROM + ABS:
        return abs(operand(code, i, 1)) + abs(operand(code, i, 2))
    k = 2 * int(code[i, 1])
    if code[k, 0] != SUB:
        return abs(code[k + 1, 0])
    return abs(operand(code, k, 1)) + abs(operand(code, k, 2))


@part
def rests(code, i):
    """Check whether a held comparison is at its threshold at both ends of an interval, where
    rounding decides."""
    most = max(abs(code[i + 1, BEGIN_MARGIN]), abs(margin_of(code, i)))
    return most <= ROUNDING * sides(code, i)


@sweep
def keep(code):
    """Start the next interval of the step at the state that was evaluated last."""
    for i in range(0, code.shape[0], 2):
        code[i + 1, BEGIN_MARGIN] = (
            margin_of(code, i) if code[i, 0] >= HELD_FROM else code[i + 1, 0]
        )
        if code[i, 0] == NUMBER:
            code[i, OLD_RATE] = code[i, LENGTH_RATE]


@part
def has_changed(code, i):
    """Check whether a held comparison has another result than at the start of the step."""
    return abs(code[i + 1, SIDE]) == 1.0 and side_of(code, i) != code[i + 1, SIDE]


@part
def jumps(code, i):
    """Check whether a value jumps where the held comparison changes."""
    return code[i, 0] == HELD_FROM + LESS or code[i, 0] == HELD_FROM + AT_MOST


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
def any_changed(code):
    """Check whether a comparison has changed."""
    found = False
    for i in range(0, code.shape[0], 2):
        found = found or (code[i, 0] >= HELD_FROM and has_changed(code, i))
    return found


# -- bounds ---------------------------------------------------------------------------------------


@part
def rate_in(run, row, k):
    """Return v of coordinate k or v' of velocity k, as far as the step knows it, else 0."""
    data = opened_run(run)
    starts = row == at.Y and data.method[0].starts == 1
    return data.stages[at.SLOPE, k] if starts else 0.0


@sweep
def bend(run, code, h):
    """Store how far each coordinate and velocity of the program can leave the chord of the step.

    A cubic through both positions with both velocities leaves it by less than its velocities
    times h differ from the chord, a parabola by less than its first rate does. Parts of a step
    leave theirs by the square of their share.
    """
    stages = opened_run(run).stages
    nq, _ = size_of_state(run)
    bend_numbers(run, code, h)
    for i in range(0, code.shape[0], 2):
        op, k = int(code[i, 0]), int(code[i, 1])
        way = code[i + 1, 0] - code[i + 1, BEGIN_MARGIN]
        if op == Q:
            j = nq + int(code[i, 2])
            first, last = h * stages[at.Y, j] - way, h * stages[at.CANDIDATE, j] - way
            code[i + 1, BENDING] = max(abs(first), abs(last))
        elif op == V:
            slope = h * rate_in(run, at.Y, nq + k)
            code[i + 1, BENDING] = abs(slope - way) if slope != 0.0 else 0.0


@part
def is_curved(table, code, i):
    """Check whether an instruction is the rate of a strut, or an input of a drive that bends."""
    what, n = int(code[i, 1]), int(code[i, 2])
    if code[i, 0] != NUMBER or what != OF_INPUT:
        return code[i, 0] == NUMBER and what == OF_SPEED
    return table[n].lag > 0.0 or table[n].integrates != 0


@sweep
def bend_numbers(run, code, h):
    """Store `bend` of the rates of struts and of the inputs of drives, as parabolas.

    Their first rates are differences over a small part of the step, along the rate of the state.
    """
    data = opened_run(run)
    stages, t, size = data.stages, data.control[0].clock.time, size_of_state(run)
    table, ahead = opened(data.scene).drives.table, False
    for i in range(0, code.shape[0], 2):
        if is_curved(table, code, i):
            code[i + 1, BENDING] = code[i + 1, 0] - code[i + 1, BEGIN_MARGIN]
            ahead = True
    if not ahead:
        return
    rate_of(opened(data.scene).rows, size, stages, at.Y, at.TRIAL)
    for j in range(size[0] + size[1]):
        rate = stages[at.TRIAL, j] if j < size[0] else rate_in(run, at.Y, j)
        stages[at.TRIAL, j] = stages[at.Y, j] + SPAN * h * rate
    see(run, code, at.TRIAL, t + SPAN * h)
    for i in range(0, code.shape[0], 2):
        if is_curved(table, code, i):
            first = (code[i + 1, 0] - code[i + 1, BEGIN_MARGIN]) / SPAN
            code[i + 1, BENDING] = abs(first - code[i + 1, BENDING])
    see(run, code, at.CANDIDATE, t + h)


@sweep
def judged(code, t, share, width):
    """Return CLEAR if no comparison changes in an interval, CHANGED if one has changed at its end,
    RESTS if one may but is at its threshold at both ends, or UNDECIDED.

    The interval from t [s] has this share of the step and this width [s]. A margin without a known
    range is judged by its values at both ends, like a margin that does not turn. For comparisons
    that may turn back, the smallest margin is stored.
    """
    found = CLEAR
    for i in range(0, code.shape[0], 2):
        op = int(code[i, 0])
        if op <= V:
            put_signal(code, i, op, share, width)
            continue
        a, b = range_at(code, i, 1), range_at(code, i, 2)
        by_a, by_b = rate_at(code, i, 1), rate_at(code, i, 2)
        if op < HELD_FROM:
            x = range_of(op, a, b, range_at(code, i, 3))
            put_range(code, i, x, rate_range(op, x, a, b, by_a, by_b, rate_at(code, i, 3)))
            continue
        side = code[i + 1, SIDE]
        least, most = by_a if op == HELD_FROM + ABS else (by_a[0] - by_b[1], by_a[1] - by_b[0])
        turns = most - least < math.inf and least <= 0.0 <= most
        sure = certain(op - HELD_FROM, side, a, b)
        if not sure and share > 0.0 and rests(code, i):
            sure = True
            found = RESTS if found == CLEAR else found
        if not sure and (turns or share == 0.0):
            found = UNDECIDED
        elif not sure and found != UNDECIDED and has_changed(code, i):
            found = CHANGED
        if turns and abs(side) == 1.0 and share > 0.0 and (sure or share < 2.0 * SHORTEST):
            near = max(b[0] - a[1] if side > 0.0 else a[0] - b[1], 0.0)
            begin, end = abs(code[i + 1, BEGIN_MARGIN]), abs(margin_of(code, i))
            rest = ROUNDING * sides(code, i)
            comes = end < begin and begin - code[i, REST] > rest  # else it leaves, or it rests
            if comes and near < min(end, code[i, NEAREST]):
                code[i, NEAREST], code[i, WHEN] = near, t
        put_range(
            code,
            i,
            range_held(op - HELD_FROM, side, a, b),
            rate_held(op - HELD_FROM, side, by_a, by_b),
        )
    return found


@sweep
def put_signal(code, i, op, share, width):
    """Store the range of a signal and of its rate in an interval."""
    a, b = code[i + 1, BEGIN_MARGIN], code[i + 1, 0]
    off = code[i + 1, BENDING] * share * share
    if op == NUMBER and code[i, 1] == OF_LENGTH:  # its rate turns fast where two points come close
        way = b - a
        off = max(abs(width * code[i, OLD_RATE] - way), abs(width * code[i, LENGTH_RATE] - way))
    code[i + 1, LOWEST], code[i + 1, HIGHEST] = min(a, b) - off, max(a, b) + off
    slope, off = 0.0, 3.0 * off
    if op == TIME:
        slope = 1.0
    elif width > 0.0:
        slope, off = (b - a) / width, off / width
    code[i + 1, LOWEST_RATE], code[i + 1, HIGHEST_RATE] = slope - off, slope + off


@part
def put_range(code, i, x, rate):
    """Store the range of a value and of its rate."""
    code[i + 1, LOWEST], code[i + 1, HIGHEST] = x
    code[i + 1, LOWEST_RATE], code[i + 1, HIGHEST_RATE] = rate


@part
def rate_at(code, i, k):
    """Return the (least, largest) rate of an operand."""
    row = 2 * int(code[i, k]) + 1
    return code[row, LOWEST_RATE], code[row, HIGHEST_RATE]


@part
def product(a, b):
    """Compute the range of a product."""
    return hull(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])


@sweep
def rate_range(op, x, a, b, by_a, by_b, by_c):
    """Compute the (least, largest) rate of an operation of range x, infinite if it is not known."""
    if op == ADD:
        return by_a[0] + by_b[0], by_a[1] + by_b[1]
    if op == SUB:
        return by_a[0] - by_b[1], by_a[1] - by_b[0]
    if op == MUL:
        one, two = product(by_a, b), product(a, by_b)
        return one[0] + two[0], one[1] + two[1]
    if op == DIV and not b[0] <= 0.0 <= b[1]:
        two = product(x, by_b)
        return product((by_a[0] - two[1], by_a[1] - two[0]), (1.0 / b[1], 1.0 / b[0]))
    if op == MIN or op == MAX:
        return min(by_a[0], by_b[0]), max(by_a[1], by_b[1])
    if op == CHOOSE or op == BLEND:
        return min(by_b[0], by_c[0]), max(by_b[1], by_c[1])
    if op == ABS:
        return product(by_a, (-1.0, 1.0))
    if op == SIN:
        return product(by_a, range_of(COS, a, a, a))
    if op == COS:
        low, high = range_of(SIN, a, a, a)
        return product(by_a, (-high, -low))
    if op == EXP:
        return product(by_a, x)
    if op == SQRT and x[0] > 0.0:
        return product(by_a, (0.5 / x[1], 0.5 / x[0]))
    if op == LESS or op == AT_MOST:
        return 0.0, 0.0
    return -math.inf, math.inf


@part
def rate_held(op, side, by_a, by_b):
    """Return the (least, largest) rate of a held comparison."""
    if op == LESS or op == AT_MOST:
        return 0.0, 0.0
    if op == ABS:
        return (-by_a[1], -by_a[0]) if side > 0.0 else by_a
    return by_a if (side > 0.0) == (op == MIN) else by_b


@part
def certain(op, side, a, b):
    """Check whether a comparison has the same result for all values in two ranges."""
    if op == ABS:
        b = (0.0, 0.0)
    if abs(side) < 1.0:
        return True
    if side > 0.0:
        return a[1] <= b[0] if op == AT_MOST else a[1] < b[0]
    return a[0] > b[1] if op == AT_MOST else a[0] >= b[1]


@part
def range_held(op, side, a, b):
    """Compute the (least, largest) value of a held comparison."""
    if op == LESS or op == AT_MOST:
        return 0.5 + 0.5 * side, 0.5 + 0.5 * side
    if op == ABS:
        return (-a[1], -a[0]) if side > 0.0 else a
    return a if (side > 0.0) == (op == MIN) else b


@sweep
def look_ahead(run, code, h):
    """Widen the ranges in which no comparison can change, so that next steps need no look."""
    for i in range(0, code.shape[0], 2):
        op = int(code[i, 0])
        if op <= V:
            room = STEPS_AHEAD * way_of(run, code, i, h)
            code[i + 1, BEGIN_MARGIN], code[i + 1, 0] = code[i + 1, 0] - room, code[i + 1, 0] + room
    control, corners = opened_run(run).control[0], opened_run(run).corners
    ends = control.ends
    if judged(code, control.clock.time, 0.0, 0.0) == CLEAR:
        ends.clear = control.clock.time + (1.0 + STEPS_AHEAD) * h
        if ends.corner < corners.shape[0]:
            ends.clear = min(ends.clear, corners[ends.corner])


@part
def way_of(run, code, i, h):
    """Find the largest deviation of a signal within a step, given its values and rates at both
    ends."""
    stages = opened_run(run).stages
    nq, _ = size_of_state(run)
    op, k = int(code[i, 0]), int(code[i, 1])
    if op == TIME:
        return h
    if op == NUMBER:
        return way_of_number(opened(opened_run(run).scene).drives.table, code, i)
    j = nq + (k if op == V else int(code[i, 2]))
    change = max(abs(stages[at.CANDIDATE, j] - stages[at.Y, j]), h * abs(rate_in(run, at.Y, j)))
    if op == V:
        return change
    return h * (max(abs(stages[at.Y, j]), abs(stages[at.CANDIDATE, j])) + change)


@part
def way_of_number(table, code, i):
    """Return `way_of` for a signal that is not part of the state. Between corners, inputs are
    straight."""
    what, n = int(code[i, 1]), int(code[i, 2])
    if what == OF_INPUT and table[n].lag == 0.0 and table[n].integrates == 0:
        return abs(code[i + 1, 0] - code[i + 1, BEGIN_MARGIN])
    return math.inf if 0 < what < CONSTRAINT else 0.0  # lengths are not known ahead


@sweep
def within_ranges(run, code, h):
    """Check whether the step in CANDIDATE stays where no comparison changes."""
    data = opened_run(run)
    stages, t = data.stages, data.control[0].clock.time
    nq, _ = size_of_state(run)
    inside = t + h <= data.control[0].ends.clear
    for i in range(0, code.shape[0], 2):
        if code[i, 0] == NUMBER and code[i, 1] == TOUCH:
            code[i, GAP_RANGE] = width_of_touch(data.scene, h)
            inside = inside and code[i, GAP_RANGE] == 0.0
    if not inside:
        return False
    for i in range(0, code.shape[0], 2):
        op = int(code[i, 0])
        if op == Q or op == V:
            j = int(code[i, 1]) + (nq if op == V else 0)
            x, y = stages[at.Y, j], stages[at.CANDIDATE, j]
            room = way_of(run, code, i, h)
            low, high = min(x, y) - room, max(x, y) + room
            inside = inside and code[i + 1, LOWEST] <= low and high <= code[i + 1, HIGHEST]
    return inside


# -- location -------------------------------------------------------------------------------------


@sweep
def step_to(run, code, w):
    """Take the step with width w into CANDIDATE and evaluate the program there."""
    call_step(opened_run(run).links.step, (run, w))
    see(run, code, at.CANDIDATE, opened_run(run).control[0].clock.time + w)


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
    ends.pieces = (ends.pieces if ends.pieces > 0 else ends.parts) - 1
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
        ends.shut = min(
            GROWTH * least, control.error.rtol * h if control.error.widths == CHOSEN else h
        )
    else:
        calm(control)
        turn_beyond(run, code, h, w)
    step_to(run, code, w)
    ends.sided = 0
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
def instant(control, h):
    """Find the least difference [s] of two widths of a step."""
    return ROUNDED * max(h, abs(control.clock.time))


@part
def calm(control):
    """Make steps narrower again after one that was not the least."""
    control.ends.shut = control.ends.shut / GROWTH


# -- sliding --------------------------------------------------------------------------------------


@part
def blend(code, i, share):
    """Give the comparison in row i this share of its true side."""
    side = 2.0 * share - 1.0
    code[i + 1, SIDE] = side if side != 0.0 else EPS


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
                control.ends.slid = i
                control.ends.share = share
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
    low, high, least = 0.0, 1.0, ROUNDING * (below - above)
    share = 0.0
    for _ in range(TRIALS):
        share = low + (high - low) * below / (below - above)
        found = beyond(run, code, i, share, w)
        if abs(found) <= least or not low < share < high:
            break
        if found > 0.0:
            above = 0.5 * above if low > 0.0 else above
            low, below = share, found
        else:
            below = 0.5 * below if high < 1.0 else below
            high, above = share, found
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
        control.clock.width = h
    ends.share = share
    if share == 0.0 or share == 1.0:
        code[i + 1, SIDE] *= 1.0 - EPS  # judged again from the next step on
        ends.slid = 0
        ends.sided = 0
    return h
