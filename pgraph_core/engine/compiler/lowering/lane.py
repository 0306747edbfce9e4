"""Lane(width): a numba type for an LLVM vector of doubles, so that one kernel runs W instances.

`lanes(a)` views a C-contiguous float64 array (..., W) as an array (...) of lanes. Kernels index it
like any array. The type determines whether they are compiled for one instance or for W instances at
once. Lanes support + - * / neg, their in-place forms, sqrt, floor, min and max with a number, and
`sine_cosine` and `atan2` of `elementary`. A float is converted to a lane when it is stored or
combined with one. Lanes cannot be compared, because kernels for lanes branch on the structure of a
mechanism and never on its state.
"""

from __future__ import annotations

import math
import operator
from functools import partial
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import signature
from numba.extending import lower_cast, models, register_model

from ..lane import LANE_WIDTH
from .dual import multiplied
from .kinds import (
    DOUBLE,
    DUAL,
    INLINED,
    PLACE,
    Dual,
    axes_of,
    intrinsic,
    llvm,
    operation,
    overload,
    splat,
    view_type,
    viewed,
    viewer,
)


class Lane(types.Type):
    """A vector of W doubles."""

    def __init__(self, width: int):
        """Create a vector type of `width` doubles."""
        self.width = width
        super().__init__(name=f"Lane({width})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Allow conversion from numbers, so that a constant may be stored in a lane."""
        return Conversion.safe if isinstance(other, (types.Float, types.Integer)) else None


@register_model(Lane)
class LaneModel(models.PrimitiveModel):
    """Data model of a lane: one LLVM vector in registers and in memory."""

    def __init__(self, dmm: Any, fe_type: Lane):
        super().__init__(dmm, fe_type, ir.VectorType(DOUBLE, fe_type.width))


def as_vector(context: Any, builder: Any, value: Any, given: Any, lane: Lane) -> Any:
    """Return a lane unchanged, or broadcast a number to a lane."""
    if isinstance(given, Lane):
        return value
    return splat(builder, context.cast(builder, value, given, types.float64), lane.width)


@lower_cast(types.Float, Lane)
@lower_cast(types.Integer, Lane)
def _cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return as_vector(context, builder, value, fromty, toty)


def _lane(args: Any, *others: Any) -> Any:
    """Return the lane among arguments that are lanes and these types, or None."""
    lane = next((a for a in args if isinstance(a, Lane)), None)
    return lane if all(isinstance(a, (Lane, *others)) for a in args) else None


def _binary(name: str, *operators: Any) -> None:
    """Typing and lowering of a binary operation between lanes, or a lane and a number."""

    def typed(args: Any) -> Any:
        lane = _lane(args, types.Float, types.Integer)
        return signature(lane, *args) if lane is not None and len(args) == 2 else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = (
            as_vector(context, builder, a, given, sig.return_type)
            for a, given in zip(args, sig.args)
        )
        return getattr(builder, name)(x, y)

    numbers = [(Lane, x) for x in (types.Float, types.Integer)]
    operation(operators, typed, lower, (Lane, Lane), *numbers, *(pair[::-1] for pair in numbers))


_binary("fadd", operator.add, operator.iadd)
_binary("fsub", operator.sub, operator.isub)
_binary("fmul", operator.mul, operator.imul)
_binary("fdiv", operator.truediv, operator.itruediv)


def _unary(function: Any, emit: Any) -> None:
    """Typing and lowering of a function of one lane."""

    def typed(args: Any) -> Any:
        return signature(args[0], *args) if len(args) == 1 and isinstance(args[0], Lane) else None

    operation(
        (function,), typed, lambda context, builder, sig, args: emit(builder, args[0]), (Lane,)
    )


_unary(operator.neg, lambda builder, x: builder.fneg(x))
_unary(math.sqrt, lambda builder, x: llvm(builder, "sqrt", x))
_unary(math.floor, lambda builder, x: llvm(builder, "floor", x))
_unary(abs, lambda builder, x: llvm(builder, "fabs", x))


def _clamp(function: Any, relation: str) -> None:
    """Generate code for min(a, b) and max(a, b), where a is a lane and b is a lane or a number.

    `relation` selects a.
    """

    def typed(args: Any) -> Any:
        lane = _lane(args, types.Float)
        return signature(lane, lane, args[1]) if lane and len(args) == 2 else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bound = as_vector(context, builder, args[1], sig.args[1], sig.return_type)
        keep = builder.fcmp_unordered(relation, args[0], bound)  # nan stays nan
        return builder.select(keep, args[0], bound)

    operation((function,), typed, lower, (Lane, types.Float), (Lane, Lane))


_clamp(min, "<")
_clamp(max, ">")


lanes = viewer(Lane(LANE_WIDTH))


@intrinsic
def constants(typingctx: Any, array: Any, block: Any) -> Any:
    """Return a block's constants: a shared array (rows, columns), or its own as lanes."""
    if array.ndim == 2:
        return array(array, block), lambda context, builder, sig, args: args[0]
    view = view_type(array, LANE, 2)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, args[0])
        axes = axes_of(builder, source)
        index = context.cast(builder, args[1], sig.args[1], types.intp)
        start = cgutils.pointer_add(builder, source.data, builder.mul(index, axes[1][0]))
        return viewed(context, builder, view, source, start, [axis[1:-1] for axis in axes])

    return view(array, block), codegen


