"""An earlier run beside the one that plays: the same bodies, seen through."""

from __future__ import annotations

import numpy as np
import viser

from pgraph_core.show import shapes
from pgraph_core.show.animation import between
from pgraph_core.show.bodies import at_rest

from ..core.state import Run, State
from .view import looks

COLOR, OPACITY = (120, 128, 140), 0.28


class GhostView:
    def __init__(self, server: viser.ViserServer):
        self._server = server
        self._nodes: list[viser.MeshHandle] = []

    def render(self, old: State, new: State) -> None:
        if new.ghost is not old.ghost:
            for node in self._nodes:
                node.remove()
            self._nodes = [] if new.ghost is None else self._drawn(new, new.ghost)
        if new.ghost is not None and self._nodes:
            self._place(new.ghost, new.playback.time)

    def _drawn(self, state: State, ghost: Run) -> list[viser.MeshHandle]:
        of = State(ghost.model, ghost.request)
        nodes = []
        for k, look in enumerate(looks(of), 1):
            solid = shapes.mesh(look.pieces)
            node = self._server.scene.add_mesh_simple(
                f"/ghost/{k}",
                solid.vertices,
                solid.faces,
                color=COLOR,
                opacity=OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )
            nodes.append(at_rest(node))
        return nodes

    def _place(self, ghost: Run, time: float) -> None:
        result = ghost.result
        t, pose = np.asarray(result.t), np.asarray(result.body_pose)
        positions, wxyz = between(t, pose, float(np.clip(time, t[0], t[-1])))
        with self._server.atomic():
            for node, place, turn in zip(self._nodes, positions, wxyz):
                node.position, node.wxyz = place, turn
