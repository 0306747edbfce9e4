"""Mesh files as shapes, and mass properties from shapes: errands of the properties."""

from __future__ import annotations

import hashlib
import math
import re
from pathlib import Path
from typing import Any

import pgraph_core as pg
from pgraph_core.mesh_files import FORMATS, load_mesh
from pgraph_core.model.shape import mass_properties, mass_properties_of

from ..core.cells import Refusal
from ..model import Found
from ..model.archive import mesh_folder

LARGEST_MESH = 10_000_000  # [bytes]
LARGE = 5.0  # [m] a mesh beyond this is likely not in metres


def shaped(bodies: tuple[str, ...], file: str, content: bytes) -> Found:
    """The uploaded file kept, and made the shape of these bodies.

    Raises PgraphError, Refusal, OSError.
    """
    suffix = Path(file).suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise Refusal(f"no mesh is read from .{suffix} files; give one of {', '.join(FORMATS)}")
    if len(content) > LARGEST_MESH:
        size = len(content) / 1e6
        raise Refusal(f"{file} has {size:.1f} MB; a mesh file has at most 10 MB")
    stem = re.sub(r"[^\w-]+", "_", Path(file).stem)[:60] or "mesh"
    path = mesh_folder() / f"{stem}-{hashlib.sha256(content).hexdigest()[:8]}.{suffix}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    try:
        mesh = load_mesh(path)
    except pg.PgraphError as error:
        path.unlink(missing_ok=True)
        raise Refusal(str(error).replace(str(path), file)) from None
    shape = pg.Shape(kind="mesh", file=str(path))
    x, y, z = (float(e) for e in mesh.extents)
    text = f"{file}: {len(mesh.faces)} faces, {x:.3g} × {y:.3g} × {z:.3g} m."
    if max(mesh.extents) > LARGE:
        text += " If its numbers are millimetres, set the scale to 0.001."
    try:
        mass_properties(shape, 1.0)
    except pg.PgraphError as error:
        why = str(error).split(": ", 1)[-1]
        text += f" It is drawn and touches, but has no volume: {why}."
    return Found(text, {name: {"shape": shape} for name in bodies})


def mass_of(bodies: list[pg.Body], density: float) -> dict[str, dict[str, Any]]:
    """What makes mass, centre of mass and inertia of bodies follow from shapes that they fill.

    Raises PgraphError, Refusal.
    """
    found = {}
    for body in bodies:
        mass = mass_properties_of(body.shapes, density).mass
        if not (math.isfinite(mass) and mass >= 0):
            raise Refusal(f"gives '{body.name}' a mass of {mass}")
        derived = tuple(dict.fromkeys((*body.derived, "mass", "com", "inertia")))
        found[body.name] = {"density": density, "derived": derived}
    return found
