"""Rank-safe solution of Ω λ = r: a proximal factor, its null directions, refinement.

(Ω + μI) is factored once and refined, which tends to the multipliers of least norm
([Carpentier et al. 2021]). Redundant rows show as pivots of the size of μ; each gives a null
direction, along which the right-hand side is only rounding or a contradiction: taken out there,
refinement cannot blow it up by 1/μ.
"""

import math

from ._jit import part, sweep

RHS, LAMBDA, CHANGE, DINV, STEP, ZERO = 0, 1, 2, 3, 4, 5  # rows of `vectors`
PROXIMAL = 1e-10  # μ relative to the mean diagonal of Ω
NULL = 30.0  # a pivot below this many μ belongs to a null direction
REFINEMENTS = 12


@sweep
def factor_proximal(omega, factor, nulls, m):
    """L diag(d) Lᵀ = Ω + μI (1/d on the diagonal, Lᵀ above it), and the null directions; how many."""
    trace = 0.0
    for r in range(m):
        trace += omega[r, r]
    mu = PROXIMAL * trace / m
    for r in range(m):
        for c in range(r, m):
            factor[r, c] = omega[r, c]
        factor[r, r] += mu
    count = 0
    for n in range(m):
        null = not factor[n, n] > NULL * mu
        pivot = 1.0 / factor[n, n]
        for r in range(n + 1, m):
            x = factor[n, r] * pivot
            if x != 0.0:
                for c in range(r, m):
                    factor[r, c] -= x * factor[n, c]
        factor[n, n] = pivot
        for c in range(n + 1, m):
            factor[n, c] *= pivot
        if null:
            count += null_direction(factor, nulls, count, n)
    return count


@part
def null_direction(factor, nulls, count, n):
    """L⁻ᵀ e_n, at right angles to the earlier ones and of length one; 1, or 0 if nothing is left."""
    for r in range(nulls.shape[1]):
        nulls[count, r] = 0.0
    nulls[count, n] = 1.0
    for r in range(n - 1, -1, -1):
        x = 0.0
        for c in range(r + 1, n + 1):
            x += factor[r, c] * nulls[count, c]
        nulls[count, r] = -x
    for other in range(count):
        take_out(nulls, other, nulls[count])
    size = 0.0
    for r in range(n + 1):
        size += nulls[count, r] ** 2
    if not size > 0.0:
        return 0
    size = 1.0 / math.sqrt(size)
    for r in range(n + 1):
        nulls[count, r] *= size
    return 1


@part
def take_out(nulls, n, x):
    """x less its part along null direction n."""
    along = 0.0
    for r in range(nulls.shape[1]):
        along += nulls[n, r] * x[r]
    for r in range(nulls.shape[1]):
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
def solve_proximal(omega, factor, nulls, count, vectors, m):
    """λ of least norm with Ω λ = RHS, by refinement of the proximal solve; iterations taken.

    Corrections shrink by a constant ratio: the one that would be rounding is not computed.
    """
    rhs = vectors[RHS, :m]
    lam = vectors[LAMBDA, :m]
    change = vectors[CHANGE, :m]
    for n in range(count):
        take_out(nulls[:, :m], n, rhs)
    for r in range(m):
        lam[r] = rhs[r]
    last = solve_factor(factor, lam, m)
    size = last
    taken = 1
    while taken < REFINEMENTS and last > 0.0:
        for r in range(m):
            change[r] = rhs[r]
        for c in range(m):
            x = lam[c]
            for r in range(m):
                change[r] -= omega[c, r] * x
        largest = solve_factor(factor, change, m)
        if not largest < 0.5 * last:  # rounding is all that is left
            break
        for r in range(m):
            lam[r] += change[r]
        taken += 1
        if largest * (largest / last) <= 1e-16 * size:
            break
        last = largest
    for n in range(count):
        take_out(nulls[:, :m], n, lam)
    return taken
