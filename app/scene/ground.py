"""The ground in 3D, drawn again if it changes."""

from __future__ import annotations

from typing import Any

import viser

from pgraph_core.show.ground import grid, steps

from ..core.state import State


class GroundView:
    """The ground of the model that is shown."""

    def __init__(self, server: viser.ViserServer):
        self._scene = server.scene
        self._drawn: object = None  # what is drawn: the ground, which way is up, the size
        self._steps: Any = None

    def render(self, state: State) -> None:
        model = state.model
        wanted = (model.ground, model.up, state.framed)
        if wanted == self._drawn:
            return
        self._drawn = wanted
        if self._steps is not None:
            self._steps.remove()
        grid(self._scene, model, state.derived.size)
        self._steps = steps(self._scene, model)
