"""Factors of sparse matrices in blocks of 4 x 4 against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from pgraph_core.engine.compiler.jit import kernel
from pgraph_core.engine.compiler.kinds import F2, I1, i8
from pgraph_core.engine.contact.envelope import factor, substitute


@kernel(i8(F2, F2, I1, I1, i8, F2))
def solve(upper, lower, start, last, symmetric, x):
    """Solve for x in place. Returns 0 if a pivot is zero."""
    if not factor(upper, lower, start, last, x.shape[0], symmetric == 1):
        return 0
    substitute(upper, lower, start, last, x.shape[0], x)
    return 1


def solved(a: np.ndarray, last: np.ndarray, symmetric: bool, b: np.ndarray) -> np.ndarray | None:
    """The solution of a x = b, whose blocks to the right of block p end with `last[p]`."""
    start = np.append(0, np.cumsum(last - np.arange(len(last)) + 1))
    upper, lower = np.zeros((2, start[-1], 16))
    for p, end in enumerate(last):
        for q in range(p, end + 1):
            block, at = a[4 * p : 4 * p + 4, 4 * q : 4 * q + 4], start[p] + q - p
            upper[at] = (np.triu(block) if symmetric and p == q else block).ravel()
            if q > p and not symmetric:
                lower[at] = a[4 * q : 4 * q + 4, 4 * p : 4 * p + 4].T.ravel()
    x = b.reshape(-1, 4).copy()
    return x.ravel() if solve(upper, lower, start, last, int(symmetric), x) else None


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("last", [[0], [1, 1], [1, 3, 3, 4, 4], [2, 2, 2, 5, 5, 5]])
def test_solutions_equal_those_of_numpy(last, symmetric):
    """To rounding, as the diagonal is dominant; entries outside the envelope are never read."""
    dice, n = np.random.default_rng(len(last)), 4 * len(last)
    block = np.arange(n) // 4
    inside = np.maximum.outer(block, block) <= np.array(last)[np.minimum.outer(block, block)]
    a = inside * dice.normal(size=(n, n)) + 2.0 * n * np.eye(n)
    a = a + a.T if symmetric else a
    b = dice.normal(size=n)
    expected = np.linalg.solve(a, b)
    found = solved(a, np.array(last), symmetric, b)
    assert found == pytest.approx(expected, abs=1e-14 * abs(expected).max())


def test_a_pivot_of_zero_is_reported():
    assert solved(np.zeros((4, 4)), np.array([0]), True, np.ones(4)) is None
