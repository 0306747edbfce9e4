"""The camera of each page, which frames a new model, takes named views and follows an animal."""

from __future__ import annotations

from itertools import count

import numpy as np
import viser

from pgraph_core.show import bodies, shapes, stage
from pgraph_core.show.stage import FRAMING, GRID, WHOLE, Free, Viewpoint, in_picture

from ..core.bridge import Bridge
from ..core.views import requests
from ..pose import poses
from ..run.runs import FEW, led
from . import Client, State, View, marks, ties
from .marks import looks

ALONG = "/along/{}"  # the node that cameras follow, one of its own for each model that is opened
CLEAR = 0.03  # height of a camera above the ground, and of the bodies of a mechanism, over its size
FILLS = 0.6  # least share of the picture that a model and its motion fill, in one direction
TYPICAL_ASPECT = 1.0  # width over height of the view at 1280 x 800


class CameraView:
    """Moves a camera only on request, or if the motion would leave the picture."""

    def __init__(self, bridge: Bridge):
        self._server, self._bridge = bridge.server, bridge
        self._framed = -1
        self._up = ""
        self._names = map(ALONG.format, count())
        self._along = bridge.server.scene.add_frame(next(self._names), show_axes=False)
        self._follows: dict[int, bool] = {}  # by page: whether its camera goes along
        self._views: dict[
            int, tuple[str, tuple[str, ...]]
        ] = {}  # view of each page, and the bodies in it

    def render(self, old: State, new: State) -> None:
        another = new.framed != self._framed or new.model.up != self._up
        over = old.playback.moves and not new.playback.moves
        edited = new.derived is not old.derived and not new.playback.moves
        posed = new.pose is not old.pose  # a camera that moves under a drag would disturb it
        grown = len(new.derived.names) > len(old.derived.names)
        changed = (
            new.last_run is not old.last_run
            or (edited and (grown or len(new.derived.names) <= FEW))
            or (new.playback.time != old.playback.time and new.playback.rests
                and not travelled(new).any())
        )  # fmt: skip
        turns = new.playback.rests != old.playback.rests  # from a motion to a moment, or back
        handles = self._server.get_clients()
        asked = {view.client: view.which for view in requests(old, new, View)}
        if another and (self._framed < 0 or any(page.aspect for page in new.clients.values())):
            self._framed, self._up = new.framed, new.model.up
            self._start(new)
        for client, page in new.clients.items():
            handle, before = handles.get(client), old.clients.get(client, Client())
            which, chosen = self._views.get(client, ("start", ()))
            if handle is None or page.aspect is None:
                continue
            if another or before.aspect is None:
                self._look(handle, new, page, "start")
            elif client in asked:
                self._look(handle, new, page, asked[client], page.selected)
            elif page.turned or (chosen and page.aspect == before.aspect):
                if (over or edited) and not holds(handle, new, page, poses(new)[0]).any():
                    self._look(handle, new, page, "fit")
            elif page.aspect != before.aspect:
                self._look(handle, new, page, which, chosen)
            elif turns or (
                (changed or page.follow != before.follow or (posed and page.reply != before.reply))
                and not fits(handle, new, page)
            ):
                self._look(handle, new, page, which, chosen, eased=True)
            if page.follow != self._follows.get(client):
                self._follows[client] = page.follow
                self._bridge.send(client, "follow", page.follow)
        if (at := followed(new)) != tuple(self._along.position):
            self._along.position = at
        for known in (self._follows, self._views):
            for gone in known.keys() - new.clients.keys():
                del known[gone]

    def _look(
        self, handle: viser.ClientHandle, state: State, page: Client, which: str,
        selected: tuple[str, ...] = (), eased: bool = False,
    ) -> None:  # fmt: skip
        """Set a camera, and again after each resize of the view until a person moves the camera."""
        self._views[handle.client_id] = which, selected
        with handle.atomic():  # the page hears of both at once: its camera moves in each picture
            self._bridge.send(handle.client_id, "framed", [self._along.name, followed(state)])
            look(handle, state, page, which, selected)
            if eased:
                self._bridge.send(handle.client_id, "eased", True)

    def _start(self, state: State) -> None:
        """Set the up direction and the initial camera of new pages for another model."""
        up, size = GRID[state.model.up][1], state.derived.size
        self._server.scene.set_up_direction(up)
        self._along.remove()  # pages shift no camera of this model by moves of the last one
        self._along = self._server.scene.add_frame(
            next(self._names), show_axes=False, position=followed(state)
        )
        start = self._server.initial_camera
        # viser returns to this after a change of `up`, so it has to suit the pages that are open
        known = [(page.aspect, *page.free) for page in state.clients.values() if page.aspect]
        aspect, *free = np.min(known or [(TYPICAL_ASPECT, *WHOLE)], axis=0).tolist()
        start.position, start.look_at = viewpoint(state, aspect, Free(*free))
        start.up, start.fov = up, FRAMING.field_of_view
        start.near, start.far = size / 100, 1000 * size


