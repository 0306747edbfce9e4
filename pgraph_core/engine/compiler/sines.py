"""Sine and cosine together, of numbers and of lanes: one reduction, and no call."""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from .jit import JIT
from .lane import DOUBLE, Lane, called, intrinsic, llvm

# sin and cos of Cephes (S. L. Moshier): reduction by π/4 in three parts, minimax polynomials;
# within 0.9 ulp for |x| < 1e5, and losing as x²·1e-26 beyond.
PI_4 = (7.85398125648498535156e-1, 3.77489470793079817668e-8, 2.69515142907905952645e-15)
SIN = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
COS = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)


def _sine_and_cosine(builder: Any, x: Any) -> tuple[Any, Any]:
    """x = n π/2 + r with |r| <= π/4; n's parity picks which is sin r; of a vector or a double."""
    whole = ir.IntType(64)
    width = getattr(x.type, "count", 0)
    if width:
        whole = ir.VectorType(whole, width)

    def number(value: float) -> Any:
        return ir.Constant(x.type, [value] * width if width else value)

    def count(value: int) -> Any:
        return ir.Constant(whole, [value] * width if width else value)

    n = llvm(builder, "rint", builder.fmul(x, number(2.0 / math.pi)))
    sine, cosine = _near_zero(builder, *_reduced(builder, x, n, number), number)
    i = builder.fptosi(n, whole)
    odd = builder.icmp_signed("!=", builder.and_(i, count(1)), count(0))

    def signed(value: Any, i: Any) -> Any:
        negative = builder.icmp_signed("!=", builder.and_(i, count(2)), count(0))
        return builder.select(negative, builder.fneg(value), value)

    return (
        signed(builder.select(odd, cosine, sine), i),
        signed(builder.select(odd, sine, cosine), builder.add(i, count(1))),
    )


def _reduced(builder: Any, x: Any, n: Any, number: Any) -> tuple[Any, Any]:
    """(r, what rounding has taken off it): x - n π/2."""
    r, low = x, number(0.0)
    for part in PI_4:
        less = builder.fmul(n, number(2.0 * part))
        left = builder.fsub(r, less)
        low = builder.fadd(low, builder.fsub(builder.fsub(r, left), less))
        r = left
    return r, low


def _near_zero(builder: Any, r: Any, low: Any, number: Any) -> tuple[Any, Any]:
    """(sine, cosine) of r + low: the small terms are added up before the large ones."""
    z = builder.fmul(r, r)
    more = builder.fmul(builder.fmul(r, z), _polynomial(builder, SIN, z, number))
    sine = builder.fadd(r, builder.fadd(more, low))
    more = builder.fmul(builder.fmul(z, z), _polynomial(builder, COS, z, number))
    more = builder.fsub(more, builder.fmul(r, low))
    half = builder.fmul(number(0.5), z)
    cosine = builder.fsub(number(1.0), half)
    lost = builder.fsub(builder.fsub(number(1.0), cosine), half)
    return sine, builder.fadd(cosine, builder.fadd(more, lost))


def _polynomial(builder: Any, coefficients: Any, z: Any, number: Any) -> Any:
    value = number(coefficients[0])
    for c in coefficients[1:]:
        value = builder.fadd(builder.fmul(value, z), number(c))
    return value


FAR = 1e5  # rad: from here on the reduction of `_sine_and_cosine` loses digits


@intrinsic
def _sine_cosine(typingctx: Any, x: Any) -> Any:
    """(sin x, cos x) of a lane or a number: in place, which takes half the time of a call."""
    pair = types.UniTuple(x, 2)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        near = _sine_and_cosine(builder, args[0])
        if isinstance(x, Lane):
            return context.make_tuple(builder, pair, near)
        found = [cgutils.alloca_once_value(builder, value) for value in near]
        size = llvm(builder, "fabs", args[0])
        with builder.if_then(builder.fcmp_unordered(">=", size, DOUBLE(FAR)), likely=False):
            for name, place in zip(("sin", "cos"), found):
                builder.store(called(builder, name, args), place)
        return context.make_tuple(builder, pair, [builder.load(place) for place in found])

    return pair(x), code


sine_cosine: Any = _sine_cosine if JIT else lambda x: (math.sin(x), math.cos(x))
