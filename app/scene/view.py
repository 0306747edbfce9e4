"""The 3D view: stage, bodies at their poses, ground, and each page's selection."""

from __future__ import annotations

import threading
from collections.abc import Callable
from importlib import import_module
from typing import Any, cast

import numpy as np
import viser

from pgraph_core.show import shapes
from pgraph_core.show.bodies import SEPARATE, Look
from pgraph_core.show.notebook import between

from ..constraints import Part
from ..constraints.update import OpenPart
from ..core.bridge import Bridge, at_rest
from ..core.events import Event
from ..core.views import Host, Payload, Place, topic
from ..pose import poses
from ..pose.update import DragBody, Pull
from ..pose.view import Gizmos
from ..run import GoLiveHere, Run
from ..session import Select
from . import Client, State, Unreadable, marks, nodes, ties
from .camera import CameraView, ground
from .camera import viewpoint as viewpoint
from .marks import looks
from .nodes import (
    PULLING,
    BatchedBodies,
    Bodies,
    SeparateBodies,
    parts_of,
)
from .overlays import Opened, Overlays

INSIDE = {"links", "coms", "inertias", "frames", "points"}  # is seen only through the bodies
MOST_FILLED = 30  # bodies of a page
ABOVE = 0.02  # height of a fill over the size of bodies: clear of its neighbours' facets
BEHIND = 0.15  # opacity of what is selected where something is before it
CENTRE = 0.015  # radius of the mark of a mass centre over the size of bodies


