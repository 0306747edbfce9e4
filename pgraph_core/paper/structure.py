"""The operators that carry the structure of the tree: φ, ε_φ and Φ, eqs. (6), (13), (16)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..rotation import Array, skew
from ..topology import Ints, find


def phi(link: Sequence[float] | Array) -> Array:
    """(6, 6) link propagation matrix of eq. (6): V at the far end of `link` = φ V at its root."""
    shift = np.eye(6)
    shift[3:, :3] = -skew(link)
    return shift


def blocks(
    rows: Sequence[int] | Ints, columns: Sequence[int] | Ints, data: Array, shape: tuple[int, int]
) -> Any:
    """Sparse matrix with a 6x6 block at each (row, column); `shape` counts blocks."""
    at, column = np.asarray(rows, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    order = np.lexsort((column, at))
    start = np.searchsorted(at[order], np.arange(shape[0] + 1))
    data = np.reshape(data, (-1, 6, 6))[order]
    size = (6 * shape[0], 6 * shape[1])
    from scipy import sparse

    matrix = sparse.bsr_array((data, column[order], start), shape=size, blocksize=(6, 6)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def kernel_operator(parent: Ints, link: Array) -> Any:
    """ε_φ = Σ e_κ φ_κ,j e_jᵀ, eq. (13): (6 nb, 6 nb) sparse; `link` (nb, 3) in world axes [m]."""
    child = np.flatnonzero(parent)
    data = np.array([phi(link[k]) for k in child])
    return blocks(child, parent[child] - 1, data, (len(parent), len(parent)))


def kernel_operator_of_pgraph(pgraph: Sequence[int] | Ints, link: Array) -> Any:
    """ε_φ from Pgraph alone, Fig. 6: no adjacency matrix is given or made.

    Walk Pgraph; where a body stands for the first time, its parent stands before it.
    """
    pgraph = np.asarray(pgraph, dtype=np.int64)
    first = find(pgraph)
    inner = [i for i in first if i > 0 and pgraph[i] > 0 and pgraph[i - 1] > 0]
    rows, columns = pgraph[inner] - 1, pgraph[[i - 1 for i in inner]] - 1
    data = np.array([phi(link[k]) for k in rows])
    return blocks(rows, columns, data, (len(link), len(link)))


def propagation_operator(parent: Ints, link: Array) -> Any:
    """Φ = (1 - ε_φ)⁻¹, eq. (16), as the products of φ along paths: (6 nb, 6 nb) sparse.

    Block row κ is φ_κ,ρ(κ) times block row ρ(κ), and 1 at κ: no inverse is formed, and block
    (κ, j) is there only where j is an ancestor of κ or κ itself. O(n · depth).
    """
    paths: list[Ints] = []
    rows: list[Array] = []
    for k, p in enumerate(parent.tolist()):
        path = np.append(paths[p - 1], k) if p else np.array([k])
        ahead = phi(link[k]) @ rows[p - 1] if p else np.zeros((0, 6, 6))
        paths.append(path)
        rows.append(np.concatenate((ahead, np.eye(6)[None])))
    at = np.repeat(np.arange(len(parent)), [len(path) for path in paths])
    return blocks(at, np.concatenate(paths), np.concatenate(rows), (len(parent), len(parent)))
