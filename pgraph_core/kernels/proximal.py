"""Rank-safe solution of Ω λ = r: a proximal factor and refinement [Carpentier et al. 2021]."""

import math

from ._jit import sweep

RHS, LAMBDA, CHANGE, DINV, STEP, ZERO = 0, 1, 2, 3, 4, 5  # rows of `vectors`
PROXIMAL = 1e-10  # μ relative to the mean diagonal of Ω
REFINEMENTS = 12


@sweep
def factor_proximal(omega, factor, m):
    """Cholesky factor L of Ω + μI with its diagonal inverted, Lᵀ above it; μ."""
    trace = 0.0
    for r in range(m):
        trace += omega[r, r]
    mu = PROXIMAL * trace / m
    for r in range(m):
        for c in range(m):
            factor[r, c] = omega[r, c]
        factor[r, r] += mu
    for n in range(m):
        pivot = 1.0 / math.sqrt(factor[n, n])
        factor[n, n] = pivot
        for c in range(n + 1, m):
            factor[n, c] *= pivot
        for r in range(n + 1, m):
            x = factor[n, r]
            if x != 0.0:
                for c in range(r, m):
                    factor[r, c] -= x * factor[n, c]
    for n in range(m):
        for r in range(n + 1, m):
            factor[r, n] = factor[n, r]
    return mu


@sweep
def solve_factor(factor, x, m):
    """(Ω + μI)⁻¹ x in place; the largest magnitude of the result."""
    for n in range(m):
        x[n] *= factor[n, n]
        y = x[n]
        for r in range(n + 1, m):
            x[r] -= factor[n, r] * y
    size = 0.0
    for n in range(m - 1, -1, -1):
        x[n] *= factor[n, n]
        y = x[n]
        for r in range(n):
            x[r] -= factor[n, r] * y
        size = max(size, abs(y))
    return size


@sweep
def drop_null(factor, mu, x, y, m):
    """Take off x what lies in the null space of Ω: (μ (Ω + μI)⁻¹)³ x.

    That is what redundant rows contradict each other by, or rounding: refinement would blow it
    up by 1/μ. A direction of eigenvalue λ loses (μ/λ)³ of itself.
    """
    for r in range(m):
        y[r] = x[r]
    for _ in range(3):
        solve_factor(factor, y, m)
        for r in range(m):
            y[r] *= mu
    for r in range(m):
        x[r] -= y[r]


@sweep
def solve_proximal(space, mu, m):
    """λ of least norm with Ω λ = RHS, by refinement of the proximal solve; iterations taken."""
    y, omega, factor, vectors = space
    rhs = vectors[RHS]
    lam = vectors[LAMBDA]
    change = vectors[CHANGE]
    drop_null(factor, mu, rhs, change, m)
    for r in range(m):
        lam[r] = 0.0
    last = math.inf
    taken = 0
    while taken < REFINEMENTS:
        for r in range(m):
            change[r] = rhs[r]
        for c in range(m if taken > 0 else 0):
            x = lam[c]
            for r in range(m):
                change[r] -= omega[c, r] * x
        largest_change = solve_factor(factor, change, m)
        if not largest_change < 0.5 * last:  # rounding is all that is left
            break
        size = 0.0
        for r in range(m):
            lam[r] += change[r]
            size = max(size, abs(lam[r]))
        taken += 1
        if largest_change <= 1e-15 * size:
            break
        last = largest_change
    drop_null(factor, mu, lam, change, m)
    return taken
