"""Footfalls: when the feet of a run change their phases, and where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.result.records import PHASES, SWING
from pgraph_core.show.shapes import to_matrix

Place = tuple[float, float, float]


class Change(NamedTuple):
    """The start of a foot's phase at `t`, with its touchdown position `at`."""

    foot: str  # name of a contact
    t: float  # [s]
    phase: int  # index in PHASES
    at: Place | None = None  # [m]


def changes(run: pg.Result, known: Sequence[Change] = ()) -> tuple[Change, ...]:
    """Return the phase changes between frames of a run, or those that a part adds to `known`."""
    if not len(run.t):
        return ()
    points = {c.name for c in run.mechanism.model.contacts if len(c.points) == 1}
    feet = [
        name
        for name, phase in run.phases.items()
        if (not points or name in points) and len(phase) and phase[0] in PHASES
    ]
    before = {change.foot for change in known}
    found = []
    for name in feet:
        phase = run.phases[name]
        begun = (np.flatnonzero(phase[1:] != phase[:-1]) + 1).tolist()
        for k in begun if name in before else (0, *begun):
            down = phase[k] != SWING and (k == 0 or phase[k - 1] == SWING)
            at = place(run, name, k) if down else None
            found.append(Change(name, float(run.t[k]), PHASES.index(phase[k]), at))
    return tuple(sorted(found, key=lambda change: change.t))


def place(run: pg.Result, foot: str, frame: int) -> Place | None:
    """Return the position of a foot in a frame, or None if the foot is not a point."""
    model = run.mechanism.model
    contact = next((c for c in model.contacts if c.name == foot), None)
    if contact is None or len(contact.points) != 1:
        return None
    pose = run.body_pose[frame, run.mechanism.topology.number(contact.body) - 1]
    x, y, z = pose[:3] + to_matrix(pose[3:]) @ np.array(contact.points[0])
    return float(x), float(y), float(z)


def prints(found: Sequence[Change], time: float, most: int) -> np.ndarray:
    """Find the last touchdown positions up to `time` as an (n, 3) array."""
    down = (change.at for change in reversed(found) if change.at is not None and change.t <= time)
    return np.array(list(islice(down, most))[::-1]).reshape(-1, 3)


def since(found: Sequence[Change], time: float) -> list[Change]:
    """Return the changes after `time`, and the last one before it for each foot."""
    last = {change.foot: change for change in found if change.t <= time}
    return [*last.values(), *(change for change in found if change.t > time)]
