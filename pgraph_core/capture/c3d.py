"""Reader of trials in C3D, with force plates of types 1 to 4 (The C3D File Format, 2020)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, Problem, needed
from .trial import LOADED, Array, Plate, Trial, centre_of_pressure, factor, labelled

CHANNELS = {1: 6, 2: 6, 3: 8, 4: 6}  # channels of each type of plate
FORCES = {"n": 1.0, "kn": 1000.0}
LENGTHS = {"mm": 0.001, "cm": 0.01, "m": 1.0}


def read(path: str | Path, units: str | None, subject: str | None) -> Trial:
    """Read markers, analog channels and force plates. Raises FileError, MissingPackage."""
    ezc3d = needed("ezc3d", "mocap")
    if not Path(path).is_file():
        raise FileError(Problem(str(path), "", "cannot be read: there is no such file"))
    try:
        file = ezc3d.c3d(str(path))
        points, residuals = file["data"]["points"], file["data"]["meta_points"]["residuals"]
        analogs, header, groups = file["data"]["analogs"][0], file["header"], file["parameters"]
    except Exception as error:  # ezc3d raises any kind for a damaged file
        raise FileError(Problem(str(path), "", f"cannot be read as C3D: {error}")) from None
    told: list[str] = []
    given = _text(groups, "POINT", "UNITS")
    scale, odd = factor(given, units, path) if points.shape[1] else (1.0, [])
    rate, first = float(header["points"]["frame_rate"]), int(header["points"]["first_frame"])
    n = points.shape[2] or len(residuals[0].T)
    if not (rate > 0.0 and (n or analogs.size)):
        raise FileError(Problem(str(path), "", "has no frames"))
    t = (first + np.arange(n)) / rate
    if first:
        told.append(f"the first frame is number {first + 1}, at t = {t[0] if n else 0.0:g} s")
    labels = [x for k in ("", *range(2, 10)) for x in _texts(groups, "POINT", f"LABELS{k}")]
    labels += [""] * (points.shape[1] - len(labels))
    seen = residuals[0] >= 0.0  # (markers, n); -1 marks a point that is not valid
    places = np.where(seen[:, :, None], scale * points[:3].transpose(1, 2, 0), np.nan)
    markers, more = labelled(zip(labels, places), subject, path)
    per_frame = max(round(float(header["analogs"]["frame_rate"]) / rate), 1)
    analog_t = first / rate + np.arange(analogs.shape[1]) / (per_frame * rate)
    if per_frame > 1:
        told.append(f"markers at {rate:g} Hz, analog channels at {per_frame * rate:g} Hz")
    plates, used = _plates(path, groups, analogs, analog_t, scale if units else None, told)
    names = _texts(groups, "ANALOG", "LABELS")
    free = [i for i in range(len(analogs)) if i not in used and i < len(names)]
    return Trial(
        t=t, markers=markers, plates=plates, analog={names[i]: analogs[i] for i in free},
        analog_t=analog_t, report=(*odd, *more, *told), source=Path(path).name,
    )  # fmt: skip


def _plates(
    path: str | Path, groups: Any, analogs: Array, t: Array, scale: float | None, told: list[str]
) -> tuple[tuple[Plate, ...], set[int]]:
    """Return the plates, and the indices of their channels."""
    if "FORCE_PLATFORM" not in groups or not _array(groups, "FORCE_PLATFORM", "USED").any():
        return (), set()

    def of(name: str) -> Array:
        return _array(groups, "FORCE_PLATFORM", name)

    count, channel = int(of("USED").flat[0]), of("CHANNEL").astype(int)
    word = _text(groups, "POINT", "UNITS").lower() or "mm"
    length = LENGTHS.get(word, 0.001) if scale is None else scale
    found, used = list[Plate](), set[int]()
    if (zero := of("ZERO").ravel()).size > 1 and zero[1] > zero[0] > 0:
        told.append(f"the offsets of the plates in frames {zero[0]:g} to {zero[1]:g} are not "
                    "subtracted")  # fmt: skip
    for k in range(count):
        name, kind = f"plate {k + 1}", int(of("TYPE").flat[k])
        if kind not in CHANNELS:
            told.append(f"{name} is of type {kind}, and left out: types 1 to 4 are read")
            continue
        try:
            own = channel[: CHANNELS[kind], k] - 1
            corners, origin = length * of("CORNERS")[:, :, k].T, of("ORIGIN")[:, k].astype(float)
            if (own < 0).any() or (own >= len(analogs)).any() or corners.shape != (4, 3):
                raise IndexError
            signals = analogs[own].T
        except IndexError:
            text = f"{name} lacks corners, an origin or channels; remove it from FORCE_PLATFORM"
            raise FileError(Problem(str(path), "", text)) from None
        used |= set(own.tolist())
        if not np.isfinite(signals).all():
            raise FileError(Problem(str(path), name, "has a sample that is no number"))
        if kind == 4:
            matrix = of("CAL_MATRIX")
            if matrix.ndim != 3 or matrix.shape[2] <= k:
                raise FileError(Problem(str(path), name, "of type 4 has no CAL_MATRIX"))
            signals = signals @ matrix[:6, :6, k].T
        unit = [_channel_unit(groups, int(i)) for i in own]
        plate = _plate(name, kind, signals, unit, (corners, length * origin, length), t, told)
        found.append(plate)
    return tuple(found), used


def _plate(
    name: str,
    kind: int,
    signals: Array,
    units: list[str],
    size: tuple[Array, Array, float],
    t: Array,
    told: list[str],
) -> Plate:
    """Return a plate from its channels (m, 6 or 8), in the axes of the corners."""
    corners, origin, length = size
    x, y = corners[0] - corners[1], corners[0] - corners[3]
    z = np.cross(x, y)
    axes = np.stack([v / (np.linalg.norm(v) or 1.0) for v in (x, np.cross(z, x), z)], axis=1)
    if not np.linalg.norm(z):
        told.append(f"{name} has corners on a line; its axes are unknown")
    centre = corners.mean(axis=0)
    if origin[2] > 0.0:
        told.append(f"{name}: its origin lies above the plate, taken as below")
        origin = -origin
    forces = FORCES.get(units[0].lower(), 1.0)
    turning = _unit_of_moment(units[-1], length)
    if kind == 3:  # (fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4)
        s = forces * signals
        a, b, down = abs(origin[0]), abs(origin[1]), origin[2]
        force = np.stack((s[:, 0] + s[:, 1], s[:, 2] + s[:, 3], s[:, 4:].sum(axis=1)), axis=1)
        moment = np.stack((
            b * (s[:, 4] + s[:, 5] - s[:, 6] - s[:, 7]),
            a * (s[:, 5] + s[:, 6] - s[:, 4] - s[:, 7]),
            b * (s[:, 1] - s[:, 0]) + a * (s[:, 2] - s[:, 3]),
        ), axis=1)  # fmt: skip
        moment = moment + np.cross(force, (0.0, 0.0, down))
    elif kind == 1:  # (fx, fy, fz, px, py, tz)
        force = forces * signals[:, :3]
        at = length * np.stack((signals[:, 3], signals[:, 4], np.zeros(len(signals))), axis=1)
        free = turning * signals[:, 5, None] * np.array([0.0, 0.0, 1.0])
        moment = np.cross(at, force) + free
    else:
        force, moment = forces * signals[:, :3], turning * signals[:, 3:]
        moment = moment + np.cross(force, origin)
    force, moment = force @ axes.T, moment @ axes.T  # about the centre of the plate's surface
    up = np.zeros(3)
    up[np.abs(axes[:, 2]).argmax()] = 1.0
    lift = force @ up
    if lift[np.abs(lift) > LOADED].sum() < 0.0:  # a plate only pushes
        told.append(f"{name} records the force on the plate; the one on the foot is its opposite")
        force, moment = -force, -moment
    moment = moment + np.cross(centre, force)
    point = centre_of_pressure(force, moment, centre, axes)
    low, high = corners.min(axis=0), corners.max(axis=0)
    off = np.isfinite(point[:, 0]) & ((point < low - length) | (point > high + length))[
        :, np.arange(3) != np.abs(axes[:, 2]).argmax()
    ].any(axis=1)
    if off.any():
        told.append(f"{name}: the centre of pressure is off the plate in {int(off.sum())} samples")
    return Plate(name, t, force, moment, point, corners)


def _unit_of_moment(text: str, length: float) -> float:
    """Return the factor to N m of a channel. A force alone counts with the unit of lengths."""
    word = text.lower().replace(".", "").replace("*", "").replace(" ", "").replace("-", "")
    known = {f"{f}{x}": FORCES[f] * LENGTHS[x] for f in FORCES for x in LENGTHS}
    return known.get(word, length)


def _channel_unit(groups: Any, i: int) -> str:
    units = _texts(groups, "ANALOG", "UNITS")
    return units[i] if i < len(units) else ""


def _array(groups: Any, group: str, name: str) -> Array:
    held = dict(groups).get(group, {})
    return np.asarray(held[name]["value"], float) if name in held else np.zeros(0)


def _texts(groups: Any, group: str, name: str) -> list[str]:
    held = dict(groups).get(group, {})
    return [str(x).strip() for x in held[name]["value"]] if name in held else []


def _text(groups: Any, group: str, name: str) -> str:
    return next(iter(_texts(groups, group, name)), "")
