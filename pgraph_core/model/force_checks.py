"""Checks of forces against the bodies on which they act."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from .. import joints
from ..errors import Problem, shown
from ..fields import GROUND, OfSums
from ..forces import BetweenPoints, Force, OnJoint, Shift, Tendon, Within, legs_of
from ..signals import written
from ..stateful import Stateful
from .constraint import Constraint
from .control import Control
from .part_checks import Bodies, has_position, pair_problems, sum_problems, unique, unknown
from .scenario import Scenario


def force_problems(items: Sequence[Force], bodies: Bodies, of: str = "") -> list[Problem]:
    """Check forces for unknown bodies, invalid joint coordinates and servos on a ball's angle."""
    found = unique("force", [f.name for f in items])
    for f in items:
        where = f"{of}force '{f.name}'"
        springs = isinstance(f, Tendon) or (isinstance(f, OnJoint) and f.law.kp != 0)
        if isinstance(f, OfSums) and f.coefficients:
            found += sum_problems(f, where, bodies, springs)
            continue
        if not isinstance(f, OnJoint):
            found += pair_problems(f, where, bodies) + path_problems(f, where, bodies)
            continue
        if text := unknown(f.body, bodies):
            found.append(Problem(where, "body", text))
            continue
        body = bodies[f.body]
        if body is None:
            continue
        if f.coordinate >= body.dof:
            text = joints.no_coordinate(f.body, body.dof, f.coordinate)
            found.append(Problem(where, "coordinate", text))
        elif springs and not has_position(body, f.coordinate):
            text = "kp of a servo requires a rotate or translate motion, not a ball joint"
            found.append(Problem(where, "kp", text))
    return found


def muscle_problems(
    forces: Sequence[Force], controls: Sequence[Control], scenarios: Sequence[Scenario]
) -> list[Problem]:
    """Check that each `x.NAME` means one part, and that muscles belong to the model."""
    known, found = {c.name for c in controls}, list[Problem]()
    for f in forces:
        if isinstance(f, Stateful) and f.name in known:
            text = f"a control is also called {shown(f.name)}, and {written('x', f.name)} would "
            found.append(Problem(f"force '{f.name}'", "name", f"{text}mean both; rename one"))
    for s in scenarios:
        for f in s.forces:
            if isinstance(f, Stateful):
                text = f"a {f.own_kind()} has states and belongs to the forces of the model; in a "
                text += "scenario, let its excitation depend on time, or give `inputs` to the run"
                found.append(Problem(f"scenario '{s.name}', force '{f.name}'", "kind", text))
    return found


def place_problems(part: Constraint | Force, where: str, bodies: Bodies) -> list[Problem]:
    """Check the points of further bodies for unknown bodies."""
    return [
        Problem(where, field, f"point {k}: {text}")
        for field in part.PLACES
        for k, place in enumerate(getattr(part, field), start=1)
        if (text := unknown(place.body, bodies, GROUND))
    ]


def riding_problems(f: Force, where: str, bodies: Bodies) -> list[Problem]:
    """Check the coordinates with which points of a path ride."""
    if not isinstance(f, BetweenPoints):
        return []
    own: list[tuple[str, str, Any]] = [
        ("shifts", "", f.shifts),
        ("other_shifts", "", f.other_shifts),
    ]
    for k, via in enumerate(f.via, start=1):
        own.append(("via", f"point {k}: ", (*via.shifts, *([via.when] if via.when else ()))))
    found = list[Problem]()
    for field, at, parts in own:
        for one in parts:
            if text := coordinate_problem(one, bodies):
                found.append(Problem(where, field, f"{at}{text}"))
    return found


def coordinate_problem(one: Shift | Within, bodies: Bodies) -> str:
    """Return why a point of a path cannot ride with a coordinate, or ""."""
    if text := unknown(one.body, bodies):
        return text
    body = bodies[one.body]
    if body is None:
        return ""
    if one.coordinate >= body.dof:
        return joints.no_coordinate(one.body, body.dof, one.coordinate)
    if not has_position(body, one.coordinate):
        text = f"coordinate {one.coordinate} of '{one.body}' is of a ball or free joint and has no "
        return text + "value; name a hinge, slider, screw or curve"
    return ""


def path_problems(f: Force, where: str, bodies: Bodies) -> list[Problem]:
    """Check a path for unknown bodies, for spans without a length and for a constant length."""
    found = place_problems(f, where, bodies) + riding_problems(f, where, bodies)
    body = bodies.get(f.body)
    if found or not isinstance(f, BetweenPoints) or not f.via or body is None or f._rides:
        return found
    if {via.body for via in f.via} == {f.body} == {f.other}:
        text = f"all its points are on '{f.body}', so that its length is constant; put one of them "
        return [Problem(where, "via", f"{text}on another body or on the ground")]
    points = [k for k, via in enumerate(f.via, start=1) if not via.is_obstacle]
    names = ["point", *(f"point {k} of via" for k in points), "other_point"]
    for k, ((one, a), past, (two, b)) in enumerate(legs_of(f, body)):
        if not past and one == two and tuple(a) == tuple(b):
            text = f"{names[k]} and {names[k + 1]} are the same point {shown(tuple(a))} of '{one}'"
            found.append(Problem(where, "via", f"{text}; take one of them out or move it"))
    return found


def late_limits(forces: Iterable[Force], of: str = "") -> list[Problem]:
    """Return problems of forces outside the model whose limits act in the whole model."""
    text = "the limits of a {0} only act if it is part of the model; add the {0} to the model"
    return [
        Problem(f"{of}force '{f.name}'", "low", text.format(f.kind)) for f in forces if f._bounds
    ]
