"""Footprints: where and when each foot stood, from the record of a run."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..dynamics.arguments import wrong_type
from ..dynamics.bodies import turned
from ..errors import explained
from ..packing.system import Array
from ..result import Result
from ..result.contact_record import SWING


class Footprint(NamedTuple):
    """One stance of a foot: where it stood, and when."""

    foot: str  # the contact
    start: float  # [s] of its first recorded frame on the ground
    end: float  # [s] of its last one
    x: float  # [m] where it first stood
    y: float
    z: float
    moved: float  # [m] the way of the sole while it was down
    push: float  # [N] mean normal force


@explained
def footprints(run: Result) -> tuple[Footprint, ...]:
    """The footprints of all contacts that are single points, in order of time.

    Raises InputError if it is given no run.
    """
    if not isinstance(run, Result):
        raise wrong_type("footprints", "run", "a pg.Result, which pg.simulate returns", run)
    model = run.mechanism.model
    points = {c.name: c for c in model.contacts if len(c.points) == 1 and c.name in run.phases}
    found = [
        print_
        for name, contact in points.items()
        for print_ in _prints(run, name, sole(run, contact.body, np.array(contact.points[0])))
    ]
    return tuple(sorted(found, key=lambda one: one.start))


@explained
def footprints_csv(run: Result) -> str:
    """The footprints as CSV, units in the first line."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    units = ("", "s", "s", "m", "m", "m", "m", "N")
    names = Footprint._fields
    writer.writerow(f"{name} [{unit}]" if unit else name for name, unit in zip(names, units))
    writer.writerows(footprints(run))
    return text.getvalue()


def sole(run: Result, body: str, point: Array) -> Array:
    """(n, 3) places of a point of a body, world axes [m]."""
    pose = run.body_pose[:, run.mechanism.topology.number(body) - 1]
    return pose[:, :3] + turned(pose[:, 3:], point)


def _prints(run: Result, name: str, at: Array) -> Iterable[Footprint]:
    down = run.phases[name] != SWING
    ends = np.flatnonzero(np.diff(np.concatenate(([0], down.astype(int), [0]))))
    for a, b in zip(ends[::2].tolist(), ends[1::2].tolist()):
        moved = float(np.linalg.norm(np.diff(at[a:b], axis=0), axis=1).sum())
        push = float(run.contact_normal[name][a:b].mean())
        x, y, z = at[a].tolist()
        yield Footprint(name, float(run.t[a]), float(run.t[b - 1]), x, y, z, moved, push)
