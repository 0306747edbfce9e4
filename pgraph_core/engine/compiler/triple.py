"""Three numbers in one register: what the three rows of a block do, at the cost of one.

A triple adds and multiplies as a lane does (`lane`): a wrench whose components are triples is three
wrenches, and goes through the same lines as one. Three rows of a 3x3 block are three triples.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from .jit import JIT
from .lane import DOUBLE, Lane, intrinsic

TRIPLE = Lane(4)  # the fourth place is idle
PAIR = ir.VectorType(DOUBLE, 2)
WHOLE = ir.VectorType(DOUBLE, 4)
PLACE = ir.IntType(32)


def _mask(*places: int) -> Any:
    return ir.Constant(ir.VectorType(PLACE, len(places)), list(places))


def _pointer(context: Any, builder: Any, kind: Any, values: Any) -> Any:
    """Where entry (i, j) of a C-contiguous array is."""
    array = context.make_array(kind)(context, builder, values[0])
    strides = cgutils.unpack_tuple(builder, array.strides)
    place = builder.mul(values[1], strides[0])
    place = builder.add(place, builder.mul(values[2], strides[1]))
    return cgutils.pointer_add(builder, array.data, place)


@intrinsic
def _triple(typingctx: Any, x: Any, y: Any, z: Any) -> Any:
    """Three numbers side by side."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = ir.Constant(WHOLE, [0.0] * 4)
        for n, arg in enumerate(args):
            value = builder.insert_element(value, arg, PLACE(n))
        return value

    return TRIPLE(types.float64, types.float64, types.float64), code


@intrinsic
def _numbers(typingctx: Any, x: Any) -> Any:
    """The three numbers of a triple, as a tuple."""
    kind = types.UniTuple(types.float64, 3)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = [builder.extract_element(args[0], PLACE(n)) for n in range(3)]
        return context.make_tuple(builder, kind, found)

    return kind(TRIPLE), code


@intrinsic
def _load_triple(typingctx: Any, a: Any, i: Any, j: Any) -> Any:
    """a[i, j], a[i, j + 1], a[i, j + 2] as a triple."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        two = builder.load(builder.bitcast(place, PAIR.as_pointer()), align=8)
        one = builder.load(builder.gep(place, [PLACE(2)]), align=8)
        last = builder.insert_element(ir.Constant(PAIR, [0.0] * 2), one, PLACE(0))
        return builder.shuffle_vector(two, last, _mask(0, 1, 2, 3))

    return TRIPLE(a, types.intp, types.intp), code


@intrinsic
def _store_triple(typingctx: Any, a: Any, i: Any, j: Any, x: Any) -> Any:
    """a[i, j], a[i, j + 1], a[i, j + 2] from a triple."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        two = builder.shuffle_vector(args[3], ir.Constant(WHOLE, ir.Undefined), _mask(0, 1))
        builder.store(two, builder.bitcast(place, PAIR.as_pointer()), align=8)
        builder.store(
            builder.extract_element(args[3], PLACE(2)), builder.gep(place, [PLACE(2)]), align=8
        )
        return context.get_dummy_value()

    return types.void(a, types.intp, types.intp, TRIPLE), code


def _store_plain(a: Any, i: int, j: int, x: Any) -> None:
    a[i, j : j + 3] = x


# uncompiled, a triple is an array of three
triple: Any = _triple if JIT else lambda x, y, z: np.array([x, y, z])
numbers: Any = _numbers if JIT else lambda x: tuple(x.tolist())
load_triple: Any = _load_triple if JIT else lambda a, i, j: a[i, j : j + 3].copy()
store_triple: Any = _store_triple if JIT else _store_plain
