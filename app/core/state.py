"""What the page shows, as frozen values: the model, what follows from it, and who looks at it."""

from __future__ import annotations

import bisect
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.show.animation import between

from ..gait.footfalls import Change, changes
from ..gait.walking import Walking
from ..model.derived import Derived, derive
from ..model.renames import Rename
from .intents import Display, Errand, MobilityReport, Picking

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # of playback
SHOWN_AT_FIRST = frozenset({"shapes", "axes"})
SHOWABLE = frozenset(
    {
        "shapes", "axes", "links", "coms", "inertias", "frames", "names", "points", "forces",
        "cones", "footprints", "follow",
    }
)  # fmt: skip
FREE_RUN = ""  # the scenario of a run that has none
METHODS = (
    "auto",
    "rk4",
    "semi_implicit_euler",
    "dopri5",
    "dop853",
    "ros2",
    "radau5",
    "moreau_jean",
)


@dataclass(frozen=True)
class Step:
    """One user action, as an undo step: the model before it and what the action was."""

    model: pg.Model
    label: str


@dataclass(frozen=True)
class Reply:
    """The answer to a typed cell: "" where it was taken, else the sentence that refuses it."""

    serial: int
    text: str
    offer: str = ""  # what a button beside the sentence would do, e.g. "use the nearest possible"


@dataclass(frozen=True)
class Notice:
    """Something to tell one person in passing."""

    title: str
    text: str = ""
    bad: bool = False


@dataclass(frozen=True)
class Grip:
    """Where a page's gizmo has dragged a vector of a body to."""

    body: str
    what: str  # "link" or "com"
    vector: tuple[float, ...]  # (3,) [m]


@dataclass(frozen=True)
class Inspected:
    """The part of an operator that a page looks at; None: all rows, all columns."""

    what: str  # as in `app/operators/matrices.py`
    rows: tuple[int, int] | None = None  # from, to
    columns: tuple[int, int] | None = None


@dataclass(frozen=True)
class Client:
    """One open page: what it selected and what it was told last."""

    page: str = ""  # what the page calls itself, also when it comes back
    selection: str | None = None  # the body that was selected last
    selected: tuple[str, ...] = ()  # all selected bodies, in the table's order; it among them
    dark: bool = False
    aspect: float | None = None  # width over height of its 3D view, once known
    reply: Reply | None = None
    notice: Notice | None = None
    downloads: int = 0  # how often the model was asked for as a file
    reports: int = 0  # how often the report was asked for as a file
    plots: tuple[tuple[str, str], ...] = ()  # (quantity, of what), in their order
    walk: str = ""  # what it steps through: "pgraph" (Fig. 4), "frames" (Fig. 8) or nothing
    posing: bool = False  # whether it has the sliders of the joints in view
    follow: bool = False  # whether its camera goes along
    gizmo: str = ""  # what of the selected body it moves in 3D: "link", "com" or nothing
    grip: Grip | None = None  # while it does
    inspected: Inspected | None = None  # the operator it looks at
    exported: tuple[int, str, str] = (0, "", "")  # how often, and what it asked for as a file
    display: Display = field(default_factory=Display)
    picking: Picking | None = None
    opened: tuple[str, str] | None = None  # (part, name) of what the constraints tab shows whole
    listed: str | None = None  # body whose constraints alone are listed
    called: int = 0  # how often the constraints tab was asked to come forward
    watching: bool = False  # whether the constraints tab is in sight


@dataclass(frozen=True)
class Kept:
    """The model of a session that is over, from where the server keeps it."""

    path: Path
    given: str  # the model that the session was started with
    time: float  # of the last edit [s since 1970]
    text: str  # JSON
    ended: bool  # in order; otherwise the server was killed


@dataclass(frozen=True)
class Saving:
    """A file to be written for one page."""

    client: int
    serial: int
    path: str
    model: pg.Model


@dataclass(frozen=True)
class Request:
    """How to simulate: a named scenario with its own settings, or a free run with these."""

    scenario: str = FREE_RUN
    t_end: float = 2.0  # [s]
    step: float | None = 1e-3  # [s]; None: the method chooses
    method: str = "auto"
    rtol: float | None = None


@dataclass(frozen=True)
class Job:
    """A simulation under way, for the model it was asked for."""

    id: int
    model: pg.Model
    request: Request
    fraction: float = 0.0
    before: Any = None  # the result that this one goes on from


@dataclass(frozen=True)
class Run:
    """A finished simulation and the model it is of."""

    model: pg.Model
    request: Request
    result: Any  # pgraph_core's result

    @cached_property
    def falls(self) -> tuple[Change, ...]:
        """What its feet did."""
        return changes(self.result)


@dataclass(frozen=True)
class Pose:
    """A pose set by hand, shown until the model, the run or the time shown changes."""

    model: pg.Model
    run: Run | None
    time: float  # of the playback when it was set [s]
    q: np.ndarray  # (nq,)
    positions: np.ndarray  # (nb, 3) [m]
    wxyz: np.ndarray  # (nb, 4)


@dataclass(frozen=True)
class Live:
    """A run that plays while it is computed, of whatever the model is by then."""

    id: int
    request: Request
    running: bool = True
    parts: tuple[Any, ...] = ()  # results, one after the other
    pace: float = 1.0  # its speed over the one asked for
    falls: tuple[Change, ...] = ()  # what its feet did

    def part_at(self, time: float) -> Any:
        """The part that holds `time`, else the last."""
        k = bisect.bisect_left(self.parts, time, key=lambda part: part.t[-1])
        return self.parts[min(k, len(self.parts) - 1)]


