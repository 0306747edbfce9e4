"""Rank-safe solution of Ω λ = r with a proximal factor, its null directions and refinement.

(Ω + μI) is factored once and refined, which tends to the multipliers of least norm ([Carpentier et
al. 2021]). Along a null direction of Ω, the right-hand side only contains rounding errors or
contradictory rows. These components are removed, because refinement would amplify them by 1/μ. Null
directions show as small pivots, else as corrections that do not shrink. All operations use blocks
of 3x3, which fit into the registers. The last block is padded with zeros.
"""

import math

from ...tolerances import PROXIMAL
from ..arrays import CORRECTION, LAMBDA, RHS
from ..compiler.jit import part, sweep
from ..compiler.lane import load_triple, numbers, store_triple, triple
from ..compiler.masks import chosen, more
from ..linear import backward3, factor3, solve3
from ..vec import load, load3, store, store3

SMALL = PROXIMAL**-0.5  # a pivot below this many μ may belong to a null direction
NULL = 10  # an eigenvalue below this many μ does
REFINEMENTS = 12
INVERSE_ITERATIONS = 2  # towards a null direction: each leaves μ/λ of what is not null


@part
def whole_blocks(m):
    """Return m rounded up to a multiple of the block size three."""
    return (m + 2) // 3 * 3


@part
def load_factor3(factor, i):
    """Compute the factor of diagonal block i, or the block itself, as stored in `factor`."""
    x = load(factor, i, i)
    return (x[0], factor[i + 1, i + 1], factor[i + 2, i + 2], x[1], x[2], factor[i + 1, i + 2])


@part
def store_factor3(factor, i, f):
    store(factor, i, i, (f[0], f[3], f[4]))
    factor[i + 1, i + 1] = f[1]
    factor[i + 1, i + 2] = f[5]
    factor[i + 2, i + 2] = f[2]


@part
def less_block(y, a, i, j, x):
    """Compute the triple y - Aᵀ x for block (i, j) of a, with entries i to i + 2 of x."""
    more = x[i] * load_triple(a, i, j) + x[i + 1] * load_triple(a, i + 1, j)
    return y - x[i + 2] * load_triple(a, i + 2, j) - more  # y waits for the last two alone


@sweep
def factor_proximal(omega, factor, nulls, m):
    """Factor Ω + μI = L diag(B) Lᵀ with 3x3 blocks B. Returns (μ, null directions)."""
    trace = 0.0
    for r in range(m):
        trace += omega[r, r]
    mu = PROXIMAL * trace / m if trace > 0.0 else 1.0  # no row moves anything: all are null
    end = whole_blocks(m)
    for r in range(m, end):
        for c in range(end):
            omega[r, c] = 0.0
            omega[c, r] = 0.0
    for r in range(end):
        for c in range(end):
            factor[r, c] = omega[r, c]
        factor[r, r] += mu if r < m else 1.0
    small = 0
    for i in range(0, end, 3):
        f = factor3(load_factor3(factor, i))
        store_factor3(factor, i, f)
        for n in range(3):
            if not 0.0 < f[n] * (SMALL * mu) < 1.0 and i + n < m:
                begin_null(factor, f, i, n, nulls[small], end)
                small += 1
        for j in range(i + 3, end, 3):
            eliminate(factor, f, i, j, end)
    count = 0
    for n in range(small):
        for r in range(end if n > count else 0):
            nulls[count, r] = nulls[n, r]
        count += refine_null(factor, mu, nulls, count, 1, m)
    return mu, count


@part
def eliminate(factor, f, i, j, end):
    """Eliminate block row i from block row j, storing the blocks of L and, above, of Lᵀ."""
    block = (
        load_triple(factor, i, j), load_triple(factor, i + 1, j), load_triple(factor, i + 2, j),
    )  # fmt: skip
    along = solve3(f, block)
    x, y, z = numbers(along[0]), numbers(along[1]), numbers(along[2])
    a, b, c = (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])
    for k in range(j, end, 3):
        u, v, w = (
            load_triple(factor, i, k), load_triple(factor, i + 1, k), load_triple(factor, i + 2, k),
        )  # fmt: skip
        take_rows(factor, j, k, a, u, v, w)
        take_rows(factor, j + 1, k, b, u, v, w)
        take_rows(factor, j + 2, k, c, u, v, w)
    store(factor, j, i, a)
    store(factor, j + 1, i, b)
    store(factor, j + 2, i, c)
    for n in range(3):
        store_triple(factor, i + n, j, along[n])


@part
def take_rows(factor, j, k, a, u, v, w):
    """Subtract a₀ u + a₁ v + a₂ w from entries k to k + 2 of row j."""
    store_triple(factor, j, k, load_triple(factor, j, k) - a[0] * u - a[1] * v - a[2] * w)


