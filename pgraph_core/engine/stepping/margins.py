"""Margins of comparisons in expressions, their sides, and their values within a step."""

import math

from ...tolerances import EPS, ROUNDING
from .. import layout as at
from ..arrays import opened_run
from ..compiler.jit import part, sweep
from ..edges import DEEPEST, compared
from ..motion import opened
from ..signals import (
    ABS,
    AT_MOST,
    HELD_FROM,
    LESS,
    NEAREST,
    NUMBER,
    REST,
    SIDE,
    SUB,
    WHEN,
    evaluate,
)
from .bracket import BELOW, NOTHING, ROUNDED, Margins
from .control.ends import hold_sides
from .measured import (
    LENGTH_RATE,
    observe,
)
from .state import call_step, size_of_state

# of a second row: of a coordinate or velocity, what bends its way; the value, or the margin, where
# a part begins; the margin where a bracket ends and where it was looked at last, positive while the
# comparison keeps its result
BENDING, BEGIN_MARGIN, END_MARGIN, NOW_MARGIN = 1, 2, 7, 8
LOWEST_RATE, HIGHEST_RATE = 5, 6  # range of the rate
OLD_RATE = 6  # column in the row of a length: rate at the start of an interval
CLEAR, CHANGED, UNDECIDED, RESTS = 0, 1, 2, 3
SHORTEST = 1.0 / (1 << DEEPEST)  # part of a step: what changes twice within it changes nothing


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
    hold_sides(ends)


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
def step_to(run, code, w):
    """Take the step with width w into CANDIDATE and evaluate the program there."""
    call_step(opened_run(run).links.step, (run, w))
    see(run, code, at.CANDIDATE, opened_run(run).control[0].clock.time + w)


@sweep
def watch_sides(code):
    """Fill NOW_MARGIN from the state that was evaluated last. Returns whether any has changed."""
    found = False
    for i in range(0, code.shape[0], 2):
        code[i + 1, NOW_MARGIN] = NOTHING
        if code[i, 0] >= HELD_FROM and abs(code[i + 1, SIDE]) == 1.0:
            size, changed = abs(margin_of(code, i)), has_changed(code, i)
            code[i + 1, NOW_MARGIN] = -max(size, BELOW) if changed else size
            found = found or changed
    return found


@sweep
def look_at_sides(run, low, w):
    """Take the step of width low + w, fill NOW_MARGIN and return whether any has changed."""
    code = opened(opened_run(run).scene).loads.signals[0]
    step_to(run, code, low + w)
    return watch_sides(code)


# A program on its side is a table of margins, of which each second one is that of an instruction.


@part
def rounding_of_sides(margins, n):
    """Return the rounding of the margin of a comparison."""
    return ROUNDED * sides(margins.T, n - 1)


@part
def is_jump(run, margins, n):
    """Check whether the comparison with margin n has changed, and a value jumps with it."""
    code, i = margins.T, n - 1
    return code[i, 0] >= HELD_FROM and jumps(code, i) and has_changed(code, i)


@part
def note_near_side(run, margins, n, near, w):
    """Keep how near to zero margin n comes at width w of the step."""
    code, i = margins.T, n - 1
    if near < code[i, NEAREST]:
        code[i, NEAREST], code[i, WHEN] = near, opened_run(run).control[0].clock.time + w


SIDES = Margins(1, 2, BEGIN_MARGIN, END_MARGIN, NOW_MARGIN, look_at_sides, rounding_of_sides)


@part
def instant(control, h):
    """Find the least difference [s] of two widths of a step."""
    return ROUNDED * max(h, abs(control.clock.time))


@part
def blend(code, i, share):
    """Give the comparison in row i this share of its true side."""
    side = 2.0 * share - 1.0
    code[i + 1, SIDE] = side if side != 0.0 else EPS
