"""Names of lanes and triples for kernels, defined by `lowering.lane`.

`lanes(a)` views a C-contiguous float64 array (..., W) as an array (...) of lanes. A triple is three
numbers in one register, or three lanes. A wrench whose components are triples is three wrenches,
and the same code handles it. Uncompiled, it is an array of three.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from .jit import late


def _width() -> int:
    """Return the doubles per lane: the size of a vector register on this processor, at least 4."""
    chosen = os.environ.get("PGRAPH_LANE_WIDTH")  # set while an archive is built
    if chosen:
        return int(chosen)
    from llvmlite import binding

    return 8 if binding.get_host_cpu_features().get("avx512f") else 4


LANE_WIDTH = _width()


def _store_plain(a: Any, i: int, j: int, x: Any) -> None:
    a[i, j : j + 3] = x


def _store_four_plain(a: Any, i: int, j: int, x: Any) -> None:
    a[i, j : j + 4] = x


def by_lanes(of_lanes: Any, of_numbers: Any) -> Any:
    """Return a function of (rows, work, q) that selects one of two, by whether q contains lanes."""
    return late("lane", "by_lanes", of_lanes, of_lanes, of_numbers)


def numbers_alone(exert: Any) -> Any:
    """Return `exert` of a load whose runs take no lanes, in which it does nothing."""
    return late("lane", "numbers_alone", exert, exert)


def in_lanes_of(kind: Any) -> Any:
    """Return a function that views a float64 array (records, words, W) as records in lanes."""
    return late("records", "in_lanes_of", None, kind)


def in_each(function: Any) -> Any:
    """Apply a compiled function of one number to each element of a lane, or to a number."""
    return late("elementary", "in_each", function, function)


lanes: Any = late("lane", "lanes")
constants: Any = late("lane", "constants")
four: Any = late("lane", "four", lambda *x: np.array(x))
numbers_of_four: Any = late("lane", "numbers_of_four", lambda x: tuple(x.tolist()))
load_four: Any = late("lane", "load_four", lambda a, i, j: a[i, j : j + 4].copy())
store_four: Any = late("lane", "store_four", _store_four_plain)
triple: Any = late("lane", "triple", lambda x, y, z: np.array([x, y, z]))
numbers: Any = late("lane", "numbers", lambda x: tuple(x.tolist()))
load_triple: Any = late("lane", "load_triple", lambda a, i, j: a[i, j : j + 3].copy())
store_triple: Any = late("lane", "store_triple", _store_plain)
beyond: Any = late("lane", "beyond", lambda x, least: np.where(abs(x) <= least, 0.0, x))
