"""What makes a description a multibody system: the checks, each answering with a sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .. import joints
from ..errors import Problem, choices
from ..joints import Motion
from .fields import shown

if TYPE_CHECKING:
    from .body import Body
    from .constraint import Constraint
    from .force import Force
    from .model import Model
    from .scenario import Scenario

GROUND = "ground"
TRIANGLE = 1e-9  # relative slack of the inertia's symmetry and triangle inequality

Finding = tuple[str, str]  # (field, sentence)


def body_problems(body: Body) -> list[Finding]:
    """What is wrong with one row by itself."""
    return [*_joint_problems(body), *_inertia_problems(body)]


def _joint_problems(body: Body) -> list[tuple[str, str]]:
    """What is wrong with the name, the axes, the initial state and the joint's own physics."""
    found: list[tuple[str, str]] = []
    motions = body.sequence
    if not body.name.strip():
        found.append(("name", f"must be text that is not empty; given {shown(body.name)}"))
    if body.name == GROUND:
        found.append(("name", "'ground' is the name of the ground; choose another"))
    if body.joint != "compound" and _kinds(motions) != _kinds(joints.DEFAULT[body.joint]):
        found.append(("motions", f"are not those of a {body.joint} joint; use joint 'compound'"))
    if any(m.kind == "free" for m in motions) and len(motions) > 1:
        found.append(("motions", "a free motion stands alone; use ball and translate motions"))
    if joints.nv(motions) > 6:
        found.append(("motions", f"give {joints.nv(motions)} degrees of freedom; at most 6"))
    for m in motions:
        if m.kind in ("rotate", "translate") and not 1e-9 < math.hypot(*m.axis) < 1e9:
            found.append(("axes", f"a direction must not be zero; given {list(m.axis)}"))
    if not 0.5 < math.hypot(*body.rotation) < 2:
        found.append(("rotation", f"must be a unit quaternion [w, x, y, z]; given {body.rotation}"))
    for name, length in (("q", joints.nq(motions)), ("v", joints.nv(motions))):
        value = getattr(body, name)
        if len(value) != length:
            found.append((name, f"a {body.joint} joint has {length} numbers; given {len(value)}"))
        elif name == "q":
            found += _quaternion_problems(value, motions)
    for name in ("stiffness", "damping", "rest", "armature"):
        found += _physics_problems(name, getattr(body, name), motions)
    return found


def _kinds(motions: tuple[Motion, ...]) -> tuple[str, ...]:
    return tuple(m.kind for m in motions)


def _quaternion_problems(
    q: tuple[float, ...], motions: tuple[Motion, ...]
) -> list[tuple[str, str]]:
    found, start = [], 0
    for m in motions:
        size = joints.SIZE[m.kind][0]
        if m.kind in ("ball", "free"):
            quaternion = q[start + size - 4 : start + size]
            if abs(math.hypot(*quaternion) - 1) > 1e-3:
                found.append(("q", f"needs a unit quaternion [w, x, y, z]; given {quaternion}"))
        start += size
    return found


def _physics_problems(
    name: str, values: tuple[float, ...], motions: tuple[Motion, ...]
) -> list[tuple[str, str]]:
    if len(values) != len(motions):
        return [(name, f"give one number, or one for each of {len(motions)} motions")]
    if name != "rest" and any(x < 0 for x in values):
        return [(name, f"must be >= 0; given {list(values)}")]
    springs = name in ("stiffness", "rest")
    if springs and any(x and m.kind in ("ball", "free") for x, m in zip(values, motions)):
        return [(name, "a spring acts on a rotate or translate motion, not on a ball or free one")]
    return []


def _inertia_problems(body: Body) -> list[tuple[str, str]]:
    """Symmetry, positive semidefiniteness and the triangle inequality of the inertia."""
    inertia = body.inertia
    size = max(abs(x) for row in inertia for x in row)
    if any(
        abs(inertia[i][j] - inertia[j][i]) > TRIANGLE * size for i, j in ((0, 1), (0, 2), (1, 2))
    ):
        return [("inertia", f"must be symmetric; given {[list(row) for row in inertia]}")]
    a, b, c = principal_moments(inertia)
    slack = TRIANGLE * size
    if a < -slack:
        return [
            (
                "inertia",
                f"must be positive semidefinite; its smallest principal moment is {a:.6g} kg m^2",
            )
        ]
    if a + b < c - slack:
        return [
            (
                "inertia",
                f"breaks the triangle inequality: principal moments {a:.6g} + {b:.6g} < {c:.6g} by "
                f"{c - a - b:.3g} kg m^2; no rigid body has it",
            )
        ]
    return []


def principal_moments(inertia: tuple[tuple[float, ...], ...]) -> tuple[float, float, float]:
    """Eigenvalues of a symmetric 3x3 matrix, ascending."""
    (a, d, e), (_, b, f), (_, _, c) = inertia
    if d == e == f == 0.0:
        low, middle, high = sorted((a, b, c))
        return low, middle, high
    low, middle, high = np.linalg.eigvalsh(np.array(inertia))
    return float(low), float(middle), float(high)


def tree_problems(names: Sequence[str], parents: Sequence[str]) -> list[Problem]:
    """Duplicate names, unknown parents and cycles of the table."""
    found: list[Problem] = []
    row: dict[str, int] = {}
    for i, name in enumerate(names):
        if name in row:
            text = f"'{name}' is already the name of row {row[name] + 1}; choose another"
            found.append(Problem(f"row {i + 1}", "name", text))
        row.setdefault(name, i)
    for name, parent in zip(names, parents):
        if parent != GROUND and parent not in row:
            text = f"no body is named {shown(parent)}; choose one of {choices((GROUND, *row))}"
            found.append(Problem(f"body '{name}'", "parent", text))
    return found + [_cycle_problem(cycle) for cycle in _cycles(names, parents, row)]


