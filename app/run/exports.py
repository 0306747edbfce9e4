"""A run as a file for one page: a table, the arrays, or an animation that plays by itself."""

from __future__ import annotations

import re
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import viser

from ..core.bridge import Bridge, quiet
from ..core.state import SHOWN_AT_FIRST, Exporting, Playback, Run, State, between
from ..gait.footfalls import prints
from ..gait.footprints import MOST, FootprintsView
from ..model.derived import derive
from ..scene.bodies import SEPARATE, BatchedBodies, Bodies, SeparateBodies
from ..scene.ground import GRID, grid, steps
from ..scene.overlays import Overlays
from ..scene.view import viewpoint

PICTURES = 30  # of an animation, a second
MOST_PICTURES = 3000
ASPECT = 1.6  # of the window that an animation is framed for


class ExportView:
    """Makes the file in a thread and sends it to the page that asked."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        asked = new.exporting
        if asked is not None and asked is not old.exporting:
            threading.Thread(
                target=self._send, args=(asked,), name="pgraph-export", daemon=True
            ).start()

    def _send(self, asked: Exporting) -> None:
        handle = self._bridge.server.get_clients().get(asked.client)
        if handle is None:
            return
        name = re.sub(r"[^\w-]+", "_", asked.run.model.name) or "run"
        try:
            content = made(asked)
        except Exception as error:  # said on the page: the session goes on
            handle.add_notification(
                "Not exported", f"{type(error).__name__}: {error}", color=(200, 60, 50)
            )
            return
        handle.send_file_download(f"{name}.{asked.what}", content, save_immediately=True)


def made(asked: Exporting) -> bytes:
    """The file that is asked for."""
    match asked.what:
        case "csv":
            return table(asked.run)
        case "npz":
            return arrays(asked.run)
    return animation(asked.run, asked.shown)


def table(run: Run) -> bytes:
    """Everything over time, units in the first line."""
    return run.result.to_csv().encode()


def arrays(run: Run) -> bytes:
    """The run with its model, as `pg.Result.load` reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.npz"
        run.result.save(path)
        return path.read_bytes()


def animation(run: Run, shown: frozenset[str] = SHOWN_AT_FIRST) -> bytes:
    """One HTML file, the viewer in it: a server of its own draws the pictures of the run.

    Forces, friction cones, footprints and marks of bodies are in it where they are `shown`.
    """
    state = State(run.model, derive(run.model), run.request, last_run=run, shown=shown)
    with quiet():
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        serializer = server.get_scene_serializer()
        draw(server, state, run, serializer.insert_sleep)
        return serializer.as_html().encode()
    finally:
        with quiet():
            server.stop()


def draw(server: viser.ViserServer, state: State, run: Run, wait: Callable[[float], None]) -> None:
    """Every picture of the run in turn, `wait` [s] in between."""
    up = GRID[state.model.up][1]
    server.scene.set_up_direction(up)
    ground = [grid(server.scene, state.model, state.derived.size), steps(server.scene, state.model)]
    camera = server.initial_camera
    camera.position, camera.look_at = viewpoint(state, ASPECT)
    camera.up = up
    kind = SeparateBodies if len(state.derived.names) <= SEPARATE else BatchedBodies
    drawn: Bodies = kind(server, lambda *_: None, lambda *_: None)
    drawn.show(state)
    t, pose = np.asarray(run.result.t), np.asarray(run.result.body_pose)
    count = int(np.clip((t[-1] - t[0]) * PICTURES, 2, MOST_PICTURES))
    times = np.linspace(t[0], t[-1], count)
    overlays, feet = Overlays(server), FootprintsView(server)
    leaves = travelled(pose[:, 0], up).max() > state.derived.size
    for time in times:
        positions, wxyz = between(t, pose, float(time))
        gone = level(positions[0] - pose[0, 0, :3], up) if leaves else np.zeros(3)
        drawn.place(positions - gone, wxyz)
        now = replace(state, playback=Playback(float(time)))
        overlays.render(now, positions, wxyz, gone)
        if "footprints" in state.shown:
            feet.show(now, prints(run.falls, float(time), MOST) - gone)
        for node in filter(None, ground):
            node.position = -gone  # the ground moves where the camera would have to
        wait(float(times[1] - times[0]))


def travelled(pose: np.ndarray, up: Sequence[float]) -> np.ndarray:
    """(n,) how far a body is from where it began, along the ground [m]."""
    return np.linalg.norm(level(pose[:, :3] - pose[0, :3], up), axis=-1)


def level(way: np.ndarray, up: Sequence[float]) -> np.ndarray:
    """Vectors (..., 3) without their part along `up`."""
    return way * (1.0 - np.asarray(up))
