"""Kernels allocate nothing: arrays do not compile, and no machine code calls an allocator."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.engine import warm_up
from pgraph_core.engine.compiler.jit import JIT, KERNELS, OPTIONS, cache_folder

RUNTIME = b"NRT_"  # numba's run-time: arrays and reference counts
HEAP = (b"malloc", b"calloc", b"_Znwm")
compiled_only = pytest.mark.skipif(not JIT, reason="nothing is compiled")


@compiled_only
def test_a_kernel_that_makes_an_array_does_not_compile():
    @numba.njit(**OPTIONS)
    def allocating(x):
        return np.zeros(3)[0] + x

    with pytest.raises(numba.TypingError, match="zeros"):
        allocating(1.0)


@pytest.mark.nightly
@compiled_only
def test_the_machine_code_of_no_kernel_calls_an_allocator():
    for _ in warm_up():
        pass
    mech = pg.Mechanism(pg.Model.serial(2))
    batch = pg.BatchStepper(mech, 1)  # lanes: when first asked for
    batch.step()
    batch.inverse_dynamics(batch.acceleration())
    for name, (dispatcher, _) in KERNELS.items():
        files = list(cache_folder().glob(f"{dispatcher._cache._impl.filename_base}.*.kernel"))
        assert files, name
        for code in (path.read_bytes() for path in files):
            assert RUNTIME not in code, name
            assert not any(symbol in code for symbol in HEAP), name
