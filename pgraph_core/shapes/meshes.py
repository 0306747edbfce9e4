"""Mesh: a file, which touches by its convex hull or by several convex parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ModelError, PgraphError, Problem, needed
from ..mesh_files import Scale, load_mesh
from .contract import Element, Form, Kind, Picture, Piece, Size, Volume
from .hulls import hull
from .solid import Array, Solid

MUJOCO = (".stl", ".obj")  # files that MuJoCo reads as we do
MOST_HULLS = 64
HULL_CORNERS = 32  # limit on the corners of a part


class Mesh(Kind, Picture):
    name = "mesh"
    needs = ("file",)
    cells = ("scale",)
    elsewhere = "meshes are read from files: use 'Mesh file ...'"

    def mirrored(self, shape: Any, plane: int) -> dict[str, Any]:
        return {"scale": tuple(-x if k == plane else x for k, x in enumerate(scales(shape)))}

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        mesh = load_mesh(shape.file, shape.scale, unit)
        if reason := leak(mesh):
            do = "repair the file, or give the body its own mass, com and inertia"
            raise ModelError(Problem(f"mesh {shape.file}", "", f"{reason}; {do}"))
        mesh.density = 1.0
        found = mesh.mass_properties
        sign = math.copysign(1.0, found.volume)  # all faces may be inside out
        return sign * found.volume, np.array(found.center_mass), sign * np.array(found.inertia)

    def corners(self, shape: Any) -> Array:
        return np.asarray(load_mesh(shape.file, shape.scale).vertices)

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        if shape.hull == "parts":
            return convex_parts(shape.file, shape.scale)
        return (convex_hull(shape.file, shape.scale, closed=shape.hull is None),)

    def excess(self, shape: Any) -> float:
        return hull_excess(shape.file, shape.scale) if shape.hull is None else 1.0

    def urdf(self, shape: Any, drawn: bool) -> Sequence[Element]:
        return (Element("mesh", {"filename": shape.file, "scale": scales(shape)}),)

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]] | None:
        return ("mesh", ()) if Path(shape.file).suffix.lower() in MUJOCO else None

    def form(self, shape: Any) -> Form:
        return Form("mesh", scales(shape), shape.file)

    def drawn(self, piece: Piece, many: bool = False) -> Any:
        solid = opened(piece.file)
        solid.apply_scale(piece.size)
        return solid

    def bounds(self, piece: Piece) -> Array:
        return np.sort(np.asarray(opened(piece.file).bounds) * np.asarray(piece.size), axis=0)


def scales(shape: Any) -> Size:
    """Return the factors of a mesh along its three axes."""
    x, y, z = shape.scale if isinstance(shape.scale, tuple) else (shape.scale,) * 3
    return x, y, z


def convex_hull(
    file: str | Path, scale: Scale = 1.0, unit: str = "m", *, closed: bool = False
) -> Solid:
    """Return the convex hull of a mesh file for collisions.

    Raises FileError, ModelError, also for a mesh that is not closed if `closed` is required.
    """
    mesh = load_mesh(file, scale, unit)
    vertices = np.asarray(mesh.vertices)
    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or spread[2] <= 1e-9 * spread[0]:
        text = "is flat: a shape with contact must have a volume; give a box, or a solid mesh"
        raise ModelError(Problem(f"mesh {file}", "", text))
    if closed:
        _refuse_open(mesh, file)
    return hull(vertices)


def _refuse_open(mesh: Any, file: str | Path) -> None:
    if not mesh.is_watertight:
        do = "give a closed mesh, or hull 'convex' to let its convex hull touch"
        raise ModelError(Problem(f"mesh {file}", "", f"{leak(mesh)}; {do}"))


def leak(mesh: Any) -> str:
    """Return the reason why a mesh has no volume, or ""."""
    if mesh.is_watertight and mesh.is_winding_consistent:
        return ""
    edges = np.sort(mesh.edges, axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    open_edges = int((counts != 2).sum())
    if open_edges:
        return f"is not closed: {open_edges} of its edges do not have two faces"
    return "has faces with inconsistent winding"


def hull_excess(file: str | Path, scale: Scale = 1.0) -> float:
    """Return the ratio of a closed mesh's convex hull volume to its own. Raises FileError,
    ModelError.

    The result is cached until the file changes.
    """
    return _hull_excess(str(file), scale, _changed(file))


@lru_cache(maxsize=256)
def _hull_excess(file: str, scale: Scale, changed: int) -> float:
    mesh = load_mesh(file, scale)
    return float(mesh.convex_hull.volume / abs(mesh.volume))


def convex_parts(file: str | Path, scale: Scale = 1.0) -> tuple[Solid, ...]:
    """Split a closed mesh into approximate convex parts, using CoACD [Wei et al. 2022].

    The result is cached until the file changes. Raises FileError, MissingPackage, and ModelError
    for a mesh that is not closed or has more than 64 parts.
    """
    return _convex_parts(str(file), scale, _changed(file))


@lru_cache(maxsize=64)
def _convex_parts(file: str, scale: Scale, changed: int) -> tuple[Solid, ...]:
    mesh = load_mesh(file, scale)
    _refuse_open(mesh, file)
    coacd = needed("coacd", "meshes")
    coacd.set_log_level("error")
    given = coacd.Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    parts = coacd.run_coacd(given, seed=0, decimate=True, max_ch_vertex=HULL_CORNERS)
    if len(parts) > MOST_HULLS:
        text = f"splits into {len(parts)} convex parts, more than {MOST_HULLS}"
        do = "simplify the mesh, use simple shapes, or hull 'convex'"
        raise ModelError(Problem(f"mesh {file}", "", f"{text}; {do}"))
    return tuple(hull(np.unique(vertices, axis=0)) for vertices, _ in parts)


# -- files that are drawn --------------------------------------------------------------------------


def opened(name: str) -> Any:
    """Return the mesh in a file, or a 0.1 m box as a visible placeholder."""
    found = _read(name, _changed(name))
    if isinstance(found, str):
        return needed("trimesh").creation.box(extents=(0.1, 0.1, 0.1))
    return found.copy()


def fault_of(name: str) -> str:
    """Return the reason why a mesh file cannot be read, or ""."""
    found = _read(name, _changed(name))
    return found if isinstance(found, str) else ""


@lru_cache(maxsize=64)
def _read(name: str, changed: int) -> Any:
    """Return the mesh in a file as last modified at time `changed`, or the error message."""
    try:
        return load_mesh(name)
    except PgraphError as error:
        return str(error)


def _changed(name: str | Path) -> int:
    """Return the modification time of a file [ns], or 0 if there is no file."""
    try:
        return Path(name).stat().st_mtime_ns
    except (OSError, ValueError):
        return 0
