"""Records of lanes or of duals: a kernel reads `leg.offset` as one of these instead of a number.

An array of such records is a C-contiguous float64 array (records, words, width), with a word for
each number of the record. A field is an element, a field of several numbers an array of elements.
Integers describe the structure of a mechanism and are equal in all lanes, so they are read from the
first lane.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, signature
from numba.extending import (
    lower_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)

from .kinds import BYTES, Records, infer_getattr, intrinsic, operation
from .lane import LANE

WORD = 8  # bytes of a number


class Record(types.Type):
    """One record whose real numbers are lanes or duals."""

    def __init__(self, kind: np.dtype[Any], element: Any):
        """`kind` has fields of eight bytes, or of several such numbers."""
        self.kind, self.element = kind, element
        super().__init__(name=f"Record({kind}, {element})")

    def field(self, name: str) -> tuple[int, int, bool]:
        """Return (index of the first word, number of values, whether they are integers)."""
        known: Any = self.kind.fields
        inside, first = known[name][:2]
        return first // WORD, inside.itemsize // WORD, inside.base.kind == "i"


@register_model(Record)
class _RecordModel(models.PrimitiveModel):
    """The pointer to the first number."""

    def __init__(self, dmm: Any, fe_type: Record):
        super().__init__(dmm, fe_type, BYTES)


def in_lanes_of(kind: np.dtype[Any]) -> Any:
    """Return a function that views a float64 array (records, words, W) as records in lanes."""

    @intrinsic
    def records(typingctx: Any, array: Any) -> Any:
        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source = context.make_array(sig.args[0])(context, builder, args[0])
            found = cgutils.create_struct_proxy(sig.return_type)(context, builder)
            found.data = builder.bitcast(source.data, BYTES)
            found.count = builder.extract_value(source.shape, 0)
            return found._getvalue()

        return Records(kind, LANE)(array), code

    return records


def _of_item(args: Any) -> Any:
    if len(args) != 2 or not isinstance(args[0], Records):
        return None
    return signature(Record(args[0].kind, args[0].element), args[0], types.intp)


def _item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    of = sig.args[0]
    records = cgutils.create_struct_proxy(of)(context, builder, args[0])
    whole = context.get_constant(types.intp, of.kind.itemsize * of.element.width)
    return builder.gep(records.data, [builder.mul(args[1], whole)])


operation((operator.getitem,), _of_item, _item, (Records, types.Integer))


def _of_set_item(args: Any) -> Any:
    if len(args) != 3 or not (isinstance(args[0], Records) and isinstance(args[2], Record)):
        return None
    return signature(types.none, args[0], types.intp, args[2])


def _set_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    of = sig.args[0]
    target = _item(context, builder, sig, args)
    whole = context.get_constant(types.intp, of.kind.itemsize * of.element.width)
    cgutils.raw_memcpy(builder, target, args[2], whole, 1)
    return context.get_dummy_value()


operation((operator.setitem,), _of_set_item, _set_item, (Records, types.Integer, Record))


@infer_getattr
class _Shape(AttributeTemplate):
    key = Records

    def resolve_shape(self, typ: Any) -> Any:
        return types.UniTuple(types.intp, 1)


@lower_getattr(Records, "shape")
def _shape(context: Any, builder: Any, typ: Any, value: Any) -> Any:
    records = cgutils.create_struct_proxy(typ)(context, builder, value)
    return context.make_tuple(builder, types.UniTuple(types.intp, 1), [records.count])


def _view_of(element: Any) -> types.Array:
    layout = "A" if element == types.int64 else "C"  # integers are as far apart as duals
    return types.Array(element, 1, layout, aligned=False)


@infer_getattr
class _Fields(AttributeTemplate):
    key = Record

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        if attr not in (typ.kind.names or ()):
            return None
        _, count, whole = typ.field(attr)
        element = types.int64 if whole else typ.element
        return element if count == 1 else _view_of(element)


def _address(builder: Any, typ: Record, record: Any, word: int, kind: Any) -> Any:
    start = builder.gep(record, [ir.Constant(ir.IntType(64), word * WORD * typ.element.width)])
    return builder.bitcast(start, kind.as_pointer())


@lower_getattr_generic(Record)
def _field(context: Any, builder: Any, typ: Any, value: Any, attr: str) -> Any:
    word, count, whole = typ.field(attr)
    element = types.int64 if whole else typ.element
    start = _address(builder, typ, value, word, context.get_value_type(element))
    if count == 1:
        return builder.load(start, align=WORD)
    found = context.make_array(_view_of(element))(context, builder)
    size, step = (context.get_constant(types.intp, n) for n in (count, WORD * typ.element.width))
    found.data, found.nitems, found.itemsize = start, size, step
    found.shape, found.strides = (cgutils.pack_array(builder, [x]) for x in (size, step))
    found.meminfo = ir.Constant(found.meminfo.type, None)
    found.parent = ir.Constant(found.parent.type, None)
    return found._getvalue()


@lower_setattr_generic(Record)
def _set_field(context: Any, builder: Any, sig: Any, args: Any, attr: str) -> None:
    word, _, whole = sig.args[0].field(attr)
    kind = types.int64 if whole else sig.args[0].element
    value = context.cast(builder, args[1], sig.args[1], kind)
    builder.store(value, _address(builder, sig.args[0], args[0], word, value.type), align=WORD)
