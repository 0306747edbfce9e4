"""Dual: a numba type that is a value and its derivatives, so that kernels differentiate themselves.

Kernels are compiled for it by type alone. The operations on the value are those on a number, in the
same order, so the results are equal bit for bit. Comparisons and conversions to integers only use
the value. A number is a dual without derivatives.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature
from numba.extending import lower_cast

from .kinds import (
    DOUBLE,
    DUAL,
    INLINED,
    PLACE,
    WIDTH,
    Dual,
    axes_of,
    intrinsic,
    llvm,
    operation,
    overload,
    splat,
    viewed,
    viewer,
)

VECTOR = ir.VectorType(DOUBLE, WIDTH)
PAIRS = ((Dual, Dual), (Dual, types.Float), (types.Float, Dual))
duals = viewer(DUAL)


def value_in(builder: Any, x: Any) -> Any:
    """The value of a dual."""
    return builder.extract_element(x, PLACE(0))


def with_value(builder: Any, x: Any, value: Any) -> Any:
    """A dual with another value."""
    return builder.insert_element(x, value, PLACE(0))


def everywhere(builder: Any, value: Any) -> Any:
    """A number in all places."""
    return splat(builder, value, WIDTH)


def dual_of(context: Any, builder: Any, value: Any, given: Any) -> Any:
    """Return a dual unchanged, or a number as a dual without derivatives."""
    if isinstance(given, Dual):
        return value
    number = context.cast(builder, value, given, types.float64)
    return with_value(builder, ir.Constant(VECTOR, [0.0] * WIDTH), number)


@lower_cast(types.Float, Dual)
@lower_cast(types.Integer, Dual)
def _cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return dual_of(context, builder, value, fromty)


# -- operations: x and y are vectors, or doubles where they are numbers ---------------------------


def _added(builder: Any, x: Any, y: Any) -> Any:
    if x.type == y.type:
        return builder.fadd(x, y)
    x, y = (x, y) if x.type == VECTOR else (y, x)
    return with_value(builder, x, builder.fadd(value_in(builder, x), y))


def _taken_off(builder: Any, x: Any, y: Any) -> Any:
    if x.type == y.type:
        return builder.fsub(x, y)
    if x.type == VECTOR:
        return with_value(builder, x, builder.fsub(value_in(builder, x), y))
    return with_value(builder, builder.fneg(y), builder.fsub(x, value_in(builder, y)))


def multiplied(builder: Any, x: Any, y: Any) -> Any:
    """x y."""
    if x.type != y.type:
        x, y = (x, y) if x.type == VECTOR else (y, x)
        return builder.fmul(x, everywhere(builder, y))
    a, b = value_in(builder, x), value_in(builder, y)
    both = builder.fmul(everywhere(builder, a), y), builder.fmul(everywhere(builder, b), x)
    return with_value(builder, builder.fadd(*both), builder.fmul(a, b))


def _divided(builder: Any, x: Any, y: Any) -> Any:
    if y.type != VECTOR:
        return builder.fdiv(x, everywhere(builder, y))
    below = value_in(builder, y)
    quotient = builder.fdiv(value_in(builder, x) if x.type == VECTOR else x, below)
    change = builder.fmul(everywhere(builder, quotient), y)
    change = builder.fsub(x, change) if x.type == VECTOR else builder.fneg(change)
    return with_value(builder, builder.fdiv(change, everywhere(builder, below)), quotient)


def _of_two(result: Any, *, cast: bool = False) -> Callable[[Any], Any]:
    """Return the typing of a function of two duals, or a dual and a number, `cast` to a dual."""

    def typed(args: Any) -> Any:
        fits = len(args) == 2 and any(isinstance(a, Dual) for a in args)
        fits = fits and all(isinstance(a, (Dual, types.Float, types.Integer)) for a in args)
        kinds = [DUAL if cast or isinstance(a, Dual) else types.float64 for a in args]
        return signature(result, *kinds) if fits else None

    return typed


def _binary(emit: Callable[..., Any], *operators: Any) -> None:
    """Typing and lowering of one operation between duals, or a dual and a number."""
    operation(
        operators, _of_two(DUAL), lambda context, builder, sig, args: emit(builder, *args), *PAIRS
    )


_binary(_added, operator.add, operator.iadd)
_binary(_taken_off, operator.sub, operator.isub)
_binary(multiplied, operator.mul, operator.imul)
_binary(_divided, operator.truediv, operator.itruediv)


def _comparison(relation: str, op: Any) -> None:
    """Typing and lowering of a comparison of values."""

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = (value_in(builder, a) if a.type == VECTOR else a for a in args)
        compare = builder.fcmp_unordered if relation == "!=" else builder.fcmp_ordered
        return compare(relation, x, y)

    operation((op,), _of_two(types.boolean), lower, *PAIRS)


for _relation in ("<", "<=", ">", ">=", "==", "!="):
    _names = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge", "==": "eq", "!=": "ne"}
    _comparison(_relation, getattr(operator, _names[_relation]))


def _unary(function: Any, result: Any, emit: Callable[..., Any]) -> None:
    """Typing and lowering of a function of one dual."""

    def typed(args: Any) -> Any:
        fits = len(args) == 1 and isinstance(args[0], Dual)
        return signature(result, *args) if fits else None

    operation(
        (function,), typed, lambda context, builder, sig, args: emit(builder, args[0]), (Dual,)
    )


def _root(builder: Any, x: Any) -> Any:
    root = llvm(builder, "sqrt", value_in(builder, x))
    slope = everywhere(builder, builder.fdiv(ir.Constant(DOUBLE, 0.5), root))
    return with_value(builder, builder.fmul(x, slope), root)


def _size(builder: Any, x: Any) -> Any:
    value = value_in(builder, x)
    negative = builder.fcmp_ordered("<", value, ir.Constant(DOUBLE, 0.0))
    size = builder.select(negative, builder.fneg(x), x)
    return with_value(builder, size, llvm(builder, "fabs", value))


_unary(operator.neg, DUAL, lambda builder, x: builder.fneg(x))
_unary(math.sqrt, DUAL, _root)
_unary(abs, DUAL, _size)
_unary(
    math.floor,
    types.int64,
    lambda builder, x: builder.fptosi(llvm(builder, "floor", value_in(builder, x)), ir.IntType(64)),
)
_unary(
    math.isnan,
    types.boolean,
    lambda builder, x: builder.fcmp_unordered("uno", value_in(builder, x), value_in(builder, x)),
)
_unary(int, types.int64, lambda builder, x: builder.fptosi(value_in(builder, x), ir.IntType(64)))


def _extreme(function: Any, relation: str) -> None:
    """min and max of two: the second where it stands in `relation` to the first, as Python's."""

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = args
        other = builder.fcmp_ordered(relation, value_in(builder, y), value_in(builder, x))
        return builder.select(other, y, x)

    operation((function,), _of_two(DUAL, cast=True), lower, (Dual, Dual))


