"""What feet do over a run: when each changes its phase, and where it comes down (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.result.contact_record import PHASES, SWING
from pgraph_core.show.shapes import to_matrix

Place = tuple[float, float, float]


class Change(NamedTuple):
    """From `t` on a foot is in a phase; `at` is where it came down."""

    foot: str  # name of a contact
    t: float  # [s]
    phase: int  # of PHASES
    at: Place | None = None  # [m]


def changes(run: pg.Result, known: Sequence[Change] = ()) -> tuple[Change, ...]:
    """Those of a run; of a part that goes on from `known`, those that it adds."""
    if not len(run.t):
        return ()
    points = {c.name for c in run.mechanism.model.contacts if len(c.points) == 1}
    feet = [
        name
        for name, phase in run.phases.items()
        if (not points or name in points) and len(phase) and phase[0] in PHASES
    ]
    before = {change.foot for change in known}
    found = [
        _change(run, name, float(run.t[0]), str(run.phases[name][0]), "")
        for name in feet
        if name not in before
    ]
    for event in run.events:
        if event.contact in feet and event.before != event.after:
            found.append(_change(run, event.contact, event.t, event.after, event.before))
    return tuple(found)


def _change(run: pg.Result, foot: str, t: float, after: str, before: str) -> Change:
    down = after != SWING and before in ("", SWING)
    return Change(foot, t, PHASES.index(after), place(run, foot, t) if down else None)


def place(run: pg.Result, foot: str, t: float) -> Place | None:
    """Where the point of a foot is in the frame at t or after; None of contacts of more points."""
    model = run.mechanism.model
    contact = next((c for c in model.contacts if c.name == foot), None)
    if contact is None or len(contact.points) != 1:
        return None
    frame = min(int(np.searchsorted(run.t, t)), len(run.t) - 1)
    pose = run.body_pose[frame, run.mechanism.topology.number(contact.body) - 1]
    x, y, z = pose[:3] + to_matrix(pose[3:]) @ np.array(contact.points[0])
    return float(x), float(y), float(z)


def prints(found: Sequence[Change], time: float, most: int) -> np.ndarray:
    """(n, 3) the last places where feet came down by `time`."""
    down = (change.at for change in reversed(found) if change.at is not None and change.t <= time)
    return np.array(list(islice(down, most))[::-1]).reshape(-1, 3)


def since(found: Sequence[Change], time: float) -> list[Change]:
    """Changes after `time`, and of each foot the last one before."""
    last = {change.foot: change for change in found if change.t <= time}
    return [*last.values(), *(change for change in found if change.t > time)]
