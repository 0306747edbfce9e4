"""Articulated inertias on their way from a row to its parent, eq. (12)."""

from ...tolerances import EPS
from ..compiler.jit import part
from ..rows import add_inertia
from ..vec import add9, cross, cross_sym, rows_of


@part
def shifted(link, j, b, m):
    """Return φᵀ I φ (12) for I = [j b, bᵀ m]: [j + l× bᵀ - n l×, n, nᵀ, m] with n = b + l× m."""
    n = add9(b, cross_sym(link, m))
    b0, b1, b2 = rows_of(b)
    n0, n1, n2 = rows_of(n)
    e0, e1, e2 = cross(link, b0), cross(link, b1), cross(link, b2)  # columns of l× bᵀ
    f0, f1, f2 = cross(n0, link), cross(n1, link), cross(n2, link)  # rows of n l×
    j = (
        j[0] + e0[0] - f0[0],
        j[1] + e1[1] - f1[1],
        j[2] + e2[2] - f2[2],
        j[3] + e1[0] - f0[1],
        j[4] + e2[0] - f0[2],
        j[5] + e2[1] - f1[2],
    )
    return j, n, m


@part
def add_inertia_to(work, p, link, j, b, m):
    """Add φᵀ I φ of a child to row p, eq. (12), shifted by the link vector."""
    j, b, m = shifted(link, j, b, m)
    add_inertia(work, p, j, b, m)


@part
def vanishes(size, inverse):
    """Check whether a pivot, given by its inverse, is zero to rounding for an inertia of this
    size."""
    return not (16 * EPS * size * inverse < 1.0 and inverse > 0.0)
