"""Plain numbers written into a table, where nothing else has to look at them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine.packing import pack
from .checks import Array

DIRECT = {"mass": pack.MASS, "com": pack.COM, "link": pack.LINK}  # fields that an edit writes


def written(body: Array, row: int, field: str, value: Any) -> Array | None:
    """`body` with a plain finite value in a field of a row, or None."""
    numbers = (value,) if field == "mass" else value
    if type(numbers) is not tuple or len(numbers) != (1 if field == "mass" else 3):
        return None
    for x in numbers:
        if type(x) not in (float, int) or not -np.inf < x < np.inf:
            return None
    if field == "mass" and numbers[0] < 0:
        return None
    first = DIRECT[field]
    old = body[row, first : first + len(numbers)]
    if old.tolist() == list(numbers):
        return body
    body = body.copy()
    body[row, first : first + len(numbers)] = numbers
    return body
