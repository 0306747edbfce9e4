"""Code generation for `elementary` in numba: bits, sines of lanes, functions by type."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from .. import elementary
from ..elementary import COS, PI_4, SIN
from .dual import chained, joined, value_of
from .kinds import DOUBLE, INLINED, Dual, intrinsic, llvm, overload
from .lane import LANE_WIDTH, Lane

WORD = ir.IntType(64)


@intrinsic
def bits_of(typing: Any, x: Any) -> Any:
    """Return the 64 bits of a double as an integer."""
    return types.int64(types.float64), lambda context, builder, sig, args: builder.bitcast(
        args[0], WORD
    )


@intrinsic
def float_of(typing: Any, x: Any) -> Any:
    """Return the double with these 64 bits."""
    return types.float64(types.int64), lambda context, builder, sig, args: builder.bitcast(
        args[0], DOUBLE
    )


def _sine_and_cosine(builder: Any, x: Any) -> tuple[Any, Any]:
    """Return (sin x, cos x) of a vector or double from x = n π/2 + r, |r| <= π/4 and n's parity."""
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
    """Return (r, its rounding error) for r = x - n π/2."""
    r, low = x, number(0.0)
    for third in PI_4:
        less = builder.fmul(n, number(2.0 * third))
        left = builder.fsub(r, less)
        low = builder.fadd(low, builder.fsub(builder.fsub(r, left), less))
        r = left
    return r, low


def _near_zero(builder: Any, r: Any, low: Any, number: Any) -> tuple[Any, Any]:
    """Return (sine, cosine) of r + low. Small terms are added before the large ones."""
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


@intrinsic
def near(typingctx: Any, x: Any) -> Any:
    """Return (sin x, cos x) for a lane or number up to FAR. Inlined, it takes half the time."""
    pair = types.UniTuple(x, 2)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.make_tuple(builder, pair, _sine_and_cosine(builder, args[0]))

    return pair(x), code


def sine_cosine(x: Any) -> Any:
    """Return (sin x, cos x) for a number, or for a lane up to FAR."""
    return math.sin(x), math.cos(x)


@overload(sine_cosine, jit_options=INLINED, strict=False)
def _sine_cosine(x: Any) -> Any:
    of_number, of_lane = elementary._of_number, near
    if isinstance(x, Dual):

        def of_dual(x: Any) -> Any:
            sine, cosine = of_number(value_of(x))
            return chained(x, sine, cosine), chained(x, cosine, -sine)

        return of_dual
    return (lambda x: of_lane(x)) if isinstance(x, Lane) else (lambda x: of_number(x))


@intrinsic
def place_of(typing: Any, x: Any, n: Any) -> Any:
    """Return element n of a lane."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.extract_element(args[0], args[1])

    return types.float64(x, types.int64), code


@intrinsic
def with_place(typing: Any, x: Any, n: Any, value: Any) -> Any:
    """Return a lane with element n replaced."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.insert_element(args[0], args[2], args[1])

    return x(x, types.int64, types.float64), code


def atan2(y: Any, x: Any) -> Any:
    """Return the angle of (x, y) from the x axis, from -π to π, for numbers or lanes."""
    return math.atan2(y, x)


@overload(atan2, jit_options=INLINED, strict=False)
def _any_atan2(y: Any, x: Any) -> Any:
    of_numbers = elementary._atan2
    if isinstance(x, Dual) or isinstance(y, Dual):

        def of_duals(y: Any, x: Any) -> Any:
            b, a = value_of(y), value_of(x)
            square = a * a + b * b
            arc = of_numbers(b, a)
            return joined(chained(y, arc, a / square), chained(x, 0.0, -b / square), arc)

        return of_duals
    if not isinstance(x, Lane):
        return lambda y, x: of_numbers(y, x)

    def of_lanes(y: Any, x: Any) -> Any:  # one place after the other: few ask for it
        found = y
        for n in range(LANE_WIDTH):
            found = with_place(found, n, of_numbers(place_of(y, n), place_of(x, n)))
        return found

    return of_lanes


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


def with_slope(of_number: Any, slope: Any) -> Any:
    """A function of a number, or of a dual by its slope at (x, f(x))."""

    def of_any(x: Any) -> Any:
        return of_number(x)

    @overload(of_any, jit_options=INLINED, strict=False)
    def _of_any(x: Any) -> Any:
        if not isinstance(x, Dual):
            return lambda x: of_number(x)

        def of_dual(x: Any) -> Any:
            value = value_of(x)
            found = of_number(value)
            return chained(x, found, slope(value, found))

        return of_dual

    return of_any


def power(x: Any, y: Any) -> Any:
    """x^y of numbers or duals."""
    return x**y


@overload(power, jit_options=INLINED, strict=False)
def _any_power(x: Any, y: Any) -> Any:
    of_numbers = elementary._power
    if not isinstance(x, Dual) and not isinstance(y, Dual):
        return lambda x, y: of_numbers(x, y)
    logarithm = elementary._log_of

    def of_duals(x: Any, y: Any) -> Any:
        base, exponent = value_of(x), value_of(y)
        found = of_numbers(base, exponent)
        by_base = chained(x, found, exponent * of_numbers(base, exponent - 1.0))
        by_exponent = chained(y, 0.0, found * logarithm(base) if base > 0.0 else 0.0)
        return joined(by_base, by_exponent, found)

    return of_duals
