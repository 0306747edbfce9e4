"""Optimised modules of numba's code, for one kernel on this processor or for all kernels in
WebAssembly."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock

from .jit import Kernel
from .lowering.dispatch import Library, lowered


def module_of(kernel: Kernel, variant: int, symbol: str, target: Any) -> Any:
    """Return one kernel as an optimised module."""
    text, around = lowered(kernel, variant, symbol)
    whole = parsed(text)
    whole.link_in(parsed(str(around)))
    optimise(whole, (f"k_{symbol}", f"w_{symbol}"), target)
    return whole


def parsed(text: str) -> Any:
    """Parse a numba module for any processor."""
    text = re.sub(r'"(target-cpu|target-features|tune-cpu)"="[^"]*"', "", text)
    # numba's environments, which nothing reads
    return llvm.parse_assembly(text.replace("= common ", "= linkonce_odr "))


def optimise(whole: Any, exports: Iterable[str], target: Any) -> None:
    """Inline and optimise a module as numba does, exporting only these functions."""
    whole.triple, whole.data_layout = target.triple, str(target.target_data)
    export(whole, exports)
    cheap = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=0))
    passes = cheap.getModulePassManager()
    passes.add_loop_rotate_pass()
    passes.add_instruction_combine_pass()
    passes.add_jump_threading_pass()
    passes.run(whole, cheap)
    optimise_fully(whole, target)


def export(whole: Any, exports: Iterable[str]) -> None:
    """Make all functions and data of a module internal but these."""
    outside = set(exports)
    for one in (*whole.functions, *whole.global_variables):
        if not one.is_declaration:
            one.linkage = "external" if one.name in outside else "internal"
    whole.verify()


def optimise_fully(whole: Any, target: Any) -> None:
    """Inline and vectorise at the highest level."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = True
    full = llvm.create_pass_builder(target, options)
    full.getModulePassManager().run(whole, full)


# -- WebAssembly -----------------------------------------------------------------------------------
# Numba's unoptimised LLVM code names members of structs and not their places: given the data layout
# of wasm32 before anything is optimised, it takes pointers of 4 bytes.


WASM = "wasm32-unknown-unknown"
LAYOUT = "e-m:e-p:32:32-p10:8:8-p20:8:8-i64:64-i128:128-n32:64-S128-ni:1:10:20"
FEATURES = "+simd128,+bulk-memory,+mutable-globals,+sign-ext,+nontrapping-fptoint"
TABLE = "table_of_kernels"  # their numbers in the table of functions, in the order given
BYTE = ir.IntType(8).as_pointer()


def object_of(kernels: Sequence[Kernel]) -> tuple[bytes, list[str]]:
    """Return (object file, exported names) for kernels.

    The process cannot be used for other purposes afterwards, because its kernels are compiled for
    WebAssembly.
    """
    with global_compiler_lock:
        whole, exports = compiled(kernels)
        return optimised(whole, exports), exports


def compiled(kernels: Sequence[Kernel]) -> tuple[Any, list[str]]:
    """Return one unoptimised module of all kernels, and the names that it exports."""
    libraries: tuple[Any, ...] = (CPUCodeLibrary, Library)
    for library in libraries:
        library._optimize_functions = library._optimize_final_module = _as_it_is
    whole = llvm.parse_assembly(f'target triple = "{WASM}"\ntarget datalayout = "{LAYOUT}"')
    table = ir.Module()
    table.triple, table.data_layout = WASM, LAYOUT
    names = [kernel.__name__ for kernel in kernels]
    exports = [f"k_{name}" for name in names]
    for kernel, name in zip(kernels, names):
        text, around = lowered(kernel, 0, name)
        around.triple, around.data_layout = WASM, LAYOUT
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
    text = re.sub(r'target triple = ".*"', f'target triple = "{WASM}"', text)
    text = re.sub(r'target datalayout = ".*"', f'target datalayout = "{LAYOUT}"', text)
    return parsed(text)


def optimised(whole: Any, exports: list[str]) -> bytes:
    """Return the optimised module as an object file."""
    export(whole, exports)
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(WASM).create_target_machine(
        cpu="generic", features=FEATURES, opt=3, reloc="static"
    )
    optimise_fully(whole, machine)
    return machine.emit_object(whole)
