"""Minima of values of which some are known: of parabolas and cubics, and by golden sections."""

import math
from collections.abc import Callable
from typing import Any

from ...tolerances import SOLVED, step_of_differences
from ..compiler.jit import part, sweep
from .bracket import Margins
from .widths import GOLDEN

SPAN = 2.0 * step_of_differences(3)  # fraction of a step; three values give a rate and a curvature


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
def cubic_vertex(rise, falls, rises):
    """Return the minimum (x, y) of a cubic from (0, 0) to (1, `rise`) with these rates there."""
    square = 3.0 * rise - 2.0 * falls - rises
    cube = falls + rises - 2.0 * rise
    x = -falls / (square + math.sqrt(max(square * square - 3.0 * cube * falls, 0.0)))
    return x, x * (falls + x * (square + x * cube))


# -- the minimum of one value, in a bracket of three places x with values y -----------------------


@part
def is_inside(y):
    """Check whether a bracket has a minimum inside."""
    return y[1] < y[0] and y[1] < y[2]


@part
def convex_bound(x, y):
    """Return a bound of a convex value: it is above the lines through the middle and the ends."""
    left, right = (y[0] - y[1]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    return min(y[1] - right * (x[1] - x[0]), y[1] - left * (x[2] - x[1]))


@part
def next_least(x, y, k):
    """Return (x, y, w): the bracket without what the values exclude, and the place of look k.

    Vertices take turns with golden sections of the wider side.
    """
    if is_inside(y):
        w, _ = vertex(x, y)
        if k % 2 == 1 or not abs(w - x[1]) > SOLVED * SOLVED:
            left = x[1] - x[0] > x[2] - x[1]
            w = x[1] - GOLDEN * (x[1] - x[0]) if left else x[1] + GOLDEN * (x[2] - x[1])
        return x, y, w
    if y[0] <= y[2]:
        x, y = (x[0], x[1], x[1]), (y[0], y[1], y[1])
        return x, y, x[0] + GOLDEN * (x[2] - x[0])
    x, y = (x[1], x[1], x[2]), (y[1], y[1], y[2])
    return x, y, x[2] - GOLDEN * (x[2] - x[0])


@part
def narrowed_least(x, y, w, value):
    """Return the bracket (x, y) that a value at w within it leaves."""
    a, m, b = x
    fa, fm, fb = y
    if not a < m < b or value < fm:
        if a < m < w:
            a, fa = m, fm
        elif w < m < b:
            b, fb = m, fm
        m, fm = w, value
    elif w < m:
        a, fa = w, value
    else:
        b, fb = w, value
    return (a, m, b), (fa, fm, fb)


# -- how far beyond zero margins turn back --------------------------------------------------------


@part
def beside(w, h):
    """Compute (begin, end) of a part of a step that ends or begins at w, for second differences."""
    return (w - SPAN * h, w) if 2.0 * w > h else (w, w + SPAN * h)


def turning(known: Margins, counts: Any, note: Any) -> Callable[..., Any]:
    """Return the function that keeps how far beyond zero margins of a table turn back.

    counts(run, margins, n) checks whether a margin has just changed and is watched, and note(run,
    margins, n, near, w) keeps what is near.
    """
    first, step, low_row, high_row, now_row, look, _ = known

    @sweep
    def turn_beyond(run, margins, h, w):
        """Keep how far beyond zero what changes at width w of h would turn back if nothing changed.

        It is the minimum of a parabola through three values of the margin `beside` w. Rows `low`
        and `now` get all margins at the begin and the end of that part.
        """
        for n in range(first, margins.shape[1], step):
            margins[high_row, n] = 0.0 if counts(run, margins, n) else math.inf
        begin, end = beside(w, h)
        look(run, begin, 0.0)
        for n in range(first, margins.shape[1], step):
            margins[low_row, n] = margins[now_row, n]
        look(run, begin, 0.5 * (end - begin))
        for n in range(first, margins.shape[1], step):
            margins[high_row, n] += margins[now_row, n]
        look(run, begin, end - begin)
        for n in range(first, margins.shape[1], step):
            if margins[high_row, n] < math.inf:
                y = (margins[low_row, n], margins[high_row, n], margins[now_row, n])
                _, least = vertex((0.0, 0.5, 1.0), y)
                if least < 0.0:
                    note(run, margins, n, -least, w)

    return turn_beyond
