"""Overlays on the bodies: axes, links, masses, names, frames, points and forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import viser

from pgraph_core.rotation import frame_of
from pgraph_core.show import shapes
from pgraph_core.show.bodies import SEPARATE

from . import State, marks, ties

STAY = {"axes", "links"}  # lines of one look, whatever the model
AXIS, LINK, COM, FORCE = (224, 120, 20), (96, 106, 120), (200, 40, 150), (30, 160, 90)
INERTIA, POINT, CONE, PULL = (110, 80, 200), (220, 50, 40), (30, 160, 90), (230, 90, 20)
TRACK = (92, 100, 110)
METAL, LOAD, STEEL = (150, 158, 168), (214, 92, 40), (92, 100, 110)
SHAFT, HEAD = 0.01, (0.026, 0.05)  # radii of arrows and length of heads, of the model's size
NOWHERE = np.zeros(3)
NOTHING = ties.Joining(np.zeros((0, 2, 3)), np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3)))
WIDER = 1.15  # width of the opened part over that of the others
HIDDEN = 0.35  # opacity of the opened part where a body is before it
JOINING = {  # kind: solid, colour, opacity
    "springs": (shapes.coil, METAL, None),
    "pivots": (shapes.bracket, STEEL, None),
    "rods": (lambda: shapes.unit("cylinder"), METAL, None),
    "muscles": (lambda: shapes.unit("cylinder"), METAL, None),
    "beads": (lambda: shapes.unit("sphere"), STEEL, None),
    "balls": (lambda: shapes.unit("sphere"), STEEL, 0.35),
    "drums": (lambda: shapes.unit("cylinder"), STEEL, 0.35),
}
TRIAD = ((205, 45, 45), (45, 155, 60), (50, 90, 220))  # x, y, z


class Overlays:
    """Overlays as children of the body nodes, or one node per kind in large models.

    Children move with their bodies. Hidden overlays cost nothing.
    """

    def __init__(
        self, server: viser.ViserServer, clicked: Callable[[int, ties.Part], None] | None = None
    ):
        self._scene, self._clicked = server.scene, clicked
        self.joined: Mapping[str, ties.Joining] = {}  # drawn marks by kind
        self._nodes: dict[str, list[Any]] = {}
        self._solids: marks.Placed | None = None
        self._attached = True  # the nodes hang on those of bodies

    def clear(self, attached: bool) -> None:
        """Remove all overlays before the bodies are redrawn.

        Lines that hang on no body stay, to be moved where they have to be.
        """
        for kind in self._nodes.keys() - (set() if attached or self._attached else STAY):
            self._remove(kind)
        self._attached = attached

    def render(
        self, state: State, positions: np.ndarray, wxyz: np.ndarray, gone: np.ndarray = NOWHERE
    ) -> None:
        """Draw the overlays in `state.shown` for these body poses, all shifted back by `gone`."""
        large = "shapes" in state.shown and len(state.derived.names) > SEPARATE
        for kind in LOCAL:
            if kind in state.shown or (kind == "spine" and large):
                self._local(kind, state, positions - gone, wxyz)
            else:
                self._remove(kind)
        self._inertias(state, positions - gone, wxyz)
        self._joining(state, positions, wxyz, gone)
        self._forces(state, positions, wxyz, gone)

    def pull(self, state: State, positions: np.ndarray, wxyz: np.ndarray) -> None:
        """Draw an arrow from the point where the mouse pulls a body to the target."""
        self._remove("pull")
        if (pull := state.pull) is None or pull.body not in state.derived.number:
            return
        k = state.derived.number[pull.body] - 1
        at = positions[k] + shapes.to_matrix(wxyz[k]) @ np.asarray(pull.point)
        line = np.array([(at, np.asarray(pull.target))])
        self._nodes["pull"] = _arrows(self._scene, "/pull", line, state.derived.size, PULL)

    def _forces(
        self, state: State, positions: np.ndarray, wxyz: np.ndarray, gone: np.ndarray
    ) -> None:
        wanted = state.shown & {"forces", "cones"}
        found = marks.pushes(state, positions, shapes.to_matrix(wxyz)) if wanted else []
        metres = marks.scale(state) if found else 0.0
        arrows = marks.arrows(found if "forces" in wanted else [], metres) - gone
        self._arrows("forces", arrows.astype(np.float32), state.derived.size, FORCE)
        normal = np.asarray(state.model.ground_normal)
        at, size = marks.cones(found if "cones" in wanted else [], metres, normal)
        turned = shapes.to_wxyz(frame_of(normal)[None])
        self._batch(
            "cones", shapes.cone, at - gone, np.repeat(turned, len(at), 0), size, CONE, 0.25
        )

    def _inertias(self, state: State, positions: np.ndarray, wxyz: np.ndarray) -> None:
        if "inertias" not in state.shown:
            self._remove("inertias")
            return
        if not self._nodes.get("inertias"):
            self._solids = marks.ellipsoids(state)
        assert self._solids is not None
        at, turned = marks.placed(self._solids, positions, wxyz)
        size = self._solids.size
        self._batch("inertias", lambda: shapes.unit("sphere"), at, turned, size, INERTIA, 0.55)

    def _joining(
        self, state: State, positions: np.ndarray, wxyz: np.ndarray, gone: np.ndarray
    ) -> None:
        """Draw springs, rods, brackets of pivots, paths, and arrows for the applied forces."""
        on, R = "joining" in state.shown, shapes.to_matrix(wxyz)
        self.joined = ties.joinings(state, positions, R) if on else {}
        for kind, (solid, color, opacity) in JOINING.items():
            found, name = self.joined.get(kind, NOTHING), f"joining/{kind}"
            made = self._batch(
                name, solid, found.at - gone, found.wxyz, found.size,
                color if found.colors is None else found.colors.astype(np.uint8), opacity,
                shadow=opacity is None,
            )  # fmt: skip
            if made and kind in ties.OPENS and self._clicked is not None:
                self._open_on_click(kind, self._nodes[name][0], self._clicked)
        arrows = marks.loads(state, positions, R) if on else np.zeros((0, 2, 3))
        self._arrows("loads", (arrows - gone).astype(np.float32), state.derived.size, LOAD)

    def _open_on_click(
        self, kind: str, node: Any, clicked: Callable[[int, ties.Part], None]
    ) -> None:
        """Tell about clicks on the marks of one node which part they show."""

        @node.on_click
        async def _(event: viser.SceneNodePointerEvent) -> None:
            of, k = self.joined.get(kind, NOTHING).of, event.instance_index
            if k is not None and k < len(of) and (part := of[k]) is not None:
                clicked(event.client_id, part)

    def _arrows(self, kind: str, arrows: np.ndarray, size: float, color: shapes.Color) -> None:
        """Draw arrows of one kind in their node, which is hidden if there are none."""
        drawn = self._nodes.get(kind)
        if not drawn:
            self._nodes[kind] = _arrows(self._scene, f"/{kind}", arrows, size, color)
            return
        if len(arrows):
            drawn[0].points = arrows
        drawn[0].visible = len(arrows) > 0

    def _batch(
        self, kind: str, solid: Any, at: Any, wxyz: Any, size: Any, color: Any, opacity: Any,
        shadow: bool = False,
    ) -> bool:  # fmt: skip
        """Draw solids of one kind in their node, and return whether it is new."""
        return _batched(
            self._scene, self._nodes, kind, solid, at, wxyz, size, color, opacity, shadow
        )

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
        placed = marks.world(points, positions, shapes.to_matrix(wxyz))
        if kind == "names":
            self._move_names(state, placed)
            return
        placed, drawn = placed.astype(np.float32), self._nodes.get(kind)
        if drawn and drawn[0].points.shape == placed.shape:
            if not np.array_equal(drawn[0].points, placed):
                drawn[0].points = placed
            return
        self._remove(kind)
        if len(placed):
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


class Opened:
    """The part that is open on a page, drawn on that page alone over all else."""

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._nodes: dict[str, list[Any]] = {}

    def render(self, part: ties.Part | None, joined: Mapping[str, ties.Joining]) -> None:
        """Draw the marks of a part. The page gives them its colour."""
        for kind in ties.OPENS:
            solid, color, _ = JOINING[kind]
            found = joined.get(kind, NOTHING).only(part)
            for name, opacity in (("behind", HIDDEN), ("fill", None)):
                _batched(
                    self._scene, self._nodes, f"opened/{kind}/{name}", solid, found.at, found.wxyz,
                    found.size * (WIDER, WIDER, 1.0), color, opacity, False,
                )  # fmt: skip


def _batched(
    scene: viser.SceneApi, nodes: dict[str, list[Any]], kind: str, solid: Any, at: Any, wxyz: Any,
    size: Any, color: Any, opacity: Any, shadow: bool,
) -> bool:  # fmt: skip
    """Draw solids of one kind in their node, which is hidden if there are none.

    Return whether the node is new.
    """
    if drawn := nodes.get(kind):
        node = drawn[0]
        if len(at):
            node.batched_positions, node.batched_wxyzs = at, wxyz
            node.batched_scales = size
            if isinstance(color, np.ndarray):
                node.batched_colors = color
        node.visible = len(at) > 0
        return False
    if len(at) == 0:
        return False
    unit = solid()
    nodes[kind] = [
        scene.add_batched_meshes_simple(
            f"/{kind}", unit.vertices, unit.faces, batched_wxyzs=wxyz, batched_positions=at,
            batched_scales=size, batched_colors=color, opacity=opacity, lod="off",
            cast_shadow=shadow, receive_shadow=shadow,
        )
    ]  # fmt: skip
    return True


def _lines(color: shapes.Color, pixels: float) -> Any:
    def add(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
        return scene.add_line_segments(
            name, points, colors=color, thickness=pixels, thickness_units="screen"
        )

    return add


def _triads(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
    one = np.repeat(np.array(TRIAD, np.uint8)[:, None], 2, axis=1)
    colors = np.tile(one, (len(points) // 3, 1, 1))
    return scene.add_line_segments(
        name, points, colors=colors, thickness=3.0, thickness_units="screen"
    )


def _spine(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
    """Draw lines in the bodies' colours, so that parts thinner than a pixel remain visible."""
    owners = [n for n, lines in marks.spine(state).items() for _ in lines]
    hues = [shapes.HUES[shapes.hue_of(state.derived.branches[n - 1])] for n in owners]
    colors = np.array(hues, np.uint8)
    return scene.add_line_segments(
        name, points, colors=np.repeat(colors[:, None], 2, axis=1), thickness=4.0,
        thickness_units="screen",
    )  # fmt: skip