@part
def begin_null(factor, f, i, n, x, end):
    """Compute x = L⁻ᵀ e for pivot n of block i, which is null except for that pivot."""
    for r in range(end):
        x[r] = 0.0
    pivot = (1.0 if n == 0 else 0.0, 1.0 if n == 1 else 0.0, 1.0 if n == 2 else 0.0)
    store3(x, i, backward3(f, pivot))
    for k in range(i - 3, -1, -3):
        y = triple(0.0, 0.0, 0.0)
        for j in range(k + 3, i + 3, 3):
            y = less_block(y, factor, j, k, x)
        store3(x, k, numbers(y))
    normalise(x, end)


@sweep
def refine_null(factor, mu, nulls, n, iterations, m):
    """Refine null direction n by inverse iteration, orthogonal to earlier ones.

    Returns 1 if it is a null direction, else 0.
    """
    growth = 0.0
    end = whole_blocks(m)
    for _ in range(iterations):
        solve_factor(factor, nulls[n], m)
        for other in range(n):
            take_out(nulls, other, nulls[n], end)
        growth = normalise(nulls[n], end)
    return 1 if growth * NULL * mu > 1.0 else 0


@part
def inner(x, y, end):
    """Compute x · y."""
    a, b, c = 0.0, 0.0, 0.0
    for r in range(0, end, 3):
        a += x[r] * y[r]
        b += x[r + 1] * y[r + 1]
        c += x[r + 2] * y[r + 2]
    return a + b + c


@part
def normalise(x, end):
    """Normalise x in place and return its previous length."""
    size = math.sqrt(inner(x, x, end))
    share = chosen(more(size, 0.0), 1.0 / size, 0.0)
    for r in range(end):
        x[r] *= share
    return size


@part
def take_out(nulls, n, x, end):
    """Remove the component of x along null direction n."""
    along = inner(nulls[n], x, end)
    for r in range(end):
        x[r] -= along * nulls[n, r]


@part
def along_nulls(nulls, count, x, m):
    """Find the largest component of x along the null directions."""
    size = 0.0
    for n in range(count):
        size = max(size, abs(inner(nulls[n], x, whole_blocks(m))))
    return size


@sweep
def solve_factor(factor, x, m):
    """Compute (Ω + μI)⁻¹ x in place. Returns the largest magnitude in the result."""
    end = whole_blocks(m)
    for i in range(3, end, 3):
        y = triple(x[i], x[i + 1], x[i + 2])
        for k in range(0, i, 3):
            y = less_block(y, factor, k, i, x)
        store3(x, i, numbers(y))
    size = 0.0
    for i in range(end - 3, -1, -3):
        begun = solve3(load_factor3(factor, i), load3(x, i))
        y = triple(begun[0], begun[1], begun[2])
        for k in range(i + 3, end, 3):
            y = less_block(y, factor, k, i, x)
        y = numbers(y)
        store3(x, i, y)
        size = max(size, max(abs(y[0]), max(abs(y[1]), abs(y[2]))))
    return size


@part
def remainder(omega, rhs, lam, out, end):
    """Compute rhs - Ω λ by the columns of the symmetric matrix Ω."""
    for i in range(0, end, 3):
        y = triple(rhs[i], rhs[i + 1], rhs[i + 2])
        for k in range(0, end, 3):
            y = less_block(y, omega, k, i, lam)
        store3(out, i, numbers(y))


@sweep
def solve_proximal(omega, factor, nulls, mu, count, vectors, m, enough):
    """Solve Ω λ = RHS for the minimum-norm λ by proximal refinement. Returns the iterations.

    Corrections decrease by a constant ratio, so corrections below rounding are not computed. The
    residual after the first solve is μ λ. No further solve is needed if it is at most `enough`.
    """
    rhs = vectors[RHS]
    lam = vectors[LAMBDA]
    change = vectors[CORRECTION]
    end = whole_blocks(m)
    for r in range(m, end):
        rhs[r] = 0.0
    for n in range(count):
        take_out(nulls, n, rhs, end)
    for r in range(end):
        lam[r] = rhs[r]
    size = solve_factor(factor, lam, m)
    last = size
    taken = 1
    if mu * size <= enough:
        return taken
    while taken < REFINEMENTS and last > 0.0:
        remainder(omega, rhs, lam, change, end)
        largest = solve_factor(factor, change, m)
        taken += 1
        if not largest < 0.5 * last:
            if not (largest > 1e-9 * size and count < m):  # rounding is all that is left
                break
            for r in range(end):
                nulls[count, r] = change[r]
            normalise(nulls[count], end)
            if refine_null(factor, mu, nulls, count, INVERSE_ITERATIONS, m) == 0:
                break
            take_out(nulls, count, rhs, end)
            take_out(nulls, count, lam, end)
            count += 1
            continue
        for r in range(end):
            lam[r] += change[r]
        if largest * (largest / last) <= 1e-16 * size:
            break
        last = largest
    for n in range(count):
        take_out(nulls, n, lam, end)
    return taken
