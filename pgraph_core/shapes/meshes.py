"""Solids of shapes. trimesh is imported only where a mesh file is opened."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import ModelError, Problem
from ..mesh_files import load_mesh
from ..model import Shape
from ..model.shape import MassProperties as MassProperties
from ..model.shape import leak as _leak
from ..model.shape import mass_properties as mass_properties
from . import solids
from .solids import Solid

Array = np.ndarray


def solid_of(shape: Shape, unit: str = "m") -> Solid:
    """A shape as it touches others, in its own frame. Raises FileError, ModelError."""
    match shape.kind:
        case "box":
            return solids.box(shape.size or ())
        case "sphere":
            return solids.sphere(shape.radius or 0.0)
        case "cylinder":
            return solids.cylinder(shape.radius or 0.0, shape.length or 0.0)
        case "capsule":
            return solids.capsule(shape.radius or 0.0, shape.length or 0.0)
        case _:
            return convex_hull(shape.file or "", shape.scale, unit, closed=shape.hull is None)


def convex_hull(
    file: str | Path, scale: float = 1.0, unit: str = "m", *, closed: bool = False
) -> Solid:
    """The convex hull of a mesh file, as it touches other bodies.

    Raises FileError, ModelError, also for a mesh that is not `closed` where it has to be.
    """
    mesh = load_mesh(file, scale, unit)
    vertices = np.asarray(mesh.vertices)
    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or spread[2] <= 1e-9 * spread[0]:
        text = "is flat: a shape that touches must span a volume; give a box, or a solid mesh"
        raise ModelError(Problem(f"mesh {file}", "", text))
    if closed and not mesh.is_watertight:
        do = "give a closed mesh, or hull 'convex' to let its convex hull touch"
        raise ModelError(Problem(f"mesh {file}", "", f"{_leak(mesh)}; {do}"))
    return solids.hull(vertices)
