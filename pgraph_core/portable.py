"""Pickles and copies of public objects, tagged with the version of Pgraph that wrote them."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.metadata import version
from typing import Any

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
