"""Composite bodies: the mass matrix, and its factor along the tree, O(n depth²).

M = Lᵀ D L keeps the zeros of M: only freedoms on one path to the root meet
[Featherstone 2008, secs. 6.2, 6.5]. `outer[i]` is the freedom next to i towards the root (λ(i)
there), -1 for the ground.
"""

from .. import layout as at
from ..compiler.jit import part, sweep
from ..vec import add, add_cross, dot, load, mul, mul_t, sym_mul
from .articulated import add_to_parent, vanishes
from .kinematics import base_axes, load_inertia


@part
def size_of(kind):
    """Degrees of freedom of a row."""
    return 1 if kind <= at.TRANSLATE else 3 if kind == at.BALL else 6


@part
def motion(rows, const, work, k, column):
    """Column of H_k, eqs. (6), (7): (angular, linear) in world axes."""
    zero = (0.0, 0.0, 0.0)
    kind = rows[k, at.KIND]
    if kind == at.ROTATE:
        return load(work, k, at.H), zero
    if kind == at.TRANSLATE:
        return zero, load(work, k, at.H)
    axes = base_axes(const, work, rows[k, at.PARENT], k)
    c = column % 3
    x = (axes[c], axes[c + 3], axes[c + 6])
    if column < 3:
        return x, zero
    return zero, x


@sweep
def composite_inertia(rows, work):
    """I_c of every row: its own inertia and, shifted by φ, those of all rows it carries."""
    zero = (0.0, 0.0, 0.0)
    for k in range(rows.shape[0] - 1, 0, -1):
        p = rows[k, at.PARENT]
        if p > 0:
            j, b, mass = load_inertia(work, k)
            add_to_parent(work, p, load(work, k, at.L), j, b, mass, zero, zero)


@sweep
def joint_inertia(rows, const, work, m):
    """M of eq. (25) after `outboard`: F = I_c H carried down the path, F_p = φᵀ F, eq. (12)."""
    composite_inertia(rows, work)
    for k in range(1, rows.shape[0]):
        for column in range(size_of(rows[k, at.KIND])):
            h0, h1 = motion(rows, const, work, k, column)
            j, b, mass = load_inertia(work, k)
            moment = add(sym_mul(j, h0), mul(b, h1))
            force = add(mul_t(b, h0), sym_mul(mass, h1))
            i = rows[k, at.VI] + column
            p = k
            while p > 0:
                for c in range(size_of(rows[p, at.KIND])):
                    g0, g1 = motion(rows, const, work, p, c)
                    x = dot(g0, moment) + dot(g1, force)
                    m[i, rows[p, at.VI] + c] = x
                    m[rows[p, at.VI] + c, i] = x
                moment = add_cross(moment, load(work, p, at.L), force)
                p = rows[p, at.PARENT]
            if rows[k, at.KIND] <= at.TRANSLATE:
                m[i, i] += const[k, at.ARMATURE]


@sweep
def outer_freedoms(rows, outer):
    """The freedom next to each one towards the root, -1 for the ground."""
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        first = rows[k, at.VI]
        outer[first] = rows[p, at.VI] + size_of(rows[p, at.KIND]) - 1 if p > 0 else -1
        for i in range(first + 1, first + size_of(rows[k, at.KIND])):
            outer[i] = i - 1


@sweep
def factor(outer, m):
    """M = Lᵀ D L in the lower triangle of `m`, L with ones on its diagonal, D in their place."""
    for k in range(m.shape[0] - 1, -1, -1):
        i = outer[k]
        while i >= 0:
            a = m[k, i] / m[k, k]
            j = i
            while j >= 0:
                m[i, j] -= a * m[k, j]
                j = outer[j]
            m[k, i] = a
            i = outer[i]


@sweep
def solve(outer, m, x):
    """M⁻¹ x in place by the factor of M: L⁻¹ D⁻¹ L⁻ᵀ x."""
    n = m.shape[0]
    for i in range(n - 1, -1, -1):
        j = outer[i]
        while j >= 0:
            x[j] -= m[i, j] * x[i]
            j = outer[j]
    for i in range(n):
        x[i] /= m[i, i]
        j = outer[i]
        while j >= 0:
            x[i] -= m[i, j] * x[j]
            j = outer[j]


@sweep
def singular_pivot(rows, work, m):
    """First row, from the tips, with a pivot of D that is rounding of its inertia; 0 if none."""
    for k in range(rows.shape[0] - 1, 0, -1):
        angular = work[k, at.IA] + work[k, at.IA + 2] + work[k, at.IA + 5]
        linear = work[k, at.IA + 9] + work[k, at.IA + 14] + work[k, at.IA + 20]
        kind = rows[k, at.KIND]
        for c in range(size_of(kind)):
            i = rows[k, at.VI] + c
            size = linear if kind == at.TRANSLATE or c > 2 else angular
            if vanishes(size, 1.0 / m[i, i]):
                return k
    return 0
