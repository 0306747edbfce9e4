"""Memory of a user's function: variables that its calls change, and answers that depend on them.

A function of its arguments alone changes nothing that it can see, and gives the same answer to a
call that is repeated, in any order. Both are checked for some calls of a run.
"""

from __future__ import annotations

import functools
import io
import types
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from ..packing import Array

KEPT = 16  # calls kept of a run, and at most twice as many
MOST_SEEN = 4096  # objects that are looked at, and entries of each
PLAIN = (bool, int, float, complex, str, bytes, type(None))
FIXED = (types.ModuleType, type, types.BuiltinFunctionType, types.CodeType)  # not looked into
OWN = __name__.partition(".")[
    0
]  # package whose models and mechanisms keep nothing that changes an answer


class Call(NamedTuple):
    """A call, its answer, and what the function held after it."""

    t: float
    q: Array
    v: Array
    answer: Array
    held: dict[str, int]


class Calls:
    """Some calls of a function, evenly over all of them."""

    def __init__(self, function: Callable[..., Any]):
        self.function = function  # the user's own
        self.count, self.apart = 0, 1
        self.first: dict[str, int] = {}  # values that it held after its first call
        self.kept: list[Call] = []

    def note(self, t: float, q: Array, v: Array, answer: Array) -> None:
        """Note a call and its answer, if it is one to keep."""
        self.count += 1
        if self.count % self.apart:
            return
        held = variables_of(self.function)
        self.first = self.first or held
        self.kept.append(Call(t, q.copy(), v.copy(), answer.astype(float), held))
        if len(self.kept) > 2 * KEPT:
            self.kept, self.apart = self.kept[1::2], 2 * self.apart

    def changed(self) -> str:
        """Return the name of a variable that calls after the first one have changed, or ""."""
        every = (variables_of(self.function), *(call.held for call in self.kept))
        for held in every if self.count > 1 else ():
            for name, content in held.items():
                if self.first.get(name) != content:
                    return name
        return ""

    def differs(self, answer: Callable[[float, Array, Array], Array]) -> float | None:
        """Return the time of a call that gets another answer when it is repeated, or None.

        The last calls are repeated first, so that what a function remembers is not what it was.
        """
        for call in reversed(self.kept):
            found = answer(call.t, call.q.copy(), call.v.copy())
            if not np.array_equal(found, call.answer, equal_nan=True):
                return call.t
        return None


def variables_of(function: Any) -> dict[str, int]:
    """Return a hash of the content of each variable that a function can change, by name.

    These are its attributes and those of its object, the variables of functions around it, its
    global variables and default values, and all that they hold.
    """
    found, seen = dict[str, int](), Seen(package_of(getattr(function, "__func__", function)))
    for name, value in _held(function):
        found[name] = hash((found.get(name), _content(value, seen)))
    return found


def package_of(value: Any) -> str:
    """Return the package in which a function, or the class of an object, was defined."""
    module = value.__module__ if isinstance(value, types.FunctionType) else type(value).__module__
    return (module or "").partition(".")[0]


class Seen(set[int]):
    """The identities of objects that were looked at, for a function of this package."""

    def __init__(self, package: str):
        super().__init__()
        self.package = package

    def passes(self, value: Any) -> bool:
        """Return True if a value is not looked into, or was already.

        Functions of other packages keep what changes no answer, and so does Pgraph.
        """
        if id(value) in self or len(self) > MOST_SEEN or isinstance(value, FIXED):
            return True
        package, foreign = package_of(value), isinstance(value, types.FunctionType)
        return package == OWN or (foreign and package != self.package)


def _held(function: Any) -> Iterator[tuple[str, Any]]:
    """Yield the variables of a function, or of an object that is called, by name."""
    if isinstance(function, types.MethodType):
        yield from _attributes(function.__self__)
        yield from _held(function.__func__)
    elif isinstance(function, functools.partial):
        yield from (("args", function.args), ("keywords", function.keywords))
        yield from _held(function.func)
    elif isinstance(function, types.FunctionType):
        cells = zip(function.__code__.co_freevars, function.__closure__ or ())
        yield from ((name, _inside(cell)) for name, cell in cells)
        own = function.__globals__
        yield from ((name, own[name]) for name in _names_in(function.__code__) if name in own)
        defaults = (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values())
        yield from (("a default value", value) for value in defaults)
        yield from [*vars(function).items()]
    else:
        yield from _attributes(function)
        if isinstance(called := type(function).__call__, types.FunctionType):
            yield from _held(called)


def _inside(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # the cell has no value yet
        return None


def _names_in(code: types.CodeType) -> set[str]:
    """Return the names of global variables in a function and in those within it."""
    inner = (_names_in(x) for x in code.co_consts if isinstance(x, types.CodeType))
    return set(code.co_names).union(*inner)


def _attributes(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the attributes of an object and the data of its class."""
    for base in type(value).__mro__:
        slots = vars(base).get("__slots__", ())
        slots = (slots,) if isinstance(slots, str) else slots
        yield from ((name, getattr(value, name, None)) for name in slots)
        data = ((name, x) for name, x in [*vars(base).items()] if name[:2] != "__")
        yield from ((name, x) for name, x in data if isinstance(x, (*PLAIN, list, dict, set)))
    yield from [*getattr(value, "__dict__", {}).items()]


def _content(value: Any, seen: Seen) -> int:
    """Return a hash of the content of a value, of at most MOST_SEEN objects that are not seen."""
    if isinstance(value, PLAIN):
        return hash((type(value), value.hex() if isinstance(value, float) else value))
    if isinstance(value, np.ndarray) and value.dtype != object:
        return hash((value.shape, _some(value.reshape(-1)).tobytes()))
    if seen.passes(value):
        return id(value)
    seen.add(id(value))
    return hash((type(value), *(_content(x, seen) for x in _parts(value))))


def _some(values: Any) -> Any:
    """Return at most MOST_SEEN entries, evenly over a sequence."""
    return values[:: -(-len(values) // MOST_SEEN) or 1]


def _parts(value: Any) -> Iterator[Any]:
    """Yield what a value consists of, as far as Python can tell."""
    if isinstance(value, (list, tuple)):
        yield from (len(value), *_some(value))
    elif isinstance(value, Mapping):
        yield len(value)
        for pair in [*islice(value.items(), MOST_SEEN)]:
            yield from pair
    elif isinstance(value, (types.FunctionType, types.MethodType, functools.partial)):
        for pair in _held(value):
            yield from pair
    elif isinstance(value, types.GeneratorType):
        frame = value.gi_frame
        yield from (None,) if frame is None else (frame.f_lasti, dict(frame.f_locals))
    elif isinstance(value, io.IOBase):
        yield value.closed or (value.seekable() and value.tell())
    else:
        try:
            copied = value.__reduce_ex__(4)  # all that a copy gets, such as a random state
        except Exception:  # a lock or a file, for example
            copied = dict(_attributes(value))
        for x in copied[1:] if isinstance(copied, tuple) else (copied,):
            yield from islice(x, MOST_SEEN) if isinstance(x, Iterator) else (x,)
