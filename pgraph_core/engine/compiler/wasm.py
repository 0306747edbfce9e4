"""Kernels as an object file for WebAssembly, made from what numba makes of them for this machine.

Numba's unoptimised LLVM code names members of structs and not their places: given the data layout
of wasm32 before anything is optimised, it takes pointers of 4 bytes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.caching import NullCache
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock

from . import jit

TRIPLE = "wasm32-unknown-unknown"
LAYOUT = "e-m:e-p:32:32-p10:8:8-p20:8:8-i64:64-i128:128-n32:64-S128-ni:1:10:20"
FEATURES = "+simd128,+bulk-memory,+mutable-globals,+sign-ext,+nontrapping-fptoint"
TABLE = "table_of_kernels"  # their numbers in the table of functions, in the order given
BYTE = ir.IntType(8).as_pointer()


def object_of(kernels: Sequence[Any]) -> tuple[bytes, list[str]]:
    """(object file, the names that it exports) of kernels.

    The process is of no other use afterwards: its kernels are compiled for WebAssembly.
    """
    with global_compiler_lock:
        whole, exports = compiled(kernels)
        return optimised(whole, exports), exports


def compiled(kernels: Sequence[Any]) -> tuple[Any, list[str]]:
    """(one module of all kernels, not optimised; the names that it exports)."""
    names = [kernel.__name__ for kernel in kernels]
    for one, _ in (*jit.KERNELS.values(), *jit.LATER.values()):
        one._cache = NullCache()
        one._compiler.pipeline_class = jit._PartCompiler
        one.targetoptions.update(no_cpython_wrapper=True, no_cfunc_wrapper=True)
    libraries: tuple[Any, ...] = (CPUCodeLibrary, jit._PartLibrary)
    for library in libraries:
        library._optimize_functions = library._optimize_final_module = _as_it_is
    wrappers, whole = ir.Module(), None
    wrappers.triple, wrappers.data_layout = TRIPLE, LAYOUT
    for kernel in kernels:
        jit.compile_kernel(kernel.__name__)
        (found,) = kernel.overloads.values()
        found.library._ensure_finalized()
        module = portable(str(found.library._final_module))
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
        _wrap(wrappers, kernel.__name__, found)
        print(kernel.__name__, flush=True)
    kinds = ir.ArrayType(BYTE, len(names))
    numbers: Any = ir.GlobalVariable(wrappers, kinds, TABLE)
    numbers.global_constant = True
    numbers.initializer = ir.Constant(
        kinds, [wrappers.get_global(f"k_{name}").bitcast(BYTE) for name in names]
    )
    assert whole is not None
    whole.link_in(llvm.parse_assembly(str(wrappers)))
    return whole, [*(f"k_{name}" for name in names), TABLE]


def _as_it_is(library: Any, *_: Any) -> None:
    """In the place of numba's own passes, which put this machine's offsets into the code."""


def portable(text: str) -> Any:
    """A module of numba's as one for wasm32."""
    text = re.sub(r'target triple = ".*"', f'target triple = "{TRIPLE}"', text)
    text = re.sub(r'target datalayout = ".*"', f'target datalayout = "{LAYOUT}"', text)
    text = re.sub(r'"(target-cpu|target-features|tune-cpu)"="[^"]*"', "", text)
    # numba's environments, which nothing reads; there are no common symbols in wasm
    return llvm.parse_assembly(text.replace("= common ", "= linkonce_odr "))


def _wrap(module: Any, name: str, found: Any) -> None:
    """A function `k_name` that takes and returns values, as `caller` calls it by address."""
    context, signature, described = found.target_context, found.signature, found.fndesc
    kind = context.call_conv.get_function_type(described.restype, described.argtypes)
    inner = ir.Function(module, kind, described.llvm_func_name)
    inputs = [context.get_value_type(one) for one in signature.args]
    void = isinstance(signature.return_type, types.NoneType)
    output = ir.VoidType() if void else context.get_value_type(signature.return_type)
    outer = ir.Function(module, ir.FunctionType(output, inputs), f"k_{name}")
    builder = ir.IRBuilder(outer.append_basic_block())
    given = signature.return_type, signature.args, outer.args
    _, value = context.call_conv.call_function(builder, inner, *given)
    if void:
        builder.ret_void()
    else:
        builder.ret(value)


def optimised(whole: Any, exports: list[str]) -> bytes:
    """The module as an object file."""
    for one in (*whole.functions, *whole.global_variables):
        if not one.is_declaration:
            one.linkage = "external" if one.name in exports else "internal"
    whole.verify()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(
        cpu="generic", features=FEATURES, opt=3, reloc="static"
    )
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = True
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(whole, passes)
    return machine.emit_object(whole)
