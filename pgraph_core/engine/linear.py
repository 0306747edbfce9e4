"""Linear algebra: factors of 3x3 ball blocks and 6x6 free-joint blocks, and dense systems.

The 6x6 block is the inertia of a row in `work`, factored in place as L diag(d) Lᵀ.
"""

from .compiler.jit import part, sweep
from .layout import IA
from .layout import SOLVED as X


@part
def factor3(j):
    """Compute (1/d0, 1/d1, 1/d2, l10, l20, l21) of j = L diag(d) Lᵀ."""
    d0 = 1.0 / j[0]
    l10 = j[3] * d0
    l20 = j[4] * d0
    d1 = 1.0 / (j[1] - l10 * j[3])
    y = j[5] - l20 * j[3]
    l21 = y * d1
    d2 = 1.0 / (j[2] - l20 * j[4] - l21 * y)
    return (d0, d1, d2, l10, l20, l21)


@part
def forward3(f, x):
    """L⁻¹ x."""
    y1 = x[1] - f[3] * x[0]
    return (x[0], y1, x[2] - f[4] * x[0] - f[5] * y1)


@part
def backward3(f, x):
    """L⁻ᵀ x."""
    y1 = x[1] - f[5] * x[2]
    return (x[0] - f[3] * y1 - f[4] * x[2], y1, x[2])


@part
def solve3(f, x):
    """j⁻¹ x."""
    y = forward3(f, x)
    return backward3(f, (f[0] * y[0], f[1] * y[1], f[2] * y[2]))


@part
def factor6(work, k):
    """Factor the 6x6 inertia in place as L diag(d) Lᵀ, with 1/d on the diagonal."""
    for r in range(6):
        ir = IA + r * (r + 1) // 2
        for c in range(r):
            ic = IA + c * (c + 1) // 2
            for n in range(c):
                work[k, ir + c] -= work[k, ir + n] * work[k, ic + n]
        diagonal = work[k, ir + r]
        for c in range(r):
            scaled = work[k, ir + c] * work[k, IA + c * (c + 1) // 2 + c]
            diagonal -= scaled * work[k, ir + c]
            work[k, ir + c] = scaled
        work[k, ir + r] = 1.0 / diagonal


@part
def add_diagonal6(work, k, a):
    """Add a number to the diagonal of the 6x6 inertia."""
    for r in range(6):
        work[k, IA + r * (r + 1) // 2 + r] += a


@sweep
def restore6(work, k):
    """Restore the 6x6 inertia from its factor, in place."""
    for r in range(5, -1, -1):
        ir = IA + r * (r + 1) // 2
        for c in range(r, -1, -1):
            ic = IA + c * (c + 1) // 2
            x = (work[k, ir + c] if c < r else 1.0) / work[k, ic + c]
            for n in range(c):
                x += work[k, ir + n] * work[k, ic + n] / work[k, IA + n * (n + 1) // 2 + n]
            work[k, ir + c] = x


@part
def forward6(work, k):
    """Compute L⁻¹ x in place, where x is the right-hand side of six numbers."""
    for r in range(1, 6):
        ir = IA + r * (r + 1) // 2
        for c in range(r):
            work[k, X + r] -= work[k, ir + c] * work[k, X + c]


@part
def backward6(work, k):
    """Compute L⁻ᵀ x in place."""
    for r in range(4, -1, -1):
        for c in range(r + 1, 6):
            work[k, X + r] -= work[k, IA + c * (c + 1) // 2 + r] * work[k, X + c]


@part
def transposed6(work, k, x, i):
    """Compute Lᵀ x in place for six entries of x starting at i."""
    for r in range(5):
        for c in range(r + 1, 6):
            x[i + r] += work[k, IA + c * (c + 1) // 2 + r] * x[i + c]


@part
def diagonal6(work, k):
    """Compute diag(1/d) x in place."""
    for r in range(6):
        work[k, X + r] *= work[k, IA + r * (r + 1) // 2 + r]


@part
def forward_free(work, k, moment, force):
    """Return L⁻¹ of a wrench of numbers or triples, as six entries."""
    y0, y1, y2 = moment
    y3, y4, y5 = force
    y1 -= work[k, IA + 1] * y0
    y2 -= work[k, IA + 3] * y0 + work[k, IA + 4] * y1
    y3 -= work[k, IA + 6] * y0 + work[k, IA + 7] * y1 + work[k, IA + 8] * y2
    y4 -= work[k, IA + 10] * y0 + work[k, IA + 11] * y1 + work[k, IA + 12] * y2
    y4 -= work[k, IA + 13] * y3
    y5 -= work[k, IA + 15] * y0 + work[k, IA + 16] * y1 + work[k, IA + 17] * y2
    y5 -= work[k, IA + 18] * y3 + work[k, IA + 19] * y4
    return (y0, y1, y2, y3, y4, y5)


@part
def pivots6(work, k):
    """Return 1/d for the six degrees of freedom as (angular, linear)."""
    a = (work[k, IA], work[k, IA + 2], work[k, IA + 5])
    return a, (work[k, IA + 9], work[k, IA + 14], work[k, IA + 20])


# -- dense systems, real or complex: factors in place, partial pivoting ---------------------------


@part
def cabs1(x):
    """Return |Re x| + |Im x|, which is used to compare pivots (LAPACK's `cabs1`).

    The absolute value would need `hypot` of the C library, whose bits differ between platforms.
    """
    return abs(x.real) + abs(x.imag)


@sweep
def factor(a, n, pivots):
    """Factor the first n rows of `a` in place as L U with `pivots`. Returns False if singular.

    Rows are divided by their largest entry, so that the pivot does not depend on units.
    """
    for r in range(n):
        size = 0.0
        for c in range(n):
            size = max(size, cabs1(a[r, c]))
        if not size > 0.0 or size > 1e300:
            return False
        pivots[n + r] = 1.0 / size
    for k in range(n):
        best = -1.0
        row = k
        for r in range(k, n):
            x = cabs1(a[r, k]) * pivots[n + r]
            if x > best:
                best = x
                row = r
        if not best > 0.0:
            return False
        pivots[k] = row
        if row != k:
            weight = pivots[n + row]
            pivots[n + row] = pivots[n + k]
            pivots[n + k] = weight
            for c in range(n):
                x = a[k, c]
                a[k, c] = a[row, c]
                a[row, c] = x
        inverse = 1.0 / a[k, k]
        for r in range(k + 1, n):
            x = a[r, k] * inverse
            a[r, k] = x
            if x != 0.0:
                for c in range(k + 1, n):
                    a[r, c] -= x * a[k, c]
    return True


@part
def row_times(a, k, first, last, x):
    """Return Σ a[k, c] x[c] from `first` to `last`, in four independent partial sums."""
    y0 = y1 = y2 = y3 = 0.0 * x[0]
    c = first
    while c + 4 <= last:
        y0 += a[k, c] * x[c]
        y1 += a[k, c + 1] * x[c + 1]
        y2 += a[k, c + 2] * x[c + 2]
        y3 += a[k, c + 3] * x[c + 3]
        c += 4
    while c < last:
        y0 += a[k, c] * x[c]
        c += 1
    return (y0 + y1) + (y2 + y3)


@sweep
def substitute(a, n, pivots, x):
    """Compute a⁻¹ x in place, after `factor`."""
    for k in range(n):
        row = int(pivots[k])
        y = x[row]
        x[row] = x[k]
        x[k] = y
        x[k] = y - row_times(a, k, 0, k, x)
    for k in range(n - 1, -1, -1):
        x[k] = (x[k] - row_times(a, k, k + 1, n, x)) / a[k, k]
