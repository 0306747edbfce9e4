"""Equality of values that hold arrays: a bool, where nan equals nan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, cast

import numpy as np


def same(a: Any, b: Any) -> bool:
    """Whether two values, or all values in them, are equal; a list equals a tuple."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        a, b = np.asarray(a), np.asarray(b)
        floats = all(x.dtype.kind in "fc" for x in (a, b))  # others have no nan
        return bool(np.array_equal(a, b, equal_nan=floats))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b or (a != a and b != b))


class EqualByFields:
    """A mixin of dataclasses with arrays: equal fields, but for those with `compare=False`.

    Arrays can change, so there is no hash.
    """

    def __eq__(self, other: object) -> bool:
        """Whether the fields are equal, nan to nan."""
        if type(self) is not type(other):
            return NotImplemented
        names = [field.name for field in fields(cast("Any", self)) if field.compare]
        return all(same(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # pyright: ignore[reportAssignmentType]
