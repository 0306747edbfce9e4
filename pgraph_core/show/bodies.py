"""Bodies in 3D, drawn by viser. Small models use one node per body, large ones batched unit
solids.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

import numpy as np

from . import shapes

if TYPE_CHECKING:
    import viser

MOMENTS = 40  # number of frames that pictures must contain
SEPARATE = 50  # bodies up to which each is a node of its own
Clicked = Callable[[int, int], None]  # client, number of the body
Dragged = Callable[[int, int, "viser.SceneNodeDragEvent"], None]  # the same, and the drag
FLAT = 200  # faces: boxes and cylinders keep their edges
PULLING = "cmd/ctrl"  # held while the mouse pulls on a body; else it poses it
Node = TypeVar("Node", bound="viser.SceneNodeHandle")


class Look(NamedTuple):
    """The drawn shape of one body, and its description."""

    body: Any  # with the fields of `pg.Body`
    links: tuple[tuple[float, float, float], ...]  # positions of its children's joints at q = 0 [m]
    pieces: tuple[shapes.Piece, ...]
    color: shapes.Color
    plain: bool = False  # drawn in the colour of its branch

    def alike(self, other: Look) -> bool:
        """Return True if both have the same appearance."""
        same = self.pieces is other.pieces or _drawn(self.pieces) == _drawn(other.pieces)
        return same and self.color == other.color


def _drawn(pieces: Sequence[shapes.Piece]) -> list[Any]:
    return [
        (p.kind, p.file, p.size, p.position, p.rotation.tobytes(), p.color, p.opacity, p.taper)
        for p in pieces
    ]


def looks(
    bodies: Sequence[Any], children: Sequence[Sequence[int]], colors: Sequence[shapes.Color],
    before: Sequence[Look] = (), plain: bool = False,
) -> list[Look]:  # fmt: skip
    """Return the looks of the bodies by number, reusing `before` if nothing changed.

    `plain`: in the bodies' colours; of those of their shapes what is dark or light stays.
    """
    found: list[Look] = []
    for k, (body, color) in enumerate(zip(bodies, colors)):
        links = tuple(bodies[child - 1].link for child in children[k + 1])
        known = before[k] if k < len(before) else None
        same = known is not None and known.body is body and known.links == links
        if known is not None and same and known.plain == plain:
            found.append(known._replace(color=color))
            continue
        pieces = shapes.pieces(body, links)
        if plain:
            pieces = tuple(replace(piece, color=shapes.shade(piece.color)) for piece in pieces)
        found.append(Look(body, links, pieces, color, plain))
    return found


def corners(pieces: Sequence[shapes.Piece]) -> np.ndarray:
    """Return the corners of bounding boxes around pieces, (n, 3), in body axes [m]."""
    which = np.array([*itertools.product((0, 1), repeat=3)])
    found = [p.position + shapes.bounds(p)[which, range(3)] @ p.rotation.T for p in pieces]
    return np.concatenate(found) if found else np.zeros((1, 3))


ROOM = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))  # 1 m, the size without a body


def extent(looks: Sequence[Look], positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return the corners of the drawn bodies at these poses (n, 3) [m], or of ROOM if none."""
    found = [p + corners(look.pieces) @ r.T for look, p, r in zip(looks, positions, R)]
    return np.concatenate(found) if found else ROOM


class Track:
    """The way of a mechanism through recorded poses (n, nb, 7), and all that is seen of it.

    If it travels further than its size, pictures keep it in the middle and move the ground.
    """

    def __init__(self, looks: Sequence[Look], poses: np.ndarray, up: np.ndarray):
        self.across = 1.0 - np.asarray(up)  # takes what is along the vertical out of a vector
        self.start = poses[0, 0, :3] if poses.shape[1] else np.zeros(3)
        first = extent(looks, poses[0, :, :3], shapes.to_matrix(poses[0, :, 3:]))
        gone = (poses[:, :1, :3] - self.start) * self.across
        still = shapes.diagonal(first)
        self.travels = bool(np.linalg.norm(gone, axis=-1).max(initial=0.0) > still)
        some = poses[np.unique(np.linspace(0, len(poses) - 1, MOMENTS).astype(int))]
        every = [extent(looks, p[:, :3] - self.gone(p), shapes.to_matrix(p[:, 3:])) for p in some]
        corners = np.concatenate(every)
        self.corners = corners if np.isfinite(corners).all() else first  # (m, 3) [m]
        self.size = shapes.diagonal(self.corners)  # [m]

    def gone(self, pose: np.ndarray) -> np.ndarray:
        """Return how far a picture of bodies at `pose` (nb, 7) has followed them, (3,) [m]."""
        return (pose[0, :3] - self.start) * self.across if self.travels else np.zeros(3)


class Bodies(Protocol):
    """The drawn bodies for one model."""

    def show(self, looks: Sequence[Look]) -> None: ...
    def place(self, positions: np.ndarray, wxyz: np.ndarray) -> None: ...
    def fade(self, opacity: float | None, visible: bool) -> None: ...
    def remove(self) -> None: ...


def at_rest(node: Node) -> Node:
    """Return `node` at its default pose, which is also sent to clients.

    viser 1.1.1 sends no pose that is the default, so a node removed and added under the same name
    would keep the pose of the old one.
    """
    for pose in ("wxyz", "position"):
        value = getattr(node, pose).copy()
        setattr(node, pose, value[::-1] + 1.0)
        setattr(node, pose, value)
    return node


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
        solid, (color, opacity) = shapes.mesh(pieces), paint
        node = self._server.scene.add_mesh_simple(
            name,
            solid.vertices,
            solid.faces,
            color=color,
            opacity=_faded(opacity, None),
            flat_shading=len(solid.faces) < FLAT,
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
            self._batches.append(self._batch(name, shapes.unit(kind, file, taper), parts))

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
            flat_shading=len(solid.faces) < FLAT,
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
