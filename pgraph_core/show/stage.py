"""Surroundings of the bodies in viser: ground, grid, steps, light, sky and floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from . import shapes

if TYPE_CHECKING:
    import viser

    from .shapes import Color

# by what is up: the plane whose upper side viser draws, and the direction
GRID: dict[str, tuple] = {
    "x": ("zy", (1.0, 0.0, 0.0)), "y": ("xz", (0.0, 1.0, 0.0)), "z": ("xy", (0.0, 0.0, 1.0)),
}  # fmt: skip
STEP = (150, 158, 168)
BOX = ((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7),
       (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5))  # fmt: skip
ABOVE = {"x": (-0.3, 1.0, 0.5), "y": (0.5, -0.3, 1.0), "z": (1.0, 0.5, -0.3)}  # the fill light


class Tones(NamedTuple):
    """Colours of one theme, with intensities in units of three.js."""

    zenith: Color
    horizon: Color
    floor: Color
    line: Color
    section: Color
    sky: Color
    soil: Color
    ambient: float
    fill: float


LIGHT = Tones(
    (196, 212, 231), (240, 243, 247), (233, 236, 240), (222, 226, 231), (210, 215, 222),
    (255, 252, 246), (176, 164, 150), 1.1, 0.5,
)  # fmt: skip
DARK = Tones(
    (14, 17, 23), (44, 50, 60), (66, 73, 85), (73, 81, 93), (84, 92, 106),
    (170, 186, 214), (64, 60, 58), 1.2, 0.4,
)  # fmt: skip


def light(scene: viser.SceneApi, dark: bool, up: str) -> None:
    """Add ambient light to viser's sun with its shadows, and the sky."""
    tones = DARK if dark else LIGHT
    _, overhead = GRID[up]
    scene.add_light_hemisphere(
        "/light/sky", sky_color=tones.sky, ground_color=tones.soil, intensity=tones.ambient,
        position=overhead,
    )  # fmt: skip
    scene.add_light_directional(
        "/light/fill", color=tones.sky, intensity=tones.fill, position=ABOVE[up]
    )
    scene.set_background_image(sky(tones), format="png")


def sky(tones: Tones) -> np.ndarray:
    """(rows, columns, 3) a picture from the zenith to the horizon, which fills the view."""
    down = np.clip(np.linspace(0.0, 1.6, 320), 0.0, 1.0)[:, None]
    colors = np.asarray(tones.zenith) * (1 - down) + np.asarray(tones.horizon) * down
    return np.repeat(np.round(colors).astype(np.uint8)[:, None], 16, axis=1)


def floor(
    scene: viser.SceneApi, model: Any, size: float, dark: bool, low: float = 0.0
) -> viser.GridHandle:
    """Add the plane of the ground with its lines up to the horizon, `low` [m] under the plane."""
    plane, up = GRID[model.up]
    tones, cell = DARK if dark else LIGHT, shapes.spaced(size)
    return scene.add_grid(
        "/floor",
        plane=plane,
        infinite_grid=True,
        cell_size=cell / 5,
        section_size=cell,
        cell_color=tones.line,
        section_color=tones.section,
        section_thickness=1.2,
        plane_color=tones.floor,
        plane_opacity=1.0,
        shadow_opacity=0.0,
        fade_distance=26 * size,
        fade_strength=0.9,
        # under the ground, which takes the shadows
        position=-(low + 2e-3 * size) * np.asarray(model.ground_normal),
        wxyz=tilt(np.array(up), np.asarray(model.ground_normal)),
    )


# -- the ground ------------------------------------------------------------------------------------


def depth(
    model: Any, bodies: Sequence[Any], parent: Sequence[int], positions: np.ndarray, size: float
) -> float:
    """Return the depth [m] under the ground's plane at which the ground is drawn.

    It is 0 if something may touch the ground. Otherwise bodies that hang from their roots must not
    reach the drawn ground, up to a few sizes of the model.
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
    """Add the infinite plane of the ground that receives shadows, in the colour of the stage.

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
    """Add the steps as solids on the plane, or return None without steps."""
    if not model.ground.steps:
        return None
    corners = np.concatenate([solid(model, step) for step in model.ground.steps])
    faces = (np.array(BOX) + 8 * np.arange(len(model.ground.steps))[:, None, None]).reshape(-1, 3)
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


