"""Cameras that go along with the first body, each page as it chose."""

from __future__ import annotations

import numpy as np
import viser

from pgraph_core.show.ground import GRID

from ..core.state import State, poses

LEAST = 1e-3  # [m] below which a camera stays


class FollowView:
    """The way from the eye to what it looks at is the page's own, also while it is turned."""

    def __init__(self, server: viser.ViserServer):
        self._server = server
        self._ahead: dict[int, np.ndarray] = {}  # of what each page looks at, from the body [m]

    def render(self, old: State, new: State) -> None:
        for client in self._ahead.keys() - new.clients.keys():
            del self._ahead[client]
        leaves = any(body.joint == "free" for body in new.model.bodies)
        following = [key for key, page in new.clients.items() if page.follow and leaves]
        for client in self._ahead.keys() - set(following):
            del self._ahead[client]
        if not following:
            return
        at = level(new)
        another = new.framed != old.framed or not old.derived.names
        handles = self._server.get_clients()
        for client in following:
            if client not in handles or new.clients[client].aspect is None:
                continue
            camera = handles[client].camera
            if client not in self._ahead or another:
                was = at if another else level(old)
                self._ahead[client] = np.asarray(camera.look_at) - was
            move(camera, at + self._ahead[client])


def level(state: State) -> np.ndarray:
    """(3,) where the first body is, its height left out."""
    up = np.array(GRID[state.model.up][1])
    at = np.asarray(poses(state)[0][0])
    return at - (at @ up) * up


def move(camera: viser.CameraHandle, target: np.ndarray) -> None:
    """Look at `target` from where the page looks from."""
    way = np.asarray(camera.position) - np.asarray(camera.look_at)
    if np.linalg.norm(target - np.asarray(camera.look_at)) > LEAST:
        camera.position = target + way
        camera.look_at = target
