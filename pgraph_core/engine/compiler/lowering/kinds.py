"""Numba types for our kinds."""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typeconv.castgraph import Conversion
from numba.extending import models, register_model

from ..dual import WIDTH
from ..kinds import Array, Group, Kind


class Dual(types.Type):
    """A number and its derivatives: place 0 of a vector is the value."""

    width = WIDTH

    def __init__(self) -> None:
        super().__init__(name=f"Dual({WIDTH})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Numbers become duals without derivatives, so that a constant may be stored."""
        return Conversion.safe if isinstance(other, (types.Float, types.Integer)) else None


class Records(types.Type):
    """An array of records whose real numbers are duals."""

    def __init__(self, kind: np.dtype[Any]):
        """`kind` has fields of eight bytes, or of several such numbers."""
        self.kind = kind
        super().__init__(name=f"Records({kind})")


class OfDuals(types.Type):
    """The address of a scene or a run whose numbers are duals."""

    def __init__(self) -> None:
        super().__init__(name="OfDuals")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """A word is taken for one where a kernel is called by address."""
        return Conversion.safe if isinstance(other, types.Integer) else None


DUAL, OF_DUALS = Dual(), OfDuals()


@register_model(Dual)
class _DualModel(models.PrimitiveModel):
    """In registers and in memory: one LLVM vector."""

    def __init__(self, dmm: Any, fe_type: Dual):
        super().__init__(dmm, fe_type, ir.VectorType(ir.DoubleType(), WIDTH))


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
            return Records(kind.dtype)
        return types.Array(DUAL, kind.ndim, "C", aligned=False)
    if isinstance(kind, Array):
        return types.Array(numba.from_dtype(kind.dtype), kind.ndim, "C")
    if isinstance(kind, Group):
        members = [numba_type(member) for member in kind.members]
        plain = kind.names is None
        return types.Tuple(members) if plain else types.BaseTuple.from_types(members, kind.names)
    return SCALARS[kind.code]
