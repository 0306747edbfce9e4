"""The state of the app as immutable values: the model, its derived data, and the open pages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.show.animation import between

from ..constraints import MobilityReport, Picking
from ..gait import Change, Walking
from ..model import Errand, Step
from ..model.derived import Derived, derive
from ..operators import Inspected
from ..picking import Aim
from ..playback import SPEEDS as SPEEDS
from ..playback import Playback
from ..pose import Grip, Pose
from ..report import Analysis, Report, ReportRequest
from ..run import Exporting, Job, KeptRun, Kernels, Live, Request, Run, first_request
from ..scene import SHOWN_AT_FIRST
from ..session import Kept, Saving
from .cells import Display, Rows


@dataclass(frozen=True)
class Reply:
    """The reply for a typed cell: "" if it was accepted, or else the error message."""

    serial: int
    text: str
    offer: str = ""  # label of a repair button, e.g. "use the nearest possible"


@dataclass(frozen=True)
class Notice:
    """A transient notification for one user."""

    title: str
    text: str = ""
    bad: bool = False


@dataclass(frozen=True)
class Rename:
    """A rename that pages may not yet know, so that they may briefly use the old name."""

    number: int  # from 1
    kind: str  # "bodies", "parameters", "constraints", "contacts" or "forces"
    old: str
    new: str


@dataclass(frozen=True)
class Client:
    """An open page with its selection and its last notice."""

    page: str = ""  # name of the page, kept when it reconnects
    selection: str | None = None  # the body that was selected last
    selected: tuple[str, ...] = ()  # all selected bodies in the table's order
    dark: bool = False
    aspect: float | None = None  # width over height of its 3D view, once known
    turned: bool = False  # whether a person moved its camera since it was set
    reply: Reply | None = None
    notice: Notice | None = None
    downloads: int = 0  # number of requested downloads of the model
    download: str = ".json"  # its suffix
    conversion: Any = None  # the report of the last file of another format that it opened
    members: Any = None  # models of the last archive, of which it is to choose one
    reports: tuple[int, str] = (0, "")  # number of requested report files, and the last kind
    plots: tuple[tuple[str, str], ...] = ()  # (quantity, of what), in their order
    walk: str = ""  # stepped figure: "pgraph" (Fig. 4), "frames" (Fig. 8) or ""
    sees: frozenset[str] = frozenset()  # the views of hidden tabs that it has in sight
    gallery: int = 0  # number of requests for the pictures of the models
    follow: bool = True  # whether its camera goes along with what travels
    view: tuple[int, str] = (0, "")  # number of requests for a view, and its name
    gizmo: str = ""  # field of the selected body that it moves in 3D: "link", "com" or nothing
    grip: Grip | None = None  # while it does
    inspected: Inspected | None = None  # the operator it looks at
    exported: tuple[int, str, str] = (0, "", "")  # number of requested exports, and the last one
    display: Display = field(default_factory=Display)
    picking: Picking | None = None
    aim: Aim | None = None  # pick in progress in its 3D view
    menu: tuple[int, str | None, tuple[float, float]] = (0, None, (0.0, 0.0))  # the last asked for
    opened: tuple[str, str] | None = None  # (part, name) of what the constraints tab shows whole
    listed: str | None = None  # body whose constraints alone are listed
    called: int = 0  # number of requests to show the constraints tab


@dataclass(frozen=True)
class State:
    model: pg.Model
    request: Request
    gallery: Mapping[str, str] = field(default_factory=dict)  # built-in name -> JSON text
    clients: Mapping[int, Client] = field(default_factory=dict)
    left: Mapping[str, Client] = field(default_factory=dict)  # pages that went, by their names
    undo: tuple[Step, ...] = ()
    redo: tuple[Step, ...] = ()
    renames: tuple[Rename, ...] = ()  # the most recent renames
    rows: Rows = field(default_factory=Rows)
    last_run: Run | None = None
    run_framed: int = 0  # `framed` when it was made
    job: Job | None = None
    jobs: int = 0  # number of requested jobs, the id of the last one
    live: Live | None = None
    runs: tuple[KeptRun, ...] = ()  # earlier ones, shown together with this one
    exporting: Exporting | None = None
    reporting: ReportRequest = field(default_factory=ReportRequest)
    analysis: Analysis | None = None
    analysis_problem: str = ""  # why the last one gave no report
    report: Report | None = None
    run_problem: str = ""  # why the last job gave no result
    playback: Playback = field(default_factory=Playback)
    kernels: Kernels = field(default_factory=Kernels)
    walking: Walking = field(default_factory=Walking)
    saving: Saving | None = None
    saved: tuple[int, pg.Model] | None = None  # document and model that were written last by Save
    kept: Mapping[str, Kept] = field(default_factory=dict)  # by what it is called in a list
    not_kept: str = ""  # why edits are not kept on disk
    greeting: Notice | None = None  # to pages that open, until the model is changed
    shown: frozenset[str] = SHOWN_AT_FIRST
    errands: tuple[Errand, ...] = ()  # under way, in order
    errand_count: int = 0  # number of errands sent, the id of the last one
    mobility: MobilityReport | None = None
    mobility_asked: pg.Model | None = None  # a large model, whose report takes long
    framed: int = 0  # number of opened models, for each of which the camera is framed
    document: int = 0  # `framed` when the present model was opened, changed by Undo and Redo
    posed: Pose | None = None  # the last pose by hand
    pose_problem: str = ""  # why a joint could not be moved further
    pull: Any = None  # the event of the mouse that pulls on a body

    @property
    def derived(self) -> Derived:
        """Data derived from the model."""
        return derive(self.model)

    @property
    def renamed(self) -> int:
        """Number of renames."""
        return self.renames[-1].number if self.renames else 0

    @property
    def pose(self) -> Pose | None:
        """The displayed pose if it was set by hand."""
        posed = self.posed
        if posed is None or posed.model is not self.model or posed.run is not self.run:
            return None
        return posed if posed.time == self.playback.time else None

    @property
    def going(self) -> Live | None:
        """The live run, or None if it was stopped."""
        return None if self.live is None or self.live.over else self.live

    @property
    def run(self) -> Run | None:
        """The run to play: the live run's part at the current time, or the last run of this
        model.
        """
        if self.live is not None:
            live = self.live
            part = live.part_at(self.playback.time) if live.parts else None
            return None if part is None else Run(self.model, live.request, part)
        run = self.last_run
        return run if run is not None and run.model is self.model else None

    @property
    def earlier(self) -> Run | None:
        """The last run if the model was edited since, or None if another model was opened."""
        last = self.last_run
        gone = last is None or self.live is not None or self.run is not None
        return None if gone or self.run_framed != self.framed else last

    @property
    def plotted(self) -> Run | None:
        """The run used for plots: the one to play, or else that of the model before its last
        edits.
        """
        return self.run or self.earlier

    @property
    def falls(self) -> tuple[Change, ...]:
        """The foot phase changes in the run to play."""
        if self.live is not None:
            return self.live.falls
        return self.run.falls if self.run is not None else ()

    @property
    def t_end(self) -> float:
        """The end time of the run to play [s], or 0 if there is none."""
        if self.live is not None:
            return float(self.live.parts[-1].t[-1]) if self.live.parts else 0.0
        return float(self.run.result.t[-1]) if self.run is not None else 0.0

    @property
    def t_start(self) -> float:
        """The start time of the run to play [s]."""
        if self.live is not None:
            return float(self.live.parts[0].t[0]) if self.live.parts else 0.0
        return float(self.run.result.t[0]) if self.run is not None else 0.0


def initial(model: pg.Model, gallery: Mapping[str, str] | None = None) -> State:
    """Return the initial state of the server."""
    return State(model, first_request(model), gallery or {})


def poses(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return the (nb, 3) positions and (nb, 4) orientations to draw: pose by hand, run, or home."""
    if (pose := state.pose) is not None:
        return pose.positions, pose.wxyz
    if state.run is None:
        return state.derived.positions, state.derived.wxyz
    result = state.run.result
    return between(np.asarray(result.t), np.asarray(result.body_pose), state.playback.time)


def with_client(state: State, client: int, **changes: Any) -> State:
    """Return `state` with one page's own fields changed. Unknown pages are ignored."""
    if client not in state.clients:
        return state
    changed = replace(state.clients[client], **changes)
    return replace(state, clients={**state.clients, client: changed})


def told(state: State, client: int, notice: Notice) -> State:
    """Return `state` with a notice for one page."""
    return with_client(state, client, notice=notice)


def replied(state: State, client: int, serial: int, text: str = "", offer: str = "") -> State:
    """Return `state` with a reply to one page's typed cell, where "" accepts it."""
    return with_client(state, client, reply=Reply(serial, text, offer))


def display_of(state: State, client: int) -> Display:
    """Return the units and number formats for one page."""
    page = state.clients.get(client)
    return page.display if page is not None else Display()
