"""The switch between mutants, for Python code, compiled kernels and subprocesses of tests.

The rewritten sources call `mutant(k)` at the site of mutant k. One block of memory holds the number
of the active mutant and one byte per mutant that records whether its site was executed. Compiled
kernels refer to the block by an external symbol, so their cached machine code works for all mutants
and in every process.
"""

import ctypes
import mmap
import os
import struct

from llvmlite import binding, ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

NONE = -1
START = 8  # bytes of the active mutant's number
SIZE = 4096
ACTIVE, TRACED = "PGRAPH_MUTANT", "PGRAPH_MUTANTS_TRACED"  # environment of the tests
SYMBOL = "pgraph_mutants"


def _memory() -> mmap.mmap:
    """Allocate the block, in a trace as a file shared with subprocesses."""
    path = os.environ.get(TRACED)
    if path is None:
        return mmap.mmap(-1, SIZE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
    file = os.open(f"{path}.{worker}", os.O_RDWR | os.O_CREAT)
    os.ftruncate(file, SIZE)
    return mmap.mmap(file, SIZE)


BLOCK = _memory()
KEPT = ctypes.c_char.from_buffer(BLOCK)
binding.add_symbol(SYMBOL, ctypes.addressof(KEPT))


def activate(k: int) -> None:
    """Activate mutant k in this process and in subprocesses started later."""
    BLOCK[:START] = struct.pack("<q", k)
    os.environ[ACTIVE] = str(k)


def reached() -> set[int]:
    """Return the mutants whose sites were executed since the last `forget`."""
    return {k for k, byte in enumerate(BLOCK[START:]) if byte}


def forget() -> None:
    """Clear the record of executed sites."""
    BLOCK[START:] = bytes(SIZE - START)


def mutant(k: int) -> bool:
    """Record that the site of mutant k is executed. Return True if the mutant is active."""
    BLOCK[START + k] = 1
    return struct.unpack_from("<q", BLOCK)[0] == k


@infer_global(mutant)
class _Mutant(AbstractTemplate):
    def generic(self, args, kws):
        return signature(types.boolean, types.int64)


@lower_builtin(mutant, types.int64)
def _mutant(context, builder, sig, args):
    """Generate code for `mutant` in a compiled kernel."""
    byte, word = ir.IntType(8), ir.IntType(64)
    block = builder.module.globals.get(SYMBOL)
    if block is None:
        block = ir.GlobalVariable(builder.module, ir.ArrayType(byte, SIZE), SYMBOL)
    start = builder.bitcast(block, byte.as_pointer())
    builder.store(byte(1), builder.gep(start, [builder.add(args[0], word(START))]))
    active = builder.load(builder.bitcast(block, word.as_pointer()))
    return builder.icmp_signed("==", active, args[0])


activate(int(os.environ.get(ACTIVE, NONE)))
