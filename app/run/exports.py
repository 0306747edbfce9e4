"""A run as a file for one page: a table, the arrays, or an animation that plays by itself."""

from __future__ import annotations

import re
import tempfile
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import viser

from pgraph_core import show
from pgraph_core.show.animation import Extra

from ..core.bridge import Bridge
from ..core.state import SHOWN_AT_FIRST, Exporting, Playback, Run, State
from ..gait.footfalls import prints
from ..gait.footprints import MOST, FootprintsView
from ..scene.overlays import Overlays


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
        except Exception as error:  # shown on the page: the session goes on
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
    """One HTML file that plays the run and needs nothing else.

    Forces, friction cones, footprints and marks of bodies are in it where they are `shown`.
    """
    return show.animation_html(run.result, lambda server: overlays(server, run, shown)).encode()


def overlays(server: viser.ViserServer, run: Run, shown: frozenset[str]) -> Extra:
    """Draws what is `shown` over the bodies of one picture."""
    state = State(run.model, run.request, last_run=run, shown=shown)
    marks, feet = Overlays(server), FootprintsView(server)

    def draw(time: float, positions: np.ndarray, wxyz: np.ndarray, gone: np.ndarray) -> None:
        now = replace(state, playback=Playback(time))
        marks.render(now, positions, wxyz, gone)
        if "footprints" in shown:
            feet.show(now, prints(run.falls, time, MOST) - gone)

    return draw
