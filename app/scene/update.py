"""Contents of the 3D view and problems with mesh files (pure)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pydantic import Field

from ..core.events import Event, FromPage, on, on_request
from ..core.state import Notice, told, with_client
from . import State

Showable = Literal[
    "shapes", "axes", "links", "coms", "inertias", "frames", "names", "sites", "points", "forces",
    "joining", "branches", "cones", "footprints", "follow",
]  # fmt: skip


@dataclass(frozen=True)
class Show(FromPage):
    """Toggle an overlay of the 3D view. "follow", the camera, belongs to one page."""

    what: Showable
    on: bool


@on(Show)
def show(state: State, event: Show) -> State:
    if event.what == "follow":
        return with_client(state, event.client, follow=event.on)
    shown = state.shown | {event.what} if event.on else state.shown - {event.what}
    return replace(state, shown=shown)


@on_request
@dataclass(frozen=True)
class View(FromPage):
    """Point a page's camera at the selection or the whole model ("fit"), or use a named direction.

    "centre" keeps direction and distance: the selection, or all, comes to the middle, about which
    the view turns.
    """

    which: Literal[
        "fit", "front", "side", "top", "isometric", "centre", "x", "y", "z", "-x", "-y", "-z"
    ]


@dataclass(frozen=True)
class Viewport(FromPage):
    """The aspect ratio (width over height) of a page's 3D view has changed.

    `free` is the share of its height between the toolbar and its mirror image.
    """

    aspect: Annotated[float, Field(gt=0.05, lt=20)]
    free: Annotated[float, Field(ge=0.5, le=1)] = 1.0
    turned: bool = False  # whether a person moved the camera since it was set


@on(Viewport)
def viewport(state: State, event: Viewport) -> State:
    if state.playback.unseen:
        state = replace(state, playback=replace(state.playback, unseen=False))
    now = {"aspect": event.aspect, "free": event.free, "turned": event.turned}
    return with_client(state, event.client, **now)


@dataclass(frozen=True)
class Unreadable(Event):
    """Mesh files that cannot be drawn, with one message each."""

    sentences: tuple[str, ...]


@on(Unreadable)
def unreadable(state: State, event: Unreadable) -> State:
    text = f"Transparent links stand for meshes: {' '.join(event.sentences)}"
    notice = Notice("Meshes are missing", text, bad=True)
    for client in state.clients:
        state = told(state, client, notice)
    return state
