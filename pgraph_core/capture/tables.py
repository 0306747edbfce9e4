"""Readers of trials in text: .trc, .mot, .sto and .csv."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import FileError, Problem, choices, counted
from ..markup import ordinary
from ..search.measured import factor_of
from .trial import LOADED, Array, Plate, Trial, even, factor, labelled

VECTOR = re.compile(r"(.+)[._ ]([xyzXYZ])$")


def read_trc(path: str | Path, units: str | None, subject: str | None) -> Trial:
    """Read markers of a .trc file. Raises FileError."""
    lines = _lines(path)
    if len(lines) < 6 or "PathFileType" not in lines[0]:
        raise FileError(Problem(str(path), "", "is no .trc file: it must begin with PathFileType"))
    facts = dict(zip(lines[1].split(), lines[2].split()))
    tabbed = "\t" in lines[3]
    labels = [x.strip() for x in (lines[3].split("\t") if tabbed else lines[3].split())]
    labels = [label for label in labels[2:] if label]
    count = len(labels)
    told, rows = list[str](), list[list[float]]()
    for number, line in enumerate(lines[5:], start=6):
        if not line.strip():
            continue
        cells = line.split("\t") if tabbed else line.split()
        cells += [""] * (2 + 3 * count - len(cells))
        rows.append([_number(path, number, x) for x in cells[: 2 + 3 * count]])
    table = _table(path, rows)
    if str(count) != facts.get("NumMarkers", str(count)):
        told.append(f"the file says {facts['NumMarkers']} markers, and has {count} labels")
    if str(len(table)) != facts.get("NumFrames", str(len(table))):
        told.append(f"the file says {facts['NumFrames']} frames, and has {len(table)}")
    scale, odd = factor(facts.get("Units", ""), units, path)
    points = scale * table[:, 2:].reshape(len(table), count, 3)
    markers, more = labelled(((x, points[:, i]) for i, x in enumerate(labels)), subject, path)
    rate = facts.get("DataRate", "")
    t, uneven = even(table[:, 1], path, float(rate) if rate.replace(".", "", 1).isdigit() else 0.0)
    report = (*told, *odd, *more, *uneven)
    return Trial(t=t, markers=markers, report=report, source=Path(path).name)


def read_storage(path: str | Path, units: str | None, subject: str | None) -> Trial:
    """Read coordinates and force plates of a .mot or .sto file. Raises FileError."""
    lines = _lines(path)
    end = next((i for i, x in enumerate(lines) if x.strip().lower() == "endheader"), None)
    head = lines[: end or 0]
    facts = dict(x.strip().lower().split("=", 1) for x in head if "=" in x)
    if end is None or len(lines) < end + 3:
        text = "has no line 'endheader' with a line of names and lines of numbers below it"
        raise FileError(Problem(str(path), "", text))
    names = lines[end + 1].split()
    rows = [
        [_number(path, n, x) for x in line.split()]
        for n, line in enumerate(lines[end + 2 :], start=end + 3) if line.strip()
    ]  # fmt: skip
    columns = dict(zip(names, _table(path, rows, len(names)).T))
    return _of_columns(path, columns, units, subject, facts.get("indegrees", "no") == "yes")


def read_csv(path: str | Path, units: str | None, subject: str | None) -> Trial:
    """Read a table with a column of times, and columns such as "RASI.x [mm]". Raises FileError."""
    rows = [row for row in csv.reader(_lines(path)) if any(cell.strip() for cell in row)]
    if len(rows) < 2:
        raise FileError(Problem(str(path), "", "needs a line of names and lines of numbers"))
    heads = [cell.strip() for cell in rows[0]]
    numbers = [[_number(path, n, cell) for cell in row] for n, row in enumerate(rows[1:], start=2)]
    values = _table(path, numbers, len(heads)).T
    columns: dict[str, Array] = {}
    for head, x in zip(heads, values):
        name, _, unit = head.partition("[")
        name, unit = name.strip(), unit.strip(" ]")
        if units is None and unit in ("mm", "cm") and VECTOR.match(name):
            x = x * (factor_of(unit, "m") or 1.0)
        columns["time" if name == "t" else name] = x
    return _of_columns(path, columns, units, subject, degrees=False)


def _of_columns(
    path: str | Path,
    columns: Mapping[str, Array],
    units: str | None,
    subject: str | None,
    degrees: bool,
) -> Trial:
    """Return the trial of named columns: plates, then points, then coordinates."""
    rest = dict(columns)
    if "time" not in rest:
        raise FileError(Problem(str(path), "", f"needs a column time, got {choices(rest, 12)}"))
    t, told = even(rest.pop("time"), path)
    plates: list[Plate] = []
    for stem in [name[:-1] for name in columns if name.endswith("vx")]:
        base = stem[:-1]
        force = _taken(rest, stem)
        point = _taken(rest, f"{base}p")
        torques = [base.replace("force", word) for word in ("torque", "moment")]
        torque = next(
            (x for s in (*torques, f"{base}m", f"{base}t") if (x := _taken(rest, s)) is not None),
            None,
        )
        if force is None or point is None:
            text = f"column {stem}x needs {stem}y, {stem}z and {base}px, {base}py, {base}pz"
            raise FileError(Problem(str(path), "", text))
        name = base.strip("_")
        if torque is None:
            told.append(f"{name} has no torque, taken as zero")
            torque = np.zeros_like(force)
        whole = [np.isfinite(x).all(axis=1) for x in (force, torque)]
        if not (whole[0] & whole[1]).all():
            row = int(np.flatnonzero(~(whole[0] & whole[1]))[0])
            raise FileError(Problem(str(path), name, f"has no number at t = {t[row]:g} s"))
        borne = np.linalg.norm(force, axis=1) > LOADED
        if len(lost := np.flatnonzero(borne & ~np.isfinite(point).all(axis=1))):
            text = f"bears a load and has no centre of pressure at t = {t[lost[0]]:g} s"
            raise FileError(Problem(str(path), name, text))
        point = np.where(np.isfinite(point), point, 0.0)
        moment = torque + np.cross(point, force)
        plates.append(Plate(name, t, force, moment, np.where(borne[:, None], point, np.nan)))
    stems: dict[str, list[str]] = {}
    for name in rest:
        if found := VECTOR.match(name):
            stems.setdefault(found[1], []).append(name)
    points = {stem: each for stem, each in stems.items() if len(each) == 3}
    scale, odd = factor("m", units, path) if points else (1.0, [])
    pairs = [(s, scale * np.stack([rest.pop(x) for x in each], 1)) for s, each in points.items()]
    markers, more = labelled(pairs, subject, path)
    bad = {name: int((~np.isfinite(x)).sum()) for name, x in rest.items()}
    if gone := [f"{name} in {n}" for name, n in bad.items() if n]:
        told.append(f"columns without a number left out: {choices(gone, 12)}")
    rest = {name: x for name, x in rest.items() if not bad[name]}
    if not (plates or markers or rest):
        raise FileError(Problem(str(path), "", "has no markers, force plates or coordinates"))
    if plates and rest:
        told.append(f"{counted(len(rest), 'column')} beside the plates: {choices(rest, 12)}")
    return Trial(
        t=t, markers=markers, plates=tuple(plates), coordinates=rest, degrees=degrees,
        report=(*told, *odd, *more), source=Path(path).name,
    )  # fmt: skip


def _taken(columns: dict[str, Array], stem: str) -> Array | None:
    """Take the columns (n, 3) of a vector out, by its stem, None if they are not there."""
    for between in ("", "_"):
        names = [f"{stem}{between}{axis}" for axis in "xyz"]
        if all(name in columns for name in names):
            return np.stack([columns.pop(name) for name in names], axis=1)
    return None


def _lines(path: str | Path) -> list[str]:
    try:
        with ordinary(path) as file:
            return file.read().decode("utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        raise FileError(Problem(str(path), "", f"cannot be read: {error}")) from None


def _number(path: str | Path, line: int, cell: str) -> float:
    """Return the number of a cell, nan of an empty one. Raises FileError."""
    word = cell.strip()
    if not word:
        return np.nan
    try:
        return float(word)
    except ValueError:
        text = f"line {line} has {word[:40]!r}, which is no number"
        raise FileError(Problem(str(path), "", text)) from None


def _table(path: str | Path, rows: list[list[float]], width: int | None = None) -> Array:
    """Return rows of equal length (n, width). Raises FileError."""
    if not rows:
        raise FileError(Problem(str(path), "", "has no rows of numbers"))
    width = len(rows[0]) if width is None else width
    for n, row in enumerate(rows, start=1):
        if len(row) != width:
            text = f"row {n} has {counted(len(row), 'number')}, and {width} are needed"
            raise FileError(Problem(str(path), "", text))
    return np.array(rows)
