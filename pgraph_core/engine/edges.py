"""Times at which a comparison of times within an expression changes. Steps end there.

Comparisons are `<` and `<=`, as well as those in min, max, abs, tables and smooth steps. An
interval in which none can change, by interval arithmetic [Moore 1966], has no edge. Others are
halved. The programs are defined in `signals`. The fifth number of an instruction marks required
values and comparisons. The second row of an instruction receives its value, the previous value, and
the smallest and largest values in an interval.
"""

import math

from ..tolerances import EPS
from .compiler.elementary import acos, asin, atan, cos, exp, log, power, sin, tan
from .compiler.jit import kernel, part, sweep
from .compiler.kinds import F1, F2, f8, i8
from .signals import (
    ABS,
    ACOS,
    ADD,
    ASIN,
    AT_MOST,
    ATAN,
    BLEND,
    CHOOSE,
    COS,
    DIV,
    EXP,
    LESS,
    LOG,
    MAX,
    MIN,
    MUL,
    NUMBER,
    POW,
    SIN,
    SQRT,
    SUB,
    TAN,
    TIME,
    value_of,
)

MARK, NEEDED, COMPARES = 4, 1, 2  # column of an operation, and its values
# of a second row: the result of a comparison before, and the range of a value in an interval
RESULT_BEFORE, LOWEST, HIGHEST = 1, 3, 4
DEEPEST = 26  # halvings, to √EPS of a search: what changes twice within that changes nothing
# Intervals of a search. The edges of 30 expressions took at most 152, and were the same from 256 to
# 16384. A comparison of two equal curves would take 2^DEEPEST.
MOST_LOOKS = 4096


@sweep
def next_edge(code, t, stop):
    """Find the first time in (t, stop] with another result of a comparison than at t, or
    infinity.
    """
    changed(code, t, True)
    share = 1.0
    index = 0
    depth = 0
    looks = 0
    begin = t
    while begin < stop:
        last = (index + 1) * share == 1.0
        end = stop if last else t + (stop - t) * ((index + 1) * share)
        wide = begin < 0.5 * (begin + end) < end
        if wide and depth < DEEPEST and looks < MOST_LOOKS:
            looks += 1
            if may_change(code, begin, end):
                index = 2 * index
                depth += 1
                share *= 0.5
                continue
        elif changed(code, end, False):
            return first_change(code, begin, end)
        begin = end
        index += 1
        while depth > 0 and index & 1 == 0:
            index = index >> 1
            depth -= 1
            share *= 2.0
    return math.inf


@kernel(i8(F2, f8, f8, F1), later=True)
def edges(code, begin, end, out):
    """Write the next edges of a program in (begin, end] into `out`. Returns how many.

    Times within rounding error of the start or of an edge are assigned to it.
    """
    near = EPS * max(abs(begin), abs(end))
    for n in range(out.shape[0]):
        out[n] = next_edge(code, begin + near, end)
        if out[n] == math.inf:
            return n
        begin = out[n]
    return out.shape[0]


@sweep
def first_change(code, low, high):
    """Find the first time by which something has changed between two times."""
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if changed(code, middle, False):
            high = middle
        else:
            low = middle


@sweep
def changed(code, t, keep):
    """Check whether a comparison has another result at t than before. `keep` stores them."""
    other = False
    for i in range(0, code.shape[0], 2):
        op = int(code[i, 0])
        if op == NUMBER:
            code[i + 1, 0] = code[i, 4]
        elif op == TIME:
            code[i + 1, 0] = t
        elif code[i, MARK] > 0.0:
            a = code[2 * int(code[i, 1]) + 1, 0]
            b = code[2 * int(code[i, 2]) + 1, 0]
            c = code[2 * int(code[i, 3]) + 1, 0]
            code[i + 1, 0] = value_of(op, a, b, c)
            if code[i, MARK] == COMPARES:
                now = compared(op, a, b)
                other = other or now != code[i + 1, RESULT_BEFORE]
                if keep:
                    code[i + 1, RESULT_BEFORE] = now
    return other


@part
def compared(op, a, b):
    """Return 1 if the comparison within an operation is true, else 0."""
    if op == AT_MOST:
        return 1.0 if a <= b else 0.0
    return 1.0 if a < (0.0 if op == ABS else b) else 0.0


@sweep
def may_change(code, begin, end):
    """Return False if no comparison changes in an interval."""
    for i in range(0, code.shape[0], 2):
        op = int(code[i, 0])
        if op == NUMBER:
            least, most = code[i, 4], code[i, 4]
        elif op == TIME:
            least, most = begin, end
        elif code[i, MARK] > 0.0:
            a = range_at(code, i, 1)
            b = range_at(code, i, 2)
            c = range_at(code, i, 3)
            if code[i, MARK] == COMPARES and not settled(op, a, b):
                return True
            least, most = range_of(op, a, b, c)
        else:
            continue
        code[i + 1, LOWEST] = least
        code[i + 1, HIGHEST] = most
    return False


