"""What can be shown over the bodies: joint axes, link vectors, centres of mass, names, forces."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from .. import shapes
from ..state import State

AXIS, LINK, COM, FORCE = (224, 120, 20), (96, 106, 120), (200, 40, 150), (30, 160, 90)


class Overlays:
    """Each kind is one node (names: one a body) whose points are moved; hidden ones cost nothing."""

    def __init__(self, server: viser.ViserServer):
        self._scene = server.scene
        self._nodes: dict[str, list[Any]] = {}

    def render(self, state: State, positions: np.ndarray, wxyz: np.ndarray, rebuilt: bool) -> None:
        R = shapes.to_matrix(wxyz)
        for kind in ("axes", "links", "coms", "names", "forces"):
            if rebuilt or kind not in state.shown or kind == "forces":
                self._remove(kind)
            if kind not in state.shown:
                continue
            points = POINTS[kind](state, positions, R)
            if len(points) == 0:
                continue
            if kind not in self._nodes:
                self._nodes[kind] = ADD[kind](self._scene, state, points)
            elif kind == "names":
                for node, point in zip(self._nodes[kind], points):
                    node.position = point
            else:
                self._nodes[kind][0].points = points.astype(np.float32)

    def _remove(self, kind: str) -> None:
        for node in self._nodes.pop(kind, []):
            node.remove()


def axis_lines(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(n, 2, 3): a line along each joint axis, through the body's origin."""
    d, half = state.derived, 0.09 * state.derived.size
    lines = []
    for k, name in enumerate(d.names):
        body, p = state.model.body(name), d.parent[k]
        before = (R[p - 1] if p else np.eye(3)) @ shapes.to_matrix(np.asarray(body.rotation))
        for i, axis in enumerate(body.axes):
            turned = R[k] if i == len(body.axes) - 1 else before
            a = half * (turned @ np.asarray(axis)) / np.linalg.norm(axis)
            lines.append((positions[k] - a, positions[k] + a))
    return np.array(lines).reshape(-1, 2, 3)


def link_lines(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(nb, 2, 3): from the parent's origin to the body's."""
    parent = np.array(state.derived.parent, dtype=int)
    start = np.vstack((np.zeros((1, 3)), positions))[parent]
    return np.stack((start, positions), axis=1)


def com_points(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(nb, 3): centres of mass."""
    local = np.array([state.model.body(name).com for name in state.derived.names]).reshape(-1, 3)
    return positions + np.einsum("nij,nj->ni", R, local)


def name_points(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    return com_points(state, positions, R)


def force_lines(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(n, 2, 3): constraint forces of the run at its time, the largest half the model long."""
    if state.run is None:
        return np.zeros((0, 2, 3))
    result, d = state.run.result, state.derived
    frame = min(int(np.searchsorted(result.t, state.playback.time)), len(result.t) - 1)
    largest = max((np.abs(f[:, 3:]).max() for f in result.constraint_force.values()), default=0.0)
    lines = []
    for constraint in state.model.constraints:
        wrench = result.constraint_force.get(constraint.name)
        if wrench is None or not np.isfinite(largest) or largest == 0.0:
            continue
        k = d.number[constraint.body] - 1
        at = positions[k] + R[k] @ np.asarray(constraint.point)
        lines.append((at, at + 0.5 * d.size / largest * wrench[frame, 3:]))
    return np.array(lines).reshape(-1, 2, 3)


def _lines(name: str, color: shapes.Color, pixels: float) -> Any:
    def add(scene: viser.SceneApi, state: State, points: np.ndarray) -> list[Any]:
        node = scene.add_line_segments(
            name, points, colors=color, thickness=pixels, thickness_units="screen"
        )
        return [node]

    return add


def _add_coms(scene: viser.SceneApi, state: State, points: np.ndarray) -> list[Any]:
    size = 0.03 * state.derived.size
    node = scene.add_point_cloud(
        "/overlay/coms", points, colors=COM, point_size=size, point_shape="circle", precision="float32"
    )
    return [node]


def _add_names(scene: viser.SceneApi, state: State, points: np.ndarray) -> list[Any]:
    return [
        scene.add_label(f"/overlay/names/{k}", name, position=point, font_screen_scale=0.8)
        for k, (name, point) in enumerate(zip(state.derived.names, points))
    ]


def _add_forces(scene: viser.SceneApi, state: State, points: np.ndarray) -> list[Any]:
    size = state.derived.size
    node = scene.add_arrows(
        "/overlay/forces", points, colors=FORCE, shaft_radius=0.008 * size,
        head_radius=0.022 * size, head_length=0.05 * size,
    )  # fmt: skip
    return [node]


POINTS = {"axes": axis_lines, "links": link_lines, "coms": com_points, "names": name_points,
          "forces": force_lines}  # fmt: skip
ADD = {
    "axes": _lines("/overlay/axes", AXIS, 4.0),
    "links": _lines("/overlay/links", LINK, 2.5),
    "coms": _add_coms,
    "names": _add_names,
    "forces": _add_forces,
}
