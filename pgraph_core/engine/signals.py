"""Expressions compiled to programs that a single loop evaluates, without model-specific code.

A program is a table of instructions, two rows each. The first row is the operation, its operands
a, b, c (numbers of earlier instructions, or an index into q or v) and a number; the second one
receives the value, and its first and second derivative in time where nothing but time varies.
"""

import math

from .compiler.elementary import acos, asin, atan, cos, exp, log, power, sin, tan
from .compiler.jit import kernel, part, sweep
from .compiler.kinds import F1, F2, I2, f8, i8, void
from .loads import LOADS, number_in_knots, put_in_knots

COLUMNS, OWN_COLUMNS = 5, 4
NUMBER_AT = 4  # column of the number of an instruction
(
    NUMBER, TIME, Q, V, ADD, SUB, MUL, DIV, MIN, MAX, CHOOSE, LESS, AT_MOST, ABS, SQRT, SIN, COS,
    TAN, EXP, LOG, ASIN, ACOS, ATAN, POW, BLEND,
) = range(25)  # fmt: skip
COMPARING = MIN, MAX, LESS, AT_MOST, ABS
HELD_FROM = 25  # added to a comparison of the motion: a run holds its result within a step
# operations whose value jumps
JUMPING = CHOOSE, LESS, AT_MOST, HELD_FROM + LESS, HELD_FROM + AT_MOST
# in the second row of a held comparison: 1 if it is true, -1 if not, 0 if not held; in between the
# motion slides along its margin, with a share of both sides
SIDE = 1
# in the first one: how close to zero the margin was where it may have turned, and when; and where
# the comparison changed last, which is as far from zero as the margin of what rests there
NEAREST, WHEN, REST = 5, 6, 7
# where a value goes: the instruction, DRIVE, a kind of load, counted from 1, LAW or GATE, the first
# knot, pair or rider, how many, the column; the number of its part, and 1 once it was not valid
DRIVE, LAW, GATE = 0, 1 + len(LOADS), 2 + len(LOADS)
OWNER, FAILED, TARGETS = 5, 6, 7
# states of controls and muscles: the instruction of the rate or the new value, that of the time
# between samples or -1, that of the first value, the number of the part, and 1 once the value was
# not finite; the kind of load that reads it, counted from 1, or 0, the knot and the column, behind
# which the load writes the rate of a state that has no instruction for it (-1); and the instruction
# of the constant input that it follows, or -1
SAMPLE, START, CONTROL, LOST, READER, KNOT_OF, IN_KNOT, INPUT_OF, STATES = 1, 2, 3, 4, 5, 6, 7, 8, 9


@sweep
def evaluate(code, first, count, t, q, v):
    """Evaluate `count` instructions starting at row `first`."""
    for i in range(first, first + 2 * count, 2):
        op = int(code[i, 0])
        if op == NUMBER:
            code[i + 1, 0] = code[i, 4]
        elif op == Q:
            code[i + 1, 0] = q[int(code[i, 1])]
        elif op == V:
            code[i + 1, 0] = v[int(code[i, 1])]
        elif op == TIME:
            code[i + 1, 0] = t
        else:
            a = code[first + 2 * int(code[i, 1]) + 1, 0]
            b = code[first + 2 * int(code[i, 2]) + 1, 0]
            c = code[first + 2 * int(code[i, 3]) + 1, 0]
            if op < HELD_FROM:
                code[i + 1, 0] = value_of(op, a, b, c)
            else:
                code[i + 1, 0] = held(op - HELD_FROM, code[i + 1, SIDE], a, b)


@part
def held(op, side, a, b):
    """Return the value of a comparison, using its held result if there is one."""
    if side == 0.0:
        return value_of(op, a, b, b)
    if op == LESS or op == AT_MOST:
        return 0.5 + 0.5 * side
    if op == ABS:
        return -a if side > 0.0 else a
    return a if (side > 0.0) == (op == MIN) else b


