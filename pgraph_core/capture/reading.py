"""Reading of trials, with the doubts that a user should know."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from ..errors import FileError, InputError, Problem, choices, explained, shown
from . import c3d, tables
from .trial import LOADED, METRES, ROOM, UPS, Plate, Trial

READERS = {".c3d": c3d.read, ".trc": tables.read_trc, ".mot": tables.read_storage,
           ".sto": tables.read_storage, ".csv": tables.read_csv}  # fmt: skip


@explained
def read_trial(
    path: str | Path,
    *,
    forces: str | Path | None = None,
    up: str | None = None,
    units: str | None = None,
    subject: str | None = None,
) -> Trial:
    """Read markers, force plates and coordinates of a trial.

    Parameters
    ----------
    path : path
        A .c3d, .trc, .mot, .sto or .csv file. C3D needs `pip install 'pgraph-dynamics[mocap]'`.
    forces : path, optional
        Another file with the force plates, such as the .mot file beside a .trc file.
    up : {"x", "y", "z"}, optional
        The vertical axis of the file. By default, it is the normal of the plates, or the direction
        of their largest mean force.
    units : {"m", "cm", "mm"}, optional
        Unit of the markers, if the file states none or a wrong one.
    subject : str, optional
        Subject whose markers are read, if labels have prefixes of several, as "S1:RASI".

    Returns
    -------
    Trial
        In SI units. `report` names everything that was odd, changed or left out.

    Raises
    ------
    FileError
        If the file cannot be read or has no markers, plates or coordinates.
    InputError
        If an argument is invalid.
    MissingPackage
        If `ezc3d` is needed and is not installed.

    Examples
    --------
        trial = pg.read_trial("walk.trc", forces="walk_grf.mot")
        print(trial)
    """
    for name, value, known in (("up", up, UPS), ("units", units, tuple(METRES))):
        if value is not None and value not in known:
            text = f"must be one of {choices(known)}, got {shown(value)}"
            raise InputError(Problem("read_trial", name, text))
    trial = _read(path, units, subject)
    if forces is not None:
        other = _read(forces, units, subject)
        if not other.plates:
            text = "has no force plate; its columns are "
            raise FileError(
                Problem(str(forces), "", text + (choices(other.coordinates, 12) or "none"))
            )
        trial = replace(trial, plates=other.plates, report=(*trial.report, *other.report))
    trial = replace(trial, up=up or _upward(trial.plates))
    return replace(trial, report=(*trial.report, *_doubts(trial)))


def _read(path: str | Path, units: str | None, subject: str | None) -> Trial:
    suffix = Path(path).suffix.lower()
    if suffix not in READERS:
        text = f"is no trial: its name must end in {choices(READERS)}"
        raise FileError(Problem(str(path), "", text))
    return READERS[suffix](path, units, subject)


def _upward(plates: tuple[Plate, ...]) -> str | None:
    """Return the vertical axis by the plates' normals, or by their force, None without plates."""
    if not plates:
        return None
    normals = [
        np.cross(p.corners[0] - p.corners[1], p.corners[0] - p.corners[3])
        for p in plates if p.corners is not None
    ]  # fmt: skip
    total = [np.abs(p.force).sum(axis=0) for p in plates]
    return UPS[int(np.sum(np.abs(normals or total), axis=0).argmax())]


def _doubts(trial: Trial) -> list[str]:
    """Return sentences on gaps, sizes and times that a user should know."""
    told: list[str] = []
    n = len(trial.t)
    never = [name for name, lost in trial.gaps.items() if lost == n]
    some = [f"{name} in {lost}" for name, lost in trial.gaps.items() if lost < n]
    if never:
        told.append(f"never seen: {choices(never)}")
    if some:
        told.append(f"not seen in some of {n} frames: {choices(some, 12)}")
    seen = [x[np.isfinite(x[:, 0])] for x in trial.markers.values()]
    points = np.concatenate(seen) if seen else np.zeros((0, 3))
    if len(points):
        span = float(np.ptp(points, axis=0).max())
        if span > ROOM or span < ROOM * METRES["mm"]:
            told.append(f"markers span {span:.3g} m: is their unit right? units='mm' changes it")
    for label, other in combinations([x for x in trial.markers if x not in never], 2):
        if np.array_equal(trial.markers[label], trial.markers[other], equal_nan=True):
            told.append(f"{label} and {other} are at the same place in every frame")
    if trial.up is None and trial.markers:
        told.append("the vertical axis is unknown, and taken as that of the model; give up='z'")
    for plate in trial.plates:
        up = trial.up
        if not plate.loaded.any():
            told.append(f"{plate.name} is never loaded by more than {LOADED:g} N")
        elif up and plate.force[plate.loaded][:, UPS.index(up)].mean() < 0:
            told.append(f"{plate.name} pulls the foot down: its force seems to be on the plate")
        start, end = trial.t[[0, -1]] if n else (0.0, 0.0)
        if n and (plate.t[0] > start + 1.5 / trial.rate or plate.t[-1] < end - 1.5 / trial.rate):
            told.append(f"{plate.name} records from {plate.t[0]:g} to {plate.t[-1]:g} s, and the "
                        f"frames last from {start:g} to {end:g} s")  # fmt: skip
    if trial.markers and not trial.plates:
        told.append("no force plates")
    return told
