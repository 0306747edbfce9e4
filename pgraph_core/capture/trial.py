"""Trials: markers, force plates and coordinates that a laboratory has recorded."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import joints
from ..errors import FileError, InputError, Problem, choices, counted, explained, nearest, shown
from ..tolerances import NOTABLE, SOLVED

if TYPE_CHECKING:
    from ..mechanism import Mechanism

Array = np.ndarray
LOADED = 20  # [N] upward force below which a plate bears nobody, as laboratories use
UPS = ("x", "y", "z")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
ROOM = 50  # [m] span of markers that no laboratory has


@dataclass(frozen=True, eq=False)
class Plate:
    """A force plate: its wrench on the foot, in the axes of the trial.

    The wrench about the origin of the axes is exact at any load. The centre of pressure is that of
    loads above 20 N, and nan otherwise.
    """

    name: str
    t: Array  # (m,) [s]
    force: Array  # (m, 3) on the foot [N]
    moment: Array  # (m, 3) on the foot, about the origin of the axes [N m]
    point: Array  # (m, 3) centre of pressure [m], nan where the plate bears less than 20 N
    corners: Array | None = None  # (4, 3) [m]

    @property
    def loaded(self) -> Any:
        """A mask (m,) that is True where the plate bears a load."""
        return np.isfinite(self.point[:, 0])

    def wrench(self, t: Array) -> Array:
        """Return [torque about the origin, force] (n, 6) at times, zero beyond the record."""
        both = np.hstack((self.moment, self.force))
        return np.stack([np.interp(t, self.t, x, 0.0, 0.0) for x in both.T], axis=1)

    def turned(self, turn: Array) -> Plate:
        """Return the plate in other axes, x' = turn x."""
        corners = None if self.corners is None else self.corners @ turn.T
        force, moment, point = (x @ turn.T for x in (self.force, self.moment, self.point))
        return replace(self, force=force, moment=moment, point=point, corners=corners)


