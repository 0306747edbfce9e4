"""Records of duals: what a kernel reads as `spring.stiffness` of numbers, it reads as a dual.

An array of records of duals is a C-contiguous float64 array (records, words, WIDTH), a word for
each number of the record. A field is a dual, a field of several numbers an array of duals. Integers
say how a mechanism is built: they are the integers of place 0.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing import templates
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, signature
from numba.extending import (
    lower_builtin,
    lower_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)

from .dual import VECTOR
from .kinds import DUAL, WIDTH, Records

infer_global: Any = templates.infer_global  # untyped in numba
infer_getattr: Any = templates.infer_getattr
WORD = 8  # bytes of a number
BYTES = ir.IntType(8).as_pointer()


class Record(types.Type):
    """One record of duals."""

    def __init__(self, kind: np.dtype[Any]):
        """`kind` has fields of eight bytes, or of several such numbers."""
        self.kind = kind
        super().__init__(name=f"Record of duals({kind})")

    def field(self, name: str) -> tuple[int, int, bool]:
        """(its first word, how many numbers, whether they are integers)."""
        known: Any = self.kind.fields
        inside, first = known[name][:2]
        return first // WORD, inside.itemsize // WORD, inside.base.kind == "i"


@register_model(Record)
class _RecordModel(models.PrimitiveModel):
    """The pointer to the first number."""

    def __init__(self, dmm: Any, fe_type: Record):
        super().__init__(dmm, fe_type, BYTES)


@infer_global(operator.getitem)
class _Item(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        fits = len(args) == 2 and isinstance(args[0], Records)
        return signature(Record(args[0].kind), args[0], types.intp) if fits else None


@lower_builtin(operator.getitem, Records, types.Integer)
def _item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    records = cgutils.create_struct_proxy(sig.args[0])(context, builder, args[0])
    whole = context.get_constant(types.intp, sig.args[0].kind.itemsize * WIDTH)
    return builder.gep(records.data, [builder.mul(args[1], whole)])


@infer_getattr
class _Shape(AttributeTemplate):
    key = Records

    def resolve_shape(self, typ: Any) -> Any:
        return types.UniTuple(types.intp, 1)


@lower_getattr(Records, "shape")
def _shape(context: Any, builder: Any, typ: Any, value: Any) -> Any:
    records = cgutils.create_struct_proxy(typ)(context, builder, value)
    return context.make_tuple(builder, types.UniTuple(types.intp, 1), [records.count])


@infer_getattr
class _Fields(AttributeTemplate):
    key = Record

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        if attr not in (typ.kind.names or ()):
            return None
        _, count, whole = typ.field(attr)
        if whole:
            return types.int64
        return DUAL if count == 1 else types.Array(DUAL, 1, "C", aligned=False)


def _address(builder: Any, record: Any, word: int, kind: Any) -> Any:
    start = builder.gep(record, [ir.Constant(ir.IntType(64), word * WORD * WIDTH)])
    return builder.bitcast(start, kind.as_pointer())


@lower_getattr_generic(Record)
def _field(context: Any, builder: Any, typ: Any, value: Any, attr: str) -> Any:
    word, count, whole = typ.field(attr)
    if whole:
        return builder.load(_address(builder, value, word, ir.IntType(64)))
    start = _address(builder, value, word, VECTOR)
    if count == 1:
        return builder.load(start, align=WORD)
    view = types.Array(DUAL, 1, "C", aligned=False)
    found = context.make_array(view)(context, builder)
    size, step = (context.get_constant(types.intp, n) for n in (count, WORD * WIDTH))
    found.data, found.nitems, found.itemsize = start, size, step
    found.shape, found.strides = (cgutils.pack_array(builder, [x]) for x in (size, step))
    found.meminfo = ir.Constant(found.meminfo.type, None)
    found.parent = ir.Constant(found.parent.type, None)
    return found._getvalue()


@lower_setattr_generic(Record)
def _set_field(context: Any, builder: Any, sig: Any, args: Any, attr: str) -> None:
    word, _, whole = sig.args[0].field(attr)
    kind = types.int64 if whole else DUAL
    value = context.cast(builder, args[1], sig.args[1], kind)
    builder.store(value, _address(builder, args[0], word, value.type), align=WORD)
