"""Kernels allocate nothing: not when compiled, not in their machine code, not when run."""

from __future__ import annotations

import gc
import pickle
import sys
import tracemalloc

import numba
import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.engine import layout as at
from pgraph_core.engine import warm_up
from pgraph_core.engine.compiler.jit import JIT, KERNELS, OPTIONS, cache_folder
from pgraph_core.engine.tree import dynamics

from .trees import random_case

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


@compiled_only
def test_the_search_would_find_an_allocation():
    @numba.njit
    def allocating(x):
        return np.full(3, x)

    allocating(1.0)
    library = allocating.overloads[allocating.signatures[0]].library
    assert RUNTIME in pickle.dumps(library.serialize_using_object_code())


def calls(seed=5):
    """{name: a call of a kernel on arrays that are there}, on a forest of all joints."""
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    packed, tree = mech.packed.system[:4], mech.packed.tree
    q, v, tau, vdot, external = (np.ascontiguousarray(x) for x in s[2:])
    n, work = mech.nv, np.zeros((len(mech.packed.system.rows), at.WORK))
    zero, out, m, outer = np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros(n, np.int64)
    given = (q, v, tau, external)
    return {
        "forward_dynamics": (*tree, q, v, tau, work, out),
        "forward_dynamics_external": (*packed, *given, work, out),
        "forward_dynamics_composite": (*packed, *given, zero, work, outer, m, out),
        "inverse_dynamics": (*packed, q, v, vdot, external, work, out),
        "mass_matrix": (*tree, q, zero, work, m),
    }


@compiled_only
@pytest.mark.parametrize("name", calls())
def test_repeated_calls_leave_the_heap_as_it_was(name):
    """Python's own blocks, and the bytes that NumPy reports to tracemalloc, at their peak."""
    kernel, arguments = getattr(dynamics, name), calls()[name]
    repeat = [None] * 200

    def peak():
        gc.collect()
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        for _ in repeat:
            kernel(*arguments)
        highest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return highest - before

    kernel(*arguments)
    assert peak() < 1024  # the interpreter's own; the smallest array of a state is as large
    gc.collect()
    before = sys.getallocatedblocks()
    for _ in repeat:
        kernel(*arguments)
    assert sys.getallocatedblocks() - before < 20
