"""The arguments of a BatchStepper as arrays, and their refusals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..dynamics.arguments import numbers_in
from ..engine.compiler.jit import made_by_numba
from ..errors import InputError, Problem, shown
from ..model import Model
from ..packing import Array, Ints
from ..portable import array_of
from ..simulation.paths import Path, counting, distinct, started

SHARED: dict[Any, str] = {  # field of a scenario: why an instance has none of its own
    "step": "all instances take the same step: give the batch a step=",
    "t_end": "not supported: the steps of a batch are requested by calling `step`",
}


def compiled(tau: Any, varied: bool) -> Any:
    """Return the torques for all instances. Raises InputError if a function is not compiled."""
    if hasattr(tau, "acting") and varied:
        text = "a controller only supports a single set of values; pass the scenario with its gait"
        raise refused("tau", text)
    if callable(tau) and not hasattr(tau, "acting") and not made_by_numba(tau):
        text = "Python functions are not supported; compile it by "
        text += "numba.njit, or give an array to each call of step"
        raise refused("tau", text)
    return tau


def values_of(model: Model, given: Any, size: int, options: Mapping[str, Any]) -> dict[Any, Array]:
    """Return {path: (m,) values}, m >= size. Raises InputError."""
    if not isinstance(given, Mapping) or not given:
        text = f"must map paths to values, as {{'bodies.shin.mass': [1, 2]}}, got {shown(given)}"
        raise refused("set", text)
    given = {started(model, path, options["scenario"]): x for path, x in given.items()}
    paths = [Path(model, path, "BatchStepper") for path in given]
    distinct(paths, "BatchStepper")
    for path in paths:
        if path.group == "scenarios" and path.inside[0] in SHARED:
            raise refused(path.text, SHARED[path.inside[0]])
    counting(paths, model, "BatchStepper", options["scenario"], {"tau": options["tau"]})
    found = {}
    for name, (path, values) in zip((path.text for path in paths), given.items()):
        numbers = numbers_in(values)
        found[path] = np.full((0, 0), np.nan) if numbers is None else numbers
        if found[path].ndim > 1 or not np.isfinite(found[path]).all():
            text = f"must be finite numbers, one for each instance, got {shown(values)}"
            raise refused(name, text)
    lengths = {str(path): len(x) for path, x in found.items() if x.ndim}
    most = max(lengths.values(), default=size)
    for name, length in lengths.items():
        if length != most or length < size:
            text = f"has {length} values, but there are {max(most, size)} instances or entries of "
            text += "other paths"
            raise refused(name, text)
    return {path: np.broadcast_to(x, most).copy() for path, x in found.items()}


def kinds_of(values: Mapping[Any, Array], size: int) -> tuple[Array, Ints]:
    """Return ((kinds, paths) distinct values, (m,) kind of each entry), in order of appearance."""
    if not values:
        return np.zeros((1, 0)), np.zeros(size, dtype=np.int64)
    rows = np.stack(list(values.values()), axis=1)
    found: dict[bytes, int] = {}
    entries = np.array([found.setdefault(row.tobytes(), len(found)) for row in rows])
    return np.array([np.frombuffer(row) for row in found]), entries


def numbers_of(name: str, value: Any, rows: int, columns: int | None) -> Array:
    """Return finite numbers as (rows, columns), repeating a single row. Raises InputError."""
    shape = (rows,) if columns is None else (rows, columns)
    given = numbers_in(value, shape, shape[1:])
    found = np.full((0, 0, 0), np.nan) if given is None else given
    fits = found.shape in (shape, shape[1:])
    if not fits or not np.isfinite(found).all():
        text = f"must be finite numbers of shape {shape} or {shape[1:]}, got {shown(value)}"
        if found.size and not fits:
            text = f"must have shape {shape} or {shape[1:]}, got {found.shape}"
        raise refused(name, text)
    return np.broadcast_to(found, shape)


def chosen_in(which: Any, size: int) -> Ints:
    """Return the indices of the selected instances. Raises InputError."""
    if which is None:
        return np.arange(size)
    found = np.atleast_1d(_array(which))
    if found.dtype == bool and found.shape == (size,):
        return np.flatnonzero(found)
    whole = found.ndim == 1 and (found.dtype.kind in "iu" or not found.size)
    if not whole or ((found < 0) | (found >= size)).any():
        text = f"must be numbers of instances, 0 to {size - 1}, or ({size},) bool"
        raise refused("which", f"{text}, got {shown(which)}", "reset")
    return found.astype(np.int64)


def places_in(numbers: Any, entries: Ints, n: int) -> Ints:
    """Return the kinds for n list entries. Raises InputError."""
    found = _array(numbers)
    if found.dtype.kind not in "iu" or found.shape not in ((), (n,)):
        text = f"must be ({n},) places in the lists of `set`, got {shown(numbers)}"
        raise refused("numbers", text, "reset")
    if ((found < 0) | (found >= len(entries))).any():
        text = f"the lists of `set` have {len(entries)} entries, got {shown(numbers)}"
        raise refused("numbers", text, "reset")
    return np.broadcast_to(entries[found], n)


def _array(given: Any) -> Any:
    try:
        return array_of(given)
    except (TypeError, ValueError):
        return np.asarray(None)


def refused(field: str, text: str, call: str = "") -> InputError:
    return InputError(Problem(f"BatchStepper{'.' if call else ''}{call}", field, text))