def look(
    handle: viser.ClientHandle, state: State, page: Client, which: str,
    selected: tuple[str, ...] = (),
) -> None:  # fmt: skip
    """Point the camera of one page at the model, or at the selection if `which` is "fit"."""
    at, size = handle.camera, state.derived.size
    up = np.array(GRID[state.model.up][1])
    if which in ("fit", "centre"):
        way = np.asarray(at.position) - np.asarray(at.look_at)
        way = way / np.linalg.norm(way)
        if np.linalg.norm(np.cross(up, way)) < FRAMING.lean / 2:
            way = stage.towards(state.model.up, "top")
    else:
        way = start(state) if which == "start" else stage.towards(state.model.up, which)
    aspect = TYPICAL_ASPECT if page.aspect is None else page.aspect
    corners = extent(state, selected if which in ("fit", "centre") else ())
    seen = stage.fitted(corners, up, way, aspect, page.free)
    if which == "centre":
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        far = float(np.linalg.norm(np.asarray(at.position) - np.asarray(at.look_at)))
        seen = Viewpoint(middle + far * way, middle)
    seen = above_ground(state, seen, up)
    at.near, at.far = size / 100, 1000 * size
    at.up_direction = up
    # viser sends nothing if the camera that it last heard of is the one asked for. The page may
    # have another one by then, so a second camera goes first: the last view asked for always holds.
    far = np.linalg.norm(seen.position - seen.target) + 1e-3 * np.linalg.norm(seen.position)
    at.position = seen.position + 0.1 * far * way
    at.position, at.look_at = seen


def above_ground(state: State, seen: Viewpoint, up: np.ndarray) -> Viewpoint:
    """Create a viewpoint above the drawn ground, which would else hide a lying model."""
    normal = np.asarray(state.model.ground_normal)
    missing = CLEAR * state.derived.size - ground(state) - seen.position @ normal
    if missing <= 0 or (seen.position - seen.target) @ normal < -1e-9:
        return seen
    lift = missing / (normal @ up) * up
    return Viewpoint(seen.position + lift, seen.target + lift)


def fits(handle: viser.ClientHandle, state: State, page: Client) -> bool:
    """Check whether a page shows the whole model, which fills a fair share of the picture."""
    corners, at, up = extent(state), handle.camera, np.array(GRID[state.model.up][1])
    if page.aspect is None or not holds(handle, state, page, corners).all():
        return False
    way = np.asarray(at.position) - np.asarray(at.look_at)
    nearest = stage.fitted(corners, up, way / np.linalg.norm(way), page.aspect, page.free)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    near, far = (np.linalg.norm(x - middle) for x in (nearest.position, np.asarray(at.position)))
    return bool(FILLS * far < FRAMING.margin * near)