def _cycle_problem(cycle: list[str]) -> Problem:
    if len(cycle) == 1:
        text = f"a body cannot be its own parent; given '{cycle[0]}'; choose another, or ground"
    else:
        text = f"closes a cycle: {' -> '.join([*cycle, cycle[0]])}; tie one of them to the ground"
    return Problem(f"body '{cycle[0]}'", "parent", text)


def _cycles(names: Sequence[str], parents: Sequence[str], row: dict[str, int]) -> list[list[str]]:
    """Each cycle once, as the names along it; O(n)."""
    state = dict.fromkeys(names, 0)  # 0 new, 1 on the present path, 2 done
    cycles = []
    for start in names:
        path = []
        name = start
        while name in state and state[name] == 0:
            state[name] = 1
            path.append(name)
            name = parents[row[name]]
        if name in state and state[name] == 1:
            cycles.append(path[path.index(name) :])
        state.update(dict.fromkeys(path, 2))
    return cycles


def unique(kind: str, names: Iterable[str]) -> list[Problem]:
    """Empty and duplicate names of constraints, forces, scenarios."""
    found: list[Problem] = []
    seen: set[str] = set()
    for i, name in enumerate(names):
        if not name.strip():
            found.append(Problem(f"{kind} {i + 1}", "name", "must be text that is not empty"))
        elif name in seen:
            text = f"another {kind} has this name; choose another name"
            found.append(Problem(f"{kind} '{name}'", "name", text))
        seen.add(name)
    return found


def constraint_problems(items: Sequence[Constraint], bodies: dict[str, Body]) -> list[Problem]:
    """Unknown bodies, and a body constrained to itself."""
    found = unique("constraint", [c.name for c in items])
    for c in items:
        where = f"constraint '{c.name}'"
        for field, name in (("body", c.body), ("other", c.other)):
            if name not in bodies and not (field == "other" and name == GROUND):
                text = f"no body is named '{name}'; choose one of {choices(bodies)}"
                found.append(Problem(where, field, text))
        if c.body == c.other:
            text = f"a body cannot be constrained to itself; given '{c.body}' twice"
            found.append(Problem(where, "other", text))
    return found


def force_problems(items: Sequence[Force], bodies: dict[str, Body], of: str = "") -> list[Problem]:
    """Unknown bodies, coordinates that a joint lacks, a servo on a ball's angle."""
    found = unique("force", [f.name for f in items])
    for f in items:
        where = f"{of}force '{f.name}'"
        if f.body not in bodies:
            text = f"no body is named '{f.body}'; choose one of {choices(bodies)}"
            found.append(Problem(where, "body", text))
            continue
        body = bodies[f.body]
        if f.coordinate >= body.dof:
            text = (
                f"the joint of '{f.body}' has {body.dof} degrees of freedom; given {f.coordinate}"
            )
            found.append(Problem(where, "coordinate", text))
        elif f.kp and not _has_position(body, f.coordinate):
            text = "a servo's kp needs a rotate or translate motion; a ball has no single angle"
            found.append(Problem(where, "kp", text))
    return found


def _has_position(body: Body, coordinate: int) -> bool:
    kinds = [m.kind for m in body.sequence for _ in range(joints.SIZE[m.kind][1])]
    return kinds[coordinate] in ("rotate", "translate")


def scenario_problems(
    items: Sequence[Scenario], bodies: dict[str, Body], constraints: Sequence[Constraint]
) -> list[Problem]:
    """Unknown bodies and constraints, states of the wrong length, and its forces' own problems."""
    found = unique("scenario", [s.name for s in items])
    known = {c.name for c in constraints}
    for s in items:
        where = f"scenario '{s.name}'"
        for field, state, size in (("q", s.q, joints.nq), ("v", s.v, joints.nv)):
            for name, values in state.items():
                if name not in bodies:
                    text = f"no body is named '{name}'; choose one of {choices(bodies)}"
                    found.append(Problem(where, field, text))
                elif len(values) != size(bodies[name].sequence):
                    text = (
                        f"'{name}' has {size(bodies[name].sequence)} numbers; given {len(values)}"
                    )
                    found.append(Problem(where, field, text))
        for name in s.constraints or ():
            if name not in known:
                listed = choices(sorted(known)) or "none: the model has no constraint"
                text = f"no constraint is named '{name}'; choose {listed}"
                found.append(Problem(where, "constraints", text))
        found += force_problems(s.forces, bodies, f"{where}, ")
    return found


def reference_problems(
    bodies: Sequence[Body],
    constraints: Sequence[Constraint],
    forces: Sequence[Force],
    scenarios: Sequence[Scenario],
) -> list[Problem]:
    """What is wrong with the names by which valid parts refer to each other."""
    by_name = {body.name: body for body in bodies}
    return [
        *constraint_problems(constraints, by_name),
        *force_problems(forces, by_name),
        *scenario_problems(scenarios, by_name, constraints),
    ]


def model_problems(model: Model) -> list[Problem]:
    """What is wrong between the parts of a model, each valid by itself."""
    bodies = model.bodies
    return [
        *tree_problems([b.name for b in bodies], [b.parent for b in bodies]),
        *reference_problems(bodies, model.constraints, model.forces, model.scenarios),
    ]
