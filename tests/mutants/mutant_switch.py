"""Which mutant is active, in Python, in compiled kernels and in processes that tests start.

The rewritten sources ask `mutant(k)` at the place of mutant k. One block of memory holds the number
of the active one and a byte for each mutant that was asked for. Kernels find it as an external
symbol, so their machine code, also from the disk cache, serves all mutants.
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
    """A block of this process; while tests are traced, a file that its children share."""
    path = os.environ.get(TRACED)
    if path is None:
        return mmap.mmap(-1, SIZE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    file = os.open(
        f"{path}.{os.environ.get('PYTEST_XDIST_WORKER', 'main')}", os.O_RDWR | os.O_CREAT
    )
    os.ftruncate(file, SIZE)
    return mmap.mmap(file, SIZE)


BLOCK = _memory()
KEPT = ctypes.c_char.from_buffer(BLOCK)
binding.add_symbol(SYMBOL, ctypes.addressof(KEPT))


def activate(k: int) -> None:
    """Make mutant k the active one, here and in processes started from now on."""
    BLOCK[:START] = struct.pack("<q", k)
    os.environ[ACTIVE] = str(k)


def reached() -> set[int]:
    """The mutants asked for since the last `forget`."""
    return {k for k, byte in enumerate(BLOCK[START:]) if byte}


def forget() -> None:
    """Forget which mutants were asked for."""
    BLOCK[START:] = bytes(SIZE - START)


def mutant(k: int) -> bool:
    """Whether mutant k is active."""
    BLOCK[START + k] = 1
    return struct.unpack_from("<q", BLOCK)[0] == k


@infer_global(mutant)
class _Mutant(AbstractTemplate):
    def generic(self, args, kws):
        return signature(types.boolean, types.int64)


@lower_builtin(mutant, types.int64)
def _mutant(context, builder, sig, args):
    """`mutant` in a kernel."""
    byte, word = ir.IntType(8), ir.IntType(64)
    block = builder.module.globals.get(SYMBOL)
    if block is None:
        block = ir.GlobalVariable(builder.module, ir.ArrayType(byte, SIZE), SYMBOL)
    start = builder.bitcast(block, byte.as_pointer())
    builder.store(byte(1), builder.gep(start, [builder.add(args[0], word(START))]))
    active = builder.load(builder.bitcast(block, word.as_pointer()))
    return builder.icmp_signed("==", active, args[0])


activate(int(os.environ.get(ACTIVE, NONE)))