@kernel(void(F2, f8, F1, F1), later=True)
def values(code, t, q, v):
    """Evaluate a whole program."""
    evaluate(code, 0, code.shape[0] // 2, t, q, v)


@part
def value_of(op, a, b, c):
    """Compute the value of an operation."""
    if op == ADD:
        return a + b
    if op == SUB:
        return a - b
    if op == MUL:
        return a * b
    if op == DIV:
        return a / b
    if op == MIN:
        return b if b < a else a
    if op == MAX:
        return b if b > a else a
    if op == CHOOSE:
        return b if a != 0.0 else c
    if op == LESS:
        return 1.0 if a < b else 0.0
    if op == AT_MOST:
        return 1.0 if a <= b else 0.0
    if op == ABS:
        return abs(a)
    if op == SQRT:
        return math.sqrt(a) if a >= 0.0 else math.nan
    if op == BLEND and 0.0 < a < 1.0:
        return a * b + (1.0 - a) * c
    if op == BLEND:
        return b if a != 0.0 else c
    return function_of(op, a, b)


@sweep
def function_of(op, a, b):
    """Compute the value of an elementary function, or nan outside its domain."""
    if op == SIN:
        return sin(a)
    if op == COS:
        return cos(a)
    if op == TAN:
        return tan(a)
    if op == EXP:
        return exp(a)
    if op == LOG:
        return log(a) if a > 0.0 else math.nan
    if op == ASIN:
        return asin(a) if abs(a) <= 1.0 else math.nan
    if op == ACOS:
        return acos(a) if abs(a) <= 1.0 else math.nan
    if op == ATAN:
        return atan(a)
    return power(a, b)


@sweep
def differentiate(code, first, count):
    """Compute first and second time derivatives of a program of time alone, after `evaluate`."""
    for i in range(first, first + 2 * count, 2):
        op = int(code[i, 0])
        rate = 1.0 if op == TIME else 0.0
        bend = 0.0
        if op > V:
            a = code[first + 2 * int(code[i, 1]) + 1]
            b = code[first + 2 * int(code[i, 2]) + 1]
            c = code[first + 2 * int(code[i, 3]) + 1]
            rate, bend = rates_of(op, a, b, c, code[i + 1, 0])
        code[i + 1, 1] = rate
        code[i + 1, 2] = bend


@kernel(void(F2, F1, F2), later=True)
def rates(code, times, out):
    """Write the value and rate of a program of time only into `out`, at each time (n, 2)."""
    count = code.shape[0] // 2
    for i in range(times.shape[0]):
        evaluate(code, 0, count, times[i], times, times)
        differentiate(code, 0, count)
        out[i, 0] = code[2 * count - 1, 0]
        out[i, 1] = code[2 * count - 1, 1]


@part
def rates_of(op, a, b, c, x):
    """Compute (x', x'') of an operation with value x and operands (value, rate, second rate)."""
    if op == ADD:
        return a[1] + b[1], a[2] + b[2]
    if op == SUB:
        return a[1] - b[1], a[2] - b[2]
    if op == MUL:
        return a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]
    if op == DIV:
        rate = (a[1] - x * b[1]) / b[0]
        return rate, (a[2] - 2.0 * rate * b[1] - x * b[2]) / b[0]
    if op == LESS or op == AT_MOST:
        return 0.0, 0.0
    if op == MIN:
        return (b[1], b[2]) if b[0] < a[0] else (a[1], a[2])
    if op == MAX:
        return (b[1], b[2]) if b[0] > a[0] else (a[1], a[2])
    if op == CHOOSE:
        return (b[1], b[2]) if a[0] != 0.0 else (c[1], c[2])
    if op == POW:
        return rates_of_power(a, b, x)
    slope, curve = slopes_of(op, a[0], x)
    return slope * a[1], slope * a[2] + curve * a[1] * a[1]


@part
def rates_of_power(a, b, x):
    """Compute (x', x'') of x = a^b."""
    if b[1] == 0.0 and b[2] == 0.0:
        n = b[0]
        slope = n * power(a[0], n - 1.0) if n != 0.0 else 0.0
        curve = n * (n - 1.0) * power(a[0], n - 2.0) if n * (n - 1.0) != 0.0 else 0.0
        return slope * a[1], slope * a[2] + curve * a[1] * a[1]
    root = log(a[0])  # x = exp(b log a)
    part_of_a = a[1] / a[0]
    rate = b[1] * root + b[0] * part_of_a
    bend = b[2] * root + 2.0 * b[1] * part_of_a + b[0] * (a[2] / a[0] - part_of_a * part_of_a)
    return x * rate, x * (bend + rate * rate)


@part
def slopes_of(op, a, x):
    """Compute the first and second derivative of a function of a single number a, with value x."""
    if op == ABS:
        return (1.0 if a >= 0.0 else -1.0), 0.0
    if op == SQRT:
        return 0.5 / x, -0.25 / (x * a)
    if op == SIN:
        return cos(a), -x
    if op == COS:
        return -sin(a), -x
    if op == TAN:
        slope = 1.0 + x * x
        return slope, 2.0 * x * slope
    if op == EXP:
        return x, x
    if op == LOG:
        return 1.0 / a, -1.0 / (a * a)
    if op == ATAN:
        slope = 1.0 / (1.0 + a * a)
        return slope, -2.0 * a * slope * slope
    slope = 1.0 / math.sqrt(1.0 - a * a) if op == ASIN else -1.0 / math.sqrt(1.0 - a * a)
    return slope, slope * slope * slope * a