def _points(color: shapes.Color) -> Any:
    def add(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
        return scene.add_point_cloud(
            name, points, colors=color, point_size=0.03 * state.derived.grain,
            point_shape="circle", precision="float32",
        )  # fmt: skip

    return add


def _name(scene: viser.SceneApi, name: str, points: np.ndarray, state: State, k: int) -> Any:
    text = state.derived.names[k - 1]
    return scene.add_label(name, text, position=points[0], font_screen_scale=0.8)


def _arrows(
    scene: viser.SceneApi, name: str, points: np.ndarray, size: float, color: shapes.Color
) -> list[Any]:
    if len(points) == 0:
        return []
    node = scene.add_arrows(
        name, points, colors=color, shaft_radius=SHAFT * size, head_radius=HEAD[0] * size,
        head_length=HEAD[1] * size,
    )  # fmt: skip
    return [node]


LOCAL = {
    "axes": marks.axes, "tracks": marks.tracks, "links": marks.links, "coms": marks.coms,
    "names": marks.coms, "frames": marks.frames,
    "sites": marks.sites, "points": marks.points, "spine": marks.spine,
}  # fmt: skip
ADD = {
    "axes": _lines(AXIS, 4.0), "tracks": _lines(TRACK, 3.0), "links": _lines(LINK, 2.5),
    "coms": _points(COM), "names": _name, "frames": _triads,
    "sites": _triads, "points": _points(POINT), "spine": _spine,
}  # fmt: skip
