"""Addresses of scenes and kernels, used instead of forty arrays or a function.

A kernel that takes a scene by address is called from Python in the time of three arguments, and
from other kernels without a copy. Methods that call the equations of motion by address do not
contain their code, so the equations are compiled once instead of once per method. The creator of an
address must keep the object alive. Uncompiled (NUMBA_DISABLE_JIT=1) an address is a key of a
dictionary.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from .jit import JIT, late
from .kinds import Group, Signature

WORDS = 1024  # words of 8 bytes, more than any scene takes
_KEPT: dict[int, Any] = {}  # objects by their "addresses" when nothing is compiled


def unnamed(value: Any) -> Any:
    """Return a named tuple in the form passed to kernels."""
    if not JIT:
        return value
    members = list(value)
    for i, member in enumerate(members):
        if isinstance(member, tuple):
            members[i] = unnamed(member)
    return tuple(members)


def stored(kind: Group, of_duals: Group | None = None) -> tuple[Any, Any]:
    """Return (save, opened) for a named tuple: `save(buffer, value)` and `opened(address)`.

    Tuples are saved without names by `unnamed`, and have names when they are opened. A tuple can be
    opened as its first member. If `of_duals` is given, the members at an address have its types.
    """
    return (
        late("address", "saving", _keep, kind),
        late(
            "address", "opening", lambda address: _named(_KEPT[address], kind.names), kind, of_duals
        ),
    )


def caller(signature: Signature) -> Any:
    """Return `call(address, (arguments))` for kernels or C functions with this signature."""
    return late("address", "caller", lambda address, args: _KEPT[address](*args), signature)


def address_of(kernel: Any) -> int:
    """Return the address of a kernel's code for `caller`. Loads or compiles it first."""
    return kernel.code().address if JIT else address_of_function(kernel)


def address_of_function(function: Any) -> int:
    """Return the address of a ctypes function."""
    if JIT:
        return ctypes.cast(function, ctypes.c_void_p).value or 0
    _KEPT[id(function)] = function
    return id(function)


def address_of_array(array: Any) -> int:
    """Return the address of a buffer for `stored`."""
    return array.ctypes.data if JIT else id(array)


def buffer() -> Any:
    """Return an empty buffer for a scene."""
    return np.zeros(WORDS, dtype=np.int64)


def _keep(array: Any, value: Any) -> None:
    _KEPT[id(array)] = value


def _named(value: Any, wanted: type) -> Any:
    """Return the value, or its first member, that is an instance of the wanted named tuple."""
    return value if isinstance(value, wanted) else _named(value[0], wanted)
