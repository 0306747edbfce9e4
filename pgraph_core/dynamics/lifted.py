"""Tuples of arrays with dual numbers, which kernels access by a single address."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ..engine.compiler.dual import WIDTH
from ..engine.compiler.kinds import Array as ArrayKind
from ..engine.compiler.kinds import Group
from ..packing import Array, Ints
from ..tolerances import ROUNDING

MOST = WIDTH - 1  # derivatives that a dual carries


class Differs(Exception):
    """Two tuples are not of the same structure."""


class Flat(NamedTuple):
    """The numbers of a tuple of arrays in one array."""

    words: Array  # (n,) all real numbers
    begins: Ints  # start index of each array
    fixed: tuple[Any, ...]  # data without derivatives: sizes, integers, places of zeros in records


def flat(kind: Any, value: Any) -> Flat:
    """Return the numbers of `value` of a kind with duals."""
    found: list[Array] = []
    fixed: list[Any] = []
    for own, array in _arrays(kind, value, []):
        fixed.append(array.shape)
        if not own.duals:
            fixed.append(array.tobytes())
        elif own.dtype.names:
            words, real = _words(array), _is_real(own.dtype)
            fixed.append(words[:, ~real].tobytes())
            found.append(words[:, real].ravel())
            fixed.append((found[-1] == 0.0).tobytes())  # laws leave out what is 0
        else:
            found.append(array.ravel())
    begins = np.cumsum([0, *(x.size for x in found if x.size)])
    return Flat(np.concatenate(found), begins[:-1], tuple(fixed))


def lifted(kind: Any, value: Any, slopes: Array) -> Any:
    """Return `value` of a kind with duals, with derivatives of its `Flat.words`, (k, n).

    An array of duals is float64 (..., WIDTH), one of records of duals (records, words, WIDTH).
    """
    begin = 0

    def of(kind: Any, value: Any) -> Any:
        nonlocal begin
        if isinstance(kind, Group):
            parts = [of(own, part) for own, part in zip(kind.members, value)]
            return kind.names(*parts) if kind.names else tuple(parts)
        if not (isinstance(kind, ArrayKind) and kind.duals):
            return value
        words = _words(value)
        out = np.zeros((*words.shape, WIDTH))
        out[..., 0].view(np.int64)[...] = words.view(np.int64)
        if kind.dtype.names:
            real = np.broadcast_to(_is_real(kind.dtype), words.shape)
            first, begin = begin, begin + np.count_nonzero(real)
            out[real, 1 : 1 + len(slopes)] = slopes[:, first:begin].T
        elif words.size:
            first, begin = begin, begin + words.size
            out.reshape(-1, WIDTH)[:, 1 : 1 + len(slopes)] = slopes[:, first:begin].T
        return out

    return of(kind, value)


def slope_of(values: Sequence[Flat], weights: Sequence[float]) -> Array:
    """Return Σ weights words, (n,).

    The sum of the weights is zero: numbers that do not differ have a slope of exactly zero.

    Raises Differs if sizes or integers are not the same.
    """
    if any(x.fixed != values[0].fixed for x in values):
        raise Differs
    return weighted([x.words for x in values], weights)


def are_on_lines(values: Sequence[Flat]) -> bool:
    """Check whether all numbers have values at 0, 1 and -2 that are on a line, to rounding.

    The bound of 2 f(1) + f(-2) - 3 f(0) is 16 roundings of the largest value in its array.
    """
    finite = np.isfinite(values[0].words)
    at_0, at_1, at_2 = (np.where(finite, x.words, 0.0) for x in values)
    begins = values[0].begins
    size = np.maximum.reduceat(np.maximum.reduce(np.abs((at_0, at_1, at_2))), begins)
    bent = np.maximum.reduceat(np.abs(2.0 * at_1 + at_2 - 3.0 * at_0), begins)
    return bool((bent <= 16.0 * np.finfo(float).eps * size).all())


def are_alike(one: Flat, other: Flat) -> bool:
    """Check whether all numbers are equal, to rounding of the largest value in their array."""
    finite = np.isfinite(one.words)
    a, b = (np.where(finite, x.words, 0.0) for x in (one, other))
    size = np.maximum.reduceat(np.maximum(np.abs(a), np.abs(b)), one.begins)
    apart = np.maximum.reduceat(np.abs(a - b), one.begins)
    same = np.array_equal(one.words[~finite], other.words[~finite], equal_nan=True)
    return same and bool((apart <= ROUNDING * size).all())


def laid_out(kind: Any, value: Any) -> list[int]:
    """The memory words through which kernels access a lifted tuple, given its address."""
    if isinstance(kind, Group):
        return [word for own, part in zip(kind.members, value) for word in laid_out(own, part)]
    if not isinstance(kind, ArrayKind):
        return [int(value)]
    if kind.duals and kind.dtype.names:
        return [value.ctypes.data, len(value)]
    ndim, size = kind.ndim, value.itemsize * (WIDTH if kind.duals else 1)
    shape, strides = value.shape[:ndim], value.strides[:ndim]
    return [0, 0, math.prod(shape), size, value.ctypes.data, *shape, *strides]


def weighted(values: Sequence[Array], weights: Sequence[float]) -> Array:
    """Σ weights (values - the first of them), zero if that is not finite."""
    first, total = values[0], np.zeros(np.shape(values[0]))
    finite = np.isfinite(first)
    for weight, value in zip(weights, values):
        total[finite] += weight * (value[finite] - first[finite])
    return total


def _arrays(kind: Any, value: Any, found: list[tuple[ArrayKind, Array]]) -> list[Any]:
    """Add all arrays of a tuple, with their kinds, to a list."""
    for own, part in zip(kind.members, value):
        if isinstance(own, Group):
            _arrays(own, part, found)
        elif isinstance(own, ArrayKind):
            found.append((own, part))
    return found


def _words(value: Any) -> Array:
    """Return arrays of numbers unchanged, and arrays of records as (records, words)."""
    if not value.dtype.names:
        return value
    flat = np.ascontiguousarray(value).view(np.float64)
    return flat.reshape(len(value), value.dtype.itemsize // 8)


@cache
def _is_real(record: np.dtype[Any]) -> Any:
    """(words,) whether each word of a record is a real number."""
    found = np.zeros(record.itemsize // 8, dtype=bool)
    for field in record.fields.values() if record.fields else ():
        inside, first = field[:2]
        found[first // 8 : (first + inside.itemsize) // 8] = inside.base.kind == "f"
    return found
