"""Ranges of margins over a step, and the place up to which none can change its sign.

Margins and their rates are bounded by interval arithmetic [Moore 1966] over the states within the
step, which are bounded by the states and rates at both ends.
"""

import math

from ...tolerances import ROUNDING
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import part, sweep
from ..edges import HIGHEST, LOWEST, hull, range_at, range_of
from ..motion import opened
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
)
from .control.ends import set_clear
from .margins import (
    BEGIN_MARGIN,
    BENDING,
    CHANGED,
    CLEAR,
    HIGHEST_RATE,
    LOWEST_RATE,
    OLD_RATE,
    RESTS,
    SHORTEST,
    UNDECIDED,
    has_changed,
    margin_of,
    rests,
    see,
    sides,
)
from .measured import (
    CONSTRAINT,
    GAP_RANGE,
    LENGTH_RATE,
    OF_INPUT,
    OF_LENGTH,
    OF_SPEED,
    TOUCH,
    width_of_touch,
)
from .minima import SPAN
from .state import rate_of, size_of_state

STEPS_AHEAD = 16  # steps of this way within which nothing can change: later ones need no look


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
        clear = control.clock.time + (1.0 + STEPS_AHEAD) * h
        if ends.corner < corners.shape[0]:
            clear = min(clear, corners[ends.corner])
        set_clear(ends, clear)


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
