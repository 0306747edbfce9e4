"""Read and write model files by suffix: URDF, MJCF and our JSON."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, Problem, explained
from ..markup import ordinary
from ..model import Model
from ..model.files import FOREIGN
from .conversion import Report, nearest_inertia, why_unphysical
from .mjcf import read_mjcf
from .mjcf_out import write_mjcf
from .urdf import read_urdf
from .urdf_out import write_urdf
from .xacro import SUFFIX, no_arguments

FORMATS = {"urdf": (read_urdf, write_urdf), "mjcf": (read_mjcf, write_mjcf)}
READERS = {suffix: FORMATS[name][0] for suffix, name in FOREIGN.items()}
WRITERS = {suffix: FORMATS[name][1] for suffix, name in FOREIGN.items()}


@explained
def load(
    path: str | Path,
    /,
    *,
    roots: Iterable[str | Path] = (),
    arguments: Mapping[str, Any] | None = None,
) -> Model:
    """Load a model from a file in Pgraph JSON, URDF, xacro or MJCF format, chosen by its suffix.

    `notices` of the model list omissions and warnings. `pg.read_urdf` and `pg.read_mjcf` return the
    whole report.

    Parameters
    ----------
    path : path
        The file. Paths of meshes are relative to the folder of the file.
    roots : iterable of paths, optional
        Further folders in which meshes are permitted.
    arguments : dict, optional
        Arguments of a xacro file. Such a file is a program, so load it only if you trust it.

    Raises
    ------
    FileError
        If the file cannot be read.
    ModelError
        If the model is not valid.
    InputError
        If the suffix or an argument is unknown.
    """
    model, report = read_model(path, roots, arguments)
    return report.noted(model)


def read_model(
    path: str | Path, roots: Iterable[str | Path] = (), arguments: Mapping[str, Any] | None = None
) -> tuple[Model, Report]:
    """Read (model, report) from a file, by its suffix. Raises FileError, ModelError or InputError.

    URDF and MJCF are both XML, and many files have the suffix of the other: the first element of
    the file decides between them.
    """
    suffix = Path(path).suffix.lower()
    if suffix == SUFFIX:
        return read_urdf(path, roots, arguments=arguments)
    if arguments:
        raise no_arguments(Path(path))
    if suffix == ".npz":
        raise FileError(Problem(Path(path).name, "", "holds a run; give it to pg.Result.load"))
    if reader := READERS.get(suffix):
        return _by_root(path, reader)(path, roots)
    model, report = Model.load(path, roots=roots), Report(Path(path).name)
    for body in model.bodies:
        inertia = np.array(body.inertia)
        if body.any_inertia and why_unphysical(inertia):
            report.repairs[body.name] = nearest_inertia(inertia)
    return model, report


def write_model(model: Model, path: str | Path) -> Report:
    """Write a model in the format given by the suffix. Raises FileError or ModelError."""
    suffix = Path(path).suffix.lower()
    if writer := WRITERS.get(suffix):
        return writer(model, path)
    if suffix != ".json":
        known = ", ".join((".json", *WRITERS))
        text = f"no model is written to {suffix or 'files without a suffix'}; give one of {known}"
        raise FileError(Problem(str(path), "", text))
    model.save(path)
    return Report(Path(path).name)


ROOTS = {b"robot": read_urdf, b"mujoco": read_mjcf}  # first element -> reader
FIRST = re.compile(rb"<([A-Za-z_][\w:.-]*)")
HEAD = 65536  # bytes of a file in which its first element stands


def first_element(head: bytes) -> bytes:
    """Return the name of the first element at the start of an XML file, or b""."""
    found = FIRST.search(re.sub(rb"<!--.*?-->", b"", head[:HEAD], flags=re.DOTALL))
    return found[1] if found else b""


def _by_root(path: str | Path, otherwise: Any) -> Any:
    """Return the reader for the first element of an XML file, or `otherwise` if there is none."""
    try:
        with ordinary(path) as file:
            return ROOTS.get(first_element(file.read(HEAD)), otherwise)
    except (OSError, ValueError):
        return otherwise  # whose reader reports why the file cannot be read
