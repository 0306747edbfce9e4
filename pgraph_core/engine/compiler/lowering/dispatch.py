"""Helpers and kernels as compiled by numba, up to unoptimised LLVM IR.

This module does not generate machine code. `building` and `loading` do this for all kernels, so
that a kernel does not depend on its source.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
from llvmlite import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.types import NoneType, unliteral

from ..jit import Kernel
from .kinds import OPTIONS, numba_type

WORD = ir.IntType(64)


class Library(JITCodeLibrary):
    """Code in the form linked by kernels. `loading` optimises it and generates the machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0  # numba's answer for a missing function

    @property
    def codegen(self) -> Any:
        return _NoEnvironment


class _NoEnvironment:
    """A replacement for the environment that gives machine code access to its Python objects."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        pass


class _Compiler(Compiler):
    """Numba's compiler with a `Library` as its output."""

    def define_pipelines(self) -> Any:
        state: Any = self.state
        state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()


PART: dict[str, Any] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _Compiler,
    **OPTIONS,
}
# A sweep says that it is not inlined: to numba, what an inlined helper calls is to be inlined.
HOW: dict[str, dict[str, Any]] = {
    "part": {"forceinline": True},
    "sweep": {"forceinline": False},
    "inlined": {"inline": "always"},
}


def dispatcher(function: Callable[..., Any], how: str) -> Any:
    """Return numba's dispatcher for a helper, compiled per type but not per constant."""
    _know_all()
    made: Any = numba.njit(**PART, **HOW[how])(function)
    if how != "inlined":
        template = made.get_call_template
        made.get_call_template = lambda args, kws: template(
            tuple(unliteral(arg) for arg in args),
            {name: unliteral(arg) for name, arg in kws.items()},
        )
    return made


def type_of(made: Any) -> Any:
    """Return numba's type of a function."""
    _know_all()
    target: Any = cpu_target
    target.typing_context.refresh()
    target.target_context.refresh()
    return target.typing_context.resolve_value_type(made)


@cache
def _know_all() -> None:
    """Register all our types and functions with numba."""
    from . import address, dual, elementary, lane, masks, records  # noqa: F401


def lowered(kernel: Kernel, variant: int, name: str) -> tuple[str, Any]:
    """Return a kernel in LLVM IR, and two functions around it in another module.

    `k_NAME` takes and returns values, as `caller` calls it by address. `w_NAME(words, results)`
    finds its arguments as words of 8 bytes, as `calls` puts them there, and returns a status.
    """
    signature = kernel.signatures[variant]
    with global_compiler_lock:
        kernel.made.compile(tuple(numba_type(kind) for kind in signature.arguments))
        (found,) = (
            one
            for one in kernel.made.overloads.values()
            if one.signature.args == tuple(map(numba_type, signature.arguments))
        )
        returned = unliteral(found.signature.return_type)
        if returned != numba_type(signature.result):
            raise TypeError(f"{kernel.__name__} returns {returned}, not {signature.result}")
        found.library._ensure_finalized()
        return str(found.library._final_module), _around(found, name)


def _around(found: Any, name: str) -> Any:
    context, signature, described = found.target_context, found.signature, found.fndesc
    module = ir.Module()
    kind = context.call_conv.get_function_type(described.restype, described.argtypes)
    inner = ir.Function(module, kind, described.llvm_func_name)
    inputs = [context.get_value_type(one) for one in signature.args]
    void = isinstance(signature.return_type, NoneType)
    output = ir.VoidType() if void else context.get_value_type(signature.return_type)

    def call(builder: Any, values: Any) -> Any:
        given = signature.return_type, signature.args, values
        return context.call_conv.call_function(builder, inner, *given)

    outer = ir.Function(module, ir.FunctionType(output, inputs), f"k_{name}")
    builder = ir.IRBuilder(outer.append_basic_block())
    _, value = call(builder, outer.args)
    if void:
        builder.ret_void()
    else:
        builder.ret(value)

    status = ir.IntType(32)
    words = WORD.as_pointer()
    outer = ir.Function(module, ir.FunctionType(status, [words, words]), f"w_{name}")
    builder = ir.IRBuilder(outer.append_basic_block())
    place = [0]

    def take(kind: Any) -> Any:
        if isinstance(kind, (ir.LiteralStructType, ir.ArrayType)):
            some = isinstance(kind, ir.ArrayType)
            parts = [kind.element] * kind.count if some else list(kind.elements)
            whole = ir.Constant(kind, ir.Undefined)
            for i, part in enumerate(parts):
                whole = builder.insert_value(whole, take(part), i)
            return whole
        at = builder.gep(outer.args[0], [WORD(place[0])])
        place[0] += 1
        return builder.load(builder.bitcast(at, kind.as_pointer()))

    values = [
        ir.Constant(kind, None) if isinstance(one, NoneType) else take(kind)
        for one, kind in zip(signature.args, inputs)
    ]
    code, value = call(builder, values)

    def put(value: Any, at: int) -> int:
        if isinstance(value.type, (ir.LiteralStructType, ir.ArrayType)):
            for i in range(len(value.type)):
                at = put(builder.extract_value(value, i), at)
            return at
        pointer = builder.gep(outer.args[1], [WORD(at)])
        builder.store(value, builder.bitcast(pointer, value.type.as_pointer()))
        return at + 1

    if not void:
        put(value, 0)
    builder.ret(builder.zext(code.is_error, status))
    return module
