"""The memory of a run as one image: structs and arrays as the kernels of another machine find them.

Numbers and records have the same format everywhere, but array descriptors and addresses depend on
the size of a pointer. Arrays that share memory in Python also share memory in the image.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..engine.compiler.kinds import Array, Group

ALIGNED = 16  # [bytes] alignment of vectors of two doubles
AXIS = 16  # [bytes] per axis in the struct of an array: its length and its stride


class Pointers(NamedTuple):
    """Places [bytes] in the struct of an array, by the size of a pointer.

    Shape and strides follow `shape`.
    """

    entries: int  # number of entries
    entry: int  # bytes of each
    data: int  # address of the first
    shape: int  # also the size of the struct without its axes

    def size_of(self, kind: Any) -> int:
        """Return the size of a struct of this type [bytes]."""
        if isinstance(kind, Group):
            return sum(map(self.size_of, kind.members))
        return self.shape + AXIS * kind.ndim if isinstance(kind, Array) else 8

    def offset_of(self, kind: Any, *path: str) -> int:
        """Return the byte offset of a named-tuple field within the corresponding struct."""
        at = 0
        for name in path:
            k = kind.fields.index(name)
            at += sum(self.size_of(member) for member in kind.members[:k])
            kind = kind.members[k]
        return at


FOUR_BYTES = Pointers(8, 16, 24, 32)  # WebAssembly
EIGHT_BYTES = Pointers(16, 24, 32, 40)


class Root(NamedTuple):
    """A struct that the kernels access by address."""

    kind: Any  # type of its members
    value: Any  # named tuple
    within: Any = None  # array that holds the struct, None if the struct stands alone
    skip: int = 0  # [bytes] from the start of that array


class Image:
    """The layout and the bytes of the structs and arrays that start at address `base`."""

    def __init__(
        self, base: int, pointers: Pointers, roots: Mapping[str, Root], others: Iterable[Any] = ()
    ):
        """Set up the layout. `others` are arrays outside structs. Nothing is written yet."""
        self.base, self.pointers, self._roots = base, pointers, roots
        arrays = [a for root in roots.values() for a in _arrays(root.kind, root.value)]
        arrays += [*others, *(r.within for r in roots.values() if r.within is not None)]
        self._begins, self._ends = _spans(arrays)
        top, self.at = base, dict[str, int]()
        for name, root in roots.items():
            if root.within is None:
                self.at[name], top = top, _aligned(top + pointers.size_of(root.kind))
        self._places = [0] * len(self._begins)  # sorted like the arrays, so every image is the same
        for k in dict.fromkeys(self._span_of(a) for a in arrays if a.nbytes):
            self._places[k] = top
            top = _aligned(top + self._ends[k] - self._begins[k])
        self.size = top - base
        for name, root in roots.items():
            if root.within is not None:
                self.at[name] = self.place(root.within) + root.skip

    def move(self, by: int) -> None:
        """Put the image at another address."""
        self.base += by
        self._places = [place + by for place in self._places]
        self.at = {name: place + by for name, place in self.at.items()}

    def place(self, array: Any) -> int:
        """Return the address of the first entry in an array."""
        k, address = self._span_of(array), _address(array)
        if array.nbytes == 0 and (k < 0 or not address < self._ends[k]):
            return self.base  # an empty array is not the begin of another one
        assert address + array.nbytes <= self._ends[k], "not in the image"
        return self._places[k] + address - self._begins[k]

    def _span_of(self, array: Any) -> int:
        return int(np.searchsorted(self._begins, _address(array), side="right")) - 1

    def name_of(self, address: int) -> str:
        """Return a readable name for the struct whose array contains an address."""
        for name, root in self._roots.items():
            for path, array in _named(root.kind, root.value):
                place = self.place(array)
                if array.nbytes and place <= address < place + array.nbytes:
                    return f"numbers of the {name} ({path})"
        return "numbers of the run"

    def bytes(self, changed: Mapping[str, Any]) -> bytearray:
        """Return the memory, with `changed` values of structs (links, addresses)."""
        found = bytearray(self.size)
        for begin, end, place in zip(self._begins, self._ends, self._places):
            found[place - self.base : place - self.base + end - begin] = _memory(begin, end)
        for name, root in self._roots.items():
            if root.within is not None:  # replaces the struct of this machine
                at, size = self.at[name] - self.base, root.within.nbytes - root.skip
                found[at : at + size] = bytes(size)
            self._write(found, root.kind, changed.get(name, root.value), self.at[name] - self.base)
        return found

    def _write(self, out: bytearray, kind: Any, value: Any, at: int) -> int:
        """Write a value at an offset and return the offset of the next value."""
        if isinstance(kind, Group):
            for member, part in zip(kind.members, value):
                at = self._write(out, member, part, at)
            return at
        if isinstance(kind, Array):
            place = self.place(value)
            places = self.pointers
            head = np.zeros(places.shape // 8 + 2 * kind.ndim, dtype=np.int64)
            head[places.entries // 8], head[places.entry // 8] = value.size, value.itemsize
            head[places.data // 8] = place
            # of a contiguous array, even for axes of length 0 or 1
            strides, step = [], value.itemsize
            for n in reversed(value.shape):
                strides.insert(0, step)
                step *= n
            head[places.shape // 8 :] = *value.shape, *strides
            out[at : at + head.nbytes] = head.tobytes()
            return at + head.nbytes
        out[at : at + 8] = np.int64(value).tobytes()
        return at + 8


def _arrays(kind: Any, value: Any) -> list[Any]:
    if isinstance(kind, Group):
        return [a for member, part in zip(kind.members, value) for a in _arrays(member, part)]
    return [value] if isinstance(kind, Array) else []


def _named(kind: Any, value: Any, path: str = "") -> list[tuple[str, Any]]:
    if isinstance(kind, Group):
        names = kind.fields if kind.names else range(len(value))
        parts = zip(names, kind.members, value)
        return [found for n, k, v in parts for found in _named(k, v, f"{path}.{n}".strip("."))]
    return [(path, value)] if isinstance(kind, Array) else []


def _address(array: Any) -> int:
    return array.__array_interface__["data"][0]


def _spans(arrays: Iterable[Any]) -> tuple[list[int], list[int]]:
    """Return the start and end addresses of arrays, merging overlapping arrays."""
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


def _aligned(address: int) -> int:
    return -(-address // ALIGNED) * ALIGNED
