"""The nodes of the 3D view in viser: bodies, lights, floor and steps. Small models use one node per
body, large ones batched unit solids.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import viser

from pgraph_core.show import shapes, stage
from pgraph_core.show.bodies import Look

from ..core.bridge import at_rest

Clicked = Callable[[int, int], None]  # client, number of the body
Dragged = Callable[[int, int, viser.SceneNodeDragEvent], None]  # the same, and the drag
PULLING = "cmd/ctrl"  # held while the mouse pulls on a body; else it poses it


class Bodies(Protocol):
    """The drawn bodies for one model."""

    def show(self, looks: Sequence[Look]) -> None: ...
    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None: ...
    def fade(self, opacity: float | None, visible: bool) -> None: ...
    def remove(self) -> None: ...


class SeparateBodies:
    """One node per body, with a child for each additional colour. Only changes are sent."""

    def __init__(self, server: viser.ViserServer, clicked: Clicked, dragged: Dragged):
        self._server = server
        self._clicked, self._dragged = clicked, dragged
        self._drawn: list[tuple[Look, list[viser.MeshHandle]]] = []  # by number

    def show(self, looks: Sequence[Look]) -> None:
        for _, nodes in self._drawn[len(looks) :]:
            _remove(nodes)
        del self._drawn[len(looks) :]
        for k, look in enumerate(looks, 1):
            if k > len(self._drawn) or not self._drawn[k - 1][0].alike(look):
                if k <= len(self._drawn):
                    _remove(self._drawn[k - 1][1][1:])
                self._drawn[k - 1 : k] = [(look, self._nodes(look, k))]

    def _nodes(self, look: Look, number: int) -> list[viser.MeshHandle]:
        """Return the body's node and its children."""
        parts = parts_of(look)
        names = [f"/bodies/{number}", *(f"/bodies/{number}/{i}" for i in range(1, len(parts)))]
        return [self._node(name, *part, number) for name, part in zip(names, parts.items())]

    def _node(
        self,
        name: str,
        paint: tuple[shapes.Color, float],
        pieces: Sequence[shapes.Piece],
        number: int,
    ) -> viser.MeshHandle:
        solid, (color, opacity) = shapes.creased(shapes.mesh(pieces)), paint
        node = self._server.scene.add_mesh_simple(
            name,
            solid.vertices,
            solid.faces,
            color=color,
            opacity=_faded(opacity, None),
        )
        at_rest(node)

        @node.on_click
        async def _(event: viser.SceneNodePointerEvent) -> None:
            self._clicked(event.client_id, number)

        @node.on_drag("left")
        @node.on_drag("left", modifier=PULLING)
        async def _(event: viser.SceneNodeDragEvent) -> None:
            self._dragged(event.client_id, number, event)

        return node

    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None:
        for (_, nodes), p, quaternion in zip(self._drawn, positions, wxyz):
            nodes[0].position, nodes[0].wxyz = p, quaternion

    def fade(self, opacity: float | None, visible: bool) -> None:
        for look, nodes in self._drawn:
            for node, (_, own) in zip(nodes, parts_of(look)):
                node.opacity = _faded(own, opacity) if visible else 0.0  # overlays hang on it
                node.cast_shadow = visible

    def remove(self) -> None:
        for _, nodes in self._drawn:
            _remove(nodes)
        self._drawn = []


def parts_of(look: Look) -> dict[tuple[shapes.Color, float], list[shapes.Piece]]:
    """Group the pieces of a body by colour and opacity."""
    found: dict[tuple[shapes.Color, float], list[shapes.Piece]] = defaultdict(list)
    for piece in look.pieces:
        found[piece.color or look.color, piece.opacity].append(piece)
    return found or {(look.color, 1.0): []}


def _faded(own: float, opacity: float | None) -> float | None:
    """Return a piece's `own` opacity multiplied by the fading, or None for 1."""
    return None if opacity is None and own == 1.0 else own * (1.0 if opacity is None else opacity)


def _remove(nodes: Sequence[viser.MeshHandle]) -> None:
    """Remove nodes, starting with the children."""
    for node in reversed(nodes):
        node.remove()


