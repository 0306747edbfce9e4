"""Rows on joint coordinates: a sum Σ c q or Σ c v that follows a number, a curve over time, or in a
relation q = f(q') a function of another coordinate.

A relation is the row q - f(q') = 0, with J = [1, -f'] and J' v = -f'' v'². Its second coefficient
depends on the state, so `coefficient` knows it only after `locate`, which keeps f, f' and f'' of
the present coordinate in the row's place.
"""

from .. import layout as at
from ..compiler.elementary import cos, sin
from ..compiler.jit import part, sweep
from ..layout import SINE, T_RELATION
from ..pieces import located, polynomial
from ..signals import differentiate, evaluate


@part
def terms_of(blocks_i, i):
    """Return the first and the end index of the terms in a coordinate row."""
    first = blocks_i[i, at.B_TERM]
    return first, first + blocks_i[i, at.B_TERMS]


@part
def followed(blocks_i, blocks_f, curves, i, t, order):
    """Compute the curve of a coordinate row, or its first or second time derivative."""
    count = blocks_i[i, at.B_KNOTS]
    k = blocks_i[i, at.B_CURVE]
    if count == 0:
        return blocks_f[i, at.VALUE] if order == 0 else 0.0
    if count == SINE:
        rate = curves[k, 2]
        angle = rate * t + curves[k, 3]
        if order == 0:
            return curves[k, 0] + curves[k, 1] * sin(angle)
        if order == 1:
            return curves[k, 1] * rate * cos(angle)
        return -curves[k, 1] * rate * rate * sin(angle)
    if count < SINE:
        evaluate(curves, k, -1 - count, t, curves[k], curves[k])
        if order > 0:
            differentiate(curves, k, -1 - count)
        return curves[k + 2 * (-1 - count) - 1, order]
    last = k + count - 1
    while k < last and t >= curves[k + 1, 0]:
        k += 1
    s = t - curves[k, 0]
    if order == 0:
        return curves[k, 1] + s * (curves[k, 2] + s * (curves[k, 3] + s * curves[k, 4]))
    if order == 1:
        return curves[k, 2] + s * (2.0 * curves[k, 3] + s * 3.0 * curves[k, 4])
    return 2.0 * curves[k, 3] + s * 6.0 * curves[k, 4]


@part
def total(blocks_i, terms_i, terms_f, i, column, x):
    """Return Σ c x for a coordinate row over entries of q or v."""
    sum_ = 0.0
    first, end = terms_of(blocks_i, i)
    for n in range(first, end):
        sum_ += terms_f[n] * x[terms_i[n, column]]
    return sum_


@sweep
def function_at(curves, first, count, x):
    """Compute f, f' and f'' at x, from `count` rows of pieces or a program."""
    if count < SINE:
        program = -1 - count
        evaluate(curves, first, program, x, curves[first], curves[first])
        differentiate(curves, first, program)
        last = curves[first + 2 * program - 1]
        return last[0], last[1], last[2]
    pieces = count - 1
    i, s, beyond, periods = located(curves, first, pieces, 1.0, at.PIECE_RATE, x)
    value, slope, bend, _ = polynomial(curves, i, s, beyond, at.PIECE_POWERS, 1)
    rise = curves[first + pieces, at.PIECE_POWERS] - curves[first, at.PIECE_POWERS]
    return value + periods * rise, slope, bend


@part
def follower_of(blocks, i, column):
    """Return the index into v, column 0, or q, column 1, of the coordinate that relation i sets."""
    return blocks.terms_i[blocks.blocks_i[i, at.B_TERM], column]


@part
def leader_of(blocks, i, column):
    """Return the index into v, column 0, or q, column 1, of the coordinate that it follows."""
    return blocks.terms_i[blocks.blocks_i[i, at.B_TERM] + 1, column]


@part
def relate(blocks, i, q, place):
    """Write f, f' and f'' of relation i into its place."""
    first, count = blocks.blocks_i[i, at.B_CURVE], blocks.blocks_i[i, at.B_KNOTS]
    value, slope, bend = function_at(blocks.curves, first, count, q[leader_of(blocks, i, 1)])
    place[i, at.PLACE_VALUE] = value
    place[i, at.PLACE_SLOPE] = slope
    place[i, at.PLACE_BEND] = bend


@part
def bending(blocks, place, i, v):
    """Compute f'' v'² of relation i, after `locate`."""
    rate = v[leader_of(blocks, i, 0)]
    return place[i, at.PLACE_BEND] * rate * rate


@part
def coefficient(blocks, place, i, n):
    """Return the coefficient of term n, of coordinate row i, after `locate`."""
    if blocks.blocks_i[i, at.B_TYPE] == T_RELATION and n > blocks.blocks_i[i, at.B_TERM]:
        return -place[i, at.PLACE_SLOPE]
    return blocks.terms_f[n]


@part
def speed_along(blocks, place, i, v):
    """Compute Σ coefficient v of coordinate row i over entries of v, after `locate`."""
    sum_ = 0.0
    first, end = terms_of(blocks.blocks_i, i)
    for n in range(first, end):
        sum_ += coefficient(blocks, place, i, n) * v[blocks.terms_i[n, 0]]
    return sum_