@sweep
def follow_signals(signals, drives, loads, t, q, v):
    """Write the values of all expressions to the knots of drives and loads.

    Returns 0, or -1 if a signal is not finite or a friction coefficient is negative.
    """
    code, targets, states = signals
    evaluate(code, 0, code.shape[0] // 2, t, q, v)
    failed = 0
    for n in range(targets.shape[0]):
        value = code[2 * targets[n, 0] + 1, 0]
        if not abs(value) < math.inf or (targets[n, 1] == LAW and value < 0.0):
            failed = -1
            targets[n, FAILED] = 1
        first, column = targets[n, 2], targets[n, 4]
        for k in range(first, first + targets[n, 3]):
            if targets[n, 1] == DRIVE:
                drives.knots[k, 1] = value
                drives.knots[k, 3] = value
            elif targets[n, 1] == GATE:
                loads.riders[3][k, column] = value
            else:
                put_in_knots(loads, targets[n, 1] - 1, k, column, value)
    for n in range(states.shape[0]):
        if states[n, READER] > 0:
            kind, state = states[n, READER] - 1, v[v.shape[0] - states.shape[0] + n]
            put_in_knots(loads, kind, states[n, KNOT_OF], states[n, IN_KNOT], state)
        if states[n, 0] < 0:
            continue
        if states[n, SAMPLE] < 0 and not abs(code[2 * states[n, 0] + 1, 0]) < math.inf:
            failed = -1
            states[n, LOST] = 1
    return failed


@sweep
def follow_frictions(signals, laws):
    """Write the friction of contacts to their laws, after `follow_signals`."""
    code, targets, _ = signals
    for n in range(targets.shape[0]):
        if targets[n, 1] == LAW:
            for k in range(targets[n, 2], targets[n, 2] + targets[n, 3]):
                laws[k].friction = code[2 * targets[n, 0] + 1, 0]
                laws[k].static_friction = laws[k].friction


@sweep
def put_rates(signals, loads, tau):
    """Write the rates of all states into the last entries of τ, after the loads that give some."""
    code, _, states = signals
    first = tau.shape[0] - states.shape[0]
    for n in range(states.shape[0]):
        tau[first + n] = 0.0
        if states[n, 0] < 0:
            if states[n, READER] > 0:
                place = states[n, KNOT_OF], states[n, IN_KNOT] + 1
                tau[first + n] = number_in_knots(loads, states[n, READER] - 1, place[0], place[1])
        elif states[n, SAMPLE] < 0:
            tau[first + n] = code[2 * states[n, 0] + 1, 0]


@sweep
def begin_states(signals, t, q, v, settled):
    """Give the states of controls their first values, some of which may follow from others.

    Those whose rates are computed with the loads keep their values if they are `settled`.
    """
    code, _, states = signals
    first = v.shape[0] - states.shape[0]
    for _ in range(states.shape[0] + 1):
        evaluate(code, 0, code.shape[0] // 2, t, q, v)
        for n in range(states.shape[0]):
            if states[n, 0] >= 0 or not settled:
                v[first + n] = code[2 * states[n, START] + 1, 0]


@part
def gives_rates(states):
    """Check whether a load gives the rate of a state."""
    found = False
    for n in range(states.shape[0]):
        found = found or (states[n, 0] < 0 and states[n, READER] > 0)
    return found


@sweep
def leave_to_loads(signals, loads):
    """Let loads find the states whose rates they give, as they do where the knots have none."""
    _, _, states = signals
    for n in range(states.shape[0]):
        if states[n, 0] < 0 and states[n, READER] > 0:
            kind, knot = states[n, READER] - 1, states[n, KNOT_OF]
            put_in_knots(loads, kind, knot, states[n, IN_KNOT], math.nan)


@sweep
def take_from_loads(signals, loads, v):
    """Copy the states whose rates loads give from the knots. Returns True if one has changed."""
    _, _, states = signals
    first, changed = v.shape[0] - states.shape[0], False
    for n in range(states.shape[0]):
        if states[n, 0] < 0 and states[n, READER] > 0:
            kind, knot = states[n, READER] - 1, states[n, KNOT_OF]
            found = number_in_knots(loads, kind, knot, states[n, IN_KNOT])
            changed = changed or v[first + n] != found
            v[first + n] = found
    return changed


@kernel(void(F2, I2, f8, F1, F1, i8), later=True)
def first_values(code, states, t, q, v, settled):
    """Write the first values of the states of controls behind the velocities, see
    `begin_states`."""
    begin_states((code, states, states), t, q, v, settled == 1)


@part
def sample_time(code, states, n):
    """Return the time between the samples of state n [s]."""
    return code[2 * states[n, SAMPLE], 4]


@sweep
def next_sample(signals, t, near):
    """Compute the time of the first sample after t [s], which is not within `near` of it."""
    code, _, states = signals
    found = math.inf
    for n in range(states.shape[0]):
        if states[n, SAMPLE] >= 0:
            apart = sample_time(code, states, n)
            k = math.floor(t / apart)
            while k * apart <= t + near:
                k += 1.0
            found = min(found, k * apart)
    return found


@sweep
def take_samples(signals, t, near, q, v):
    """Give the states whose sample is at t, within `near`, their new values. Returns how many."""
    code, _, states = signals
    first = v.shape[0] - states.shape[0]
    count = 0
    for n in range(states.shape[0]):
        if states[n, SAMPLE] >= 0:
            apart = sample_time(code, states, n)
            if abs(apart * math.floor(t / apart + 0.5) - t) <= near:
                if count == 0:
                    evaluate(code, 0, code.shape[0] // 2, t, q, v)
                count += 1
                v[first + n] = code[2 * states[n, 0] + 1, 0]
                if not abs(v[first + n]) < math.inf:
                    states[n, LOST] = 1
    return count
