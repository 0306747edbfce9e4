"""Bodies from NumPy columns, with one entry per row or one for all rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..errors import ModelError, Problem, is_deep, shown
from ..fields import GROUND
from ..portable import array_of
from .body import Body

LEVELS = {
    "link": 1,
    "axes": 1,
    "com": 1,
    "tip": 1,
    "rotation": 1,
    "inertia": 2,
}  # depth of lists, from one


def bodies_of(
    parent: Any, names: Iterable[str] | None, columns: Mapping[str, Any]
) -> tuple[Body, ...]:
    """Return a body for each entry in `parent` (nb,), with rows numbered from 1 and 0 for the
    ground.

    `columns` contains fields of `Body`: nb entries, or one for all. Raises ModelError.
    """
    above = _array("parent", parent)
    if above.ndim != 1 or (above.size and above.dtype.kind not in "iu"):
        raise _refused("parent", f"must be a list of whole numbers, got {shown(parent)}")
    n = len(above)
    given = [str(i) for i in range(1, n + 1)] if names is None else list(names)
    if len(given) != n:
        raise _refused("names", f"must have length {n}, one entry per body, got {len(given)}")
    wrong = np.flatnonzero((above < 0) | (above > n))
    if wrong.size:
        row = int(wrong[0])
        text = f"must be a row from 1 to {n}, or 0 for the ground, got {above[row]}"
        raise ModelError(Problem(f"body '{given[row]}'", "parent", text))
    label = [GROUND, *given]
    rows = [_rows(name, value, n) for name, value in columns.items() if value is not None]
    fields = [name for name, value in columns.items() if value is not None]
    return tuple(
        Body(**{"name": name, "parent": label[p], **dict(zip(fields, values))})
        for name, p, *values in zip(given, above.tolist(), *rows)
    )


def _rows(name: str, value: Any, n: int) -> list[Any]:
    """Return the entries of a column for all rows."""
    array = _array(name, value)
    entries = array.tolist()
    if array.ndim == LEVELS.get(name, 0):
        return [entries] * n
    if len(entries) != n:
        text = f"must have {n} entries, one per body, or one for all, got {len(entries)}"
        raise _refused(name, text)
    return entries


def _array(name: str, value: Any) -> Any:
    """Return a column as an array, with dtype object if its entries differ in length."""
    try:
        return array_of(value)
    except ValueError:
        if not isinstance(value, (list, tuple)) or is_deep(value):
            raise _refused(name, f"must be a column, got {shown(value)}") from None
    array = np.empty(len(value), object)
    array[:] = value
    return array


def _refused(column: str, text: str) -> ModelError:
    return ModelError(Problem("columns", column, text))
