"""Kernels as an object file for WebAssembly, made from numba's code for this machine.

Numba's unoptimised LLVM code names members of structs and not their places: given the data layout
of wasm32 before anything is optimised, it takes pointers of 4 bytes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock

from .jit import Kernel
from .lowering.dispatch import Library, lowered
from .optimising import export, optimise_fully, parsed

TRIPLE = "wasm32-unknown-unknown"
LAYOUT = "e-m:e-p:32:32-p10:8:8-p20:8:8-i64:64-i128:128-n32:64-S128-ni:1:10:20"
FEATURES = "+simd128,+bulk-memory,+mutable-globals,+sign-ext,+nontrapping-fptoint"
TABLE = "table_of_kernels"  # their numbers in the table of functions, in the order given
BYTE = ir.IntType(8).as_pointer()


def object_of(kernels: Sequence[Kernel]) -> tuple[bytes, list[str]]:
    """Return (object file, exported names) for kernels.

    The process is of no other use afterwards: its kernels are compiled for WebAssembly.
    """
    with global_compiler_lock:
        whole, exports = compiled(kernels)
        return optimised(whole, exports), exports


def compiled(kernels: Sequence[Kernel]) -> tuple[Any, list[str]]:
    """Return one unoptimised module of all kernels, and the names that it exports."""
    libraries: tuple[Any, ...] = (CPUCodeLibrary, Library)
    for library in libraries:
        library._optimize_functions = library._optimize_final_module = _as_it_is
    whole = llvm.parse_assembly(f'target triple = "{TRIPLE}"\ntarget datalayout = "{LAYOUT}"')
    table = ir.Module()
    table.triple, table.data_layout = TRIPLE, LAYOUT
    names = [kernel.__name__ for kernel in kernels]
    exports = [f"k_{name}" for name in names]
    for kernel, name in zip(kernels, names):
        text, around = lowered(kernel, 0, name)
        around.triple, around.data_layout = TRIPLE, LAYOUT
        whole.link_in(portable(text))
        whole.link_in(llvm.parse_assembly(str(around)))
        print(name, flush=True)
    kinds = ir.ArrayType(BYTE, len(names))
    functions = [ir.Function(table, ir.FunctionType(ir.VoidType(), ()), one) for one in exports]
    numbers: Any = ir.GlobalVariable(table, kinds, TABLE)
    numbers.global_constant = True
    numbers.initializer = ir.Constant(kinds, [function.bitcast(BYTE) for function in functions])
    whole.link_in(llvm.parse_assembly(str(table)))
    return whole, [*exports, TABLE]


def _as_it_is(library: Any, *_: Any) -> None:
    """Replace numba's own passes, which insert offsets for this machine into the code."""


def portable(text: str) -> Any:
    """Convert a numba module to a module for wasm32."""
    text = re.sub(r'target triple = ".*"', f'target triple = "{TRIPLE}"', text)
    text = re.sub(r'target datalayout = ".*"', f'target datalayout = "{LAYOUT}"', text)
    return parsed(text)


def optimised(whole: Any, exports: list[str]) -> bytes:
    """Return the optimised module as an object file."""
    export(whole, exports)
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(
        cpu="generic", features=FEATURES, opt=3, reloc="static"
    )
    optimise_fully(whole, machine)
    return machine.emit_object(whole)