class BatchedBodies:
    """One node per kind of solid, with scaled and positioned unit solids as instances."""

    def __init__(self, server: viser.ViserServer, clicked: Clicked, dragged: Dragged):
        self._server = server
        self._clicked, self._dragged = clicked, dragged
        self._batches: list[tuple[np.ndarray, np.ndarray, np.ndarray, float, Any]] = []
        self._looks: list[Look] = []  # by number

    def show(self, looks: Sequence[Look]) -> None:
        before, self._looks = self._looks, list(looks)
        same = len(before) == len(looks) and all(map(Look.alike, before, looks))
        if self._batches and same:
            return
        self.remove()
        found: dict[Any, list[tuple[int, shapes.Piece]]] = defaultdict(list)
        for k, look in enumerate(looks, 1):
            for piece in look.pieces:
                solid = piece.kind, piece.file, round(piece.taper, 2), piece.opacity
                found[solid].append((k, piece))
        for i, ((kind, file, taper, opacity), parts) in enumerate(found.items()):
            plain = not file and taper == opacity == 1.0
            name = f"/bodies/{kind}" if plain else f"/bodies/{kind} {i}"
            solid = shapes.creased(shapes.unit(kind, file, taper))
            self._batches.append(self._batch(name, solid, parts))

    def _batch(self, name: str, solid: Any, parts: list[tuple[int, shapes.Piece]]) -> Any:
        owner = np.array([k for k, _ in parts])
        local = np.array([piece.position for _, piece in parts])
        turned = shapes.to_wxyz(np.array([piece.rotation for _, piece in parts]))
        node = self._server.scene.add_batched_meshes_simple(
            name,
            solid.vertices,
            solid.faces,
            batched_wxyzs=turned,
            batched_positions=local,
            batched_scales=np.array([piece.size for _, piece in parts]),
            batched_colors=np.array([p.color or self._looks[k - 1].color for k, p in parts]),
            opacity=_faded(parts[0][1].opacity, None),
            lod="off",
        )

        @node.on_click
        async def _(event: viser.SceneNodePointerEvent) -> None:
            if event.instance_index is not None:
                self._clicked(event.client_id, int(owner[event.instance_index]))

        @node.on_drag("left")
        @node.on_drag("left", modifier=PULLING)
        async def _(event: viser.SceneNodeDragEvent) -> None:
            if event.instance_index is not None:
                self._dragged(event.client_id, int(owner[event.instance_index]), event)

        return owner, local, turned, parts[0][1].opacity, node

    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None:
        R = shapes.to_matrix(wxyz)
        for owner, local, turned, _, node in self._batches:
            k = owner - 1
            at = (positions[k] + np.einsum("nij,nj->ni", R[k], local)).astype(np.float32)
            facing = shapes.times(wxyz[k], turned).astype(np.float32)
            if not np.array_equal(node.batched_positions, at):
                node.batched_positions = at
            if not np.array_equal(node.batched_wxyzs, facing):
                node.batched_wxyzs = facing

    def fade(self, opacity: float | None, visible: bool) -> None:
        for *_, own, node in self._batches:
            node.opacity, node.visible = _faded(own, opacity), visible

    def remove(self) -> None:
        for *_, node in self._batches:
            node.remove()
        self._batches = []


# -- around the bodies


def light(scene: viser.SceneApi, dark: bool, up: str) -> None:
    """Add a key light, sky light and cool rim light from behind, on a plain background.

    The page casts shadows itself, with one shadow map per light instead of viser's three.
    """
    tones = stage.DARK if dark else stage.LIGHT
    lights = (
        ("key", stage.KEY, stage.WARM, tones.key),
        ("sky", stage.SKY, stage.WARM, tones.sky),
        ("rim", stage.RIM, stage.COOL, tones.rim),
    )
    for name, towards, color, intensity in lights:
        scene.add_light_directional(
            f"/light/{name}", color=color, intensity=intensity, position=stage.turned(towards, up),
            cast_shadow=False,
        )  # fmt: skip
    scene.add_light_hemisphere(
        "/light/around", sky_color=tones.above, ground_color=tones.below, intensity=tones.around,
        position=stage.GRID[up][1],
    )  # fmt: skip
    scene.set_background_image(np.full((16, 16, 3), tones.canvas, np.uint8), format="png")


def floor(
    scene: viser.SceneApi, model: Any, size: float, dark: bool, low: float = 0.0
) -> viser.GridHandle:
    """Add the ground plane, drawn `low` [m] below it, with lines and shadows that fade out."""
    plane, up = stage.GRID[model.up]
    tones, cell = stage.DARK if dark else stage.LIGHT, shapes.spaced(size)
    return scene.add_grid(
        "/floor",
        plane=plane,
        infinite_grid=True,
        cell_size=cell / 5,
        section_size=cell,
        cell_color=tones.line,
        section_color=tones.line,
        section_thickness=1.2,
        plane_color=tones.floor,
        plane_opacity=1.0,
        shadow_opacity=tones.shadow,
        fade_distance=12 * size,
        fade_strength=size,  # the page's own shader takes it for the size of the model
        position=-low * np.asarray(model.ground_normal),
        wxyz=stage.tilt(np.array(up), np.asarray(model.ground_normal)),
    )


def steps(scene: viser.SceneApi, model: Any) -> Any:
    """Add the steps as solids on the plane, or return None if there are none."""
    if not model.ground.steps:
        return None
    corners = np.concatenate([stage.solid(model, step) for step in model.ground.steps])
    first = 8 * np.arange(len(model.ground.steps))[:, None, None]
    faces = (np.array(stage.BOX) + first).reshape(-1, 3)
    look = {"color": stage.STEP, "side": "double", "flat_shading": True, "cast_shadow": False}
    return scene.add_mesh_simple("/steps", corners, faces, **look)
