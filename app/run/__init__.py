"""Simulation on the page: request, progress and result of a run."""

from __future__ import annotations

import bisect
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.show import shapes
from pgraph_core.show.bodies import extent, looks

from ..gait import Change, changes
from ..scene import SHOWN_AT_FIRST

TRAVELS = 1.0  # a picture of all of a longer way shows the model at less than half its size
FREE_RUN = ""  # the scenario of a run that has none


@dataclass(frozen=True)
class Request:
    """Settings of a run, either a named scenario with its own settings or a free run with these."""

    scenario: str = FREE_RUN
    t_end: float = 2.0  # [s]
    step: float | None = 1e-3  # [s] step, None if the method chooses
    method: str = "auto"
    rtol: float | None = None


@dataclass(frozen=True)
class Job:
    """A simulation in progress, with its model."""

    id: int
    model: pg.Model
    request: Request
    fraction: float = 0.0
    before: Any = None  # the result that this one goes on from
    gait: pg.Gait | None = None  # replaces the gait of its scenario
    framed: int = 0  # `State.framed` at the request


@dataclass(frozen=True)
class Run:
    """A finished simulation and its model."""

    model: pg.Model
    request: Request
    result: Any  # pgraph_core's result
    walked: tuple[Change, ...] | None = None  # changes of its feet, if known
    ended: str = ""  # end of a live run

    @cached_property
    def falls(self) -> tuple[Change, ...]:
        """The foot contact changes during the run."""
        return changes(self.result) if self.walked is None else self.walked

    @cached_property
    def usual_force(self) -> float:
        """Return the largest force [N] of constraints and contacts, ignoring the shortest impacts.

        Of the frames with a force 98 % have none above it: the impact of a fall is a hundred
        times what a foot carries, which would not be seen next to it.
        """
        every = (*self.result.constraint_force.values(), *self.result.contact_force.values())
        peaks = [np.abs(np.asarray(wrench)[:, 3:]).max(axis=1) for wrench in every if len(wrench)]
        largest = np.max(peaks, axis=0) if peaks else np.zeros(0)
        acting = largest[(largest > 0) & np.isfinite(largest)]
        return float(np.quantile(acting, 0.98, method="higher")) if len(acting) else 0.0

    @cached_property
    def size(self) -> float:
        """Return the overall size of the drawn bodies in the first frame [m]."""
        pose, top = np.asarray(self.result.body_pose), pg.Topology.of(self.model)
        drawn = [self.model.body(name) for name in top.names]
        parent = tuple(top.parent.tolist())
        found = looks(drawn, shapes.children_of(parent), shapes.branch_colors(parent))
        corners = extent(found, pose[0, :, :3], shapes.to_matrix(pose[0, :, 3:]))
        return float(np.linalg.norm(np.ptp(corners, axis=0)))

    @cached_property
    def travels(self) -> np.ndarray:
        """Return (3,) 1 for each axis along which the centre travels TRAVELS times `size`, else
        0.
        """
        pose = np.asarray(self.result.body_pose)
        if not pose.size:
            return np.zeros(3)
        way = np.ptp(pose[:, :, :3].mean(axis=1), axis=0)
        return (way > TRAVELS * self.size).astype(float)


@dataclass(frozen=True)
class KeptRun:
    """An earlier run, kept by name and shown together with the current one."""

    id: int
    name: str
    run: Run


@dataclass(frozen=True)
class Live:
    """A live run, which plays while it is computed and follows edits of the model."""

    id: int
    request: Request
    start: tuple[float, np.ndarray, np.ndarray] | None = None  # (t, q, v); None: the scenario's
    running: bool = True
    parts: tuple[Any, ...] = ()  # consecutive results, of which old ones are joined
    joined: tuple[int, ...] = ()  # number of joins in each part
    taken: int = 0  # parts so far
    pace: float = 1.0  # its speed over the one asked for
    falls: tuple[Change, ...] = ()  # changes of its feet
    over: bool = False  # stopped: its parts are shown until they are joined
    ended: str = ""  # description of the end

    def part_at(self, time: float) -> Any:
        """Return the part that contains `time`, or the last one."""
        k = bisect.bisect_left(self.parts, time, key=lambda part: part.t[-1])
        return self.parts[min(k, len(self.parts) - 1)]


@dataclass(frozen=True)
class Exporting:
    """A pending export of a run to one page as a file."""

    client: int
    what: str
    run: Run
    shown: frozenset[str] = SHOWN_AT_FIRST  # on the page that asks
    time: float = 0.0  # time that the page shows [s]


@dataclass(frozen=True)
class Kernels:
    """Progress of the compilation: `done` of `total` kernels, with `name` in progress."""

    done: int = 0
    total: int = 0
    name: str = ""
    ready: bool = False
    problem: str = ""


def first_request(model: pg.Model) -> Request:
    """Return the initial request: the model's first scenario, or a free run if it has none."""
    if not model.scenarios:
        return Request()
    s = model.scenarios[0]
    return Request(s.name, s.t_end, s.step, s.method)
