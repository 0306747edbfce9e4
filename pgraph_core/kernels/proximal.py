"""Rank-safe solution of Ω λ = r: a proximal factor, its null directions, refinement.

(Ω + μI) is factored once and refined, which tends to the multipliers of least norm
([Carpentier et al. 2021]). Along a null direction of Ω the right-hand side is only rounding, or
rows that contradict each other: taken out there, refinement cannot blow it up by 1/μ. Null
directions show as small pivots, else as corrections that do not shrink.
"""

import math

from ._jit import part, sweep

RHS, LAMBDA, CHANGE, DINV, STEP, ZERO = 0, 1, 2, 3, 4, 5  # rows of `vectors`
PROXIMAL = 1e-10  # μ relative to the mean diagonal of Ω
SMALL = 1e5  # a pivot below this many μ may belong to a null direction
NULL = 10.0  # an eigenvalue below this many μ does
REFINEMENTS = 12
INVERSE_ITERATIONS = 2  # towards a null direction: each leaves μ/λ of what is not null


@sweep
def factor_proximal(omega, factor, nulls, m):
    """L diag(d) Lᵀ = Ω + μI, 1/d on the diagonal, Lᵀ above it; (μ, number of null directions)."""
    trace = 0.0
    for r in range(m):
        trace += omega[r, r]
    mu = PROXIMAL * trace / m
    for r in range(m):
        for c in range(r, m):
            factor[r, c] = omega[r, c]
        factor[r, r] += mu
    small = 0
    for n in range(m):
        if not factor[n, n] > SMALL * mu:
            for r in range(m):
                nulls[small, r] = 0.0
            nulls[small, n] = 1.0
            small += 1
        pivot = 1.0 / factor[n, n]
        for r in range(n + 1, m):
            x = factor[n, r] * pivot
            if x != 0.0:
                for c in range(r, m):
                    factor[r, c] -= x * factor[n, c]
        factor[n, n] = pivot
        for c in range(n + 1, m):
            factor[n, c] *= pivot
    count = 0
    for n in range(small):
        if n > count:
            for r in range(m):
                nulls[count, r] = nulls[n, r]
        count += refine_null(factor, mu, nulls, count, m)
    return mu, count


@sweep
def refine_null(factor, mu, nulls, n, m):
    """Inverse iteration of null direction n, at right angles to those before; 1 if it is null."""
    growth = 0.0
    for _ in range(INVERSE_ITERATIONS):
        solve_factor(factor, nulls[n], m)
        for other in range(n):
            take_out(nulls, other, nulls[n], m)
        growth = normalise(nulls[n], m)
    return 1 if growth * NULL * mu > 1.0 else 0


@part
def normalise(x, m):
    """x at length one; its length before."""
    size = 0.0
    for r in range(m):
        size += x[r] * x[r]
    size = math.sqrt(size)
    if size > 0.0:
        for r in range(m):
            x[r] /= size
    return size


@part
def take_out(nulls, n, x, m):
    """x less its part along null direction n."""
    along = 0.0
    for r in range(m):
        along += nulls[n, r] * x[r]
    for r in range(m):
        x[r] -= along * nulls[n, r]


@sweep
def solve_factor(factor, x, m):
    """(Ω + μI)⁻¹ x in place; the largest magnitude of the result."""
    for n in range(m):
        y = x[n]
        for r in range(n + 1, m):
            x[r] -= factor[n, r] * y
    size = 0.0
    for n in range(m - 1, -1, -1):
        y = x[n] * factor[n, n]
        for c in range(n + 1, m):
            y -= factor[n, c] * x[c]
        x[n] = y
        size = max(size, abs(y))
    return size


@sweep
def solve_proximal(omega, factor, nulls, mu, count, vectors, m):
    """λ of least norm with Ω λ = RHS, by refinement of the proximal solve; iterations taken.

    Corrections shrink by a constant ratio: the one that would be rounding is not computed.
    """
    rhs = vectors[RHS, :m]
    lam = vectors[LAMBDA, :m]
    change = vectors[CHANGE, :m]
    for n in range(count):
        take_out(nulls, n, rhs, m)
    for r in range(m):
        lam[r] = rhs[r]
    size = solve_factor(factor, lam, m)
    last = size
    taken = 1
    while taken < REFINEMENTS and last > 0.0:
        for r in range(m):
            change[r] = rhs[r]
        for c in range(m):
            x = lam[c]
            for r in range(m):
                change[r] -= omega[c, r] * x
        largest = solve_factor(factor, change, m)
        taken += 1
        if not largest < 0.5 * last:
            if not (largest > 1e-9 * size and count < m):  # rounding is all that is left
                break
            for r in range(m):
                nulls[count, r] = change[r]
            normalise(nulls[count], m)
            if refine_null(factor, mu, nulls, count, m) == 0:
                break
            take_out(nulls, count, rhs, m)
            take_out(nulls, count, lam, m)
            count += 1
            continue
        for r in range(m):
            lam[r] += change[r]
        if largest * (largest / last) <= 1e-16 * size:
            break
        last = largest
    for n in range(count):
        take_out(nulls, n, lam, m)
    return taken
