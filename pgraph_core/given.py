"""Conversion of arguments to arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_DIMENSIONS = 8  # lists within lists: no argument has so many dimensions


def array_of(given: Any) -> NDArray[Any]:
    """Return a value as an array, without copying an existing array. Raises TypeError, ValueError.

    NumPy would follow lists that hold themselves through 64 levels, which takes 2^64 steps where
    one holds itself twice.
    """
    inner, depth = given, 0
    while isinstance(inner, (list, tuple)) and inner:
        inner, depth = inner[0], depth + 1
        if depth > MOST_DIMENSIONS:
            raise ValueError("the lists are nested too deeply")
    return np.asarray(given)
