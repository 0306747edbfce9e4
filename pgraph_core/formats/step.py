"""The reader of STEP files, which CAD systems write: bodies with exact masses, proposed joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

from ..children import MOST_MEMORY, Child
from ..errors import FileError, InputError, Problem, explained, shown
from ..model import Model
from .step_joints import Proposal, proposed
from .step_model import CALL, StepReport, densities_by_name, model_of
from .step_parts import Parts, content_of_step, parts_of

SECONDS = 60  # [s] processor time of a reader, unless another limit is given
PATIENCE = 5  # limit on wall time relative to it, for a busy machine


@explained
def read_step(
    path: str | Path,
    *,
    density: float | Mapping[str, float] | None = None,
    joints: Literal["propose", "accept"] | Iterable[Proposal] = "propose",
    fixed: Iterable[str] = (),
    tolerance: float | None = None,
    seconds: int = SECONDS,
) -> tuple[Model, StepReport]:
    """Read a STEP file as bodies with exact mass properties, and propose their joints.

    STEP files have no joints. They are proposed from cylinders, spheres and planes that fit or
    touch, and none is taken unless it is accepted. A part without an accepted joint is free.

    Parameters
    ----------
    path : path
        The file.
    density : float or dict, optional
        Density of all parts [kg/m^3], or of parts by their names, where "*" stands for the others.
        The default is that of the file's materials, or that of water, with a warning.
    joints : {"propose", "accept"} or iterable of Proposal
        Whether no joint is taken, those that are selected by default, or these.
    fixed : iterable of str, optional
        Names of the parts that are welded to the ground. The default is the heaviest body if any
        joint is accepted.
    tolerance : float, optional
        Largest distance of features that are at one place [m]. The default is that of the file, or
        1e-6 of the size of the assembly if that is larger.
    seconds : int
        Limit on the processor time of the process that reads the file.

    Returns
    -------
    model : Model
        The model, with one body for all parts that are welded to each other.
    report : Report
        Omissions and warnings, the proposed `joints`, and the largest distance by which parts were
        `moved` so that the joints meet [m].

    Raises
    ------
    FileError
        If the file cannot be read.
    InputError
        If an argument is invalid or names a part that does not exist.
    MissingPackage
        If the package cadquery-ocp is needed and is not installed.

    Examples
    --------
    >>> model, report = pg.read_step("press.step", density=7850)  # doctest: +SKIP
    >>> chosen = [joint for joint in report.joints if joint.gap < 1e-5]  # doctest: +SKIP
    >>> model, report = pg.read_step("press.step", joints=chosen)  # doctest: +SKIP
    """
    if isinstance(fixed, str):
        fixed = (fixed,)
    path, densities, chosen = Path(path), densities_by_name(density), _chosen(joints)
    found, proposals = examined(path, tolerance, seconds)
    report = StepReport(path.name, joints=proposals)
    model = assembled(found, _accepted(chosen, proposals, found), densities, fixed, report)
    return report.attached_to(model), report


def examined(path: Path, tolerance: float | None, seconds: int) -> tuple[Parts, list[Proposal]]:
    """Return the parts of a file and the joints between them, found by a child process.

    Raises FileError.
    """
    if tolerance is not None and not 0 < tolerance < 1:
        text = f"must be a number > 0 and < 1 [m], got {shown(tolerance)}"
        raise InputError(Problem(CALL, "tolerance", text))
    if isinstance(seconds, bool) or not isinstance(seconds, int) or seconds < 1:
        text = f"must be a whole number >= 1, got {shown(seconds)}"
        raise InputError(Problem(CALL, "seconds", text))
    content_of_step(path)  # no process is started for a file that is none
    try:
        return Child(partial(looked_at, path, tolerance), seconds).result(PATIENCE)
    except TimeoutError:
        text = f"takes more than {seconds} s to read; give more: seconds={10 * seconds}"
    except (ChildProcessError, MemoryError):
        most = f"{MOST_MEMORY / 2**30:.0f} GB"
        text = f"is damaged, or needs more than {most} of memory; export a part of the assembly"
    raise FileError(Problem(path.name, "", text))


def looked_at(path: Path, tolerance: float | None) -> tuple[Parts, list[Proposal]]:
    """Return the parts of a file and the joints between them. Raises FileError, MissingPackage."""
    found = parts_of(path, tolerance)
    proposals = proposed(found.parts, found.tolerance)
    return found.unfaced(), proposals


def assembled(
    found: Parts,
    accepted: list[Proposal],
    densities: Mapping[str, float],
    fixed: Iterable[str],
    report: StepReport,
) -> Model:
    """Return the model of parts with accepted joints, and complete the report on it."""
    for kind, part, text in found.notes:
        line = f"'{part}' {text}" if part else text
        report.add(kind, report.file, line, acts=kind == "left out", part=part)
    model = model_of(found, accepted, densities, fixed, report)
    count = len(report.joints)
    if count and not accepted:
        text = f"{count} joints are proposed and none is accepted: all parts are free"
        report.add("warning", report.file, f"{text}; accept them by joints=report.joints")
    lengths = found.unit or "millimetres, since the file names no unit"
    text = f"{len(found.parts)} parts, {len(accepted)} of {count} proposed joints; lengths in "
    report.add("read", report.file, text + lengths)
    return model


def _chosen(given: Any) -> str | list[Proposal]:
    """Return the argument `joints`, a list where it is one. Raises InputError."""
    if isinstance(given, str) and given in ("propose", "accept"):
        return given
    many = isinstance(given, Iterable) and not isinstance(given, str)
    listed: list[Any] = [*given] if many else []
    if not (many and all(isinstance(x, Proposal) for x in listed)):
        text = "must be 'propose', 'accept' or a list of report.joints, got "
        raise InputError(Problem(CALL, "joints", text + shown(given)))
    for joint in listed:
        joint.changed(joint.kind)
    return listed


def _accepted(
    chosen: str | list[Proposal], proposals: list[Proposal], found: Parts
) -> list[Proposal]:
    """Return the accepted joints. Raises InputError where the file does not have their parts."""
    if isinstance(chosen, str):
        return [joint for joint in proposals if joint.selected and chosen == "accept"]
    names = {part.name for part in found.parts}
    for joint in chosen:
        if gone := next((name for name in joint.bodies if name not in names), None):
            text = f"name the part {shown(gone)}, which the file does not have"
            raise InputError(Problem(CALL, "joints", text))
    return chosen
