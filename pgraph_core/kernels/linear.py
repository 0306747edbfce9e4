"""Small dense linear systems, real or complex: factors in place, partial pivoting."""

from ._jit import sweep


@sweep
def factor(a, n, pivots):
    """L U of the first n rows of `a` in its place, rows exchanged as `pivots` says; whether it is.

    Rows are weighed by their largest entry: units do not choose the pivot.
    """
    for r in range(n):
        size = 0.0
        for c in range(n):
            size = max(size, abs(a[r, c]))
        if not size > 0.0 or size > 1e300:
            return False
        pivots[n + r] = 1.0 / size
    for k in range(n):
        best = -1.0
        row = k
        for r in range(k, n):
            x = abs(a[r, k]) * pivots[n + r]
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


@sweep
def substitute(a, n, pivots, x):
    """a⁻¹ x in the place of x, after `factor`."""
    for k in range(n):
        row = int(pivots[k])
        y = x[row]
        x[row] = x[k]
        x[k] = y
        for r in range(k):
            y -= a[k, r] * x[r]
        x[k] = y
    for k in range(n - 1, -1, -1):
        y = x[k]
        for c in range(k + 1, n):
            y -= a[k, c] * x[c]
        x[k] = y / a[k, k]
