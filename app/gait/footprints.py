"""Where feet stood: a disc each, as far as the time that is shown."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from pgraph_core.show import shapes

from ..core.state import State
from .footfalls import prints

MOST = 64  # discs, the last ones
COLOR, OPACITY = (8, 34, 110), 0.9
WIDE, THICK = 0.055, 0.004  # of the model's size


class FootprintsView:
    def __init__(self, server: viser.ViserServer):
        self._scene = server.scene
        self._node: Any = None
        self._at = np.zeros((0, 3))

    def render(self, old: State, new: State) -> None:
        falls = new.falls if "footprints" in new.shown else ()
        self.show(new, prints(falls, new.playback.time, MOST))

    def show(self, state: State, at: np.ndarray) -> None:
        """A disc at each of these places, and no others."""
        if at.shape == self._at.shape and np.array_equal(at, self._at):
            return
        self._at = at
        if self._node is not None and len(self._node.batched_positions) == len(at):
            self._node.batched_positions = at
            return
        if self._node is not None:
            self._node.remove()
        self._node = draw(self._scene, state, at) if len(at) else None


def draw(scene: viser.SceneApi, state: State, at: np.ndarray) -> Any:
    """A flat disc on the ground at each place."""
    disc, size = shapes.unit("cylinder"), state.derived.size
    turned = shapes.to_wxyz(shapes.z_to(np.asarray(state.model.ground_normal))[None])
    return scene.add_batched_meshes_simple(
        "/footprints", disc.vertices, disc.faces, batched_positions=at,
        batched_wxyzs=np.repeat(turned, len(at), 0),
        batched_scales=np.tile(size * np.array([WIDE, WIDE, THICK]), (len(at), 1)),
        batched_colors=COLOR, opacity=OPACITY, lod="off", cast_shadow=False, receive_shadow=False,
    )  # fmt: skip
