"""A report on a file: parts read, converted, approximated and omitted, with their locations."""

from __future__ import annotations

import html
import math
import os
from collections.abc import Collection, Container, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple
from urllib.parse import unquote

import numpy as np

from ..errors import FileError, InputError, Problem, Suggests, choices, explained, shown
from ..fields import GROUND
from ..markup import read_markup
from ..model import Body, Gear, Model
from ..model.description import LOST
from ..model.doubts import MILLI, limits_in_degrees, wide
from ..model.files import ALLOW
from ..model.inertia import inertia_problems
from ..rotation import unit
from ..tolerances import ROUNDING, SOLVED

Kind = Literal["read", "converted", "approximated", "left out", "warning"]
KINDS: tuple[Kind, ...] = ("warning", "left out", "approximated", "converted", "read")


def named(path: str | Path, *suffixes: str) -> Path:
    """Create an output path after checking its suffix. Raises FileError."""
    if Path(path).suffix.lower() not in suffixes:
        text = f"give a name that ends in {' or '.join(suffixes)}"
        raise FileError(Problem(str(path), "", text))
    return Path(path)


def tell_beams(report: Report, model: Model) -> None:
    """Report the beams of an expanded model, which a file has as bodies with springs."""
    for name, counts in model.segments.items():
        text = f"becomes its {sum(counts)} segments with springs, one body each"
        report.add("converted", f"beam '{name}'", text, part=name)


def unused(name: str, taken: Container[str]) -> str:
    """Return a name, with primes if others have it."""
    while name in taken:
        name += "'"
    return name


def names_beside(reserved: str, names: Collection[str]) -> dict[str, str]:
    """Return the names of parts in a file in which one name is reserved. Only this one changes."""
    return {name: unused(name, names) if name == reserved else name for name in names}


def at_origin(body: Body) -> bool:
    """Check whether a body is welded to the ground at its origin."""
    at_ground = body.parent == GROUND and body.joint == "weld"
    return at_ground and not any(body.link) and abs(unit(body.rotation)[0]) == 1.0


@dataclass(frozen=True)
class Entry:
    """A single line in a report."""

    kind: Kind
    where: str  # "robot.urdf, line 12, joint 'knee'"
    text: str
    acts: bool = False  # True if results of runs differ from those of the file because of it
    part: str = ""  # name of the body or other part of the model that it is about

    def __str__(self) -> str:
        return f"{self.kind}: {self.where}: {self.text}" if self.where else self.text


