"""Mesh files of a model: which may be opened, and how a saved model carries them.

A model file may come from anybody. So it names meshes inside its own folder only, a mesh is one by
content and not by name, and what `save` writes is the geometry that was parsed, never the file.
In memory a mesh has an absolute path; in a model file one relative to the model's folder.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, ModelError, Problem, shown
from ..mesh_files import parsed_mesh
from .body import Body
from .shape import Shape

FOLDER = "meshes"  # where a saved model keeps meshes from elsewhere, next to its file
ALLOWED = "PGRAPH_MESHES"  # environment: more folders whose meshes a model may name

# -- meshes that a model file names ----------------------------------------------------------------


def located(
    data: dict[str, Any], folder: str | Path | None, roots: Iterable[str | Path] = ()
) -> dict[str, Any]:
    """The fields of a model with absolute paths of its meshes, which a file names from `folder` on.

    Without a folder, names count from the current one on and stay as they are. Raises ModelError
    for meshes outside of the folder, `roots` and the folders in $PGRAPH_MESHES, also where `..` or
    a link leads out.
    """
    bodies = data.get("bodies")
    if not isinstance(bodies, list):
        return data
    start = Path(folder or "").absolute()
    allowed = (start, *map(Path, roots), *_allowed_always())
    problems: list[Problem] = []
    found = [_located(body, start, allowed, problems) for body in bodies]
    if problems:
        raise ModelError(problems)
    return data if folder is None else {**data, "bodies": found}


def _allowed_always() -> list[Path]:
    return [Path(each) for each in os.environ.get(ALLOWED, "").split(os.pathsep) if each]


def _located(body: Any, folder: Path, allowed: tuple[Path, ...], problems: list[Problem]) -> Any:
    if not isinstance(body, dict):
        return body

    def placed(shape: Any) -> Any:
        file = shape.get("file") if isinstance(shape, dict) else None
        if not isinstance(file, str) or not file:
            return shape
        try:
            path = folder / file
            inside = any(path.resolve().is_relative_to(each.resolve()) for each in allowed)
        except (OSError, ValueError, RuntimeError):  # a NUL, a circle of links
            inside, path = False, folder
        if not inside:
            where = f"body {shown(body.get('name', ''))}"
            problems.append(Problem(where, "shape", _outside(file, folder)))
        return {**shape, "file": str(path)}

    changed = dict(body)
    if "shape" in body:
        changed["shape"] = placed(body["shape"])
    if isinstance(shapes := body.get("shapes"), list):
        changed["shapes"] = [placed(shape) for shape in shapes]
    return changed


def _outside(file: str, folder: Path) -> str:
    return (
        f"the mesh file {shown(file, 200)} lies outside of the model's folder {folder}; copy it "
        f"into that folder, or allow its own: roots=[...] or the environment variable {ALLOWED}"
    )


# -- saving ----------------------------------------------------------------------------------------


def gathered(bodies: Iterable[Body], folder: Path) -> tuple[Body, ...]:
    """The bodies as a model file in `folder` holds them: meshes relative to it.

    The geometry of a mesh from elsewhere is written to `meshes` in it. One that is missing keeps
    its name there. Raises FileError for a file that is no mesh, by the body's name.
    """
    folder, known = folder.absolute(), {}

    def carried(body: Body, shape: Shape) -> Shape:
        if not shape.file:
            return shape
        if shape.file not in known:
            known[shape.file] = _carried(body.name, Path(shape.file), folder)
        return shape.model_copy(update={"file": known[shape.file]})

    def saved(body: Body) -> Body:
        if not any(shape.file for shape in body.shapes):
            return body
        shapes = tuple(carried(body, shape) for shape in body.shapes)
        return body.model_copy(update={"shapes": shapes})

    return tuple(map(saved, bodies))


def _carried(body: str, file: Path, folder: Path) -> str:
    """The path of a mesh relative to `folder`, in which its geometry is from now on."""
    try:
        inside = file.resolve().is_relative_to(folder.resolve())
        if inside and file.absolute().is_relative_to(folder):
            return file.absolute().relative_to(folder).as_posix()
        if inside:
            return file.resolve().relative_to(folder.resolve()).as_posix()
        to = folder / FOLDER / file.name
        if not file.is_file():
            return to.relative_to(folder).as_posix()
        to, content = _geometry(file, to)
        (folder / FOLDER).mkdir(exist_ok=True)
        if to.exists() and to.read_bytes() != content:
            to = to.with_stem(f"{to.stem}-{hashlib.sha256(content).hexdigest()[:8]}")
        if not to.exists():
            to.write_bytes(content)
        return to.relative_to(folder).as_posix()
    except FileError as error:
        do = "give the body another shape, or none"
        found = [Problem(f"body {shown(body)}", "shape", f"{p}; {do}") for p in error.problems]
        raise FileError(found) from None
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        text = f"cannot be copied to {folder / FOLDER}: {reason}; choose another place"
        raise FileError(Problem(f"mesh {file}", "", text)) from None


def _geometry(file: Path, to: Path) -> tuple[Path, bytes]:
    """Where a copy of a mesh goes, and its content: vertices and faces, nothing else of the file.

    STL stays STL; other formats become OBJ, which loses no digit.
    """
    mesh = parsed_mesh(file)
    if file.suffix.lower() == ".stl":
        return to, mesh.export(file_type="stl")
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(mesh.vertices, float).tolist()]
    rows += [f"f {a} {b} {c}" for a, b, c in (np.asarray(mesh.faces) + 1).tolist()]
    return to.with_suffix(".obj"), ("\n".join(rows) + "\n").encode()
