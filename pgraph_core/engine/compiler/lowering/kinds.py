"""Numba's types of our own."""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
from numba import types

from ..kinds import Array, Group, Kind

SCALARS = {
    "i8": types.int64, "u8": types.uint64, "f8": types.float64, "i4": types.int32,
    "f4": types.float32, "u1": types.uint8, "none": types.none, "void": types.void,
}  # fmt: skip

# No reference counting: kernels allocate nothing, and its atomic counts take half of their time.
# No contraction of a b + c to one rounding: every processor gives the same bits.
OPTIONS: dict[str, Any] = {"_nrt": False, "fastmath": False, "error_model": "numpy"}
INLINED = {**OPTIONS, "forceinline": True}


@cache
def numba_type(kind: Kind) -> Any:
    """The type that the compiler has for a kind."""
    if isinstance(kind, Array):
        return types.Array(numba.from_dtype(kind.dtype), kind.ndim, "C")
    if isinstance(kind, Group):
        members = [numba_type(member) for member in kind.members]
        plain = kind.names is None
        return types.Tuple(members) if plain else types.BaseTuple.from_types(members, kind.names)
    return SCALARS[kind.code]
