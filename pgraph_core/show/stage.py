"""The scene around the bodies, lights, background, floor and steps, and the camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from .shapes import Color

# by what is up: the plane whose upper side viser draws, and the direction
GRID: dict[str, tuple] = {
    "x": ("zy", (1.0, 0.0, 0.0)), "y": ("xz", (0.0, 1.0, 0.0)), "z": ("xy", (0.0, 0.0, 1.0)),
}  # fmt: skip
STEP = (150, 158, 168)
BOX = ((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7),
       (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5))  # fmt: skip


class Tones(NamedTuple):
    """Colours for one theme, with intensities in three.js units."""

    canvas: Color  # behind everything
    floor: Color  # the disc that the model stands on
    line: Color
    above: Color  # light from all around
    below: Color
    around: float
    key: float  # strength of the light from the upper left in front, which casts the shadow
    sky: float  # strength of the light from above, which shades what is close to the ground
    rim: float  # strength of the light from behind
    shadow: float  # on the floor


LIGHT = Tones((226, 231, 238), (243, 246, 249), (182, 190, 202), (255, 255, 255), (150, 157, 170),
              1.75, 1.8, 0.45, 0.7, 0.4)  # fmt: skip
DARK = Tones((16, 20, 26), (44, 51, 62), (84, 94, 110), (206, 218, 240), (72, 82, 100),
             1.3, 1.6, 0.4, 1.1, 0.6)  # fmt: skip
WARM, COOL = (255, 246, 234), (214, 226, 255)  # colours of the key and the rim
# Towards the lights, with z up and the camera at the start as in TOWARDS.
KEY, RIM, SKY = (1.6, -1.5, 3.4), (-2.0, 2.4, 1.2), (0.0, 0.0, 1.0)


def turned(direction: Sequence[float], up: str) -> tuple[float, float, float]:
    """Convert a direction given with z up to axes with `up` up."""
    x, y, z = direction
    return {"x": (z, x, y), "y": (x, z, -y), "z": (x, y, z)}[up]


# -- the ground ------------------------------------------------------------------------------------


def depth(
    model: Any, bodies: Sequence[Any], parent: Sequence[int], positions: np.ndarray, size: float
) -> float:
    """Return the depth [m] below the ground plane at which the ground is drawn.

    The depth is 0 if a body may touch the ground. Otherwise bodies whose roots are at rest must not
    reach the drawn ground, up to a few sizes of the model.
    """
    used = model.contacts or model.ground.steps
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


def solid(model: Any, step: Any) -> np.ndarray:
    """Return the corners of a step, (8, 3), from the plane to its height above it."""
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
    """Find the shortest rotation from `up` to `normal` as a (4,) quaternion."""
    wxyz = np.array([1.0 + up @ normal, *np.cross(up, normal)])
    return wxyz / np.linalg.norm(wxyz)


# -- the camera ------------------------------------------------------------------------------------


Which = Literal["front", "side", "top", "isometric", "start"]
# From the model to the camera, by the axis that is up. Models look along x (along y if x is up).
TOWARDS: dict[str, dict[Which, tuple[float, float, float]]] = {
    "x": {"front": (0, 1, 0), "side": (0, 0, -1), "top": (1, 0, 0), "isometric": (1, 1, -1),
          "start": (0.45, 0.6, -1.0)},
    "y": {"front": (1, 0, 0), "side": (0, 0, 1), "top": (0, 1, 0), "isometric": (1, 1, 1),
          "start": (0.6, 0.45, 1.0)},
    "z": {"front": (1, 0, 0), "side": (0, -1, 0), "top": (0, 0, 1), "isometric": (1, -1, 1),
          "start": (0.6, -1.0, 0.45)},
}  # fmt: skip


class Framing(NamedTuple):
    """Margins around the model in the picture."""

    field_of_view: float = (
        0.5  # angle over the height [rad], small enough to keep the shape of bodies
    )
    margin: float = 0.9  # share of half the width and height
    distance: float = 0.02  # least distance [m], of a model that is a point
    lean: float = 1e-3  # tilt of a view along the vertical, which would have no upright direction
    tilt: float = 0.35  # tangent of the start view's angle to the normal of a plane of motion


FRAMING = Framing()


class Free(NamedTuple):
    """The uncovered part of a picture, as shares of the way from its middle to each edge."""

    left: float = 1.0
    right: float = 1.0
    bottom: float = 1.0
    top: float = 1.0


WHOLE = Free()


class Viewpoint(NamedTuple):
    """The position and target of a camera."""

    position: np.ndarray  # (3,) [m]
    target: np.ndarray  # (3,) point at the picture's centre [m]


def towards(up: str, which: str) -> np.ndarray:
    """Return the (3,) unit vector from model to camera for a named view or an axis such as "-x"."""
    if which[-1] in "xyz":
        way = (-1.0 if which[0] == "-" else 1.0) * np.eye(3)["xyz".index(which[-1])]
    else:
        way = np.array(TOWARDS[up][which], float)  # type: ignore[index]
    if not np.cross(GRID[up][1], way).any():
        way += FRAMING.lean * np.array(TOWARDS[up]["side"])
    return way / np.linalg.norm(way)


def start(up: str, bodies: Sequence[Any], turns: np.ndarray) -> np.ndarray:
    """Return the (3,) unit vector from model to camera for the start view.

    Bodies (nb) with orientations (nb, 3, 3) that all move in one plane are seen at 19 degrees from
    its normal, where neither lengths nor angles look distorted.
    """
    way, normal = towards(up, "start"), plane_of_motion(bodies, turns)
    if normal is None or abs(normal @ way) < FRAMING.lean:
        return way
    normal = normal * np.sign(normal @ way)
    aside = way - (way @ normal) * normal
    found = normal + FRAMING.tilt * aside / np.linalg.norm(aside)
    return found / np.linalg.norm(found)


def plane_of_motion(bodies: Sequence[Any], turns: np.ndarray) -> np.ndarray | None:
    """Return the (3,) normal of the plane in which joints of one axis move all bodies, or None."""
    moves = [(body.sequence, turn) for body, turn in zip(bodies, turns) if body.sequence]
    if any(len(motions) > 1 or not motions[0].facts.flat for motions, _ in moves):
        return None
    axes = [(motions[0].facts.turns, turn @ np.asarray(motions[0].axis)) for motions, turn in moves]
    normal = next((axis for turns, axis in axes if turns), None)
    if normal is None:
        return None
    off = [
        np.linalg.norm(np.cross(axis, normal)) if turns else abs(axis @ normal)
        for turns, axis in axes
    ]
    return normal if max(off) < FRAMING.lean else None


def fitted(
    points: np.ndarray, up: np.ndarray, way: np.ndarray, aspect: float, free: Free = WHOLE
) -> Viewpoint:
    """Find the nearest camera in the direction `way` (a unit vector) that sees all points.

    The points lie within the free rectangle of the picture, and in its middle if there is space.

    Let (x, y, z) be a point and (a, b, d) the camera, both in the camera's axes with z towards the
    camera. The rectangle contains the point if -l (d - z) <= x - a <= r (d - z), where l and r are
    the tangents of the angles to its left and right edges, and likewise for y - b.
    """
    right, above = frame(up, way)
    x, y, z = points @ right, points @ above, points @ way
    half = math.tan(FRAMING.field_of_view / 2)
    left, rightward, low, top = np.minimum(FRAMING.margin, free) * half * [aspect, aspect, 1, 1]
    x_high, x_low = (x + rightward * z).max(), (x - left * z).min()
    y_high, y_low = (y + top * z).max(), (y - low * z).min()
    middle = (z.min() + z.max()) / 2
    d = max(
        (x_high - x_low) / (left + rightward),
        (y_high - y_low) / (low + top),
        middle + FRAMING.distance,
    )
    across, along = x_high + x_low + (left - rightward) * d, y_high + y_low + (low - top) * d
    target = across / 2 * right + along / 2 * above + middle * way
    return Viewpoint(target + (d - middle) * way, target)


def frame(up: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the right and up directions in the picture, (3,) each."""
    right = np.cross(up, way)
    right /= np.linalg.norm(right)
    return right, np.cross(way, right)


def in_picture(points: np.ndarray, up: np.ndarray, at: Viewpoint, aspect: float) -> np.ndarray:
    """Return a mask (n,) of the points that a camera sees."""
    way = at.position - at.target
    way = way / np.linalg.norm(way)
    right, above = frame(up, way)
    deep = (at.position - points) @ way
    half = math.tan(FRAMING.field_of_view / 2)
    x, y = np.abs((points - at.position) @ right), np.abs((points - at.position) @ above)
    return (deep > 0) & (x <= half * aspect * deep) & (y <= half * deep)
