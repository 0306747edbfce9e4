"""What can be shown over the bodies: joint axes, link vectors, centres of mass, names, forces."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import viser

from .. import shapes
from ..state import State
from .bodies import SEPARATE

AXIS, LINK, COM, FORCE = (224, 120, 20), (96, 106, 120), (200, 40, 150), (30, 160, 90)
Local = dict[int, np.ndarray]  # number of a body (0: the ground) -> points in its frame [m]


class Overlays:
    """In small models children of the bodies' nodes, so that they move along by themselves; in
    large ones a single node a kind in world axes. What is not shown costs nothing."""

    def __init__(self, server: viser.ViserServer):
        self._scene = server.scene
        self._nodes: dict[str, list[Any]] = {}

    def clear(self) -> None:
        """Nothing drawn: the bodies are about to be drawn anew."""
        for kind in list(self._nodes):
            self._remove(kind)

    def render(self, state: State, positions: np.ndarray, wxyz: np.ndarray) -> None:
        """Draw what `state.shown` asks for, with the bodies at these poses."""
        for kind in LOCAL:
            if kind in state.shown:
                self._local(kind, state, positions, wxyz)
            else:
                self._remove(kind)
        self._forces(state, positions, wxyz)

    def _forces(self, state: State, positions: np.ndarray, wxyz: np.ndarray) -> None:
        arrows = np.zeros((0, 2, 3))
        if "forces" in state.shown:
            arrows = force_lines(state, positions, shapes.to_matrix(wxyz)).astype(np.float32)
        drawn = self._nodes.get("forces")
        if drawn and drawn[0].points.shape == arrows.shape:
            drawn[0].points = arrows
        else:
            self._remove("forces")
            self._nodes["forces"] = _arrows(self._scene, arrows, state.derived.size)

    def _local(self, kind: str, state: State, positions: np.ndarray, wxyz: np.ndarray) -> None:
        attached = len(state.derived.names) <= SEPARATE
        if kind in self._nodes and attached:
            return
        points = LOCAL[kind](state)
        if attached:
            self._nodes[kind] = [
                ADD[kind](self._scene, f"/bodies/{k}/{kind}" if k else f"/{kind}", at, state, k)
                for k, at in points.items()
            ]
            return
        placed = world(points, positions, shapes.to_matrix(wxyz))
        if kind == "names":
            self._move_names(state, placed)
        elif kind in self._nodes:
            self._nodes[kind][0].points = placed.astype(np.float32)
        elif len(placed):
            self._nodes[kind] = [ADD[kind](self._scene, f"/{kind}", placed, state, 0)]

    def _move_names(self, state: State, placed: np.ndarray) -> None:
        nodes = self._nodes.setdefault("names", [])
        for k, at in enumerate(placed, 1):
            if k > len(nodes):
                nodes.append(_name(self._scene, f"/names/{k}", at[None], state, k))
            nodes[k - 1].position = at

    def _remove(self, kind: str) -> None:
        for node in self._nodes.pop(kind, []):
            node.remove()


def axes(state: State) -> Local:
    """A line along each joint axis, through the body's origin; a joint of several motions has
    all but its last axis in the frame it leaves from."""
    d, half = state.derived, 0.13 * state.derived.grain
    found: dict[int, list[Any]] = defaultdict(list)
    for k, name in enumerate(d.names, 1):
        body = state.model.body(name)
        turned = shapes.to_matrix(np.asarray(body.rotation))
        for i, axis in enumerate(body.axes):
            a = half * np.asarray(axis) / np.linalg.norm(axis)
            if i == len(body.axes) - 1:
                found[k].append((-a, a))
            else:
                at, a = np.asarray(body.link), turned @ a
                found[d.parent[k - 1]].append((at - a, at + a))
    return {k: np.array(lines) for k, lines in found.items()}


def links(state: State) -> Local:
    """From each body's origin to where its children hang on it."""
    d = state.derived
    return {
        k: np.array([(np.zeros(3), state.model.body(d.names[child - 1]).link) for child in below])
        for k, below in enumerate(d.children)
        if below
    }


def coms(state: State) -> Local:
    """Centres of mass."""
    names = enumerate(state.derived.names, 1)
    return {k: np.array([state.model.body(name).com]) for k, name in names}


def world(local: Local, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """All points in world axes, in the order of `local`."""
    placed = [p if k == 0 else positions[k - 1] + p @ R[k - 1].T for k, p in local.items()]
    return np.concatenate(placed) if placed else np.zeros((0, 3))


def force_lines(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(n, 2, 3): constraint forces of the run at its time, the largest half the model long."""
    if state.run is None:
        return np.zeros((0, 2, 3))
    result, d = state.run.result, state.derived
    frame = min(int(np.searchsorted(result.t, state.playback.time)), len(result.t) - 1)
    forces = {name: np.asarray(wrench)[:, 3:] for name, wrench in result.constraint_force.items()}
    largest = max((float(np.abs(f).max()) for f in forces.values()), default=0.0)
    if not np.isfinite(largest) or largest == 0.0:
        return np.zeros((0, 2, 3))
    lines = []
    for constraint in state.model.constraints:
        if constraint.name in forces:
            k = d.number[constraint.body] - 1
            at = positions[k] + R[k] @ np.asarray(state.model.point_of(constraint))
            lines.append((at, at + 0.5 * d.size / largest * forces[constraint.name][frame]))
    return np.array(lines).reshape(-1, 2, 3)


def _lines(color: shapes.Color, pixels: float) -> Any:
    def add(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
        return scene.add_line_segments(
            name, points, colors=color, thickness=pixels, thickness_units="screen"
        )

    return add


def _points(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
    return scene.add_point_cloud(
        name, points, colors=COM, point_size=0.03 * state.derived.grain, point_shape="circle",
        precision="float32",
    )  # fmt: skip


def _name(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
    text = state.derived.names[k - 1]
    return scene.add_label(name, text, position=points[0], font_screen_scale=0.8)


def _arrows(scene: viser.SceneApi, points: np.ndarray, size: float) -> list[Any]:
    if len(points) == 0:
        return []
    node = scene.add_arrows(
        "/forces", points, colors=FORCE, shaft_radius=0.008 * size, head_radius=0.022 * size,
        head_length=0.05 * size,
    )  # fmt: skip
    return [node]


LOCAL = {"axes": axes, "links": links, "coms": coms, "names": coms}
ADD = {"axes": _lines(AXIS, 4.0), "links": _lines(LINK, 2.5), "coms": _points, "names": _name}
