"""The kinds of shapes that touch, in one table: how each touches.

trimesh is imported only where a mesh file is opened.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import ModelError, Problem, needed
from ..mesh_files import Scale, load_mesh
from ..model import Shape
from ..model.shape import MassProperties as MassProperties
from ..model.shape import leak as _leak
from ..model.shape import mass_properties as mass_properties
from . import solids
from .solids import Solid

Array = np.ndarray


def solids_of(shape: Shape) -> tuple[Solid, ...]:
    """A shape as it touches others, in its own frame: one solid, or the parts of a mesh.

    Raises FileError, ModelError, MissingPackage.
    """
    if shape.kind == "mesh" and shape.hull == "parts":
        return convex_parts(shape.file or "", shape.scale)
    return (solid_of(shape),)


def solid_of(shape: Shape, unit: str = "m") -> Solid:
    """A shape that is one solid, in its own frame. Raises FileError, ModelError."""
    if shape.kind == "mesh":
        return convex_hull(shape.file or "", shape.scale, unit, closed=shape.hull is None)
    return KINDS[shape.kind].solid(shape)


def balls_on_ground(shape: Shape) -> tuple[Array, float] | None:
    """(centres (n, 3), radius) of the balls that touch a plane; None: it has none."""
    kind = KINDS.get(shape.kind)
    return kind.balls(shape) if kind and kind.balls else None


def convex_hull(
    file: str | Path, scale: Scale = 1.0, unit: str = "m", *, closed: bool = False
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


MOST_PARTS = 64
CORNERS = 32  # of a part at most


def convex_parts(file: str | Path, scale: Scale = 1.0) -> tuple[Solid, ...]:
    """Convex solids that together are about a closed mesh, by CoACD [Wei et al. 2022].

    Kept as long as the file stays as it is. Raises FileError, MissingPackage, and ModelError for
    a mesh that is not closed or has more than 64 parts.
    """
    changed = Path(file).stat().st_mtime_ns if Path(file).is_file() else 0
    return _convex_parts(str(file), scale, changed)


@lru_cache(maxsize=64)
def _convex_parts(file: str, scale: Scale, changed: int) -> tuple[Solid, ...]:
    mesh = load_mesh(file, scale)
    if not mesh.is_watertight:
        do = "give a closed mesh, or hull 'convex' to let its convex hull touch"
        raise ModelError(Problem(f"mesh {file}", "", f"{_leak(mesh)}; {do}"))
    coacd = needed("coacd", "meshes")
    coacd.set_log_level("error")
    given = coacd.Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    parts = coacd.run_coacd(given, seed=0, decimate=True, max_ch_vertex=CORNERS)
    if len(parts) > MOST_PARTS:
        text = f"splits into {len(parts)} convex parts, more than {MOST_PARTS}"
        do = "simplify the mesh, give the body simple shapes, or use hull 'convex'"
        raise ModelError(Problem(f"mesh {file}", "", f"{text}; {do}"))
    return tuple(solids.hull(np.unique(vertices, axis=0)) for vertices, _ in parts)


class Kind(NamedTuple):
    """How a kind of shape touches.

    `balls` are (centres, radius) by which it touches a plane in event-driven runs; None where it
    does not touch by a few balls.
    """

    solid: Callable[[Shape], Solid]
    balls: Callable[[Shape], tuple[Array, float]] | None = None


# Every kind of shape but meshes, which are read from files. A new kind is an entry here, its mass
# properties in `model.shape`, a builder in `solids`, and for the kernels a branch in
# `engine.contact.pairs.single_pair` and in `engine.contact.ground.candidate`, unless it is a convex
# solid with corners.
KINDS = {
    "box": Kind(
        lambda s: solids.box(s.size or ()),
        lambda s: (np.array([*product((-0.5, 0.5), repeat=3)]) * (s.size or ()), 0.0),
    ),
    "sphere": Kind(
        lambda s: solids.sphere(s.radius or 0.0),
        lambda s: (np.zeros((1, 3)), s.radius or 0.0),
    ),
    "ellipsoid": Kind(lambda s: solids.ellipsoid(s.radii or ())),
    "heightfield": Kind(lambda s: solids.heightfield(s.size or (), s.heights or ())),
    "cylinder": Kind(lambda s: solids.cylinder(s.radius or 0.0, s.length or 0.0)),
    "capsule": Kind(
        lambda s: solids.capsule(s.radius or 0.0, s.length or 0.0),
        lambda s: (np.outer((-0.5, 0.5), (0.0, 0.0, s.length or 0.0)), s.radius or 0.0),
    ),
}
