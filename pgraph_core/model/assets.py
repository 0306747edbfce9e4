"""Mesh files of a model: beside its file, so that the folder can go to another machine.

In memory a mesh has a whole path; in a file one from the model's folder on.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any

from ..errors import FileError, Problem

if TYPE_CHECKING:
    from .model import Model

FOLDER = "meshes"  # beside the model file


def located(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The fields of a model with whole paths for mesh files given from its folder on."""
    bodies = data.get("bodies")
    if not isinstance(bodies, list):
        return data
    return {**data, "bodies": [_located(body, folder) for body in bodies]}


def _located(body: Any, folder: Path) -> Any:
    shape = body.get("shape") if isinstance(body, Mapping) else None
    if not isinstance(shape, Mapping):
        return body
    file = shape.get("file")
    if not isinstance(file, str) or not file or _whole(file):
        return body
    return {**body, "shape": {**shape, "file": str((folder / file).absolute())}}


def _whole(file: str) -> bool:
    return PurePosixPath(file).is_absolute() or PureWindowsPath(file).is_absolute()


def gathered(model: Model, folder: Path) -> Model:
    """The model as its file in `folder` says it: meshes from there on, copied where they are not
    there yet. A mesh that cannot be found keeps its path. Raises FileError.
    """
    folder, known = folder.absolute(), {}
    rows = []
    for body in model.bodies:
        file = body.shape.file if body.shape is not None else None
        if body.shape is not None and file:
            known[file] = known.get(file) or _beside(Path(file), folder)
            body = body.model_copy(
                update={"shape": body.shape.model_copy(update={"file": known[file]})}
            )
        rows.append(body)
    return model.model_copy(update={"bodies": tuple(rows)}) if known else model


def _beside(file: Path, folder: Path) -> str:
    """The name of a mesh from the folder on."""
    try:
        if not file.is_file():
            return str(file)
        if file.absolute().is_relative_to(folder):
            return file.absolute().relative_to(folder).as_posix()
        (folder / FOLDER).mkdir(exist_ok=True)
        to = folder / FOLDER / file.name
        if to.exists() and _print(to) != _print(file):
            to = to.with_stem(f"{to.stem}-{_print(file)[:8]}")
        if not to.exists():
            shutil.copyfile(file, to)
        return to.relative_to(folder).as_posix()
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        text = f"cannot be copied to {folder / FOLDER}: {reason}; choose another place"
        raise FileError(Problem(f"mesh {file}", "", text)) from None


def _print(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