@dataclass(frozen=True)
class ReportRequest:
    """What a report is asked for."""

    target: float = 1e-6  # the error that is wanted
    t_end: float | None = None  # [s]; None: as the run, but not for long
    axis: str = "stiffness"  # of the stability map


@dataclass(frozen=True)
class Analysis:
    """A report under way."""

    id: int
    kind: str  # precision or stability
    model: pg.Model
    request: Request
    reporting: ReportRequest
    fraction: float = 0.0
    cancelled: bool = False


@dataclass(frozen=True)
class Report:
    """A report, and the model it is of."""

    kind: str
    model: pg.Model
    result: Any  # pgraph_core's Study or StabilityMap


@dataclass(frozen=True)
class Exporting:
    """A run to be sent to one page as a file."""

    client: int
    what: str
    run: Run
    shown: frozenset[str] = SHOWN_AT_FIRST  # on the page that asks


@dataclass(frozen=True)
class Playback:
    time: float = 0.0  # [s]
    playing: bool = False
    speed: float = 1.0
    loop: bool = True


@dataclass(frozen=True)
class Kernels:
    """How far the compiled code is: `done` of `total`, `name` under way."""

    done: int = 0
    total: int = 0
    name: str = ""
    ready: bool = False
    problem: str = ""


@dataclass(frozen=True)
class State:
    model: pg.Model
    derived: Derived
    request: Request
    gallery: Mapping[str, str] = field(default_factory=dict)  # built-in name -> JSON text
    clients: Mapping[int, Client] = field(default_factory=dict)
    left: Mapping[str, Client] = field(default_factory=dict)  # pages that went, by their names
    undo: tuple[Step, ...] = ()
    redo: tuple[Step, ...] = ()
    renames: tuple[Rename, ...] = ()  # of late
    last_run: Run | None = None
    job: Job | None = None
    jobs: int = 0  # how many were asked for; the last one's id
    live: Live | None = None
    ghost: Run | None = None  # an earlier run, shown beside
    exporting: Exporting | None = None
    reporting: ReportRequest = ReportRequest()
    analysis: Analysis | None = None
    analysis_problem: str = ""  # why the last one gave no report
    report: Report | None = None
    run_problem: str = ""  # why the last job gave no result
    playback: Playback = Playback()
    kernels: Kernels = Kernels()
    walking: Walking = field(default_factory=Walking)
    saving: Saving | None = None
    kept: Mapping[str, Kept] = field(default_factory=dict)  # by what it is called in a list
    greeting: Notice | None = None  # to pages that open, until the model is changed
    shown: frozenset[str] = SHOWN_AT_FIRST
    errands: tuple[Errand, ...] = ()  # under way, in order
    errand_count: int = 0  # how many were sent; the last one's id
    mobility: MobilityReport | None = None
    mobility_asked: pg.Model | None = None  # a large model, whose report takes long
    framed: int = 0  # counts the models opened; the camera is set anew for each
    posed: Pose | None = None  # the last pose by hand
    pose_problem: str = ""  # why a joint could not be moved further
    pull: Any = None  # the event of the mouse that pulls on a body

    @property
    def renamed(self) -> int:
        """How often something got another name."""
        return self.renames[-1].number if self.renames else 0

    @property
    def pose(self) -> Pose | None:
        """The pose by hand that is shown."""
        posed = self.posed
        if posed is None or posed.model is not self.model or posed.run is not self.run:
            return None
        return posed if posed.time == self.playback.time else None

    @property
    def run(self) -> Run | None:
        """The run to play: the live one's part at this time, else the last of this model."""
        if self.live is not None:
            live = self.live
            part = live.part_at(self.playback.time) if live.parts else None
            return None if part is None else Run(self.model, live.request, part)
        run = self.last_run
        return run if run is not None and run.model is self.model else None

    @property
    def falls(self) -> tuple[Change, ...]:
        """What feet did in the run to play."""
        if self.live is not None:
            return self.live.falls
        return self.run.falls if self.run is not None else ()

    @property
    def t_end(self) -> float:
        """Where the run to play ends [s]; 0 without one."""
        if self.live is not None:
            return float(self.live.parts[-1].t[-1]) if self.live.parts else 0.0
        return float(self.run.result.t[-1]) if self.run is not None else 0.0

    @property
    def t_start(self) -> float:
        """Where it begins [s]."""
        if self.live is not None:
            return float(self.live.parts[0].t[0]) if self.live.parts else 0.0
        return float(self.run.result.t[0]) if self.run is not None else 0.0


def initial(model: pg.Model, gallery: Mapping[str, str] | None = None) -> State:
    """The state the server starts with."""
    return State(model, derive(model), first_request(model), gallery or {})


def first_request(model: pg.Model) -> Request:
    """What Simulate offers at first: the model's first scenario, or a free run."""
    if not model.scenarios:
        return Request()
    s = model.scenarios[0]
    method = s.method if s.method in METHODS else "auto"
    return Request(s.name, s.t_end, s.step, method)


def poses(state: State) -> tuple[np.ndarray, np.ndarray]:
    """(nb, 3) positions and (nb, 4) orientations to draw: by hand, of the run at its time, home."""
    if (pose := state.pose) is not None:
        return pose.positions, pose.wxyz
    if state.run is None:
        return state.derived.positions, state.derived.wxyz
    result = state.run.result
    return between(np.asarray(result.t), np.asarray(result.body_pose), state.playback.time)


def with_client(state: State, client: int, **changes: Any) -> State:
    """`state` with one page's own part changed; unknown pages are left out."""
    if client not in state.clients:
        return state
    changed = replace(state.clients[client], **changes)
    return replace(state, clients={**state.clients, client: changed})


def told(state: State, client: int, notice: Notice) -> State:
    """`state` with something said to one page."""
    return with_client(state, client, notice=notice)
