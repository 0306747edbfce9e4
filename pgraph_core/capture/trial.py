"""Trials: markers, force plates and coordinates that a laboratory has recorded."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import joints
from ..errors import (
    FileError,
    InputError,
    Problem,
    choices,
    counted,
    explained,
    nearest,
    nearest_name,
    refusal,
    shown,
)
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


# -- what readers share ---------------------------------------------------------------------------


def known(call: str, field: str, kind: str, name: Any, names: Iterable[str]) -> None:
    """Refuse a name that is not there. Raises InputError."""
    names = list(names)
    if name not in names:
        text = f"there is no {kind} {shown(name)}; {nearest_name(str(name), names)}"
        raise refusal(call, field, text)


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
