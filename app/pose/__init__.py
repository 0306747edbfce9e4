"""Manual posing: joint sliders, the 3D gizmo, pulling on a body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import pgraph_core as pg

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
