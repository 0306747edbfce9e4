"""The gizmo in 3D that moves a link vector or a centre of mass, on each page by itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import viser

from pgraph_core.show.bodies import at_rest

from ..core.events import Event
from ..core.state import Client, State
from .update import Gripped

PACE = 0.04  # [s] between the places that are told while it is dragged
LARGE = 0.3  # of the grain of the model


class Gizmo(NamedTuple):
    """What is drawn on one page, in the frame that the vector is fixed to."""

    body: str
    what: str
    frame: viser.FrameHandle
    control: viser.TransformControlsHandle
    numbers: viser.LabelHandle


class Gizmos:
    """Follows each page's selection; tells where it is dragged, and where it is let go."""

    def __init__(self, server: viser.ViserServer, send: Callable[[Event], None]):
        self._server = server
        self._send = send
        self._drawn: dict[int, Gizmo] = {}  # by client

    def render(self, state: State, positions: np.ndarray, wxyz: np.ndarray, anew: bool) -> None:
        """Draw what pages move, with the bodies at these poses; `anew`: the model is another."""
        for client in self._drawn.keys() - state.clients.keys():
            del self._drawn[client]
        for client, page in state.clients.items():
            wanted = (page.selection, page.gizmo) if page.selection and page.gizmo else None
            drawn = self._drawn.get(client)
            if drawn is not None and (anew or (drawn.body, drawn.what) != wanted):
                drawn.frame.remove()
                del self._drawn[client]
            if wanted is not None and client not in self._drawn:
                self._draw(client, state, *wanted)
            if client in self._drawn:
                _place(self._drawn[client], state, page, positions, wxyz)

    def _draw(self, client: int, state: State, body: str, what: str) -> None:
        handle = self._server.get_clients().get(client)
        if handle is None:
            return
        at = getattr(state.model.body(body), what)
        control = handle.scene.add_transform_controls(
            "/grip/control", LARGE * state.derived.grain, disable_rotations=True, depth_test=False,
            position=at,
        )  # fmt: skip
        frame = at_rest(handle.scene.add_frame("/grip", show_axes=False))
        numbers = handle.scene.add_label("/grip/numbers", "", position=at, font_screen_scale=0.9)
        self._drawn[client] = Gizmo(body, what, frame, control, numbers)
        self._listen(control, client, body, what)

    def _listen(self, control: Any, client: int, body: str, what: Any) -> None:
        told = 0.0

        @control.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            nonlocal told
            now, done = time.monotonic(), event.phase == "end"
            vector = np.asarray(control.position, dtype=float)
            if vector.shape != (3,) or not np.isfinite(vector).all():
                return
            if done or (event.phase == "update" and now - told > PACE):
                told = now
                x, y, z = vector.tolist()
                self._send(Gripped(client, body, what, (x, y, z), done))


def _place(
    drawn: Gizmo, state: State, page: Client, positions: np.ndarray, wxyz: np.ndarray
) -> None:
    """The frame where its body is, and the numbers beside the handle."""
    number = state.derived.number[drawn.body]
    k = number if drawn.what == "com" else state.derived.parent[number - 1]
    if k > 0:
        drawn.frame.position, drawn.frame.wxyz = positions[k - 1], wxyz[k - 1]
    at = (
        page.grip.vector
        if page.grip is not None
        else getattr(state.model.body(drawn.body), drawn.what)
    )
    drawn.numbers.position = np.asarray(at)
    drawn.numbers.text = f"{', '.join(f'{x:.6g}' for x in at)} m"
