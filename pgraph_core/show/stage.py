"""The stage that bodies stand on, drawn by viser: light, sky and floor, light or dark."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import shapes
from .ground import GRID, tilt

if TYPE_CHECKING:
    import viser

    from .shapes import Color

ABOVE = {"x": (-0.3, 1.0, 0.5), "y": (0.5, -0.3, 1.0), "z": (1.0, 0.5, -0.3)}  # the fill light
BELOW = 2e-3  # of the model's size: the floor lies under the ground, which takes the shadows


class Tones(NamedTuple):
    """Colours of one theme; intensities as three.js has them."""

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
    """Light from all around, over viser's own sun with its shadows; and the sky."""
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
    """The plane of the ground with its lines, to where it meets the sky; `low` [m] under it."""
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
        position=-(low + BELOW * size) * np.asarray(model.ground_normal),
        wxyz=tilt(np.array(up), np.asarray(model.ground_normal)),
    )
