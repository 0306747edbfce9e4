"""Convert arguments of public functions to the contiguous float64 arrays required by kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np

from ..errors import InputError, Problem, shown, to_read
from ..given import array_of
from ..packing import Array
from ..packing.packed import Packed


def names_in(value: Any) -> Mapping[str, Any] | None:
    """Return names and values as a mapping, from a dict or a pandas row for example, else None."""
    if isinstance(value, Mapping):
        return value
    if not callable(getattr(value, "keys", None)):
        return None
    named: list[Any] = list(value.keys())
    return {x: value[x] for x in named} if any(isinstance(x, str) for x in named) else None


def numbers_in(given: Any, *shapes: tuple[int, ...]) -> Array | None:
    """Copy numbers into an array, with nan for masked entries.

    None for text, truth values, complex numbers and other objects. An array that has none of the
    given shapes is not copied.
    """
    try:
        found = array_of(given)
    except (TypeError, ValueError):
        return None
    if found.dtype.kind not in "iuf" and found.size:
        return None
    if shapes and found.shape not in shapes:
        return found
    found = np.array(found, dtype=np.float64, order="C")
    if isinstance(given, np.ma.MaskedArray):
        found[np.ma.getmaskarray(given)] = np.nan
    return found


def numbers(name: str, value: Any, *shape: int) -> Array:
    """Return an array with this shape, which may contain nan or inf. Raises InputError."""
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:
        flags = value.flags
        if flags.c_contiguous and flags.writeable:
            return value
    if names_in(value) is not None:
        text = "must be a list of numbers in the order of the coordinates (mech.names), not by "
        raise InputError(Problem(name, "", f"{text}names; given {shown(value)}"))
    array = numbers_in(value, shape)
    if array is None:
        raise InputError(Problem(name, "", f"must be numbers; given {shown(value)}"))
    if array.shape != shape:
        raise InputError(Problem(name, "", f"must have shape {shape}; given {array.shape}"))
    return array


def finite(name: str, value: Any, *shape: int) -> Array:
    """Return an array with this shape and finite entries only. Raises InputError."""
    array = numbers(name, value, *shape)
    good = np.isfinite(array)
    if not good.all():
        bad = int(np.argmin(good))
        text = f"must be finite; entry {bad} is {array.flat[bad]}"
        raise InputError(Problem(name, "", text))
    return array


def position(packed: Packed, q: Any) -> Array:
    """Return q (nq,), finite and with nonzero quaternions, which need not be normalised.

    Raises InputError.
    """
    q = finite("q", q, packed.nq)
    for k, i, _ in packed.quaternions:
        length = math.hypot(*q[i : i + 4].tolist())
        if not 1e-3 < length < 1e3:
            text = f"the quaternion [w, x, y, z] of '{packed.body_of(k)}' at q[{i}] must have "
            raise InputError(Problem("q", "", f"{text}length 1; its length is {length:.6g}"))
    return q


def stretched(packed: Packed, q: Array) -> list[str]:
    """Return a warning for each quaternion in q (nq,) that does not have unit length."""
    found = list[str]()
    for k, i, _ in packed.quaternions:
        length = math.hypot(*q[i : i + 4].tolist())
        if abs(length - 1.0) > 1e-3:
            text = f"the quaternion at q[{i}] has length {length:.6g}, which has no effect"
            found.append(f"at the start '{packed.body_of(k)}': {text}")
    return found


def positions(packed: Packed, q: Array) -> None:
    """Raise InputError if a row of q (n, nq) does not satisfy the checks in `position`."""
    for _, i, _ in packed.quaternions:
        lengths = np.linalg.norm(q[:, i : i + 4], axis=1)
        for row in q[~((lengths > 1e-3) & (lengths < 1e3))]:
            position(packed, row)


def whole_number(call: str, field: str, value: Any, least: int, most: float = math.inf) -> int:
    """Return an integer within these bounds. Raises InputError, which names the call."""
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or not least <= int(value) <= most:
        text = f"must be a whole number >= {least}"
        text += "" if most == math.inf else f" and <= {most}"
        raise InputError(Problem(call, field, f"{text}; given {shown(value)}"))
    return int(value)


def wrong_type(where: str, field: str, wanted: str, value: Any) -> InputError:
    """Return the error for an argument with the wrong type, with a hint for model paths."""
    text = f"must be {wanted}; given {shown(value)}"
    text += to_read(value) if "pg.Model" in wanted else ""
    return InputError(Problem(where, field, text))
