"""Torques from a user function, called by compiled runs at every stage."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from ..engine.compiler.address import address_of_function
from ..engine.compiler.jit import made_by_numba
from ..errors import InputError, Problem, shown
from ..packing import Array
from ..packing.packed import Packed
from ..portable import Unportable

_Address = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_double, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_uint64
)


class UserTorque(Unportable):
    """A torque function f(t, q, v) -> τ (nv,), in Python or compiled by `numba.njit`.

    A compiled one costs tens of nanoseconds a call, a Python one some microseconds.
    """

    def __init__(self, function: Callable[[float, Array, Array], Any], nq: int, nv: int, room: int):
        """Wrap the function without calling it, for states of at most `room` numbers.

        Raises InputError if numba cannot compile it.
        """
        self.function = function
        self.exchange = np.zeros((4, max(room, 1)))
        self.answer = np.zeros(1, dtype=np.int64)
        self.error: InputError | None = None
        self._q, self._v = self.exchange[0, :nq], self.exchange[1, :nv]
        self._tau = self.exchange[2, :nv]
        self._bad = self.exchange[3, :1]  # time of the last answer that was not finite [s]
        self._bad[:] = -np.inf
        if made_by_numba(function):
            self._called: Any = _compiled(function, nq, nv, max(room, 1))
            self.interpreted = False
            self.address = int(self._called.address)
        else:
            self._called = _Address(self._call)
            self.address = address_of_function(self._called)

    interpreted = True  # by Python, not compiled

    @property
    def memory(self) -> list[Array]:
        """The arrays that calls read before writing."""
        return []

    @property
    def numbers(self) -> list[Array]:
        """The arrays read by calls that come from the description."""
        return []

    def join(self, packed: Packed, work: Array) -> None:
        """Join a run whose kernels keep body data in `work`. It is not used here."""

    def notices(self) -> list[str]:
        """Return warnings about the torques in the run."""
        return []

    def trouble(self, t: float) -> str:
        """Return the reason why calls produced no torques at time t [s] or later, or ""."""
        nv, answer, bad = len(self._tau), int(self.answer[0]), float(self._bad[0])
        if answer and not self.interpreted:
            return f"the compiled function tau returned {answer - 1} torques, and {nv} are needed"
        if bad < t:
            return ""
        raised = "" if self.interpreted else "raised an error, or "
        return f"the function tau {raised}returned torques that are not finite, at t = {bad:.6g} s"

    def _call(self, t: float, *_: int) -> int:
        try:
            self._tau[:] = self._checked(t)
        except InputError as error:
            self.error = error
            return 1
        return 0

    def _checked(self, t: float) -> Array:
        """Call the function on copies and return its result. A non-finite result ends the run.

        Raises InputError if the function raises or does not fit.
        """
        try:
            given = self.function(t, self._q.copy(), self._v.copy())
        except Exception as error:
            text = f"the function raised {type(error).__name__}: {error} (at t = {t:.6g} s)"
            raise InputError(Problem("simulate", "tau", text)) from error
        found = np.asarray(given)
        if found.dtype.kind in "fiu" and found.shape != self._v.shape:
            text = f"the function returned shape {found.shape}; it must return {self._v.shape}"
            raise InputError(Problem("simulate", "tau", f"{text}, a torque for each of v"))
        if found.dtype.kind not in "fiu":
            text = f"the function returned {shown(given)} at t = {t:.6g} s; it must return "
            text += f"{len(self._v)} numbers, a torque for each of v"
            raise InputError(Problem("simulate", "tau", text))
        if not np.isfinite(found).all():
            self._bad[0] = t
        return found


def acting(tau: Any, nq: int, nv: int, room: int) -> UserTorque | None:
    """Return the function called for `tau` by compiled runs, or None for an array.

    A controller provides its own compiled function, with a workspace for each run.
    """
    if hasattr(tau, "acting"):
        return tau.acting(room)
    return UserTorque(tau, nq, nv, room) if callable(tau) else None


def _compiled(function: Any, nq: int, nv: int, behind: int) -> Any:
    """Wrap the function in C's calling convention.

    Its answer is 0, or 1 and the number of torques if that is not nv. τ is not finite where
    the function raises: numba goes on then. The number in the row behind τ is the time of the last
    answer that was not finite.
    """
    # a user's function that is compiled has brought numba
    from numba import carray, cfunc, types  # pyright: ignore[reportPrivateImportUsage]
    from numba.core.errors import NumbaError

    pointer = types.CPointer(types.float64)

    def called(t: float, q: Any, v: Any, tau: Any) -> int:
        out = carray(tau, (behind + 1,))
        for j in range(nv):
            out[j] = np.nan
        last, out[behind] = out[behind], t
        given = function(t, carray(q, (nq,)), carray(v, (nv,)))
        if given.shape[0] != nv:
            return 1 + given.shape[0]
        finite = True
        for j in range(nv):
            out[j] = given[j]
            finite = finite and np.isfinite(out[j])
        if finite:
            out[behind] = last
        return 0

    try:
        return cfunc(types.int64(types.float64, pointer, pointer, pointer))(called)
    except NumbaError as error:
        lines = [line.strip(" -") for line in str(error).splitlines() if line.strip()]
        reasons = [line for line in lines if not line.startswith("Failed in")] or lines
        text = f"numba cannot compile the function for (t, q, v): {reasons[0]}"
        raise InputError(Problem("simulate", "tau", text)) from None
