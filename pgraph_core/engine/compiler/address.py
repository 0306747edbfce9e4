"""Scenes and kernels as addresses: one number in the place of forty arrays, or of a function.

A kernel that takes a scene by address is called from Python in the time of three arguments, and
from other kernels without a copy. A method that calls the equations of motion by address does
not contain them: they are compiled once, not once a method. Who hands out an address keeps what
is there alive. Uncompiled (NUMBA_DISABLE_JIT=1) an address is a key of a dictionary.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .jit import JIT, compile_kernel

WORDS = 1024  # of 8 bytes: more than any scene takes
_KEPT: dict[int, Any] = {}  # what addresses stand for without a compiler


def plain(kind: Any) -> Any:
    """The type of a tuple without names."""
    members: Any = kind if isinstance(kind, types.BaseTuple) else None
    return kind if members is None else types.Tuple([plain(member) for member in members])


def unnamed(value: Any) -> Any:
    """A named tuple as kernels are given it: numba takes long to find the type of a named one."""
    if not JIT:
        return value
    members = list(value)
    for i, member in enumerate(members):
        if isinstance(member, tuple):
            members[i] = unnamed(member)
    return tuple(members)


def stored(kind: Any) -> tuple[Any, Any]:
    """(save, opened) of a named tuple type: `save(buffer, value)`, `opened(address)` of a buffer.

    What is saved is `unnamed`, what is opened has names. A tuple can be opened as its first member.
    """
    if not JIT:
        return _keep, lambda address: _named(_KEPT[address], kind.instance_class)

    @intrinsic
    def save(typing: Any, buffer: Any, value: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            llvm = context.get_value_type(kind)
            assert context.get_abi_sizeof(llvm) <= 8 * WORDS
            data = context.make_array(buffer)(context, builder, args[0]).data

            def put(path: tuple[int, ...], at: Any) -> None:
                builder.store(builder.extract_value(args[1], path), at)

            _each(builder, llvm, builder.bitcast(data, llvm.as_pointer()), put)
            return context.get_dummy_value()

        return types.void(buffer, plain(kind)), code

    @intrinsic
    def opened(typing: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            llvm = context.get_value_type(kind)
            place = builder.inttoptr(args[0], llvm.as_pointer())
            whole = [ir.Constant(llvm, ir.Undefined)]

            def take(path: tuple[int, ...], at: Any) -> None:
                whole[0] = builder.insert_value(whole[0], builder.load(at), path)

            _each(builder, llvm, place, take)
            return whole[0]

        return kind(types.int64), code

    return save, opened


def _each(builder: Any, llvm: Any, place: Any, act: Callable[[tuple[int, ...], Any], Any]) -> None:
    """`act(path, pointer)` for every scalar of an aggregate: whole structs compile badly."""
    zero = ir.Constant(ir.IntType(32), 0)

    def visit(kind: Any, path: tuple[int, ...]) -> None:
        if isinstance(kind, ir.LiteralStructType):
            parts = list(kind.elements)
        elif isinstance(kind, ir.ArrayType):
            parts = [kind.element] * kind.count
        else:
            index = [zero, *(ir.Constant(ir.IntType(32), i) for i in path)]
            act(path, builder.gep(place, index))
            return
        for i, part in enumerate(parts):
            visit(part, (*path, i))

    visit(llvm, ())


def caller(signature: Any) -> Any:
    """`call(address, (arguments))` of a function with this signature: a kernel's, or C's."""
    if not JIT:
        return lambda address, args: _KEPT[address](*args)

    @intrinsic
    def call(typing: Any, address: Any, args: Any) -> Any:
        def code(context: Any, builder: Any, _: Any, values: Any) -> Any:
            inputs = [context.get_value_type(t) for t in signature.args]
            output = context.get_value_type(signature.return_type)
            pointer = ir.FunctionType(output, inputs).as_pointer()
            given = [builder.extract_value(values[1], i) for i in range(len(inputs))]
            return builder.call(builder.inttoptr(values[0], pointer), given)

        return signature.return_type(types.int64, types.Tuple(signature.args)), code

    return call


@cache
def address_of(dispatcher: Any) -> int:
    """Where a kernel's code is, for `caller`; compiles it first."""
    if not JIT:
        return address_of_function(dispatcher)
    compile_kernel(dispatcher.__name__)
    (found,) = dispatcher.overloads.values()
    return found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)


def address_of_function(function: Any) -> int:
    """Where a function of ctypes is."""
    if JIT:
        return ctypes.cast(function, ctypes.c_void_p).value or 0
    _KEPT[id(function)] = function
    return id(function)


def address_of_array(array: Any) -> int:
    """Where a buffer of `stored` is."""
    return array.ctypes.data if JIT else id(array)


def buffer() -> Any:
    """What a scene is saved in."""
    return np.zeros(WORDS, dtype=np.int64)


def _keep(array: Any, value: Any) -> None:
    _KEPT[id(array)] = value


def _named(value: Any, wanted: type) -> Any:
    """The value, or its first member, that is of the named tuple wanted."""
    return value if isinstance(value, wanted) else _named(value[0], wanted)
