"""Checks of the inertia of a body."""

from __future__ import annotations

import numpy as np

from ..joints import Finding, Numbers
from ..tolerances import SOLVED


def inertia_problems(inertia: tuple[Numbers, ...]) -> list[Finding]:
    """Check the inertia for symmetry, positive semidefiniteness and the triangle inequality."""
    size = max(abs(x) for row in inertia for x in row)
    if any(abs(inertia[i][j] - inertia[j][i]) > SOLVED * size for i, j in ((0, 1), (0, 2), (1, 2))):
        return [("inertia", f"must be symmetric, got {[list(row) for row in inertia]}")]
    slack = SOLVED * size
    if _is_plainly_right(inertia, 0.5 * slack):
        return []
    a, b, c = _principal_moments(inertia)
    if a < -slack:
        return [
            (
                "inertia",
                f"must be positive semidefinite; its smallest principal moment is {a:.6g} kg m^2",
            )
        ]
    if a + b < c - slack:
        return [
            (
                "inertia",
                f"breaks the triangle inequality: principal moments {a:.6g} + {b:.6g} < {c:.6g} by "
                f"{c - a - b:.3g} kg m^2; no rigid body has it: if only one axis "
                "matters, give (I, I, I) or any_inertia=True",
            )
        ]
    return []


def _is_plainly_right(inertia: tuple[tuple[float, ...], ...], slack: float) -> bool:
    """Check whether tr(I)/2 - I + slack is positive definite, using the Cholesky pivots.

    The triangle inequality is sufficient, so no eigenvalues are required.
    """
    (a, d, e), (_, b, f), (_, _, c) = inertia
    half = 0.5 * (a + b + c) + slack
    first, second = half - a, half - b
    if not (first > 0 and (second := second - d * d / first) > 0):
        return False
    left = -f - d * e / first
    return half - c - e * e / first - left * left / second > 0


def _principal_moments(inertia: tuple[tuple[float, ...], ...]) -> tuple[float, float, float]:
    """Return the eigenvalues of a symmetric 3x3 matrix in ascending order."""
    (a, d, e), (_, b, f), (_, _, c) = inertia
    if d == e == f == 0.0:
        low, middle, high = sorted((a, b, c))
        return low, middle, high
    low, middle, high = np.linalg.eigvalsh(np.array(inertia))
    return float(low), float(middle), float(high)
