"""Checks that parts of several kinds share: names of bodies, coordinates and sums."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .. import joints, words
from ..errors import Problem, choices, counted
from ..fields import GROUND, OfSums, name_problem
from ..forces import Force
from .body import Body
from .constraint import Constraint
from .contact import Contact

Bodies = Mapping[str, Body | None]  # bodies by name, None for invalid ones
_TIED = {"constraint": "constrained to", "force": "tied to", "contact": "in contact with"}


def unique(kind: str, names: Iterable[str]) -> list[Problem]:
    """Return empty and duplicate names among constraints, forces or scenarios."""
    found: list[Problem] = []
    seen: set[str] = set()
    for i, name in enumerate(names):
        if text := name_problem(name):
            found.append(Problem(f"{kind} {i + 1}", "name", text))
        elif name in seen:
            text = f"another {kind} has this name; choose another name"
            found.append(Problem(f"{kind} '{name}'", "name", text))
        seen.add(name)
    return found


def unknown(name: str, bodies: Bodies, *others: str) -> str:
    """Return an error for a name that is neither a body nor in `others`, else ""."""
    if name in bodies or name in others:
        return ""
    text = "the ground does not move, so a force cannot act on the ground only" * (name == GROUND)
    text = text or f"no body is named '{name}'"
    return f"{text}; choose one of {choices((*others, *bodies))}"


def is_ground(name: Any) -> bool:
    """Check whether a name is that of the ground, or one that means it."""
    return name == GROUND or bool(words.chosen(name, (GROUND,)))


def pair_problems(
    part: Constraint | Force | Contact, where: str, bodies: Bodies, *anyone: str
) -> list[Problem]:
    """Check for unknown bodies in `body` and `other`, and for a body paired with itself.

    `anyone` contains names that represent bodies.
    """
    found = []
    body, other = part.pair
    for field, name, others in (("body", body, anyone), ("other", other, (GROUND, *anyone))):
        if field == "body" and is_ground(name) and name not in bodies and other != name:
            text = "the ground can be its `other` only; exchange the ends: "
            text += f"body={other!r}, other='ground', with their points and axes"
            found.append(Problem(where, field, text))
        elif text := unknown(name, bodies, *others):
            found.append(Problem(where, field, text))
    if body == other and body not in anyone and not part._fits_one_body:
        text = f"a body cannot be {_TIED[part.word()]} itself, got '{body}' twice"
        found.append(Problem(where, "other", text))
    return found


def problem_of_coordinate(body: Body, coordinate: int) -> str:
    """Return the problem with a coordinate that must have its own position, or ""."""
    if coordinate >= body.dof:
        return joints.no_coordinate(body.name, body.dof, coordinate)
    if not has_position(body, coordinate):
        known = [str(k) for k in range(body.dof) if has_position(body, k)]
        do = f"choose one of {choices(known)}" if known else "use kind 'orientation' or 'velocity'"
        return f"requires a rotate or translate motion, which has a single coordinate; {do}"
    return ""


def sum_problems(
    part: OfSums, where: str, bodies: Bodies, of_positions: bool, *, ours: bool = False
) -> list[Problem]:
    """Return problems with the coefficients in a sum. If `ours` is given, only check sums that
    involve these bodies.

    A sum of positions (`of_positions`) has no terms of balls and free joints.
    """
    found = []
    for name, values in part.coefficients.items():
        if ours and name not in bodies:
            continue
        text, body = unknown(name, bodies), bodies.get(name)
        if body is not None and len(values) != body.dof:
            text = f"the joint of '{name}' takes {counted(body.dof, 'number')}, got {len(values)}"
        elif body is not None and of_positions:
            bad = (problem_of_coordinate(body, k) for k, x in enumerate(values) if x)
            text = next(filter(None, bad), "")
        if text:
            found.append(Problem(where, "coefficients", text))
    return found


def has_position(body: Body, coordinate: int) -> bool:
    kinds = [m.kind for m in body.sequence for _ in range(joints.SIZE[m.kind][1])]
    return kinds[coordinate] in joints.AXIAL
