"""Mesh files: the formats and the limits, and how a file becomes geometry."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from .collada import triangles
from .errors import FileError, ModelError, Problem, choices

FORMATS = ("glb", "obj", "off", "ply", "stl", "dae", "msh")
LARGEST = 200_000_000  # [bytes] of a mesh file
FARTHEST = 1e12  # a coordinate beyond this has no volume in float64
Scale: TypeAlias = "float | tuple[float, float, float]"
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}  # [m]


def load_mesh(file: str | Path, scale: Scale = 1.0, unit: str = "m") -> Any:
    """A mesh file as a trimesh.Trimesh in metres, its parts joined.

    `unit` is that of the file; `scale` comes on top, one factor or one an axis.
    Raises FileError, ModelError.
    """
    if unit not in UNITS:
        text = f"must be one of {choices(UNITS)}; given {unit!r}"
        raise ModelError(Problem(f"mesh {file}", "unit", text))
    mesh = parsed_mesh(file)
    try:
        mesh.apply_scale(np.array(scale) * UNITS[unit])  # one that mirrors turns the faces too
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    except Exception as error:  # damaged faces may be found only here
        raise FileError(_unreadable(file, error)) from error
    return mesh


def parsed_mesh(file: str | Path) -> Any:
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
        if suffix == "msh":
            mesh = trimesh.Trimesh(*_msh(content), process=False)
        elif suffix == "dae":
            mesh = trimesh.Trimesh(*triangles(content, Path(file).name), process=False)
        else:
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
        case "dae":
            return b"<COLLADA" in content[:10_000]
        case "msh":
            return _sizes_of_msh(content) is not None
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


def _sizes_of_msh(content: bytes) -> tuple[int, int, int, int] | None:
    """Numbers of vertices, normals, texture places, faces of a mesh of MuJoCo; None: no such."""
    if len(content) < 16:
        return None
    points, normals, places, faces = np.frombuffer(content, "<i4", 4).tolist()
    size = 16 + 12 * points + 12 * normals + 8 * places + 12 * faces
    fits = size == len(content) and points > 0 and min(normals, places, faces) >= 0
    return (points, normals, places, faces) if fits else None


def _msh(content: bytes) -> tuple[Any, Any]:
    """(vertices, faces) of a binary mesh of MuJoCo."""
    points, normals, places, faces = _sizes_of_msh(content) or (0, 0, 0, 0)
    vertices = np.frombuffer(content, "<f4", 3 * points, 16).reshape(-1, 3)
    after = 16 + 12 * points + 12 * normals + 8 * places
    return vertices.astype(float), np.frombuffer(content, "<i4", 3 * faces, after).reshape(-1, 3)


def _unreadable(file: str | Path, error: Exception) -> Problem:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    lines = (reason or type(error).__name__).splitlines()
    suffix = Path(file).suffix.lower().lstrip(".")
    return Problem(f"mesh {file}", "", f"cannot be read as {suffix}: {lines[0]}")
