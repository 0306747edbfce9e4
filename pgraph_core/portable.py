"""What public values share: pickles tagged with the version that wrote them, and equality."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .errors import InputError, Problem


@cache
def installed() -> str:
    """The version of Pgraph that runs."""
    return version("pgraph-dynamics")


class Portable:
    """A mixin: `pickle` and `copy` keep the state that `__getstate__` gives.

    The pickle names its version before anything else. Another version raises InputError when it
    reads that, before it meets classes or fields that it does not have.
    """

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        kind = type(self)
        return _empty, (installed(), kind.__module__, kind.__qualname__), self.__getstate__()


class Hinting(Portable):
    """A portable value that says where to find what other programs have as a method.

    Not for what inner loops ask: a class with `__getattr__` gives every attribute more slowly.
    """

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Says where to find what others have as a method. Raises AttributeError."""
            kind = type(self).__name__
            if hint := _elsewhere(kind, name):
                text = f"a {kind} has no '{name}'; {hint}"
                raise AttributeError(text, name=name, obj=self)
            inherited = getattr(super(), "__getattr__", None)
            if inherited is None:
                text = f"'{kind}' object has no attribute '{name}'"
                raise AttributeError(text, name=name, obj=self)
            return inherited(name)


class Elsewhere:
    """In the place of a method of a class without hints: a function of the package does it."""

    def __init__(self, name: str):
        self._name = name

    def __get__(self, value: object, kind: type) -> Any:
        """Raises AttributeError, which says what to write."""
        name = self._name
        text = f"a {kind.__name__} has no '{name}'; {_elsewhere(kind.__name__, name)}"
        raise AttributeError(text, name=name, obj=value)


def _elsewhere(kind: str, name: str) -> str:
    """What to write in place of a method that a class of ours does not have; "" for others."""
    if name.startswith("_"):
        return ""
    public = import_module("pgraph_core").__all__
    given = {"Model": "model", "Mechanism": "mech", "Result": "run"}.get(kind, "...")
    if name in public and name.islower():
        return f"write pg.{name}({given}, ...)"
    act, _, what = name.partition("_")
    if what and kind == "Model" and act in ("add", "remove", "edit", "set"):
        part = what.split("_")[0].capitalize()
        part = f"pg.{part}" if part in public else "pg.Body"
        calls = {"add": f"add({part}(name=..., ...))", "remove": "remove(name)"}
        return f"write {given}.{calls.get(act, 'edit(name, field=value)')}"
    return ""


def _empty(written: str, module: str, name: str) -> Any:
    """An instance without state, for `pickle`. Raises InputError for another version's pickle."""
    if written != installed():
        text = (
            f"was written by Pgraph {written}, and Pgraph {installed()} is running; use "
            f"{written} to read it, or save the model to a JSON file there and load that here"
        )
        raise InputError(Problem(f"pickle of a {name}", "", text))
    kind: Any = import_module(module)
    for part in name.split("."):
        kind = getattr(kind, part)
    return kind.__new__(kind)


class Unportable:
    """A mixin: holds addresses of this process, which mean nothing elsewhere."""

    def __reduce_ex__(self, protocol: Any) -> Any:
        text = "holds memory addresses and cannot be pickled or copied; send its Mechanism instead"
        raise TypeError(f"a {type(self).__name__} {text}")


# -- equality of values that hold arrays ---------------------------------------------------------


def same(a: Any, b: Any) -> bool:
    """Whether two values, or all values in them, are equal, nan to nan; a list equals a tuple."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        a, b = np.asarray(a), np.asarray(b)
        floats = all(x.dtype.kind in "fc" for x in (a, b))  # others have no nan
        return bool(np.array_equal(a, b, equal_nan=floats))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b or (a != a and b != b))


class EqualByFields:
    """A mixin of dataclasses with arrays: equal fields, but for those with `compare=False`.

    Arrays can change, so there is no hash.
    """

    def __eq__(self, other: object) -> bool:
        """Whether the fields are equal, nan to nan."""
        if type(self) is not type(other):
            return NotImplemented
        names = [field.name for field in fields(cast("Any", self)) if field.compare]
        return all(same(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # pyright: ignore[reportAssignmentType]