class SceneView:
    def __init__(self, bridge: Bridge, send: Callable[[Event], None]):
        self._bridge, self._server = bridge, bridge.server
        server = bridge.server
        self._names: tuple[str, ...] = ()
        self._bodies: Bodies | None = None
        self._looks: list[Look] = []  # by number
        self._overlays = Overlays(server, self._clicked_part)
        self._opened: dict[int, Opened] = {}  # by client
        self._told: dict[int, Any] = {}  # by client: names of the marks that open something
        self._selected: dict[int, list[viser.FrameHandle]] = {}  # by client: `_filled`
        self._made_from: dict[int, Any] = {}  # sources of the nodes
        self._gizmos = Gizmos(server, send)
        self._boxes: tuple[str, ...] = ()  # notices about meshes that cannot be read
        self._send = send
        self._state: State | None = None
        # it takes long to import, and every body is drawn with it: ready when the first page is.
        # Two threads that import what it needs of SciPy at once can lock each other.
        import_module("scipy.spatial")
        threading.Thread(target=import_module, args=("trimesh",), daemon=True).start()
        self._grips: dict[int, tuple[float, float, float]] = {}  # by client, in the body's axes

    def render(self, old: State, new: State) -> None:
        self._state = new
        if self._bodies is None and not any(page.aspect for page in new.clients.values()):
            return  # the first page gets its table first: drawing in 3D may be slow there
        recolored = {"branches"} & (new.shown ^ old.shown)
        rebuilt = self._bodies is None or new.derived is not old.derived or bool(recolored)
        with self._server.atomic():
            if rebuilt:
                self._rebuild(new)
            self._select(old, new, rebuilt)
            moved = any((
                new.playback.time != old.playback.time,
                new.run is not old.run,
                new.pose is not old.pose,
            ))  # fmt: skip
            self._draw(old, new, rebuilt, moved)

    def _draw(self, old: State, new: State, rebuilt: bool, moved: bool) -> None:
        """Draw the bodies and their overlays, as far as they have changed."""
        at = poses(new)
        pages = new.clients is not old.clients
        if rebuilt or moved or pages:
            self._place(new)
            self._gizmos.render(new, *at, rebuilt=rebuilt)
        if rebuilt or new.shown != old.shown:
            assert self._bodies is not None
            self._bodies.fade(0.35 if new.shown & INSIDE else None, "shapes" in new.shown)
        if rebuilt or moved or new.shown != old.shown or new.request is not old.request:
            self._overlays.render(new, *at)
        if rebuilt or moved or new.pull is not old.pull:
            self._overlays.pull(new, *at)
        self._open(old, new, rebuilt or moved or new.shown != old.shown)

    def _open(self, old: State, new: State, changed: bool) -> None:
        """Draw the connection that is open on a page, on that page only, and tell all names."""
        joined = self._overlays.joined
        names = {kind: joined[kind].names() for kind in ties.OPENS if kind in joined}
        for client in self._told.keys() - new.clients.keys():
            self._opened.pop(client, None)
            del self._told[client]
        for client, page in new.clients.items():
            if self._told.get(client) != names:
                self._told[client] = names
                self._bridge.send(client, "joined", names)
            before = old.clients.get(client, Client())
            if page.opened == before.opened and (not changed or page.opened is None):
                continue
            if client not in self._opened:
                handle = self._server.get_clients().get(client)
                if page.opened is None or handle is None:
                    continue
                self._opened[client] = Opened(handle.scene)
            self._opened[client].render(page.opened, joined)

    def _clicked_part(self, client: int, part: ties.Part) -> None:
        """Open what a mark shows."""
        page = self._state.clients.get(client) if self._state else None
        if page is not None and not page.aims and not page.picking:
            self._send(OpenPart(client, cast(Part, part[0]), part[1]))

    def _clicked(self, client: int, number: int) -> None:
        state = self._state
        page = state.clients.get(client) if state else None
        if state is not None and number <= len(self._names) and not (page and page.aims):
            self._send(Select(client, state.row_of(self._names[number - 1])))

    def _dragged(self, client: int, number: int, event: viser.SceneNodeDragEvent) -> None:
        """Handle a drag on a body. Its grip is fixed in body axes where the drag begins."""
        state = self._state
        pulls = event.modifier == PULLING
        if state is None or number > len(self._names) or (state.going and not pulls):
            return  # a live run is pulled, not posed
        if pulls and state.going is None:
            if event.phase == "start" and state.run is not None:
                self._send(GoLiveHere(client))
            if state.run is None:
                return
        positions, wxyz = poses(state)
        if event.phase == "start" or client not in self._grips:
            arm = np.asarray(event.start_position) - positions[number - 1]
            x, y, z = (shapes.to_matrix(wxyz[number - 1]).T @ arm).tolist()
            self._grips[client] = x, y, z
        target = None if event.phase == "end" else event.end_position
        body, grip = self._names[number - 1], self._grips[client]
        if pulls:
            self._send(Pull(client, body, grip, target))
        elif target is not None:
            self._send(DragBody(client, body, grip, target))

    def _rebuild(self, state: State) -> None:
        few = len(state.derived.names) <= SEPARATE
        self._overlays.clear(few)
        kind = SeparateBodies if few else BatchedBodies
        if not isinstance(self._bodies, kind):
            if self._bodies is not None:
                self._bodies.remove()
            self._bodies = kind(self._server, self._clicked, self._dragged)
        self._looks = looks(state, self._looks)
        self._bodies.show(self._looks)
        self._names = state.derived.names
        boxes = shapes.unreadable(state.whole.bodies)
        if boxes and boxes != self._boxes:
            self._send(Unreadable(boxes))
        self._boxes = boxes

    def _place(self, state: State) -> None:
        positions, wxyz = poses(state)
        assert self._bodies is not None
        self._bodies.place(positions, wxyz)
        for client, frames in self._selected.items():
            for name, frame in zip(_filled(state, state.clients[client]), frames):
                k = state.derived.number[name] - 1
                frame.position, frame.wxyz = positions[k], wxyz[k]

    def _select(self, old: State, new: State, rebuilt: bool) -> None:
        """Draw the selection of a page as filled bodies, on that page only."""
        for client in self._selected.keys() - new.clients.keys():
            del self._selected[client]
            self._made_from.pop(client, None)
        for client, now in new.clients.items():
            before = old.clients.get(client, Client())
            chosen = _filled(new, now)
            if not rebuilt and _filled(old, before) == chosen:
                continue
            drawn = [self._looks[new.derived.number[name] - 1] for name in chosen]
            made_from = [(one.body, one.links, one.color, new.derived.grain) for one in drawn]
            if client in self._selected and made_from == self._made_from.get(client):
                continue  # moves with its body
            self._made_from[client] = made_from
            for frame in self._selected.pop(client, []):
                frame.remove()
            handle = self._server.get_clients().get(client)
            if chosen and handle is not None:
                self._selected[client] = [
                    _filling(handle, look, new.derived.grain, k, look.body.name in new.model.row)
                    for k, look in enumerate(drawn)
                ]


def _filling(
    client: viser.ClientHandle, look: Look, size: float, at: int, marked: bool
) -> viser.FrameHandle:
    """Outline and tint one body, and mark its mass centre if asked. The page colours all of it."""
    node = f"/selected/{at}"
    frame = client.scene.add_frame(node, show_axes=False)
    drawn = [(part, look.color, look.pieces) for part in ("outline", "behind")]
    for i, ((color, _), pieces) in enumerate(parts_of(look).items()):
        drawn.append((f"fill/{i}" if i else "fill", color, tuple(pieces)))
    for part, color, pieces in drawn:
        solid = shapes.mesh(pieces)
        solid.vertices += ABOVE * size * solid.vertex_normals
        if part != "outline":
            solid = shapes.creased(solid)
        client.scene.add_mesh_simple(
            f"{node}/{part}",
            solid.vertices,
            solid.faces,
            color=color,
            opacity=BEHIND if part == "behind" else None,
            side="back" if part == "outline" else "front",
            cast_shadow=False,
            receive_shadow=False,
        )
    client.scene.add_icosphere(
        f"{node}/centre", radius=CENTRE * size, position=look.body.com,
        visible=look.body.mass > 0 and marked,
        cast_shadow=False, receive_shadow=False,
    )  # fmt: skip
    return at_rest(frame)


