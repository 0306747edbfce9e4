"""A model in the C library, called by ctypes."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest

from pgraph_core.native import library
from pgraph_core.native.image import Exported, Wanted

NUMBER, SIZE, TEXT, PLACE, INT = (
    ctypes.c_double,
    ctypes.c_size_t,
    ctypes.c_char_p,
    ctypes.c_void_p,
    ctypes.c_int,
)
CALLS: dict[str, tuple[Any, ...]] = {
    "size": (SIZE, PLACE, SIZE, ctypes.POINTER(TEXT)),
    "create": (PLACE, PLACE, SIZE, PLACE),
    "start": (INT, PLACE, NUMBER),
    "first_time": (NUMBER, PLACE),
    "step": (INT, PLACE, ctypes.c_int64),
    "advance": (INT, PLACE, NUMBER),
    "time": (NUMBER, PLACE),
    "q": (ctypes.POINTER(NUMBER), PLACE, ctypes.POINTER(SIZE)),
    "v": (ctypes.POINTER(NUMBER), PLACE, ctypes.POINTER(SIZE)),
    "count": (INT, PLACE),
    "find": (INT, PLACE, TEXT),
    "name": (TEXT, PLACE, INT),
    "get": (INT, PLACE, INT, ctypes.POINTER(NUMBER)),
    "set": (INT, PLACE, INT, NUMBER),
    "state_size": (SIZE, PLACE),
    "save": (None, PLACE, PLACE),
    "restore": (INT, PLACE, PLACE),
    "message": (TEXT, PLACE),
}
has_library = pytest.mark.skipif(
    not library.here() or bool(library.stale(library.here())),
    reason="this platform has no library",
)


@cache
def loaded() -> Any:
    """Return the library of this platform."""
    here = library.here()
    path = Path(mkdtemp(), library.PLATFORMS[here].file)
    path.write_bytes(library.library(here))
    found = ctypes.CDLL(str(path))
    for name, (result, *arguments) in CALLS.items():
        function = getattr(found, f"pgraph_{name}")
        function.restype, function.argtypes = result, arguments
    return found


class Instance:
    """An instance of a model. Calls raise ValueError with its message."""

    def __init__(self, content: bytes):
        self._call = loaded()
        self._model = np.zeros(len(content) // 8 + 1, np.int64)
        self._model.view(np.uint8)[: len(content)] = np.frombuffer(content, np.uint8)
        why, place = TEXT(), self._model.ctypes.data
        needed = self._call.pgraph_size(place, len(content), why)
        if not needed:
            raise ValueError((why.value or b"").decode())
        self._memory = np.zeros(needed + 64, np.uint8)
        at = self._memory.ctypes.data
        self._p = self._call.pgraph_create(place, len(content), at + (64 - at % 64))
        assert self._p

    def call(self, name: str, *args: Any) -> None:
        """Call a function that returns 0 or -1."""
        if getattr(self._call, f"pgraph_{name}")(self._p, *args):
            raise ValueError(self._call.pgraph_message(self._p).decode())

    def start(self, t: float | None = None) -> Instance:
        """Start at t, by default at the model's own start."""
        self.call("start", self._call.pgraph_first_time(self._p) if t is None else t)
        return self

    @property
    def t(self) -> float:
        """The time [s]."""
        return self._call.pgraph_time(self._p)

    @property
    def state(self) -> Any:
        """Coordinates and velocities."""
        parts = []
        for name in "qv":
            count = SIZE()
            place = getattr(self._call, f"pgraph_{name}")(self._p, count)
            parts.append(np.array(place[: count.value]))
        return np.concatenate(parts)

    def _number(self, name: str) -> int:
        return self._call.pgraph_find(self._p, name.encode())

    def __getitem__(self, name: str) -> float:
        found = NUMBER()
        self.call("get", self._number(name), found)
        return found.value

    def __setitem__(self, name: str, value: float) -> None:
        self.call("set", self._number(name), value)

    def save(self) -> Any:
        """Return the complete state as bytes."""
        state = np.zeros(self._call.pgraph_state_size(self._p), np.uint8)
        self._call.pgraph_save(self._p, state.ctypes.data)
        return state

    def restore(self, state: Any) -> None:
        """Go back to a state of an instance of this model."""
        self.call("restore", state.ctypes.data)


def instance(model: Any, **wanted: Any) -> Instance:
    """Return an instance of a model."""
    return Instance(Exported(model, Wanted(**wanted)).content())