# -- triples: three numbers in one register, or three lanes ---------------------------------------
# A wrench whose components are triples is three wrenches, and goes through the same lines as one:
# the three rows of a block at the cost of one. Three rows of a 3x3 block are three triples.


class Triple(Lane):
    """Three numbers in a register with four elements."""

    def __init__(self) -> None:
        super().__init__(4)
        self.name = "Triple"


register_model(Triple)(LaneModel)


class Three(types.Type):
    """Three numbers of every instance: a triple of lanes. Or three duals."""

    def __init__(self, lane: Any):
        self.lane = lane
        super().__init__(name=f"Three({lane})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Allow conversion from numbers, so that a triple of constants may be stored."""
        return Conversion.safe if isinstance(other, Triple) else None


@register_model(Three)
class ThreeModel(models.StructModel):
    """Three vectors."""

    def __init__(self, dmm: Any, fe_type: Three):
        super().__init__(dmm, fe_type, [(name, fe_type.lane) for name in "xyz"])


TRIPLE, FOUR, LANE = Triple(), Lane(4), Lane(LANE_WIDTH)
THREE, THREE_DUALS = Three(LANE), Three(DUAL)
THREES = {LANE: THREE, DUAL: THREE_DUALS}  # by the entries of an array
PAIR = ir.VectorType(DOUBLE, 2)
WHOLE = ir.VectorType(DOUBLE, 4)


def _parts(builder: Any, three: Any) -> list[Any]:
    return [builder.extract_value(three, n) for n in range(3)]


def _three(context: Any, builder: Any, parts: Any) -> Any:
    value = ir.Constant(ir.LiteralStructType([part.type for part in parts]), ir.Undefined)
    for n, part in enumerate(parts):
        value = builder.insert_value(value, part, n)
    return value


@lower_cast(Triple, Three)
def _cast_triple(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    numbers = [builder.extract_element(value, PLACE(n)) for n in range(3)]
    kind = toty.lane
    return _three(
        context, builder, [context.cast(builder, x, types.float64, kind) for x in numbers]
    )


def _binary_of_threes(name: str, *operators: Any) -> None:
    """Typing and lowering of an operation between triples of lanes, or a triple and a lane."""

    def typed(args: Any) -> Any:
        if len(args) != 2 or not any(isinstance(a, Three) for a in args):
            return None
        three = next(a for a in args if isinstance(a, Three))
        kinds = [three if isinstance(a, (Three, Triple)) else three.lane for a in args]
        return signature(three, *kinds)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = (
            _parts(builder, a) if isinstance(given, Three) else [a] * 3
            for a, given in zip(args, sig.args)
        )
        emit = getattr(builder, name)
        if sig.return_type == THREE_DUALS and name == "fmul":
            emit = partial(multiplied, builder)
        return _three(context, builder, [emit(a, b) for a, b in zip(x, y)])

    elements = [(Three, x) for x in (Lane, Dual)]
    pairs = (Three, Three), *elements, *(pair[::-1] for pair in elements)
    operation(operators, typed, lower, *pairs)


_binary_of_threes("fadd", operator.add, operator.iadd)
_binary_of_threes("fsub", operator.sub, operator.isub)
_binary_of_threes("fmul", operator.mul, operator.imul)


def _neg(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _three(context, builder, [builder.fneg(x) for x in _parts(builder, args[0])])


operation(
    (operator.neg,),
    lambda args: signature(args[0], args[0]) if isinstance(args[0], Three) else None,
    _neg,
    (Three,),
)


def _mask(*places: int) -> Any:
    return ir.Constant(ir.VectorType(PLACE, len(places)), list(places))


def _pointer(context: Any, builder: Any, kind: Any, values: Any) -> Any:
    """Return the pointer to entry (i, j) of a C-contiguous array."""
    array = context.make_array(kind)(context, builder, values[0])
    strides = cgutils.unpack_tuple(builder, array.strides)
    place = builder.mul(values[1], strides[0])
    place = builder.add(place, builder.mul(values[2], strides[1]))
    return cgutils.pointer_add(builder, array.data, place)


@intrinsic
def triple(typingctx: Any, x: Any, y: Any, z: Any) -> Any:
    """Return three numbers, or three lanes, as a triple."""

    def of_lanes(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _three(context, builder, args)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = ir.Constant(WHOLE, [0.0] * 4)
        for n, arg in enumerate(args):
            value = builder.insert_element(value, arg, PLACE(n))
        return value

    for three in (THREE, THREE_DUALS):
        if any(a == three.lane for a in (x, y, z)):
            return three(*[three.lane] * 3), of_lanes
    return TRIPLE(types.float64, types.float64, types.float64), code


@intrinsic
def numbers(typingctx: Any, x: Any) -> Any:
    """Return the three numbers or lanes of a triple as a tuple."""
    three = isinstance(x, Three)
    kind = types.UniTuple(x.lane if three else types.float64, 3)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = [builder.extract_element(args[0], PLACE(n)) for n in range(3)] if not three else []
        return context.make_tuple(builder, kind, found or _parts(builder, args[0]))

    return kind(x if three else TRIPLE), code


@intrinsic
def four(typingctx: Any, w: Any, x: Any, y: Any, z: Any) -> Any:
    """Return four numbers as a vector."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = ir.Constant(WHOLE, ir.Undefined)
        for n, arg in enumerate(args):
            value = builder.insert_element(value, arg, PLACE(n))
        return value

    return FOUR(*[types.float64] * 4), code


@intrinsic
def numbers_of_four(typingctx: Any, x: Any) -> Any:
    """Return the four numbers as a tuple."""
    kind = types.UniTuple(types.float64, 4)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = [builder.extract_element(args[0], PLACE(n)) for n in range(4)]
        return context.make_tuple(builder, kind, found)

    return kind(FOUR), code


@intrinsic
def load_four(typingctx: Any, a: Any, i: Any, j: Any) -> Any:
    """Load a[i, j] to a[i, j + 3] as a vector."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        return builder.load(builder.bitcast(place, WHOLE.as_pointer()), align=8)

    return FOUR(a, types.intp, types.intp), code


@intrinsic
def store_four(typingctx: Any, a: Any, i: Any, j: Any, x: Any) -> Any:
    """Store a vector of four numbers in a[i, j] to a[i, j + 3]."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        builder.store(args[3], builder.bitcast(place, WHOLE.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(a, types.intp, types.intp, FOUR), code


@intrinsic
def load_triple(typingctx: Any, a: Any, i: Any, j: Any) -> Any:
    """Load a[i, j], a[i, j + 1], a[i, j + 2] as a triple."""

    def of_lanes(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        found = [builder.load(builder.gep(place, [PLACE(n)]), align=8) for n in range(3)]
        return _three(context, builder, found)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        two = builder.load(builder.bitcast(place, PAIR.as_pointer()), align=8)
        one = builder.load(builder.gep(place, [PLACE(2)]), align=8)
        last = builder.insert_element(ir.Constant(PAIR, [0.0] * 2), one, PLACE(0))
        return builder.shuffle_vector(two, last, _mask(0, 1, 2, 3))

    of = THREES.get(a.dtype)
    return (of or TRIPLE)(a, types.intp, types.intp), of_lanes if of else code


@intrinsic
def store_triple(typingctx: Any, a: Any, i: Any, j: Any, x: Any) -> Any:
    """Store a triple in a[i, j], a[i, j + 1], a[i, j + 2]."""

    def of_lanes(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        for n, part in enumerate(_parts(builder, args[3])):
            builder.store(part, builder.gep(place, [PLACE(n)]), align=8)
        return context.get_dummy_value()

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = _pointer(context, builder, signature.args[0], args)
        two = builder.shuffle_vector(args[3], ir.Constant(WHOLE, ir.Undefined), _mask(0, 1))
        builder.store(two, builder.bitcast(place, PAIR.as_pointer()), align=8)
        builder.store(
            builder.extract_element(args[3], PLACE(2)), builder.gep(place, [PLACE(2)]), align=8
        )
        return context.get_dummy_value()

    of = THREES.get(a.dtype)
    kinds = (a, types.intp, types.intp, of or TRIPLE)
    return types.void(*kinds), of_lanes if of else code


def _beyond_duals(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    least = builder.extract_element(args[1], PLACE(0))
    found = []
    for x in _parts(builder, args[0]):
        value = builder.extract_element(x, PLACE(0))
        keep = builder.fcmp_unordered(">", llvm(builder, "fabs", value), least)
        value = builder.select(keep, value, ir.Constant(DOUBLE, 0.0))
        found.append(builder.insert_element(x, value, PLACE(0)))
    return _three(context, builder, found)


@intrinsic
def beyond(typingctx: Any, x: Any, least: Any) -> Any:
    """Replace the numbers of a triple with |x| <= `least` by zero, keeping nan.

    A dual with such a value keeps its derivatives.
    """
    if isinstance(x, Three) and x == THREE_DUALS:
        return x(x, DUAL), _beyond_duals

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        three = isinstance(signature.return_type, Three)
        bound = args[1] if three else splat(builder, args[1], 4)
        found = []
        for y in _parts(builder, args[0]) if three else [args[0]]:
            keep = builder.fcmp_unordered(">", llvm(builder, "fabs", y), bound)
            found.append(builder.select(keep, y, ir.Constant(y.type, [0.0] * y.type.count)))
        return _three(context, builder, found) if three else found[0]

    if isinstance(x, Three):
        return THREE(THREE, LANE), code
    return TRIPLE(TRIPLE, types.float64), code


def by_lanes(of_lanes: Any, of_numbers: Any) -> Any:
    """Return a function of (rows, work, q) that selects one of two, by whether q contains lanes."""

    def of_any(rows: Any, work: Any, q: Any) -> Any:
        return of_numbers(rows, work, q)

    @overload(of_any, jit_options=INLINED, strict=False)
    def _of_any(rows: Any, work: Any, q: Any) -> Any:
        if isinstance(q.dtype, (Lane, Dual)):
            return lambda rows, work, q: of_lanes(rows, work, q)
        return lambda rows, work, q: of_numbers(rows, work, q)

    return of_any


def numbers_alone(of_numbers: Any) -> Any:
    """Return `exert` of a load for arrays of numbers, which does nothing for arrays of lanes."""

    def of_any(
        one: Any, knots: Any, vias: Any, work: Any, linear: Any, q: Any, t: Any, to: Any
    ) -> Any:
        return of_numbers(one, knots, vias, work, linear, q, t, to)

    @overload(of_any, jit_options=INLINED, strict=False)
    def _of_any(
        one: Any, knots: Any, vias: Any, work: Any, linear: Any, q: Any, t: Any, to: Any
    ) -> Any:
        if isinstance(q.dtype, Lane):
            return lambda one, knots, vias, work, linear, q, t, to: (0.0, 0.0)
        return lambda one, knots, vias, work, linear, q, t, to: of_numbers(
            one, knots, vias, work, linear, q, t, to
        )

    return of_any
