"""Mass properties and solids of shapes. trimesh is imported only where a mesh file is opened."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import ModelError, Problem
from ..mesh_files import load_mesh
from ..model import Shape
from ..rotation import matrix
from . import solids
from .solids import Solid

Array = np.ndarray


class MassProperties(NamedTuple):
    """Of a rigid body, in its own frame."""

    mass: float  # [kg]
    com: Array  # (3,) [m]
    inertia: Array  # (3, 3) about the centre of mass, in body axes [kg m^2]


def mass_properties(shape: Shape, density: float, unit: str = "m") -> MassProperties:
    """Of a body that fills its shape evenly; `density` [kg/m^3].

    A mesh must be closed; `unit` is that of its file. Raises ModelError, FileError.
    """
    if not 0 < density < math.inf:
        raise ModelError(
            Problem("shape", "density", f"must be a number > 0 [kg/m^3]; given {density}")
        )
    volume, middle, second = _volume(shape, unit)
    turn = matrix(shape.rotation)
    com = np.array(shape.position) + turn @ middle
    return MassProperties(density * volume, com, density * turn @ second @ turn.T)


def _volume(shape: Shape, unit: str) -> tuple[float, Array, Array]:
    """Volume, its centre, and its inertia about that at density 1, in the shape's frame."""
    if shape.kind == "mesh":
        return _mesh_volume(shape, unit)
    r, h = shape.radius or 0.0, shape.length or 0.0
    if shape.kind == "box":
        x, y, z = shape.size or (0.0, 0.0, 0.0)
        volume = x * y * z
        moments = volume / 12 * np.array((y * y + z * z, x * x + z * z, x * x + y * y))
    elif shape.kind == "sphere":
        volume = 4 / 3 * math.pi * r**3
        moments = volume * 0.4 * r * r * np.ones(3)
    else:
        middle = math.pi * r * r * h
        caps = 4 / 3 * math.pi * r**3 if shape.kind == "capsule" else 0.0
        volume = middle + caps
        about = caps * 0.4 * r * r + middle * r * r / 2
        across = middle * (h * h / 12 + r * r / 4)
        # a cap's centre is 3r/8 beyond the end of the cylinder
        across += caps * (0.4 * r * r + h * h / 4 + 3 * h * r / 8)
        moments = np.array((across, across, about))
    return volume, np.zeros(3), np.diag(moments)


def _mesh_volume(shape: Shape, unit: str) -> tuple[float, Array, Array]:
    mesh = load_mesh(shape.file or "", shape.scale, unit)
    if leak := _leak(mesh):
        do = "mend the file, or give the body mass, com and inertia of its own"
        raise ModelError(Problem(f"mesh {shape.file}", "", f"{leak}; {do}"))
    mesh.density = 1.0
    found = mesh.mass_properties
    sign = math.copysign(1.0, found.volume)  # all faces may be inside out
    return sign * found.volume, np.array(found.center_mass), sign * np.array(found.inertia)


def _leak(mesh: Any) -> str:
    """Why a mesh has no volume; "" where it has one."""
    if mesh.is_watertight and mesh.is_winding_consistent:
        return ""
    edges = np.sort(mesh.edges, axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    open_edges = int((counts != 2).sum())
    if open_edges:
        return f"is not closed: {open_edges} of its edges do not have two faces"
    return "has faces that are wound both ways"


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
