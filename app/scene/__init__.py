"""The 3D view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from pydantic import Field

from pgraph_core.show.stage import WHOLE, Free

from .. import constraints, pose
from ..core.events import Event, FromPage, Request
from ..core.state import Notice, told, with_client

SHOWN_AT_FIRST = frozenset({"shapes", "joining", "tracks", "sites", "forces"})


@dataclass(frozen=True)
class Client(constraints.Client, pose.Client):
    turned: bool = False  # whether a person moved its camera since it was set
    follow: bool = True  # whether its camera goes along with what travels


@dataclass(frozen=True)
class State(constraints.State, pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    shown: frozenset[str] = SHOWN_AT_FIRST


# -- contents of the 3D view and problems with mesh files (pure) -----------------------------------


Showable = Literal[
    "shapes", "axes", "tracks", "links", "coms", "inertias", "frames", "names", "sites", "points",
    "forces", "joining", "branches", "cones", "footprints", "follow",
]  # fmt: skip


class Show(FromPage):
    """Toggle an overlay of the 3D view. "follow", the camera, belongs to one page."""

    what: Showable
    on: bool

    def applied(self, state: State) -> State:
        if self.what == "follow":
            return with_client(state, self.client, follow=self.on)
        shown = state.shown | {self.what} if self.on else state.shown - {self.what}
        return replace(state, shown=shown)


class View(Request):
    """Point a page's camera at the selection or the whole model ("fit"), or use a named direction.

    "centre" keeps direction and distance: the selection, or all, comes to the middle, about which
    the view turns.
    """

    which: Literal[
        "fit", "front", "side", "top", "isometric", "centre", "x", "y", "z", "-x", "-y", "-z"
    ]


Share = Annotated[float, Field(ge=0.5, le=1)]


class Viewport(FromPage):
    """The aspect ratio (width over height) of a page's 3D view has changed.

    `free` is the part that no toolbar covers, as shares of the way from the middle to each edge.
    """

    aspect: Annotated[float, Field(gt=0.05, lt=20)]
    free: tuple[Share, Share, Share, Share] = WHOLE
    turned: bool = False  # whether a person moved the camera since it was set

    def applied(self, state: State) -> State:
        if state.playback.unseen:
            state = replace(state, playback=replace(state.playback, unseen=False))
        now = {"aspect": self.aspect, "free": Free(*self.free), "turned": self.turned}
        return with_client(state, self.client, **now)


class Unreadable(Event):
    """Mesh files that cannot be drawn, with one message each."""

    sentences: tuple[str, ...]

    def applied(self, state: State) -> State:
        text = f"Transparent links stand for meshes: {' '.join(self.sentences)}"
        notice = Notice("Meshes are missing", text, bad=True)
        for client in state.clients:
            state = told(state, client, notice)
        return state
