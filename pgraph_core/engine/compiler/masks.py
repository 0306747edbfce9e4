"""Decisions in lanes: a mask is a lane of ones and zeros, chosen by, and never branched on.

Lanes that are done wait for the others: loops go on while `any_of` a mask is set. Each lane takes
the operations of a single instance, in their order, and so has its bits.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing import templates
from numba.core.typing.templates import AbstractTemplate, signature
from numba.extending import lower_builtin

from .lane import Lane, as_vector, intrinsic, llvm

infer_global: Any = templates.infer_global  # untyped in numba


def _number(builder: Any, found: Any, width: int) -> Any:
    """Ones where `found`."""
    kind = ir.VectorType(ir.DoubleType(), width)
    return builder.select(found, ir.Constant(kind, [1.0] * width), ir.Constant(kind, [0.0] * width))


def _set(builder: Any, mask: Any) -> Any:
    return builder.fcmp_unordered("!=", mask, ir.Constant(mask.type, [0.0] * mask.type.count))


def _lane_of(*kinds: Any) -> Any:
    return next(kind for kind in kinds if isinstance(kind, Lane))


def _of_two(emit: Any) -> Any:
    """An intrinsic of two lanes, or of a lane and a number."""

    @intrinsic
    def two(typingctx: Any, a: Any, b: Any) -> Any:
        lane = _lane_of(a, b)

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            x, y = (as_vector(context, builder, v, k, lane) for v, k in zip(args, sig.args))
            return emit(builder, x, y, lane.width)

        return lane(a, b), code

    return two


def _comparison(relation: str) -> Any:
    return _of_two(lambda b, x, y, n: _number(b, b.fcmp_ordered(relation, x, y), n))


more = _comparison(">")
most = _comparison("<=")  # the first is at most the second
larger = _of_two(lambda b, x, y, n: b.select(b.fcmp_ordered(">", x, y), x, y))
smaller = _of_two(lambda b, x, y, n: b.select(b.fcmp_ordered("<", x, y), x, y))
both = _of_two(lambda b, x, y, n: _number(b, b.and_(_set(b, x), _set(b, y)), n))
either = _of_two(lambda b, x, y, n: _number(b, b.or_(_set(b, x), _set(b, y)), n))
without = _of_two(lambda b, x, y, n: _number(b, b.and_(_set(b, x), b.not_(_set(b, y))), n))


@intrinsic
def chosen(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    """a where the mask is set, else b."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = (as_vector(context, builder, v, k, mask) for v, k in zip(args[1:], sig.args[1:]))
        return builder.select(_set(builder, args[0]), x, y)

    return mask(mask, a, b), code


@intrinsic
def any_of(typingctx: Any, mask: Any) -> Any:
    """Whether the mask is set anywhere."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = ir.IntType(mask.width)
        bits = builder.bitcast(_set(builder, args[0]), whole)
        return builder.icmp_unsigned("!=", bits, ir.Constant(whole, 0))

    return types.boolean(mask), code


@infer_global(abs)
class _Abs(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        fits = len(args) == 1 and isinstance(args[0], Lane)
        return signature(args[0], *args) if fits else None


@lower_builtin(abs, Lane)
def _abs(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return llvm(builder, "fabs", args[0])
