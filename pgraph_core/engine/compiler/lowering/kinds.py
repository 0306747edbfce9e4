"""Numba types of our own, and shared code for their operations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing import templates
from numba.core.typing.templates import AbstractTemplate
from numba.extending import lower_builtin, models, register_model

from ..dual import WIDTH
from ..kinds import Array, Group, Kind

DOUBLE, PLACE = ir.DoubleType(), ir.IntType(32)
BYTES = ir.IntType(8).as_pointer()
infer_global: Any = templates.infer_global  # these are untyped in numba, or too narrowly
infer_getattr: Any = templates.infer_getattr
intrinsic: Any = extending.intrinsic
overload: Any = extending.overload


class Dual(types.Type):
    """A number and its derivatives: place 0 of a vector is the value."""

    width = WIDTH

    def __init__(self) -> None:
        super().__init__(name=f"Dual({WIDTH})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Numbers become duals without derivatives, so that a constant may be stored."""
        return Conversion.safe if isinstance(other, (types.Float, types.Integer)) else None


class Records(types.Type):
    """An array of records whose real numbers are lanes or duals, as `records` reads them."""

    def __init__(self, kind: np.dtype[Any], element: Any):
        """`kind` has fields of eight bytes, or of several such numbers."""
        self.kind, self.element = kind, element
        super().__init__(name=f"Records({kind}, {element})")


class OfDuals(types.Type):
    """The address of a scene or a run whose numbers are duals."""

    def __init__(self) -> None:
        super().__init__(name="OfDuals")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Kernels called by address accept a word instead."""
        return Conversion.safe if isinstance(other, types.Integer) else None


DUAL, OF_DUALS = Dual(), OfDuals()


@register_model(Dual)
class _DualModel(models.PrimitiveModel):
    """In registers and in memory: one LLVM vector."""

    def __init__(self, dmm: Any, fe_type: Dual):
        super().__init__(dmm, fe_type, ir.VectorType(DOUBLE, WIDTH))


@register_model(OfDuals)
class _AddressModel(models.PrimitiveModel):
    """A word."""

    def __init__(self, dmm: Any, fe_type: OfDuals):
        super().__init__(dmm, fe_type, ir.IntType(64))


@register_model(Records)
class _RecordsModel(models.StructModel):
    """The pointer to the first number, and how many records there are."""

    def __init__(self, dmm: Any, fe_type: Records):
        members = [("data", types.voidptr), ("count", types.intp)]
        super().__init__(dmm, fe_type, members)


SCALARS = {
    "of_duals": OF_DUALS,
    "i8": types.int64, "u8": types.uint64, "f8": types.float64, "i4": types.int32,
    "f4": types.float32, "u1": types.uint8, "none": types.none, "void": types.void,
}  # fmt: skip

# No reference counting: kernels allocate nothing, and its atomic counts take half of their time.
# No contraction of a b + c to one rounding: every processor gives the same bits.
OPTIONS: dict[str, Any] = {"_nrt": False, "fastmath": False, "error_model": "numpy"}
INLINED = {**OPTIONS, "forceinline": True}


@cache
def numba_type(kind: Kind) -> Any:
    """Return the numba type of a kind."""
    if isinstance(kind, Array) and kind.duals:
        if kind.dtype.names:
            return Records(kind.dtype, DUAL)
        return types.Array(DUAL, kind.ndim, "C", aligned=False)
    if isinstance(kind, Array):
        return types.Array(numba.from_dtype(kind.dtype), kind.ndim, "C")
    if isinstance(kind, Group):
        members = [numba_type(member) for member in kind.members]
        plain = kind.names is None
        return types.Tuple(members) if plain else types.BaseTuple.from_types(members, kind.names)
    return SCALARS[kind.code]


# -- operations of lanes and duals -----------------------------------------------------------------


def operation(
    functions: Iterable[Any], typed: Callable[[Any], Any], lower: Any, *kinds: Any
) -> None:
    """Register functions of our types.

    `typed(args)` is the signature for arguments of these types, or None, and `lower` the code for
    each of the `kinds`.
    """

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return typed(args)

    for function in functions:
        infer_global(function)(Template)
        for each in kinds:
            lower_builtin(function, *each)(lower)


def splat(builder: Any, value: Any, width: int) -> Any:
    """Return a double in all elements of a vector."""
    vector = ir.VectorType(DOUBLE, width)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, PLACE(0))
    mask = ir.Constant(ir.VectorType(PLACE, width), [0] * width)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), mask)


def llvm(builder: Any, name: str, value: Any) -> Any:
    """Call an LLVM intrinsic for a vector or a double."""
    kind = f"v{value.type.count}f64" if isinstance(value.type, ir.VectorType) else "f64"
    function = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(value.type, [value.type]), f"llvm.{name}.{kind}"
    )
    return builder.call(function, [value])


def view_type(array: Any, element: Any, ndim: int) -> types.Array:
    """Return the type of a view as lanes or duals. The view is unaligned, because NumPy arrays may
    be unaligned."""
    if not (isinstance(array, types.Array) and array.layout == "C"):
        raise TypeError("lanes and duals view C-contiguous arrays")
    return types.Array(element, ndim, "C", aligned=False)


def axes_of(builder: Any, source: Any) -> list[Any]:
    """Return the lengths and the strides of an array's axes."""
    return [cgutils.unpack_tuple(builder, x) for x in (source.shape, source.strides)]


def viewed(context: Any, builder: Any, view: Any, source: Any, start: Any, axes: Any) -> Any:
    """View the memory of `source` from `start` as an array of another type, with these axes."""
    target = context.make_array(view)(context, builder)
    entry = context.get_value_type(view.dtype)
    count = context.get_constant(types.intp, 1)
    for n in axes[0]:
        count = builder.mul(count, n)
    target.data = builder.bitcast(start, entry.as_pointer())
    target.nitems = count
    target.itemsize = context.get_constant(types.intp, context.get_abi_sizeof(entry))
    target.shape, target.strides = (cgutils.pack_array(builder, axis) for axis in axes)
    target.meminfo, target.parent = source.meminfo, source.parent
    return target._getvalue()


def viewer(element: Any) -> Any:
    """Return a function that views a float64 array (..., width) as an array (...) of elements.

    The caller ensures that the length of the last axis is the width of an element.
    """

    @intrinsic
    def view(typingctx: Any, array: Any) -> Any:
        found = view_type(array, element, array.ndim - 1)

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source = context.make_array(sig.args[0])(context, builder, args[0])
            axes = [axis[:-1] for axis in axes_of(builder, source)]
            return viewed(context, builder, found, source, source.data, axes)

        return found(array), code

    return view
