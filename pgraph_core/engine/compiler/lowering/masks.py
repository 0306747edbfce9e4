"""Code generation for `masks` in numba, for lanes, numbers, or a lane and a number."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types

from .dual import dual_of, value_in
from .kinds import Dual, intrinsic
from .lane import Lane, as_vector


def _constant(kind: Any, x: float) -> Any:
    """Create a constant, broadcast if the type is a vector."""
    return ir.Constant(kind, [x] * kind.count if isinstance(kind, ir.VectorType) else x)


def _number(builder: Any, found: Any, kind: Any) -> Any:
    """Ones where `found`."""
    return builder.select(found, _constant(kind, 1.0), _constant(kind, 0.0))


def _set(builder: Any, mask: Any) -> Any:
    return builder.fcmp_unordered("!=", mask, _constant(mask.type, 0.0))


def _common(*kinds: Any) -> Any:
    """The lane or dual among these, or a number's type."""
    return next((kind for kind in kinds if isinstance(kind, (Lane, Dual))), types.float64)


def _taken(context: Any, builder: Any, values: Any, given: Any, kind: Any) -> list[Any]:
    """Values as lanes, as duals, or all as numbers."""
    if isinstance(kind, Dual):
        return [dual_of(context, builder, v, k) for v, k in zip(values, given)]
    if isinstance(kind, Lane):
        return [as_vector(context, builder, v, k, kind) for v, k in zip(values, given)]
    return [context.cast(builder, v, k, kind) for v, k in zip(values, given)]


def _of_two(emit: Any) -> Any:
    """Return an intrinsic for two lanes, a lane and a number, or two numbers.

    For duals, the result is the mask of the comparison of their values.
    """

    @intrinsic
    def two(typingctx: Any, a: Any, b: Any) -> Any:
        kind = _common(a, b)
        kind = types.float64 if isinstance(kind, Dual) else kind

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            values = [
                value_in(builder, x) if isinstance(k, Dual) else x for x, k in zip(args, sig.args)
            ]
            kinds = [types.float64 if isinstance(k, Dual) else k for k in sig.args]
            x, y = _taken(context, builder, values, kinds, kind)
            return emit(builder, x, y)

        return kind(a, b), code

    return two


def _comparison(relation: str) -> Any:
    return _of_two(lambda b, x, y: _number(b, b.fcmp_ordered(relation, x, y), x.type))


def _extreme(relation: str) -> Any:
    """Find the first of two values where the comparison is true, and the other value
    elsewhere."""

    @intrinsic
    def extreme(typingctx: Any, a: Any, b: Any) -> Any:
        kind = _common(a, b)

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            x, y = _taken(context, builder, args, sig.args, kind)
            values = [value_in(builder, z) if isinstance(kind, Dual) else z for z in (x, y)]
            return builder.select(builder.fcmp_ordered(relation, *values), x, y)

        return kind(a, b), code

    return extreme


more = _comparison(">")
most = _comparison("<=")
larger = _extreme(">")
smaller = _extreme("<")
both = _of_two(lambda b, x, y: _number(b, b.and_(_set(b, x), _set(b, y)), x.type))
either = _of_two(lambda b, x, y: _number(b, b.or_(_set(b, x), _set(b, y)), x.type))
without = _of_two(lambda b, x, y: _number(b, b.and_(_set(b, x), b.not_(_set(b, y))), x.type))


@intrinsic
def chosen(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    """Return a where the mask is set, else b."""
    kind = _common(mask, a, b)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = _taken(context, builder, args[1:], sig.args[1:], kind)
        return builder.select(_set(builder, args[0]), x, y)

    return kind(mask, a, b), code


@intrinsic
def any_of(typingctx: Any, mask: Any) -> Any:
    """Check whether the mask is set anywhere, or if a number is not zero."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        found = _set(builder, args[0])  # selects the derivatives of a dual too
        if not isinstance(mask, (Lane, Dual)):
            return found
        whole = ir.IntType(mask.width)
        return builder.icmp_unsigned("!=", builder.bitcast(found, whole), ir.Constant(whole, 0))

    return types.boolean(mask), code
