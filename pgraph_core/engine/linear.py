"""Small dense linear systems, real or complex: factors in place, partial pivoting."""

from .compiler.jit import part, sweep


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


@part
def row_times(a, k, first, last, x):
    """Σ a[k, c] x[c] from `first` to `last`, in four sums that need not wait for each other."""
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
    """a⁻¹ x in the place of x, after `factor`."""
    for k in range(n):
        row = int(pivots[k])
        y = x[row]
        x[row] = x[k]
        x[k] = y
        x[k] = y - row_times(a, k, 0, k, x)
    for k in range(n - 1, -1, -1):
        x[k] = (x[k] - row_times(a, k, k + 1, n, x)) / a[k, k]
