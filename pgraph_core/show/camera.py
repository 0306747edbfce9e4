"""Where a camera stands so that given points fill its picture."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

Which = Literal["front", "side", "top", "isometric", "start"]
FIELD_OF_VIEW = 0.7  # of the height [rad]
MARGIN = 0.92  # of half the width and of half the height above: what the points take
LOWER = 0.66  # of half the height below: the playback covers the rest
LEAST = 0.02  # [m] least distance: of a model that is a point

# From the model to the camera, by the axis that is up. Models look along x (along y if x is up).
TOWARDS: dict[str, dict[Which, tuple[float, float, float]]] = {
    "x": {"front": (0, 1, 0), "side": (0, 0, -1), "top": (1, 0, 0), "isometric": (1, 1, -1),
          "start": (0.42, 0.8, -1.0)},
    "y": {"front": (1, 0, 0), "side": (0, 0, 1), "top": (0, 1, 0), "isometric": (1, 1, 1),
          "start": (0.55, 0.4, 1.0)},
    "z": {"front": (1, 0, 0), "side": (0, -1, 0), "top": (0, 0, 1), "isometric": (1, -1, 1),
          "start": (0.55, -1.0, 0.4)},
}  # fmt: skip
STEEP = 1e-3  # of the direction "top": a camera that looks straight down has no upright picture


class Viewpoint(NamedTuple):
    """Of a camera."""

    position: np.ndarray  # (3,) [m]
    target: np.ndarray  # (3,) what it looks at [m]


def towards(up: str, which: Which) -> np.ndarray:
    """(3,) unit vector from the model to the camera."""
    way = np.array(TOWARDS[up][which], float)
    if which == "top":
        way += STEEP * np.array(TOWARDS[up]["side"])
    return way / np.linalg.norm(way)


def fitted(points: np.ndarray, up: np.ndarray, way: np.ndarray, aspect: float) -> Viewpoint:
    """The nearest camera in the direction `way` (a unit vector towards it) that sees all points.

    A point at (x, y, z) in the camera's axes, z towards the camera at (a, b, d), is in the picture
    if |x - a| <= h (d - z), y - b <= v (d - z) and b - y <= w (d - z), with the tangents h, v, w
    of the picture's half width and of its parts above and below the middle. The tightest of these
    on either side meet where a, b and d are as small as can be.
    """
    right, above = frame(up, way)
    x, y, z = points @ right, points @ above, points @ way
    half = math.tan(FIELD_OF_VIEW / 2)
    h, v, w = MARGIN * half * aspect, MARGIN * half, LOWER * half
    a, across = _squeezed(x, z, h, h)
    b, along = _squeezed(y, z, v, w)
    middle = (z.min() + z.max()) / 2
    d = max(across, along, middle + LEAST)
    target = a * right + b * above + middle * way
    return Viewpoint(target + (d - middle) * way, target)


def _squeezed(x: np.ndarray, z: np.ndarray, high: float, low: float) -> tuple[float, float]:
    """Where the camera stands along one axis of its picture, and how far from it."""
    top, bottom = float((z + x / high).max()), float((z - x / low).max())
    at = (top - bottom) / (1 / high + 1 / low)
    return at, top - at / high


def frame(up: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) directions to the right and upwards in the picture."""
    right = np.cross(up, way)
    right /= np.linalg.norm(right)
    return right, np.cross(way, right)


def in_picture(points: np.ndarray, up: np.ndarray, at: Viewpoint, aspect: float) -> bool:
    """Whether a camera sees all points."""
    way = at.position - at.target
    way = way / np.linalg.norm(way)
    right, above = frame(up, way)
    deep = (at.position - points) @ way
    half = math.tan(FIELD_OF_VIEW / 2)
    x, y = np.abs((points - at.position) @ right), (points - at.position) @ above
    inside = (deep > 0) & (x <= half * aspect * deep) & (y <= half * deep) & (-y <= half * deep)
    return bool(inside.all())
