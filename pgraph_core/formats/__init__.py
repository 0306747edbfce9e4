"""Read and write model files by suffix: URDF, MJCF, OpenSim, STEP and our JSON."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..errors import FileError, InputError, Problem, explained, shown
from ..file_kinds import HEAD, first_element, is_json, is_step
from ..markup import ordinary
from ..model import Model
from ..model.files import FOREIGN, refuse_kind
from ..model.links import is_link, linked
from .conversion import Report, nearest_inertia, why_unphysical
from .mjcf import read_mjcf
from .mjcf_out import write_mjcf
from .osim import read_osim
from .step import read_step
from .urdf import read_urdf
from .urdf_out import write_urdf
from .xacro import SUFFIX, no_arguments


def _read_step(path: str | Path, roots: Any = ()) -> tuple[Model, Report]:
    """Read the parts of a STEP file, which names no other files, and take no joint."""
    return read_step(path)


FORMATS: dict[str, tuple[Any, Any]] = {  # name -> reader, and writer if there is one
    "urdf": (read_urdf, write_urdf),
    "mjcf": (read_mjcf, write_mjcf),
    "osim": (read_osim, None),
    "step": (_read_step, None),
}
READERS = {suffix: FORMATS[name][0] for suffix, name in FOREIGN.items()}
WRITERS = {suffix: FORMATS[name][1] for suffix, name in FOREIGN.items() if FORMATS[name][1]}
# suffix of a file that is saved -> name of its format
SAVED = {
    next(x for x, of in FOREIGN.items() if of == name): name.upper()
    for name, (_, writer) in FORMATS.items()
    if writer
}


@explained
def load(
    path: str | Path,
    /,
    *,
    roots: str | Path | Iterable[str | Path] = (),
    base: Literal["fixed", "free"] = "fixed",
    arguments: Mapping[str, Any] | None = None,
) -> Model:
    """Load a file of Pgraph, URDF, xacro, MJCF, OpenSim or STEP, a built-in model, or a link.

    Omissions and warnings are stored in `notices` of the model. To obtain the full report, use
    `pg.read_urdf`, `pg.read_mjcf`, `pg.read_osim` or `pg.read_step`.

    Parameters
    ----------
    path : path
        The file, the name of a built-in model, or a link by `pg.link`. Mesh paths are relative to
        the folder of the file.
    roots : path or iterable of paths, optional
        Additional folders from which meshes may be loaded.
    base : {"fixed", "free"}
        Whether the root link of a URDF file is welded to the ground or free.
    arguments : dict, optional
        Arguments of a xacro file. Since xacro files can execute code, only load files that you
        trust.

    Raises
    ------
    FileError
        If the file cannot be read.
    ModelError
        If the model is not valid.
    InputError
        If the suffix or an argument is unknown.
    """
    roots = [roots] if isinstance(roots, (str, Path)) else [*roots]
    for root in roots:
        if not Path(root).is_dir():
            raise InputError(Problem("load", "roots", f"no folder is named {shown(root)}"))
    model, report = read_model(path, roots, arguments, base)
    return report.noted(model)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Suspend garbage collection inside the context.

    A model is built of many objects and leaves no cycles behind. The search for them takes a third
    of the time of reading a model of 1600 bodies.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@_uncollected()
def read_model(
    path: str | Path,
    roots: Iterable[str | Path] = (),
    arguments: Mapping[str, Any] | None = None,
    base: Literal["fixed", "free"] = "fixed",
) -> tuple[Model, Report]:
    """Read (model, report) from a file, by its suffix. Raises FileError, ModelError or InputError.

    URDF and MJCF are both XML, and many files have the suffix of the other: the first element of
    the file decides between them.
    """
    if is_link(path):
        return linked(str(path)), Report("link")
    suffix = Path(path).suffix.lower()
    if suffix == SUFFIX:
        return read_urdf(path, roots, arguments=arguments, base=base)
    if arguments:
        raise no_arguments(Path(path))
    reader = reader_of(path)
    if reader == read_urdf:
        return read_urdf(path, roots, base=base)
    if base != "fixed":
        text = "is for URDF files; of others write model = pg.load(path).edit(NAME, joint='free')"
        raise InputError(Problem("load", "base", text))
    if reader:
        return reader(path, roots)
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


ROOTS = {
    "robot": read_urdf,
    "mujoco": read_mjcf,
    "OpenSimDocument": read_osim,
}  # first element -> reader


def reader_of(path: str | Path) -> Any:
    """Return the reader for a file of another format, by its first element and then its suffix.

    Raises FileError if the file is not a supported model.
    """
    by_suffix = READERS.get(Path(path).suffix.lower())
    try:
        with ordinary(path) as file:
            head = file.read(HEAD)
    except (OSError, ValueError):
        return by_suffix  # its reader reports why the file cannot be read
    if is_step(head):
        return _read_step
    refuse_kind(path, head)
    if is_json(head):
        return None  # a model of Pgraph, whatever its name
    return ROOTS.get(first_element(head), by_suffix)
