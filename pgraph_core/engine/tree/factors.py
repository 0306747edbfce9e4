"""L diag(1/d)⁻¹ Lᵀ of the 3x3 block of a ball and of the 6x6 inertia of a free motion."""

from .. import layout as at
from ..compiler.jit import part


@part
def factor3(j):
    """(1/d0, 1/d1, 1/d2, l10, l20, l21) of j = L diag(d) Lᵀ."""
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
    """L diag(d) Lᵀ of the 6x6 inertia in its own place; the diagonal holds 1/d."""
    for r in range(6):
        ir = at.IA + r * (r + 1) // 2
        for c in range(r):
            ic = at.IA + c * (c + 1) // 2
            for n in range(c):
                work[k, ir + c] -= work[k, ir + n] * work[k, ic + n]
        diagonal = work[k, ir + r]
        for c in range(r):
            scaled = work[k, ir + c] * work[k, at.IA + c * (c + 1) // 2 + c]
            diagonal -= scaled * work[k, ir + c]
            work[k, ir + c] = scaled
        work[k, ir + r] = 1.0 / diagonal


@part
def forward6(work, k, at_x):
    """L⁻¹ x in place, x the six numbers of row k from column `at_x`."""
    for r in range(1, 6):
        ir = at.IA + r * (r + 1) // 2
        for c in range(r):
            work[k, at_x + r] -= work[k, ir + c] * work[k, at_x + c]


@part
def backward6(work, k, at_x):
    """L⁻ᵀ x in place."""
    for r in range(4, -1, -1):
        for c in range(r + 1, 6):
            work[k, at_x + r] -= work[k, at.IA + c * (c + 1) // 2 + r] * work[k, at_x + c]


@part
def diagonal6(work, k, at_x):
    """diag(1/d) x in place."""
    for r in range(6):
        work[k, at_x + r] *= work[k, at.IA + r * (r + 1) // 2 + r]