_extreme(min, "<")
_extreme(max, ">")


def _copy_sign(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    word = ir.IntType(64)
    bits = (builder.bitcast(value_in(builder, a), word) for a in args)
    x, y = (builder.icmp_signed("<", one, ir.Constant(word, 0)) for one in bits)
    return builder.select(builder.xor(x, y), builder.fneg(args[0]), args[0])


operation((math.copysign,), _of_two(DUAL, cast=True), _copy_sign, (Dual, Dual))


@overload(operator.pow, jit_options=INLINED, strict=False)
def _whole_power(x: Any, n: Any) -> Any:
    if not (isinstance(x, Dual) and isinstance(n, types.Integer)):
        return None

    def of_dual(x: Any, n: Any) -> Any:
        found = x
        for _ in range(n - 1):
            found = found * x
        return found

    return of_dual


# -- parts of a dual ------------------------------------------------------------------------------


@intrinsic
def value_of(typingctx: Any, x: Any) -> Any:
    """The value of a dual, or a number."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return value_in(builder, args[0]) if isinstance(x, Dual) else args[0]

    return types.float64(x if isinstance(x, Dual) else types.float64), code


@intrinsic
def chained(typingctx: Any, x: Any, value: Any, slope: Any) -> Any:
    """Apply f to a dual, given its slope, or to a number without derivatives."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not isinstance(x, Dual):
            return dual_of(context, builder, args[1], types.float64)
        return with_value(builder, builder.fmul(args[0], everywhere(builder, args[2])), args[1])

    return DUAL(x, types.float64, types.float64), code


@intrinsic
def joined(typingctx: Any, x: Any, y: Any, value: Any) -> Any:
    """The derivatives of two duals added up, with a value."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return with_value(builder, builder.fadd(args[0], args[1]), args[2])

    return DUAL(x, y, types.float64), code


@intrinsic
def revalued(typingctx: Any, x: Any, value: Any) -> Any:
    """The derivatives of a dual with another value."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return with_value(builder, args[0], args[1])

    return DUAL(DUAL, types.float64), code


def carries(x: Any) -> bool:
    """Check whether an array contains duals."""
    return False


@overload(carries, jit_options=INLINED, strict=False)
def _carries(x: Any) -> Any:
    found = isinstance(x.dtype, Dual)
    return lambda x: found


@intrinsic
def parted(typingctx: Any, array: Any) -> Any:
    """An array (...) of duals as a float64 array (..., WIDTH) over the same memory."""
    view = types.Array(types.float64, array.ndim + 1, "C", aligned=False)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, args[0])
        axes = axes_of(builder, source)
        for axis, more in zip(axes, (WIDTH, 8)):
            axis.append(context.get_constant(types.intp, more))
        return viewed(context, builder, view, source, source.data, axes)

    return view(array), code


def of_numbers(function: Any) -> Any:
    """A function of (user, t, q, v, tau), which is nan of duals."""

    def of_any(user: Any, t: Any, q: Any, v: Any, tau: Any) -> Any:
        return function(user, t, q, v, tau)

    @overload(of_any, jit_options=INLINED, strict=False)
    def _of_any(user: Any, t: Any, q: Any, v: Any, tau: Any) -> Any:
        if isinstance(q.dtype, Dual):
            return lambda user, t, q, v, tau: math.nan
        return lambda user, t, q, v, tau: function(user, t, q, v, tau)

    return of_any
