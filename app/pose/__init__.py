"""Manual posing: joint sliders, the 3D gizmo, pulling on a body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

import pgraph_core as pg
from pgraph_core.show.notebook import between

from .. import run
from ..core import state
from ..run import Run


@dataclass(frozen=True)
class Grip:
    """The vector of a body that a page's gizmo has dragged or rotated."""

    body: str
    what: str  # "link", "com" or "rotation"
    vector: tuple[float, ...]  # (3,) [m], or (4,) a quaternion


@dataclass(frozen=True)
class Pose:
    """A manual pose, displayed until the model, the run or the displayed time changes."""

    model: pg.Model
    run: Run | None
    time: float  # playback time at which it was set [s]
    q: np.ndarray  # (nq,)
    positions: np.ndarray  # (nb, 3) [m]
    wxyz: np.ndarray  # (nb, 4)


@dataclass(frozen=True)
class Client(state.Client):
    gizmo: str = ""  # field of the selected body that it moves in 3D: "link", "com" or nothing
    grip: Grip | None = None  # while it does

    def afresh(self) -> Self:
        return replace(super().afresh(), gizmo="", grip=None)

    def again(self, fresh: Any) -> Self:
        return replace(super().again(fresh), grip=None)


@dataclass(frozen=True)
class State(run.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    posed: Pose | None = None  # the last pose by hand
    pose_problem: str = ""  # why a joint could not be moved further
    pull: Any = None  # the event of the mouse that pulls on a body

    def opened(self, before: Any) -> Self:
        return replace(super().opened(before), posed=None, pull=None)

    @property
    def pose(self) -> Pose | None:
        """The displayed pose if it was set by hand."""
        posed = self.posed
        if posed is None or posed.model is not self.model or posed.run is not self.run:
            return None
        return posed if posed.time == self.playback.time else None


def poses(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return the (nb, 3) positions and (nb, 4) orientations to draw: pose by hand, run, or home."""
    if (pose := state.pose) is not None:
        return pose.positions, pose.wxyz
    if state.run is None:
        return state.derived.positions, state.derived.wxyz
    result = state.run.result
    return between(np.asarray(result.t), np.asarray(result.body_pose), state.playback.time)
