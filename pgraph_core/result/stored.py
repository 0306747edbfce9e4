"""The file of a run (`.npz`). Arrays are read only if their sizes can match its model.

A file of some megabytes can unpack to gigabytes. The times are read while they ascend, and every
other array has at most as many numbers a frame as the model can have.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.lib import format as npy

from ..model import Model
from ..model.files import LARGEST, gathered
from ..packing import Array
from .records import (
    OF_CONSTRAINTS,
    ContactRecord,
    Derivatives,
    Named,
    event_arrays,
    events_of_arrays,
)

CHUNK = 1 << 16  # [bytes] block size for reading times
PER_BODY = 7 * 8  # [bytes] most that a body has in a frame of one array: the place of a free joint
ARRAYS = (
    "t", "q", "v", "vdot", "kinetic_energy", "potential_energy", "work", "dissipation",
    "constraint_drift", "error_at", "states", "state_error_at",
)  # fmt: skip
SCALARS = ("message", "counters", "timing", "header", "notices")
FORCE, DERIVATIVE = "force:", "derivative:"  # before the names of constraints and paths


def file_of(run: Any, folder: Path) -> bytes:
    """Return the file of a run. Meshes from elsewhere are copied to the folder if it exists."""
    model = run.mechanism.model
    if folder.is_dir():
        model = model.unchecked_copy({"bodies": gathered(model.bodies, folder)})
    arrays = {name: getattr(run, name) for name in ARRAYS}
    arrays |= {FORCE + name: value for name, value in run.constraint_force.items()}
    arrays |= {DERIVATIVE + path: value for path, value in run.derivatives.items()}
    arrays |= run.contacts.arrays() | event_arrays(run.user_events)
    header = {
        "status": run.status.name,
        **{name: getattr(run, name) for name in SCALARS},
        "model": json.loads(model.to_json()),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, header=np.array(json.dumps(header)), **arrays)
    return buffer.getvalue()


def fields_of(file: ZipFile, path: str | Path, roots: Iterable[str | Path]) -> dict[str, Any]:
    """Return the fields of a run, with the name of its status.

    Raises KeyError, TypeError, ValueError or FileError.
    """
    from ..mechanism import Mechanism

    header = header_of(file)
    description, folder = json.dumps(header.pop("model")), Path(path).parent
    model = Model.from_json(description, source=str(path), folder=folder, roots=roots)
    arrays = arrays_of(file, len(model.bodies) + len(model.controls))
    n = len(arrays["t"])
    arrays.setdefault("states", np.zeros((n, 0)))  # older files have none
    arrays.setdefault("state_error_at", np.full((n, arrays["states"].shape[1]), np.nan))
    found = {name: header[name] for name in SCALARS} | {name: arrays[name] for name in ARRAYS}
    forces, derivatives = (
        {k.removeprefix(prefix): a for k, a in arrays.items() if k.startswith(prefix)}
        for prefix in (FORCE, DERIVATIVE)
    )
    mech = Mechanism(model)
    fits = found["q"].shape[1:] == (mech.nq,) and found["v"].shape[1:] == (mech.nv,)
    if not fits or len({len(found[name]) for name in ARRAYS}) != 1:
        raise ValueError("arrays of different lengths")
    shape = len(found["t"]), mech.nq + mech.nv + 2 + 2 * found["states"].shape[1]
    if any(x.shape != shape for x in derivatives.values()):
        raise ValueError("derivatives of another shape")
    return {
        **found,
        "mechanism": mech,
        "status": header["status"],
        "notices": tuple(found["notices"]),
        "constraint_force": Named(forces, *OF_CONSTRAINTS),
        "contacts": ContactRecord.of_arrays(arrays),
        "user_events": events_of_arrays(arrays),
        "derivatives": Derivatives(derivatives),
    }


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