# -- the camera ------------------------------------------------------------------------------------


Which = Literal["front", "side", "top", "isometric", "start"]
# From the model to the camera, by the axis that is up. Models look along x (along y if x is up).
TOWARDS: dict[str, dict[Which, tuple[float, float, float]]] = {
    "x": {"front": (0, 1, 0), "side": (0, 0, -1), "top": (1, 0, 0), "isometric": (1, 1, -1),
          "start": (0.42, 0.8, -1.0)},
    "y": {"front": (1, 0, 0), "side": (0, 0, 1), "top": (0, 1, 0), "isometric": (1, 1, 1),
          "start": (0.55, 0.4, 1.0)},
    "z": {"front": (1, 0, 0), "side": (0, -1, 0), "top": (0, 0, 1), "isometric": (1, -1, 1),
          "start": (0.55, -1.0, 0.4)},
}  # fmt: skip


class Framing(NamedTuple):
    """Margins of the camera's picture."""

    field_of_view: float = 0.7  # vertical angle [rad]
    margin: float = 0.92  # used share of half the width, and of half the height above the middle
    lower: float = 0.66  # used share of half the height below the middle, above the playback
    gap: float = 0.02  # share of the height between the bodies and the playback
    most_covered: float = 0.7  # largest share of the height that is covered
    distance: float = 0.02  # least distance [m], of a model that is a point
    lean: float = 1e-3  # tilt of the view "top", because a vertical view has no upright picture


FRAMING = Framing()


class Viewpoint(NamedTuple):
    """Position and target of a camera."""

    position: np.ndarray  # (3,) [m]
    target: np.ndarray  # (3,) point at the picture's centre [m]


def towards(up: str, which: Which) -> np.ndarray:
    """(3,) unit vector from the model to the camera."""
    way = np.array(TOWARDS[up][which], float)
    if which == "top":
        way += FRAMING.lean * np.array(TOWARDS[up]["side"])
    return way / np.linalg.norm(way)


def fitted(
    points: np.ndarray, up: np.ndarray, way: np.ndarray, aspect: float, covered: float = 0.0
) -> Viewpoint:
    """Return the nearest camera in the direction `way` (a unit vector) that sees all points.

    A share `covered` of the picture's height at its bottom is kept free. Let a point be at
    (x, y, z) in the camera's axes and the camera at (a, b, d), with z towards the camera. The point
    is in the picture if |x - a| <= h (d - z) and -w (d - z) <= y - b <= v (d - z). The tangents are
    h of the picture's half width and v, w of its parts above and below the middle. w is negative if
    more than half is covered.
    """
    right, above = frame(up, way)
    x, y, z = points @ right, points @ above, points @ way
    half = math.tan(FRAMING.field_of_view / 2)
    h, v = FRAMING.margin * half * aspect, FRAMING.margin * half
    low = 1 - 2 * min(covered + FRAMING.gap, FRAMING.most_covered)
    w = min(FRAMING.lower, low) * half
    x_high, x_low = (x + h * z).max(), (x - h * z).min()
    y_high, y_low = (y + v * z).max(), (y - w * z).min()
    middle = (z.min() + z.max()) / 2
    d = max((x_high - x_low) / (2 * h), (y_high - y_low) / (v + w), middle + FRAMING.distance)
    a, b = (x_high + x_low) / 2, (y_high - v * d + y_low + w * d) / 2
    target = a * right + b * above + middle * way
    return Viewpoint(target + (d - middle) * way, target)


def frame(up: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) directions to the right and upwards in the picture."""
    right = np.cross(up, way)
    right /= np.linalg.norm(right)
    return right, np.cross(way, right)


def in_picture(
    points: np.ndarray, up: np.ndarray, at: Viewpoint, aspect: float, covered: float = 0.0
) -> np.ndarray:
    """Return a mask (n,) of the points in a camera's picture above its `covered` share."""
    way = at.position - at.target
    way = way / np.linalg.norm(way)
    right, above = frame(up, way)
    deep = (at.position - points) @ way
    half = math.tan(FRAMING.field_of_view / 2)
    x, y = np.abs((points - at.position) @ right), (points - at.position) @ above
    low = (1 - 2 * covered) * half
    return (deep > 0) & (x <= half * aspect * deep) & (y <= half * deep) & (-y <= low * deep)
