"""A run's data as one piece of memory for WebAssembly, where pointers take 4 bytes.

Numbers and records have the same form there as here; only the structs that describe arrays differ,
and all that is an address. Arrays that share memory here share it there.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import types

TUPLE: Any = types.BaseTuple
ARRAYS: Any = types.Array
ALIGNED = 16  # [bytes] as vectors of two doubles want it
ARRAY, AXIS = 32, 16  # [bytes] of the struct of an array, and for each of its axes
# in that struct: number of entries, bytes of each, place of the data, then shape and strides
ENTRIES, ENTRY, DATA, SHAPE = 8, 16, 24, 32


class Root(NamedTuple):
    """A struct that kernels open by address."""

    kind: Any  # its numba type
    value: Any  # named tuple
    within: Any = None  # array that holds the struct; None: it stands alone
    skip: int = 0  # [bytes] from the start of that array


class Image:
    """Where structs and arrays stand from address `base` on, and their bytes."""

    def __init__(self, base: int, roots: Mapping[str, Root], others: Iterable[Any] = ()):
        """`others` are arrays that no struct names. Nothing is written yet."""
        self.base, self._roots = base, roots
        arrays = [a for root in roots.values() for a in _arrays(root.kind, root.value)]
        arrays += [*others, *(r.within for r in roots.values() if r.within is not None)]
        self._begins, self._ends = _spans(arrays)
        top, self.at = base, dict[str, int]()
        for name, root in roots.items():
            if root.within is None:
                self.at[name], top = top, _aligned(top + size_of(root.kind))
        self._places = [0] * len(self._begins)  # in the order of the arrays: the same every time
        for k in dict.fromkeys(self._span_of(a) for a in arrays if a.nbytes):
            self._places[k] = top
            top = _aligned(top + self._ends[k] - self._begins[k])
        self.size = top - base
        for name, root in roots.items():
            if root.within is not None:
                self.at[name] = self.place(root.within) + root.skip

    def place(self, array: Any) -> int:
        """Where an array's first entry stands."""
        if array.nbytes == 0:
            return self.base
        k, address = self._span_of(array), _address(array)
        assert address + array.nbytes <= self._ends[k], "not in the image"
        return self._places[k] + address - self._begins[k]

    def _span_of(self, array: Any) -> int:
        return int(np.searchsorted(self._begins, _address(array), side="right")) - 1

    def name_of(self, address: int) -> str:
        """Which struct's array holds an address, in words for a person."""
        for name, root in self._roots.items():
            for path, array in _named(root.kind, root.value):
                place = self.place(array)
                if array.nbytes and place <= address < place + array.nbytes:
                    return f"numbers of the {name} ({path})"
        return "numbers of the run"

    def bytes(self, changed: Mapping[str, Any]) -> bytearray:
        """The memory, with these values in the places of the structs' own (links, addresses)."""
        found = bytearray(self.size)
        for begin, end, place in zip(self._begins, self._ends, self._places):
            found[place - self.base : place - self.base + end - begin] = _memory(begin, end)
        for name, root in self._roots.items():
            if root.within is not None:  # where this machine's struct stood
                at, size = self.at[name] - self.base, root.within.nbytes - root.skip
                found[at : at + size] = bytes(size)
            self._write(found, root.kind, changed.get(name, root.value), self.at[name] - self.base)
        return found

    def _write(self, out: bytearray, kind: Any, value: Any, at: int) -> int:
        """Write a value at an offset; where the next one begins."""
        if isinstance(kind, TUPLE):
            for member, part in zip(kind, value):
                at = self._write(out, member, part, at)
            return at
        if isinstance(kind, ARRAYS):
            place = self.place(value)
            head = np.zeros(ARRAY // 8 + 2 * kind.ndim, dtype=np.int64)
            head[ENTRIES // 8], head[ENTRY // 8] = value.size, value.itemsize
            head[DATA // 8] = place
            head[SHAPE // 8 :] = *value.shape, *_strides(value)
            out[at : at + head.nbytes] = head.tobytes()
            return at + head.nbytes
        out[at : at + 8] = np.int64(value).tobytes()
        return at + 8


def size_of(kind: Any) -> int:
    """Bytes of a struct of this numba type."""
    if isinstance(kind, TUPLE):
        return sum(map(size_of, kind))
    return ARRAY + AXIS * kind.ndim if isinstance(kind, ARRAYS) else 8


def offset_of(kind: Any, *path: str) -> int:
    """Where a member of a named tuple type stands in its struct [bytes]."""
    at = 0
    for name in path:
        k = kind.fields.index(name)
        at += sum(size_of(kind[i]) for i in range(k))
        kind = kind[k]
    return at


def _arrays(kind: Any, value: Any) -> list[Any]:
    if isinstance(kind, TUPLE):
        return [a for member, part in zip(kind, value) for a in _arrays(member, part)]
    return [value] if isinstance(kind, ARRAYS) else []


def _named(kind: Any, value: Any, path: str = "") -> list[tuple[str, Any]]:
    if isinstance(kind, TUPLE):
        names = getattr(kind, "fields", range(len(value)))
        parts = zip(names, kind, value)
        return [found for n, k, v in parts for found in _named(k, v, f"{path}.{n}".strip("."))]
    return [(path, value)] if isinstance(kind, ARRAYS) else []


def _address(array: Any) -> int:
    return array.__array_interface__["data"][0]


def _spans(arrays: Iterable[Any]) -> tuple[list[int], list[int]]:
    """Where the memory of arrays begins and ends, those that overlap together."""
    begins: list[int] = []
    ends: list[int] = []
    for begin, end in sorted((_address(a), _address(a) + a.nbytes) for a in arrays if a.nbytes):
        if ends and begin < ends[-1]:
            ends[-1] = max(ends[-1], end)
        else:
            begins.append(begin)
            ends.append(end)
    return begins, ends


def _memory(begin: int, end: int) -> bytes:
    return ctypes.string_at(begin, end - begin)


def _strides(array: Any) -> tuple[int, ...]:
    """Of a contiguous array; NumPy gives others where an axis has one entry or none."""
    strides, step = [], array.itemsize
    for n in reversed(array.shape):
        strides.insert(0, step)
        step *= n
    return tuple(strides)


def _aligned(address: int) -> int:
    return -(-address // ALIGNED) * ALIGNED
