"""Semantics of expressions: constant values, dependencies and consistency of units."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Container, Mapping
from typing import Any

from ..errors import nearest_name, shown
from ..units import NONE, RAD, Dim, J, M, N, S
from .grammar import COMPARISONS, Node, Unreadable, parsed, walk

CONSTANTS = {"pi": math.pi}
TIME = "t"
VALUES: dict[str, Callable[..., Any]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "pow": operator.pow, "neg": operator.neg, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos,
    "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan, "exp": math.exp,
    "log": math.log, "abs": abs, "min": min, "max": max, "less": operator.lt,
    "at_most": operator.le, "more": operator.gt, "at_least": operator.ge,
    "and": lambda a, b: bool(a and b), "or": lambda a, b: bool(a or b), "not": operator.not_,
    "if": lambda c, a, b: a if c else b,
}  # fmt: skip


def varies(text: str, parameters: Container[str] = ()) -> bool:
    """Return True if a text is an expression in time or signals, or False for a constant formula.

    A parameter that is called t is the parameter.
    """
    try:
        return any(
            n.op == "signal" or (n.op == "name" and n.signal[1] == TIME and TIME not in parameters)
            for n in walk(parsed(text))
        )
    except Unreadable:
        return False


def constant(
    node: Node, parameters: Mapping[str, float], read: Callable[[Node], float] | None = None
) -> Any:
    """Evaluate a tree to a number, using `read` for the values of any signals.

    Raises Unreadable for names that are not parameters, and arithmetic errors.
    """
    if node.op == "number":
        return node.value
    if node.op == "name":
        name = node.signal[1]
        if name in parameters:
            return parameters[name]
        if name in CONSTANTS:
            return CONSTANTS[name]
        do = nearest_name(name, parameters) if parameters else "the model has none yet"
        raise Unreadable(node.column, f"no parameter is named {shown(name)}; {do}")
    if node.op == "signal" and read is not None:
        return read(node)
    if node.op == "signal":
        raise Unreadable(node.column, "varies in a motion; a constant is wanted here")
    args = [constant(x, parameters, read) for x in node.args]
    if node.op == "smoothstep":
        return smoothstep(*args)
    if node.op == "table":
        return interpolated(*args)
    return VALUES[node.op](*args)


def smoothstep(x: float, begin: float, end: float) -> float:
    """Return 0 before `begin`, 1 after `end`, and 3 s^2 - 2 s^3 in between."""
    s = min(max((x - begin) / (end - begin), 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


def interpolated(x: float, *knots: float) -> float:
    """Interpolate linearly between knots (position, value, ...), with constant extrapolation."""
    found = knots[1]
    for a, y, b, z in zip(knots[0::2], knots[1::2], knots[2::2], knots[3::2]):
        found += (z - y) / (b - a) * (min(max(x, a), b) - a)
    return found


def places_of(node: Node) -> tuple[Node, ...]:
    """Return the knot positions of a `table`."""
    return node.args[1::2]


def compares(node: Node) -> bool:
    """Check whether a tree is a comparison, or comparisons combined by and, or, not."""
    if node.op in ("and", "or", "not"):
        return all(map(compares, node.args))
    return node.op in COMPARISONS


# -- units -----------------------------------------------------------------------------------------

NAMES = {
    J: "N m", J / RAD: "N m", N: "N", RAD / S: "rad/s", M / S: "m/s", N / M: "N/m",
    N * S / M: "N s/m", J * S / RAD: "N m s",
}  # fmt: skip
# the dimension of a signal, None if it fits everything. Raises Unreadable for an unknown one
Units = Callable[[Node], Dim | None]


def dim_of(node: Node, units: Units) -> Dim | None:
    """Return the dimension of an expression, or None if a plain number in it may have any
    dimension.

    Numbers, parameters and time match every unit, because gains have no declared unit. Raises
    Unreadable if two measured quantities do not fit, and where a name is unknown.
    """
    if node.op in ("number", "name"):
        return None
    if node.op == "signal":
        return units(node)
    dims = [dim_of(x, units) for x in node.args]
    match node.op:
        case "mul" | "div":
            a, b = dims
            if a is None or b is None:
                return None
            return a * b if node.op == "mul" else a / b
        case "pow" | "sqrt":
            (base, *_), exponent = dims, node.args[-1]
            if node.op == "pow" and exponent.op != "number":
                return None
            return None if base is None else base ** (0.5 if node.op == "sqrt" else exponent.value)
        case "neg" | "abs" | "final" | "mean" | "rms" | "peak" | "range" | "window":
            return dims[0]
        case "integral":
            return None if dims[0] is None else dims[0] * S
        case "settle":
            return S
        case "add" | "sub" | "min" | "max" | "norm":
            return _same(node, dims)
        case "if":
            return _same(node, dims[1:])
        case "table":
            _same(node, (dims[0], *dims[1::2]))
            return _same(node, dims[2::2])
        case "less" | "at_most" | "more" | "at_least" | "smoothstep":
            _same(node, dims)
        case _:
            for x, dim in zip(node.args, dims):
                if dim is not None and not fits(dim, NONE) and dim != S:
                    text = f"{node.op} takes an angle or a number without unit, got {unit(dim)}"
                    raise Unreadable(x.column, text)
    return None


def _same(node: Node, dims: Any) -> Dim | None:
    known = [dim for dim in dims if dim is not None]
    for dim in known[1:]:
        if not fits(dim, known[0]):
            text = f"{unit(known[0])} and {unit(dim)} do not fit together; give one a factor"
            raise Unreadable(node.column, text)
    return known[0] if len(known) == len(dims) else None


def fits(a: Dim, b: Dim) -> bool:
    """Check whether two quantities may be added. Angles are treated as plain numbers."""
    return a._replace(angle=0) == b._replace(angle=0)


def unit(dim: Dim) -> str:
    """Return a dimension in SI units, for use in a message."""
    if name := NAMES.get(dim):
        return name
    known = ("kg", dim.mass), ("m", dim.length), ("rad", dim.angle), ("s", dim.time)
    words = [name if n == 1 else f"{name}^{n:g}" for name, n in known if n]
    return " ".join(words) or "a plain number"
