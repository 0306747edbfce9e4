"""The ground in 3D, drawn by viser: a grid in its plane, and its steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from . import shapes

if TYPE_CHECKING:
    import viser

GRID: dict[str, tuple] = {
    "x": ("yz", (1.0, 0.0, 0.0)), "y": ("xz", (0.0, 1.0, 0.0)), "z": ("xy", (0.0, 0.0, 1.0)),
}  # fmt: skip
STEP = (150, 158, 168)
BOX = ((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7),
       (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5))  # fmt: skip


def grid(scene: viser.SceneApi, model: Any, size: float) -> viser.GridHandle:
    """The plane of the ground, endless."""
    plane, up = GRID[model.up]
    cell = shapes.spaced(size)
    return scene.add_grid(
        "/ground",
        plane=plane,
        infinite_grid=True,
        cell_size=cell / 5,
        section_size=cell,
        cell_color=(190, 195, 202),
        section_color=(140, 147, 156),
        fade_distance=14 * size,
        fade_strength=2.0,
        shadow_opacity=0.18,
        wxyz=tilt(np.array(up), np.asarray(model.ground_normal)),
    )


def steps(scene: viser.SceneApi, model: Any) -> Any:
    """The steps as solids on the plane; None where there are none."""
    if not model.ground.steps:
        return None
    corners = np.concatenate([solid(model, step) for step in model.ground.steps])
    faces = np.concatenate([np.array(BOX) + 8 * k for k in range(len(model.ground.steps))])
    return scene.add_mesh_simple(
        "/steps", corners, faces, color=STEP, side="double", flat_shading=True, cast_shadow=False
    )


def solid(model: Any, step: Any) -> np.ndarray:
    """(8, 3) corners of a step: on the plane, and as much over it as it stands out."""
    up = "xyz".index(model.up)
    along = [k for k in range(3) if k != up]
    normal = np.asarray(model.ground_normal)
    found = np.zeros((8, 3))
    for k, corner in enumerate(found):
        corner[along[0]] = (step.low, step.high)[k & 1][0]
        corner[along[1]] = (step.low, step.high)[k >> 1 & 1][1]
        raised = step.height * (k >> 2)
        corner[up] = (raised - normal[along] @ corner[along]) / normal[up]
    return found


def tilt(up: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(4,) the shortest turn that takes `up` to `normal`."""
    wxyz = np.array([1.0 + up @ normal, *np.cross(up, normal)])
    return wxyz / np.linalg.norm(wxyz)
