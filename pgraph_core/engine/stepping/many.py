"""Many instances one after the other in one run: each is a row of bytes, copied in, stepped, out.

A row is all that steps read before they write it, so that no result depends on what the run has
stepped before. Kernels are called by address: nothing is compiled twice.
"""

from numba import types

from .. import layout as at
from ..arrays import I1, I2, i8
from ..compiler.address import caller
from ..compiler.jit import kernel, part

COPY = types.int64(types.int64, types.int64, types.int64)  # to, from, bytes: C's memmove
ADVANCE = types.int64(types.int64, types.int64)  # `advance_run`
call_copy = caller(COPY)
call_advance = caller(ADVANCE)


@kernel(types.void(i8, i8, i8, I2, I2, I2, I1, I1, i8, i8, i8), nogil=True)
def step_instances(run, advance, copy, own, numbers, tables, kind, codes, n, begin, end):
    """n steps of instances `begin` to `end` - 1 whose code is RUNNING; their codes after it.

    `own` and `numbers` are the spans of the rows of two tables: (address in the run, place in the
    row, bytes). `tables` has their addresses and the lengths of their rows [bytes]: states by
    instance, copied back after the steps, and numbers of the model by `kind`.
    """
    for i in range(begin, end):
        if codes[i] != at.RUNNING:
            continue
        row = tables[0, 0] + i * tables[0, 1]
        copy_in(copy, numbers, tables[1, 0] + kind[i] * tables[1, 1])
        copy_in(copy, own, row)
        codes[i] = call_advance(advance, (run, n))
        for k in range(own.shape[0]):
            call_copy(copy, (row + own[k, 1], own[k, 0], own[k, 2]))


@part
def copy_in(copy, spans, row):
    """The spans of a row into the arrays of the run."""
    for k in range(spans.shape[0]):
        call_copy(copy, (spans[k, 0], row + spans[k, 1], spans[k, 2]))