@explained
@dataclass
class Report(Suggests):
    """A conversion report, which can be printed."""

    file: str
    entries: list[Entry] = field(default_factory=list[Entry])
    repairs: dict[str, tuple[tuple[float, ...], ...]] = field(
        default_factory=dict[str, tuple[tuple[float, ...], ...]]
    )  # body -> the nearest inertia (3, 3) that a rigid body can have [kg m^2]
    refused: str = ""  # reason why the written file's program will refuse it, and a remedy

    def add(self, kind: Kind, where: str, text: str, *, acts: bool = False, part: str = "") -> None:
        """One more line."""
        self.entries.append(Entry(kind, where, text, acts, part))

    def of(self, kind: Kind) -> Iterator[Entry]:
        """Return the lines of one kind."""
        return (entry for entry in self.entries if entry.kind == kind)

    @property
    def loaded(self) -> bool:
        """Return True if no part that affects the motion was omitted."""
        return not any(entry.acts for entry in self.of("left out"))

    def attached_to(self, model: Model) -> Model:
        """Return the model with all lines that affect the results of runs as `model.lost`."""
        lost = (str(e) for e in self.entries if e.acts)
        vars(model)[LOST] = tuple(lost)  # no field: models are equal without it
        return model

    def noted(self, model: Model) -> Model:
        """Return the model, whose `notices` list omissions, warnings and changes of results."""
        worth = (str(e) for e in self.entries if e.kind in ("left out", "warning") or e.acts)
        vars(model)["notices"] = tuple(worth)
        return model

    def repaired(self, model: Model, *names: str) -> Model:
        """Return the model with the inertias from `repairs`, for these bodies or for all.

        Raises InputError for a body that needs no repair.
        """
        for name in names:
            if name not in self.repairs:
                known = choices(self.repairs) or "none"
                text = f"has no inertia to repair; those that have: {known}"
                raise InputError(Problem(f"body {shown(name)}", "", text))
        for name in names or self.repairs:
            model = model.edit(name, inertia=self.repairs[name], any_inertia=False)
        return model

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as a dictionary, for JSON."""
        return {
            "file": self.file,
            "loaded": self.loaded,
            "refused": self.refused,
            "entries": [asdict(entry) for entry in self.entries],
            "repairs": {name: [list(row) for row in x] for name, x in self.repairs.items()},
        }

    def __repr__(self) -> str:
        counts = ", ".join(f"{n} {kind}" for kind in KINDS if (n := len([*self.of(kind)])))
        word = "loaded" if self.loaded else "some acting parts are not loaded"
        word = "will be refused" if self.refused else word
        return f"<Report {shown(self.file)}: {word}; {counts}>"

    def __str__(self) -> str:
        first = self.refused or (
            "all acting parts are included" if self.loaded else "some acting parts were omitted"
        )
        return "\n".join(
            [f"{self.file}: {first}", *(f"  {e}" for kind in KINDS for e in self.of(kind))]
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{e.kind}</td><td>{html.escape(e.where)}</td><td>{html.escape(e.text)}</td></tr>"
            for kind in KINDS
            for e in self.of(kind)
        )
        head = "<tr><th>what</th><th>where</th><th></th></tr>"
        why = f"<p>{html.escape(self.refused)}</p>" if self.refused else ""
        return f"<p>{html.escape(repr(self))}</p>{why}<table>{head}{rows}</table>"


# -- joints that follow each other ----------------------------------------------------------------


def suspect_rings(report: Report, gears: Iterable[tuple[Gear, str]]) -> None:
    """Warn about each gear (and its location) between joints that other gears connect."""
    tied: dict[tuple[str, int], tuple[tuple[str, int], float, float]] = {}  # q = factor x q' + at
    for gear, where in gears:
        own, other = (gear.body, gear.coordinate), (gear.other, gear.other_coordinate)
        base, factor, at = tied.get(other, (other, 1.0, 0.0))
        factor, at = gear.ratio * factor, gear.ratio * at + gear.offset
        root, own_factor, own_at = tied.setdefault(own, (own, 1.0, 0.0))
        tied.setdefault(other, (other, 1.0, 0.0))
        if not own_factor or not np.isfinite(factor + at):  # products that vanish or overflow
            continue
        slope, gap = own_factor - factor, at - own_at
        if root != base:  # q of the root = (factor x q of the base + gap) / own_factor
            for end, (known, f, x) in tied.items():
                if known == root:
                    tied[end] = base, f * factor / own_factor, f * gap / own_factor + x
            continue
        if abs(slope) > SOLVED * max(abs(factor), abs(own_factor)):
            text = f"all joints of the loop are held, '{base[0]}' at q = {gap / slope:.6g}"
        elif abs(gap) > SOLVED * max(1.0, abs(at), abs(own_at)):
            text = "no joint positions satisfy all of its gears"
        else:
            text = "the gear follows from the others"
        text = f"'{own[0]}' and '{other[0]}' follow each other in a closed loop of gears: {text}"
        report.add("warning", where, text, part=gear.name)


# -- inertias --------------------------------------------------------------------------------------

MOST_INERTIA = float(np.finfo(float).max ** 0.5) / 10  # [kg m^2] squares of it can be added


def why_unphysical(inertia: np.ndarray) -> str:
    """Return the reason why no rigid body can have this inertia, or ""."""
    rows = tuple(tuple(row) for row in inertia.tolist())
    return "; ".join(text for _, text in inertia_problems(rows))


def nearest_inertia(inertia: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """Return the rigid-body inertia nearest to a symmetric matrix, in the Frobenius norm.

    The second moments S = tr(I)/2 - I of a body must be positive semidefinite [Wensing, Kim and
    Slotine 2018]. The closest valid inertia with the same eigenvectors is found by a least-squares
    problem for its eigenvalues.
    """
    from scipy.optimize import nnls

    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    about = 1.0 - np.eye(3)  # moments of inertia are sums of two second moments
    size = float(np.abs(moments).max()) or 1.0  # squares of the largest moments overflow
    best = size * (about @ nnls(about, moments / size)[0])
    best += ROUNDING * float(best.max())  # for moments of flat and thin bodies
    fixed = axes @ np.diag(best) @ axes.T
    fixed = (fixed + fixed.T) / 2
    return tuple(tuple(float(x) for x in row) for row in fixed)


def unphysical(report: Report, where: str, name: str, inertia: np.ndarray) -> dict[str, Any]:
    """Return body fields that keep an unphysical inertia, and report it together with a repair.

    Raises FileError for an inertia that overflows.
    """
    if not (np.abs(inertia) < MOST_INERTIA).all():
        text = f"its numbers overflow; moments below {MOST_INERTIA:g} kg m^2 are read"
        raise FileError(Problem(where, "inertia", text))
    why = why_unphysical(inertia)
    if not why:
        return {}
    report.repairs[name] = nearest_inertia(inertia)
    text = f"{why}; kept as given. `report.repaired(model)` uses the closest valid inertia"
    report.add("warning", where, f"the inertia {text}", part=name)
    return {"any_inertia": True}


# -- limits --------------------------------------------------------------------------------------

NO_LIMIT = 1e9  # m, rad, N, rad/s: stands for no limit if a format asks for a number

# -- units -----------------------------------------------------------------------------------------

TALL = 100.0  # m between two bodies
DENSEST = 22_590.0  # kg/m³, osmium: no solid is denser (CRC Handbook of Chemistry and Physics)
HEAVY = 4 / 3 * math.pi * DENSEST  # kg of one body: a ball of osmium with a radius of 1 m


def suspect_units(report: Report, model: Model, reach: float) -> None:
    """Warn about numbers that may be in millimetres, grams or degrees, using the `reach` [m]."""
    if reach > TALL:
        text = f"bodies are up to {reach:.4g} m apart: are the lengths in millimetres?"
        report.add("warning", report.file, text)
    heaviest = max(model.bodies, key=lambda b: b.mass, default=None)
    if heaviest is not None and heaviest.mass > HEAVY:
        text = f"body '{heaviest.name}' has {heaviest.mass:.4g} kg: is its mass in grams?"
        report.add("warning", report.file, text, part=heaviest.name)
    for name, text in (*wide(model.bodies), *limits_in_degrees(model.bodies)):
        report.add("warning", report.file, f"body '{name}': {text}", part=name)


class MeshSize(NamedTuple):
    """The size of a mesh in the model."""

    where: str  # place in the file
    body: str
    name: str  # name of the mesh in the file
    size: float  # [m] largest extent


def suspect_meshes(report: Report, model: Model, reach: float, meshes: Iterable[MeshSize]) -> None:
    """Warn about meshes on moving bodies with sizes that suggest millimetres.

    The size of a robot is the `reach` of its joints [m], or the largest radius of gyration.
    """
    radii = (
        math.sqrt(abs(np.trace(np.array(body.inertia))) / 2 / body.mass)
        for body in model.bodies
        if body.mass > 0
    )
    robot = max((reach, *radii))
    still = {GROUND}
    for body in model.bodies:
        if body.joint == "weld" and body.parent in still:
            still.add(body.name)
    if len(still) > len(model.bodies):  # nothing moves
        still = {GROUND}
    for mesh in meshes:
        if robot > 0 and mesh.size > MILLI * robot and mesh.body not in still:
            text = (
                f"mesh {shown(mesh.name)} is {mesh.size:.4g} m long, {mesh.size / robot:.3g} times "
                "the size of the robot: is it in millimetres? Then its scale is 0.001"
            )
            report.add("warning", mesh.where, text, part=mesh.body)


def reach_of(bodies: Mapping[str, tuple[float, float, float]]) -> float:
    """Find the largest extent of a set of points [m]."""
    points = np.array([*bodies.values()]) if bodies else np.zeros((1, 3))
    return float(np.max(points.max(axis=0) - points.min(axis=0), initial=0.0))


# -- which files a model file may name -------------------------------------------------------------


MANIFEST = "package.xml"
MOST_FOLDERS = 10_000  # folders in which packages are looked for
MISSING = "the file does not exist"


class Folders:
    """The folders that contain the files of a model.

    A file may only name others in them, also through links. One that is `trusted`, since code in it
    is executed, may name all files.
    """

    def __init__(self, file: Path, roots: Iterable[str | Path] = (), *, trusted: bool = False):
        self.here, self.trusted = file.parent.absolute(), trusted
        given = [Path(root).absolute() for root in roots]
        self.package = self._package()
        self.allowed = [*given, self.package or self.here]

    def _package(self) -> Path | None:
        """Find the nearest folder with a package.xml, searching upwards from the file's."""
        for folder in (self.here, *self.here.parents):
            if (folder / MANIFEST).is_file():
                return folder
        return None

    def outside(self, path: Path) -> str:
        """Return the reason why a path may not be read after resolving links, or ""."""
        try:
            found = path.resolve()
        except (OSError, RuntimeError, ValueError):  # a circle of links, a name that is too long
            return MISSING
        if self.trusted or any(found.is_relative_to(root.resolve()) for root in self.allowed):
            return ""
        return f"it is in {found.parent}, outside {self.package or self.here}; {ALLOW}"

    def find(self, name: str) -> tuple[Path | None, str]:
        """Return (path, "") for a file named by a model, or (None, reason)."""
        if "\0" in name or not name:
            return None, "its name is empty or contains a NUL"
        for scheme in ("package://", "model://"):
            if name.startswith(scheme):
                # a folder of this name above the file or in a root
                rest = unquote(name[len(scheme) :]).lstrip("/")
                package, _, inside = rest.partition("/")
                tries = [self.packages[package] / inside] if package in self.packages else []
                for root in self.allowed:
                    if root.name == package or root == self.package:
                        tries.append(root / inside)
                    tries += [root / package / inside, root / inside]
                tries += [folder / inside for folder in self.here.parents if folder.name == package]
                return self._checked(tries)
        if name.startswith("file://"):
            name = unquote(name[len("file://") :])
        elif "://" in name:
            return None, "files are not downloaded; give a path"
        found = [self.here / name, *(root / name for root in self.allowed)]
        return self._checked(found if not Path(name).is_absolute() else [Path(name)])

    @cached_property
    def packages(self) -> dict[str, Path]:
        """The packages in the allowed folders by the names in their manifests.

        As in ROS, a package contains no other packages, and the first of a name counts.
        """
        found, seen = dict[str, Path](), 0
        for root in self.allowed:
            for folder, inside, files in os.walk(root):
                seen += 1
                if seen > MOST_FOLDERS:
                    return found
                inside[:] = sorted(name for name in inside if not name.startswith("."))
                if MANIFEST in files:
                    found.setdefault(_name_in(Path(folder, MANIFEST)), Path(folder))
                    inside.clear()
        return found

    def package_called(self, name: str) -> Path | None:
        """Return a package's folder, by its manifest, or by the name of a folder above the file or
        in a root."""
        tries = [self.packages[name]] if name in self.packages else []
        tries += [root for root in self.allowed if root.name == name]
        tries += [root / name for root in self.allowed]
        tries += [folder for folder in self.here.parents if folder.name == name]
        return next((folder for folder in tries if folder.is_dir()), None)

    def _checked(self, tries: list[Path]) -> tuple[Path | None, str]:
        outside = ""
        for path in tries:
            try:
                resolved = path.resolve()
                if not resolved.is_file():
                    continue
            except (OSError, RuntimeError):  # a circle of links, a name that is too long
                continue
            if not (why := self.outside(resolved)):
                return resolved, ""
            outside = outside or why
        return None, outside or MISSING


def _name_in(manifest: Path) -> str:
    """Return the name of a package, or "" if its manifest cannot be read."""
    try:
        name = read_markup(manifest).first("name")
    except FileError:
        return ""
    return name.text.strip() if name is not None else ""
