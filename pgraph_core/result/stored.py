"""The file of a run (`.npz`). Arrays are read only if their sizes can match its model.

A file of some megabytes can unpack to gigabytes. The times are read while they ascend, and every
other array has at most as many numbers a frame as the model can have.
"""

from __future__ import annotations

import json
import math
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.lib import format as npy

from ..model.files import LARGEST
from ..packing import Array

CHUNK = 1 << 16  # [bytes] of times read at once
PER_BODY = 7 * 8  # [bytes] most that a body has in a frame of one array: the place of a free joint


def header_of(file: ZipFile) -> dict[str, Any]:
    """Return the header, which includes the model. Raises KeyError or ValueError."""
    return dict(json.loads(str(_array(file, "header", 4 * LARGEST))))


def arrays_of(file: ZipFile, bodies: int) -> dict[str, Array]:
    """Return the arrays by name. Raises KeyError or ValueError."""
    found = {"t": _times(file)}
    most = len(found["t"]) * PER_BODY * (bodies + 1)
    names = {entry.removesuffix(".npy") for entry in file.namelist()} - {"header", "t"}
    for name in names:  # events are not of frames
        found[name] = _array(file, name, LARGEST if "event" in name else most)
    return found


def _array(file: ZipFile, name: str, most: int) -> Array:
    if f"{name}.npy" not in file.namelist():
        raise KeyError(name)
    with file.open(f"{name}.npy") as entry:
        shape, kind = _head(entry)
        if math.prod(shape) * kind.itemsize > most:
            raise ValueError(f"{name} has more numbers than its model can have")
    with file.open(f"{name}.npy") as entry:
        return npy.read_array(entry, allow_pickle=False)


def _times(file: ZipFile) -> Array:
    """Return the times, reading only as far as they ascend."""
    parts = [np.full(1, -np.inf)]
    with file.open("t.npy") as entry:
        (count,), kind = _head(entry)
        while content := entry.read(CHUNK):
            parts.append(np.frombuffer(content, kind))
            if not (np.diff(parts[-1], prepend=parts[-2][-1]) > 0).all():
                raise ValueError("t does not ascend")
    found = np.concatenate(parts[1:]) if count else np.zeros(0)
    if found.shape != (count,):
        raise ValueError("t is cut short")
    return found


def _head(entry: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(entry)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, kind = read(entry)
    return shape, kind
