"""Scenes and kernels as addresses in numba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_cast

from ..address import WORDS
from ..kinds import Group, Signature, plain
from .kinds import DUAL, OF_DUALS, Dual, OfDuals, Records, numba_type


def saving(described: Group) -> Any:
    """Return `save(buffer, value)` for an unnamed tuple."""
    kind, given = numba_type(described), numba_type(plain(described))

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

        return types.void(buffer, given), code

    return save


def opening(described: Group, of_duals: Group | None) -> Any:
    """Return `opened(address)` for a buffer, which returns the named tuple."""

    @intrinsic
    def opened(typing: Any, address: Any) -> Any:
        found = of_duals if isinstance(address, OfDuals) and of_duals else described
        kind = numba_type(found)

        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            llvm = context.get_value_type(kind)
            place = builder.inttoptr(args[0], llvm.as_pointer())
            whole = [ir.Constant(llvm, ir.Undefined)]

            def take(path: tuple[int, ...], at: Any) -> None:
                whole[0] = builder.insert_value(whole[0], builder.load(at), path)

            _each(builder, llvm, place, take)
            return whole[0]

        return kind(OF_DUALS if isinstance(address, OfDuals) else types.int64), code

    return opened


def _each(builder: Any, llvm: Any, place: Any, act: Callable[[tuple[int, ...], Any], Any]) -> None:
    """Call `act(path, pointer)` for each scalar of an aggregate: whole structs compile badly."""
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


def caller(described: Signature) -> Any:
    """Return `call(address, (arguments))` for kernels or C functions with this signature.

    For duals, this is the function with the same arguments and arrays of duals.
    """
    result = numba_type(described.result)
    of_numbers = [numba_type(kind) for kind in described.arguments]

    @intrinsic
    def call(typing: Any, address: Any, args: Any) -> Any:
        arguments = [
            given if _carries(given) else number for given, number in zip(args.types, of_numbers)
        ]

        def code(context: Any, builder: Any, _: Any, values: Any) -> Any:
            inputs = [context.get_value_type(t) for t in arguments]
            output = context.get_value_type(result)
            pointer = ir.FunctionType(output, inputs).as_pointer()
            given = [builder.extract_value(values[1], i) for i in range(len(inputs))]
            return builder.call(builder.inttoptr(values[0], pointer), given)

        return result(types.int64, types.Tuple(arguments)), code

    return call


@lower_cast(types.Integer, OfDuals)
def _cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return value


def _carries(kind: Any) -> bool:
    """True if a type contains duals."""
    return isinstance(kind, (OfDuals, Records, Dual)) or getattr(kind, "dtype", None) == DUAL
