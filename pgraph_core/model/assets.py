"""Mesh files: which may be opened, how they are read, and how a saved model carries them.

A model file may come from anybody. So it names meshes inside its own folder only, a mesh is one by
content and not by name, and what `save` writes is the geometry that was parsed, never the file.
In memory a mesh has an absolute path; in a model file one relative to the model's folder.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FileError, ModelError, Problem, choices
from .sentences import shown

if TYPE_CHECKING:
    from .body import Body, Shape

FOLDER = "meshes"  # where a saved model keeps meshes from elsewhere, next to its file
FORMATS = ("glb", "obj", "off", "ply", "stl")
LARGEST = 200_000_000  # [bytes] of a mesh file
FARTHEST = 1e12  # a coordinate beyond this has no volume in float64
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}  # [m]
ALLOWED = "PGRAPH_MESHES"  # environment: more folders whose meshes a model may name

# -- reading a mesh ------------------------------------------------------------------------------


def load_mesh(file: str | Path, scale: float = 1.0, unit: str = "m") -> Any:
    """A mesh file as a trimesh.Trimesh in metres, its parts joined.

    `unit` is that of the file; `scale` comes on top. Raises FileError, ModelError.
    """
    if unit not in UNITS:
        text = f"must be one of {choices(UNITS)}; given {unit!r}"
        raise ModelError(Problem(f"mesh {file}", "unit", text))
    mesh = _parsed(file)
    try:
        mesh.apply_scale(scale * UNITS[unit])
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    except Exception as error:  # damaged faces may be found only here
        raise FileError(_unreadable(file, error)) from error
    return mesh


def _parsed(file: str | Path) -> Any:
    """The geometry in a file, as it stands there. Opens that one file and none that it names."""
    import trimesh  # not before a file is opened: half a second

    where, suffix = f"mesh {file}", Path(file).suffix.lower().lstrip(".")
    if not Path(file).is_file():  # nor a device or a pipe
        raise FileError(Problem(where, "", "there is no such file"))
    if suffix not in FORMATS:
        text = f"no mesh is read from .{suffix} files; give one of {choices(FORMATS)}"
        raise FileError(Problem(where, "", text))
    try:
        if Path(file).stat().st_size > LARGEST:
            text = f"is larger than {LARGEST / 1e6:.0f} MB; give a coarser mesh"
            raise FileError(Problem(where, "", text))
        content = Path(file).read_bytes()
    except OSError as error:
        raise FileError(_unreadable(file, error)) from error
    if not _looks_like(suffix, content):
        text = f"cannot be read as {suffix}: its content is no {suffix.upper()} mesh"
        raise FileError(Problem(where, "", text))
    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=suffix, resolver=None)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # whatever a reader of a damaged file raises
        raise FileError(_unreadable(file, error)) from error
    if len(faces) == 0:
        raise FileError(Problem(where, "", "holds no faces"))
    if faces.min() < 0 or faces.max() >= len(vertices):
        text = f"has faces of vertices that are not there; it has {len(vertices)} vertices"
        raise FileError(Problem(where, "", text))
    if not (np.abs(vertices) < FARTHEST).all():
        text = f"has coordinates that are not finite numbers below {FARTHEST:g}"
        raise FileError(Problem(where, "", text))
    return mesh


def _looks_like(suffix: str, content: bytes) -> bool:
    """Whether a file begins as its format does, so that no other file is parsed as a mesh."""
    match suffix:
        case "glb":
            return content[:4] == b"glTF"
        case "ply":
            return content[:3] == b"ply"
        case "off":
            return re.match(rb"(\s*#[^\n]*\n)*\s*(ST)?C?N?4?n?OFF\b", content) is not None
        case "stl":
            triangles = int.from_bytes(content[80:84], "little")
            ascii_text = content.lstrip()[:5].lower() == b"solid" and b"facet" in content
            return ascii_text or (len(content) >= 84 and len(content) >= 84 + 50 * triangles > 84)
    return bool(re.search(rb"^\s*v\s", content, re.M) and re.search(rb"^\s*f\s", content, re.M))


def _unreadable(file: str | Path, error: Exception) -> Problem:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    lines = (reason or type(error).__name__).splitlines()
    suffix = Path(file).suffix.lower().lstrip(".")
    return Problem(f"mesh {file}", "", f"cannot be read as {suffix}: {lines[0]}")


# -- meshes that a model file names ----------------------------------------------------------------


def located(
    data: dict[str, Any], folder: str | Path, roots: Iterable[str | Path] = ()
) -> dict[str, Any]:
    """The fields of a model with absolute paths of its meshes, which a file names from `folder` on.

    Raises ModelError for meshes outside of `folder`, `roots` and the folders in $PGRAPH_MESHES,
    also where `..` or a link leads out.
    """
    bodies = data.get("bodies")
    if not isinstance(bodies, list):
        return data
    folder = Path(folder).absolute()
    allowed = (folder, *map(Path, roots), *_allowed_always())
    problems: list[Problem] = []
    found = [_located(body, folder, allowed, problems) for body in bodies]
    if problems:
        raise ModelError(problems)
    return {**data, "bodies": found}


def _allowed_always() -> list[Path]:
    return [Path(each) for each in os.environ.get(ALLOWED, "").split(os.pathsep) if each]


def _located(body: Any, folder: Path, allowed: tuple[Path, ...], problems: list[Problem]) -> Any:
    if not isinstance(body, Mapping):
        return body
    where = f"body {shown(body.get('name', ''))}"

    def placed(shape: Any) -> Any:
        file = shape.get("file") if isinstance(shape, Mapping) else None
        if not isinstance(file, str) or not file:
            return shape
        try:
            path = folder / file
            inside = any(path.resolve().is_relative_to(each.resolve()) for each in allowed)
        except (OSError, ValueError, RuntimeError):  # a NUL, a circle of links
            inside, path = False, folder
        if not inside:
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
        f"into that folder, or allow its own: Model.load(path, roots=[...]) or {ALLOWED}"
    )


def mesh_files(bodies: Iterable[Body]) -> Iterator[tuple[str, str]]:
    """(name of the body, path) of each mesh."""
    for body in bodies:
        if body.shape is not None and body.shape.file:
            yield body.name, body.shape.file


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

    return tuple(
        body if body.shape is None or not body.shape.file
        else body.model_copy(update={"shape": carried(body, body.shape)})
        for body in bodies
    )  # fmt: skip


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
    mesh = _parsed(file)
    if file.suffix.lower() == ".stl":
        return to, mesh.export(file_type="stl")
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(mesh.vertices, float).tolist()]
    rows += [f"f {a} {b} {c}" for a, b, c in (np.asarray(mesh.faces) + 1).tolist()]
    return to.with_suffix(".obj"), ("\n".join(rows) + "\n").encode()