def _filled(state: State, page: Client) -> tuple[str, ...]:
    """Return the bodies drawn for the rows selected on a page, the last one first."""
    last = page.selection
    if last is None:
        return ()
    rows = (last, *(name for name in page.selected if name != last))
    return state.drawn_as(rows[:MOST_FILLED])


COLOR, OPACITY = (120, 128, 140), 0.28


class GhostView:
    """The most recently kept run, drawn as a ghost."""

    def __init__(self, server: viser.ViserServer):
        self._server = server
        self._nodes: list[viser.MeshHandle] = []

    def render(self, old: State, new: State) -> None:
        before, ghost = (state.runs[-1].run if state.runs else None for state in (old, new))
        if ghost is not before:
            for node in self._nodes:
                node.remove()
            self._nodes = [] if ghost is None else self._drawn(ghost)
        if ghost is not None and self._nodes:
            self._place(ghost, new.playback.time)

    def _drawn(self, ghost: Run) -> list[viser.MeshHandle]:
        of = State(ghost.model, last_run=ghost)
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


class ForceView:
    """Force values at the arrow heads."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._sent: dict[int, list[Any]] = {}

    def render(self, old: State, new: State) -> None:
        shown = "forces" in new.shown
        positions, wxyz = poses(new)
        found = marks.pushes(new, positions, shapes.to_matrix(wxyz)) if shown else []
        for client, page in new.clients.items():
            values = marks.values(new, found, page.selected)
            if self._sent.get(client, []) != values:
                self._sent[client] = values
                self._bridge.send(client, "forces", values)
        for gone in self._sent.keys() - new.clients.keys():
            del self._sent[gone]


class StageView:
    """Draws light, canvas and floor of each page in its theme, and the steps of the ground."""

    def __init__(self, server: viser.ViserServer):
        self._server = server
        self._lit: dict[int, tuple[bool, str]] = {}  # by client: dark, which way is up
        self._floors: dict[int, object] = {}  # source of each floor
        self._ground: object = None  # source of the steps
        self._steps: Any = None
        server.scene.configure_default_lights(False)
        server.scene.configure_environment_map(None)  # viser's city

    def render(self, old: State, new: State) -> None:
        for gone in self._lit.keys() - new.clients.keys():
            del self._lit[gone]
            self._floors.pop(gone, None)
        model, handles = new.model, None
        if (model.ground, model.up) != self._ground:
            self._ground = model.ground, model.up
            if self._steps is not None:
                self._steps.remove()
            self._steps = nodes.steps(self._server.scene, model)
        for client, page in new.clients.items():
            lit = page.dark, model.up
            low = ground(new)
            floor = lit, model.ground_normal, new.framed, low
            if self._lit.get(client) == lit and self._floors.get(client) == floor:
                continue
            handles = self._server.get_clients() if handles is None else handles
            if page.aspect is None or (handle := handles.get(client)) is None:
                continue
            if self._lit.get(client) != lit:
                nodes.light(handle.scene, page.dark, model.up)
            nodes.floor(handle.scene, model, new.derived.size, page.dark, low)
            self._lit[client], self._floors[client] = lit, floor


def _chosen(state: State, page: Client) -> tuple[object, ...]:
    return page.gizmo, page.selection, page.follow


def switches(state: State, page: Client) -> Payload:
    """Return the available display options, the enabled ones, and the quantity moved by the
    gizmo."""
    listed = [
        {
            "what": what,
            "label": label,
            "on": page.follow if what == "follow" else what in state.shown,
        }
        for what, label in marks.showable(state)
    ]
    return {"switches": listed, "gizmo": page.gizmo, "selected": page.selection}


VIEWS = (
    Place(topic("show", switches, "derived", "shown", page=_chosen), 42, Host("show", "display")),
    Place(lambda desk: ForceView(desk.bridge), 67),
    Place(lambda desk: CameraView(desk.bridge), 68),
    Place(lambda desk: StageView(desk.bridge.server), 69),
    Place(lambda desk: SceneView(desk.bridge, desk.send), 70),
    Place(lambda desk: GhostView(desk.bridge.server), 71),
)
