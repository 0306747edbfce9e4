"""Functions of one number in pieces, each of which is a polynomial of degree 7.

A table has `stride` rows for each piece, and one more for the end. The first row of a piece has the
place where it begins, and 1 / period in the column `rate` of the first piece, or 0. Coefficients
belong to the way from that place.
"""

import math

from . import layout as at
from .compiler.jit import part
from .compiler.masks import chosen, larger, more, most, smaller
from .compiler.tables import entry


@part
def piece_at(table, first, pieces, stride, x):
    """Return the row of the last piece that begins at or before x, or of the first one."""
    last = pieces - 1
    found = 0.0 * more(x, x)  # a number of the kind of x
    step = 1
    while 2 * step <= last:
        step *= 2
    while step > 0:
        ahead = smaller(found + step, last + 0.0)
        begin = entry(table, first + stride * ahead, at.PIECE_AT)
        found = chosen(most(begin, x), ahead, found)
        step //= 2
    return first + stride * found


@part
def located(table, first, pieces, stride, rate, q):
    """Return (row of the piece with q, way from its beginning, way beyond all pieces, periods).

    The way beyond them is that past the ends of an open function.
    """
    start = table[first, at.PIECE_AT]
    periods = math.floor((q - start) * table[first, rate]) * 1.0
    x = q - periods * (table[first + int(stride) * pieces, at.PIECE_AT] - start)
    i = piece_at(table, first, pieces, stride, x)
    begin = entry(table, i, at.PIECE_AT)
    way = x - begin
    # at an end, the way is chosen, whose derivative is that of q
    inside = smaller(entry(table, i + stride, at.PIECE_AT) - begin, larger(0.0, way))
    return i, inside, way - inside, periods


@part
def polynomial(table, i, s, beyond, c, apart):
    """Return value and three derivatives at s of the number whose coefficients are `apart`.

    Beyond the pieces, the second derivative is constant.
    """
    value = entry(table, i, c + 7 * apart)
    slope = 7.0 * value
    bend = 6.0 * slope
    third = 5.0 * bend
    for n in range(6, -1, -1):
        a = entry(table, i, c + n * apart)
        value = value * s + a
        if n > 0:
            slope = slope * s + n * a
        if n > 1:
            bend = bend * s + n * (n - 1) * a
        if n > 2:
            third = third * s + n * (n - 1) * (n - 2) * a
    value = value + beyond * (slope + 0.5 * beyond * bend)
    return value, slope + beyond * bend, bend, third
