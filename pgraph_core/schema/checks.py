"""What makes parts a multibody system: the tree, and the names by which parts refer to others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from .. import joints
from ..errors import Problem, choices
from .body_checks import quaternion_problems
from .names import GROUND, name_problem, numbers
from .sentences import shown

if TYPE_CHECKING:
    from .body import Body
    from .constraint import Constraint
    from .force import Force
    from .model import Model
    from .scenario import Scenario

Bodies = Mapping[str, "Body | None"]  # by name; None for one that is not valid itself


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
            found.append(Problem(f"body {shown(name)}", "parent", text))
    return found + [_cycle_problem(cycle) for cycle in _cycles(names, parents, row)]


def _cycle_problem(cycle: list[str]) -> Problem:
    if len(cycle) == 1:
        text = f"a body cannot be its own parent; given '{cycle[0]}'; choose another, or ground"
    else:
        path = " -> ".join([*cycle[:12], "..."] if len(cycle) > 12 else [*cycle, cycle[0]])
        text = f"closes a cycle: {path}; tie one of them to the ground"
    return Problem(f"body '{cycle[0]}'", "parent", text)


def _cycles(names: Sequence[str], parents: Sequence[str], row: dict[str, int]) -> list[list[str]]:
    """Each cycle once, as the names along it; O(n)."""
    state = dict.fromkeys(
        (name for name in names if name != GROUND), 0
    )  # 0 new, 1 on the present path, 2 done
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
        if text := name_problem(name):
            found.append(Problem(f"{kind} {i + 1}", "name", text))
        elif name in seen:
            text = f"another {kind} has this name; choose another name"
            found.append(Problem(f"{kind} '{name}'", "name", text))
        seen.add(name)
    return found


def constraint_problems(items: Sequence[Constraint], bodies: Bodies) -> list[Problem]:
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


def force_problems(items: Sequence[Force], bodies: Bodies, of: str = "") -> list[Problem]:
    """Unknown bodies, coordinates that a joint lacks, a servo on a ball's angle."""
    found = unique("force", [f.name for f in items])
    for f in items:
        where = f"{of}force '{f.name}'"
        if f.body not in bodies:
            text = f"no body is named '{f.body}'; choose one of {choices(bodies)}"
            found.append(Problem(where, "body", text))
            continue
        body = bodies[f.body]
        if body is None:
            continue
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
    items: Sequence[Scenario], bodies: Bodies, constraints: Sequence[str]
) -> list[Problem]:
    """Unknown bodies and constraints, states of the wrong length, and its forces' own problems."""
    found = unique("scenario", [s.name for s in items])
    for s in items:
        where = f"scenario '{s.name}'"
        for field, state in (("q", s.q), ("v", s.v)):
            for name, values in state.items():
                texts = state_problems(field, name, values, bodies)
                found += [Problem(where, field, text) for text in texts]
        for i, name in enumerate(s.constraints or ()):
            if name not in constraints:
                known = choices(constraints)
                do = f"choose one of {known}" if known else "the model has no constraint"
                text = f"no constraint is named '{name}'; {do}"
                found.append(Problem(where, "constraints", text))
            elif s.constraints and name in s.constraints[:i]:
                found.append(Problem(where, "constraints", f"'{name}' stands there twice"))
        found += force_problems(s.forces, bodies, f"{where}, ")
    return found


def state_problems(field: str, name: str, values: tuple[float, ...], bodies: Bodies) -> list[str]:
    """What is wrong with the q or v that a scenario gives a body."""
    if name not in bodies:
        return [f"no body is named '{name}'; choose one of {choices(bodies)}"]
    body = bodies[name]
    if body is None:
        return []
    length = (joints.nq if field == "q" else joints.nv)(body.sequence)
    if len(values) != length:
        return [f"'{name}' has {numbers(length)}; given {len(values)}"]
    if field == "v":
        return []
    return [f"'{name}' {text}" for _, text in quaternion_problems(values, body.sequence)]


def reference_problems(
    bodies: Bodies,
    constraints: Sequence[Constraint],
    forces: Sequence[Force],
    scenarios: Sequence[Scenario],
    constraint_names: Sequence[str],
) -> list[Problem]:
    """What is wrong with the names by which parts refer to each other."""
    return [
        *constraint_problems(constraints, bodies),
        *force_problems(forces, bodies),
        *scenario_problems(scenarios, bodies, constraint_names),
    ]


def model_problems(model: Model) -> list[Problem]:
    """What is wrong between the parts of a model, each valid by itself."""
    bodies = model.bodies
    return [
        *tree_problems([b.name for b in bodies], [b.parent for b in bodies]),
        *reference_problems(
            {b.name: b for b in bodies},
            model.constraints,
            model.forces,
            model.scenarios,
            [c.name for c in model.constraints],
        ),
    ]
