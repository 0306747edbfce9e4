"""Arguments of `pgraph convert` for CAD assemblies: densities, fixed parts, accepted joints."""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from typing import Any

import pgraph_core as pg
from pgraph_core.errors import InputError, Problem, shown
from pgraph_core.model.files import FOREIGN

from .terminal import model_path, names, positive, takes, whole


def _density(text: str) -> tuple[str, float]:
    """Parse 7850 or NAME=7850."""
    name, mark, value = text.rpartition("=")
    return name if mark else "*", positive(value)


def _choice(text: str) -> list[tuple[int, str]]:
    """Parse 1,3=prismatic: the numbers of joints, and the kinds of those that are changed."""
    found = list[tuple[int, str]]()
    for one in names(text):
        number, _, kind = one.partition("=")
        if not (number.isascii() and number.isdigit()):
            raise ArgumentTypeError(
                f"must be numbers of joints such as 1,3=prismatic, got {text!r}"
            )
        found.append((int(number), kind))
    return found


CAD = (
    takes("--accept", action="store_true", help="STEP files: accept the joints that are proposed"),
    takes(
        "--joints", type=_choice, metavar="N,N=KIND",
        help="STEP files: accept the proposed joints of these numbers, some as another kind",
    ),
    takes(
        "--density", type=_density, action="append", default=[], metavar="[PART=]NUMBER",
        help="STEP files: density of all parts or of one [kg/m^3]; may be repeated",
    ),
    takes(
        "--fixed", action="append", default=[], metavar="PART",
        help="STEP files: a part that is welded to the ground; may be repeated",
    ),
    takes(
        "--tolerance", type=positive, metavar="NUMBER",
        help="STEP files: largest distance of features that are at one place [m]",
    ),
    takes(
        "--seconds", type=whole(1), default=60, metavar="N",
        help="STEP files: limit on the processor time of reading; default: 60",
    ),
)  # fmt: skip


def is_cad(args: Namespace) -> bool:
    """Check whether the given file is a STEP file. Raises InputError for arguments of those."""
    path = model_path(args.model)
    if FOREIGN.get(path.suffix.lower()) == "step":
        return True
    for name in ("accept", "joints", "density", "fixed", "tolerance"):
        if getattr(args, name):
            text = f"is for STEP files, got {shown(path.name)}"
            raise InputError(Problem("pgraph convert", f"--{name}", text))
    return False


def assembly(args: Namespace) -> tuple[pg.Model, Any]:
    """Return (model, report) of a STEP file with the accepted joints. Raises PgraphError."""
    from pgraph_core.formats.step import assembled, examined
    from pgraph_core.formats.step_model import StepReport, densities_by_name

    path, densities = model_path(args.model), densities_by_name(dict(args.density))
    found, proposals = examined(path, args.tolerance, args.seconds)
    report = StepReport(path.name, joints=proposals)
    args.taken = _taken(args, proposals)
    model = assembled(found, [*args.taken.values()], densities, args.fixed, report)
    return report.attached_to(model), report


def _taken(args: Namespace, proposals: list[pg.Proposal]) -> dict[int, pg.Proposal]:
    """Return the accepted joints by their numbers, counted from 1."""
    numbered = dict(enumerate(proposals, 1))
    found = {n: joint for n, joint in numbered.items() if args.accept and joint.selected}
    for number, kind in args.joints or ():
        if number not in numbered:
            text = f"{len(numbered)} joints are proposed, counted from 1; got {number}"
            raise InputError(Problem("pgraph convert", "--joints", text))
        joint = numbered[number]
        found[number] = joint.changed(kind) if kind else joint
    return found


def listed(args: Namespace, report: Any) -> list[str]:
    """Return a line for each proposed joint, with its number."""
    lines = [f"{len(report.joints)} proposed joints; + is accepted:"]
    for number, joint in enumerate(report.joints, 1):
        mark = "+" if number in args.taken else " "
        lines.append(f"{mark} {number:3} {args.taken.get(number, joint)}")
    return lines if report.joints else ["no joints are proposed"]
