"""The ground in 3D, drawn by viser: where shadows fall, and its steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import viser

GRID: dict[str, tuple] = {
    "x": ("yz", (1.0, 0.0, 0.0)), "y": ("xz", (0.0, 1.0, 0.0)), "z": ("xy", (0.0, 0.0, 1.0)),
}  # fmt: skip
STEP = (150, 158, 168)
BOX = ((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7),
       (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5))  # fmt: skip


def depth(
    model: Any, bodies: Sequence[Any], parent: Sequence[int], positions: np.ndarray, size: float
) -> float:
    """How far under the ground's plane it is drawn, so that nothing that cannot touch it is in it.

    At the plane where something may touch it; else as deep as the bodies hang down from their
    roots [m], but for a few sizes of the model.
    """
    used = model.contacts or model.ground.steps or any(b.joint == "free" for b in bodies)
    up = np.array(GRID[model.up][1])
    if used or len(positions) == 0 or np.asarray(model.ground_normal) @ up < 1.0:
        return 0.0
    height, reach = positions @ up, np.zeros(len(positions))
    for k in reversed(range(len(positions))):
        reach[k] = max(reach[k], float(np.linalg.norm(bodies[k].tip_point)))
        if (p := parent[k] - 1) >= 0:
            reach[p] = max(reach[p], reach[k] + float(np.linalg.norm(bodies[k].link)))
    roots = [k for k, p in enumerate(parent) if p == 0]
    lowest = min(height[k] - reach[k] for k in roots)
    return float(np.clip(-lowest, 0.0, max(3 * size - height.mean(), 0.0)))


def grid(scene: viser.SceneApi, model: Any, size: float, low: float = 0.0) -> viser.GridHandle:
    """The plane of the ground, endless, where shadows fall; its colour is the stage's.

    It is drawn `low` [m] under the plane.
    """
    plane, up = GRID[model.up]
    return scene.add_grid(
        "/ground",
        plane=plane,
        infinite_grid=True,
        cell_thickness=0.0,
        section_thickness=0.0,
        fade_distance=26 * size,
        fade_strength=0.9,
        shadow_opacity=0.22,
        position=-low * np.asarray(up),
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
