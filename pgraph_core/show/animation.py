"""An animation of a run as one self-contained HTML page with viewer and motion."""

from __future__ import annotations

import contextlib
import io
import re
import sys
import tempfile
import webbrowser
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import needed
from .bodies import SEPARATE, BatchedBodies, Bodies, SeparateBodies, Track, looks
from .shapes import branch_colors, children_of
from .stage import FRAMING, GRID, depth, fitted, floor, light, steps, towards, unlit

if TYPE_CHECKING:
    import viser

PICTURES = 30  # a second
SHOWN = 3000
ASPECT = 1.2  # aspect of the narrowest usual window, in which everything must be visible
QUIET = "<style>.mantine-Notification-root { display: none; }</style>"  # viser's on software GL

# Draws more into a picture: (time [s], positions, quaternions, shift of the picture [m])
Extra = Callable[[float, np.ndarray, np.ndarray, np.ndarray], None]


def animation_html(run: Any, extra: Callable[[viser.ViserServer], Extra] | None = None) -> str:
    """Return the HTML page for a `pg.Result`. Needs viser. `extra` adds drawing to every frame."""
    viser = needed("viser")
    with contextlib.redirect_stdout(io.StringIO()):  # viser's banner
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        serializer = server.get_scene_serializer()
        draw(server, run, serializer.insert_sleep, extra(server) if extra else None)
        page = serializer.as_html()
        head = f"<title>{escape(run.mechanism.model.name)}</title>{QUIET}"
        return re.sub("<title>.*?</title>", lambda _: head, page, count=1)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def draw(
    server: viser.ViserServer, run: Any, wait: Callable[[float], None], extra: Extra | None = None
) -> None:
    """Draw every frame of the run in turn, calling `wait` [s] in between.

    A model that travels further than its size stays in the middle, and the ground moves.
    """
    model, names = run.mechanism.model, run.mechanism.names
    bodies, parent = [model.body(name) for name in names], run.mechanism.topology.parent.tolist()
    t, pose = np.asarray(run.t), np.asarray(run.body_pose)
    up = np.array(GRID[model.up][1])
    found = looks(bodies, children_of(parent), branch_colors(parent))
    track = Track(found, pose, up)
    scene, camera = server.scene, server.initial_camera
    scene.set_up_direction(up)
    low = depth(model, bodies, parent, pose[0, :, :3], track.size)
    planes = (floor(scene, model, track.size, False, low), steps(scene, model))
    under = [node for node in planes if node is not None]
    ground = [(node, node.position) for node in under]
    camera.position, camera.look_at = fitted(track.corners, up, towards(model.up, "start"), ASPECT)
    camera.up, camera.fov = up, FRAMING.field_of_view
    unlit(scene)
    light(scene, False, model.up)
    kind = SeparateBodies if len(names) <= SEPARATE else BatchedBodies
    drawn: Bodies = kind(server, lambda *_: None, lambda *_: None)
    drawn.show(found)
    count = int(np.clip((t[-1] - t[0]) * PICTURES, 2, SHOWN))
    times = np.linspace(t[0], t[-1], count)
    for time in times:
        positions, wxyz = between(t, pose, float(time))
        gone = track.gone(positions)
        drawn.place(positions - gone, wxyz)
        if extra is not None:
            extra(float(time), positions, wxyz, gone)
        for node, at in ground:
            node.position = at - gone
        wait(float(times[1] - times[0]))


def between(t: np.ndarray, pose: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate `pose` (len(t), nb, 7) at `time` into positions (nb, 3), quaternions (nb, 4)."""
    k = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, max(len(t) - 2, 0)))
    last = min(k + 1, len(t) - 1)
    span = t[last] - t[k]
    s = min(max((time - t[k]) / span, 0.0), 1.0) if span > 0 else 0.0
    a, b = pose[k], pose[last]
    sign = np.where((a[:, 3:] * b[:, 3:]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    wxyz = (1 - s) * a[:, 3:] + s * sign * b[:, 3:]
    return (1 - s) * a[:, :3] + s * b[:, :3], wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)


def opened(page: str, height: int = 480) -> Any:
    """Show a page. Returns an object to display in a notebook, else opens the browser."""
    if _in_notebook():
        return Embedded(page, height)
    with tempfile.NamedTemporaryFile("w", suffix=".html", delete=False, encoding="utf-8") as file:
        file.write(page)
    webbrowser.open(Path(file.name).as_uri())
    return None


class Embedded:
    """A page embedded in a notebook cell."""

    def __init__(self, page: str, height: int):
        self.page, self.height = page, height

    def _repr_html_(self) -> str:
        frame = 'width="100%" style="border:0"'
        return f'<iframe srcdoc="{escape(self.page)}" {frame} height="{self.height}"></iframe>'


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and shell.has_trait("kernel")
