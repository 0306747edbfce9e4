"""Factors of a sparse matrix in blocks of 4 x 4, for Newton's method of contact.

Rows and columns are processed in groups of four. `upper` stores the blocks of block row p from the
index `start[p]` on, those in the columns `column`, first the diagonal. The 16 entries of a block
are in row-major order. `lower` stores the transposes of the blocks below the diagonal at the same
indices. A = L U without pivoting, in place, with 1/U on the diagonal of U. The rows of a block are
vectors of four numbers, and four pivots are eliminated at once. Rows beyond the matrix are those of
the identity.
"""

from ..compiler.jit import part, sweep
from ..compiler.lane import four, load_four, numbers_of_four, store_four


@part
def reduce_diagonal(x, b, symmetric):
    """Factor the block on the diagonal in place. Returns False if a pivot is zero.

    Only the upper triangle of a symmetric matrix is read.
    """
    for k in range(4):
        pivot = x[b, 5 * k]
        if not abs(pivot) > 0.0:
            return False
        inverse = 1.0 / pivot
        x[b, 5 * k] = inverse
        for a in range(k + 1, 4):
            f = inverse * (x[b, 4 * k + a] if symmetric else x[b, 4 * a + k])
            x[b, 4 * a + k] = f
            for c in range(k + 1, 4):
                x[b, 4 * a + c] -= f * x[b, 4 * k + c]
    return True


@part
def reduce_right(x, d, b):
    """Multiply block b by the inverse of the lower factor in block d, whose diagonal is 1."""
    one = load_four(x, b, 0)
    two = load_four(x, b, 4) - x[d, 4] * one
    three = load_four(x, b, 8) - x[d, 8] * one - x[d, 9] * two
    rest = load_four(x, b, 12) - x[d, 12] * one - x[d, 13] * two - x[d, 14] * three
    store_four(x, b, 4, two)
    store_four(x, b, 8, three)
    store_four(x, b, 12, rest)


@part
def reduce_below(x, d, y, b):
    """Multiply block b of y by the inverse of the transposed upper factor in block d of x."""
    one = x[d, 0] * load_four(y, b, 0)
    two = x[d, 5] * (load_four(y, b, 4) - x[d, 1] * one)
    three = x[d, 10] * (load_four(y, b, 8) - x[d, 2] * one - x[d, 6] * two)
    rest = load_four(y, b, 12) - x[d, 3] * one - x[d, 7] * two - x[d, 11] * three
    store_four(y, b, 0, one)
    store_four(y, b, 4, two)
    store_four(y, b, 8, three)
    store_four(y, b, 12, x[d, 15] * rest)


@part
def mirror(x, d, y, b):
    """Write block b of the rows of a symmetric matrix over its pivots into y."""
    for a in range(4):
        store_four(y, b, 4 * a, x[d, 5 * a] * load_four(x, b, 4 * a))


@part
def take(x, b, f, c, y, end, column):
    """Subtract (block c of f)ᵀ (block n of y) from the block of x in the same column, for the
    blocks n from c to `end`. Those of x begin at b."""
    f0, f1, f2, f3 = f[c, 0], f[c, 1], f[c, 2], f[c, 3]
    g0, g1, g2, g3 = f[c, 4], f[c, 5], f[c, 6], f[c, 7]
    h0, h1, h2, h3 = f[c, 8], f[c, 9], f[c, 10], f[c, 11]
    k0, k1, k2, k3 = f[c, 12], f[c, 13], f[c, 14], f[c, 15]
    for n in range(c, end):
        while column[b] != column[n]:
            b += 1
        one, two = load_four(y, n, 0), load_four(y, n, 4)
        three, rest = load_four(y, n, 8), load_four(y, n, 12)
        p, q = load_four(x, b, 0), load_four(x, b, 4)
        r, s = load_four(x, b, 8), load_four(x, b, 12)
        store_four(x, b, 0, p - (f0 * one + g0 * two + (h0 * three + k0 * rest)))
        store_four(x, b, 4, q - (f1 * one + g1 * two + (h1 * three + k1 * rest)))
        store_four(x, b, 8, r - (f2 * one + g2 * two + (h2 * three + k2 * rest)))
        store_four(x, b, 12, s - (f3 * one + g3 * two + (h3 * three + k3 * rest)))


@sweep
def factor(upper, lower, start, column, rows, symmetric):
    """Compute the factors L and U in place, of so many rows of blocks. Returns False if that fails.

    Only the upper blocks of a symmetric matrix are read.
    """
    for p in range(rows):
        d, end = start[p], start[p + 1]
        if not reduce_diagonal(upper, d, symmetric):
            return False
        for n in range(d + 1, end):
            reduce_right(upper, d, n)
            if symmetric:
                mirror(upper, d, lower, n)
            else:
                reduce_below(upper, d, lower, n)
        for n in range(d + 1, end):
            take(upper, start[column[n]], lower, n, upper, end, column)
            if not symmetric:
                take(lower, start[column[n]], upper, n, lower, end, column)
    return True


@sweep
def substitute(upper, lower, start, column, rows, x):
    """Solve for x (rows, 4) in place, after `factor`."""
    for p in range(rows):
        d = start[p]
        a = x[p, 0]
        b = x[p, 1] - upper[d, 4] * a
        c = x[p, 2] - upper[d, 8] * a - upper[d, 9] * b
        e = x[p, 3] - upper[d, 12] * a - upper[d, 13] * b - upper[d, 14] * c
        x[p, 1], x[p, 2], x[p, 3] = b, c, e
        for n in range(d + 1, start[p + 1]):
            one, two = load_four(lower, n, 0), load_four(lower, n, 4)
            three, rest = load_four(lower, n, 8), load_four(lower, n, 12)
            moved = a * one + b * two + (c * three + e * rest)
            store_four(x, column[n], 0, load_four(x, column[n], 0) - moved)
    for p in range(rows - 1, -1, -1):
        d = start[p]
        one = four(0.0, 0.0, 0.0, 0.0)
        two, three, rest = one, one, one
        for n in range(d + 1, start[p + 1]):
            right = load_four(x, column[n], 0)
            one = one + load_four(upper, n, 0) * right
            two = two + load_four(upper, n, 4) * right
            three = three + load_four(upper, n, 8) * right
            rest = rest + load_four(upper, n, 12) * right
        e = upper[d, 15] * (x[p, 3] - total(rest))
        c = upper[d, 10] * (x[p, 2] - total(three) - upper[d, 11] * e)
        b = upper[d, 5] * (x[p, 1] - total(two) - upper[d, 6] * c - upper[d, 7] * e)
        a = x[p, 0] - total(one) - upper[d, 1] * b - upper[d, 2] * c - upper[d, 3] * e
        x[p, 0], x[p, 1], x[p, 2], x[p, 3] = upper[d, 0] * a, b, c, e


@part
def total(x):
    """Compute the sum of four numbers."""
    a, b, c, d = numbers_of_four(x)
    return (a + b) + (c + d)
