"""Kernel decorators: `kernel` for calls from Python, `part`, `sweep`, `inlined` for helpers.

The decorators import no compiler. A kernel gets its machine code from `loading` at its first call.
If there is no machine code for these sources, `lowering` compiles the kernel with numba, which
treats helpers as numba functions. All settings are attributes of these objects, so a user's own
numba code is not affected.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from .kinds import Signature

ENGINE = Path(__file__).parent.parent
JIT = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
LOCK = threading.RLock()  # one thread at a time compiles or loads
tools: Any = None  # the module `tools`, which the package `engine` sets here


class Late:
    """A placeholder for `lowering.MODULE.NAME`, resolved when a kernel is compiled.

    With arguments, the object represents the return value of the function for these arguments.
    Python calls `plain`.
    """

    def __init__(self, module: str, name: str, plain: Any = None, *given: Any):
        self._where, self._given = (module, name), given
        self._plain = plain

    def __call__(self, *args: Any) -> Any:
        return self._plain(*args)

    @cached_property
    def made(self) -> Any:
        """Return the function known to numba."""
        found = tools.lowering(*self._where)
        return found(*self._given) if self._given else found

    @property
    def _numba_type_(self) -> Any:
        return tools.type_of(self.made)


def late(module: str, name: str, plain: Any = None, *given: Any) -> Any:
    """Return a placeholder for a function of `lowering`, or `plain` if compilation is disabled."""
    return Late(module, name, plain, *given) if JIT else plain


class Helper:
    """A function called by kernels, turned into numba's form when a kernel is compiled."""

    def __init__(self, function: Callable[..., Any], how: str):
        self.py_func, self._how = function, how
        self.__name__, self.__module__, self.__doc__ = (
            function.__name__,
            function.__module__,
            function.__doc__,
        )

    @cached_property
    def made(self) -> Any:
        """Numba's dispatcher."""
        return tools.dispatcher(self.py_func, self._how)

    @property
    def targetoptions(self) -> Any:
        """Return the options of numba's form, which mark a stage as inlined."""
        return self.made.targetoptions

    @property
    def _numba_type_(self) -> Any:
        return tools.type_of(self.made)


class Kernel(Helper):
    """A compiled function for calls from Python. Other signatures than its own raise TypeError.

    Python code can then try a call with the given arguments, and only check them if it fails.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        signatures: tuple[Signature, ...],
        nogil: bool = False,
        lanes: bool = False,
    ):
        super().__init__(function, "sweep")
        self.signatures, self.nogil, self.lanes = signatures, nogil, lanes
        self._codes: dict[int, Any] = {}
        self._enter: Callable[..., Any] = self._first

    def __call__(self, *args: Any) -> Any:
        return self._enter(*args)

    def _first(self, *args: Any) -> Any:
        if len(self.signatures) == 1:
            return self.ready()(*args)
        for k, signature in enumerate(self.signatures):
            if tools.fits(signature, args):
                found = self.code(k).call
                self._enter = self._any_of
                return found(*args)
        raise TypeError(f"{self.__name__}: none of its signatures takes these arguments")

    def _any_of(self, *args: Any) -> Any:
        for code in (*self._codes.values(),):
            try:
                return code.call(*args)
            except TypeError:
                continue
        return self._first(*args)

    def code(self, variant: int = 0) -> Any:
        """Return the machine code for a signature, loading or compiling it."""
        with LOCK:
            if variant not in self._codes:
                self._codes[variant] = tools.code_of(self, variant)
            return self._codes[variant]

    def ready(self) -> Callable[..., Any]:
        """Return the function that Python calls, loading or compiling it."""
        self._enter = self.code().call
        return self._enter

    @property
    def is_ready(self) -> bool:
        """Return True if its machine code is loaded."""
        return bool(self._codes)

    def close(self) -> None:
        """Make calls raise TypeError until the kernel is made ready."""
        if not self._codes:
            self._enter = self._refuse

    def _refuse(self, *args: Any) -> Any:
        raise TypeError(f"{self.__name__} is not loaded yet")


def part(function: Callable[..., Any]) -> Any:
    """Mark a small helper that is always inlined."""
    return Helper(function, "part") if JIT else tools.as_python(function)


def sweep(function: Callable[..., Any]) -> Any:
    """Mark a helper that loops over rows. Sweeps are not inlined, so a kernel contains their code
    once."""
    return Helper(function, "sweep") if JIT else tools.as_python(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Mark a stage of one kernel, merged into it before compilation."""
    return Helper(function, "inlined") if JIT else tools.as_python(function)


def kernel(
    *signatures: Signature, nogil: bool = False, later: bool = False, lanes: bool = False
) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function for calls from Python, with one or several signatures.

    `later` keeps it out of the warm-up: it is loaded where something asks for it. `lanes` says that
    it is compiled for the width of vectors here.

    Short kernels hold the GIL, so that a workspace is never used by two threads at once. Whole runs
    release the GIL (`nogil`) and have separate workspaces.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        if not JIT:
            return tools.as_python(function, entry=True)
        made = Kernel(function, signatures, nogil, lanes)
        register(LATER if later or len(signatures) > 1 else KERNELS, made)
        return made

    return compiled


def register(kernels: dict[str, Any], made: Any) -> None:
    """Register a kernel under its name. Raises RuntimeError if another module uses that name."""
    name, home = made.__name__, made.__module__
    for known in (KERNELS, LATER):
        if name in known and known[name].__module__ != home:
            raise RuntimeError(f"{home} and {known[name].__module__} both have a kernel {name}")
    kernels[name] = made


def ready(one: Any) -> Any:
    """Return a kernel as a Python callable, loading or compiling it first."""
    return one.ready() if JIT else one


def closed(one: Any) -> Any:
    """Disable loading in calls. Calling a kernel before it is `ready` raises TypeError."""
    if JIT:
        one.close()
    return one


def made_by_numba(function: Any) -> bool:
    """Check whether a user's function was compiled by `numba.njit`."""
    module = sys.modules.get("numba.core.dispatcher")  # without it there is no such function
    return JIT and module is not None and isinstance(function, module.Dispatcher)


KERNELS: dict[str, Any] = {}  # every kernel, for the warm-up
LATER: dict[str, Any] = {}  # those that are not warmed up