@part
def range_at(code, i, operand):
    """Return the (least, largest) value of an operand."""
    k = 2 * int(code[i, operand]) + 1
    return code[k, LOWEST], code[k, HIGHEST]


@part
def settled(op, a, b):
    """Check whether a comparison has the same result for all values in two ranges."""
    if op == AT_MOST:
        return a[1] <= b[0] or a[0] > b[1]
    if op == ABS:
        return a[1] < 0.0 or a[0] >= 0.0
    return a[1] < b[0] or a[0] >= b[1]


@sweep
def range_of(op, a, b, c):
    """Compute the (least, largest) value of an operation on ranges, infinite if it is not known."""
    known = finite_range(a) and finite_range(b) and finite_range(c)
    least, most = -math.inf, math.inf
    if not known:
        return least, most
    if op == ADD:
        return a[0] + b[0], a[1] + b[1]
    if op == SUB:
        return a[0] - b[1], a[1] - b[0]
    if op == MUL:
        return hull(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])
    if op == DIV:
        if b[0] <= 0.0 <= b[1]:
            return least, most
        return hull(a[0] / b[0], a[0] / b[1], a[1] / b[0], a[1] / b[1])
    if op == MIN:
        return min(a[0], b[0]), min(a[1], b[1])
    if op == MAX:
        return max(a[0], b[0]), max(a[1], b[1])
    if op == CHOOSE or op == BLEND:
        if op == BLEND and 0.0 < a[0] < 1.0:
            return min(b[0], c[0]), max(b[1], c[1])
        if a[0] > 0.0 or a[1] < 0.0:
            return b
        if a[0] == 0.0 and a[1] == 0.0:
            return c
        return min(b[0], c[0]), max(b[1], c[1])
    if op == LESS or op == AT_MOST:
        if settled(op, a, b):
            x = compared(op, a[0], b[0])
            return x, x
        return 0.0, 1.0
    if op == ABS:
        most = max(-a[0], a[1])
        return (0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))), most
    return range_of_function(op, a, b)


@sweep
def range_of_function(op, a, b):
    """Compute the (least, largest) value of an elementary function on a range."""
    if op == SIN:
        return range_of_wave(a, sin(a[0]), sin(a[1]), 0.5 * math.pi)
    if op == COS:
        return range_of_wave(a, cos(a[0]), cos(a[1]), 0.0)
    if op == SQRT:
        return math.sqrt(max(a[0], 0.0)), math.sqrt(max(a[1], 0.0))
    if op == EXP:
        return exp(a[0]), exp(a[1])
    if op == ATAN:
        return atan(a[0]), atan(a[1])
    if op == ASIN:
        return asin(max(a[0], -1.0)), asin(min(a[1], 1.0))
    if op == ACOS:
        return acos(min(a[1], 1.0)), acos(max(a[0], -1.0))
    if op == LOG and a[0] > 0.0:
        return log(a[0]), log(a[1])
    if op == TAN and not within(a, 0.5 * math.pi, math.pi):
        return tan(a[0]), tan(a[1])
    if op == POW and (a[0] > 0.0 or (a[0] == 0.0 and b[0] > 0.0)):
        return hull(power(a[0], b[0]), power(a[0], b[1]), power(a[1], b[0]), power(a[1], b[1]))
    return -math.inf, math.inf


@part
def range_of_wave(a, first, last, top):
    """Compute the range of a sine or cosine with a peak at `top`, from its values at both ends."""
    most = 1.0 if within(a, top, 2.0 * math.pi) else max(first, last)
    least = -1.0 if within(a, top + math.pi, 2.0 * math.pi) else min(first, last)
    return least, most


@part
def within(a, place, period):
    """Check whether a range may contain one of the periodic points."""
    if a[1] - a[0] >= period or not max(-a[0], a[1]) < 1.0 / EPS:
        return True
    return math.floor((a[1] - place) / period) >= -math.floor((place - a[0]) / period)


@part
def hull(a, b, c, d):
    """Compute the (least, largest) of four numbers, infinite if one of them is none."""
    least, most = min(min(a, b), min(c, d)), max(max(a, b), max(c, d))
    if not (abs(a) < math.inf and abs(b) < math.inf and abs(c) < math.inf and abs(d) < math.inf):
        return -math.inf, math.inf
    return least, most


@part
def finite_range(a):
    """Check whether both ends of a range are finite."""
    return abs(a[0]) < math.inf and abs(a[1]) < math.inf
