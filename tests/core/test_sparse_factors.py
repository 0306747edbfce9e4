"""Factors of sparse matrices in blocks of 4 x 4 against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from pgraph_core.engine.compiler.jit import kernel
from pgraph_core.engine.compiler.kinds import F2, I1, i8
from pgraph_core.engine.contact.sparse import factor, substitute


@kernel(i8(F2, F2, I1, I1, i8, F2))
def solve(upper, lower, start, column, symmetric, x):
    """Solve for x in place. Returns 0 if a pivot is zero."""
    if not factor(upper, lower, start, column, x.shape[0], symmetric == 1):
        return 0
    substitute(upper, lower, start, column, x.shape[0], x)
    return 1


Columns = list[list[int]]  # of the blocks in every row, from the diagonal on


def solved(a: np.ndarray, columns: Columns, symmetric: bool, b: np.ndarray) -> np.ndarray | None:
    """The solution of a x = b."""
    start = np.append(0, np.cumsum([len(row) for row in columns]))
    upper, lower = np.zeros((2, start[-1], 16))
    for p, row in enumerate(columns):
        for at, q in enumerate(row, start[p]):
            block = a[4 * p : 4 * p + 4, 4 * q : 4 * q + 4]
            upper[at] = (np.triu(block) if symmetric and p == q else block).ravel()
            if q > p and not symmetric:
                lower[at] = a[4 * q : 4 * q + 4, 4 * p : 4 * p + 4].T.ravel()
    x = b.reshape(-1, 4).copy()
    return (
        x.ravel()
        if solve(upper, lower, start, np.concatenate(columns), int(symmetric), x)
        else None
    )


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize(
    "columns", [[[0]], [[0, 1], [1]], [[0, 2, 5], [1, 3], [2, 5], [3, 4], [4, 5], [5]]]
)
def test_solutions_equal_those_of_numpy(columns, symmetric):
    """To rounding, as the diagonal is dominant; other entries are never read."""
    dice, n = np.random.default_rng(len(columns)), 4 * len(columns)
    inside = np.zeros((len(columns), len(columns)), dtype=bool)
    for p, row in enumerate(columns):
        inside[p, row] = inside[row, p] = True
    a = np.kron(inside, np.ones((4, 4))) * dice.normal(size=(n, n)) + 2.0 * n * np.eye(n)
    a = a + a.T if symmetric else a
    b = dice.normal(size=n)
    expected = np.linalg.solve(a, b)
    found = solved(a, columns, symmetric, b)
    assert found == pytest.approx(expected, abs=1e-14 * abs(expected).max())


def test_a_pivot_of_zero_is_reported():
    assert solved(np.zeros((4, 4)), [[0]], True, np.ones(4)) is None