@explained
@dataclass(frozen=True, eq=False)
class Trial:
    """A recorded trial, in SI units and in the axes of its file.

    `print(trial)` lists what the reader found odd or changed.
    """

    t: Array  # (n,) times of markers and coordinates [s]
    markers: Mapping[str, Array] = field(default_factory=dict[str, Array])
    """{label: (n, 3)} [m], nan in frames in which a marker was not seen."""
    plates: tuple[Plate, ...] = ()
    coordinates: Mapping[str, Array] = field(default_factory=dict[str, Array])
    """{name: (n,)} columns of a table, in the units of the file."""
    degrees: bool = False  # whether angles among `coordinates` are in degrees
    analog: Mapping[str, Array] = field(default_factory=dict[str, Array])
    """{label: (m,)} channels that belong to no plate, in the units of the file."""
    analog_t: Array = field(default_factory=lambda: np.zeros(0))  # (m,) [s]
    up: str | None = None  # "x", "y" or "z", None if unknown
    report: tuple[str, ...] = ()
    source: str = ""

    def __repr__(self) -> str:
        span = f", {self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else ""
        head = f"<Trial {self.source!r}: {counted(len(self.t), 'frame')}{span}, "
        head += f"{counted(len(self.markers), 'marker')}, {counted(len(self.plates), 'plate')}"
        head += f", {counted(len(self.coordinates), 'coordinate')}" * bool(self.coordinates)
        return "\n  ".join((f"{head}, up {self.up or 'unknown'}>", *self.report))

    @property
    def rate(self) -> float:
        """Frames per second [Hz]."""
        return (len(self.t) - 1) / float(self.t[-1] - self.t[0]) if len(self.t) > 1 else math.nan

    @property
    def gaps(self) -> dict[str, int]:
        """The numbers of frames in which each marker was not seen, for those with any."""
        lost = {name: int(np.isnan(x[:, 0]).sum()) for name, x in self.markers.items()}
        return {name: n for name, n in lost.items() if n}

    def with_up(self, up: str) -> Trial:
        """Return the trial in axes of which `up` is vertical, by a rotation of the axes."""
        if self.up is None or self.up == up:
            return self
        steps = (UPS.index(up) - UPS.index(self.up)) % 3
        turn = np.roll(np.eye(3), steps, axis=0)
        told = f"axes turned: {self.up} was up in the file, {up} is up in the model"
        return replace(
            self, up=up, report=(*self.report, told),
            markers={name: x @ turn.T for name, x in self.markers.items()},
            plates=tuple(plate.turned(turn) for plate in self.plates),
        )  # fmt: skip

    def between(self, start: float, end: float) -> Trial:
        """Return the frames from `start` to `end` [s]. Plates stay whole."""
        kept = (self.t >= start) & (self.t <= end)
        if not kept.any():
            text = f"has no frame from {start:g} to {end:g} s; it lasts from {self.t[0]:g} to "
            raise InputError(Problem(f"trial {self.source!r}", "", f"{text}{self.t[-1]:g} s"))
        markers, coordinates = (
            {name: x[kept] for name, x in table.items()}
            for table in (self.markers, self.coordinates)
        )
        return replace(self, t=self.t[kept], markers=markers, coordinates=coordinates)

    def positions(self, mech: Mechanism) -> Array:
        """Return q (n, nq) of a mechanism from columns of coordinates, by name.

        A column has the name of a joint or of an output of a joint position, as those that the
        reader of OpenSim makes. Others keep the initial q. Raises InputError if no name fits.
        """
        from ..result.columns import coordinates

        listed = coordinates(mech)[0]
        places = {name: (i, unit) for i, (name, unit) in enumerate(listed)}
        for o in mech.model.outputs:
            if o.kind != "joint_position":
                continue
            place = joints.places(mech.model.body(o.at).sequence)[o.coordinate]
            if place is not None:
                i = mech.joints[o.at].q.start + place
                places[o.name] = i, listed[i][1]
        found = np.tile(mech.home()[0], (len(self.t), 1))
        known = [name for name in self.coordinates if name in places]
        if not known:
            text = f"has no column of a joint; it has {choices(self.coordinates, 12) or 'none'}, "
            text += f"and the model has {choices(places, 12)}"
            raise InputError(Problem(f"trial {self.source!r}", "", text))
        for name in known:
            i, unit = places[name]
            factor = math.pi / 180 if self.degrees and unit == "rad" else 1.0
            found[:, i] = factor * self.coordinates[name]
        return found


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
    from . import c3d, tables  # other readers need no ezc3d

    readers = {".c3d": c3d.read, ".trc": tables.read_trc, ".mot": tables.read_storage,
               ".sto": tables.read_storage, ".csv": tables.read_csv}  # fmt: skip
    suffix = Path(path).suffix.lower()
    if suffix not in readers:
        text = f"is no trial: its name must end in {choices(readers)}"
        raise FileError(Problem(str(path), "", text))
    return readers[suffix](path, units, subject)


# -- what readers share ---------------------------------------------------------------------------


