"""Parts of the compiler that `jit` imports on demand.

`jit` is the floor on which kernels are written, and `loading` and `lowering` know `jit`. The
package passes this module to it, so `jit` has no imports.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from .clock import LOADING


def code_of(kernel: Any, variant: int) -> Any:
    """Return a kernel's machine code, loaded or compiled."""
    from .loading import code_of

    with LOADING:
        return code_of(kernel, variant)


def fits(signature: Any, args: tuple[Any, ...]) -> bool:
    """Check whether a signature accepts the arguments."""
    from .calls import fits

    return fits(signature, args)


def as_python(function: Callable[..., Any], *, entry: bool = False) -> Callable[..., Any]:
    """Return a kernel or helper as a Python function with the arithmetic of machine code."""
    from .plain import as_python

    return as_python(function, entry=entry)


def dispatcher(function: Callable[..., Any], how: str) -> Any:
    """Return numba's form of a helper."""
    from .lowering.dispatch import dispatcher

    return dispatcher(function, how)


def type_of(made: Any) -> Any:
    """Return numba's type of a function."""
    from .lowering.dispatch import type_of

    return type_of(made)


def lowering(module: str, name: str) -> Any:
    """Return a function of `lowering.MODULE`."""
    return getattr(import_module(f".lowering.{module}", __package__), name)