def holds(
    handle: viser.ClientHandle, state: State, page: Client, positions: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return a mask (n,) of positions (n, 3) in a page's picture, False in vertical views."""
    at = Viewpoint(np.asarray(handle.camera.position), np.asarray(handle.camera.look_at))
    up = np.array(GRID[state.model.up][1])
    way = (at.position - at.target) / np.linalg.norm(at.position - at.target)
    if page.aspect is None or np.linalg.norm(np.cross(up, way)) < FRAMING.lean / 2:
        return np.zeros(len(positions), bool)
    return in_picture(positions, up, at, page.aspect)


def viewpoint(state: State, aspect: float, free: Free = WHOLE) -> Viewpoint:
    """Return positions of the camera and its target for which the model fills the view."""
    up = np.array(GRID[state.model.up][1])
    return stage.fitted(extent(state), up, start(state), aspect, free)


def start(state: State) -> np.ndarray:
    """Return the (3,) unit vector from the model to the camera for the start view."""
    drawn = [state.whole.body(name) for name in state.derived.names]
    return stage.start(state.model.up, drawn, shapes.to_matrix(state.derived.wxyz))


def extent(state: State, names: tuple[str, ...] = ()) -> np.ndarray:
    """Return the corners (n, 3) of these bodies as drawn, or of everything that is drawn [m].

    While time moves on, everything includes the bodies at all times. It includes a point of the
    ground, unless the ground is out of reach or would make the bodies appear small.
    """
    d = state.derived
    positions, wxyz = poses(state)
    k = [d.number[name] - 1 for name in names if name in d.number] or list(range(len(d.names)))
    found = looks(state)
    R = shapes.to_matrix(wxyz)
    corners = bodies.extent([found[i] for i in k], positions[k], R[k])
    if names:
        return corners
    joining = [found.ends.reshape(-1, 3) for found in ties.joinings(state, positions, R).values()]
    lines = marks.tracks(state) if "tracks" in state.shown else {}
    tracks = marks.world(lines, np.asarray(positions), R)
    drawn = np.concatenate([corners, *joining, tracks.reshape(-1, 3), passed(state)])
    middle, up = (drawn.min(axis=0) + drawn.max(axis=0)) / 2, np.asarray(state.model.ground_normal)
    if ground(state) > 0:
        return drawn
    whole = np.vstack((drawn, middle - (middle @ up) * up))
    return whole if shapes.diagonal(drawn) > FILLS * shapes.diagonal(whole) else drawn


def passed(state: State) -> np.ndarray:
    """Return the corners (n, 3) of the bodies during a run that moves on, relative to a following
    camera, or none if one moment is shown."""
    if state.playback.rests or frames(state) is None or state.run is None:
        return np.zeros((0, 3))
    return state.run.swept + state.run.travels * middle(state)


def ground(state: State) -> float:
    """Return the depth [m] below its plane at which the ground is drawn.

    The ground lies clear of the motion of the last run, or the initial pose before a run, and of
    the present pose. During a live run, it lies below all that the bodies can reach.
    """
    d, run, up = state.derived, state.last_run, np.asarray(state.model.ground_normal)
    if not d.low or state.live is not None:
        return d.low
    if run is not None and run.model is not state.model:
        run = None
    if run is not None and (run.travels @ up or not len(run.swept)):
        return d.low
    lowest = [float((run.swept @ up).min()) if run else low_at(state, up, d.positions, d.wxyz)]
    if state.pose is not None:
        lowest.append(low_at(state, up, *poses(state)))
    return min(d.low, max(CLEAR * d.size - min(lowest), 0.0))


def low_at(state: State, up: np.ndarray, positions: np.ndarray, wxyz: np.ndarray) -> float:
    """Return the height [m] of the lowest point of bodies and brackets at these poses."""
    R = shapes.to_matrix(wxyz)
    low = float((bodies.extent(looks(state), positions, R) @ up).min())
    if (found := ties.joinings(state, positions, R).get("pivots")) is not None:
        reach = found.size.max(axis=1) / 2
        low = min(low, float((found.at @ up - reach).min(initial=low)))
    return low


def frames(state: State) -> np.ndarray | None:
    """Return the poses (nt, nb, 7) of the shown run, or None for a live run or a manual pose."""
    if state.run is None or state.pose is not None or state.live is not None:
        return None
    found = np.asarray(state.run.result.body_pose)
    return found if found.size else None


def travelled(state: State) -> np.ndarray:
    """Return (3,) 1 for each axis along which the camera follows the motion, else 0.

    Nobody knows how far a live run will go: over the ground, if a body is free.
    """
    if state.live is not None:
        free = any(body.floats for body in state.model.bodies)
        return free * (1.0 - np.array(GRID[state.model.up][1]))
    if state.pose is not None and state.pose is state.posed:
        return np.zeros(3)
    return state.travels


def followed(state: State) -> tuple[float, float, float]:
    """Return the displacement of the bodies from their initial positions [m], or 0 for axes that
    the camera does not follow.

    The result is the position of a node of the scene, which is updated in the same frame as the
    bodies.
    """
    along = travelled(state)
    home = np.asarray(state.derived.positions)
    start = home[led(state.whole)].mean(axis=0) if along.any() else home
    x, y, z = along * (middle(state) - start) if along.any() else along
    return round(float(x), 6), round(float(y), 6), round(float(z), 6)


def middle(state: State) -> np.ndarray:
    """Return the mean (3,) of the origins of the bodies that the camera follows, as drawn."""
    return np.asarray(poses(state)[0])[led(state.whole)].mean(axis=0)
