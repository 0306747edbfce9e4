"""Joint coordinates as sliders, on the pages that have them in view."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import viser

from pgraph_core.errors import counted

from ..core.bridge import at_rest
from ..core.cells import Display, Quantity
from ..core.events import Event
from ..core.views import Host, Payload, Place, hue, topic
from ..properties.body_cells import euler_of
from ..run.trust import supported
from . import Client, State
from .solving import coordinates, shown_time
from .update import Gripped

EVERY = 0.2  # [s] between two updates while a run plays
MOST = 100  # limit on sliders, beyond which only the selected body's path has them


def moment(state: State) -> tuple[object, ...]:
    """Return a value that changes when bodies have moved, and regularly during playback."""
    shown, parts = state.playback, state.live and state.live.taken
    at = int(shown.time / (EVERY * shown.speed)) if shown.moves else vars(shown)
    return state.last_run, parts, at


def joints(state: State, selection: str | None, display: Display | None = None) -> Payload:
    """Return the sliders in numerical order, with the hint to show next to them."""
    d, names = state.derived, None
    display = display or Display()
    kinds: dict[str, Quantity] = {"rad": "angle", "m": "length"}
    ids = state.rows.named(state.model, "bodies")
    if d.dof > MOST:
        names = path(state, selection)
    run = None if shown_time(state) is None else state.run
    error = 0.0 if run is None else float(run.result.error_estimate)
    rows = [
        {
            "id": f"{ids[c.body]} {c.index} {c.label}",
            **vars(c),
            "shown": supported(
                display.shown(c.value - c.turns, kinds[c.unit]), display.shown(error, kinds[c.unit])
            ),
            "more": turned(c.turns),
            "unit": display.unit(kinds[c.unit]).replace("deg", "°"),
            "si": c.unit,
            "color": hue(d.branches[d.number[c.body] - 1]),
        }
        for c in coordinates(state, names)
    ]
    return {
        "rows": rows,
        "selected": selection,
        "problem": state.pose_problem,
        "posed": state.pose is not None,
        "shows": shows(state),
        "hint": hint(state, rows),
    }


def turned(angle: float) -> str:
    """Return the whole turns in an angle [rad], to show next to the rest, such as "+ 3 turns"."""
    turns = round(angle / (2 * math.pi))
    return f"{'−' if turns < 0 else '+'} {counted(abs(turns), 'turn')}" if turns else ""


def shows(state: State) -> str:
    """Return the source of the pose shown by the sliders: model, run, trial or manual input."""
    time = shown_time(state)
    if time is not None:
        return f"run at {time:.3f} s"
    if state.pose is not None and state.pose is not state.posed:
        return f"trial at {state.playback.time:.3f} s"
    return "posed by hand" if state.pose is not None else "initial pose"


def hint(state: State, rows: list[Payload]) -> str:
    """Return the hint that explains missing sliders."""
    if state.derived.dof > MOST and rows:
        return "Showing the joints from the ground to the selection."
    if state.derived.dof > MOST:
        return f"{state.derived.dof} degrees of freedom are too many to list: select a body."
    return ""


def path(state: State, selection: str | None) -> frozenset[str]:
    """Return the names on the path from the selected body to the ground."""
    names, parent = state.derived.names, state.derived.parent
    k, found = state.derived.number.get(selection or "", 0), []
    while k > 0:
        found.append(names[k - 1])
        k = parent[k - 1]
    return frozenset(found)


PACE = 0.04  # [s] interval of messages during a drag
LARGE = 0.3  # size of the gizmo relative to the grain of the model
WORD = {"link": "joint", "com": "centre of mass", "rotation": "orientation"}


class Gizmo(NamedTuple):
    """The gizmo of one page, in the frame of its vector."""

    body: str
    what: str
    frame: viser.FrameHandle
    control: viser.TransformControlsHandle
    numbers: viser.LabelHandle


class Gizmos:
    """The gizmos, which follow each page's selection and report drags and releases."""

    def __init__(self, server: viser.ViserServer, send: Callable[[Event], None]):
        self._server = server
        self._send = send
        self._drawn: dict[int, Gizmo] = {}  # by client

    def render(self, state: State, positions: np.ndarray, wxyz: np.ndarray, rebuilt: bool) -> None:
        """Draw the gizmos of all pages for these body poses. Redraw every one if `rebuilt`."""
        for client in self._drawn.keys() - state.clients.keys():
            del self._drawn[client]
        for client, page in state.clients.items():
            body = page.selection if page.selection in state.model.row else None
            wanted = (body, page.gizmo) if body and page.gizmo else None
            drawn = self._drawn.get(client)
            if drawn is not None and (rebuilt or (drawn.body, drawn.what) != wanted):
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
        own, turns = state.model.body(body), what == "rotation"
        at = own.com if what == "com" else own.link
        control = handle.scene.add_transform_controls(
            "/grip/control", LARGE * state.derived.grain, disable_rotations=not turns,
            disable_axes=turns, disable_sliders=turns, depth_test=False, position=at,
            wxyz=own.rotation if turns else (1.0, 0.0, 0.0, 0.0),
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
            moved = control.wxyz if what == "rotation" else control.position
            vector = np.asarray(moved, dtype=float)
            if not np.isfinite(vector).all():
                return
            if done or (event.phase == "update" and now - told > PACE):
                told = now
                self._send(Gripped(client, body, what, tuple(vector.tolist()), done))  # type: ignore[arg-type]


def _place(
    drawn: Gizmo, state: State, page: Client, positions: np.ndarray, wxyz: np.ndarray
) -> None:
    """Return the frame of the gizmo at its body, and the numbers shown next to the handle."""
    number = state.derived.number[drawn.body]
    k = number if drawn.what == "com" else state.derived.parent[number - 1]
    if k > 0:
        drawn.frame.position, drawn.frame.wxyz = positions[k - 1], wxyz[k - 1]
    body, show = state.model.body(drawn.body), page.display
    now = getattr(body, drawn.what) if page.grip is None else page.grip.vector
    turns = drawn.what == "rotation"
    drawn.numbers.position = np.asarray(body.link if turns else now)
    of, names = ("angle", ("roll", "pitch", "yaw")) if turns else ("length", "xyz")
    parts = euler_of(now) if turns else now
    numbers = "  ".join(f"{k} {show.shown(x, of):.5g}" for k, x in zip(names, parts))
    drawn.numbers.text = f"{WORD[drawn.what]}: {numbers} {show.unit(of)}"


VIEWS = (
    Place(
        topic(
            "joints", lambda state, page: joints(state, page.selection, page.display),
            "derived", "posed", "pose_problem", moment,
            page=lambda state, page: (page.selection, page.display), seen="joints",
        ),
        41, Host("joints", "right"),
    ),
)  # fmt: skip
