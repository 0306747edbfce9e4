"""Argument and return types of kernels, for signatures such as `void(i8[:, ::1], f8)`.

They describe memory alone. The compiler support is in `lowering.kinds`, so that signatures of
kernels do not require the import of a compiler.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np


class Kind:
    """The type of a value."""

    code: str  # code of a number

    def __call__(self, *arguments: Kind) -> Signature:
        """Return the signature of a function that returns this kind."""
        return Signature(self, arguments)


@dataclass(frozen=True)
class Scalar(Kind):
    """A number by its NumPy code, "none" for a missing one, or "void" for no result."""

    code: str

    def __getitem__(self, axes: slice | tuple[slice, ...]) -> Array:
        """Return the kind of a C-contiguous array with one axis per slice."""
        return Array(np.dtype(self.code), len(axes) if isinstance(axes, tuple) else 1)


@dataclass(frozen=True)
class Array(Kind):
    """A C-contiguous array of numbers or records."""

    dtype: np.dtype[Any]
    ndim: int
    read: bool = False  # not written: an array that is read-only does as well
    duals: bool = False  # each number is followed by its derivatives


@dataclass(frozen=True)
class Group(Kind):
    """A tuple, or a named tuple with its class."""

    members: tuple[Kind, ...]
    names: Any = None

    @property
    def fields(self) -> tuple[str, ...]:
        """Return the names of the members."""
        return self.names._fields

    def but(self, **members: Kind) -> Group:
        """Return the kind with other members."""
        kinds = dict(zip(self.fields, self.members)) | members
        return replace(self, members=tuple(kinds.values()))


@dataclass(frozen=True)
class Signature:
    """The types of the result and the arguments of a function."""

    result: Kind
    arguments: tuple[Kind, ...]


i8, f8, u8, i4, f4, u1 = map(Scalar, ("i8", "f8", "u8", "i4", "f4", "u1"))
none, void = Scalar("none"), Scalar("void")
of_duals = Scalar("of_duals")  # address of a scene or run whose numbers carry derivatives


def group(*members: Kind) -> Group:
    """Return the kind of an unnamed tuple."""
    return Group(members)


def named(names: Any, *members: Kind) -> Group:
    """Return the kind of a named tuple."""
    return Group(members, names)


def array_of(record: np.dtype[Any], dimensions: int = 1) -> Array:
    """Return the kind of a C-contiguous array of records."""
    return Array(record, dimensions)


def read(kind: Array) -> Array:
    """Return the kind of an array that a kernel only reads."""
    return replace(kind, read=True)


def carrying(kind: Any) -> Any:
    """Return the same kind or signature with dual numbers in its arrays."""
    if isinstance(kind, Group):
        return replace(kind, members=tuple(map(carrying, kind.members)))
    if isinstance(kind, Signature):
        return Signature(kind.result, tuple(map(carrying, kind.arguments)))
    real = isinstance(kind, Array) and (kind.dtype.names or kind.dtype == np.float64)
    return replace(kind, duals=True) if real else kind


def plain(kind: Kind) -> Kind:
    """Return the kind of an unnamed tuple."""
    return Group(tuple(map(plain, kind.members))) if isinstance(kind, Group) else kind


I1, I2 = i8[::1], i8[:, ::1]
F1, F2, F3 = f8[::1], f8[:, ::1], f8[:, :, ::1]
C2 = Scalar("c16")[:, ::1]
