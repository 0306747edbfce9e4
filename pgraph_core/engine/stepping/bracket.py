"""The first zero of several margins within a step.

A margin is positive until its event and negative from then on. Comparisons of the motion, user
events and phases of contacts each fill a table of margins, with a row for each end of a bracket and
one for the place that was looked at last. `locating` makes the search for one of these tables.
"""

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from ...tolerances import EPS
from ..compiler.jit import part, sweep

NOTHING = 1.0  # margin of what is not watched
BELOW = sys.float_info.min  # stand-in for a margin of zero, which counts as reached
ROUNDED = 4 * EPS  # width of an instant, relative to the step or the time
AHEAD = 12  # looks by which secants may be behind bisections
TRIALS = 80  # looks: bisections need 52, and AHEAD more


class Margins(NamedTuple):
    """The columns of a table of margins [row, n] that a search reads."""

    first: int  # every `step`-th column from here on is a margin
    step: int
    low: int  # rows: where a bracket begins and ends, and where it was looked at last
    high: int
    now: int
    look: Any  # run, low, w: fill row `now` at a width low + w -> whether a margin is below zero
    rounding: Any  # margins, n -> size below which a margin that is negative is zero


class Bracket(NamedTuple):
    """Two widths between which the first margin becomes zero."""

    begin: Any
    end: Any
    room: Any  # largest width after the next look
    moved: Any  # 1 if the last look moved the end, -1 if it moved the begin, else 0


@part
def whole(begin, end):
    """Return the bracket from `begin` to `end`."""
    return Bracket(begin, end, 0.5 * (1 << AHEAD) * (end - begin), 0)


@part
def narrowed(bracket, w, ended):
    """Return the part of a bracket up to w if the event has happened there, else from w on."""
    if ended:
        return Bracket(bracket.begin, w, 0.5 * bracket.room, 1)
    return Bracket(w, bracket.end, 0.5 * bracket.room, -1)


@part
def secant(bracket, before, after):
    """Compute where a margin is zero, from its values at the begin and at the end, on a line."""
    before = max(before, 0.0)
    share = before / (before - after) if before > after else 0.0
    return bracket.begin + share * (bracket.end - bracket.begin)


@part
def next_try(bracket, zero, apart):
    """Return the next width to look at, near `zero` and clear of both ends.

    A bracket is never wider than bisections would have left it AHEAD looks ago, so that a kink, a
    jump or a flat zero takes AHEAD looks more than they do [Oliveira and Takahashi 2020].
    """
    middle = 0.5 * (bracket.begin + bracket.end)
    aside = max(bracket.room - 0.5 * (bracket.end - bracket.begin), 0.0)
    w = min(max(zero, middle - aside), middle + aside)
    return min(max(w, bracket.begin + 0.3 * apart), bracket.end - 0.3 * apart)


@part
def tempered(kept, old, new):
    """Return the margin at the end of a bracket that stays again, for the next secant.

    The other end moved from the margin `old` to `new`: Pegasus [Dowell and Jarratt 1972].
    """
    return kept * (old / (old + new)) if old * new > 0.0 else kept


@part
def narrowed_by(bracket, ends, w, value):
    """Return a bracket and the margins at its ends after a look at w, for a single margin."""
    before, after = ends
    if value < 0.0:
        if bracket.moved == 1:
            before = tempered(before, after, value)
        return narrowed(bracket, w, True), (before, value)
    if bracket.moved == -1:
        after = tempered(after, before, value)
    return narrowed(bracket, w, False), (value, after)


@part
def over(margins, row):
    """Check whether a margin is below zero."""
    found = False
    for n in range(margins.shape[1]):
        found = found or margins[row, n] < 0.0
    return found


def locating(known: Margins) -> Callable[..., Any]:
    """Return the search for the first zero in a table of margins."""
    first, step, low_row, high_row, now_row, look, rounding = known

    @sweep
    def moved(margins, near, far, again):
        """Move one end of a bracket to the last look. `again`: it has moved there before, too."""
        for n in range(first, margins.shape[1], step):
            if again:
                margins[far, n] = tempered(margins[far, n], margins[near, n], margins[now_row, n])
            margins[near, n] = margins[now_row, n]

    @sweep
    def first_zero(margins, bracket):
        """Compute the width at which secants reach the first zero."""
        best = bracket.end
        for n in range(first, margins.shape[1], step):
            if margins[high_row, n] < 0.0:
                best = min(best, secant(bracket, margins[low_row, n], margins[high_row, n]))
        return best

    @sweep
    def is_zero(margins):
        """Check whether all margins that are below zero now are zero up to rounding."""
        found = True
        for n in range(first, margins.shape[1], step):
            if margins[now_row, n] < 0.0:
                found = found and margins[now_row, n] >= -rounding(margins, n)
        return found

    @sweep
    def located(run, margins, low, width, apart):
        """Return the width from `low` at which an event has happened. It was looked at last.

        Row `low` has the margins at `low`, and row `now` those at the end of this width. Widths
        that are `apart` [s] are one instant.
        """
        bracket, ended = whole(0.0, width), True
        moved(margins, high_row, low_row, False)
        for _ in range(TRIALS):
            if bracket.end - bracket.begin <= apart or (ended and is_zero(margins)):
                break
            w = next_try(bracket, first_zero(margins, bracket), apart)
            ended = look(run, low, w)
            if ended:
                moved(margins, high_row, low_row, bracket.moved == 1)
            else:
                moved(margins, low_row, high_row, bracket.moved == -1)
            bracket = narrowed(bracket, w, ended)
        if not ended:
            look(run, low, bracket.end)
        return bracket.end

    return located
