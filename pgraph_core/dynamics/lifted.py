"""Tuples of arrays with derivatives: numbers become duals, behind one address for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..engine.compiler.dual import WIDTH
from ..engine.compiler.kinds import Array as ArrayKind
from ..engine.compiler.kinds import Group
from ..packing import Array

MOST = WIDTH - 1  # derivatives that a dual carries


class Differs(Exception):
    """Two tuples are not of the same structure."""


def lifted(kind: Any, value: Any, slopes: Sequence[Any]) -> Any:
    """Return `value` of a kind with duals, with these derivatives, tuples of the same form.

    An array of duals is float64 (..., WIDTH), one of records of duals (records, words, WIDTH).
    """
    if isinstance(kind, Group):
        parts = [
            lifted(own, part, [slope[i] for slope in slopes])
            for i, (own, part) in enumerate(zip(kind.members, value))
        ]
        return kind.names(*parts) if kind.names else tuple(parts)
    if not (isinstance(kind, ArrayKind) and kind.duals):
        return value
    words = _words(value)
    out = np.zeros((*words.shape, WIDTH))
    out[..., 0].view(np.int64)[...] = words.view(np.int64)
    for k, slope in enumerate(slopes, start=1):
        out[..., k] = slope
    return out


def slope_of(kind: Any, values: Sequence[Any], weights: Sequence[float]) -> Any:
    """Return Σ weights values of every array with duals, None for other members.

    The sum of the weights is zero: numbers that do not differ have a slope of exactly zero.

    Raises Differs if sizes or integers are not the same.
    """
    if isinstance(kind, Group):
        return tuple(
            slope_of(own, [value[i] for value in values], weights)
            for i, own in enumerate(kind.members)
        )
    if not isinstance(kind, ArrayKind):
        return None
    first, *others = values
    if any(x.shape != first.shape for x in others):
        raise Differs
    if kind.duals and are_same(values):
        return np.zeros(_words(first).shape)
    if kind.duals and kind.dtype.names:
        real = np.tile(_is_real(kind.dtype), (len(first), 1))
        words = [_words(x) for x in values]
        if any((x.view(np.int64)[~real] != words[0].view(np.int64)[~real]).any() for x in words):
            raise Differs
        out = np.zeros(real.shape)
        out[real] = weighted([x[real] for x in words], weights)
        return out
    if kind.duals:
        return weighted(values, weights)
    if any((x != first).any() for x in others):
        raise Differs
    return None


def are_on_lines(kind: Any, values: Sequence[Any]) -> bool:
    """True if every number has values at 0, 1 and -2 that are on a line, to rounding.

    The bound of 2 f(1) + f(-2) - 3 f(0) is 16 roundings of the largest value in its array.
    """
    if isinstance(kind, Group):
        return all(
            are_on_lines(own, [value[i] for value in values]) for i, own in enumerate(kind.members)
        )
    if not (isinstance(kind, ArrayKind) and kind.duals) or are_same(values):
        return True
    words = [_words(value) for value in values]
    if kind.dtype.names:
        words = [x[:, _is_real(kind.dtype)] for x in words]
    finite = np.isfinite(words[0])
    at_0, at_1, at_2 = (x[finite] for x in words)
    size = max(float(np.abs(x).max(initial=0.0)) for x in (at_0, at_1, at_2))
    bent = np.abs(2.0 * at_1 + at_2 - 3.0 * at_0)
    return float(bent.max(initial=0.0)) <= 16.0 * np.finfo(float).eps * size


def are_same(values: Sequence[Array]) -> bool:
    """True if arrays of one shape have the same bits."""
    first = values[0].tobytes()
    return all(value.tobytes() == first for value in values[1:])


def laid_out(kind: Any, value: Any) -> list[int]:
    """The words in which kernels find a lifted tuple at an address."""
    if isinstance(kind, Group):
        return [word for own, part in zip(kind.members, value) for word in laid_out(own, part)]
    if not isinstance(kind, ArrayKind):
        return [int(value)]
    if kind.duals and kind.dtype.names:
        return [value.ctypes.data, len(value)]
    ndim, size = kind.ndim, value.itemsize * (WIDTH if kind.duals else 1)
    shape, strides = value.shape[:ndim], value.strides[:ndim]
    return [0, 0, int(np.prod(shape)), size, value.ctypes.data, *shape, *strides]


def weighted(values: Sequence[Array], weights: Sequence[float]) -> Array:
    """Σ weights (values - the first of them), zero if that is not finite."""
    first, total = values[0], np.zeros(np.shape(values[0]))
    finite = np.isfinite(first)
    for weight, value in zip(weights, values):
        total[finite] += weight * (value[finite] - first[finite])
    return total


def _words(value: Any) -> Array:
    """An array of numbers as it is, one of records as (records, words)."""
    if not value.dtype.names:
        return value
    flat = np.ascontiguousarray(value).view(np.float64)
    return flat.reshape(len(value), value.dtype.itemsize // 8)


def _is_real(record: np.dtype[Any]) -> Any:
    """(words,) whether each word of a record is a real number."""
    found = np.zeros(record.itemsize // 8, dtype=bool)
    for field in record.fields.values() if record.fields else ():
        inside, first = field[:2]
        found[first // 8 : (first + inside.itemsize) // 8] = inside.base.kind == "f"
    return found
