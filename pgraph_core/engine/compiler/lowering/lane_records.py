"""Records for many instances: a kernel reads `leg.offset` as a lane of W instead of one number.

An array of records in lanes is a C-contiguous float64 array (records, words, W), a word for each
number of the record. A field is a lane, a field of several numbers an array of lanes. Integers say
how a mechanism is built and are the same in all lanes: they are read as the integers of the first.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.typing import templates
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, signature
from numba.extending import (
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)

from ..lane import LANE_WIDTH
from .elementary import place_of, with_place
from .kinds import INLINED
from .lane import LANE, Lane, intrinsic

infer_global: Any = templates.infer_global  # untyped in numba
infer_getattr: Any = templates.infer_getattr
overload: Any = extending.overload  # typed too narrowly in numba
WORD = 8  # bytes of a number
BYTES = ir.IntType(8).as_pointer()


class LaneRecord(types.Type):
    """A single record in lanes."""

    def __init__(self, kind: np.dtype[Any]):
        """`kind` has fields of eight bytes, or of several such numbers."""
        self.kind = kind
        super().__init__(name=f"{type(self).__name__}({kind})")

    def field(self, name: str) -> tuple[int, int, bool]:
        """Return (index of the first word, number of values, whether they are integers)."""
        known: Any = self.kind.fields
        inside, first = known[name][:2]
        return first // WORD, inside.itemsize // WORD, inside.base.kind == "i"


class LaneRecords(LaneRecord):
    """An array of records in lanes."""


@register_model(LaneRecord)
@register_model(LaneRecords)
class LaneRecordModel(models.PrimitiveModel):
    """Data model of a record: the pointer to its first number."""

    def __init__(self, dmm: Any, fe_type: LaneRecord):
        super().__init__(dmm, fe_type, BYTES)


def in_lanes_of(kind: np.dtype[Any]) -> Any:
    """Return a function that views a float64 array (records, words, W) as records in lanes."""

    @intrinsic
    def records(typingctx: Any, array: Any) -> Any:
        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source = context.make_array(sig.args[0])(context, builder, args[0])
            return builder.bitcast(source.data, BYTES)

        return LaneRecords(kind)(array), code

    return records


@infer_global(operator.getitem)
class _Item(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        fits = len(args) == 2 and isinstance(args[0], LaneRecords)
        return signature(LaneRecord(args[0].kind), args[0], types.intp) if fits else None


@lower_builtin(operator.getitem, LaneRecords, types.Integer)
def _item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    whole = sig.args[0].kind.itemsize * LANE_WIDTH
    place = builder.mul(args[1], context.get_constant(types.intp, whole))
    return builder.gep(args[0], [place])


@infer_getattr
class _Fields(AttributeTemplate):
    key = LaneRecord

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        if type(typ) is not LaneRecord or attr not in (typ.kind.names or ()):
            return None
        _, count, whole = typ.field(attr)
        if whole:
            return types.int64
        return LANE if count == 1 else types.Array(LANE, 1, "C", aligned=False)


def _address(builder: Any, record: Any, word: int, kind: Any) -> Any:
    start = builder.gep(record, [ir.Constant(ir.IntType(64), word * WORD * LANE_WIDTH)])
    return builder.bitcast(start, kind.as_pointer())


@lower_getattr_generic(LaneRecord)
def _field(context: Any, builder: Any, typ: Any, value: Any, attr: str) -> Any:
    word, count, whole = typ.field(attr)
    if whole:
        return builder.load(_address(builder, value, word, ir.IntType(64)))
    start = _address(builder, value, word, context.get_value_type(LANE))
    if count == 1:
        return builder.load(start, align=WORD)
    view = types.Array(LANE, 1, "C", aligned=False)
    found = context.make_array(view)(context, builder)
    size, step = (context.get_constant(types.intp, n) for n in (count, WORD * LANE_WIDTH))
    found.data, found.nitems, found.itemsize = start, size, step
    found.shape, found.strides = (cgutils.pack_array(builder, [x]) for x in (size, step))
    found.meminfo = ir.Constant(found.meminfo.type, None)
    found.parent = ir.Constant(found.parent.type, None)
    return found._getvalue()


@lower_setattr_generic(LaneRecord)
def _set_field(context: Any, builder: Any, sig: Any, args: Any, attr: str) -> None:
    word, _, _ = sig.args[0].field(attr)
    value = context.cast(builder, args[1], sig.args[1], LANE)
    builder.store(value, _address(builder, args[0], word, value.type), align=WORD)


def in_each(function: Callable[[Any], Any]) -> Any:
    """Apply a compiled function of one number to each element of a lane, or to a number."""

    def of_any(x: Any) -> Any:
        return function(x)

    @overload(of_any, jit_options=INLINED, strict=False)
    def _of_any(x: Any) -> Any:
        if not isinstance(x, Lane):
            return lambda x: function(x)

        def of_lanes(x: Any) -> Any:
            found = x
            for n in range(LANE_WIDTH):
                found = with_place(found, n, function(place_of(x, n)))
            return found

        return of_lanes

    return of_any
