"""Factors of sparse matrices in blocks of 4 x 4 against NumPy."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from pgraph_core.engine.compiler.jit import kernel
from pgraph_core.engine.compiler.kinds import F2, I1, I2, i8
from pgraph_core.engine.contact.islands import GRAPH, SIZES, connect, order_trees
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


class Trees(NamedTuple):
    """The tables of `Islands` that an order of elimination needs."""

    edge: Any
    edges: Any
    graph: Any
    queue: Any
    size: Any


@kernel(i8(I2, I1, I2, I2, I1, I1))
def put_in_order(links, edge, edges, graph, queue, size):
    """Connect trees and write their order of elimination into `queue`. Returns their number."""
    islands = Trees(edge, edges, graph, queue, size)
    for k in range(links.shape[0]):
        connect(islands, links[k, 0], links[k, 1])
        connect(islands, links[k, 1], links[k, 0])
    return order_trees(islands, links[0, 0])


Links = list[tuple[int, int]]  # of trees from 1


def ordered(links: Links) -> tuple[list[int], int]:
    """The order of elimination, and how many connections were added."""
    n = np.max(links) + 1
    edges, size = np.zeros((40 * len(links), 2), dtype=int), np.zeros(SIZES.total, dtype=int)
    graph, queue = np.zeros((n, GRAPH.total), dtype=int), np.zeros(n, dtype=int)
    count = put_in_order(np.array(links), np.full(n, -1), edges, graph, queue, size)
    assert sorted(queue[:count]) == list(range(1, n))
    return queue[:count].tolist(), size[SIZES.edges] // 2 - len(links)


def fill(links: Links, order: list[int]) -> int:
    """How many connections elimination in this order adds, by its definition."""
    near, added = {t: set() for t in order}, 0
    for a, b in links:
        near[a].add(b)
        near[b].add(a)
    for t in order:
        now = near.pop(t)
        for a in now:
            new = now - near[a] - {a}
            near[a] = (near[a] | new) - {t}
            added += len(new)
    return added // 2


def grid(m: int) -> Links:
    """A square of m by m, row after row."""
    at = 1 + np.arange(m * m).reshape(m, m)
    pairs = [(at[:, 1:], at[:, :-1]), (at[1:], at[:-1])]
    return [pair for a, b in pairs for pair in zip(a.ravel(), b.ravel(), strict=True)]


@pytest.mark.parametrize("n", [2, 3, 12, 40])
def test_the_order_of_a_tree_fills_nothing_and_that_of_a_ring_the_least(n):
    dice = np.random.default_rng(n)
    for _ in range(5):
        names = 1 + dice.permutation(n)
        tree = [(names[k], names[dice.integers(0, k)]) for k in range(1, n)]
        order, added = ordered(tree)
        assert fill(tree, order) == added == 0
        if n > 2:
            ring = [*zip(names, np.roll(names, 1), strict=True)]
            order, added = ordered(ring)
            assert fill(ring, order) == added == n - 3  # any order: triangles of a polygon


@pytest.mark.parametrize("m", [3, 5, 8, 12])
def test_the_order_of_a_grid_connects_what_elimination_fills(m):
    order, added = ordered(grid(m))
    assert fill(grid(m), order) == added
    assert added < fill(grid(m), [*range(1, m * m + 1)])  # less than row after row
