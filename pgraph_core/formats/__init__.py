"""Model files of other programs, in and out: URDF and MJCF; with JSON of our own, by suffix."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..errors import FileError, Problem
from ..model import Model
from ..model.files import FOREIGN
from .conversion import Report, nearest_inertia, why_unphysical
from .mjcf import read_mjcf
from .mjcf_out import write_mjcf
from .urdf import read_urdf
from .urdf_out import write_urdf

FORMATS = {"urdf": (read_urdf, write_urdf), "mjcf": (read_mjcf, write_mjcf)}
READERS = {suffix: FORMATS[name][0] for suffix, name in FOREIGN.items()}
WRITERS = {suffix: FORMATS[name][1] for suffix, name in FOREIGN.items()}


def read_model(path: str | Path, roots: Iterable[str | Path] = ()) -> tuple[Model, Report]:
    """(model, report) of a file, by its suffix. Raises FileError or ModelError."""
    suffix = Path(path).suffix.lower()
    if reader := READERS.get(suffix):
        return reader(path, roots)
    model, report = Model.load(path, roots=roots), Report(Path(path).name)
    for body in model.bodies:
        inertia = np.array(body.inertia)
        if body.any_inertia and why_unphysical(inertia):
            report.repairs[body.name] = nearest_inertia(inertia)
    return model, report


def write_model(model: Model, path: str | Path) -> Report:
    """Write a model in the format of the suffix. Raises FileError or ModelError."""
    suffix = Path(path).suffix.lower()
    if writer := WRITERS.get(suffix):
        return writer(model, path)
    if suffix != ".json":
        known = ", ".join((".json", *WRITERS))
        text = f"no model is written to {suffix or 'files without a suffix'}; give one of {known}"
        raise FileError(Problem(str(path), "", text))
    model.save(path)
    return Report(Path(path).name)