def labelled(
    pairs: Iterable[tuple[str, Array]], subject: str | None, path: str | Path
) -> tuple[dict[str, Array], list[str]]:
    """Return markers by label without the prefix of their subject, and what was odd about them.

    `pairs` are (label, (n, 3) [m]). Points at exactly (0, 0, 0) were not seen.
    """
    told: list[str] = []
    pairs = [(label.strip(), np.asarray(x, float)) for label, x in pairs]
    nameless = [label for label, _ in pairs if not label or label.startswith("*")]
    if nameless:
        told.append(f"{counted(len(nameless), 'marker')} without a label left out")
    pairs = [(label, x) for label, x in pairs if label not in nameless]
    prefixes = Counter(label.rpartition(":")[0] for label, _ in pairs if ":" in label)
    if subject is not None and subject not in prefixes:
        text = f"has no subject {subject!r}; {nearest(subject, prefixes) or 'its labels have none'}"
        raise FileError(Problem(str(path), "subject", text))
    if subject is not None:
        own = f"{subject}:"
        pairs = [(x.removeprefix(own), m) for x, m in pairs if x.startswith(own)]
        told.append(f"markers of subject {subject} read, {choices(prefixes)} are in the file")
    elif len(prefixes) == 1:
        (prefix,) = prefixes
        pairs = [(label.removeprefix(f"{prefix}:"), x) for label, x in pairs]
        told.append(f"prefix {prefix}: taken off the labels")
    elif prefixes:
        told.append(
            f"labels have the prefixes {choices(prefixes)}, which were kept; "
            f"subject={next(iter(prefixes))!r} reads those of one"
        )
    found: dict[str, Array] = {}
    for label, x in pairs:
        name, n = label, 1
        while name in found:
            name, n = f"{label}#{n + 1}", n + 1
        if name != label:
            told.append(f"two markers have the label {label}; the later one is called {name}")
        if zeros := int((np.abs(x).max(axis=1) == 0.0).sum()):
            told.append(f"{name} is at exactly (0, 0, 0) in {counted(zeros, 'frame')}, not seen")
        lost = ~(np.abs(x).max(axis=1, keepdims=True) > 0.0)  # also of what is no number
        found[name] = np.where(lost, np.nan, x)
    return found, told


def factor(given: str, units: str | None, path: str | Path) -> tuple[float, list[str]]:
    """Return the factor to metres for the unit of a file, or for `units`, and a sentence."""
    word = given.strip().lower()
    if units is not None:
        odd = word and word != units
        return METRES[units], [f"unit {units} as given, the file says {given}"] if odd else []
    if word in METRES:
        return METRES[word], []
    text = f"states the unit {given!r} of markers; give units='mm' or 'm'"
    raise FileError(Problem(str(path), "units", text))


def centre_of_pressure(force: Array, moment: Array, origin: Array, axes: Array) -> Array:
    """Return the points (m, 3) of a plane at which wrenches have no torque along it, in its axes'
    world.

    `moment` is about the origin of the world, `axes` (3, 3) has the plane's axes as columns, and
    the last one is its normal. Loads below 20 N along it have none, nan.
    """
    f = force @ axes
    m = (moment - np.cross(origin, force)) @ axes
    borne = np.abs(f[:, 2:]) > LOADED
    over = np.where(borne, f[:, 2:], 1.0)[:, 0]
    inside = np.stack((-m[:, 1] / over, m[:, 0] / over, np.zeros(len(f))), axis=1)
    return np.where(borne, origin + inside @ axes.T, np.nan)


def even(t: Array, path: str | Path, stated: float = 0.0) -> tuple[Array, list[str]]:
    """Return times, those of an even rate if the given ones are these to their last digit.

    The rate is the stated one [Hz], or a whole number, or that of the first and last time.
    """
    t = np.asarray(t, float)
    if not (np.isfinite(t).all() and (np.diff(t) > 0).all()):
        k = int(np.flatnonzero(~(np.diff(t) > 0))[0]) + 1 if len(t) > 1 else 0
        text = f"times must ascend, and that of row {k + 1} does not"
        raise FileError(Problem(str(path), "time", text))
    if len(t) < 3:
        return t, []
    mean = (len(t) - 1) / float(t[-1] - t[0])
    digits = next((k for k in range(8) if np.abs(t - t.round(k)).max() <= SOLVED), 8)
    for rate in (stated, float(round(mean)), mean):
        grid = t[0] + np.arange(len(t)) / (rate or mean)
        apart = float(np.abs(t - grid).max())
        if apart <= NOTABLE / mean:
            return grid, []
        if apart <= 10.0**-digits and apart < 1 / (4 * mean):
            rounded = f"times are rounded to {digits} digits; even ones at {rate or mean:.6g} Hz"
            return grid, [f"{rounded} were taken"]
    steps = np.diff(t)
    return t, [f"times are not even: steps from {steps.min():.6g} to {steps.max():.6g} s"]


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
