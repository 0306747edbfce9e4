"""Loops in machine code: forward dynamics without a call from Python in between."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba import types

from pgraph_core.engine.compiler.address import caller
from pgraph_core.engine.compiler.jit import OPTIONS
from pgraph_core.engine.tree.dynamics import articulated

_call = caller(
    types.int64(types.float64, types.uint64, types.uint64, types.uint64)
)  # t, and where q, v and τ stand


@numba.njit(**OPTIONS)
def forward_dynamics(rows, const, q, v, tau, work, vdot, n):
    """v' of the tree, n times."""
    for _ in range(n):
        articulated(rows, const, q, v, tau, work, vdot)


def mujoco_loop(model: Any, data: Any) -> Callable[[int], None]:
    """mj_forward of its own library, n times."""
    import mujoco

    library = next(Path(mujoco.__file__).parent.glob("libmujoco.*"))
    mj_forward = ctypes.CDLL(str(library)).mj_forward
    mj_forward.argtypes, mj_forward.restype = (ctypes.c_void_p, ctypes.c_void_p), None

    @numba.njit
    def loop(model_address, data_address, n):
        for _ in range(n):
            mj_forward(model_address, data_address)

    return lambda n: loop(model._address, data._address, n)


@numba.njit(**OPTIONS)
def torques(address, q, v, tau, step, n):
    """A controller behind an address, n times, as runs call it; q, v, tau are places."""
    for k in range(n):
        _call(address, (k * step, q, v, tau))
