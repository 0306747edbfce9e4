"""The bodies in 3D: a node each in small models, batches of scaled unit solids in large ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
import viser

import pgraph_core as pg

from ..core.state import State
from ..core.views import at_rest
from . import shapes

SEPARATE = 50  # bodies up to which each is a node of its own
Clicked = Callable[[int, int], None]  # client, number of the body
Pulled = Callable[[int, int, viser.SceneNodeDragEvent], None]  # the same, and the drag
PULLING = "cmd/ctrl"  # held while the mouse pulls on a body


class Bodies(Protocol):
    """The drawn bodies of one model."""

    def show(self, state: State) -> None: ...
    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None: ...
    def fade(self, opacity: float | None, visible: bool) -> None: ...
    def remove(self) -> None: ...


def links(state: State, number: int) -> tuple[tuple[float, float, float], ...]:
    """Link vectors of the children of a body: where they hang on it, in its axes at q = 0."""
    d = state.derived
    return tuple(state.model.body(d.names[k - 1]).link for k in d.children[number])


def pieces(state: State, number: int) -> tuple[shapes.Piece, ...]:
    """What body `number` is drawn as."""
    return shapes.pieces(state.model.body(state.derived.names[number - 1]), links(state, number))


class SeparateBodies:
    """A node a body; only bodies that look different are sent again."""

    def __init__(self, server: viser.ViserServer, clicked: Clicked, pulled: Pulled):
        self._server = server
        self._clicked, self._pulled = clicked, pulled
        self._drawn: list[tuple[Any, viser.MeshHandle]] = []  # (looks, node) by number

    def show(self, state: State) -> None:
        d = state.derived
        for _, node in self._drawn[len(d.names) :]:
            node.remove()
        del self._drawn[len(d.names) :]
        for k, name in enumerate(d.names, 1):
            body = state.model.body(name)
            looks = (body.shape, links(state, k), body.tip, body.com, body.mass, d.colors[k - 1])
            if k > len(self._drawn) or self._drawn[k - 1][0] != looks:
                self._drawn[k - 1 : k] = [(looks, self._node(state, k))]

    def _node(self, state: State, number: int) -> viser.MeshHandle:
        solid = shapes.mesh(pieces(state, number))
        node = self._server.scene.add_mesh_simple(
            f"/bodies/{number}",
            solid.vertices,
            solid.faces,
            color=state.derived.colors[number - 1],
            flat_shading=len(solid.faces) < 100,
        )
        at_rest(node)

        @node.on_click
        async def _(event: viser.SceneNodePointerEvent) -> None:
            self._clicked(event.client_id, number)

        @node.on_drag("left", modifier=PULLING)
        async def _(event: viser.SceneNodeDragEvent) -> None:
            self._pulled(event.client_id, number, event)

        return node

    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None:
        for (_, node), p, quaternion in zip(self._drawn, positions, wxyz):
            node.position, node.wxyz = p, quaternion

    def fade(self, opacity: float | None, visible: bool) -> None:
        for _, node in self._drawn:
            node.opacity = opacity if visible else 0.0  # overlays hang on it
            node.cast_shadow = visible

    def remove(self) -> None:
        for _, node in self._drawn:
            node.remove()
        self._drawn = []


class Made(NamedTuple):
    """A body as it is drawn, and what that was made from."""

    body: pg.Body
    links: tuple[tuple[float, float, float], ...]
    pieces: tuple[shapes.Piece, ...]
    color: tuple[int, int, int]


def _alike(before: list[Made], now: list[Made]) -> bool:
    """Whether two lists of bodies look the same."""
    return len(before) == len(now) and all(
        a.color == b.color and (a.pieces is b.pieces or _looks(a) == _looks(b))
        for a, b in zip(before, now)
    )


def _looks(made: Made) -> list[Any]:
    return [(p.kind, p.file, p.size, p.position, p.rotation.tobytes()) for p in made.pieces]


class BatchedBodies:
    """One node a kind of solid; each instance is a unit solid, scaled and placed."""

    def __init__(self, server: viser.ViserServer, clicked: Clicked, pulled: Pulled):
        self._server = server
        self._clicked, self._pulled = clicked, pulled
        self._batches: list[tuple[np.ndarray, np.ndarray, np.ndarray, Any]] = []
        self._made: list[Made] = []  # by number

    def show(self, state: State) -> None:
        before, self._made = self._made, self._made_of(state)
        if self._batches and _alike(before, self._made):
            return  # an edit of something else: what is drawn stays
        self.remove()
        found: dict[tuple[str, str], list[tuple[int, shapes.Piece]]] = defaultdict(list)
        for k, (*_, solids, _) in enumerate(self._made, 1):
            for piece in solids:
                found[piece.kind, piece.file].append((k, piece))
        for i, ((kind, file), parts) in enumerate(found.items()):
            name = f"/bodies/{kind} {i}" if file else f"/bodies/{kind}"
            self._batches.append(self._batch(state, name, shapes.unit(kind, file), parts))

    def _made_of(self, state: State) -> list[Made]:
        """What every body is drawn as; made anew for bodies that are others than before."""
        found: list[Made] = []
        for k, (name, color) in enumerate(zip(state.derived.names, state.derived.colors), 1):
            body, ends = state.model.body(name), links(state, k)
            before = self._made[k - 1] if k <= len(self._made) else None
            if before and before.body is body and before.links == ends:
                found.append(before._replace(color=color))
            else:
                found.append(Made(body, ends, shapes.pieces(body, ends), color))
        return found

    def _batch(
        self, state: State, name: str, solid: Any, parts: list[tuple[int, shapes.Piece]]
    ) -> Any:
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
            batched_colors=np.array([state.derived.colors[k - 1] for k, _ in parts]),
            flat_shading=len(solid.faces) < 100,
            lod="off",
        )

        @node.on_click
        async def _(event: viser.SceneNodePointerEvent) -> None:
            if event.instance_index is not None:
                self._clicked(event.client_id, int(owner[event.instance_index]))

        @node.on_drag("left", modifier=PULLING)
        async def _(event: viser.SceneNodeDragEvent) -> None:
            if event.instance_index is not None:
                self._pulled(event.client_id, int(owner[event.instance_index]), event)

        return owner, local, turned, node

    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None:
        R = shapes.to_matrix(wxyz)
        for owner, local, turned, node in self._batches:
            k = owner - 1
            at = (positions[k] + np.einsum("nij,nj->ni", R[k], local)).astype(np.float32)
            facing = shapes.times(wxyz[k], turned).astype(np.float32)
            if not np.array_equal(node.batched_positions, at):
                node.batched_positions = at
            if not np.array_equal(node.batched_wxyzs, facing):
                node.batched_wxyzs = facing

    def fade(self, opacity: float | None, visible: bool) -> None:
        for *_, node in self._batches:
            node.opacity, node.visible = opacity, visible

    def remove(self) -> None:
        for *_, node in self._batches:
            node.remove()
        self._batches = []
