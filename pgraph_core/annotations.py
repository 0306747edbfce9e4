"""Checks of values against the annotations of parameters."""

from __future__ import annotations

import collections.abc
import math
import os
import types
import typing
from numbers import Integral, Real
from pathlib import Path
from typing import Any


def fits(value: Any, wanted: Any) -> bool:
    """Check whether a value matches an annotation, as far as this can be checked."""
    origin, inner = typing.get_origin(wanted), typing.get_args(wanted)
    if wanted is Any:
        return True
    if origin in (typing.Union, types.UnionType):
        return any(fits(value, each) for each in inner)
    if origin is typing.Annotated:
        return fits(value, inner[0])
    if origin is typing.Literal:
        return isinstance(value, str) and value in inner
    if wanted is None or wanted is type(None):
        return value is None
    if wanted is bool:
        return isinstance(value, bool) or type(value).__name__ == "bool"
    if wanted in (int, float):
        number = isinstance(value, Integral if wanted is int else Real)
        return number and not isinstance(value, bool) and math.isfinite(value)
    if wanted is Path:
        return isinstance(value, os.PathLike)
    kind = origin or wanted
    if not isinstance(kind, type):
        return True
    if kind.__name__ == "ndarray":
        return _numeric(value)
    if kind is collections.abc.Callable:
        return callable(value)
    if issubclass(kind, (tuple, collections.abc.Iterable)) and origin is not None:
        return _inside(value, kind, inner)
    return isinstance(value, kind)


def _inside(value: Any, kind: type, inner: tuple[Any, ...]) -> bool:
    """Check whether a container and its values match an annotation."""
    if issubclass(kind, collections.abc.Mapping):
        if not isinstance(value, collections.abc.Mapping):
            return False
        key, held = inner
        return all(fits(k, key) and fits(x, held) for k, x in value.items())
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, (str, bytes, collections.abc.Mapping)):
        return False
    whole = kind is not tuple or inner[1:] == (...,)
    if not isinstance(value, (list, tuple)) or not whole:
        return isinstance(value, collections.abc.Iterable)
    return all(fits(x, inner[0]) for x in value)


def _numeric(value: Any) -> bool:
    import numpy as np

    try:
        return np.asarray(value).dtype.kind in "fiu" or np.size(value) == 0
    except (TypeError, ValueError):
        return False
